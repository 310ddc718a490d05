"""What an attitude computer made of a record, and how far that is from the truth."""

import math
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from scipy.spatial.transform import Rotation

from ...models.turntable import EARTH_RATE
from ..errors import InputError
from ..shown import Shown
from .error_split import split_error

if TYPE_CHECKING:
    from polars import DataFrame

SCHEMA = "trihedron.attitude/1"


def rotation_of(quaternion: np.ndarray) -> Rotation:
    """Rotations of quaternions (N, 4), scalar first."""
    return Rotation.from_quat(np.roll(quaternion, -1, axis=-1))


def attitude_error(computed: np.ndarray, true: np.ndarray) -> np.ndarray:
    """Rotation vectors that turn the true attitudes into the computed ones, components in the reference frame.

    Parameters
    ----------
    computed, true : ndarray, shape (N, 4)
        unit quaternions, scalar first, body to reference

    Returns
    -------
    ndarray, shape (N, 3)
        [rad], length within [0, π]
    """
    if len(computed) == 0:
        return np.zeros((0, 3))
    return (rotation_of(computed) * rotation_of(true).inv()).as_rotvec()


def heading_and_tilt(error: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Split error rotations into the turn about the reference's third axis and the tilt of that axis.

    Parameters
    ----------
    error : ndarray, shape (N, 3)
        rotation vectors, components in the reference frame [rad]

    Returns
    -------
    heading : ndarray, shape (N,)
        turn about the third axis, within [-π, π] [rad]
    tilt : ndarray, shape (N,)
        angle between the third axis and where the error takes it [rad]; rotation = tilt after heading, exactly
    """
    if len(error) == 0:
        return np.zeros(0), np.zeros(0)
    x, y, z, w = Rotation.from_rotvec(error).as_quat().T
    heading = 2.0 * np.arctan2(z, w)
    tilt = 2.0 * np.arctan2(np.hypot(x, y), np.hypot(w, z))
    return np.arctan2(np.sin(heading), np.cos(heading)), tilt


@dataclass(frozen=True, eq=False, repr=False)
class AttitudeRun(Shown):
    """Attitude at the moments of the algorithm's updates, the start first; NaN where the truth is not known.

    Attributes
    ----------
    record : Path
        where the gyros came from
    algorithm, rates : str
        the algorithm's name; how the rates were taken ("increments" where the record has these)
    gyro_bias : tuple of 3 float or None
        what was taken out of the rates [rad/s]
    period : float
        time between the record's rows [s]
    row : ndarray of int, shape (N,)
        the record's rows, as an editor counts lines
    time_s : ndarray, shape (N,)
        [s]
    attitude : ndarray, shape (N, 4)
        computed, unit quaternion, scalar first, body to reference
    error_rad : ndarray, shape (N, 3)
        rotation vector of the computed against the true attitude, components in the reference frame [rad]
    error_angle : ndarray, shape (N,)
        its length [rad]
    heading, tilt : ndarray, shape (N,), or None
        the error about the reference's third axis and of that axis [rad]; None where it is not the vertical
    provenance : dict
        what the orchestrator says of the run
    files : tuple of Path
        what was written
    """

    record: Path
    algorithm: str
    rates: str
    gyro_bias: tuple[float, float, float] | None
    period: float
    row: np.ndarray
    time_s: np.ndarray
    attitude: np.ndarray
    error_rad: np.ndarray
    error_angle: np.ndarray
    heading: np.ndarray | None
    tilt: np.ndarray | None
    provenance: dict[str, Any] = field(default_factory=dict)
    files: tuple[Path, ...] = ()

    @property
    def judged(self) -> np.ndarray:
        """Mask (N,) of the updates after the start whose true attitude is known."""
        known = np.isfinite(self.error_angle)
        known[:1] = False
        return known

    @property
    def rms(self) -> float | None:
        """Root mean square of the error's angle [rad]; None where nothing can be judged."""
        angle = self.error_angle[self.judged]
        return float(np.sqrt(np.mean(angle**2))) if angle.size else None

    @property
    def maximum(self) -> float | None:
        """Largest angle of the error [rad]."""
        angle = self.error_angle[self.judged]
        return float(angle.max()) if angle.size else None

    @property
    def final(self) -> float | None:
        """Angle of the error where the truth is known last [rad]."""
        angle = self.error_angle[self.judged]
        return float(angle[-1]) if angle.size else None

    @property
    def drift(self) -> float | None:
        """Growth of the error's angle: slope of the best line through zero at the start [rad/s]."""
        known = self.judged
        if not known.any():
            return None
        elapsed = self.time_s[known] - self.time_s[0]
        return float(elapsed @ self.error_angle[known] / (elapsed @ elapsed))

    def to_json(self) -> dict[str, Any]:
        """The object of schema trihedron.attitude/1, angles in radians."""
        return {
            "schema": SCHEMA,
            "record": str(self.record),
            "algorithm": self.algorithm,
            "rates": self.rates,
            "gyro_bias_radps": None if self.gyro_bias is None else list(self.gyro_bias),
            "period_s": self.period,
            "updates": len(self.time_s) - 1,
            "judged_updates": int(self.judged.sum()),
            "error_rms_rad": self.rms,
            "error_max_rad": self.maximum,
            "error_at_end_rad": self.final,
            "drift_radps": self.drift,
            "files": [str(file) for file in self.files],
        }

    def to_polars(self) -> "DataFrame":
        """A row for each update: time_s, q0 to q3, error_rad."""
        import polars as pl

        quaternion = {f"q{k}": self.attitude[:, k] for k in range(4)}
        return pl.DataFrame({"time_s": self.time_s, **quaternion, "error_rad": self.error_angle}).fill_nan(None)

    def lines(self) -> list[str]:
        """As `summary`."""
        return self.summary()

    def summary(self) -> list[str]:
        """Lines for a person: what was run, and how large the error is."""
        span = self.time_s[-1] - self.time_s[0]
        how = {
            "instantaneous": "instantaneous rates, trapezoid rule",
            "averaged": "rates averaged over their intervals",
        }
        lines = [
            f"{self.record.name}: {span:.1f} s at {1.0 / self.period:.1f} Hz, algorithm {self.algorithm}, "
            f"{how.get(self.rates, 'increments as measured')}"
        ]
        rms, maximum, final, drift = self.rms, self.maximum, self.final, self.drift
        if rms is None or maximum is None or final is None or drift is None:
            return [*lines, "attitude error: the record has no true attitude to compare with"]
        known = self.judged
        if self.gyro_bias is None:
            earth = math.degrees(EARTH_RATE * (self.time_s[known][-1] - self.time_s[0]))
            lines.append(
                f"rates as measured: neither the gyros' bias nor Earth's rotation ({earth:.3f} deg over this time) "
                "is taken out"
            )
        else:
            bias = ", ".join(f"{math.degrees(value):.4f}" for value in self.gyro_bias)
            lines.append(f"a gyro bias of ({bias}) deg/s is taken out of the rates")
        lines.append(
            f"attitude error over {int(known.sum())} updates: {math.degrees(rms):.3f} deg rms, "
            f"{math.degrees(maximum):.3f} deg at most, {math.degrees(final):.3f} deg at the end, "
            f"drift {60.0 * math.degrees(drift):.3f} deg/min"
        )
        if self.heading is not None and self.tilt is not None:
            heading, tilt = (float(np.sqrt(np.mean(part[known] ** 2))) for part in (self.heading, self.tilt))
            lines.append(f"of it heading {math.degrees(heading):.3f} deg rms, tilt {math.degrees(tilt):.3f} deg rms")
        return lines + self.split_lines()

    def split_lines(self) -> list[str]:
        """The error as a slowly growing and a periodic part; nothing where the run is too short to tell them apart."""
        known = self.judged
        try:
            split = split_error(self.time_s[known], np.degrees(self.error_rad[known]))
        except InputError:
            return []
        rate = ", ".join(f"{60.0 * value:+.3f}" for value in split.rate)
        amplitude = ", ".join(f"{value:.3f}" for value in split.amplitude)
        return [
            f"slowly growing part ({rate}) deg/min, periodic part at most ({amplitude}) deg about axes 1, 2, 3 "
            f"(period {split.period:.1f} s)"
        ]
