"""Hidden effects, and the two sizes with a theory: sure detection, and sure exclusion of every rival.

Let d be the change of the readings by the unit effect, J the derivatives of the nominal model at its relinearised point
and b the bounds. Noise within its bounds can hide an effect nearer to the model than the bounds, and the model may use
up the bounds once more. An effect is therefore surely *detected* from the size 2 / min over x of max |d − J x| / b.
That is 2 σ over the Chebyshev distance; b is wider where a sign is open. No parameters of a rival with columns C can
mend the record from 2 / min over x, y of max |d − J x − C y| / b. The greatest of these sizes over all rivals outside
the effect's class surely *excludes* them.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...models.arrays import Floats
from ...models.effects import EffectPlace, Rows
from ...models.effects.columns import TIME_CONSTANT
from ...models.effects.last_stage import place_of
from ..bounded.programmes import chebyshev_radius, column_space, spread_directions
from ..bounded.sets import sharpened
from ..calibration.model import Linearisation
from ..diagnosis.cause import NamedEffect
from ..evidence.bench_visits import Circumstances, Visits, acted_on, signature_columns, untold_readings
from ..evidence.cells import Cell, lagged
from ..evidence.fit import coefficient_count
from ..evidence.setting_in import SettingIn
from ..result import finite_or_none

RECORD_DECIMALS = 9
"""Decimals of a record's numbers, as laboratories write them."""
NOTHING_LEFT = 1e-8
"""Distance, relative to the effect's largest reading, below which it is rounding: the effect lies in the model."""
TOLERANCE = 1e-3
"""Relative tolerance with which the last excluded rival is chosen."""
ROUNDS = 12
"""Rounds of Lawson's algorithm in which a rival may prove too far away to matter."""
DIRECTIONS = 16
"""Number of directions of an effect's coefficients among which the worst is sought."""
MIDDLE_OF_RECORD = 0.2, 0.8
"""Range of times at which an effect may set in, relative to the record."""
SHORT_OF_RECORD = 0.02, 0.4
"""Range of time constants, relative to the record's length, uniform in their logarithm; longer ones show little more
than a drift."""


Way = tuple[EffectPlace, Cell]
"""An effect that is not linear in one of its ways."""


@dataclass(frozen=True)
class SureSizes:
    """Sizes of an effect, as lengths of its vector of linear coefficients; infinite for none."""

    detected: float
    """least size at which the nominal model is surely falsified"""
    excluded: float
    """least size at which every single rival leaves a radius above 1; never below `detected`"""
    rival: str | None
    """the rival that is excluded last; None if it is the model itself"""


UNIT_SIZES = SureSizes(detected=1.0, excluded=1.0, rival=None)


@dataclass(frozen=True)
class Hidden:
    """A hidden effect."""

    place: EffectPlace
    values: tuple[float, ...]
    """its parameters, on the clock of the run"""
    size: float = 1.0
    """length of the vector of its linear coefficients, or in units of `sizes`; 1 for an effect that is not linear"""
    sizes: SureSizes = UNIT_SIZES
    """sizes of sure detection and of sure exclusion of every rival, in the same measure"""

    @property
    def relative_size(self) -> float:
        """Size relative to that of sure detection."""
        return self.size / self.sizes.detected

    @property
    def parameters(self) -> dict[str, float]:
        """Its parameters by name."""
        names = [parameter.name for parameter in self.place.definition.parameters]
        return dict(zip(names, self.values, strict=True))

    @property
    def entry(self) -> dict[str, Any]:
        """The effect as in a scenario file."""
        return {**NamedEffect.keys(self.place), **self.parameters}

    def since(self, hours: float, temperature: tuple[float, float] | None = None) -> "Hidden":
        """Return the same effect on a clock that begins this time [h] later, like that of a record's first row.

        `temperature` [degC] is that at the earlier beginning and at the later one, linear in time between them; None
        for a record without temperature.
        """
        values = self.parameters
        if "start" in values:
            values["start"] -= hours
        if self.place.effect == "warm-up":
            # The part that has settled by then belongs to the bias.
            values["size"] *= math.exp(-hours / values["time_constant"])
        if self.place.effect == "thermal-lag" and temperature is not None:
            # The lead of the lag at the later beginning also decays from there on.
            times, constant = np.array([0.0, abs(hours)]), np.array([values["time_constant"]])
            ahead = float(lagged(times, np.array(temperature), constant)[0][1, 0]) - temperature[1]
            offset, decay = values["coefficient"] * ahead, math.exp(-hours / constant[0])
            values["settling"] = values["settling"] * decay + offset * (1.0 if hours > 0.0 else -decay)
        return replace(self, values=tuple(values.values()))


class Secret(NamedEffect):
    """A hidden effect of a bench: the effect, its parameters, and its size relative to the two sizes with a theory."""

    parameters: dict[str, float]
    size: float
    """length of the vector of its linear coefficients; 1 for an effect that is not linear"""
    surely_detected: float | None
    rivals_excluded: float | None
    """sizes in the same measure; None for none"""
    last_rival: str | None
    """the rival that is excluded last"""

    @staticmethod
    def hidden(hidden: Hidden) -> "Secret":
        """Return the secret of a hidden effect."""
        return Secret(
            **NamedEffect.keys(hidden.place),
            parameters=hidden.parameters,
            size=hidden.size,
            surely_detected=finite_or_none(hidden.sizes.detected),
            rivals_excluded=finite_or_none(hidden.sizes.excluded),
            last_rival=hidden.sizes.rival,
        )

    @property
    def relative_size(self) -> float:
        """Size relative to that of sure detection."""
        if self.surely_detected is None:
            return 0.0
        return self.size / self.surely_detected


@dataclass(frozen=True, eq=False)
class KnownBench:
    """The model of a bench at its truth, with bounds of its readings, and its rows' circumstances."""

    model: Linearisation
    circumstances: Circumstances

    @cached_property
    def rows(self) -> Rows:
        """The rows as effects take them."""
        return Visits.of(self.model, self.circumstances).rows(self.model.point)

    def sure_sizes(
        self,
        place: EffectPlace,
        rivals: Sequence[EffectPlace],
        *,
        direction: NDArray | None = None,
        beside: Sequence[EffectPlace] = (),
        ways: Sequence[Way] = (),
    ) -> SureSizes:
        """Return the sizes from which an effect is surely detected and from which every rival is surely excluded.

        Parameters
        ----------
        place : EffectPlace
            the effect, linear in its coefficients, or an outlier
        rivals : sequence of EffectPlace
            effects outside the effect's class; an outlier at every other reading is one too
        direction : (K,) array, optional
            direction of the effect's coefficients, of length one; by default the worst of `DIRECTIONS`, each size for
            itself
        beside : sequence of EffectPlace
            further effects of the model, of any size: with one of a pair, no rival replaces the other one from these
            sizes on
        ways : sequence of Way
            ways in which effects that are not linear, rivals too, add columns

        Returns
        -------
        SureSizes
            sizes of sure detection and of sure exclusion
        """
        columns = signature_columns([place], self.rows)
        # Readings with an unknown effect on them prove nothing.
        nominal = [self.model.jacobian, _untold_columns([place], self.rows)]
        for companion in beside:
            nominal.append(_freed_columns(companion, self.rows))
        reading = None
        if place.effect == "outlier":
            reading = int(np.flatnonzero(columns[:, 0])[0])
        directions = [direction]
        if direction is None:
            directions = spread_directions(columns.shape[1], DIRECTIONS)
        possible, bound, detected = self._rivals(rivals, ways), self.model.bound, 0.0
        worst = None
        for unit in directions:
            sizes = _sizes_of_change(np.hstack(nominal), columns @ unit, bound, possible, own_reading=reading)
            detected = max(detected, sizes.detected)
            if worst is None or sizes.excluded > worst.excluded:
                worst = sizes
        assert worst is not None
        return replace(worst, detected=detected)

    def sizes_of_way(self, change: NDArray, rivals: Sequence[EffectPlace], ways: Sequence[Way]) -> SureSizes:
        """Return sizes as `sure_sizes` does, for the change of the readings (N, 3) [g] by an effect that is not
        linear."""
        return _sizes_of_change(self.model.jacobian, change.ravel(), self.model.bound, self._rivals(rivals, ways))

    def level_margins(
        self, place: EffectPlace, levels: Sequence[float], rivals: Sequence[EffectPlace]
    ) -> list[SureSizes]:
        """Return, for each level of an effect that is not linear, the factors of its change that detect it and exclude
        rivals.

        The change grows in jumps with the level, so levels are scanned: at a factor of 1 or less the effect is surely
        detected, or every linear rival surely excluded.
        """
        margins = []
        for level in levels:
            margins.append(self.sizes_of_way(level_change(place, level, self.rows), rivals, ()))
        return margins

    def _rivals(self, rivals: Sequence[EffectPlace], ways: Sequence[Way]) -> "list[_Rival]":
        """Return the rivals of an effect: other effects, and ways of effects that are not linear."""
        possible = []
        for rival in rivals:
            possible.append(_Rival(rival.title, _freed_columns(rival, self.rows)))
        for place, way in ways:
            possible.append(_Rival(place.title, way.columns.reshape(-1, way.columns.shape[2]), way.one_sign))
        return possible


@dataclass(frozen=True, eq=False)
class _Rival:
    """A rival of an effect: columns (M, K), and a flag for coefficients of one sign."""

    title: str
    columns: NDArray
    one_sign: bool = False

    def distance(self, model: NDArray, target: NDArray, own: NDArray) -> float:
        """Return the distance of a target (M,) from a model (M, P) with the rival's columns (M, K), in units of the
        bounds."""
        columns, ones = np.hstack((model, own)), np.ones(len(target))
        if not self.one_sign:
            return chebyshev_radius(columns, target, ones)[0]
        least = np.full(columns.shape[1], -np.inf)
        least[model.shape[1] :] = 0.0
        positive = chebyshev_radius(columns, target, ones, low=least)[0]
        return min(positive, chebyshev_radius(columns, target, ones, high=-least)[0])


ONE_READING = _Rival("outlier", np.zeros((0, 1)))
"""Any one reading left out."""


def _untold_columns(places: Sequence[EffectPlace], rows: Rows) -> NDArray:
    """Return one column (3 N, U) for each reading on which an effect acts in a way that the record does not show."""
    return np.eye(3 * len(rows.hours))[:, untold_readings(places, rows)]


def _freed_columns(place: EffectPlace, rows: Rows) -> NDArray:
    """Return the signature of an effect, and a column for each reading that it leaves free."""
    return np.hstack((signature_columns([place], rows), _untold_columns([place], rows)))


def _sizes_of_change(
    nominal: NDArray,
    change: NDArray,
    bound: NDArray,
    rivals: Sequence[_Rival],
    *,
    own_reading: int | None = None,
) -> SureSizes:
    """Return the factors of a change (M,) of the readings from which it is surely detected, and every rival excluded.

    Leaving out one reading is a further rival, except the change's own reading.
    """
    model, target = nominal / bound[:, None], change / bound
    scale = float(np.abs(target).max(initial=0.0))
    if scale == 0.0:
        return SureSizes(math.inf, math.inf, None)
    target = target / scale
    ones = np.ones(len(bound))
    alone, _, duals = chebyshev_radius(model, target, ones)
    if alone < NOTHING_LEFT:
        return SureSizes(math.inf, math.inf, None)
    least, nearest = alone, None
    scaled = [rival.columns / bound[:, None] for rival in rivals]
    bounds, candidates = _least_square_bounds(model, target, scaled, own_reading)
    # The other readings prove the rest without a reading that the proof does not use.
    bounds[len(rivals) :] = np.maximum(bounds[len(rivals) :], np.where(duals == 0.0, alone, 0.0))
    for k in np.argsort(bounds, kind="stable"):
        if bounds[k] >= (1.0 - TOLERANCE) * least:
            break
        if _is_farther(np.hstack((model, candidates[k])), target, (1.0 - TOLERANCE) * least, np.abs(duals)):
            continue
        if k < len(rivals):
            rival = rivals[k]
        else:
            rival = ONE_READING
        parts = (model, target, candidates[k])
        if k >= len(rivals):
            none = np.zeros((len(bound), 0))
            parts = tuple(np.delete(part, k - len(rivals), axis=0) for part in (model, target, none))
        radius = rival.distance(*parts)
        if radius < least:
            least, nearest = radius, int(k)
    last = None
    if nearest is not None:
        row, accelerometer = divmod(nearest - len(rivals), 3)
        if nearest < len(rivals):
            last = rivals[nearest].title
        else:
            last = place_of(row + 1, accelerometer + 1).title
    if least > NOTHING_LEFT:
        excluded = 2.0 / (scale * least)
    else:
        excluded = math.inf
    return SureSizes(2.0 / (scale * alone), excluded, last)


def sizes_of_change(nominal: NDArray, change: NDArray, rivals: Mapping[str, NDArray]) -> SureSizes:
    """Return the factors of a change (M,) of rows over their bounds that surely detect it, and exclude rivals by
    title."""
    possible = []
    for title, columns in rivals.items():
        possible.append(_Rival(title, columns))
    return _sizes_of_change(nominal, change, np.ones(len(change)), possible)


def _least_square_bounds(
    model: NDArray, target: NDArray, rivals: Sequence[NDArray], own_reading: int | None
) -> tuple[NDArray, list[NDArray]]:
    """Return lower bounds of the distances with each rival's columns, then with each reading's own column, and the
    columns."""
    count = len(target)
    basis = column_space(model)
    remainder = target - basis @ (basis.T @ target)
    bounds = []
    for columns in rivals:
        scale = np.abs(columns).max(initial=0.0) or 1.0
        u, values, _ = np.linalg.svd((columns - basis @ (basis.T @ columns)) / scale, full_matrices=False)
        directions = u[:, values > 1e-9 * max(values.max(initial=0.0), 1.0)]
        bounds.append(np.linalg.norm(remainder - directions @ (directions.T @ remainder)) / math.sqrt(count))
    free = 1.0 - np.sum(basis**2, axis=1)
    by_reading = np.where(free > 1e-9, remainder**2 / np.maximum(free, 1e-9), 0.0)
    # One reading less: the others' mean square is over one fewer.
    alone = np.sqrt(np.maximum(remainder @ remainder - by_reading, 0.0) / (count - 1))
    if own_reading is not None:
        alone[own_reading] = math.inf
    readings = [np.eye(count, 1, -k) for k in range(count)]
    return np.concatenate((bounds, alone)), [*rivals, *readings]


def _is_farther(columns: NDArray, target: NDArray, least: float, first: NDArray) -> bool:
    """Return True if Lawson's algorithm, from weights `first`, soon proves that columns come no nearer than `least`."""
    weights = 0.9 * first / first.sum() + 0.1 / len(target)
    for _ in range(ROUNDS):
        root = np.sqrt(weights)
        basis = column_space(columns * root[:, None])
        weighted = root * target
        remainder = weighted - basis @ (basis.T @ weighted)
        if remainder @ remainder >= least**2:
            return True
        weights = sharpened(weights, remainder / root)
    return False


def level_change(place: EffectPlace, level: float, rows: Rows) -> NDArray:
    """Return the change of the readings (N, 3) [g] by an effect that is not linear at a level, by its own kernel."""
    return acted_on([(place, (level,))], rows, rows.prediction) - rows.prediction


def draw_direction(rng: np.random.Generator, place: EffectPlace) -> NDArray:
    """Draw a direction of an effect's coefficients, of length one; positive for an effect that only grows."""
    direction = rng.normal(size=coefficient_count(place))
    direction /= np.linalg.norm(direction)
    only_grow = all(parameter.smallest == 0.0 for parameter in place.definition.linear_parameters)
    if only_grow:
        return np.abs(direction)
    return direction


def drawn_time(rng: np.random.Generator, model: SettingIn, place: EffectPlace) -> int:
    """Draw the row, or the number of the time constant, from which an effect that sets in acts in a record.

    Rows near the ends are excluded: the effect would show in hardly any piece.
    """
    cells = model.cells[place]
    if place.definition.searched == TIME_CONSTANT:
        low, high = (round(cells.number(part * float(cells.hours[-1]))) for part in SHORT_OF_RECORD)
    else:
        low, high = np.quantile(cells.edges, MIDDLE_OF_RECORD)
    return int(rng.integers(low, high))


def most_alike(model: SettingIn, place: EffectPlace, change: NDArray) -> Floats:
    """Return columns (M, K) of an effect that sets in, at the time with the least squares distance to a change (M,)."""
    cells, candidates = model.cells[place], []
    for row in cells.edges:
        candidates.append(np.nan_to_num(model.over_bounds(cells.columns(row)[0])))
    base = column_space(model.rows.nominal)
    remainder = change - base @ (base.T @ change)

    def told(columns: NDArray) -> float:
        directions = column_space(columns - base @ (base.T @ columns))
        return float(np.sum((directions.T @ remainder) ** 2))

    return max(candidates, key=told)


def largest_possible_size(place: EffectPlace, direction: NDArray) -> float:
    """Return the largest possible size along a direction of the coefficients."""
    effect = place.definition
    unit = effect.from_coefficients(direction)
    # Phases do not grow with the size.
    growing = zip(effect.linear_parameters, unit, strict=True)
    return min((p.largest / abs(v) for p, v in growing if not p.name.endswith("phase") and v != 0.0), default=0.0)
