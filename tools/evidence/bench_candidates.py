"""Sets of effects that the linear model of a bench does not refuse, and where the search linearises it.

A fit that few readings cannot draw is the centre; where the misfit is so large that the linear model may be wrong by
much, effects that stand out are fitted first and the others are sought beside them.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from ...models.effects import EffectPlace
from ...models.effects.outlier import place_of
from ...models.regressors import admissible, nominal_input
from ..bounded.sets import Problem, sets_of_size
from ..bounded.spaces import least_squares
from ..calibration.model import Linearisation, linearise, predicted_input, widening
from .bench_effects import Circumstances, Visits, added_bound, signature_columns
from .bench_model import ASTRAY, Cast, Readings, Relaxation

USUAL = 0.9
"""The misfit that this part of the readings does not exceed is what draws the fit; a few readings may miss by more."""
LEAST_SLACK = 0.05
SECOND_ORDER = 5.0
"""The linear model may be wrong by so many times the square of the usual misfit, as fractions of g."""
TOO_MUCH = 0.3
"""With more slack than this, effects that stand out are fitted before others are sought."""
MOST_ANCHORS = 3
STANDS_OUT = 0.5
"""An effect stands out that leaves at most this part of the usual misfit."""
ROUNDS = 12


@dataclass(frozen=True)
class Centre:
    """A fit of the bench with some effects, and the model linearised there.

    Attributes
    ----------
    readings : Readings
    fixed : tuple of EffectPlace
        the effects
    point : (P,) array
        parameters of the bench
    coefficients : (K,) array
        of the effects
    residual : (M,) array
        exact, fractions of g
    jacobian : (M, P + K) array
    """

    readings: Readings
    fixed: tuple[EffectPlace, ...]
    point: NDArray
    coefficients: NDArray
    residual: NDArray
    jacobian: NDArray

    @property
    def usual_misfit(self) -> float:
        """What most of the readings' misfits do not exceed, in units of the bounds."""
        return float(np.quantile(np.abs(self.residual / self.readings.bound), USUAL))

    @property
    def slack(self) -> float:
        """What the linear model may be wrong by, in units of the bounds: of second order in the usual misfit."""
        return LEAST_SLACK + SECOND_ORDER * self.usual_misfit**2 * float(self.readings.bound.min())

    def problem(self, places: Sequence[EffectPlace]) -> Problem:
        """The search for further effects in units of the bounds; the fixed ones are always there."""
        visits, bound = self.readings.visits, self.readings.bound[:, None]
        sized = [(p, self.coefficients[b]) for p, b in zip(self.fixed, Cast(self.fixed).blocks(), strict=True)]
        rows = visits.rows(self.point, visits.disturbed(self.point, sized))
        blocks = [signature_columns([place], rows) / bound for place in places]
        return Problem.of(self.residual / bound[:, 0], self.jacobian / bound, blocks)


def centre_of(readings: Readings, fixed: Sequence[EffectPlace], start: NDArray, before: Centre | None = None) -> Centre:
    """The point with about the least sum of absolute misfits.

    Parameters
    ----------
    readings : Readings
    fixed : sequence of EffectPlace
        linear effects
    start : (P,) array
        where to begin
    before : Centre, optional
        with all of them but the last: where to begin instead
    """
    cast = Cast(tuple(fixed))
    blocks = cast.blocks()
    point = start if before is None else before.point
    coefficients = np.zeros(blocks[-1].stop if blocks else 0)
    if before is not None:
        coefficients[: len(before.coefficients)] = before.coefficients
    for iteration in range(ROUNDS + 1):
        model = cast.model(readings, point, coefficients, blocks)
        assert model is not None
        residual = readings.reading.ravel() - model.reading
        # Least squares with these bounds is the least sum of absolute values; misfits within the noise count as one.
        loose = readings.bound * np.sqrt(np.maximum(1.0, np.abs(residual / readings.bound)))
        step = least_squares(model.jacobian / loose[:, None], residual / loose)
        settled = iteration == ROUNDS or np.abs(step).max(initial=0.0) < 0.1 * readings.bound.min()
        if settled or not np.abs(point + step[: len(point)]).max() <= ASTRAY:
            return Centre(readings, cast.places, point, coefficients, residual, model.jacobian)
        point, coefficients = point + step[: len(point)], coefficients + step[len(point) :]
    raise AssertionError("the loop returns")


@dataclass(frozen=True)
class Candidates:
    """The search for sets of effects by the linear model of a bench.

    Attributes
    ----------
    readings : Readings
    start : (P,) array
        the nominal fit
    places : tuple of EffectPlace
        linear effects, one of each class
    bent : tuple of EffectPlace
        effects that are not linear
    """

    readings: Readings
    start: NDArray
    places: tuple[EffectPlace, ...]
    bent: tuple[EffectPlace, ...]
    _anchors: dict[tuple[EffectPlace, ...], list[Centre]] = field(default_factory=dict)

    @cached_property
    def centre(self) -> Centre:
        """The nominal model where few readings cannot draw it."""
        return centre_of(self.readings, (), self.start)

    @cached_property
    def untold(self) -> tuple[EffectPlace, ...]:
        """Linear effects whose circumstances the record does not tell everywhere."""
        rows = self.readings.visits.rows(self.centre.point)
        return tuple(place for place in self.places if added_bound([place], rows).any())

    @cached_property
    def relaxed(self) -> dict[EffectPlace, Relaxation]:
        """What effects may do at most that are not linear everywhere."""
        every = self.readings.relaxations(self.centre.point, [*self.untold, *self.bent])
        return {relaxation.place: relaxation for relaxation in every}

    def of_size(self, size: int) -> Iterator[tuple[EffectPlace, ...]]:
        """All sets of a size that no bound refuses: linear effects and outliers, and effects that are not linear."""
        for count in range(min(size, len(self.relaxed)) + 1):
            for chosen in combinations(self.relaxed.values(), count):
                seen = set()
                free = [place for place in self.places if place not in self.untold]
                for linear in self._linear_sets(self.centre, free, chosen, size - count):
                    if linear not in seen:
                        seen.add(linear)
                        yield (*sorted(linear, key=lambda place: place.title), *(r.place for r in chosen))

    def _linear_sets(
        self, centre: Centre, places: Sequence[EffectPlace], chosen: Sequence[Relaxation], size: int
    ) -> Iterator[frozenset[EffectPlace]]:
        """Sets of so many linear effects and outliers, beside those of a centre, that no bound refuses."""
        free = [place for place in places if place not in centre.fixed]
        if size > 0 and centre.slack > TOO_MUCH:
            if centre.fixed not in self._anchors:
                self._anchors[centre.fixed] = self.anchors(centre, free)
            more = self._anchors[centre.fixed]
            for one in more:
                yield from self._linear_sets(one, places, chosen, size - 1)
            free = [place for place in free if place not in {one.fixed[-1] for one in more}]
        part, kept = self._without(centre.problem(free), chosen)
        for candidate in sets_of_size(part, size, centre.slack):
            outliers = (divmod(int(kept[row]), 3) for row in candidate.outliers)
            yield frozenset(
                (
                    *centre.fixed,
                    *(free[i] for i in candidate.effects),
                    *(place_of(row + 1, accelerometer + 1) for row, accelerometer in outliers),
                )
            )

    def anchors(self, centre: Centre, places: Sequence[EffectPlace]) -> list[Centre]:
        """Centres with one effect more that stands out, the most helpful first."""
        helpful = most_helpful(centre.problem(places), places)
        more = [
            centre_of(self.readings, (*centre.fixed, place), self.start, centre) for place in helpful[:MOST_ANCHORS]
        ]
        return [one for one in more if one.usual_misfit <= STANDS_OUT * centre.usual_misfit]

    def _without(self, problem: Problem, chosen: Sequence[Relaxation]) -> tuple[Problem, NDArray]:
        """The problem that bounds every set with these effects from below, and the readings (m,) that it keeps."""
        if not chosen:
            return problem, np.arange(len(problem.residual))
        bound = self.readings.bound
        nominal = np.hstack([problem.nominal, *(r.columns / bound[:, None] for r in chosen)])
        widened = bound + sum(r.widening for r in chosen)
        kept = np.flatnonzero(~np.any([r.touched for r in chosen], axis=0))
        shrunk = (bound / widened)[kept]
        columns = problem.columns[kept] * shrunk[:, None]
        return Problem(problem.residual[kept] * shrunk, nominal[kept] * shrunk[:, None], columns, problem.blocks), kept


def most_helpful(problem: Problem, places: Sequence[EffectPlace]) -> list[EffectPlace]:
    """Effects by what each takes off the robust sum of squares, the most helpful first."""
    root = 1.0 / np.sqrt(np.maximum(1.0, np.abs(problem.residual)))
    nominal = root[:, None] * problem.nominal
    size = np.linalg.norm(nominal, axis=0)
    basis, values, _ = np.linalg.svd(nominal / np.where(size > 0.0, size, 1.0), full_matrices=False)
    basis = basis[:, values > 1e-9 * values.max(initial=0.0)]
    target = root * problem.residual
    target = target - basis @ (basis.T @ target)
    gains = []
    for place, block in zip(places, problem.blocks, strict=True):
        columns = root[:, None] * problem.columns[:, block]
        before = np.linalg.norm(columns, axis=0)
        columns = columns - basis @ (basis.T @ columns)
        kept = np.linalg.norm(columns, axis=0) > 1e-7 * before
        if kept.any():
            part = np.linalg.svd(columns[:, kept], full_matrices=False)[0].T @ target
            gains.append((-float(part @ part), place.title, place))
    return [place for _, _, place in sorted(gains, key=lambda gain: gain[:2])]


def with_usual_signs(
    here: Linearisation, circumstances: Circumstances, noise_bound: float, bounds: tuple[float, float]
) -> Linearisation:
    """The nominal model with the signs of the inputs at the centre, where gross readings drew the fit far from it.

    Parameters
    ----------
    here : Linearisation
        the nominal model at its fit
    circumstances : Circumstances
    noise_bound : float
        σ, as a fraction of g
    bounds : (float, float)
        u^max and v^0max of (1.7)
    """
    p, at = here.parametrisation, here.positions
    readings = Readings(Visits.of(here, circumstances), here.reading, here.bound, here.sign)
    point = centre_of(readings, (), here.point).point
    sign = np.where(predicted_input(p, point, at) >= 0.0, 1, -1)
    if np.abs(point - here.point).max() <= bounds[1] or np.array_equal(sign, here.sign):
        return here
    there = linearise(p, at, here.reading, point, np.full_like(here.bound, noise_bound), sign)
    if p.symmetric:
        return there
    matrices = p.matrices[at.mounting]
    certain = admissible(at.alpha, at.beta, matrices, bounds=bounds)
    certain &= (nominal_input(at.alpha, at.beta, matrices) >= 0.0) == (sign > 0)
    return replace(there, bound=noise_bound + widening(there, certain, noise_bound, bounds))
