"""Rests on a table solved together with effects and breaks: their sizes are unknowns of the same programme."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, fields, replace
from functools import cached_property
from itertools import islice
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...models.arrays import Floats, Ints
from ...models.bench import SYMMETRIC_PAIRS
from ...models.effects import EffectPlace
from ..bounded.programmes import Interval
from ..bounded.work import Work
from ..calibrated import CalibratedEffect, Calibration, Open, Parameter, Reading, Sigma
from ..calibration.calibration import Asked, reading_uncertainty, wanted_targets, without_guarantee
from ..calibration.estimates import Solution, open_directions, solve_system
from ..calibration.gyros import widened
from ..calibration.model import Linearisation, determined
from ..calibration.targets import BIAS_TARGETS, NAMES, Target, asked_priors, error_weights
from ..errors import InputError
from ..evidence.bench import Bench
from ..evidence.bench_model import Cast, Model, Readings
from ..evidence.evidence import Evidence
from ..evidence.fit import Fit, blocks_of, coefficient_limits, estimated, linear_intervals
from ..records import PositionRecord
from ..rounding import exactly
from ..sieve.breaks import BIASES, SCALES, BreakSearch, ChangingGroup, ChangingPart, RowGap, jumping_at
from .applied import coefficients_of, errors_of
from .cause import Cause, causes_of, stated_within

ROUNDS = 12
"""Rounds of least squares at most."""
STILL = 1e-13
"""Steps [g], [rad], [1] that move nothing."""
MORE_POSITIONS = "more positions"


@dataclass(frozen=True)
class Known:
    """Known combinations of parameters and coefficients: |middle - weights'x| within half.

    `weights` (L, P + K), `middle` and `half` (L,).
    """

    weights: Floats
    middle: Floats
    half: Floats


@dataclass(frozen=True)
class WithEffects(Linearisation):
    """Readings linearised with effects, followed by rows for the known combinations.

    `point` holds the model's parameters and the effects' coefficients, each times its `scale` (K,), so that one of
    either adds 1 g to a reading at most. `blocks` are the coefficients of each effect.
    """

    readings: Readings
    cast: Cast
    blocks: tuple[slice, ...]
    scale: Floats
    known: Known

    @property
    def count(self) -> int:
        """The number of parameters before the coefficients of the effects."""
        return len(self.point) - len(self.scale)

    def model_at(self, point: NDArray) -> Model | None:
        """The bench with the effects at another point; None where an effect does not act there in its way."""
        return self.cast.model(self.readings, point[: self.count], point[self.count :] / self.scale, self.blocks)

    def rows_of(self, positions: NDArray) -> Ints:
        """All rows: effects may join any of them."""
        return np.arange(len(self.bound))

    def selected(self, rows: NDArray) -> "WithEffects":
        """All rows."""
        return self

    def residuals_at(self, points: NDArray) -> NDArray:
        """Exact residuals (K, M) at other points; linear ones where an effect does not act there in its way."""
        return np.array([self._residual_at(point) for point in points])

    def _residual_at(self, point: NDArray) -> NDArray:
        model = self.model_at(point)
        if model is None:
            return self.residual - self.jacobian @ (point - self.point)
        errors = self.reading.ravel() - model.reading
        return np.append(errors, self.known.middle - self.known.weights @ point)

    def jacobian_at(self, point: NDArray) -> NDArray:
        """Derivatives at another point."""
        model = self.model_at(point)
        return self.jacobian if model is None else self._rows(model)

    def _rows(self, model: Model) -> Floats:
        columns = np.hstack((model.jacobian[:, : self.count], model.jacobian[:, self.count :] / self.scale))
        return np.vstack((columns, self.known.weights))

    def at(self, point: NDArray, largest: NDArray) -> "WithEffects":
        """The same about another point; bounds grow with coefficients of the largest sizes (K,)."""
        model = self.model_at(point)
        if model is None:
            return self
        bound = np.append(model.bound + model.rate[:, self.count :] @ largest, self.known.half)
        jacobian = self._rows(model)
        residual = np.append(self.reading.ravel() - model.reading, self.known.middle - self.known.weights @ point)
        span = determined(jacobian, float(model.bound.min()))
        return replace(self, point=point, bound=bound, residual=residual, jacobian=jacobian, span=span)


@dataclass(frozen=True)
class Named:
    """Faults of a diagnosis: effects in the record's numbering, with their causes, and changes at breaks.

    `known`: whether the sizes of the effects are bounded by the diagnosis; else the record itself tells them. `changes`
    are the parts that change at each break, in the order of time.
    """

    causes: Mapping[EffectPlace, Cause]
    known: bool
    changes: tuple[tuple[str, ...], ...] = ()

    @property
    def title(self) -> str:
        """The effects in words."""
        return " and ".join(cause.place.title for cause in self.causes.values())


@dataclass(frozen=True)
class Way:
    """One way in which effects and breaks can act: `gaps` of the breaks; a fit of effects that are not linear."""

    cast: Cast
    fit: Fit | None = None
    gaps: tuple[RowGap, ...] = ()


@dataclass(frozen=True)
class Solved:
    """Targets solved from a record in one way: the effects with their parameters, those of breaks first."""

    way: Way
    system: WithEffects
    targets: list[Target]
    solution: Solution
    effects: tuple[CalibratedEffect, ...]


@dataclass(frozen=True)
class Programme:
    """Readings of a record, with effects and breaks of unknown size."""

    record: PositionRecord
    evidence: Evidence
    named: Named
    request: Asked

    @property
    def model(self) -> Bench:
        """The exact model of bench and block."""
        return self.evidence.model

    @cached_property
    def search(self) -> BreakSearch:
        """The search for the gaps of the breaks."""
        return BreakSearch(self.evidence, Work())

    @cached_property
    def groups(self) -> tuple[ChangingGroup, ...]:
        """Parts that change together at each break; an InputError for some that the search does not know."""
        by_parts = {frozenset(part.key for part in group.parts): group for group in self.search.every_group}
        groups = [by_parts.get(frozenset(keys)) for keys in self.named.changes]
        if None in groups:
            raise InputError(f"--with: the diagnosis names a break of no known parts: {self.named.changes}")
        return tuple(group for group in groups if group is not None)

    def ways(self) -> Iterator[Way]:
        """Yield each way in which the effects and breaks can act."""
        places = tuple(self.named.causes)
        if self.groups:
            for gaps in self.search.gaps_with(self.groups, places):
                yield Way(Cast((*jumping_at(self.groups, gaps), *places)), None, gaps)
        elif all(place.definition.linear for place in places):
            yield Way(Cast(places))
        else:
            for cast, fit in self.model.standing(places, Work()):
                yield Way(cast, fit)

    def solved(self) -> list[Solved]:
        """Solve for the targets in each way; an InputError where there is none."""
        every = [self.solved_in(way) for way in self.ways()]
        if not every:
            sigma = exactly(self.model.calibration.noise_bound)
            title = self.named.title or "the break"
            raise InputError(
                f"{self.record.path}: does not stand with {title} within {sigma} g; diagnose it with this noise bound"
            )
        return every

    def solved_in(self, way: Way) -> Solved:
        """Solve for the targets in one way."""
        p = self.model.here.parametrisation
        system = _system(self.evidence, self.named, way, self.request)
        targets = [widened(target, len(system.point)) for target in wanted_targets(p, self.request)]
        coefficients = _coefficient_targets(system)
        breaks = self._targets_of_breaks(system, coefficients)
        weights = np.pad(error_weights(p), ((0, 0), (0, len(system.scale))))
        slack = reading_uncertainty(self.model.readings.resolution)
        asked = [*targets, *coefficients, *(target for of_break in breaks for target in of_break)]
        solution = solve_system(system, asked, slack, self.model.calibration.noise_bound, weights)
        parameters = iter(solution.parameters)
        of_targets = list(islice(parameters, len(targets)))
        sizes = list(islice(parameters, len(coefficients)))
        effects = []
        for group, of_break in zip(self.groups, breaks, strict=True):
            changed = list(islice(parameters, len(of_break)))
            effects.append(CalibratedEffect(effect=group.words, where=", ".join(group.where), parameters=changed))
        if way.fit is None:
            effects += _effects(self.evidence, self.named, system, sizes)
        else:
            effects += effects_of_fit(self.evidence, way.fit)
        return Solved(way, system, targets, replace(solution, parameters=of_targets), tuple(effects))

    def _targets_of_breaks(self, system: WithEffects, coefficients: Sequence[Target]) -> list[list[Target]]:
        """Return for each break its changes, and the biases and scale factors after it."""
        p, number = self.model.here.parametrisation, 0
        so_far: dict[ChangingPart, NDArray] = {}
        breaks = []
        for group in self.groups:
            targets = []
            for part in group.parts:
                change = coefficients[number].weights
                so_far[part] = so_far.get(part, 0.0) + change
                words = part.key.removesuffix(f"_{part.unit}").replace("_", " ")
                targets.append(Target(part.key, f"change of {words}", part.unit, change))
                for symbol in _symbols_of(part):
                    if symbol in p.symbols:
                        after = so_far[part].copy()
                        after[p.symbols.index(symbol)] += 1.0
                        name, unit = NAMES[symbol]
                        targets.append(Target(symbol, f"{name} after the break", unit, after))
                number += 1
            breaks.append(targets)
        return breaks

    def titled(self, effects: Sequence[CalibratedEffect], standing: Sequence[Solved]) -> list[CalibratedEffect]:
        """Return effects, those of breaks with the rows between which they can be."""
        titled = list(effects)
        for k, group in enumerate(self.groups):
            first = min(one.way.gaps[k].before for one in standing)
            last = max(one.way.gaps[k].after for one in standing)
            between = self.search.between(first, last)
            title = f"a change of {group.words} {between[0].lower()}{between[1:]}"
            titled[k] = titled[k].model_copy(update={"effect": title})
        return titled


def _symbols_of(part: ChangingPart) -> tuple[str, ...]:
    """Return the parameters that change by a part; none of angles."""
    if part in BIASES:
        return (BIAS_TARGETS[BIASES.index(part)],)
    return SYMMETRIC_PAIRS[SCALES.index(part)] if part in SCALES else ()


def _system(evidence: Evidence, named: Named, way: Way, request: Asked) -> WithEffects:
    """Return readings and effects fitted together by least squares, with the known limits of the effects."""
    model: Bench = evidence.model
    cast, fit = way.cast, way.fit
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
    known, largest = _known(evidence, named, places, request, scale)
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


def _known(
    evidence: Evidence, named: Named, places: Sequence[EffectPlace], request: Asked, scale: NDArray
) -> tuple[Known, Floats]:
    """Return what priors say, and a diagnosis of another record of sizes; the largest sizes (K,) of coefficients."""
    here, wide = evidence.model.here, len(scale)
    weights, middle, half = [], [], []
    for prior in asked_priors(request.priors, here.parametrisation, request.bounds):
        weights.append(np.append(prior.weights, np.zeros(wide)))
        middle.append(0.0)
        half.append(prior.limit)
    largest = [np.zeros(0)]
    for place in places:
        ends = np.abs(np.array(coefficient_limits(place))).max(axis=0)
        if named.known:
            # This record gives the sizes up to powers of 1 - Δg/g and turns by Δβ, as the other does.
            cause = named.causes[place]
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


def _largest_of_fit(fit: Fit, room: float) -> Floats:
    """Return the largest sizes (K,) of coefficients that a record leaves possible with a fit's effects."""
    count, steps = len(fit.point), fit.possible(room)
    low, high = fit.limits
    sizes = []
    for k, limit in enumerate(np.maximum(np.abs(low), np.abs(high))):
        ends = np.add(steps.ends(count + k), fit.central[count + k])
        sizes.append(min(float(np.abs(ends).max()), float(limit)))
    return np.array(sizes)


def _coefficient_targets(system: WithEffects) -> list[Target]:
    """Return each coefficient of breaks and effects as a target."""
    count, targets = system.count, []
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
    # The coefficients of breaks come before those of effects.
    blocks = system.blocks[len(system.blocks) - len(named.causes) :]
    for (place, cause), block in zip(named.causes.items(), blocks, strict=True):
        ends = low[block], high[block]

        def reach(direction: NDArray, ends: tuple[NDArray, NDArray] = ends) -> float:
            """The farthest that coefficients within their ends go in a direction."""
            products = [np.where(direction == 0.0, 0.0, direction * end) for end in ends]
            return float(np.maximum(*products).sum())

        values = place.definition.from_coefficients(estimates[block])
        intervals = evidence.reader.told(place, linear_intervals(place, reach))
        effects.append(_effect(cause.place, values, intervals))
    return tuple(effects)


def effects_of_fit(evidence: Evidence, fit: Fit) -> tuple[CalibratedEffect, ...]:
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


def solve_with(programme: Programme, sigma: Sigma) -> Calibration:
    """Return the calibration: the union of the intervals over all ways in which effects and breaks can act."""
    nominal, every = programme.model.calibration, programme.solved()
    ranked = sorted(every, key=lambda one: one.solution.radius)
    standing = [one for one in ranked if not one.solution.contradicted]
    best = ranked[0]
    solution, contradicted = best.solution, not standing
    parameters = solution.parameters
    reading_errors = solution.reading_errors
    effects = best.effects
    for one in standing[1:]:
        parameters = either_parameters(parameters, one.solution.parameters)
        pairs = zip(reading_errors, one.solution.reading_errors, strict=True)
        reading_errors = [a.model_copy(update=ends_of_either(a, b)) for a, b in pairs]
        effects = either_effects(effects, one.effects)
    missing = [p.symbol for p in parameters if not p.determined]
    verdict, why, witness = "consistent", "", []
    if contradicted:
        verdict, why = "falsified", "no parameters and sizes of the effects keep every reading within the noise bound"
        witness = _witness(programme.record, best)
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
        "open": _open_of(best, missing),
        "next_positions": [],
        "linearised": best.system,
        "feasible": None,
        "effects": programme.titled(effects, standing or ranked[:1]),
    }
    return nominal.model_copy(update=changed)


def _open_of(best: Solved, missing: Sequence[str]) -> list[Open]:
    """Return the open directions of the best way, and one of the targets that only other ways leave open."""
    entries = open_directions(best.system, best.targets, MORE_POSITIONS)
    listed = {symbol for entry in entries for symbol in entry.parameters}
    others = [symbol for symbol in missing if symbol not in listed]
    return [*entries, Open(parameters=others, close_by=MORE_POSITIONS)] if others else entries


def _witness(record: PositionRecord, solved: Solved) -> list[Reading]:
    """Return the readings whose duals prove a falsification."""
    proof = np.abs(solved.solution.duals) * solved.system.bound > 1e-9
    rows = np.flatnonzero(proof[: solved.system.reading.size])
    return [Reading(position=int(record.position[k // 3]), accelerometer=int(k % 3 + 1)) for k in rows]


def ends_of_either(first: Any, second: Any) -> dict[str, float | None]:
    """Return the ends of the union of two intervals; None where one is unbounded."""
    ends: dict[str, float | None] = {"low": None, "high": None}
    if first.low is not None and second.low is not None:
        ends["low"] = min(first.low, second.low)
    if first.high is not None and second.high is not None:
        ends["high"] = max(first.high, second.high)
    return ends


def either_parameters(first: Sequence[Parameter], second: Sequence[Parameter]) -> list[Parameter]:
    """Return parameters as either of two ways leaves them; the estimates are those of the first."""
    parameters = []
    for one, other in zip(first, second, strict=True):
        changed = {**ends_of_either(one, other), "determined": one.determined and other.determined}
        parameters.append(one.model_copy(update=changed))
    return parameters


def either_effects(
    first: Sequence[CalibratedEffect], second: Sequence[CalibratedEffect]
) -> tuple[CalibratedEffect, ...]:
    """Return effects as either of two ways leaves them."""
    effects = []
    for one, other in zip(first, second, strict=True):
        effects.append(one.model_copy(update={"parameters": either_parameters(one.parameters, other.parameters)}))
    return tuple(effects)
