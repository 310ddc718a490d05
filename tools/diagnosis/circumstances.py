"""What effects may depend on beside the angles: time, temperature, senses of the last moves."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ..records import PositionRecord


@dataclass(frozen=True)
class Circumstances:
    """The circumstances of each of N rows.

    Attributes
    ----------
    hours : (N,) array
        time since the first row of the record [h]
    temperature : (N,) array or None
        [degC]
    sense_alpha, sense_beta : (N,) array
        sense of the last move of each axis: +1, -1, or 0 where there was none
    approached : bool
        whether the senses are the record's own, not concluded from the row before
    before : (N, 2) array or None
        encoder readings [rad] of the row before each; NaN where there is none, or another mounting; None where the
        rows follow no order
    temperature_resolution : float
        half a last digit of the temperature as it was written [K]
    """

    hours: NDArray
    temperature: NDArray | None
    sense_alpha: NDArray
    sense_beta: NDArray
    approached: bool
    before: NDArray | None = None
    temperature_resolution: float = 0.0

    def selected(self, rows: NDArray) -> "Circumstances":
        """The circumstances of some rows (n,) of int."""
        temperature = None if self.temperature is None else self.temperature[rows]
        before = None if self.before is None else self.before[rows]
        return replace(
            self,
            hours=self.hours[rows],
            temperature=temperature,
            sense_alpha=self.sense_alpha[rows],
            sense_beta=self.sense_beta[rows],
            before=before,
        )


def circumstances_of(record: PositionRecord) -> Circumstances:
    """The circumstances of a record's rows; without approach columns a sense is that of the shorter turn before."""
    hours = (record.time_s - record.time_s[0]) / 3600.0
    before = np.full((len(hours), 2), np.nan)
    before[1:] = np.stack((record.alpha, record.beta), axis=1)[:-1]
    if record.mounting is not None:
        before[1:][np.array(record.mounting[1:]) != np.array(record.mounting[:-1])] = np.nan
    if record.approach_alpha is not None and record.approach_beta is not None:
        senses = np.asarray(record.approach_alpha, float), np.asarray(record.approach_beta, float)
        return Circumstances(hours, record.temperature, *senses, True, before, record.temperature_resolution)
    senses = senses_of(record.alpha), senses_of(record.beta)
    return Circumstances(hours, record.temperature, *senses, False, before, record.temperature_resolution)


def senses_of(angle: NDArray) -> NDArray:
    """Senses (N,) of the shorter turns that lead to each of successive angles (N,) [rad]; 0 before the first move."""
    turns = np.remainder(np.diff(angle) + np.pi, 2.0 * np.pi) - np.pi
    senses = np.zeros(len(angle))
    for row, turn in enumerate(turns, start=1):
        senses[row] = np.sign(turn) if abs(turn) > 1e-6 else senses[row - 1]
    return senses
