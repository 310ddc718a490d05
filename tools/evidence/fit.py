"""A model fitted with a set of effects: possible sizes, classes, FMUs and gain."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from ...fmus import build
from ...fmus.catalogue import COMPONENTS
from ...fmus.component import can_extend
from ...fmus.units import ARCMIN as ARCMIN
from ...models.arrays import Floats
from ...models.effects import EffectPlace, place_from_mapping
from ...models.effects.variants import Variant
from ..bounded.centre import Bounded, analytic_centre, central_programme
from ..bounded.possible import AnyOf, Possible, Proofs, Reach, Steps, allowed_about, grown_rows, polar_intervals
from ..bounded.programmes import (
    SAME_SPACE,
    Growth,
    Interval,
    SolverError,
    chebyshev_radius,
    column_space,
    is_within,
    same_space,
)
from ..bounded.sweep import Swept
from ..fields import Count
from ..orchestrator.scenario import Scenario
from ..result import Told
from .cells import Cell

DETERMINED = 1e-10
"""Part of the largest singular value below which least squares do not determine a direction."""
ROBUST_ROUNDS = 20
"""Rounds of least squares in which rows that misfit lose their weight."""
FIRST_ROWS, MORE_ROWS = 300, 100
"""Rows that a linear programme begins with, and takes in at a time."""
TOLERANCE = 1e-9
"""Relative distance beyond the radius that a row outside the selection may have."""


FAINT = 0.01
"""Least part of a bound by which a shown effect moves a reading."""

Way = Variant | Cell
"""How an effect acts that is not linear, or a cell of its unknown number."""


@dataclass(frozen=True, eq=False)
class Fit:
    """A model with a set of effects `places`, fitted to evidence and linear about the fit.

    `at` (P + K,) are the parameters of the model and the coefficients of the effects, a block for each, at which it is
    linearised. `step` (P + K,) leads from there to a Chebyshev centre, the point of least radius. `residual` (M,) are
    the errors there, `bound` (M,) their largest possible sizes, `jacobian` (M, P + K) the derivatives by parameters and
    coefficients. `growths`: growth of the bound of a reading with the size of an effect whose action on it the record
    leaves open. There is one branch for each combination of the coefficients' signs, that of the fit first.

    `radius` is the least possible largest error over its bound, with coefficients of possible size. `estimate` (P + K,)
    are parameters and coefficients of least squares, `stated` (K,) the coefficients that are reported; both are those
    of one possible point where the fit is `centred`. `variants` are the ways in which effects act that are not linear.
    `also` are consistent fits of the same effects in their other variants: a value is possible if it is possible with
    any of them. Where an effect has a variant for each value of a number, `swept` are all of these.
    """

    places: tuple[EffectPlace, ...]
    blocks: tuple[slice, ...]
    at: Floats
    step: Floats
    residual: Floats
    bound: Floats
    jacobian: Floats
    radius: float
    estimate: Floats
    stated: Floats
    variants: tuple[Way | None, ...] = ()
    growths: tuple[Growth, ...] = ()
    also: tuple["Fit", ...] = ()
    swept: tuple[Swept, ...] = ()

    @property
    def point(self) -> Floats:
        """Parameters (P,) of the model at which it is linearised."""
        return self.at[: len(self.at) - len(self.stated)]

    @property
    def coefficients(self) -> Floats:
        """Coefficients (K,) of the effects at which it is linearised."""
        return self.at[len(self.point) :]

    @property
    def central(self) -> Floats:
        """Parameters and coefficients (P + K,) where the radius is attained."""
        return self.at + self.step

    @cached_property
    def left(self) -> Floats:
        """Errors (M,) where the radius is attained."""
        return self.residual - self.jacobian @ self.step

    @property
    def allowed(self) -> Floats:
        """Largest errors (M,) at the least radius, including the part that the sizes leave open."""
        return self.bound + self.growths[0].at(self.step) if self.growths else self.bound

    @property
    def ways(self) -> tuple[tuple[EffectPlace, slice, Way | None], ...]:
        """Each effect with its coefficients and its variant."""
        return tuple(zip(self.places, self.blocks, self.variants or (None,) * len(self.places), strict=True))

    @property
    def faint(self) -> tuple[EffectPlace, ...]:
        """Effects that move no reading by `FAINT` of its bound where the radius is attained."""
        count, places = len(self.point), []
        for place, block, way in self.ways:
            if isinstance(way, Variant):
                # A variant acts by more than its coefficients.
                continue
            columns = np.arange(count + block.start, count + block.stop)
            moved = self.jacobian[:, columns] @ self.central[columns]
            if np.abs(moved / self.bound).max(initial=0.0) < FAINT:
                places.append(place)
        return tuple(places)

    @property
    def linear(self) -> bool:
        """Return whether every effect is linear in its coefficients."""
        return all(variant is None for _, _, variant in self.ways)

    @property
    def signs(self) -> tuple[float, ...]:
        """Signs of the sizes of effects that are not linear, at the least radius.

        Coefficients with whose size bounds grow have one sign, whatever their sum.
        """
        coefficients = self.central[len(self.point) :]
        signs: list[float] = []
        for _, block, variant in self.ways:
            if variant is not None:
                directions = variant.directions[:1] if variant.one_sign else variant.directions
                signs += np.sign(directions @ coefficients[block]).tolist()
        return tuple(signs)

    @property
    def sized(self) -> list[tuple[EffectPlace, Floats]]:
        """Each effect with the coefficients at which the fit is linearised."""
        return [(place, self.coefficients[block]) for place, block, _ in self.ways]

    @property
    def title(self) -> str:
        """The effects in words."""
        return " and ".join(place.title for place in self.places)

    def values(self, coefficients: NDArray | None = None) -> tuple[tuple[float, ...], ...]:
        """Return the parameters of each effect, by default the stated ones."""
        if coefficients is None:
            coefficients = self.stated
        values = []
        for place, block, variant in self.ways:
            values_of = place.definition.from_coefficients if variant is None else variant.values
            values.append(values_of(coefficients[block]))
        return tuple(values)

    @property
    def is_possible(self) -> bool:
        """Return whether the stated sizes are possible."""
        return all(are_possible(place, values) for place, values in zip(self.places, self.values(), strict=True))

    def possible(
        self,
        room: float = 0.0,
        further: NDArray | None = None,
        most_rows: int | None = None,
        proofs: Proofs | None = None,
    ) -> Possible:
        """The steps from the Chebyshev centre that keep every error within its bound and `room`.

        `further` are columns (M, C) of more effects, at zero in the fit; `most_rows`, `proofs` are as for `Possible`.
        """
        jacobian = self.jacobian if further is None else np.hstack((self.jacobian, further))
        growths = [growth.moved(self.step) for growth in self.growths]
        if further is not None:
            growths = [growth.beside(further.shape[1]) for growth in growths]
        return Possible(jacobian, self.left, self.bound + room, most_rows, growths, proofs)

    def possible_in_any(
        self,
        room: float = 0.0,
        further: NDArray | None = None,
        most_rows: int | None = None,
        proofs: Proofs | None = None,
    ) -> Steps:
        """Return `possible` for any of the effects' variants."""
        if not self.swept:
            return AnyOf([part.possible(room, further, most_rows, proofs) for part in (self, *self.also)])
        count, shared = len(self.residual), {} if proofs is None else proofs
        rows = np.linspace(0, count - 1, min(count, most_rows or count)).round().astype(int)
        return AnyOf([swept.beside(self.step, rows, room, further, shared) for swept in self.swept])

    def centred(self, room: float = 0.0, most_rows: int | None = None) -> "Fit":
        """Return the fit that states the centre of all points within the bounds and `room` with possible sizes.

        This is the analytic centre of all rows, or the central programme where these leave no interior; `most_rows` is
        as for `Possible`. Undetermined values stay as they are at the Chebyshev centre.
        """
        anything = np.full(len(self.point), np.inf)
        low, high = np.append(-anything, self.limits[0]), np.append(anything, self.limits[1])
        bound = allowed_about(self.left, self.bound + room, self.allowed - self.bound)
        free = Bounded(self.jacobian, self.left, bound)
        if self.growths:
            growth = self.growths[0].moved(self.step)
            rows, _, *ends = grown_rows(self.jacobian, self.left, bound, growth)
            free = Bounded(rows, 0.5 * (ends[0] + ends[1]), 0.5 * (ends[1] - ends[0]))
        # Where no possible sizes are consistent together, the sizes of the fit are stated.
        for bounded in (replace(free, low=low - self.central, high=high - self.central), free):
            step = analytic_centre(bounded)
            try:
                step = self._middle(bounded, room, most_rows) if step is None else step
            except SolverError:
                continue
            point = self.central + step
            return replace(self, estimate=point, stated=point[len(self.point) :])
        return self

    def _middle(self, bounded: Bounded, room: float, most_rows: int | None) -> Floats:
        """The step (P + K,) of the central programme."""
        possible = self.possible(room, None, most_rows)
        numbers, ends = [], []
        for k in range(len(self.at)):
            own_ends = possible.ends(k)
            if np.isfinite(own_ends).all():
                numbers.append(k)
                ends.append(own_ends)
        return central_programme(bounded, np.eye(len(self.at))[numbers], np.array(ends).reshape(-1, 2))

    @property
    def limits(self) -> tuple[Floats, Floats]:
        """Ends (K,) of the possible coefficients."""
        low, high = [np.zeros(0)], [np.zeros(0)]
        for place, _, variant in self.ways:
            lowest, highest = coefficient_limits(place) if variant is None else (variant.low, variant.high)
            low.append(np.asarray(lowest))
            high.append(np.asarray(highest))
        return np.concatenate(low), np.concatenate(high)

    def ends(self, room: float = 0.0, most_rows: int | None = None, count: int | None = None) -> Floats:
        """Return the ends (P, 2) of the possible values of each parameter of the model; infinite where it has no bound.

        By default all parameters are returned, else the given number of the first ones.
        """
        possible = self._steps(room, most_rows)
        ends = [np.add(possible.ends(k), self.central[k]) for k in range(len(self.point))[:count]]
        of_ways = [np.array(ends).reshape(-1, 2)]
        if not self.swept:
            of_ways += [fit.ends(room, most_rows, count) for fit in self.also]
        return hull(of_ways)

    def _steps(self, room: float, most_rows: int | None) -> Steps:
        """The possible steps; where an effect has a way for each value of a number, in any of them."""
        return self.possible_in_any(room, None, most_rows) if self.swept else self.possible(room, None, most_rows)

    def intervals(self, room: float = 0.0, most_rows: int | None = None) -> tuple[tuple[Interval, ...], ...]:
        """Ends of the values that each parameter of each effect can have; infinite where nothing bounds it.

        Arguments as for `possible`.
        """
        possible = self._steps(room, most_rows)
        intervals, count = [], len(self.point)
        for place, block, variant in self.ways:
            columns = count + np.arange(block.start, block.stop)
            middle, step = self.central[columns], possible.among(columns)

            def reach(direction: NDArray, middle: NDArray = middle, step: Reach = step) -> float:
                return float(direction @ middle + step(direction))

            intervals.append(linear_intervals(place, reach) if variant is None else _variant_intervals(variant, reach))
        if self.swept or not self.also:
            return tuple(intervals)
        of_ways = [tuple(intervals)]
        for fit in self.also:
            of_ways.append(fit.intervals(room, most_rows))
        widest = []
        for of_effect in zip(*of_ways, strict=True):
            ends = hull([np.array(ends) for ends in of_effect])
            widest.append(tuple((float(low), float(high)) for low, high in ends))
        return tuple(widest)


def not_in_all(fits: Sequence[Fit]) -> list[EffectPlace]:
    """Return the effects that only some of the fits hold."""
    places: dict[EffectPlace, int] = {}
    for fit in fits:
        for place in fit.places:
            places[place] = places.get(place, 0) + 1
    return [place for place, count in places.items() if count < len(fits)]


def contains(places: Sequence[EffectPlace], others: Sequence[EffectPlace]) -> bool:
    """Return whether two sets are equal except for effects that contain others of the second set at the same place."""
    more = [place for place in places if place not in others]
    less = {(place.effect, _home(place)) for place in others if place not in places}
    contained = set()
    for place in more:
        parts = [(name, _home(place)) for name in place.definition.contains]
        part = next((part for part in parts if part in less), None)
        if part is None:
            return False
        contained.add(part)
    return bool(more) and len(contained) == len(less)


def _home(place: EffectPlace) -> str:
    """Return the place where an effect acts, with its record where it acts in one of several."""
    return place.title.removeprefix(place.effect)


def are_possible(place: EffectPlace, values: Sequence[float]) -> bool:
    """Return whether the given values of an effect's parameters are possible."""
    return all(p.possible(value) for p, value in zip(place.definition.parameters, values, strict=True))


def linear_intervals(place: EffectPlace, reach: Reach) -> tuple[Interval, ...]:
    """Intervals of an effect's parameters: amplitudes and phases in pairs, others one by one."""
    parameters = place.definition.parameters
    intervals: list[Interval] = []
    for k, unit in enumerate(np.eye(len(parameters))):
        if parameters[k].name.endswith("phase"):
            continue
        if parameters[k].name.endswith("amplitude"):
            pair = np.eye(len(parameters))[k : k + 2]

            def in_plane(direction: NDArray, pair: NDArray = pair) -> float:
                return reach(direction @ pair)

            intervals += polar_intervals(in_plane)
        else:
            least = parameters[k].smallest
            low = -reach(-unit)
            intervals.append((low if least is None else max(least, low), reach(unit)))
    return tuple(intervals)


def _variant_intervals(variant: Way, reach: Reach) -> tuple[Interval, ...]:
    """Return intervals of the parameters of an effect that is not linear, for its variant."""
    intervals = list(variant.limits)
    for k, along in enumerate(variant.directions):
        low, high = variant.limits[k]
        intervals[k] = max(low, -reach(-along)), min(high, reach(along))
    return tuple(intervals)


def hull(ends: Sequence[NDArray]) -> Floats:
    """The least intervals (K, 2) that hold several (K, 2)."""
    low, high = np.min(ends, axis=0)[:, 0], np.max(ends, axis=0)[:, 1]
    return np.stack((low, high), axis=1)


@dataclass(frozen=True, eq=False)
class Classes:
    """Effects that can be told apart, each with the class that it represents.

    `places` is one effect of each class, in the order of the catalogue; effects that lie wholly in the model are left
    out. `members` are the others of each class, `spaces` the orthonormal columns of each beyond the model. `within` are
    members whose space is only a part of their class's: turns of the table that it can always do.
    """

    places: tuple[EffectPlace, ...]
    members: tuple[tuple[EffectPlace, ...], ...]
    spaces: tuple[Floats, ...]
    within: frozenset[EffectPlace] = frozenset()

    @staticmethod
    def of(places: Sequence[EffectPlace], spaces: Sequence[NDArray]) -> "Classes":
        """Effects sorted by the spaces that they add to the model.

        The parts of a given vector in two spaces differ by no more than the spaces do: few have to be compared.
        """
        vectors = np.random.default_rng(0).normal(size=(len(spaces[0]) if spaces else 0, 2))
        apart = 2.0 * SAME_SPACE * np.linalg.norm(vectors, axis=0)
        firsts: list[EffectPlace] = []
        members: list[list[EffectPlace]] = []
        kept_spaces: list[NDArray] = []
        marks: list[NDArray] = []
        for place, space in zip(places, spaces, strict=True):
            mark = np.linalg.norm(space.T @ vectors, axis=0)
            near = (k for k, known in enumerate(marks) if np.all(np.abs(known - mark) <= apart))
            number = next((k for k in near if same_space(space, kept_spaces[k])), None)
            if number is not None:
                members[number].append(place)
            elif space.shape[1]:
                firsts.append(place)
                members.append([])
                kept_spaces.append(space)
                marks.append(mark)
        return Classes(tuple(firsts), tuple(map(tuple, members)), tuple(kept_spaces))._with_parts()

    def _with_parts(self) -> "Classes":
        """Return the classes with each partial turn of the table as a member of the class of the whole one."""
        turning = [k for k, place in enumerate(self.places) if place.definition.turns_table]
        # The widest comes first: it is not a part of another one with the same members.
        turning.sort(key=lambda k: -self.spaces[k].shape[1])
        holders: dict[int, int] = {}
        for part, whole in product(turning, repeat=2):
            space, larger = self.spaces[part], self.spaces[whole]
            if space.shape[1] < larger.shape[1] and is_within(space, larger):
                holders.setdefault(part, whole)
        kept = [k for k in range(len(self.places)) if k not in holders]
        members, within = {k: self.members[k] for k in kept}, set[EffectPlace]()
        for part, whole in holders.items():
            parts = (self.places[part], *self.members[part])
            within.update(parts)
            members[whole] = members.get(whole, ()) + parts
        return Classes(
            tuple(self.places[k] for k in kept),
            tuple(members[k] for k in kept),
            tuple(self.spaces[k] for k in kept),
            frozenset(within),
        )

    def equivalents(self, place: EffectPlace) -> tuple[EffectPlace, ...]:
        """Return the effects that no measurement of this kind separates from the effect at `place`."""
        return tuple(member for member in self.whole_class(place) if member != place)

    def whole_class(self, place: EffectPlace) -> tuple[EffectPlace, ...]:
        """Return the class of an effect; the effect alone where it is in none."""
        for first, members in zip(self.places, self.members, strict=True):
            if place == first or place in members:
                return (first, *members)
        return (place,)

    def joint_space(self, places: Sequence[EffectPlace]) -> Floats:
        """Return the column space of a set of effects together, beyond the model."""
        spaces = [self.spaces[self.places.index(self.whole_class(place)[0])] for place in places]
        return column_space(np.hstack(spaces)) if spaces else np.zeros((1, 0))


class Gain(Told):
    """Errors of data that no estimate used, without the effects and with them.

    `over` is the kind of moves or windows, in words, `pieces` their number, `unit` the unit of the figures where it
    differs from the result's. Figures are over the sizes of the errors: fractions of g, or arcminutes of turns.
    `others` is the same of every other kind. `before`, `after` (S, d) are the errors themselves, in g or rad, NaN where
    they do not count; `rows` (S,) are their rows in the record.
    """

    over: str | None = None
    pieces: Count | None = None
    held_out_rms_before: float
    held_out_rms_after: float
    held_out_max_before: float
    held_out_max_after: float
    unit: str | None = None
    others: list["Gain"] | None = None
    before: Any = Field(default=None, exclude=True)
    after: Any = Field(default=None, exclude=True)
    rows: Any = Field(default=None, exclude=True)

    @property
    def improves(self) -> bool:
        """Return whether the effects improve the prediction of the held-out data as a whole."""
        return self.held_out_rms_after < self.held_out_rms_before


def blocks_of(places: Sequence[EffectPlace], variants: Sequence[Way | None] = ()) -> tuple[slice, ...]:
    """Return the columns of each effect, by its variant, one after the other."""
    blocks, start = [], 0
    for place, variant in zip(places, variants or [None] * len(places), strict=True):
        stop = start + (coefficient_count(place) if variant is None else variant.columns.shape[2])
        blocks.append(slice(start, stop))
        start = stop
    return tuple(blocks)


def coefficient_limits(place: EffectPlace) -> tuple[Floats, Floats]:
    """Return the ends of the possible coefficients of a linear effect; for amplitude and phase those of their pair."""
    ends: list[tuple[float, float]] = []
    for parameter in place.definition.linear_parameters:
        if parameter.name.endswith("amplitude"):
            # The square within the circle of the largest amplitude.
            largest = float(parameter.largest / np.sqrt(2.0))
            ends.append((-largest, largest))
        elif parameter.name.endswith("phase"):
            ends.append(ends[-1])
        else:
            ends.append(parameter.range)
    low, high = np.array(ends, dtype=float).T
    return low, high


def coefficient_count(place: EffectPlace) -> int:
    """Return the number of linear coefficients of an effect."""
    return len(place.definition.linear_parameters)


def width_of(places: Sequence[EffectPlace]) -> int:
    """Return the number of linear coefficients of all effects together."""
    return sum(coefficient_count(place) for place in places)


def gain_of(before: NDArray, after: NDArray, unit: float = 1.0, **more: Any) -> Gain:
    """Return the gain by errors (S, d) without and with the effects, in the quoted unit."""
    figures = {}
    for name, errors in (("before", before), ("after", after)):
        sizes = np.linalg.norm(errors, axis=1) / unit
        figures |= {f"held_out_rms_{name}": float(np.sqrt(np.mean(sizes**2))), f"held_out_max_{name}": sizes.max()}
    return Gain(before=before, after=after, **figures, **more)


def extended_fmus(
    places: Sequence[EffectPlace], folder: Path, components: Sequence[str], flavour: str = "python"
) -> dict[str, Path]:
    """Write FMUs of some components, extended by those of the effects that they can have: component -> file."""
    files = {}
    for name in components:
        extending = [place for place in places if can_extend(COMPONENTS[name], place)]
        files[name] = build(name, folder, extending, flavour=flavour)
    return files


def with_effects(
    fmus: Mapping[str, tuple[str, Mapping[str, Any]]], effects: Sequence[Mapping[str, object]]
) -> dict[str, dict[str, Any]]:
    """Return components with their parameters and those of the effects that extend them, for a scenario file."""
    of_component: dict[str | None, list[dict[str, object]]] = {}
    for entry in effects:
        place, _ = place_from_mapping(entry)
        of_component.setdefault(place.definition.component, []).append(dict(entry))
    described: dict[str, dict[str, Any]] = {}
    for name, (component, values) in fmus.items():
        described[name] = {
            "component": component,
            "effects": of_component.get(component, []),
            "parameters": values,
        }
    return described


def composed(
    title: str,
    fmus: Mapping[str, tuple[str, Mapping[str, Any]]],
    effects: Sequence[Mapping[str, object]],
    columns: Mapping[str, str],
    **parts: Any,
) -> Scenario:
    """A scenario of components, each with those of the effects composed in that extend it.

    `fmus`: of each name the component and its parameters; `effects` as in a scenario file; `columns` of the record;
    other parts of a scenario file: ``run``, ``connections``, ``stimuli``.
    """
    described = with_effects(fmus, effects)
    description = {"schema": "trihedron.scenario/1", "title": title, "fmus": described, "record": {"columns": columns}}
    return Scenario.model_validate(description | parts)


def estimated(matrix: NDArray, residual: NDArray) -> Floats:
    """Least squares of rows in units of their bounds.

    Directions that nothing determines stay where they are.
    """
    scale = np.linalg.norm(matrix, axis=0)
    scale[scale == 0.0] = 1.0
    return np.linalg.lstsq(matrix / scale, residual, rcond=DETERMINED)[0] / scale


def robust_estimate(matrix: NDArray, residual: NDArray) -> Floats:
    """Least squares of rows (M, P) in units of their bounds, in which those that misfit lose their weight."""
    step = estimated(matrix, residual)
    for _ in range(ROBUST_ROUNDS):
        weight = 1.0 / np.sqrt(np.maximum(np.abs(residual - matrix @ step), 1.0))
        step = estimated(matrix * weight[:, None], residual * weight)
    return step


def least_radius(
    matrix: NDArray, residual: NDArray, ends: tuple[NDArray, NDArray], squares: NDArray
) -> tuple[float, Floats]:
    """Return the least radius of rows (M, P) over their bounds, with limits (P,) of the coefficients, and its point.

    Of many rows few matter: those that least squares `squares` (P,) fit worst, and those that a fit to them violates.
    """
    rows = np.argsort(-np.abs(residual - matrix @ squares), kind="stable")[:FIRST_ROWS]
    step, radius, bound = np.zeros(matrix.shape[1]), float(np.abs(residual).max(initial=0.0)), np.ones(len(residual))
    while matrix.shape[1]:
        radius, step, _ = chebyshev_radius(matrix[rows], residual[rows], bound[rows], low=ends[0], high=ends[1])
        excess = np.abs(residual - matrix @ step) - radius
        excess[rows] = 0.0
        violated = np.argsort(-excess, kind="stable")[:MORE_ROWS]
        violated = violated[excess[violated] > TOLERANCE * max(1.0, radius)]
        if not len(violated):
            break
        rows = np.concatenate([rows, violated])
    return radius, step
