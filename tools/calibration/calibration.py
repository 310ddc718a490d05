"""The procedure of `trihedron calibrate`: from a position record to values with guaranteed errors."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import product
from math import isfinite
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ...fmus.parameters import GRAVITIES
from ...fmus.units import STANDARD_GRAVITY
from ...models.arrays import Floats
from ...models.bench import SYMMETRIC_PAIRS, admissible, nominal_input, up
from ..bounded.programmes import RELATIVE_TOLERANCE, SolverError, least_squares
from ..calibrated import (
    Calibration,
    KnownBefore,
    Parameter,
    Provenance,
    Reading,
    Sigma,
    TablePosition,
    Verdict,
)
from ..errors import InputError, said_of
from ..records import BenchRecord, PositionRecord
from ..records.channels import (
    LARGEST_MISFIT,
    LEAST_MISFIT,
    PERMUTATIONS,
    SENSES,
    USUAL,
    Channels,
    advice,
    far_better,
    reading_of,
)
from ..records.columns import CORRECTED_BY, CORRECTED_WITHIN
from ..records.noise import NoiseBound, noise_bound_from, noise_bound_of
from ..records.sigma import Fitted
from ..records.steps import AngleSteps
from ..room import FEWER_POSITIONS, Room
from ..rounding import digits, exactly, upwards
from .estimates import Solution, fit, open_directions, solve_system
from .model import (
    Linearisation,
    Parametrisation,
    Positions,
    every_position,
    mountings_for,
    parametrise,
    reading_jacobian,
    table_position,
)
from .targets import (
    Target,
    asked_priors,
    asked_targets,
    convention_targets,
    error_weights,
    parameter_limits,
    unit_of,
    with_priors,
    words_of,
)

STANDARD_BOUNDS = (3e-3, 1e-2)
SCALE_FACTORS = (0.5, 1.5)
"""What an accelerometer may read of its input: beyond that it is dead or reversed, or the units are wrong."""
DEAD = 0.01
"""Least part of the space of the inputs that the readings of an accelerometer span."""
NOISE_BOUNDS = (1e-12, 1e-2)
"""Noise bounds that can be used: above rounding, and small enough that the model is smooth on their scale."""
ROOM = Room("a calibration", "positions", FEWER_POSITIONS, 2.4e8, 3500.0)
SAY_THE_NOISE = (
    "give --noise-sd, the standard deviation of one averaged reading, which the averages of a static record show, or "
    "--noise-bound, which none exceeds; both are fractions of g, as 3e-6 and 1e-5"
)
"""What to do where nothing tells σ."""
ROUNDING = 2e-15
"""Largest error of the evaluation of readings and model, as a fraction of g."""
WIDE = 2.0
"""Change of readings [σ] from which steps of the encoders may falsify a model."""
MOST_ALONG = 0.3
"""Largest part of a misfit by errors of angles that is along gravity, where other parameters cause that."""
LEAST_OF_ROUNDING, MOST_OF_ROUNDING = 0.5, 1.6
"""The least and the largest misfit over that of rounding, rms."""
MOST_OF_HALF_STEP = 1.5
"""The largest error of a fit to rounded angles, over that of half a step."""
LEAST_OF_USUAL_ROW = 0.25
"""The least error of a usual row over that of rounding: if few rows err, these are wrong, and the angles are exact."""
ROBUST_ROUNDS = 12
"""Rounds of least squares to a fit that few rows cannot draw."""
COARSE = 0.5
"""Half a step of readings over σ from which a warning names the step."""
NOTICEABLE = 0.1
"""Part of σ from which a warning names a comment line that adds to it."""
FEWEST_PASTED = 3
"""Least number of consecutive rows that stand in a record twice, with all digits: they were pasted."""
SMALL_RADIUS = 0.1
"""Number of readings beside the parameters, and the part of σ that their largest error rarely stays below."""
FEWEST_SPARE = 12
FAR, MOST_FAR = 0.2, 3
"""No parameter of an aligned bench is as large as the first value [1], [rad], [g]; the second is the number of larger
ones that a message names."""
GRID_STEP_DEG = 15
WELL_DETERMINED = 2.0
"""Standard deviation of a target over that of a reading, with the positions added, that is good enough."""
MAX_POSITIONS = 24
FEWEST = 6
"""Fewer positions fit too many ways."""
CHANGES = 0.25
"""Channels may change during the record: the first or the last rows, all but one, are then nearer to an ideal bench as
they are read, by this sum of squares [g²]. That is an effect, and no way of reading."""
TURNS = tuple((unit, alpha, beta) for unit, (alpha, beta) in product((1.0, 180.0 / np.pi), SENSES))
"""Units and senses of the angles that are tried; the first changes nothing."""
MATRICES = np.array(PERMUTATIONS)
PLACES = np.where(MATRICES.max(axis=2) > 0.0, MATRICES.argmax(axis=2), MATRICES.argmin(axis=2) + 3)
"""Where the costs of the rows (48, 3) of each signed permutation stand: of inputs 1, 2, 3, then of these reversed."""


@dataclass(frozen=True)
class Asked:
    """Request of a calibration: the options of `trihedron.calibrate`.

    σ and `noise_sd` are fractions of g, gravity in [m/s²]; the bounds are u^max [rad] and v^0max of (1.7). Mountings
    are a preset, the path of a TOML file, or Q (3, 3) by name. Targets are linear combinations of X1..X18 beside those
    of the convention. Priors are "X16=1e-3" for |X16| ≤ 1e-3, or "bounds" for all by (1.7): constraints like readings.
    `positions` are those of all records that are taken together, by default the record's own. With `residuals_tell` the
    residuals of the fit give σ where the record tells none; such a σ judges no model.
    """

    noise_bound: float | None = None
    noise_sd: float | None = None
    gravity: float = 9.80665
    convention: Literal["A1", "A2"] = "A1"
    baseline: Literal["asymmetric", "symmetric"] = "asymmetric"
    bounds: tuple[float, float] = STANDARD_BOUNDS
    mounting: Mapping[str, ArrayLike] | str = "identity"
    targets: Sequence[str] = ()
    priors: Sequence[str] = ()
    positions: int | None = None
    residuals_tell: bool = False

    def __post_init__(self) -> None:
        if self.noise_bound is not None and self.noise_sd is not None:
            raise InputError(f"--noise-sd {exactly(self.noise_sd)}: goes without --noise-bound; give one of them")
        choices = {"convention": ("A1", "A2"), "baseline": ("asymmetric", "symmetric")}
        for name, choice in choices.items():
            if (value := getattr(self, name)) not in choice:
                raise InputError(f"--{name} {value}: must be {' or '.join(choice)}")


def calibrate(record: PositionRecord, **options: Any) -> Calibration:
    """Calibrate the bench from averaged readings: values, guaranteed errors, exact intervals, verdict.

    The options are the fields of `Asked`. An InputError for some that are out of range, mountings that the record does
    not fit, a fit that does not converge, or a record that would need too much memory.

    Notes
    -----
    The exact model of `trihedron.models.bench` is fitted by Gauss-Newton and linearised at the fit. The Chebyshev
    programme gives the verdict and two more for each target the ends of its interval, both corrected for the remainder
    of the linearisation. The estimates are those of one point that keeps every exact residual within its bound: the
    analytic centre. A position that is listed twice counts twice, and moves it a little. Beside them stand the a-priori
    estimates, whose weights and guaranteed errors are those of the linear programmes (2.4), (2.5) on the angles
    measured, and least squares. Source: Golovan, Matasov, Tarygin 2022, sections 2 to 5.
    """
    ROOM.check(len(record), record.path)
    request = Asked(**options)
    noise = noise_bound_for(record, request)
    sigma = noise.value
    linearised = fit_record(record, sigma, request)
    p = linearised.parametrisation
    priors = asked_priors(request.priors, p, request.bounds)
    bounded = with_priors(linearised, priors)
    targets = wanted_targets(p, request)
    resolution = record.written_to(request.gravity)
    try:
        solution = solve_system(bounded, targets, reading_uncertainty(resolution), sigma, error_weights(p), linearised)
    except SolverError as error:
        raise InputError(f"{record.path}: {error}; is --noise-bound {exactly(sigma)} a fraction of g?") from error
    _check_scale_factors(record, solution.parameters)
    missing = [parameter for parameter in solution.parameters if not parameter.determined]
    # Scatter within rests does not bound an error that holds over one: it can prove nothing against the model.
    falsified = solution.contradicted and noise.complete
    unbounded = solution.contradicted and not noise.complete
    positions: list[TablePosition] = []
    if missing:
        positions += next_positions(linearised, np.array([target.weights for target in targets]), request.bounds)
    if not noise.complete:
        positions += repeats(linearised)
    warnings = list(record.warnings) + _of_correction(record) + _of_resolution(record, sigma, request.gravity)
    warnings += _of_pasted_rows(record)
    warnings += _remarks(linearised, falsified and bool(missing), unbounded)
    spare = len(linearised.residual) - linearised.span.shape[1]
    if noise.complete and solution.radius < SMALL_RADIUS and spare >= FEWEST_SPARE:
        warnings.append(
            f"σ may be too large: no error of this record has to be more than {upwards(solution.radius * sigma, 2)} g; "
            "a smaller σ gives closer intervals and hides fewer effects"
        )
    warnings += _of_steps(record, sigma, request.gravity, noise.complete)
    if linearised.deficient and noise.complete:
        # undetermined directions hide it from the radius
        limit = 2.0 * (sigma + reading_uncertainty(resolution)) * (1.0 + RELATIVE_TOLERANCE)
        warnings += _contradiction(linearised, record.position, limit)
    verdict: Verdict = "consistent"
    witness: list[Reading] = []
    if falsified:
        verdict, witness = "falsified", _witness(record, bounded, solution)
    if missing:
        verdict = "insufficient"
    elif not noise.complete:
        verdict = "noise-unknown"
    return Calibration(
        verdict=verdict,
        sigma=sigma_of(noise),
        stands_with_sigma=max(solution.radius * (sigma + record.steps.error) - record.steps.error, 0.0),
        radius=solution.radius,
        gravity_mps2=float(request.gravity),
        convention=request.convention,
        baseline=request.baseline,
        mountings={name: q.tolist() for name, q in zip(p.mountings, p.matrices, strict=True)},
        positions=len(record.position),
        measurements=len(linearised.residual),
        estimator=solution.stated,
        no_estimate=_without_estimate(falsified, unbounded, missing),
        witness=witness,
        parameters=solution.parameters if noise.complete else without_guarantee(solution.parameters),
        priors=[KnownBefore(expression=x.text.rpartition("=")[0], limit=x.limit) for x in priors],
        reading_errors=solution.reading_errors,
        provenance=provenance_of(record, request.bounds),
        open=open_directions(bounded, targets, "the next positions"),
        next_positions=positions,
        warnings=warnings,
        linearised=linearised,
        feasible=solution.feasible,
    )


def calibrate_by_encoders(record: PositionRecord, **options: Any) -> Calibration:
    """Calibrate as `calibrate` does; where exact angles falsify the model and rounding explains it, with steps.

    The rounding of the encoders is in the bounds if the misfit is as large as it makes. Options and errors are those of
    `calibrate`.
    """
    exact = calibrate(record, **options)
    if exact.verdict != "falsified":
        return exact
    stepped = record.with_steps
    error = stepped.steps.error
    if error < WIDE * exact.noise_bound:
        return exact
    linearised = exact.linearised
    columns = linearised.jacobian @ linearised.span
    if Misfit(linearised.residual, columns, linearised.reading).is_rounding(stepped.steps, exact.noise_bound):
        rounded = calibrate(stepped, **options)
        if rounded.verdict != "falsified":
            return rounded
    line = (
        f"the angles are in steps of {stepped.steps}: if the encoders read so coarsely, and the table did not stand at "
        f"these angles exactly, add {upwards(error)} g to the noise bound"
    )
    return exact.model_copy(update={"warnings": [*exact.warnings, line]})


@dataclass(frozen=True, eq=False)
class Misfit:
    """Errors (3 N,) of a fit with independent columns (3 N, P) to readings (N, 3), as fractions of gravity."""

    errors: Floats
    columns: Floats
    reading: Floats

    @property
    def freedom(self) -> int:
        """Degrees of freedom."""
        return len(self.errors) - self.columns.shape[1]

    def is_rounding(self, steps: AngleSteps, sigma: float) -> bool:
        """Return true if the errors are as large as those of encoder steps in most rows, and turn gravity.

        A wrong row may be as large rms over all rows, but the others then fit.
        """
        if self.freedom < FEWEST_SPARE or np.abs(self.errors).max() > MOST_OF_HALF_STEP * (steps.error + sigma):
            return False
        size = float(np.sqrt(np.square(self.errors).sum() / self.freedom))
        # An error of an angle turns gravity: two ninths of its square are in each reading.
        square = (sigma**2 + 2.0 / 9.0 * (0.25 * steps.outer**2 + 0.25 * steps.inner**2)) / 3.0
        rounding = float(np.sqrt(square))
        if not LEAST_OF_ROUNDING <= size / rounding <= MOST_OF_ROUNDING:
            return False
        if self.of_usual_row(sigma) < LEAST_OF_USUAL_ROW * rounding:
            return False
        return self.turns_gravity(sigma)

    def of_usual_row(self, sigma: float) -> float:
        """Return the median over the rows of the rms error of a fit that few rows cannot draw."""
        remaining = self.errors
        for _ in range(ROBUST_ROUNDS):
            of_row = np.linalg.norm(remaining.reshape(-1, 3), axis=1)
            weight = np.repeat(1.0 / np.sqrt(np.maximum(of_row, sigma)), 3)
            remaining = self.errors - self.columns @ least_squares(self.columns * weight[:, None], self.errors * weight)
        return float(np.median(np.linalg.norm(remaining.reshape(-1, 3), axis=1))) / np.sqrt(3.0)

    def turns_gravity(self, sigma: float) -> bool:
        """Return true if the errors turn gravity, as errors of angles do, and change its size by no more than noise."""
        errors = self.errors.reshape(-1, 3)
        along = (errors * self.reading).sum(axis=1) / np.linalg.norm(self.reading, axis=1)
        most = MOST_ALONG**2 * float(np.square(errors).sum(axis=1).mean()) + sigma**2 / 3.0
        return float(np.square(along).mean()) <= most


OF_RESIDUALS = "from the residuals of the fit"
"""Basis of σ where the record does not tell its noise."""
HOW_TO_FIND = "measure some positions again, or give --noise-sd or --noise-bound"
"""How to find a bound of errors that hold over a rest."""


def without_guarantee(parameters: Sequence[Parameter]) -> list[Parameter]:
    """Return parameters without guaranteed errors: where σ is unknown nothing is guaranteed."""
    return [parameter.model_copy(update={"guaranteed_error": None}) for parameter in parameters]


def sigma_of(noise: NoiseBound) -> Sigma:
    """Return σ as a calibration has it: unknown where errors that hold over a rest do not show in it."""
    sigma = Sigma.of(noise.value, noise.basis)
    if noise.complete:
        return sigma
    return sigma.model_copy(update={"kind": "unknown", "find": HOW_TO_FIND})


def provenance_of(record: PositionRecord, bounds: tuple[float, float]) -> Provenance:
    """Return the provenance of a calibration: record, digest, kind, bounds, temperatures and comments."""
    extent = None
    if record.temperature is not None:
        extent = [float(record.temperature.min()), float(record.temperature.max())]
    kind = "positions"
    if isinstance(record.raw, BenchRecord):
        kind = "bench"
    elif record.raw is not None:
        kind = "raw"
    return Provenance(
        record=record.path.name,
        record_sha256=record.sha256,
        bounds=[float(bound) for bound in bounds],
        kind=kind,
        temperature_degC=extent,
        angle_steps_deg=list(record.steps.degrees) if record.steps.error else None,
        comments=dict(record.about),
        decisions=str(record.decisions or ""),
    )


def _witness(record: PositionRecord, bounded: Linearisation, solution: Solution) -> list[Reading]:
    """Return the readings whose duals prove a falsification."""
    proof = (np.abs(solution.duals) * bounded.bound > 1e-9)[: bounded.reading.size]
    rows = np.flatnonzero(proof)
    return [Reading(position=int(record.position[k // 3]), accelerometer=int(k % 3 + 1)) for k in rows]


def wanted_targets(p: Parametrisation, request: Asked) -> list[Target]:
    """Return the targets of the convention and the requested ones."""
    by_symbol: dict[str, Target] = {}
    for target in convention_targets(p, request.convention) + asked_targets(request.targets, p):
        by_symbol.setdefault(target.symbol, target)
    return list(by_symbol.values())


def _without_estimate(falsified: bool, unbounded: bool, missing: Sequence[Parameter]) -> str:
    """Return why there is no estimate, or none of some targets."""
    if falsified:
        return "no parameters of the model keep every reading within the noise bound"
    if unbounded:
        return "the readings differ from the model by more than their scatter within rests"
    if missing:
        return f"the readings leave {', '.join(gap.symbol for gap in missing)} unbounded"
    return ""


def reading_uncertainty(resolution: float) -> float:
    """Return the error by half a digit of `resolution` and by evaluating the model, as a fraction of g."""
    return resolution + ROUNDING


def radius_limit(noise_bound: float, resolution: float) -> float:
    """Return the radius above which the model is falsified; `noise_bound` and `resolution` as fractions of g."""
    return 1.0 + reading_uncertainty(resolution) / noise_bound + RELATIVE_TOLERANCE


def fit_record(record: PositionRecord, noise_bound: float, request: Asked = Asked()) -> Linearisation:
    """Return the exact model fitted to a record, linear at the fit, and σ as a fraction of g; errors as of `calibrate`.

    The possible error of an earlier correction of the record is added to σ.
    """
    gravity, bounds = request.gravity, request.bounds
    if not GRAVITIES[0] <= gravity <= GRAVITIES[1]:
        least, most = map(exactly, GRAVITIES)
        raise InputError(f"--gravity {exactly(gravity)}: must be from {least} to {most}, as 9.80665 [m/s²]")
    if len(bounds) != 2 or not all(isfinite(b) and 0.0 <= b < 0.5 for b in bounds):
        raise InputError(f"--bounds {' '.join(map(exactly, bounds))}: must be two numbers from 0 to 0.5")
    if len(record.position) == 0:
        raise InputError(f"{record.path}: holds no positions")
    matrices = mountings_for(record, request.mounting)
    names = list(matrices)
    index = [0] * len(record.position)
    if record.mounting is not None:
        index = [names.index(name) for name in record.mounting]
    positions = Positions(np.asarray(record.alpha, float), np.asarray(record.beta, float), np.array(index))
    p = parametrise(matrices, symmetric=request.baseline == "symmetric")
    reading = np.asarray(record.specific_force) / gravity
    _refuse_dead(record, reading, nominal_input(positions.alpha, positions.beta, p.matrices[positions.mounting]))
    if advice_line := channels_advice(record, reading, p, positions):
        raise InputError(advice_line)
    extent = parameter_limits(p.symbols, bounds, asked_priors(request.priors, p, bounds))
    bound = record.bounds_with(noise_bound, gravity)
    with said_of(str(record.path)):
        return fit(p, positions, reading, bound, bounds, extent)


def checked_noise_bound(value: float) -> float:
    """A noise bound that readings can have; an InputError for another."""
    least, most = NOISE_BOUNDS
    if not least <= value <= most:
        limits = f"must be a fraction of g from {exactly(least)} to {exactly(most)}, as 1e-5"
        raise InputError(f"--noise-bound {exactly(value)}: {limits}")
    return float(value)


def noise_bound_for(record: PositionRecord, request: Asked) -> NoiseBound:
    """Return σ by the request or the record; raise an InputError where neither has one, or none can be used."""
    if request.noise_bound is not None:
        return NoiseBound(checked_noise_bound(request.noise_bound), "given")
    positions = request.positions or len(record)
    if request.noise_sd is not None:
        return _of_deviation(request.noise_sd, positions)
    p = parametrise(mountings_for(record, request.mounting), symmetric=request.baseline == "symmetric")
    noise = noise_bound_from(record, Fitted(positions, len(p.symbols)))
    if noise is None:
        noise = _of_residuals(record, request)
    least, most = NOISE_BOUNDS
    if not least <= noise.value <= most:
        raise InputError(
            f"{record.path}: the noise bound taken from the record is {upwards(noise.value, 3)} g ({noise.basis}), "
            f"where {exactly(least)} to {exactly(most)} can be used; {SAY_THE_NOISE}"
        )
    return noise


def _of_residuals(record: PositionRecord, request: Asked) -> NoiseBound:
    """Return σ by the residuals of the fit, which cannot speak against the model; an InputError where few are left."""
    untold = InputError(
        f"{record.path}: no position is repeated and no scatter is known, so the record does not say how large the "
        f"noise is; {SAY_THE_NOISE}"
    )
    if not request.residuals_tell:
        raise untold
    linearised = fit_record(record, NOISE_BOUNDS[1], request)
    residuals = linearised.residual
    spare = len(residuals) - linearised.span.shape[1]
    if spare < FEWEST_SPARE:
        raise untold
    deviation = float(np.sqrt(np.sum(residuals**2) / spare))
    factor = Fitted(request.positions or len(record), linearised.span.shape[1]).factor(spare)
    value = max(factor * deviation, float(np.abs(residuals).max()), record.resolution / STANDARD_GRAVITY)
    basis = f"{OF_RESIDUALS}, standard deviation {upwards(deviation)} g"
    return NoiseBound(value, basis, complete=False)


def _of_deviation(deviation: float, positions: int) -> NoiseBound:
    """σ by the standard deviation of one averaged reading; an InputError for one that readings cannot have."""
    least, most = NOISE_BOUNDS
    if least <= deviation <= most:
        noise = noise_bound_of(deviation, positions)
        if noise.value <= most:
            return noise
    raise InputError(
        f"--noise-sd {deviation:g}: must be a fraction of g, as 3e-6, of which σ is two to four times, from "
        f"{exactly(least)} to {exactly(most)}"
    )


def _check_scale_factors(record: PositionRecord, estimates: Sequence[Parameter]) -> None:
    """Refuse readings of an accelerometer that cannot have any usual scale factor."""
    least, most = SCALE_FACTORS
    for estimate in estimates:
        axis = next((p for p, pair in enumerate(SYMMETRIC_PAIRS, 1) if estimate.symbol in pair), None)
        if axis is None or estimate.low is None or estimate.high is None:
            continue
        if 1.0 + estimate.high >= least and 1.0 + estimate.low <= most:
            continue
        raise InputError(_no_scale_factor(record, axis, 1.0 + (estimate.low + estimate.high) / 2.0))


def _refuse_dead(record: PositionRecord, reading: NDArray, inputs: NDArray) -> None:
    """Refuse constant readings (N, 3) at changing inputs (N, 3), both over g: their fit would lead nowhere."""
    for axis in np.flatnonzero(np.ptp(reading, axis=0) < DEAD * np.ptp(inputs, axis=0)):
        raise InputError(_no_scale_factor(record, int(axis) + 1, 0.0))


def _no_scale_factor(record: PositionRecord, axis: int, factor: float) -> str:
    """One line on a scale factor that no accelerometer has."""
    least, most = SCALE_FACTORS
    factor = round(factor, 3) + 0.0
    hint = "is it dead"
    if factor >= least:
        hint = "are --gravity and the unit right"
    elif factor < -least:
        hint = "is its sign, or that of an angle, reversed"
    return (
        f"{record.path}: column f{axis}_mps2: reads {digits(factor, 4)} times what the table "
        f"gives, where {exactly(least)} to {exactly(most)} is possible; {hint}, or is --mounting another?"
    )


def _of_resolution(record: PositionRecord, sigma: float, gravity: float) -> list[str]:
    """Return a sentence on the comment lines that make the bounds larger than σ."""
    added = {
        "resolution_mps2": record.resolution / gravity,
        "resolution_deg": 2.0 * record.angle_resolution,
    }
    lines = []
    for key, size in added.items():
        if key in record.about and size > NOTICEABLE * sigma:
            lines.append(
                f"the comment line `# {key}: {record.about[key]}` counts: it adds {upwards(size)} g to the noise bound "
                f"of {upwards(sigma, 3)} g"
            )
    return lines


def _of_steps(record: PositionRecord, sigma: float, gravity: float, complete: bool) -> list[str]:
    """Return sentences on steps of readings and angles in the bounds, and on rests that scatter too much for σ."""
    lines, reading = [], record.resolution / gravity
    if reading > COARSE * sigma and "resolution_mps2" not in record.about:
        lines.append(
            f"the readings are in steps of {digits(2.0 * record.resolution)} m/s²: half a step, {upwards(reading)} g, "
            f"is added to the noise bound of {upwards(sigma, 3)} g"
        )
    if record.steps.error:
        lines.append(
            f"the angles are in steps of {record.steps}: half a step, which moves a reading by up to "
            f"{upwards(record.steps.error)} g, is added to the noise bound of {upwards(sigma, 3)} g"
        )
    if record.scatter is None or record.raw is None or not complete:
        return lines
    deviation = float(np.sqrt(np.max(np.mean(np.square(record.scatter), axis=0)))) / gravity
    times = Fitted(len(record)).largest * deviation / sigma
    if times > 1.0:
        longer = digits(times**2, 2)
        lines.append(
            f"the rests are too short for their scatter: the mean of a rest has a standard deviation of "
            f"{upwards(deviation)} g, and σ of {upwards(sigma, 3)} g does not bound so many readings; rests that are "
            f"{longer} times as long do, or a σ of {upwards(times * sigma)} g"
        )
    return lines


def _of_pasted_rows(record: PositionRecord) -> list[str]:
    """Return a sentence on rows that the record holds twice, with all digits."""
    if not record.resolution:
        return []
    before: dict[tuple[float, ...], int] = {}
    earlier = []
    for row, values in enumerate(np.column_stack((record.alpha, record.beta, record.specific_force)).tolist()):
        earlier.append(before.setdefault(tuple(values), row))
    lines, row = [], 0
    while row < len(earlier):
        count = 0
        while row + count < len(earlier) and earlier[row] != row and earlier[row + count] == earlier[row] + count:
            count += 1
        if count >= FEWEST_PASTED:
            at, numbers = earlier[row], record.numbers
            again = f"rows {numbers[row]} to {numbers[row + count - 1]} of {record.path.name}"
            first = f"rows {numbers[at]} to {numbers[at + count - 1]}"
            lines.append(f"{again} are {first} again, digit by digit: take one of them out, each counts twice")
        row += max(count, 1)
    return lines


def _of_correction(record: PositionRecord) -> list[str]:
    """Return a sentence on the possible error of an earlier correction of the record, if it had one."""
    if CORRECTED_WITHIN not in record.about:
        return []
    bounds = record.bounds_with(0.0, STANDARD_GRAVITY)
    by = record.about.get(CORRECTED_BY, "an effect")
    return [
        f"the record is corrected ({by}), which may be wrong by {upwards(bounds.max())} g: all bounds allow for it; "
        "`trihedron calibrate --with` of the record as it was measured gives closer intervals"
    ]


def _remarks(linearised: Linearisation, contradicts: bool, unbounded: bool) -> list[str]:
    """Warnings: a fit far from any bench, measurements too few but contradictory already, a noise bound too small."""
    remarks = []
    values = dict(zip(linearised.symbols, linearised.point, strict=True))
    large = sorted((symbol for symbol in values if abs(values[symbol]) > FAR), key=lambda symbol: -abs(values[symbol]))
    if large:
        texts = []
        for symbol in large[:MOST_FAR]:
            texts.append(f"{words_of(symbol)} {digits(values[symbol], 2)} {unit_of(symbol)}".rstrip())
        if len(large) > MOST_FAR:
            texts.append(f"{len(large) - MOST_FAR} more")
        remarks.append(f"values far from an aligned bench ({', '.join(texts)}): are --mounting and --gravity right?")
    if contradicts:
        remarks.append("the measurements, too few as they are, contradict the model: see the radius and the witness")
    if unbounded:
        remarks.append(
            "the readings differ from the model by more than their scatter within rests, which does not show errors "
            "that hold over a rest: repeat positions, or give --noise-sd or --noise-bound"
        )
    return remarks


def _contradiction(linearised: Linearisation, number: NDArray, limit: float) -> list[str]:
    """Return a sentence on the worst contradiction between readings at exactly the same angles in the same mounting.

    They may be apart by the limit, a fraction of g; `number` (N,) are the record's position numbers.
    """
    at = linearised.positions
    _, label = np.unique(np.stack([at.alpha, at.beta, at.mounting], axis=1), axis=0, return_inverse=True)
    label = label.reshape(-1)
    order = np.argsort(label, kind="stable")
    starts = np.flatnonzero(np.diff(label[order], prepend=-1))
    reading = linearised.reading[order]
    spread = np.maximum.reduceat(reading, starts) - np.minimum.reduceat(reading, starts)
    group, axis = np.unravel_index(int(np.argmax(spread)), spread.shape)
    if spread[group, axis] <= limit:
        return []
    rows = order[label[order] == label[order[starts[group]]]]
    values = linearised.reading[rows, axis]
    first, second = sorted((int(number[rows[values.argmin()]]), int(number[rows[values.argmax()]])))
    apart = f"{digits(spread[group, axis], 2)} g differently there, more than two noise bounds"
    same = f"positions {first} and {second} are the same, but accelerometer {axis + 1} reads"
    return [f"{same} {apart}: no model explains that"]


def next_positions(linearised: Linearisation, weights: NDArray, bounds: tuple[float, float]) -> list[TablePosition]:
    """Return a few positions that, added to those measured, determine every target with weights (T, P).

    They are chosen one by one from a coarse grid, the one that adds most information (the determinant) first. Only
    readings whose sign is certain by (1.7), with its bounds u^max and v^0max, count.
    """
    p = linearised.parametrisation
    grid = every_position(p, np.radians(np.arange(0, 360, GRID_STEP_DEG)))
    rows = reading_jacobian(p, linearised.point, grid)
    rows = np.where(admissible(grid.alpha, grid.beta, p.matrices[grid.mounting], bounds=bounds)[..., None], rows, 0.0)
    information = linearised.jacobian.T @ linearised.jacobian
    chosen: list[TablePosition] = []
    while len(chosen) < MAX_POSITIONS and not _determines(information, weights):
        spread = np.linalg.inv(information + 1e-8 * np.eye(len(information)))
        gain = np.linalg.slogdet(np.eye(3) + rows @ spread @ rows.transpose(0, 2, 1))[1]
        best = int(np.argmax(np.round(gain, 9)))
        information = information + rows[best].T @ rows[best]
        chosen.append(TablePosition(**table_position(p, grid, best)))
    return chosen


def repeats(linearised: Linearisation, count: int = 4) -> list[TablePosition]:
    """Return positions of the record, spread over it, that would determine the noise if measured again."""
    p, at = linearised.parametrisation, linearised.positions
    rows = np.unique(np.linspace(0, len(at.alpha) - 1, count).round().astype(int))
    return [TablePosition(**table_position(p, at, k)) for k in rows]


def _determines(information: NDArray, weights: NDArray) -> bool:
    spread = np.linalg.inv(information + 1e-8 * np.eye(len(information)))
    return bool((np.einsum("tp,pq,tq->t", weights, spread, weights) < WELL_DETERMINED**2).all())


def channels_advice(record: PositionRecord, reading: NDArray, p: Parametrisation, at: Positions) -> str:
    """Return one line where another way of reading a record fits far better than the present one; else nothing.

    The readings (N, 3) are over g. There is no advice if the person has declared the file to be right.

    Notes
    -----
    A way of reading is right where reading = (1 + E) P Q up(α, β) + b, with P a signed permutation and E, b of usual
    size. In each way the penalised least squares of E and b have a closed form, and the cost of P is a sum of three
    numbers out of eighteen.
    """
    if len(reading) < FEWEST or record.channels == Channels():
        return ""
    inputs = []
    for unit, alpha, beta in TURNS:
        vertical = up(alpha * unit * at.alpha, beta * unit * at.beta)
        inputs.append(np.einsum("nij,nj->ni", p.matrices[at.mounting], vertical))
    costs, scale = costs_of(reading, inputs)
    same = far_better(costs)
    if scale > LARGEST_MISFIT or not len(same):
        return ""

    def apart(way: int) -> Floats:
        """Return the squared distances (N,) of the readings from an ideal bench read in this way [g²]."""
        turn, permutation = divmod(int(way), len(PERMUTATIONS))
        return np.square(reading - inputs[turn] @ PERMUTATIONS[permutation].T).sum(axis=1)

    as_read, better = apart(0), apart(same[0])
    if _changes(better - as_read):
        return ""
    ways = []
    for way in same.tolist():
        turn, permutation = divmod(way, len(PERMUTATIONS))
        unit, alpha, beta = TURNS[turn]
        matrix = PERMUTATIONS[permutation]
        channels = Channels(reading_of(matrix), alpha=alpha, beta=beta, radians=unit != 1.0)
        ways.append((channels, _mounting(matrix, p, channels)))
    return (
        f"{record.path}: the readings are {digits(np.sqrt(as_read.mean()), 2)} g rms from those of an ideal bench, and "
        f"{digits(np.sqrt(better.mean()), 2)} g when they are read with {advice(ways, record.channels)}"
    )


def _changes(gains: Floats) -> bool:
    """Return whether first or last rows, without their best one, gain more than `CHANGES` as read; gains (N,) [g²]."""
    both_ways = np.stack([gains, gains[::-1]])
    largest = np.maximum.accumulate(np.maximum(both_ways, 0.0), axis=1)
    return bool(np.any(np.cumsum(both_ways, axis=1) - largest > CHANGES))


def costs_of(reading: NDArray, inputs: Sequence[NDArray]) -> tuple[Floats, float]:
    """Return costs of every signed permutation with each of some inputs (N, 3) in turn, and the usual misfit [g].

    The misfit is that of the best of the inputs with any linear map to readings (N, 3), at least `LEAST_MISFIT`.
    """
    designs = [np.hstack([n, np.ones((len(n), 1))]) for n in inputs]
    scale = max(LEAST_MISFIT, min(_left(design, reading) for design in designs))
    costs = [_costs(design, reading, scale)[np.arange(3), PLACES].sum(axis=1) for design in designs]
    return np.concatenate(costs), scale


def _left(design: NDArray, reading: NDArray) -> float:
    """Return the root mean square of the residual of any linear map, by readings beyond its parameters [g]."""
    solution, _, rank, _ = np.linalg.lstsq(design, reading, rcond=1e-6)
    if rank >= len(reading):
        return LEAST_MISFIT
    return float(np.sqrt(np.square(reading - design @ solution).sum() / (3 * (len(reading) - rank))))


def _costs(design: NDArray, reading: NDArray, scale: float) -> Floats:
    """Least penalised squares (3, 6) of each reading taken for each input, and for each input reversed."""
    columns = np.hstack([reading, design[:, :3]])
    across = design.T @ columns
    normal = design.T @ design + (scale / USUAL) ** 2 * np.eye(4)
    unexplained = (columns.T @ columns - across.T @ np.linalg.solve(normal, across)) / scale**2
    of_readings, mixed, of_inputs = np.diag(unexplained)[:3, None], unexplained[:3, 3:], np.diag(unexplained)[3:]
    return np.hstack([of_readings - 2.0 * mixed + of_inputs, of_readings + 2.0 * mixed + of_inputs])


def _mounting(matrix: NDArray, p: Parametrisation, channels: Channels) -> str:
    """Return the mounting that equals a signed permutation with these senses; empty where none does."""
    if np.linalg.det(matrix) < 0.0 or np.array_equal(matrix, np.eye(3)):
        return ""
    addition = str(Channels(alpha=channels.alpha, beta=channels.beta, radians=channels.radians))
    if addition:
        addition = f" with {addition}"
    if len(p.matrices) > 1:
        return f"mountings that are {_written(matrix)} times those given{addition}"
    return f"--mounting FILE with matrix = {_written(matrix @ p.matrices[0])}{addition}"


def _written(matrix: NDArray) -> str:
    return str((np.round(matrix, 9) + 0.0).tolist()).replace(".0", "")
