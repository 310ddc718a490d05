"""Inspection of a strapdown record: sampling, rests, moves, excitation, and instrument errors from its rests.

Accelerometers are calibrated by the norm of gravity: least squares beside guaranteed bounds.
"""

from itertools import combinations, pairwise
from typing import TYPE_CHECKING, ClassVar, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from ...fmus.units import STANDARD_GRAVITY
from ...models.bench import EARTH_RATE
from ..bounded.programmes import chebyshev_radius
from ..calibrated import Calibration, Verdict
from ..errors import InputError
from ..records import StrapdownRecord
from ..result import ABSENT, Array, Result
from .determinacy import DETERMINED, LEAST_SD, Determinacy, closing_poses
from .norm import inputs_of, norm_equations, norm_values, standard_deviations
from .rest_noise import RestNoise, factor_for, gyro_noise, rest_lengths
from .rests import RecordSampling, Rests, quiet_rests, rates_of, sampling_of
from .trust import TrustCheck, judged, trust_of, turning_of
from .turning import TurningCheck

if TYPE_CHECKING:
    from polars import DataFrame

from collections.abc import Mapping, Sequence
from types import MappingProxyType

from ..calibrated import UNITS, Open, Parameter, Sigma
from .determinacy import USABLE, candidate_poses
from .norm import LARGEST, NAMES, UNITS_OF
from .possible import central_parameters, nearest_possible, possible_forces

ITERATIONS = 30


def _calibration(
    verdict: Verdict,
    radius: float | None = None,
    missing: Sequence[str] = (),
    columns: Mapping[str, NDArray] = MappingProxyType({}),
) -> Calibration:
    """Return the calibration with some columns (9,) of numbers, and the poses that are missing, in words."""
    parameters = []
    for k, name in enumerate(NAMES):
        numbers: dict[str, float | None] = dict.fromkeys(("estimate", "standard_error", "low", "high"))
        for key, column in columns.items():
            numbers[key] = float(column[k])
        determined = "estimate" in columns
        parameters.append(Parameter(symbol=name, name=name, unit=UNITS_OF[name], determined=determined, **numbers))
    estimator = None
    if columns:
        estimator = "least squares"
    unseen = []
    for pose in missing:
        unseen.append(Open(parameters=list(NAMES), close_by=pose))
    return Calibration(
        verdict=verdict,
        sigma=Sigma.of(None, "three Allan deviations of each mean at rest"),
        radius=radius,
        estimator=estimator,
        parameters=parameters,
        open=unseen,
        units={"radius": "1", "parameters": UNITS["parameters"]},
    )


def calibrate_by_norm(reading: NDArray, bound: NDArray) -> Calibration:
    """Calibrate the accelerometers from rests of unknown direction.

    Parameters
    ----------
    reading : (K, 3) array
        mean readings at the rests [g]
    bound : (K, 3) array
        bounds of their errors [g], positive

    Returns
    -------
    Calibration with the parameters of NAMES: least squares, standard errors from their residuals, and the guaranteed
    ends. Poses, in words, would close open parameters
    """
    x = np.zeros(9)
    determinacy = Determinacy.of(norm_equations(x, reading)[1], standard_deviations(bound))
    missing = [pose.words for pose in closing_poses(determinacy, DETERMINED)]
    if len(reading) < 9 or determinacy.worst > USABLE:
        return _calibration("insufficient", missing=missing)
    for _ in range(ITERATIONS):
        residual, slopes, _ = norm_equations(x, reading)
        change = np.linalg.lstsq(slopes, -residual, rcond=None)[0]
        x = x + change
        if np.abs(x).max() > LARGEST:
            return _calibration("falsified", columns={"estimate": x})
        if np.abs(change).max() < 1e-14:
            break
    residual, slopes, _ = norm_equations(x, reading)
    columns = {"estimate": x}
    freedom = len(reading) - 9
    if freedom:
        inverse = np.linalg.inv(slopes.T @ slopes)
        columns["standard_error"] = np.sqrt(np.diag(inverse) * (residual @ residual) / freedom)
    run = np.zeros(len(reading), dtype=int)
    possible = possible_forces(x, reading, bound, run)
    if possible.radius > 1.0:
        return _calibration("falsified", possible.radius, columns=columns)
    if possible.ends is None:
        return _calibration("insufficient", possible.radius, missing or list(candidate_poses()), columns)
    centre = central_parameters(x, reading, bound, run)[1]
    columns["estimate"] = nearest_possible(x, determinacy.covariance, centre, reading, bound, run)
    columns |= {"low": possible.ends[0], "high": possible.ends[1]}
    return _calibration("consistent", possible.radius, columns=columns)


LEAST_BOUND = 1e-9
"""Bounds of means [g], [rad/s] are not taken for less: arithmetic has errors too."""
EXCITED = 5.0
"""Rms rate in moves over the noise of a sample from which an axis is excited."""
SPARE = 3
"""Rests that a model needs beside its number of parameters for each gyro."""
DISTINCT = 1e-3
"""Least singular value, over the largest, of columns of size one that can be told apart."""
SHUFFLES, CHANCE = 200, 0.01
"""Largest part of shuffled rests that a named term may explain as well."""
WORDS = {
    "drift": "drifting with time",
    "gravity": "dependent on the direction of gravity",
    "temperature": "dependent on temperature",
}
"""What may be added to a constant."""


class RestModel(Result):
    """A model of the gyros' means at rest, and whether bounded errors refute it.

    Attributes
    ----------
    terms : tuple of str
        beside the constant, of WORDS
    radius : float
        least possible largest residual over its bound; refused above 1
    by_chance : float or None
        part of 200 shuffles of the rests in which the terms fit as well; None of the constant and of refused models
    stands : bool
        whether it is one of the smallest that are not refused, and not explained by chance
    coefficients : tuple of tuple of float
        for each gyro: the constant [rad/s], then the terms' [rad/s/h], three [rad/s/g], [rad/s/K]
    """

    terms: tuple[str, ...]
    radius: float
    by_chance: float | None = None
    stands: bool = False
    coefficients: tuple[tuple[float, ...], ...]

    @property
    def title(self) -> str:
        """In words."""
        return " and ".join(WORDS[term] for term in self.terms) or "constant"


class GyrosAtRest(Result):
    """Models of the gyros' means at rest, and the verdict on them.

    Attributes
    ----------
    verdict : str
        "constant", "named": one smallest model stands; "ambiguous": several of that size; "insufficient": too few rests
        to refuse anything. "wandering": none stands, or only terms that fit shuffled rests as well; or the means differ
        by more than noise, for any terms
    tried : tuple of RestModel
        all, in the order of their size
    not_tried : tuple of str
        terms that the rests do not allow to try, with the reason
    """

    verdict: str
    tried: tuple[RestModel, ...] = Field(alias="models")
    not_tried: tuple[str, ...]

    @property
    def standing(self) -> tuple[RestModel, ...]:
        """Return the fitting models of the smallest size."""
        standing = []
        for model in self.tried:
            if model.stands:
                standing.append(model)
        return tuple(standing)


class Move(Result):
    """A move between two rests: its duration, and the integral of the rate's size less the median mean at rest."""

    length_s: float
    turn_rad: float


class PosesSeen(Result):
    """Predicted errors of the accelerometers by the poses of a record's rests.

    Attributes
    ----------
    worst_error_g, rms_error_g : float
        predicted standard error of |f| in poses that were not measured: in the worst, and over all
    missing : tuple of str
        poses that make the accelerometers determined, the most useful first
    error_with_these_g : float
        predicted standard error in the worst pose when these are measured, too
    """

    worst_error_g: float
    rms_error_g: float
    missing: tuple[str, ...]
    error_with_these_g: float


class RecordSeen(Result):
    """The record that was inspected, as its JSON names it."""

    rows: int
    sha256: str
    warnings: tuple[str, ...]


class AtTable(Result):
    """Accelerometers of a bench record at rest against the table's angles, judged as `calibrate` does.

    `noise_bound` is a fraction of g; `lacks` says why they are not judged, where they are not.
    """

    verdict: Verdict
    positions: int
    radius: float | None = None
    noise_bound: float | None = None
    noise_bound_basis: str = ""
    lacks: str = ""


class Inspection(Result):
    """Result of the inspection of a record.

    Attributes
    ----------
    gravity : float
        model value [m/s²]
    input : str
        quantity that the gyros gave
    temperature, true_attitude : bool
        true if the record has them
    moves : tuple of Move
        between rests
    excitation : (3,) array
        rms of each gyro's rate outside the rests [rad/s]
    poses : PosesSeen or None
        None where there are no rests
    accelerometers : Calibration or None
        None where there are no rests, their noise cannot be told, or a table tells more
    at_table : AtTable or None
        of a bench record; None for any other
    """

    omitted: ClassVar[frozenset[str]] = frozenset({"at_table", "poses"})

    schema_: Literal["trihedron.inspection/1"] = Field(default="trihedron.inspection/1", alias="schema")
    seen: RecordSeen = Field(alias="record")
    gravity: float = Field(alias="gravity_mps2")
    input: Literal["rates", "increments"]
    sampling: RecordSampling
    temperature: bool
    true_attitude: bool
    rests: Rests
    moves: tuple[Move, ...]
    excitation: Array = Field(alias="rate_rms_radps")
    turning: TurningCheck
    trust: TrustCheck = TrustCheck()
    poses: PosesSeen | None = None
    accelerometers: Calibration | None
    gyros: GyrosAtRest | None = Field(alias="gyros_at_rest")
    at_table: AtTable | None = None
    measured: StrapdownRecord = Field(default=ABSENT, exclude=True)

    @property
    def record(self) -> StrapdownRecord:
        """The record itself; an inspection that comes back from its JSON has none."""
        return self.measured

    def to_polars(self) -> "DataFrame":
        """A row for each rest: time_s, length_s."""
        import polars as pl

        return pl.DataFrame({"time_s": self.rests.time_s, "length_s": self.rests.length_s})


def inspect_record(
    record: StrapdownRecord,
    *,
    gravity: float = STANDARD_GRAVITY,
    trust: bool = False,
    parted: StrapdownRecord | None = None,
) -> Inspection:
    """Inspect a strapdown record: its sampling, rests and moves, and its gyros and accelerometers at rest.

    Nothing is resampled or repaired: gaps, jitter, saturated samples and wrong units are stated.

    Parameters
    ----------
    record : StrapdownRecord
    gravity : float
        model value [m/s²]; a wrong one is in every scale factor
    trust : bool
        whether a person knows that the record is right: what speaks against it is then a warning
    parted : StrapdownRecord, optional
        the record with a gap in its times wherever it is cut: each section is then judged by itself

    Raises
    ------
    InputError
        fewer than 16 rows, or gravity that is none
    """
    if not 1.0 <= gravity <= 100.0:
        raise InputError(f"--gravity {gravity!r}: gravity in m/s2 is needed, 1 to 100")
    sampling = sampling_of(record)
    rests = quiet_rests(record, sampling)
    rate = rates_of(record)
    moving = np.ones(len(record), dtype=bool)
    for rows in rests.rows:
        moving[rows] = False
    level = excitation = np.zeros(3)
    if len(rests):
        level = np.median(rests.rate, axis=0)
    turning = turning_of(record, sampling, rests)
    if parted is None or parted is record:
        check = judged(record, sampling, rests, turning, gravity).known(trust)
    else:
        check = trust_of(parted, gravity).known(trust)
    if moving.any():
        excitation = np.sqrt(np.mean((rate[moving] - level) ** 2, axis=0))
    calibration = gyros = None
    if len(rests) and rests.force_scatter is not None and rests.rate_scatter is not None:
        bound = np.maximum(rests.force_scatter / gravity, LEAST_BOUND)
        calibration = calibrate_by_norm(rests.force / gravity, bound)
        x = norm_values(calibration) if calibration.verdict == "consistent" else None
        parameters = np.zeros(9)
        if x is not None:
            parameters = x
        up = inputs_of(parameters, rests.force / gravity)
        if noise_at_rest := gyro_noise(record, rests, sampling.period, up):
            gyros = gyros_at_rest(rests, noise_at_rest, rest_lengths(rests, sampling.period), up)
    return Inspection(
        record=RecordSeen(rows=len(record), sha256=record.sha256, warnings=record.warnings),
        measured=record,
        gravity_mps2=gravity,
        input="rates" if record.rate is not None else "increments",
        sampling=sampling,
        temperature=record.temperature is not None,
        true_attitude=record.attitude is not None,
        rests=rests,
        moves=_moves(record, rests, rate - level),
        rate_rms_radps=excitation,
        turning=turning,
        trust=check,
        poses=poses_seen(rests, gravity) if len(rests) else None,
        accelerometers=calibration,
        gyros_at_rest=gyros,
    )


def poses_seen(rests: Rests, gravity: float) -> PosesSeen:
    """Return the predicted error of a pose that was not measured, from the poses of the rests."""
    sd: NDArray | float = LEAST_SD
    if rests.force_scatter is not None:
        sd = standard_deviations(rests.force_scatter / gravity)
    determinacy = Determinacy.of(norm_equations(np.zeros(9), rests.force / gravity)[1], sd)
    poses = closing_poses(determinacy, DETERMINED)
    after = poses[-1].after if poses else determinacy
    return PosesSeen(
        worst_error_g=determinacy.worst,
        rms_error_g=determinacy.rms,
        missing=tuple(pose.words for pose in poses),
        error_with_these_g=after.worst,
    )


def _moves(record: StrapdownRecord, rests: Rests, rate: NDArray) -> tuple[Move, ...]:
    """Duration and turn of each move between rests."""
    speed = np.linalg.norm(rate, axis=1)
    steps = 0.5 * (speed[1:] + speed[:-1]) * np.diff(record.time_s)
    moves = []
    for before, behind in pairwise(rests.rows):
        first, last = before.stop - 1, behind.start
        length = float(record.time_s[last] - record.time_s[first])
        moves.append(Move(length_s=length, turn_rad=float(steps[first:last].sum())))
    return tuple(moves)


def gyros_at_rest(rests: Rests, noise: RestNoise, seconds: NDArray, up: NDArray) -> GyrosAtRest:
    """Find the smallest model of the gyros' means at rest.

    Earth's rotation is in the means; without heading its direction is not known, so its size widens the bounds. Where
    the means differ by more than the gyros' noise makes, whatever they depend on, no model stands.

    Parameters
    ----------
    rests : Rests
    noise : RestNoise
        of the gyros
    seconds : (K,) array
        lengths of the rests
    up : (K, 3) array
        inputs of the accelerometers [g]
    """
    time_s, rate, temperature = rests.time_s, rests.rate, rests.temperature
    bound = np.maximum(factor_for(rate.size) * np.sqrt(noise.rate_square(seconds)), LEAST_BOUND) + EARTH_RATE
    terms = {"drift": (time_s - time_s[:1]).reshape(-1, 1) / 3600.0, "gravity": up}
    not_tried = []
    if temperature is None:
        not_tried.append("temperature: not in the record")
    elif np.ptp(temperature) > 0.0:
        terms["temperature"] = temperature.reshape(-1, 1) - 20.0
    else:
        not_tried.append("temperature: does not change")
    models: list[RestModel] = []
    for size in range(len(terms) + 1):
        fits = []
        for chosen in combinations(terms, size):
            design = np.hstack([np.ones((len(rate), 1)), *(terms[term] for term in chosen)])
            why = _hindrance(design)
            if why is None:
                model = _rest_model(chosen, design, rate, bound, steady=not noise.unsteady)
                if model.radius <= 1.0:
                    fits.append(model)
                else:
                    models.append(model)
            elif size <= 1:
                not_tried.append(f"{' and '.join(chosen) or 'constant'}: {why}")
        models += fits
        if fits:
            standing = sum(model.stands for model in fits)
            verdict = ("wandering", "named", "ambiguous")[min(standing, 2)]
            if standing and not size:
                verdict = "constant"
            return GyrosAtRest(verdict=verdict, models=tuple(models), not_tried=tuple(not_tried))
    verdict = "wandering" if models else "insufficient"
    return GyrosAtRest(verdict=verdict, models=tuple(models), not_tried=tuple(not_tried))


def _rest_model(terms: tuple[str, ...], design: NDArray, rate: NDArray, bound: NDArray, *, steady: bool) -> RestModel:
    """Return a model (K, n) of the means at rest; it fits if within the bounds where shuffled rests are not."""
    radius, coefficients, chance = 0.0, [], None
    for p in range(3):
        least, x, _ = chebyshev_radius(design, rate[:, p], bound[:, p])
        radius = max(radius, least)
        coefficients.append(tuple(x.tolist()))
    if terms and radius <= 1.0:
        chance = _by_chance(design, rate, bound, radius)
    stands = radius <= 1.0 and steady and (chance is None or chance <= CHANCE)
    return RestModel(terms=terms, radius=radius, by_chance=chance, stands=stands, coefficients=tuple(coefficients))


def _by_chance(design: NDArray, rate: NDArray, bound: NDArray, radius: float) -> float:
    """Part of shuffles of the rests in which a model (K, n) does as well."""
    rng = np.random.default_rng(0)
    as_well = 0
    for _ in range(SHUFFLES):
        order = rng.permutation(len(rate))
        as_well += all(chebyshev_radius(design, rate[order, p], bound[order, p])[0] <= radius for p in range(3))
    return as_well / SHUFFLES


def _hindrance(design: NDArray) -> str | None:
    """Why a model cannot be tried; None where it can."""
    if len(design) < design.shape[1] + SPARE:
        return f"{design.shape[1] + SPARE} rests are needed, not {len(design)}"
    size = np.abs(design).max(axis=0)
    if not size.all():
        return "nothing changes"
    singular = np.linalg.svd(design / size, compute_uv=False)
    if singular[-1] > DISTINCT * singular[0]:
        return None
    return "the rests do not tell its terms apart"
