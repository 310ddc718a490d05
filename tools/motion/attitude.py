"""The attitude of a measured record: its gyros through the attitude computer's FMU, against the true attitude.

Errors between computed and true attitudes as one angle, as heading and tilt, and over time. Quaternions are scalar
first, body to reference.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any, Literal

import numpy as np
import polars as pl
from numpy.typing import NDArray
from pydantic import Field
from scipy.interpolate import CubicSpline
from scipy.optimize import minimize_scalar
from scipy.spatial.transform import Rotation

from ...models import rotation
from ...models.attitude_algorithms import ALGORITHMS, Algorithm
from ..compiled import Makers, loops_over
from ..errors import InputError, nearest
from ..orchestrator import run_scenario
from ..orchestrator.scenario import FmuSetting, RecordSetting
from ..records import StrapdownRecord
from ..records.columns import INCREMENT, QUATERNION, VELOCITY
from ..result import ABSENT, Array, Result
from ..rounding import digits, downwards, exactly
from .carry import carrying, inputs
from .increments import Bridge, coarser, gyro_input, left_out_line
from .turning import rotation_of

VERTICAL_WITHIN = math.radians(5.0)
"""How near the mean specific force must be to the reference's third axis for that to count as the vertical [rad]."""

FEWEST_PERIODS = 4
"""A period that is looked for is at most this part of the run."""

SPEED = ("v1_mps", "v2_mps", "v3_mps")
"""Columns of a velocity."""

STRONG = 0.1
"""A line of the spectrum counts as a harmonic of the motion from this part of the strongest on."""


class AttitudeRun(Result):
    """Attitude computed from a record, and its error against the true attitude.

    Arrays hold the moments of the algorithm's updates, the start first; NaN where the truth is not known.

    Attributes
    ----------
    record : Path
        record of the gyros
    algorithm, rates : str
        the algorithm's name; how the rates were taken ("increments" where the record has these)
    gyro_bias : tuple of 3 float or None
        bias subtracted from the rates [rad/s]
    period : float
        time between the record's rows [s]
    updates, judged_updates : int
        after the start: all, and those whose true attitude is known
    rms, maximum, final : float or None
        of the error's angle [rad], root mean square, largest, and where the truth is known last; None where nothing can
        be judged
    drift : float or None
        growth of the error's angle: slope of the best line through zero at the start [rad/s]
    bridges : tuple of Bridge
        gaps that were bridged, each with a bound of the attitude error that may cause
    bridged_bound : float
        of the attitude at the end: their sum [rad]
    saturated : dict
        gyro ("w1") to its rows at a limit from where the run begins
    trusted_until : float or None
        time of the last update before the first of them: the attitude is not to be trusted behind it [s]; None: all is
    warnings : tuple of str
        warnings on the gyros' limits
    rows_left_out : int
        last rows, which fill no step of the algorithm
    files : tuple of Path
        files written
    velocity_at_end : tuple of 3 float or None
        of `velocity`
    row : ndarray, shape (N,)
        the record's rows, as an editor counts lines
    time_s : ndarray, shape (N,)
        [s]
    attitude : ndarray, shape (N, 4)
        computed, unit quaternion, scalar first, body to reference
    velocity : ndarray, shape (N, 3), or None
        integral of the specific force, in the reference, from zero at the start: nothing of gravity is taken out [m/s];
        of a record with increments of velocity
    error_rad : ndarray, shape (N, 3)
        rotation vector of the computed against the true attitude, components in the reference frame [rad]
    error_angle : ndarray, shape (N,)
        its length [rad]
    heading, tilt : ndarray, shape (N,), or None
        the error about the reference's third axis and of that axis [rad]; None where it is not the vertical
    provenance : dict
        notes of the orchestrator on the run
    """

    schema_: Literal["trihedron.attitude/1"] = Field(default="trihedron.attitude/1", alias="schema")
    record: Path
    algorithm: str
    rates: str
    gyro_bias: tuple[float, float, float] | None = Field(alias="gyro_bias_radps")
    period: float = Field(alias="period_s")
    updates: int
    judged_updates: int
    rms: float | None = Field(default=None, alias="error_rms_rad")
    maximum: float | None = Field(default=None, alias="error_max_rad")
    final: float | None = Field(default=None, alias="error_at_end_rad")
    drift: float | None = Field(default=None, alias="drift_radps")
    bridges: tuple[Bridge, ...] = Field(default=(), alias="bridged_gaps")
    bridged_bound: float = Field(default=0.0, alias="bridged_bound_rad")
    saturated: dict[str, int] = Field(default_factory=dict, alias="saturated_rows")
    trusted_until: float | None = Field(default=None, alias="trusted_until_s")
    warnings: tuple[str, ...] = ()
    rows_left_out: int = Field(default=0, exclude=True)
    files: tuple[Path, ...] = ()
    velocity_at_end: tuple[float, float, float] | None = Field(default=None, alias="velocity_at_end_mps")
    row: Array = Field(default=ABSENT, exclude=True)
    time_s: Array = Field(default=ABSENT, exclude=True)
    attitude: Array = Field(default=ABSENT, exclude=True)
    velocity: Array | None = Field(default=None, exclude=True)
    error_rad: Array = Field(default=ABSENT, exclude=True)
    error_angle: Array = Field(default=ABSENT, exclude=True)
    heading: Array | None = Field(default=None, exclude=True)
    tilt: Array | None = Field(default=None, exclude=True)
    provenance: dict[str, Any] = Field(default_factory=dict, exclude=True)

    @property
    def judged(self) -> NDArray:
        """Mask (N,) of updates after the start whose true attitude is known."""
        return judged_updates(self.error_angle)

    @property
    def trusted(self) -> NDArray:
        """Mask (N,) of the updates before a gyro is at its limit."""
        if self.trusted_until is None:
            until = np.inf
        else:
            until = self.trusted_until
        return np.asarray(self.time_s <= until)

    def bridged_bound_at(self) -> NDArray:
        """Bound (N,) of the attitude error that bridged gaps may have caused at each update [rad]."""
        begins = np.array([bridge.time_s for bridge in self.bridges])
        total = np.cumsum([0.0, *(bridge.bound for bridge in self.bridges)])
        return total[np.searchsorted(begins, self.time_s, side="right")]

    def to_polars(self) -> pl.DataFrame:
        """A row for each update: time_s, q0 to q3, v1_mps to v3_mps where there is a velocity, error_rad and more."""
        quaternion = {}
        for k, name in enumerate(QUATERNION):
            quaternion[name] = self.attitude[:, k]
        if self.velocity is not None:
            for k, name in enumerate(SPEED):
                quaternion[name] = self.velocity[:, k]
        table = pl.DataFrame({"time_s": self.time_s, **quaternion, "error_rad": self.error_angle}).fill_nan(None)
        return table.with_columns(
            pl.Series("bridged_bound_rad", self.bridged_bound_at()), pl.Series("trusted", self.trusted)
        )


def judged_updates(error_angle: NDArray) -> NDArray:
    """Return the mask (N,) of updates after the start whose error (N,) is known."""
    finite = np.isfinite(error_angle)
    finite[:1] = False
    return finite


def run_attitude(
    record: StrapdownRecord,
    *,
    algorithm: str = "two-sample-rodrigues",
    rates: str = "instantaneous",
    gyro_bias: Sequence[float] | NDArray | None = None,
    rate_divisor: int = 1,
    bridge_gaps: int = 0,
    **run: Any,
) -> AttitudeRun:
    """Run the attitude computer's FMU on a record's gyros and compare it with the record's true attitude.

    The run begins at the first row whose true attitude is known, with that attitude (without any: at the first row,
    with the identity). Errors are taken only at updates, where the truth is known. Where a gyro is at its limit the run
    goes on: `trusted_until` says from when on its attitude means nothing, and `trusted` of each row that is written.

    Parameters
    ----------
    algorithm, rates, gyro_bias, rate_divisor, bridge_gaps
        as of `trihedron.attitude_of_record`: rates are "instantaneous" (integrated by the trapezoid rule) or "averaged"
        (means over the interval before each row). `gyro_bias` [rad/s] is subtracted from them
    run
        out, progress of `orchestrator.simulate`

    Raises
    ------
    InputError
        unknown algorithm or meaning of the rates; a record that is not uniform, has a gap or ends where its true
        attitude begins; a turn in one sample outside the algorithm's range
    """
    chosen = algorithm_named(algorithm)
    source = gyro_input(record, rates, bridge_gaps=bridge_gaps, gyro_bias=gyro_bias)
    record, first, limited = source.record, source.first, source.limits
    increments = coarser(source.increments, rate_divisor)
    size = np.linalg.norm(increments.angle, axis=1)
    beyond = np.flatnonzero(size > chosen.max_increment)
    if beyond.size:
        k = int(beyond[0])
        raise InputError(
            f"{record.path}, row {int(record.row[first + (k + 1) * rate_divisor])}: a turn of "
            f"{digits(size[k], 6)} rad in one sample; {chosen.name} is valid to "
            f"{downwards(chosen.max_increment, 3)} rad: sample faster or take mean-rate"
        )
    parameters = {"algorithm": chosen.number, "sample_period": increments.period, "initial_attitude": source.start}
    component, driven = "AttitudeComputer", inputs("computer.increment", INCREMENT, increments.angle)
    if increments.velocity is not None:
        component = "VelocityComputer"
        driven |= inputs("computer.velocity_increment", VELOCITY, increments.velocity)
    scenario = carrying(
        f"attitude of {record.path.name}",
        {"computer": FmuSetting(component=component, parameters=parameters)},
        driven,
        increments.time_s,
        increments.period,
    )
    if increments.velocity is not None:
        speeds = {}
        for i, name in enumerate(SPEED, start=1):
            speeds[name] = f"computer.velocity[{i}]"
        columns = RecordSetting(columns=dict(scenario.record.columns or {}) | speeds)
        scenario = scenario.model_copy(update={"record": columns})
    simulation = run_scenario(scenario, marks=[(pl.col("time_s") < source.worthless_from).alias("trusted")], **run)
    updated = simulation.table["updated"].to_numpy()
    attitude = simulation.table.select(QUATERNION).to_numpy()[updated]
    velocity = velocity_at_end = None
    if increments.velocity is not None:
        velocity = simulation.table.select(SPEED).to_numpy()[updated]
        velocity_at_end = tuple(velocity[-1].tolist())
    index = first + rate_divisor * np.flatnonzero(updated)
    error = np.full((len(index), 3), np.nan)
    if record.attitude is not None:
        true = record.attitude[index]
        judged = np.isfinite(true).all(axis=1)
        error[judged] = attitude_error(attitude[judged], true[judged])
    heading = tilt = None
    if _third_axis_is_vertical(record):
        heading, tilt = np.full(len(index), np.nan), np.full(len(index), np.nan)
        judged = np.isfinite(error).all(axis=1)
        heading[judged], tilt[judged] = heading_and_tilt(error[judged])
    angle, time = np.linalg.norm(error, axis=1), increments.time_s[updated]
    is_known = judged_updates(angle)
    figures: dict[str, Any] = {}
    if is_known.any():
        known_angle, elapsed = angle[is_known], time[is_known] - time[0]
        figures = {
            "error_rms_rad": float(np.sqrt(np.mean(known_angle**2))),
            "error_max_rad": float(known_angle.max()),
            "error_at_end_rad": float(known_angle[-1]),
            "drift_radps": float(elapsed @ known_angle / (elapsed @ elapsed)),
        }
    if record.increment is not None:
        rates = "increments"
    bias = None
    if gyro_bias is not None:
        bias = tuple(np.asarray(gyro_bias).tolist())
    rows_left_out = len(record) - 1 - int(index[-1])
    warnings = (*source.warnings, *left_out_line(rows_left_out, algorithm, time[-1]))
    saturated = {}
    for name, mask in limited.rows.items():
        if name.startswith("w"):
            saturated[name] = int(mask.sum())
    return AttitudeRun(
        record=record.path,
        algorithm=algorithm,
        rates=rates,
        gyro_bias_radps=bias,
        period_s=increments.period,
        updates=len(index) - 1,
        judged_updates=int(is_known.sum()),
        **figures,
        bridged_gaps=source.bridges,
        bridged_bound_rad=source.bridged_bound,
        saturated_rows=saturated,
        trusted_until_s=source.trusted_until(time),
        warnings=warnings,
        rows_left_out=rows_left_out,
        files=simulation.files,
        row=record.row[index],
        time_s=time,
        attitude=attitude,
        velocity=velocity,
        velocity_at_end_mps=velocity_at_end,
        error_rad=error,
        error_angle=angle,
        heading=heading,
        tilt=tilt,
        provenance=simulation.provenance,
    )


def algorithm_named(name: str) -> Algorithm:
    """Return the algorithm of a name; InputError for an unknown name."""
    by_name = {a.name: a for a in ALGORITHMS}
    if name not in by_name:
        raise InputError(f"algorithm '{name}' is not known; {nearest(name, tuple(by_name))}")
    return by_name[name]


def _third_axis_is_vertical(record: StrapdownRecord) -> bool:
    """Return true if the mean specific force points along the third axis of the true attitude's reference."""
    if record.attitude is None:
        return False
    finite = np.isfinite(record.attitude).all(axis=1)
    if not finite.any():
        return False
    mean = rotation_of(record.attitude[finite]).apply(record.specific_force[finite]).mean(axis=0)
    return bool(math.atan2(math.hypot(mean[0], mean[1]), mean[2]) <= VERTICAL_WITHIN)


def attitude_error(computed: NDArray, true: NDArray) -> NDArray:
    """Rotation vectors (N, 3) [rad] that turn true attitudes (N, 4) into computed ones, in the reference frame."""
    if len(computed) == 0:
        return np.zeros((0, 3))
    return (rotation_of(computed) * rotation_of(true).inv()).as_rotvec()


def heading_and_tilt(error: NDArray) -> tuple[NDArray, NDArray]:
    """Split error rotations (N, 3) [rad] into the turn about the reference's third axis and the tilt of that axis.

    The heading (N,) is within [-π, π], the tilt (N,) the angle between the third axis and where the error takes it;
    rotation = tilt after heading, exactly.
    """
    if len(error) == 0:
        return np.zeros(0), np.zeros(0)
    x, y, z, w = Rotation.from_rotvec(error).as_quat().T
    heading = 2.0 * np.arctan2(z, w)
    tilt = 2.0 * np.arctan2(np.hypot(x, y), np.hypot(w, z))
    return np.arctan2(np.sin(heading), np.cos(heading)), tilt


def attitudes_of_angles(angles: NDArray) -> NDArray:
    """Quaternions (N, 4), scalar first, of the angles ψ, ϑ, γ (N, 3): about the second, then third, then first axis."""
    return np.roll(Rotation.from_euler("YZX", angles).as_quat(), 1, axis=-1)


def angle_between(p: NDArray, q: NDArray) -> NDArray:
    """Return angles (N,) between the attitudes of quaternions (N, 4) of any norm [rad]; accurate for small angles."""
    angles = np.empty(len(p))
    _comparing(loops_over(len(p)))(np.asarray(p), np.asarray(q), angles)
    return angles


@cache
def _comparing(makers: Makers) -> Callable[..., None]:
    kernel_made, loop_made = makers
    compare, angle_of_half = kernel_made(rotation.compare), kernel_made(rotation.angle_of_half)

    @loop_made
    def compare_all(p, q, angles):
        half = np.empty(2)
        for k in range(len(p)):
            compare(p[k], q[k], half)
            angles[k] = angle_of_half(half[0], half[1])

    return compare_all


@dataclass(frozen=True, eq=False)
class ErrorSplit:
    """The parts of an error, slow + periodic = error.

    Attributes
    ----------
    period : float
        over which the slow part is averaged [s]
    slow, periodic : ndarray, shape (N, K)
        in the unit of the error
    rate : ndarray, shape (K,)
        drift: slope of the best line through the slow part, per second
    amplitude : ndarray, shape (K,)
        largest size of the periodic part
    """

    period: float
    slow: NDArray
    periodic: NDArray
    rate: NDArray
    amplitude: NDArray


def split_error(time_s: NDArray, error: NDArray, period: float | None = None) -> ErrorSplit:
    """Split an error (N,) or (N, K) at growing times (N,) [s] as Chelnokov et al. 2016, section 3.1.1, describe theirs.

    The slow part is the mean over one whole period around each moment, so that errors which repeat with the motion drop
    out of it. Half a period from the ends it goes on with the drift. Without a period [s] it is the longest strong one
    in the error's spectrum. An InputError for fewer than eight errors, a number that is not finite, or a run of less
    than two periods.
    """
    time = np.asarray(time_s, dtype=np.float64)
    values = np.asarray(error, dtype=np.float64).reshape(len(time), -1)
    if len(time) < 8 or not (np.isfinite(time).all() and np.isfinite(values).all() and (np.diff(time) > 0.0).all()):
        raise InputError("an error is split from at least eight finite values at growing times")
    span = float(time[-1] - time[0])
    if period is None:
        period = found_period(time, values)
    if not (np.isfinite(period) and 0.0 < 2.0 * period <= span):
        raise InputError(
            f"a run of {exactly(span)} s is shorter than two periods of {exactly(period)} s: its drift cannot be told"
        )
    total = CubicSpline(time, values).antiderivative()
    half = 0.5 * period
    inside = np.clip(time, time[0] + half, time[-1] - half)
    slow = (total(inside + half) - total(inside - half)) / period
    interior = (time >= time[0] + half) & (time <= time[-1] - half)
    rate = _slope(time[interior], slow[interior])
    slow = slow + np.outer(time - inside, rate)
    periodic = values - slow
    return ErrorSplit(period, slow, periodic, rate, np.abs(periodic).max(axis=0))


def found_period(time_s: NDArray, error: NDArray) -> float:
    """Return the longest strong period in an error (N, K) without its best line [s].

    At most a quarter of the run; the quarter itself where nothing is periodic.
    """
    span = float(time_s[-1] - time_s[0])
    grid = np.linspace(time_s[0], time_s[-1], len(time_s))
    even = CubicSpline(time_s, error)(grid)
    rest = even - even.mean(axis=0) - np.outer(grid - grid.mean(), _slope(grid, even))
    window = np.hanning(len(grid))[:, None]
    power = np.sqrt((np.abs(np.fft.rfft(window * rest, axis=0)) ** 2).sum(axis=1))
    power[:FEWEST_PERIODS] = 0.0
    if not power.max() > 0.0:
        return span / FEWEST_PERIODS
    strong = np.flatnonzero(power >= STRONG * power.max())
    # A line of the windowed spectrum is three bins wide: the strongest of the first group is the period's.
    first = strong[0]
    peak = first + int(np.argmax(power[first : first + 3]))
    return _refined_period(grid, rest, span / peak, span)


def _refined_period(time: NDArray, rest: NDArray, period: float, span: float) -> float:
    """Return the period, near a line of the spectrum, whose sine and cosine reduce the error most."""
    window = np.hanning(len(time))[:, None] * rest

    def left(frequency: float) -> float:
        wave = np.exp(-2j * np.pi * frequency * (time - time[0]))
        return -float((np.abs(wave @ window) ** 2).sum())

    near = (1.0 / period - 0.6 / span, 1.0 / period + 0.6 / span)
    best = minimize_scalar(left, bounds=near, method="bounded", options={"xatol": 1e-6 / span})
    return 1.0 / float(best.x)  # type: ignore[attr-defined]


def _slope(time: NDArray, values: NDArray) -> NDArray:
    """Slopes (K,) of the best lines through values (N, K)."""
    moved = time - time.mean()
    return moved @ values / (moved @ moved)
