"""What gyros and accelerometers say over each interval between rows, with the time stamps as logged."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ...models.attitude import MAX_INCREMENT
from ...models.effects import MotionRows
from ..attitude.sampling import RATE_MEANINGS
from ..errors import InputError, nearest
from ..records import StrapdownRecord
from .sampling import GAP, Sampling


@dataclass(frozen=True, eq=False)
class Motion:
    """Means over the interval that ends at each row; row 0 has none, and stands for the first of them.

    Attributes
    ----------
    period : float
        median time between rows [s]
    time_s : (N,) array
        [s]
    step : (N,) array
        length of the interval [s]; the period over gaps
    rate : (N, 3) array
        mean reading of the gyros [rad/s]
    specific_force : (N, 3) array
        readings of the accelerometers at the rows [m/s²]
    gravity : float
        model value [m/s²]
    temperature : (N,) array or None
        [°C]
    """

    period: float
    time_s: NDArray[np.float64]
    step: NDArray[np.float64]
    rate: NDArray[np.float64]
    specific_force: NDArray[np.float64]
    gravity: float
    temperature: NDArray[np.float64] | None

    def __len__(self) -> int:
        return len(self.time_s)

    @property
    def increments(self) -> NDArray[np.float64]:
        """Integrals (N - 1, 3) of the readings over the intervals [rad]."""
        return self.rate[1:] * self.step[1:, None]

    def part(self, begin: int, end: int) -> "Motion":
        """The rows begin to end."""
        rows = slice(begin, end)
        temperature = None if self.temperature is None else self.temperature[rows]
        force = self.specific_force[rows]
        return replace(
            self,
            time_s=self.time_s[rows],
            step=self.step[rows],
            rate=self.rate[rows],
            specific_force=force,
            temperature=temperature,
        )

    def force(self, rows: slice | NDArray) -> NDArray[np.float64]:
        """Readings of the accelerometers at some rows [g]."""
        return self.specific_force[rows] / self.gravity

    def rows(self, begin: int, end: int, matrix: NDArray, bias: NDArray) -> MotionRows:
        """Rows begin to end as the effects see them, with (I + Γ)⁻¹ (3, 3) and a bias (3,) [rad/s] taken out."""
        first = max(begin - 1, 0)
        force = 0.5 * (self.force(slice(begin, end)) + self.force(slice(first, first + end - begin)))
        rate = (self.rate[first:end] - bias) @ matrix.T
        before = rate[:-1] if first < begin else np.vstack([rate[:1], rate[:-1]])
        return MotionRows(
            rate=rate[begin - first :],
            rate_before=before,
            specific_force=force,
            hours=(self.time_s[begin:end] - self.time_s[0]) / 3600.0,
            step=self.step[begin:end],
            temperature=None if self.temperature is None else self.temperature[begin:end],
            period=self.period,
        )


def motion_of(record: StrapdownRecord, sampling: Sampling, gravity: float, rates: str = "instantaneous") -> Motion:
    """The means of a record over its intervals.

    Parameters
    ----------
    record : StrapdownRecord
    sampling : Sampling
        of that record
    gravity : float
        model value [m/s²]
    rates : "instantaneous" or "averaged"
        samples of the rate (trapezoid rule), or means over the interval that ends at the row's time

    Raises
    ------
    InputError
        an unknown meaning of the rates, or a turn by more than half a turn between two rows
    """
    if rates not in RATE_MEANINGS:
        raise InputError(f"rates '{rates}' are not known; {nearest(rates, RATE_MEANINGS)}")
    step = np.concatenate([[sampling.period], np.diff(record.time_s)])
    if record.increment is not None:
        rate = record.increment / step[:, None]
    elif rates == "averaged":
        assert record.rate is not None
        rate = record.rate
    else:
        assert record.rate is not None
        rate = np.vstack([record.rate[:1], 0.5 * (record.rate[1:] + record.rate[:-1])])
    step[step > GAP * sampling.period] = sampling.period
    size = np.linalg.norm(rate[1:], axis=1) * step[1:]
    long = np.flatnonzero(~(size <= MAX_INCREMENT))
    if long.size:
        k = int(long[0]) + 1
        raise InputError(
            f"{record.path}, row {int(record.row[k])}: a turn of {size[k - 1]:.6g} rad since the row before; "
            f"at most half a turn ({MAX_INCREMENT:.6g} rad) can be told: are the rates in rad/s?"
        )
    return Motion(sampling.period, record.time_s, step, rate, record.specific_force, gravity, record.temperature)
