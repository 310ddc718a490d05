"""Correction of readings by a calibration: the inverse of the calibrated block, with its guaranteed bound."""

import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import product
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, ValidationError

from ...fmus import components
from ...fmus.parameters import (
    Interval,
    Parameters,
    calibrated_block,
    calibrated_gyros,
    calibrated_intervals,
    calibration_of,
    checked_number,
    known_values,
    of_one_record,
    parameter_set,
)
from ...models.bench import BIAS, GYRO_PARAMETERS, LAG, MATRIX, SENSITIVITY
from ..calibrated import LATENCIES, CalibratedEffect, Provenance, Sigma
from ..errors import InputError
from ..files import LARGEST_RESULT, advice_on, bytes_of, whole_file
from ..records import BenchRecord, PositionRecord, RawRecord, Source, StrapdownRecord, read_record
from ..records.columns import CORRECTED_BY
from ..records.rests import average_rests, find_rests
from ..result import Result, Told
from ..rounding import exactly, upwards
from .model import checked_mounting
from .promise import broken_conditions
from .targets import corners

if TYPE_CHECKING:
    from polars import DataFrame

WELL_POSED = 1e3
"""Gyros whose matrix is conditioned worse measure no three rates."""

CALIBRATED = "the calibration of "
"""How a comment line of a record says that a calibration corrected it."""

Measured = PositionRecord | RawRecord | StrapdownRecord
"""What can be corrected."""


@dataclass(frozen=True)
class GyroCorrection:
    """The inverse of calibrated gyros except for their lag [s], which remains in the readings.

    `bias` (3,) [rad/s], `matrix` (3, 3) I + Γ, `sensitivity` (3, 3) [rad/s per g]; `force_lag` is the lag of the
    accelerometers [s], which remains too; None where it is not known.
    """

    bias: NDArray
    matrix: NDArray
    sensitivity: NDArray
    lag: float
    force_lag: float | None

    @staticmethod
    def of(calibration: Mapping[str, Any]) -> "GyroCorrection | None":
        """Return the gyros of a calibration's object; None where it has none, or not all of them."""
        estimates = known_values(calibration, GYRO_PARAMETERS)
        if estimates is None:
            return None
        values = np.array([estimates[symbol] for symbol in GYRO_PARAMETERS])
        matrix = np.eye(3) + values[MATRIX].reshape(3, 3)
        if not np.linalg.cond(matrix) < WELL_POSED:
            raise ValueError("the gyros' scale factors and misalignments have no inverse")
        late = known_values(calibration, LATENCIES[:1]) or {}
        sensitivity = values[SENSITIVITY].reshape(3, 3)
        return GyroCorrection(values[BIAS], matrix, sensitivity, float(values[LAG]), late.get(LATENCIES[0]))

    def corrected(self, reading: NDArray, n: NDArray, seconds: NDArray | float = 1.0) -> NDArray:
        """Rates (N, 3) [rad/s], or integrals over (N, 1) [s], from readings, at inputs (N, 3) [g]."""
        return np.linalg.solve(self.matrix, (reading - seconds * (self.bias + n @ self.sensitivity.T)).T).T


@dataclass(frozen=True)
class Correction:
    """The inverse of a calibrated block, Γ lower triangular, in units of `gravity`, the calibration's g [m/s²].

    `plus`, `minus` (3,) are 1 + Γ⁺ and 1 + Γ⁻ of each accelerometer, `gamma` (3, 3) is Γ below the diagonal and 0
    elsewhere, `bias` (3,) is in g. `low`, `high` (3, 3, 3, 3) are the least and the greatest error of the reading of
    accelerometer p at the input (i, j, k) − 1 [g]. `mounting` (3, 3) is that of the calibration's record, None of
    several. `of_record` names, among several records calibrated together, the one that these biases belong to, where it
    is another one.

    `noise_bound` [g] is σ of the calibration and `sigma_kind` its kind; `source`, `sha256`, `temperature` [°C] (least
    and most) and `comments` are those of its record; `effects` of accelerometers were calibrated beside it and are not
    corrected.
    """

    gravity: float
    plus: NDArray
    minus: NDArray
    gamma: NDArray
    bias: NDArray
    low: NDArray
    high: NDArray
    mounting: NDArray | None = None
    of_record: str = ""
    gyros: GyroCorrection | None = None
    noise_bound: float = 0.0
    sigma_kind: str = "unknown"
    source: str = ""
    sha256: str = ""
    temperature: tuple[float, float] | None = None
    comments: Mapping[str, str] = field(default_factory=dict)
    effects: tuple[str, ...] = ()

    def inputs_of(self, specific_force: NDArray) -> NDArray[np.float64]:
        """Return inputs (N, 3) [g] by readings (N, 3) [m/s²]."""
        return corrected(self, specific_force) / self.gravity

    def bound_at(self, n: NDArray, noise_bound: float | NDArray) -> NDArray[np.float64]:
        """Return the largest difference of true inputs from corrected ones n (N, 3) [g], of either sign."""
        least, most = remaining_error(self, n, noise_bound)
        return np.maximum(np.abs(least), np.abs(most))


def read_correction(path: Path, sha256: str = "") -> Correction:
    """The correction of a calibration's file, as of `correction_of`."""
    content_bytes = bytes_of(path, most=LARGEST_RESULT)
    advice = advice_on(path, content_bytes, "calibration", "diagnosis")
    try:
        content = json.loads(content_bytes.decode("utf-8"))
    except (ValueError, RecursionError) as error:
        needed = advice or "; the file of `trihedron calibrate --json` is needed"
        raise InputError(f"{path}: is not JSON text{needed}") from error
    if advice:
        raise InputError(f"{path}: is no calibration{advice}")
    return correction_of(content, str(path), sha256)


def correction_of(calibration: Mapping[str, Any], where: str, sha256: str = "") -> Correction:
    """Return the correction of a calibration's object; raise an InputError, which begins with `where`, if it has none.

    For a calibration of several records the correction is that of the record with this SHA-256, else of the last one.
    """
    record = ""
    try:
        of_all, calibration = calibration, of_one_record(calibration, sha256)
        if isinstance(of_all, Mapping) and calibration_of(of_all).get("of_record"):
            source = calibration["provenance"]
            if not sha256 or source["record_sha256"] != sha256:
                record = source["record"]
        block: Any = calibrated_block(calibration)
        gamma = np.zeros((3, 3))
        for row, column in ((2, 1), (3, 1), (3, 2)):
            gamma[row - 1, column - 1] = block[f"gamma_{row}{column}"]
        plus, minus = 1.0 + np.array(block["scale_error_plus"]), 1.0 + np.array(block["scale_error_minus"])
        if not min(plus.min(), minus.min()) > 0.0:
            raise ValueError("a scale factor or the gravity is not positive; the block has no inverse")
        low, high = _reading_errors(calibration)
        gyros = GyroCorrection.of(calibration)
    except ValueError as error:
        raise InputError(f"{where}: {error}") from error
    bias, mounting = np.array(block["bias"]), _mounting(calibration)
    correction = Correction(block["gravity"], plus, minus, gamma, bias, low, high, mounting, record, gyros)
    return replace(correction, **_origin(calibration, where))


def _origin(calibration: Mapping[str, Any], where: str) -> dict[str, Any]:
    """Return the basis of a calibration's promise: σ, and the digest, temperatures and comments of its record."""
    try:
        sigma = Sigma.model_validate(calibration_of(calibration)["sigma"])
        values: dict[str, Any] = {"noise_bound": sigma.value or 0.0, "sigma_kind": sigma.kind}
        effects = [CalibratedEffect.model_validate(effect) for effect in calibration.get("effects", ())]
        values["effects"] = tuple(effect.effect for effect in effects if effect.in_readings)
        if calibration.get("provenance") is None:
            return values
        source = Provenance.model_validate(calibration["provenance"])
    except (KeyError, ValidationError) as error:
        raise InputError(
            f"{where}: its sigma, provenance or effects are not as the schema says; calibrate again"
        ) from error
    values |= {"source": source.record, "sha256": source.sha256, "comments": source.comments}
    if source.temperature:
        values["temperature"] = (min(source.temperature), max(source.temperature))
    return values


def _mounting(calibration: Mapping[str, Any]) -> NDArray | None:
    """Return the only mounting (3, 3) of a calibration's object; None where it has none or several."""
    try:
        (matrix,) = calibration["mountings"].values()
        return checked_mounting(matrix, "mountings")
    except (KeyError, AttributeError, TypeError, ValueError, InputError):
        return None


def _reading_errors(calibration: Mapping[str, Any]) -> tuple[NDArray, NDArray]:
    """Lower and upper ends (3, 3, 3, 3) of the `corners` in a calibration's object; NaN at other inputs."""
    ends = np.full((2, 3, 3, 3, 3), np.nan)
    try:
        entries = calibration["reading_errors"]
        ends_at = {(e["accelerometer"], tuple(e["input"])): (e["low"], e["high"]) for e in entries}
    except (KeyError, TypeError) as error:
        raise ValueError("its reading_errors are not as the schema says; calibrate again") from error
    cube = corners()
    if len(entries) != len(cube) or not all(corner in ends_at for corner in cube):
        raise ValueError("its reading_errors are not complete; calibrate again")
    for p, n in cube:
        place = f"reading_errors, accelerometer {p}, input {list(n)}"
        low, high = checked_number(ends_at[p, n][0], place), checked_number(ends_at[p, n][1], place)
        if not -1.0 <= low <= high <= 1.0:
            raise ValueError("its reading_errors are not low <= high, between -1 and 1; calibrate again")
        ends[:, p - 1, n[0] + 1, n[1] + 1, n[2] + 1] = low, high
    return ends[0], ends[1]


def corrected(correction: Correction, specific_force: NDArray) -> NDArray:
    """Specific force (N, 3) [m/s²] from readings (N, 3) [m/s²], by forward substitution.

    An accelerometer's input has the sign of its reading less bias and cross terms, since its scale factors are
    positive: that chooses Γ⁺ (above zero) or Γ⁻.
    """
    right = specific_force / correction.gravity - correction.bias
    n = np.zeros_like(right)
    for p in range(3):
        along_axis = right[:, p] - n[:, :p] @ correction.gamma[p, :p]
        n[:, p] = along_axis / np.where(along_axis > 0.0, correction.plus[p], correction.minus[p])
    return correction.gravity * n


def error_bounds(correction: Correction, n: NDArray) -> tuple[NDArray, NDArray]:
    """Return the least and the greatest error (N, 3) [g] of the block's readings at inputs (N, 3) [g].

    The greatest error over all parameters that the calibration leaves possible is convex in the input as long as its
    signs stay, so that its values at the corners of a simplex around the input bound it.
    """
    count = len(n)
    lows, highs = np.zeros((count, 3)), np.zeros((count, 3))
    rows = np.arange(count)
    for p in range(3):
        inputs = np.where(np.arange(3) <= p, n, 0.0)
        order = np.argsort(-np.abs(inputs), axis=1, kind="stable")
        size = np.take_along_axis(np.abs(inputs), order, axis=1)
        sign = np.sign(inputs).astype(int)
        first = 1.0 - size[:, 0]
        low, high = correction.low[p], correction.high[p]
        # beyond the unit cube the input's weight of zero is negative: its other end counts
        lows[:, p] = first * np.where(first >= 0.0, low[1, 1, 1], high[1, 1, 1])
        highs[:, p] = first * np.where(first >= 0.0, high[1, 1, 1], low[1, 1, 1])
        corner = np.ones((count, 3), dtype=int)
        for k in range(p + 1):
            corner[rows, order[:, k]] += sign[rows, order[:, k]]
            weight = size[:, k]
            if k < p:
                weight = weight - size[:, k + 1]
            # a corner beyond this accelerometer's own inputs has no weight
            at = tuple(corner.T)
            lows[:, p] += np.where(weight > 0.0, weight * low[at], 0.0)
            highs[:, p] += np.where(weight > 0.0, weight * high[at], 0.0)
    return lows, highs


def remaining_error(correction: Correction, n: NDArray, noise_bound: float | NDArray = 0.0) -> tuple[NDArray, NDArray]:
    """Return the least and the greatest difference (N, 3) [g], true less corrected, for corrected inputs n (N, 3) [g].

    `noise_bound` [g] is that of the readings' own errors; 0 gives the error by the calibration alone.
    """
    lows, highs = error_bounds(correction, n)
    n = np.asarray(n)
    reading = n @ correction.gamma.T + n * np.where(n > 0.0, correction.plus, correction.minus) + correction.bias
    least, most = reading - highs - n - noise_bound, reading - lows - n + noise_bound
    # the errors belong to the true input, which is not quite the corrected one
    steep = _steepness(correction)
    further = steep / (1.0 - steep) * np.maximum(np.abs(least), np.abs(most)).max(axis=1, keepdims=True)
    return least - further, most + further


def _steepness(correction: Correction) -> float:
    """The most that a reading's error changes by, over the greatest change of an input."""
    worst = 0.0
    for end in (correction.low, correction.high):
        for table in (end[0, :, 1, 1], end[1, :, :, 1], end[2]):
            steps = [np.abs(np.diff(table, axis=axis)).max() for axis in range(table.ndim)]
            worst = max(worst, sum(steps))
    return min(float(worst), 0.5)


@dataclass(frozen=True)
class Levelling:
    """Error of the vertical that readings at rest give, in each row [rad].

    `before` (N,) is the angle between the readings as they are and as corrected; `after` (N,) is guaranteed: the
    corrected readings are not further from the truth.
    """

    before: NDArray
    after: NDArray

    @property
    def worst(self) -> tuple[float, float]:
        """The greatest `before`, and the greatest `after`."""
        return float(self.before.max()), float(self.after.max())


def levelling(correction: Correction, reading: NDArray, noise_bound: float = 0.0) -> Levelling:
    """The error of levelling by readings (N, 3) [g] of a block at rest, before and after the correction."""
    reading = np.asarray(reading, dtype=float)
    n = corrected(correction, reading * correction.gravity) / correction.gravity
    size = np.linalg.norm(n, axis=1)
    before = np.arctan2(np.linalg.norm(np.cross(reading, n), axis=1), np.einsum("ij,ij->i", reading, n))
    least, most = remaining_error(correction, n, noise_bound)
    vertical = n / size[:, None]
    after = np.zeros(len(n))
    for side in product((0, 1), repeat=3):
        error = np.where(np.array(side) > 0, most, least)
        across = error - vertical * np.einsum("ij,ij->i", vertical, error)[:, None]
        along = size + np.einsum("ij,ij->i", vertical, error)
        after = np.maximum(after, np.arctan2(np.linalg.norm(across, axis=1), along))
    return Levelling(before, after)


def face_readings(correction: Correction) -> tuple[list[str], NDArray]:
    """Readings (6, 3) [g] of the calibrated block with each of its axes up and down, and the attitudes' names."""
    names = [f"axis {axis} {way}" for axis, way in product((1, 2, 3), ("up", "down"))]
    n = np.repeat(np.eye(3), 2, axis=0) * np.tile([1.0, -1.0], 3)[:, None]
    scale = np.where(n > 0.0, correction.plus, correction.minus)
    return names, n * scale + n @ correction.gamma.T + correction.bias


class LevellingError(Result):
    """The greatest error of the vertical [rad]."""

    as_read: float
    corrected_at_most: float


class AppliedEffect(Result):
    """An effect that a diagnosis names, and its treatment in another record.

    "corrected": it was subtracted from the readings; "simulated": the extended FMUs have it, but no inverse exists;
    "left": it does not show in a record of this kind, or is not linear in its sizes.
    """

    effect: str
    how: Literal["corrected", "simulated", "left"]


class Applied(Told):
    """A record corrected by a calibration, or by a diagnosis of another record, of its instrument.

    Attributes
    ----------
    rows : int
        of the record
    gravity_mps2, scale_plus, scale_minus, gamma, bias_g
        of the `Correction`, by a calibration
    levelled_at : str
        where the vertical was looked at: "positions", "rests" or "rows"
    levelling_error : LevellingError
    not_guaranteed : list of str
        why the levelling error is not guaranteed for this record; empty where it is
    gyros : str
        "corrected" where calibration and record have gyros
    effects : tuple of AppliedEffect
        of a diagnosis
    over, unit, rms_without, rms_with, max_without, max_with
        errors of the record simulated by FMUs, without and with the effects, over what `over` says; what is the
        record's own, its biases, is fitted to it in both. Absent where nothing can be run
    correction : Correction
        not published
    record : PositionRecord, RawRecord or StrapdownRecord
        corrected; None where nothing could be taken out; not published
    levelling : Levelling
        at each position, rest or row; not published
    """

    schema_: Literal["trihedron.applied/2"] = Field(default="trihedron.applied/2", alias="schema")
    rows: int
    gravity_mps2: float | None = None
    scale_plus: list[float] | None = None
    scale_minus: list[float] | None = None
    gamma: list[list[float]] | None = None
    bias_g: list[float] | None = None
    levelled_at: Literal["positions", "rests", "rows"] | None = None
    levelling_error: LevellingError | None = Field(default=None, alias="levelling_error_rad")
    not_guaranteed: list[str] | None = None
    gyros: Literal["corrected"] | None = None
    effects: tuple[AppliedEffect, ...] | None = None
    over: str | None = None
    unit: str | None = None
    rms_without: float | None = None
    rms_with: float | None = None
    max_without: float | None = None
    max_with: float | None = None
    warnings: list[str] = Field(default=[])
    correction: Correction | None = Field(default=None, exclude=True)
    record: Any = Field(default=None, exclude=True)
    levelling: Levelling | None = Field(default=None, exclude=True)

    def to_polars(self) -> "DataFrame | None":
        """The corrected readings: time_s, f1_mps2, f2_mps2, f3_mps2; None where nothing was taken out of any."""
        import polars as pl

        if self.record is None:
            return None
        force = {f"f{p + 1}_mps2": self.record.specific_force[:, p] for p in range(3)}
        return pl.DataFrame({"time_s": self.record.time_s, **force})


def apply_calibration(
    calibration: str | Path | Result,
    record: Source,
    *,
    noise_bound: float = 0.0,
    channels: Sequence[str] = (),
    stamps: str | None = None,
) -> Applied:
    """Correct the readings of a record by a calibration or its file; arguments and errors as of `trihedron.apply`.

    The noise bound is that of the averaged readings' own errors [g], for the error that remains after the correction.
    """
    if not (math.isfinite(noise_bound) and 0.0 <= noise_bound <= 1e-2):
        raise InputError(f"--noise-bound {exactly(noise_bound)}: must be a fraction of g from 0 to 0.01, as 1e-5")
    measured = read_record(record, channels=channels, stamps=stamps)
    if isinstance(calibration, str | Path):
        correction = read_correction(Path(calibration), measured.sha256)
    else:
        correction = correction_of(calibration.to_json(), "calibration", measured.sha256)
    at, still = "rows", measured
    if isinstance(measured, PositionRecord):
        at = "positions"
    elif isinstance(measured, RawRecord):
        rests = find_rests(measured)
        if any(rest.refused is None for rest in rests):
            at, still = "rests", average_rests(measured, rests)
    before_it = measured.about.get(CORRECTED_BY, "")
    if CALIBRATED in before_it:
        raise InputError(
            f"{measured.path}: is corrected already ({before_it}); apply the calibration to the record as measured"
        )
    better = corrected(correction, measured.specific_force)
    if not np.isfinite(better).all():
        raise InputError(f"{measured.path}: the corrected readings are not finite")
    warnings = list(measured.warnings)
    if correction.of_record:
        warnings.append(
            f"what each record has of its own is that of {correction.of_record}, the last that was calibrated"
        )
    gain = levelling(correction, still.specific_force / correction.gravity, noise_bound)
    before, after = gain.worst
    n = corrected(correction, still.specific_force) / correction.gravity
    source = f"{CALIBRATED}{correction.source or 'a record'} (SHA-256 {correction.sha256 or 'none'})"
    if before_it:
        source = f"{before_it}; then {source}"
    about = {CORRECTED_BY: source} | dict(measured.about) | {CORRECTED_BY: source}
    channels_of_gyros: dict[str, NDArray] = {}
    of_gyros: dict[str, Any] = {}
    if correction.gyros is not None and isinstance(measured, BenchRecord | StrapdownRecord):
        of_gyros = {"gyros": "corrected"}
        channels_of_gyros = _corrected_gyros(correction.gyros, measured, better / correction.gravity)
    return Applied(
        gravity_mps2=correction.gravity,
        scale_plus=correction.plus.tolist(),
        scale_minus=correction.minus.tolist(),
        gamma=correction.gamma.tolist(),
        bias_g=correction.bias.tolist(),
        rows=len(measured),
        levelled_at=at,
        not_guaranteed=broken_conditions(correction, measured, still, n, noise_bound),
        levelling_error_rad=LevellingError(as_read=before, corrected_at_most=after),
        warnings=warnings,
        correction=correction,
        record=replace(measured, specific_force=better, about=about, **channels_of_gyros),
        levelling=gain,
        **of_gyros,
    )


def _corrected_gyros(
    gyros: GyroCorrection, record: BenchRecord | StrapdownRecord, n: NDArray
) -> dict[str, NDArray[np.float64]]:
    """Return the corrected channels of a record's gyros by their names, at inputs (N, 3) [g]."""
    if record.rate is not None:
        return {"rate": gyros.corrected(record.rate, n)}
    if record.increment is None:
        return {}
    steps, first = np.diff(record.time_s), 0.0
    if len(steps):
        first = float(np.median(steps))
    return {"increment": gyros.corrected(record.increment, n, np.append(first, steps)[:, None])}


def write_parameter_set(result: Result, path: Path) -> None:
    """Write the calibrated block as an .ssv file, values with their intervals; both components have these parameters.

    Calibrated gyros go into a file of their own, NAME-gyros.ssv. A calibration of several records is written with the
    biases of the last. Raises an InputError if the calibration is not consistent, or the components do not accept a
    value.
    """
    try:
        content = of_one_record(result.to_json())
        block, intervals = calibrated_block(content), calibrated_intervals(content)
    except ValueError as error:
        raise InputError(f"--ssv {path}: {error}") from error
    about, source = "an accelerometer block", content.get("provenance")
    if source is not None:
        about = f"{source['record']} (SHA-256 {source['record_sha256'] or 'none'})"
    text = f"Calibration of {about}, noise bound {upwards(content['sigma']['value'], 3)} g, case (A1)"
    contents = {path: _checked_set(path, "AccelerometerBlock", block, intervals, text)}
    of_gyros = calibrated_gyros(content)
    if of_gyros is not None:
        beside_it = path.with_name(f"{path.stem}-gyros{path.suffix}")
        contents[beside_it] = _checked_set(beside_it, "GyroBlock", of_gyros[0], of_gyros[1], text)
    for target, written in contents.items():
        with whole_file(target) as temporary:
            temporary.write_bytes(written)


def _checked_set(path: Path, name: str, values: Parameters, intervals: Mapping[str, Interval], text: str) -> bytes:
    """Return the parameter set of a component; raise an InputError for values beyond its limits."""
    component = components()[name]
    for variable in component.interface:
        least, most = variable.within
        for number in np.ravel(values.get(variable.name, [])).tolist():
            if (least is not None and number < least) or (most is not None and number > most):
                raise InputError(
                    f"--ssv {path}: {variable.name} = {exactly(number)} is beyond what the component takes"
                )
    return parameter_set(component, values, text, intervals)
