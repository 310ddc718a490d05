"""Correction of readings by a calibration: the inverse of the calibrated block, with its guaranteed bound."""

import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ...fmus.parameters import (
    BY_GRAVITY,
    BY_HAND,
    CALIBRATIONS,
    calibrated_block,
    calibrated_elements,
    calibrated_intervals,
    calibration_of,
    checked_number,
    gives_parameters,
    known_values,
    of_one_record,
    shown_effects,
)
from ...models.arrays import Floats
from ...models.bench import BIAS, GYRO_PARAMETERS, MATRIX, SENSITIVITY
from ..calibrated import CalibratedEffect, Calibration, Open, Provenance, Sigma
from ..errors import InputError, one_line
from ..fields import checked_covariance
from ..files import LARGEST_RESULT, advice_on, bytes_of
from ..result import parsed_result
from ..rounding import digits
from .model import checked_mounting
from .targets import corners

WELL_POSED = 1e3
"""Gyros whose matrix is conditioned worse measure no three rates."""
SURE = 4.0
"""A difference of this number of standard errors occurs in less than one reading in ten thousand."""


@dataclass(frozen=True)
class GyroCorrection:
    """The inverse of calibrated gyros except for their lag, which remains in the readings.

    `bias` (3,) [rad/s], `matrix` (3, 3) I + Γ, `sensitivity` (3, 3) [rad/s per g]. `bias_sd`, `matrix_sd` and
    `sensitivity_sd` are standard errors, NaN where none is known.
    """

    bias: NDArray
    matrix: NDArray
    sensitivity: NDArray
    bias_sd: NDArray
    matrix_sd: NDArray
    sensitivity_sd: NDArray

    @staticmethod
    def of(calibration: Mapping[str, Any]) -> "GyroCorrection | None":
        """Return the gyros of a calibration's object; None where it has none, or not all of them.

        By hand their sensitivity to gravity and their lag count as 0 where the calibration does not have them.
        """
        needed = GYRO_PARAMETERS[: MATRIX.stop] if BY_HAND in calibration else GYRO_PARAMETERS
        estimates = known_values(calibration, needed)
        if estimates is None:
            return None
        deviations = dict.fromkeys(GYRO_PARAMETERS, 0.0)
        for entry in calibration["parameters"]:
            symbol, deviation = entry["symbol"], entry.get("standard_error")
            if symbol in GYRO_PARAMETERS:
                estimates[symbol] = checked_number(entry["estimate"], symbol)
                deviations[symbol] = math.nan if deviation is None else checked_number(deviation, symbol)
        values = np.array([estimates.get(symbol, 0.0) for symbol in GYRO_PARAMETERS])
        sd = np.array([deviations[symbol] for symbol in GYRO_PARAMETERS])
        matrix = np.eye(3) + values[MATRIX].reshape(3, 3)
        if not np.linalg.cond(matrix) < WELL_POSED:
            raise ValueError("the gyros' scale factors and misalignments have no inverse")
        return GyroCorrection(
            bias=values[BIAS],
            matrix=matrix,
            sensitivity=values[SENSITIVITY].reshape(3, 3),
            bias_sd=sd[BIAS],
            matrix_sd=sd[MATRIX].reshape(3, 3),
            sensitivity_sd=sd[SENSITIVITY].reshape(3, 3),
        )

    def corrected(self, reading: NDArray, n: NDArray, seconds: NDArray | float = 1.0) -> NDArray:
        """Rates (N, 3) [rad/s], or integrals over (N, 1) [s], from readings, at inputs (N, 3) [g]."""
        return np.linalg.solve(self.matrix, (reading - seconds * (self.bias + n @ self.sensitivity.T)).T).T

    def standard_errors(self, rate: NDArray, n: NDArray) -> Floats:
        """Return the standard errors (N, 3) [rad/s] of corrected rates (N, 3) [rad/s] at inputs (N, 3) [g].

        The parameters' errors count as independent.
        """
        variance = self.bias_sd**2 + rate**2 @ self.matrix_sd.T**2 + n**2 @ self.sensitivity_sd.T**2
        return np.sqrt(variance @ np.linalg.inv(self.matrix).T ** 2)


@dataclass(frozen=True)
class Correction:
    """The inverse of a calibrated block, Γ lower triangular, in units of `gravity`, the calibration's g [m/s²].

    `plus`, `minus` (3,) are 1 + Γ⁺ and 1 + Γ⁻ of each accelerometer, `gamma` (3, 3) is Γ below the diagonal and 0
    elsewhere, `bias` (3,) is in g. `covariance` (9, 9) is that of the six elements of Γ row by row and the biases [g],
    NaN where no standard error is known. `low`, `high` (3, 3, 3, 3) are the least and the greatest error of the reading
    of accelerometer p at the input (i, j, k) − 1 [g]; None where the calibration guarantees nothing. `mounting` (3, 3)
    is that of the calibration's record, None of several. `of_record` is the label of the record to which these biases
    belong, of several calibrated together, where it is not this one.

    `verdict` is that of the calibration, `pose_error` its predicted standard error of |f| [g] in the worst pose, and
    `open` its open directions in words. `noise_bound` [g] is σ of the calibration and `sigma_kind` its kind. `source`,
    `sha256`, `temperature` [°C] (least and most) and `comments` are those of its record. `effects` of accelerometers
    and gyros were calibrated beside it and are not corrected; nor is what the readings have `in_motion`, in words.
    """

    gravity: float
    plus: NDArray
    minus: NDArray
    gamma: NDArray
    bias: NDArray
    low: NDArray | None = None
    high: NDArray | None = None
    mounting: NDArray | None = None
    of_record: str = ""
    gyros: GyroCorrection | None = None
    covariance: NDArray = field(default_factory=lambda: np.full((9, 9), np.nan))
    noise_bound: float = 0.0
    sigma_kind: str = "unknown"
    verdict: str = ""
    pose_error: float | None = None
    open: tuple[str, ...] = ()
    source: str = ""
    sha256: str = ""
    temperature: tuple[float, float] | None = None
    comments: Mapping[str, str] = field(default_factory=dict)
    effects: tuple[str, ...] = ()
    in_motion: tuple[str, ...] = ()

    def __call__(self, readings: ArrayLike, rates: ArrayLike | None = None) -> Any:
        """Correct readings of the accelerometers, and of the gyros where `rates` are given.

        Parameters
        ----------
        readings : array, shape (3,) or (N, 3)
            of accelerometers 1, 2, 3 [m/s²]; neither time nor angles are needed
        rates : array of the same shape, optional
            readings of gyros 1, 2, 3 [rad/s] at the same times

        Returns
        -------
        ndarray, or two of them
            specific force [m/s²], and with `rates` the angular rate [rad/s], both in the calibration's axes. Axis 1 is
            accelerometer 1; axis 2 lies in the plane of accelerometers 1 and 2

        Raises
        ------
        InputError
            for another shape, or rates where the calibration has no gyros
        """
        force = corrected(self, _readings_of(readings, "readings"))
        if rates is None:
            return force
        if self.gyros is None:
            raise InputError("rates: the calibration has no gyros; leave them out")
        turning = _readings_of(rates, "rates")
        if turning.shape != force.shape:
            raise InputError(f"rates: have the shape {turning.shape}, the readings {force.shape}; one row for each")
        n = np.atleast_2d(force) / self.gravity
        return force, self.gyros.corrected(np.atleast_2d(turning), n).reshape(force.shape)

    def standard_errors(self, readings: ArrayLike) -> Floats:
        """Return the standard error of corrected readings, by the calibration alone.

        Parameters
        ----------
        readings : array, shape (3,) or (N, 3)
            of accelerometers 1, 2, 3 [m/s²]

        Returns
        -------
        ndarray of the same shape
            [m/s²]; NaN where the calibration knows no standard error
        """
        force = self(readings)
        variance = np.einsum("nii->ni", _covariance_of_input(self, np.atleast_2d(force) / self.gravity))
        return self.gravity * np.sqrt(variance).reshape(force.shape)

    def inputs_of(self, specific_force: NDArray) -> Floats:
        """Return inputs (N, 3) [g] by readings (N, 3) [m/s²]."""
        return corrected(self, specific_force) / self.gravity

    def bound_at(self, n: NDArray, noise_bound: float | NDArray) -> Floats:
        """Return the largest difference of true inputs from corrected ones n (N, 3) [g], of either sign.

        Without a guarantee it is `SURE` standard errors.
        """
        if self.low is None:
            variance = np.einsum("nii->ni", _covariance_of_input(self, n))
            return SURE * np.sqrt(variance) + noise_bound
        least, most = remaining_error(self, n, noise_bound)
        return np.maximum(np.abs(least), np.abs(most))


def _readings_of(values: ArrayLike, name: str) -> Floats:
    """Return readings as an array whose last axis has three elements; an InputError for anything else."""
    try:
        readings = np.asarray(values, dtype=np.float64)
    except (TypeError, ValueError) as error:
        raise InputError(f"{name}: are not numbers; an array (N, 3) is needed") from error
    if readings.ndim not in (1, 2) or readings.shape[-1] != 3:
        raise InputError(f"{name}: have the shape {readings.shape}; an array (N, 3) or (3,) is needed")
    return readings


def _covariance_of_input(correction: Correction, n: NDArray) -> Floats:
    """Return the covariance (N, 3, 3) of corrected inputs n (N, 3) [g] by that of the parameters."""
    slopes = np.zeros((len(n), 3, 9))
    for element, (row, column) in enumerate(zip(*np.tril_indices(3), strict=True)):
        slopes[:, row, element] = n[:, column]
    slopes[:, np.arange(3), 6 + np.arange(3)] = 1.0
    back = np.linalg.inv(correction.gamma + np.diag(0.5 * (correction.plus + correction.minus)))
    slopes = back @ slopes
    return slopes @ correction.covariance @ slopes.transpose(0, 2, 1)


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
        raise InputError(f"{path}: is not a calibration{advice}")
    if isinstance(content, Mapping):
        try:
            parsed_result(content, dict.fromkeys(CALIBRATIONS, Calibration), str(path))
        except InputError as error:
            raise InputError(f"{error}; calibrate again") from error
    return correction_of(content, str(path), sha256)


def correction_of(calibration: Mapping[str, Any], where: str, sha256: str = "") -> Correction:
    """Return the correction of a calibration's object; raise an InputError, which begins with `where`, if it has none.

    For a calibration of several records the correction is that of the record with this SHA-256, else of the last one.
    """
    record = ""
    if isinstance(calibration, Mapping) and calibration.get("effects") and not calibration.get("parameters"):
        raise InputError(
            f"{where}: has the sizes of effects alone, and no parameters; calibrate without --with, or use FMUs with "
            "these effects (calibrate --export)"
        )
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
        low, high = _reading_errors(calibration) or (None, None)
        gyros = GyroCorrection.of(calibration)
        covariance = _covariance(calibration)
    except ValueError as error:
        raise InputError(f"{where}: {error}") from error
    except (KeyError, TypeError, IndexError, AttributeError) as error:
        raise InputError(f"{where}: is not as its schema says ({one_line(str(error))}); calibrate again") from error
    bias, mounting = np.array(block["bias"]), _mounting(calibration)
    correction = Correction(block["gravity"], plus, minus, gamma, bias, low, high, mounting, record, gyros, covariance)
    return replace(correction, **_origin(calibration, where))


def _covariance(calibration: Mapping[str, Any]) -> Floats:
    """Return the covariance (9, 9) of Γ and biases: as by hand, else by the standard errors; NaN where it is unknown.

    Raises a ValueError for one that is none.
    """
    of_hand = calibration.get(BY_HAND)
    if isinstance(of_hand, Mapping) and of_hand.get("covariance") is not None:
        try:
            return checked_covariance(of_hand["covariance"])
        except ValueError as error:
            raise ValueError(f"by_hand.covariance: {error}; calibrate again") from error
    elements = calibrated_elements(calibration, "standard_error")
    sd = {name: math.nan if value is None else value for name, value in elements.items()}
    deviations = []
    for symbol in BY_GRAVITY:
        number = int(symbol[-1])
        if symbol.startswith("bias"):
            deviations.append(sd[f"bias[{number}]"])
        elif symbol[-2] == symbol[-1]:
            deviations.append(max(sd[f"scale_error_plus[{number}]"], sd[f"scale_error_minus[{number}]"]))
        else:
            deviations.append(sd[symbol])
    return np.diag(np.square(deviations))


def _origin(calibration: Mapping[str, Any], where: str) -> dict[str, Any]:
    """Return the basis of a calibration's promise: σ, and the digest, temperatures and comments of its record."""
    try:
        sigma = Sigma.model_validate(calibration_of(calibration)["sigma"])
        values: dict[str, Any] = {"noise_bound": sigma.value or 0.0, "sigma_kind": sigma.kind}
        values["verdict"] = str(calibration["verdict"])
        values["open"] = tuple(_open_words(calibration))
        if calibration.get(BY_HAND) is not None:
            values["pose_error"] = checked_number(calibration[BY_HAND]["pose_error"]["worst_g"], "pose_error")
        effects = [CalibratedEffect.model_validate(effect) for effect in calibration.get("effects", ())]
        values["effects"] = tuple(effect.effect for effect in effects if effect.in_readings)
        values["in_motion"] = tuple(_in_motion(calibration, effects))
        if calibration.get("provenance") is None:
            return values
        source = Provenance.model_validate(calibration["provenance"])
    except (KeyError, TypeError, ValueError) as error:
        raise InputError(
            f"{where}: its sigma, provenance or effects are not as the schema says; calibrate again"
        ) from error
    values |= {"source": source.record, "sha256": source.sha256, "comments": source.comments}
    if source.temperature:
        values["temperature"] = (min(source.temperature), max(source.temperature))
    return values


def _open_words(calibration: Mapping[str, Any]) -> list[str]:
    """Return the open directions of a calibration's object in words, each with what closes it."""
    words = []
    for entry in calibration.get("open", ()):
        direction = Open.model_validate(entry)
        closing = f" (closed by {direction.close_by})" if direction.close_by else ""
        words.append(f"{', '.join(direction.parameters)}{closing}")
    return words


def _in_motion(calibration: Mapping[str, Any], effects: Sequence[CalibratedEffect]) -> list[str]:
    """Return what no equation of readings takes out in motion, in words: lags, places, effects of the gyros."""
    sizes: dict[str, list[float]] = {}
    for place, entries in shown_effects(calibration).items():
        values = [checked_number(entry["estimate"], entry["symbol"]) for entry in entries]
        sizes[place.effect] = sizes.get(place.effect, []) + values
    words = []
    for effect, sensors in (("latency", "gyros"), ("accelerometer-lag", "accelerometers")):
        if effect in sizes:
            words.append(f"the {sensors}' lag of {digits(1e3 * sizes[effect][0], 3)} ms: shift their time stamps by it")
    if "lever-arm" in sizes:
        most = digits(1e3 * max(map(abs, sizes["lever-arm"])), 3)
        words.append(f"the accelerometers are up to {most} mm off the centre: ω × (ω × r) + dω/dt × r stays")
    words += [f"{effect.effect} stays in the readings" for effect in effects if effect.where.startswith("gyro")]
    return words


def _mounting(calibration: Mapping[str, Any]) -> NDArray | None:
    """Return the only mounting (3, 3) of a calibration's object; None where it has none or several."""
    try:
        (matrix,) = calibration["mountings"].values()
        return checked_mounting(matrix, "mountings")
    except (KeyError, AttributeError, TypeError, ValueError, InputError):
        return None


def _reading_errors(calibration: Mapping[str, Any]) -> tuple[NDArray, NDArray] | None:
    """Lower and upper ends (3, 3, 3, 3) of the `corners` in a calibration's object; NaN at other inputs.

    By hand, and beside effects in motion, they come from the parameters' intervals. None where no parameters keep every
    reading within its bound, and where an interval is open.
    """
    if not gives_parameters(calibration["verdict"], calibration["estimator"]):
        return None
    if BY_HAND in calibration or (calibration.get("effects") and not calibration.get("reading_errors")):
        return _errors_of_intervals(calibration)
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


def _errors_of_intervals(calibration: Mapping[str, Any]) -> tuple[NDArray, NDArray] | None:
    """Lower and upper ends as of `_reading_errors` by the intervals of all parameters; None where one is open."""
    intervals = calibrated_intervals(calibration)
    if any(None in interval for interval in intervals.values()):
        return None
    ends = np.full((2, 3, 3, 3, 3), np.nan)
    for p, n in corners():
        sides = np.array(intervals[f"bias[{p}]"])
        for column in range(1, p):
            sides = sides + np.sort(n[column - 1] * np.array(intervals[f"gamma_{p}{column}"]))
        sign = "plus" if n[p - 1] > 0 else "minus"
        sides = sides + np.sort(n[p - 1] * np.array(intervals[f"scale_error_{sign}[{p}]"]))
        ends[:, p - 1, n[0] + 1, n[1] + 1, n[2] + 1] = sides
    return ends[0], ends[1]


def corrected(correction: Correction, specific_force: NDArray) -> NDArray:
    """Specific force (..., 3) [m/s²] from readings (..., 3) [m/s²], by forward substitution.

    An accelerometer's input has the sign of its reading less bias and cross terms, since its scale factors are
    positive: that chooses Γ⁺ (above zero) or Γ⁻.
    """
    right = specific_force / correction.gravity - correction.bias
    n = np.zeros_like(right)
    for p in range(3):
        along_axis = right[..., p] - n[..., :p] @ correction.gamma[p, :p]
        n[..., p] = along_axis / np.where(along_axis > 0.0, correction.plus[p], correction.minus[p])
    return correction.gravity * n


def error_bounds(correction: Correction, n: NDArray) -> tuple[NDArray, NDArray]:
    """Return the least and the greatest error (N, 3) [g] of the block's readings at inputs (N, 3) [g].

    The greatest error over all possible parameters is convex in the input as long as its signs stay. Its values at the
    corners of a simplex around the input therefore bound it.
    """
    assert correction.low is not None
    assert correction.high is not None
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
        assert end is not None
        for table in (end[0, :, 1, 1], end[1, :, :, 1], end[2]):
            steps = [np.abs(np.diff(table, axis=axis)).max() for axis in range(table.ndim)]
            worst = max(worst, sum(steps))
    return min(float(worst), 0.5)


@dataclass(frozen=True)
class Levelling:
    """Error of the vertical that readings at rest give, in each row [rad].

    `before` (N,) is the angle between the readings as they are and as corrected; `after` (N,) is guaranteed: the
    corrected readings are not further from the truth. It is None where the calibration guarantees nothing.
    """

    before: NDArray
    after: NDArray | None

    @property
    def worst(self) -> tuple[float, float | None]:
        """The greatest `before`, and the greatest `after`."""
        return float(self.before.max()), None if self.after is None else float(self.after.max())


def levelling(correction: Correction, reading: NDArray, noise_bound: float = 0.0) -> Levelling:
    """The error of levelling by readings (N, 3) [g] of a block at rest, before and after the correction."""
    reading = np.asarray(reading, dtype=float)
    n = corrected(correction, reading * correction.gravity) / correction.gravity
    size = np.linalg.norm(n, axis=1)
    before = np.arctan2(np.linalg.norm(np.cross(reading, n), axis=1), np.einsum("ij,ij->i", reading, n))
    if correction.low is None:
        return Levelling(before, None)
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
