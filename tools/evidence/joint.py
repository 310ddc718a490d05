"""Several records of one instrument as one evidence: what they share has one value, all else is each record's own.

Parameters of the instrument are shared, those of the day, the mounting and the table are each record's own. Effects may
act in all records with one value, or in one alone; a shared parameter may differ in one. The rows are those of the
records, one below the other.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...models.effects import EffectPlace
from ..bounded.programmes import Interval, chebyshev_radius
from ..bounded.sets import MOST_OUTLIERS, Problem, Work, sets_of_size
from ..calibrated import EACH_ITS_OWN, Calibration, OfRecord, Parameter, Provenance
from ..motion.norm import LARGEST
from .bench_left_out import trials_of_each
from .bench_model import LARGEST_OF_BENCH, relinearised, with_possible_sizes
from .evidence import Evidence, Trial, parameters_with, words_of
from .fit import Fit, blocks_of, estimated
from .of_record import Differs, InRecord, differs, in_record, is_of_instrument, plain, width_of

OPEN = 0.01
"""An effect of which a record leaves open so much of what it does, relatively, is not sought in several records."""
LEAST_SLACK, MOST_SLACK = 1e-3, 0.5
"""What the linear model of a search may be wrong by, in bounds: at least, and at most."""
LEAST_PART = 1e-3
"""A parameter with so small a part in what is not determined is determined."""


def join(members: Mapping[str, Evidence], shared: Sequence[str] = (), own: Sequence[str] = ()) -> "Joint":
    """The evidence of several records of one instrument, by their labels.

    `shared` and `own` are names of parameters to be shared, or each record's own, other than by default; a star stands
    for anything. The rows are linear about the fit of the model without effects to all records.
    """
    names: dict[str, tuple[str, str]] = {}
    columns: list[list[str]] = []
    common: dict[str, None] = {}
    every = [name for member in members.values() for name, _ in member.names]
    for label, member in members.items():
        columns.append([])
        for name, unit in member.names:
            instrument = every.count(name) > 1 and is_of_instrument(name, shared, own)
            mine = name if instrument else f"{name} in {label}"
            common |= {name: None} if instrument else {}
            names[mine] = (mine, unit)
            columns[-1].append(mine)
    order = list(names)
    chosen = [
        np.array([[name == one for one in order] for name in mine], float).reshape(len(mine), len(order))
        for mine in columns
    ]
    # The rows of each about its own fit give the point that is nearest to all of them.
    pairs = list(zip(members.values(), chosen, strict=True))
    matrix = np.vstack([one.nominal @ own_ / one.bound[:, None] for one, own_ in pairs])
    right = np.concatenate([(one.residual + one.nominal @ one.point) / one.bound for one in members.values()])
    made = Joint(
        (), tuple(names.values()), estimated(matrix, right), (), tuple(members.values()), tuple(members),
        tuple(common), tuple(chosen), (shared, own),
    )  # fmt: skip
    there = replace(made, point=made.refit(()).estimate)
    return replace(there, places=there.every_place)


@dataclass(frozen=True, eq=False)
class Joint(Evidence):
    """Records of one instrument, one below the other; errors are in units of their bounds.

    `members` are the evidences of the records, `labels` what these are called; `shared` are the names of the parameters
    that have one value; `chosen` (P_k, P) picks those of each record out of all P; `asked` is what is
    shared or own other than by default.
    """

    members: tuple[Evidence, ...]
    labels: tuple[str, ...]
    shared: tuple[str, ...]
    chosen: tuple[NDArray[np.float64], ...]
    asked: tuple[Sequence[str], Sequence[str]]

    most_sets = None
    ranks_each = False

    # Rows

    @cached_property
    def starts(self) -> NDArray[np.int_]:
        """First row of each record, and the number of all."""
        return np.cumsum([0, *(len(member.residual) for member in self.members)])

    @cached_property
    def searched(self) -> tuple[tuple[EffectPlace, ...], ...]:
        """Effects of each record that are linear, and of which it leaves nothing open that counts."""
        found = []
        for member, chosen in zip(self.members, self.chosen, strict=True):
            places = member.linear_places
            at = member.about(places, chosen @ self.point, np.zeros(width_of(places)))
            columns, rate = (np.abs(values[:, chosen.shape[0] :]) for values in (at.jacobian, at.rate))
            told = (rate[:, b].max(initial=0.0) <= OPEN * columns[:, b].max(initial=0.0) for b in blocks_of(places))
            found.append(tuple(place for place, is_told in zip(places, told, strict=True) if is_told))
        return tuple(found)

    @cached_property
    def not_searched(self) -> tuple[str, ...]:
        """Names of effects that are not sought in several records together."""
        tried = {place.effect for places in self.searched for place in places} | {"outlier"}
        return tuple(dict.fromkeys(p.effect for member in self.members for p in member.places if p.effect not in tried))

    @cached_property
    def every_place(self) -> tuple[EffectPlace, ...]:
        """Effects in all records, in each alone, and shared parameters that differ in one."""
        # What a record has no readings of, as a table has none of gyros, acts in the others all the same.
        has = [{place.definition.component for place in member.linear_places} for member in self.members]
        common = [
            place
            for place in dict.fromkeys(place for places in self.searched for place in places)
            if len(those := [k for k, own in enumerate(has) if place.definition.component in own]) > 1
            and all(place in self.searched[k] for k in those)
        ]
        alone = [in_record(p, label) for label, own in zip(self.labels, self.searched, strict=True) for p in own]
        units = dict(self.names)
        apart = [
            differs(name, label, units[name])
            for name in self.shared
            for label, member in zip(self.labels, self.members, strict=True)
            if name in dict(member.names)
        ]
        return (*common, *alone, *apart)

    @cached_property
    def _here(self) -> tuple[tuple[Mapping[EffectPlace, slice], NDArray], ...]:
        """Columns of all effects of each record at the point, over the bounds."""
        found = []
        for member, chosen, places in zip(self.members, self.chosen, self.searched, strict=True):
            blocks = blocks_of(places)
            at = member.about(places, chosen @ self.point, np.zeros(width_of(places)))
            found.append((dict(zip(places, blocks, strict=True)), at.jacobian / at.bound[:, None]))
        return tuple(found)

    @cached_property
    def residual(self) -> NDArray[np.float64]:
        """Errors (M,) of the model without effects at the point, over their bounds."""
        return self.at((), self.point)[0]

    @cached_property
    def nominal(self) -> NDArray[np.float64]:
        """Columns (M, P) of the parameters over the bounds."""
        return self.at((), self.point)[1]

    def columns_of(self, places: Sequence[EffectPlace]) -> NDArray[np.float64]:
        """Columns (M, K) of some effects at the point, over the bounds."""
        found = [np.zeros((self.starts[-1], 0))]
        for place in places:
            columns = np.zeros((self.starts[-1], width_of([place])))
            for k in range(len(self.members)):
                if not self.acts(k, place):
                    continue
                rows, (blocks, own) = slice(self.starts[k], self.starts[k + 1]), self._here[k]
                if isinstance(place, Differs):
                    columns[rows, 0] = own[:, self._number(k, place.where)]
                elif plain(place) in blocks:
                    columns[rows] = own[:, len(self.chosen[k]) :][:, blocks[plain(place)]]
                else:
                    columns[rows] = self.at([place], self.point)[1][rows, len(self.point) :]
            found.append(columns)
        return np.hstack(found)

    def acts(self, k: int, place: EffectPlace) -> bool:
        """Whether an effect acts in a record, by its number."""
        return place.record == self.labels[k] if isinstance(place, InRecord) else place in self.searched[k]

    def _number(self, k: int, name: str) -> int:
        """The number of a parameter among those of a record."""
        return [own for own, _ in self.members[k].names].index(name)

    def at(
        self, places: Sequence[EffectPlace], point: NDArray, coefficients: NDArray | None = None
    ) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
        """Errors (M,), derivatives (M, P + K) and growth of the bounds (M, P + K), exact at a point and coefficients.

        All are in units of the bounds.
        """
        blocks, count = blocks_of(places), len(self.point)
        total = width_of(places)
        c = np.zeros(total) if coefficients is None else coefficients
        found: list[tuple[NDArray, NDArray, NDArray]] = []
        for k, (member, chosen) in enumerate(zip(self.members, self.chosen, strict=True)):
            mine = [
                (place, np.arange(block.start, block.stop))
                for place, block in zip(places, blocks, strict=True)
                if self.acts(k, place)
            ]
            apart = [(self._number(k, place.where), own) for place, own in mine if isinstance(place, Differs)]
            effects = [(plain(place), own) for place, own in mine if not isinstance(place, Differs)]
            x, own_columns = chosen @ point, np.concatenate([np.zeros(0, dtype=int), *(own for _, own in effects)])
            for number, own in apart:
                x[number] += c[own[0]]
            rows = member.about([place for place, _ in effects], x, c[own_columns])
            wide = []
            for values in (rows.jacobian, rows.rate):
                over = values / rows.bound[:, None]
                all_columns = np.zeros((len(over), count + total))
                all_columns[:, :count] = over[:, : len(x)] @ chosen
                all_columns[:, count + own_columns] = over[:, len(x) :]
                for number, own in apart:
                    all_columns[:, count + own[0]] = over[:, number]
                wide.append(all_columns)
            found.append((rows.residual / rows.bound, wide[0], wide[1]))
        residual, jacobian, rate = (np.concatenate(own) for own in zip(*found, strict=True))
        return residual, jacobian, rate

    # What the engine asks

    @property
    def limit(self) -> float:
        """Radius up to which the model stands."""
        return max(member.limit for member in self.members)

    def room(self, fit: Fit) -> float:
        """What digits add to the bounds, in units of these."""
        return max(member.room(fit) / float(member.bound.min()) for member in self.members)

    def told(self, place: EffectPlace, ends: Sequence[Interval]) -> tuple[Interval, ...]:
        """Intervals widened by what readings cannot tell."""
        if isinstance(place, Differs):
            return tuple(ends)
        told = (member.told(plain(place), ends) for k, member in enumerate(self.members) if self.acts(k, place))
        return tuple(
            (min(low), max(high)) for low, high in (zip(*same, strict=True) for same in zip(*told, strict=True))
        )

    def named(self, place: EffectPlace) -> EffectPlace:
        """An effect as its record names it: an outlier with the record's own number."""
        if not isinstance(place, InRecord) or isinstance(place, Differs):
            return place
        return in_record(self.members[self.labels.index(place.record)].named(plain(place)), place.record)

    def refit(self, places: Sequence[EffectPlace]) -> Fit:
        """The exact models of all records with some effects, relinearised: least squares, then the Chebyshev fit."""
        return relinearised(self.at, places, self.point, self._own_centres)

    def _own_centres(
        self, jacobian: NDArray, residual: NDArray, paid: NDArray[np.bool_], step: NDArray
    ) -> NDArray[np.float64]:
        """A step (n,) to the least radius with what is each record's own at its best.

        Records that do not decide the radius may stand anywhere within it, and would go to and fro between its corners.
        What bounds are `paid` by stays.
        """
        rows = [slice(begin, end) for begin, end in pairwise(self.starts)]
        acting = np.array([jacobian[own].any(axis=0) for own in rows])
        moved = step.copy()
        for k, own in enumerate(rows):
            columns = np.flatnonzero(acting[k] & (acting.sum(axis=0) == 1) & ~paid)
            if not len(columns):
                continue
            left = residual[own] - jacobian[own] @ moved
            moved[columns] += chebyshev_radius(jacobian[own][:, columns], left, np.ones(len(left)))[1]
        return moved

    def missing(self) -> Mapping[str, Any]:
        """Parameters that all records together do not determine; no more readings than parameters prove nothing."""
        if not self.names:
            return {}
        ends = self.baseline.ends(self.room(self.baseline), self.most_rows)
        _, values, directions = np.linalg.svd(self.nominal, full_matrices=True)
        kept = int((values > max(member.least_singular for member in self.members)).sum())
        loose = np.abs(directions[kept:]).max(axis=0, initial=0.0) > LEAST_PART
        wide = [
            unit == "1" and high - low > 2.0 * LARGEST for (_, unit), (low, high) in zip(self.names, ends, strict=True)
        ]
        which = loose | wide | ~np.isfinite(ends).all(axis=1)
        told = {"missing": tuple(name for (name, _), is_open in zip(self.names, which, strict=True) if is_open)}
        if len(self.residual) <= np.linalg.matrix_rank(self.nominal):
            return told | {"not_named": ("no more readings than parameters: nothing could be falsified",)}
        return told if told["missing"] else {}

    @property
    def slack(self) -> float:
        """What the linear model may be wrong by, in bounds: second order of the misfit, and what is left open."""
        radius = self.baseline_radius
        second = max(member.second_order_at(radius) for member in self.members)
        return min(MOST_SLACK, LEAST_SLACK + second + OPEN * radius)

    @property
    def seeks_outliers(self) -> bool:
        """Whether readings that are off are sought: in records of which every row is a reading."""
        return all(member.outlier_at(0) is not None for member in self.members)

    def candidates(
        self, size: int, work: Work, among: Sequence[EffectPlace] | None = None
    ) -> Iterator[tuple[EffectPlace, ...]]:
        """Sets of so many effects, outliers among them where records have such, that no bound refuses."""
        places = self.classes.places if among is None else among
        problem = Problem.of(self.residual, self.nominal, [self.columns_of([place]) for place in places])
        outliers = MOST_OUTLIERS if self.seeks_outliers else 0
        for chosen in sets_of_size(problem, size, self.limit - 1.0 + self.slack, outliers, work):
            yield (*(places[i] for i in chosen.effects), *(self._outlier(row) for row in chosen.outliers))

    def _outlier(self, row: int) -> InRecord:
        """A reading that is off."""
        k = int(np.searchsorted(self.starts, row, side="right")) - 1
        place = self.members[k].outlier_at(int(row - self.starts[k]))
        assert place is not None
        return in_record(place, self.labels[k])

    def mended(self, places: Sequence[EffectPlace], work: Work) -> Sequence[Fit]:
        """The fit of a set of effects with possible sizes, where the model stands with it."""
        work.programme(len(self.residual), len(self.point) + width_of(places))
        fit = self.refit(places)
        if fit.radius > self.limit:
            return []
        possible = with_possible_sizes(fit, self.limit, LARGEST_OF_BENCH)
        return [] if possible is None else [possible]

    def trials(self, fit: Fit) -> Iterator[Trial]:
        """Each effect of a fit but outliers: parts of all records left out without it, with it, and with it shuffled.

        Its signature is shuffled over the rows of a record on which it acts.
        """
        folds = np.concatenate([member.fold_of_rows() for member in self.members])
        parts = [np.flatnonzero(folds == fold) for fold in range(folds.max() + 1)]
        yield from trials_of_each(fit, parts, self._shuffled)

    def _shuffled(self, columns: NDArray, rng: np.random.Generator) -> NDArray[np.float64]:
        """Columns (M, k) of an effect moved to other rows of the same record on which it acts; of a constant to any."""
        moved = columns.copy()
        for begin, end in pairwise(self.starts):
            acting = begin + np.flatnonzero(columns[begin:end].any(axis=1))
            if len(acting) and np.allclose(columns[acting], columns[acting[0]]):
                acting = np.arange(begin, end)
            moved[acting] = columns[rng.permutation(acting)]
        return moved

    def alone_with(self, k: int, places: Sequence[EffectPlace]) -> Fit:
        """One record by itself with those of some effects that act in it."""
        mine = (place for place in places if self.acts(k, place) and not isinstance(place, Differs))
        return self.members[k].refit([plain(place) for place in mine])

    def head(self) -> Mapping[str, Any]:
        """The model whose shared parameters have one value."""
        return {"baseline_model": "shared parameters"}

    def calibration_of(self, fit: Fit | None = None) -> Calibration:
        """What the records say together: of the parameters that they share, and of each record's own."""
        parameters: dict[str, list[Parameter]] = {label: [] for label in ("", *self.labels)}
        if fit is not None:
            ends = fit.ends(self.room(fit), self.most_rows)
            for parameter in parameters_with(self.names, fit.estimate[: len(self.names)], ends):
                symbol, _, label = parameter.symbol.partition(" in ")
                parameters[label].append(parameter.model_copy(update={"symbol": symbol, "name": words_of(symbol)}))
        of_record = {}
        for label, member in zip(self.labels, self.members, strict=True):
            own = member.calibration_of()
            of_record[label] = OfRecord(
                sigma=own.sigma,
                mountings=own.mountings,
                parameters=parameters[label],
                provenance=Provenance(record=label),
            )
        falsified = self.falsified and not (fit is not None and fit.places)
        return Calibration(
            verdict="falsified" if falsified else "consistent",
            sigma=EACH_ITS_OWN,
            radius=self.baseline_radius if fit is None else fit.radius,
            estimator=None if fit is None else "analytic centre",
            parameters=parameters[""],
            of_record=of_record,
        )

    def beside(self, fit: Fit) -> Iterator[tuple[EffectPlace, NDArray[np.float64]]]:
        """Nothing: what each record excludes its own diagnosis says."""
        yield from ()
