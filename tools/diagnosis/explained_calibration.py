"""A record calibrated with the effects that a diagnosis names: their sizes are unknowns of the same programme."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...models.effects import EffectPlace
from ...models.effects.last_stage import place_of
from ..bounded.programmes import Interval, SolverError
from ..bounded.sets import Work
from ..calibrated import CalibratedEffect, Calibration, Parameter, Reading, Sigma
from ..calibration.calibration import Asked, reading_uncertainty, wanted_targets, without_guarantee
from ..calibration.estimates import Solution, open_directions, solve_system
from ..calibration.gyros import widened
from ..calibration.model import Linearisation, determined
from ..calibration.targets import Target, asked_priors, error_weights
from ..errors import InputError
from ..evidence.bench import Bench, bench_evidence
from ..evidence.bench_model import Cast, Model, Readings
from ..evidence.evidence import Evidence
from ..evidence.fit import Fit, blocks_of, coefficient_limits, estimated, linear_intervals
from ..records import PositionRecord
from ..records.columns import CORRECTED_BY, CORRECTED_WITHIN
from ..rounding import exactly
from .applied import coefficients_of, errors_of, of_the_record, origin_of
from .cause import Cause, causes_of, stated_within
from .result import Diagnosis

ROUNDS = 12
"""Rounds of least squares at most."""
STILL = 1e-13
"""Steps [g], [rad], [1] that move nothing."""
MORE_POSITIONS = "more positions"
WRITTEN = ("formula", "lookup")
"""Effects that are in no catalogue: a law or a table as a diagnosis writes it."""


@dataclass(frozen=True)
class Known:
    """Known combinations of parameters and coefficients: |middle - weights'x| within half.

    `weights` (L, P + K), `middle` and `half` (L,).
    """

    weights: NDArray[np.float64]
    middle: NDArray[np.float64]
    half: NDArray[np.float64]


@dataclass(frozen=True)
class WithEffects(Linearisation):
    """Readings linearised with effects, followed by rows for the known combinations.

    `point` holds the model's parameters and the effects' coefficients, each times its `scale` (K,), so that one of
    either adds 1 g to a reading at most. `blocks` are the coefficients of each effect.
    """

    readings: Readings
    cast: Cast
    blocks: tuple[slice, ...]
    scale: NDArray[np.float64]
    known: Known

    def model_at(self, point: NDArray) -> Model | None:
        """The bench with the effects at another point; None where an effect does not act there in its way."""
        count = len(self.point) - len(self.scale)
        return self.cast.model(self.readings, point[:count], point[count:] / self.scale, self.blocks)

    def rows_of(self, positions: NDArray) -> NDArray[np.int_]:
        """All rows: effects may join any of them."""
        return np.arange(len(self.bound))

    def selected(self, rows: NDArray) -> "WithEffects":
        """All rows."""
        return self

    def residual_at(self, point: NDArray) -> NDArray:
        """Exact residuals at another point; linear ones where an effect does not act there in its way."""
        model = self.model_at(point)
        if model is None:
            return self.residual - self.jacobian @ (point - self.point)
        errors = self.reading.ravel() - model.reading
        return np.append(errors, self.known.middle - self.known.weights @ point)

    def jacobian_at(self, point: NDArray) -> NDArray:
        """Derivatives at another point."""
        model = self.model_at(point)
        return self.jacobian if model is None else self._rows(model)

    def _rows(self, model: Model) -> NDArray[np.float64]:
        count = len(self.point) - len(self.scale)
        columns = np.hstack((model.jacobian[:, :count], model.jacobian[:, count:] / self.scale))
        return np.vstack((columns, self.known.weights))

    def at(self, point: NDArray, largest: NDArray) -> "WithEffects":
        """The same about another point; bounds grow with coefficients of the largest sizes (K,)."""
        model = self.model_at(point)
        if model is None:
            return self
        count = len(self.point) - len(self.scale)
        bound = np.append(model.bound + model.rate[:, count:] @ largest, self.known.half)
        jacobian = self._rows(model)
        residual = np.append(self.reading.ravel() - model.reading, self.known.middle - self.known.weights @ point)
        span = determined(jacobian, float(model.bound.min()))
        return replace(self, point=point, bound=bound, residual=residual, jacobian=jacobian, span=span)


@dataclass(frozen=True)
class Named:
    """Effects that a diagnosis names: places as the record numbers them, with their causes.

    `known`: whether their sizes are bounded by the diagnosis; else the record itself tells them.
    """

    causes: Mapping[EffectPlace, Cause]
    known: bool

    @property
    def title(self) -> str:
        """The effects in words."""
        return " and ".join(cause.place.title for cause in self.causes.values())


def calibrated_with(diagnosis: Diagnosis, record: PositionRecord, **options: Any) -> Calibration:
    """Calibrate a record together with the effects that a diagnosis names.

    If the diagnosis is of this record, the sizes of the effects are unknown. If it is of another record of the same
    instrument, its intervals bound them. Options are the fields of `Asked`; the noise bound defaults to that of the
    diagnosis. An InputError for a diagnosis that explains nothing, or for effects that the record cannot have.
    """
    _refuse_corrected(record)
    if diagnosis.verdict != "explained":
        raise InputError(f"--with: the diagnosis is {diagnosis.verdict} and names no effect; calibrate without --with")
    is_given = options.get("noise_bound") is not None or options.get("noise_sd") is not None
    if not is_given:
        options["noise_bound"] = _noise_bound_of(diagnosis)
    request = Asked(**options)
    evidence = bench_evidence(record, **vars(request))
    sigma = evidence.model.calibration.sigma
    if not (is_given and is_of(diagnosis, record)):
        sigma = _no_surer(sigma, diagnosis)
    named = _named(diagnosis, record, evidence)
    try:
        solved = _solved(record, evidence, named, request)
    except SolverError as error:
        raise InputError(f"{record.path}: {error}; {evidence.reader.too_large}") from error
    return _calibration(record, evidence, solved, sigma).model_copy(update={"explained_by": origin_of(diagnosis)})


def _refuse_corrected(record: PositionRecord) -> None:
    for line in (CORRECTED_WITHIN, CORRECTED_BY):
        if line in record.about:
            raise InputError(
                f"{record.path}: is corrected already ({record.about.get(CORRECTED_BY)}); give --with the record as "
                "it was measured"
            )


def is_of(diagnosis: Diagnosis, record: PositionRecord) -> bool:
    """Return true if a diagnosis was made from this record."""
    if diagnosis.made_of is record:
        return True
    source = diagnosis.calibration.provenance
    return source is not None and source.sha256 != "" and source.sha256 == record.sha256


def _noise_bound_of(diagnosis: Diagnosis) -> float:
    """Return σ of a diagnosis; an InputError where it has none of readings."""
    bound = diagnosis.noise_bound
    if bound is None:
        raise InputError("--with: the diagnosis has no noise bound of readings; give --noise-bound, as 1e-5")
    return bound


def _no_surer(used: Sigma, diagnosis: Diagnosis) -> Sigma:
    """Return σ as it was used, a bound where σ of the diagnosis, from which it or sizes are taken, is one."""
    of_diagnosis = diagnosis.calibration.sigma
    if diagnosis.records:
        of_diagnosis = of_diagnosis.model_copy(update={"kind": _least_sure(diagnosis)})
    if of_diagnosis.kind == "bound":
        return used
    return used.model_copy(update={"kind": of_diagnosis.kind, "basis": of_diagnosis.basis, "find": of_diagnosis.find})


def _least_sure(diagnosis: Diagnosis) -> str:
    """Return the kind of σ of several records on which least can be built."""
    kinds = [record.diagnosis.calibration.sigma.kind for record in diagnosis.records or ()]
    return next((kind for kind in ("unknown", "estimated") if kind in kinds), "bound")


def _named(diagnosis: Diagnosis, record: PositionRecord, evidence: Evidence) -> Named:
    """Return the named effects that act in a record; an InputError for one that it cannot have."""
    same = is_of(diagnosis, record)
    if evidence.reader.missing():
        raise InputError(f"{record.path}: does not determine the parameters even without effects; add positions")
    causes: dict[EffectPlace, Cause] = {}
    for cause in diagnosis.causes_in(record.sha256):
        if not same and (cause.effect == "outlier" or not cause.place.definition.linear):
            raise InputError(
                f"--with: {cause.place.title} is of the record that was diagnosed, and {record.path} is another one; "
                "diagnose it"
            )
        causes[_place_in(evidence, cause, record)] = cause
    if not causes and diagnosis.explanations and not diagnosis.causes:
        raise InputError(f"--with: {of_the_record(diagnosis)}; mend the record, and calibrate without --with")
    if not causes:
        raise InputError("--with: the diagnosis names nothing that is the instrument's; diagnose this record")
    return Named(causes, not same)


def _place_in(evidence: Evidence, cause: Cause, record: PositionRecord) -> EffectPlace:
    """Return the effect of a cause as evidence numbers it; an InputError where the record cannot have it."""
    if cause.effect == "outlier":
        rows = np.flatnonzero(evidence.model.numbers == int(cause.where.removeprefix("position-")))
        if len(rows):
            return place_of(int(rows[0]) + 1, cause.place.axes[0])
    if cause.effect in WRITTEN:
        try:
            evidence.rows.columns_of([cause.place])
        except ValueError as error:
            raise InputError(f"{record.path}: --with {error}") from error
        return cause.place
    if cause.place not in evidence.model.places:
        raise InputError(f"--with: {cause.place.title} is no effect of {record.path}: another kind of record")
    return cause.place


@dataclass(frozen=True)
class Solved:
    """Targets solved from a record, with effects acting in one way: `effects` with their parameters."""

    system: WithEffects
    targets: list[Target]
    solution: Solution
    effects: tuple[CalibratedEffect, ...]


def _solved(record: PositionRecord, evidence: Evidence, named: Named, request: Asked) -> list[Solved]:
    """Solve for the targets in each way in which the effects can act."""
    model: Bench = evidence.model
    places, sigma = tuple(named.causes), model.calibration.noise_bound
    linear = Cast(places)
    ways: list[tuple[Cast, Fit | None]] = [(linear, None)]
    if not all(place.definition.linear for place in places):
        ways = list(model.standing(places, Work()))
        if not ways:
            raise InputError(
                f"{record.path}: does not stand with {named.title} within {exactly(sigma)} g; diagnose it with this "
                "noise bound"
            )
    p = model.here.parametrisation
    wanted = wanted_targets(p, request)
    slack = reading_uncertainty(model.readings.resolution)
    solved = []
    for cast, fit in ways:
        system = _system(evidence, named, cast, fit, request)
        count = len(system.point)
        targets = [widened(target, count) for target in wanted]
        coefficients = _coefficient_targets(places, system)
        weights = np.pad(error_weights(p), ((0, 0), (0, len(system.scale))))
        solution = solve_system(system, [*targets, *coefficients], slack, sigma, weights)
        sizes = solution.parameters[len(targets) :]
        solution = replace(solution, parameters=solution.parameters[: len(targets)])
        effects = _effects(evidence, named, system, sizes) if fit is None else _effects_of_fit(evidence, fit)
        solved.append(Solved(system, targets, solution, effects))
    return solved


def _system(evidence: Evidence, named: Named, cast: Cast, fit: Fit | None, request: Asked) -> WithEffects:
    """Return readings and effects fitted together by least squares, with the known limits of the effects."""
    model: Bench = evidence.model
    places, here = cast.places, model.here
    if fit is None:
        blocks = blocks_of(places)
        start = np.append(here.point, np.zeros(blocks[-1].stop))
    else:
        blocks, start = fit.blocks, fit.estimate
    count = len(here.point)
    at_start = cast.model(model.readings, start[:count], start[count:], blocks)
    assert at_start is not None
    scale = np.abs(at_start.jacobian[:, count:]).max(axis=0)
    scale = np.where(scale > 0.0, scale, 1.0)
    known, largest = _known(evidence, named, request, scale)
    if fit is not None:
        largest = _largest_of_fit(fit, model.room)
    values = {field.name: getattr(here, field.name) for field in fields(Linearisation)}
    values |= {"reading": model.readings.reading, "sign": model.readings.sign}
    point = np.append(start[:count], start[count:] * scale)
    system = WithEffects(
        **{**values, "point": point},
        readings=model.readings,
        cast=cast,
        blocks=blocks,
        scale=scale,
        known=known,
    ).at(point, largest)
    if fit is None and not named.known:
        largest = _largest_of_fit(model.refit(places), model.room)
    for _ in range(ROUNDS):
        step = estimated(system.jacobian / system.bound[:, None], system.residual / system.bound)
        system = system.at(system.point + step, largest)
        if np.abs(step).max(initial=0.0) < STILL:
            break
    return system


def _known(evidence: Evidence, named: Named, request: Asked, scale: NDArray) -> tuple[Known, NDArray[np.float64]]:
    """Return what priors say, and a diagnosis of another record of sizes; the largest sizes (K,) of coefficients."""
    here, wide = evidence.model.here, len(scale)
    weights, middle, half = [], [], []
    for prior in asked_priors(request.priors, here.parametrisation, request.bounds):
        weights.append(np.append(prior.weights, np.zeros(wide)))
        middle.append(0.0)
        half.append(prior.limit)
    largest = [np.zeros(0)]
    for place, cause in named.causes.items():
        ends = np.abs(np.array(coefficient_limits(place))).max(axis=0)
        if named.known:
            # This record gives the sizes up to powers of 1 - Δg/g and turns by Δβ, as the other does.
            told = evidence.reader.told(place, cause.intervals)
            box = Cause.found(cause.place, (), cause.values, told)
            values, errors = coefficients_of(box), errors_of(box)
            ends = np.minimum(ends, np.abs(values) + errors)
            first = sum(map(len, largest))
            for k in np.flatnonzero(np.isfinite(errors)):
                row = np.zeros(len(here.point) + wide)
                row[len(here.point) + first + k] = 1.0
                weights.append(row)
                middle.append(values[k] * scale[first + k])
                half.append(max(errors[k] * scale[first + k], np.finfo(float).tiny))
        largest.append(ends)
    rows = np.array(weights).reshape(-1, len(here.point) + wide)
    return Known(rows, np.array(middle), np.array(half)), np.concatenate(largest)


def _largest_of_fit(fit: Fit, room: float) -> NDArray[np.float64]:
    """Return the largest sizes (K,) of coefficients that a record leaves possible with a fit's effects."""
    count, steps = len(fit.point), fit.possible(room)
    low, high = fit.limits
    sizes = []
    for k, limit in enumerate(np.maximum(np.abs(low), np.abs(high))):
        ends = np.add(steps.ends(count + k), fit.central[count + k])
        sizes.append(min(float(np.abs(ends).max()), float(limit)))
    return np.array(sizes)


def _coefficient_targets(places: Sequence[EffectPlace], system: WithEffects) -> list[Target]:
    """Return each coefficient of the effects as a target."""
    count, targets = len(system.point) - len(system.scale), []
    for k, scale in enumerate(system.scale):
        weights = np.zeros(len(system.point))
        weights[count + k] = 1.0 / scale
        targets.append(Target(f"coefficient {k + 1}", "", "", weights))
    return targets


def _effects(
    evidence: Evidence, named: Named, system: WithEffects, sizes: Sequence[Parameter]
) -> tuple[CalibratedEffect, ...]:
    """Return linear effects with their parameters, by the intervals of their coefficients."""
    low, high = np.array([size.ends for size in sizes]).T
    estimates = np.array([size.estimate or 0.0 for size in sizes])
    effects = []
    for (place, cause), block in zip(named.causes.items(), system.blocks, strict=True):
        ends = low[block], high[block]

        def reach(direction: NDArray, ends: tuple[NDArray, NDArray] = ends) -> float:
            """The farthest that coefficients within their ends go in a direction."""
            products = [np.where(direction == 0.0, 0.0, direction * end) for end in ends]
            return float(np.maximum(*products).sum())

        values = place.definition.from_coefficients(estimates[block])
        intervals = evidence.reader.told(place, linear_intervals(place, reach))
        effects.append(_effect(cause.place, values, intervals))
    return tuple(effects)


def _effects_of_fit(evidence: Evidence, fit: Fit) -> tuple[CalibratedEffect, ...]:
    """Return effects that act in ways of their own, as a diagnosis states them."""
    return tuple(_effect(cause.place, cause.values, cause.intervals) for cause in causes_of(evidence, fit))


def _effect(place: EffectPlace, values: Sequence[float], intervals: Sequence[Interval]) -> CalibratedEffect:
    """Return an effect with estimates and intervals of its parameters."""
    parameters = []
    for parameter, value, (low, high) in zip(place.definition.parameters, values, intervals, strict=True):
        bounded = bool(np.isfinite(low) and np.isfinite(high))
        parameters.append(
            Parameter(
                symbol=parameter.name,
                name=parameter.name,
                unit=parameter.unit,
                determined=bounded,
                estimate=stated_within(parameter.name, float(value), (low, high)),
                low=float(low) if bounded else None,
                high=float(high) if bounded else None,
            )
        )
    return CalibratedEffect(effect=place.title, where=place.where, parameters=parameters)


def _calibration(record: PositionRecord, evidence: Evidence, every: Sequence[Solved], sigma: Sigma) -> Calibration:
    """Return the calibration: the union of the intervals over all ways in which the effects can act."""
    nominal: Calibration = evidence.model.calibration
    ranked = sorted(every, key=lambda one: one.solution.radius)
    standing = [one for one in ranked if not one.solution.contradicted]
    best = ranked[0]
    solution, contradicted = best.solution, not standing
    parameters = solution.parameters
    reading_errors = solution.reading_errors
    effects = best.effects
    for one in standing[1:]:
        parameters = [_either(a, b) for a, b in zip(parameters, one.solution.parameters, strict=True)]
        pairs = zip(reading_errors, one.solution.reading_errors, strict=True)
        reading_errors = [a.model_copy(update=_ends_of(a, b)) for a, b in pairs]
        effects = _either_effects(effects, one.effects)
    missing = [p.symbol for p in parameters if not p.determined]
    verdict, why, witness = "consistent", "", []
    if contradicted:
        verdict, why = "falsified", "no parameters and sizes of the effects keep every reading within the noise bound"
        witness = _witness(record, best)
    if sigma.kind == "unknown":
        verdict, witness, parameters = "noise-unknown", [], without_guarantee(parameters)
    if missing:
        verdict, why = "insufficient", f"readings and effects leave {', '.join(missing)} unbounded"
    changed: dict[str, Any] = {
        "verdict": verdict,
        "sigma": sigma,
        "radius": solution.radius,
        "stands_with_sigma": solution.radius * nominal.noise_bound,
        "estimator": solution.stated,
        "no_estimate": why,
        "witness": witness,
        "parameters": parameters,
        "reading_errors": [] if contradicted else reading_errors,
        "open": open_directions(best.system, best.targets, MORE_POSITIONS),
        "next_positions": [],
        "linearised": best.system,
        "feasible": None,
        "effects": list(effects),
    }
    return nominal.model_copy(update=changed)


def _witness(record: PositionRecord, solved: Solved) -> list[Reading]:
    """Return the readings whose duals prove a falsification."""
    proof = np.abs(solved.solution.duals) * solved.system.bound > 1e-9
    rows = np.flatnonzero(proof[: solved.system.reading.size])
    return [Reading(position=int(record.position[k // 3]), accelerometer=int(k % 3 + 1)) for k in rows]


def _ends_of(first: Any, second: Any) -> dict[str, float | None]:
    """Return the ends of the union of two intervals; None where one is unbounded."""
    ends: dict[str, float | None] = {"low": None, "high": None}
    if first.low is not None and second.low is not None:
        ends["low"] = min(first.low, second.low)
    if first.high is not None and second.high is not None:
        ends["high"] = max(first.high, second.high)
    return ends


def _either(first: Parameter, second: Parameter) -> Parameter:
    """Return a parameter as either of two ways leaves it; the estimate is that of the first."""
    return first.model_copy(update={**_ends_of(first, second), "determined": first.determined and second.determined})


def _either_effects(
    first: Sequence[CalibratedEffect], second: Sequence[CalibratedEffect]
) -> tuple[CalibratedEffect, ...]:
    effects = []
    for one, other in zip(first, second, strict=True):
        parameters = [_either(a, b) for a, b in zip(one.parameters, other.parameters, strict=True)]
        effects.append(one.model_copy(update={"parameters": parameters}))
    return tuple(effects)
