"""One evidence of several records of one instrument: shared parameters have one value, others one a record.

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

from ...models.arrays import Bools, Floats, Ints
from ...models.effects import EffectPlace
from ..bounded.programmes import Interval, chebyshev_radius
from ..bounded.sets import MOST_OUTLIERS, Problem, sets_of_size
from ..bounded.work import Work
from ..calibrated import EACH_ITS_OWN, Calibration, OfRecord, Parameter, Provenance
from ..calibration.targets import words_of
from ..motion.norm import LARGEST
from .bench_left_out import trials_of_each
from .bench_model import LARGEST_OF_BENCH, relinearised, with_possible_sizes
from .evidence import Effort, Evidence, Linear, Reader, Trial, parameters_with
from .fit import Fit, blocks_of, estimated, hull, width_of
from .of_record import Differs, InRecord, differs, in_record, is_of_instrument, plain
from .rows import Rows, reading_at

OPEN = 0.01
"""Relative part of an effect left open by a record above which several records do not seek it."""
LEAST_SLACK, MOST_SLACK = 1e-3, 0.5
"""Error of the linear model of a search, in bounds: least and largest."""
LEAST_PART = 1e-3
"""Part of a parameter in the undetermined directions below which it is determined."""


def join(records: Mapping[str, Evidence], shared: Sequence[str] = (), own: Sequence[str] = ()) -> Evidence:
    """Return the evidence of several records of one instrument, by their labels.

    `shared` and `own` are names of parameters to be shared, or each record's own, against the default; a star matches
    anything. The rows are linear about the fit of the model without effects to all records.
    """
    names: dict[str, tuple[str, str]] = {}
    columns: list[list[str]] = []
    common: dict[str, None] = {}
    every: list[str] = []
    for record in records.values():
        every += dict(record.rows.names)
    for label, record in records.items():
        columns.append([])
        for name, unit in record.rows.names:
            instrument = every.count(name) > 1 and is_of_instrument(name, shared, own)
            joint_name = name if instrument else f"{name} in {label}"
            common |= {name: None} if instrument else {}
            names[joint_name] = (joint_name, unit)
            columns[-1].append(joint_name)
    order = list(names)
    chosen, matrix, right = [], [], []
    for record, joint_names in zip(records.values(), columns, strict=True):
        picked = np.zeros((len(joint_names), len(order)))
        picked[np.arange(len(joint_names)), [order.index(name) for name in joint_names]] = 1.0
        chosen.append(picked)
        # The rows of each record about its own fit give the point that is nearest to all of them.
        rows = record.rows
        matrix.append(rows.nominal @ picked / rows.bound[:, None])
        right.append((rows.residual + rows.nominal @ rows.point) / rows.bound)
    first = estimated(np.vstack(matrix), np.concatenate(right))
    joint = Joint(
        names=tuple(names.values()),
        point=first,
        members=tuple(records.values()),
        labels=tuple(records),
        shared=tuple(common),
        chosen=tuple(chosen),
        asked=(shared, own),
    )
    return Evidence.of(JointReader(replace(joint, point=joint.refit(()).estimate)))


@dataclass(frozen=True, eq=False)
class Joint(Linear):
    """The model of several records of one instrument, with their rows one below the other, over their bounds.

    `names` are those of all parameters, linear about `point`; `members` are the evidences of the records, `labels`
    their names. `shared` are the names of the parameters that have one value; `chosen` (P_k, P) picks those of each
    record out of all P. `asked` names the parameters that are shared, or separate for each record, against the default.
    """

    names: tuple[tuple[str, str], ...]
    point: Floats
    members: tuple[Evidence, ...]
    labels: tuple[str, ...]
    shared: tuple[str, ...]
    chosen: tuple[Floats, ...]
    asked: tuple[Sequence[str], Sequence[str]]

    effort = Effort(most_sets=None, ranks_each=False)

    @cached_property
    def rows(self) -> Rows:
        """The rows of all records at the point, over their bounds."""
        residual, nominal, _ = self.at((), self.point)
        bound, folds = np.ones(len(residual)), np.concatenate([member.rows.fold_of_rows for member in self.members])
        return Rows(self.names, self.point, self.places, residual, nominal, bound, self.columns_of, fold_numbers=folds)

    @cached_property
    def starts(self) -> Ints:
        """First row of each record, and the number of all."""
        return np.cumsum([0, *(len(member.rows.residual) for member in self.members)])

    @cached_property
    def searched(self) -> tuple[tuple[EffectPlace, ...], ...]:
        """Linear effects of each record that it determines well enough."""
        of_members = []
        for member, chosen in zip(self.members, self.chosen, strict=True):
            places = member.rows.linear_places
            at = member.model.about(places, chosen @ self.point, np.zeros(width_of(places)))
            columns, rate = np.abs(at.jacobian[:, chosen.shape[0] :]), np.abs(at.rate[:, chosen.shape[0] :])
            searched = []
            for place, block in zip(places, blocks_of(places), strict=True):
                if rate[:, block].max(initial=0.0) <= OPEN * columns[:, block].max(initial=0.0):
                    searched.append(place)
            of_members.append(tuple(searched))
        return tuple(of_members)

    @cached_property
    def not_searched(self) -> tuple[str, ...]:
        """Names of effects that a search in several records leaves out."""
        searched_names = {"outlier"}
        for places in self.searched:
            for place in places:
                searched_names.add(place.effect)
        names: dict[str, None] = {}
        for member in self.members:
            for place in member.rows.places:
                if place.effect not in searched_names:
                    names[place.effect] = None
        return tuple(names)

    @cached_property
    def places(self) -> tuple[EffectPlace, ...]:
        """Effects in all records, in each alone, and shared parameters that differ in one."""
        places: dict[EffectPlace, None] = {}
        components = []
        for member in self.members:
            components.append({place.definition.component for place in member.rows.linear_places})
        for searched in self.searched:
            for place in searched:
                # An effect on a sensor that one record lacks, as a table lacks gyros, still acts in the other records.
                showing = [k for k, shown in enumerate(components) if place.definition.component in shown]
                if len(showing) > 1 and all(place in self.searched[k] for k in showing):
                    places[place] = None
        for label, searched in zip(self.labels, self.searched, strict=True):
            places |= dict.fromkeys(in_record(place, label) for place in searched)
        units = dict(self.names)
        for name in self.shared:
            for label, member in zip(self.labels, self.members, strict=True):
                if name in dict(member.rows.names):
                    places[differs(name, label, units[name])] = None
        return tuple(places)

    @cached_property
    def _here(self) -> tuple[tuple[Mapping[EffectPlace, slice], NDArray], ...]:
        """Columns of all effects of each record at the point, over the bounds."""
        columns = []
        for member, chosen, places in zip(self.members, self.chosen, self.searched, strict=True):
            blocks = blocks_of(places)
            at = member.model.about(places, chosen @ self.point, np.zeros(width_of(places)))
            columns.append((dict(zip(places, blocks, strict=True)), at.jacobian / at.bound[:, None]))
        return tuple(columns)

    def columns_of(self, places: Sequence[EffectPlace]) -> Floats:
        """Columns (M, K) of some effects at the point, over the bounds."""
        stacked = [np.zeros((self.starts[-1], 0))]
        for place in places:
            columns = np.zeros((self.starts[-1], width_of([place])))
            for k, (blocks, jacobian) in enumerate(self._here):
                if not self.acts(k, place):
                    continue
                rows = slice(self.starts[k], self.starts[k + 1])
                if isinstance(place, Differs):
                    columns[rows, 0] = jacobian[:, self._number(k, place.where)]
                elif plain(place) in blocks:
                    columns[rows] = jacobian[:, len(self.chosen[k]) :][:, blocks[plain(place)]]
                else:
                    columns[rows] = self.at([place], self.point)[1][rows, len(self.point) :]
            stacked.append(columns)
        return np.hstack(stacked)

    def acts(self, k: int, place: EffectPlace) -> bool:
        """Return whether an effect acts in the record with a number."""
        return place.record == self.labels[k] if isinstance(place, InRecord) else place in self.searched[k]

    def _number(self, k: int, name: str) -> int:
        """The number of a parameter among those of a record."""
        return list(dict(self.members[k].rows.names)).index(name)

    def at(
        self, places: Sequence[EffectPlace], point: NDArray, coefficients: NDArray | None = None
    ) -> tuple[Floats, Floats, Floats]:
        """Errors (M,), derivatives (M, P + K) and growth of the bounds (M, P + K), exact at a point and coefficients.

        All are in units of the bounds.
        """
        count, total = len(self.point), width_of(places)
        c = np.zeros(total) if coefficients is None else coefficients
        residual, jacobian, rate = [], [], []
        for k, (member, chosen) in enumerate(zip(self.members, self.chosen, strict=True)):
            x, effects, numbers, differing = chosen @ point, [], [np.zeros(0, dtype=int)], []
            for place, block in zip(places, blocks_of(places), strict=True):
                if not self.acts(k, place):
                    continue
                if isinstance(place, Differs):
                    differing.append((self._number(k, place.where), block.start))
                    x[differing[-1][0]] += c[block.start]
                else:
                    effects.append(plain(place))
                    numbers.append(np.arange(block.start, block.stop))
            of_effects = np.concatenate(numbers)
            rows = member.model.about(effects, x, c[of_effects])
            residual.append(rows.residual / rows.bound)
            for values, stacked in ((rows.jacobian, jacobian), (rows.rate, rate)):
                over_bounds = values / rows.bound[:, None]
                columns = np.zeros((len(over_bounds), count + total))
                columns[:, :count] = over_bounds[:, : len(x)] @ chosen
                columns[:, count + of_effects] = over_bounds[:, len(x) :]
                for parameter, number in differing:
                    columns[:, count + number] = over_bounds[:, parameter]
                stacked.append(columns)
        return np.concatenate(residual), np.concatenate(jacobian), np.concatenate(rate)

    @property
    def limit(self) -> float:
        """Largest radius of a consistent model."""
        return max(member.model.limit for member in self.members)

    @property
    def room(self) -> float:
        """Addition to the bounds for the digits of the readings, in units of the bounds."""
        return max(member.model.room / float(member.rows.bound.min()) for member in self.members)

    def refit(self, places: Sequence[EffectPlace]) -> Fit:
        """The exact models of all records with some effects, relinearised: least squares, then the Chebyshev fit."""
        return relinearised(self.at, places, self.point, self._own_centres)

    def _own_centres(self, jacobian: NDArray, residual: NDArray, paid: Bools, step: NDArray) -> Floats:
        """Return a step (n,) to the least radius, with the parameters of each record alone at their centre.

        Records that do not decide the radius could lie anywhere within it, and would go to and fro between its corners.
        Coefficients marked `paid`, whose sizes widen bounds, stay.
        """
        slices = [slice(begin, end) for begin, end in pairwise(self.starts)]
        acting = np.array([jacobian[rows].any(axis=0) for rows in slices])
        moved = step.copy()
        for k, rows in enumerate(slices):
            columns = np.flatnonzero(acting[k] & (acting.sum(axis=0) == 1) & ~paid)
            if not len(columns):
                continue
            errors = residual[rows] - jacobian[rows] @ moved
            moved[columns] += chebyshev_radius(jacobian[rows][:, columns], errors, np.ones(len(errors)))[1]
        return moved

    @property
    def slack(self) -> float:
        """Error of the linear model, in bounds: second order of the misfit, and the undetermined part of effects."""
        second = max(member.model.curvature for member in self.members) * self.radius**2
        return min(MOST_SLACK, LEAST_SLACK + second + OPEN * self.radius)

    @property
    def seeks_outliers(self) -> bool:
        """Return whether the search tries outliers: only where every row of every record is a reading."""
        return all(member.rows.are_readings for member in self.members)

    def candidates(
        self, size: int, work: Work, among: Sequence[EffectPlace] | None = None
    ) -> Iterator[tuple[EffectPlace, ...]]:
        """Yield sets of a given size that no bound refuses, with outliers where the records have readings."""
        places = self.classes.places if among is None else among
        problem = Problem.of(self.rows.residual, self.rows.nominal, [self.columns_of([place]) for place in places])
        outliers = MOST_OUTLIERS if self.seeks_outliers else 0
        for chosen in sets_of_size(problem, size, self.limit - 1.0 + self.slack, outliers, work):
            candidate = [places[i] for i in chosen.effects]
            candidate += [self._outlier(row) for row in chosen.outliers]
            yield tuple(candidate)

    def _outlier(self, row: int) -> InRecord:
        """Return the outlier at a reading."""
        k = int(np.searchsorted(self.starts, row, side="right")) - 1
        return in_record(reading_at(int(row - self.starts[k])), self.labels[k])

    def mended(self, places: Sequence[EffectPlace], work: Work) -> Sequence[Fit]:
        """Return the fit of a set of effects with possible sizes, if it is consistent."""
        work.programme(len(self.rows.residual), len(self.point) + width_of(places))
        fit = self.refit(places)
        if fit.radius > self.limit:
            return []
        possible = with_possible_sizes(fit, self.limit, LARGEST_OF_BENCH)
        return [] if possible is None else [possible]

    def alone_with(self, k: int, places: Sequence[EffectPlace]) -> Fit:
        """Return one record alone, with the given effects that act in it."""
        acting = []
        for place in places:
            if self.acts(k, place) and not isinstance(place, Differs):
                acting.append(plain(place))
        return self.members[k].model.refit(acting)

    def beside(self, fit: Fit) -> Iterator[tuple[EffectPlace, Floats]]:
        """Yield nothing: the diagnosis of each record names the effects that it excludes."""
        yield from ()


@dataclass(frozen=True, eq=False)
class JointReader(Reader):
    """The reader of several records of one instrument."""

    model: Joint

    def head(self) -> Mapping[str, Any]:
        """The model whose shared parameters have one value."""
        return {"baseline_model": "shared parameters"}

    @property
    def rank(self) -> int:
        """Number of directions of the parameters that all records together determine."""
        values = np.linalg.svd(self.rows.nominal, compute_uv=False)
        return int((values > max(member.rows.least_singular for member in self.model.members)).sum())

    def missing(self) -> Mapping[str, Any]:
        """Return the parameters that all records leave open; no more readings than parameters prove nothing."""
        model, rows = self.model, self.rows
        if not rows.names:
            return {}
        ends = model.baseline.ends(model.room, model.effort.most_rows)
        directions = np.linalg.svd(rows.nominal, full_matrices=True)[2]
        loose = np.abs(directions[self.rank :]).max(axis=0, initial=0.0) > LEAST_PART
        missing = []
        for (name, unit), (low, high), is_loose in zip(rows.names, ends, loose, strict=True):
            wide = unit == "1" and high - low > 2.0 * LARGEST
            if is_loose or wide or not np.isfinite((low, high)).all():
                missing.append(name)
        keys: dict[str, Any] = {"missing": tuple(missing)}
        if len(rows.residual) <= np.linalg.matrix_rank(rows.nominal):
            return keys | {"not_named": ("no more readings than parameters: nothing could be falsified",)}
        return keys if missing else {}

    def calibration_of(self, fit: Fit | None = None) -> Calibration:
        """Return the calibration by all records: the shared parameters, and those of each record."""
        parameters: dict[str, list[Parameter]] = {label: [] for label in ("", *self.model.labels)}
        if fit is not None:
            ends = fit.ends(self.model.room, self.model.effort.most_rows)
            for parameter in parameters_with(self.rows.names, fit.estimate[: len(self.rows.names)], ends):
                symbol, _, label = parameter.symbol.partition(" in ")
                parameters[label].append(parameter.model_copy(update={"symbol": symbol, "name": words_of(symbol)}))
        of_record = {}
        for label, member in zip(self.model.labels, self.model.members, strict=True):
            alone = member.reader.calibration_of()
            of_record[label] = OfRecord(
                sigma=alone.sigma,
                mountings=alone.mountings,
                parameters=parameters[label],
                provenance=Provenance(record=label),
            )
        falsified = self.model.falsified and not (fit is not None and fit.places)
        return Calibration(
            verdict="falsified" if falsified else "consistent",
            sigma=EACH_ITS_OWN,
            radius=self.model.radius if fit is None else fit.radius,
            estimator=None if fit is None else "analytic centre",
            parameters=parameters[""],
            of_record=of_record,
        )

    def named(self, place: EffectPlace) -> EffectPlace:
        """Return an effect as its record names it: an outlier with the record's own number."""
        if not isinstance(place, InRecord) or isinstance(place, Differs):
            return place
        member = self.model.members[self.model.labels.index(place.record)]
        return in_record(member.reader.named(plain(place)), place.record)

    def told(self, place: EffectPlace, ends: Sequence[Interval]) -> tuple[Interval, ...]:
        """Return intervals widened for the values that readings cannot determine."""
        if isinstance(place, Differs):
            return tuple(ends)
        of_members = []
        for k, member in enumerate(self.model.members):
            if self.model.acts(k, place):
                of_members.append(np.array(member.reader.told(plain(place), ends)).reshape(-1, 2))
        widest = hull(of_members)
        return tuple((float(low), float(high)) for low, high in widest)

    def trials(self, fit: Fit) -> Iterator[Trial]:
        """Each effect of a fit but outliers: parts of all records left out without it, with it, and with it shuffled.

        Its signature is shuffled over the rows of a record on which it acts.
        """
        folds = self.rows.fold_of_rows
        parts = [np.flatnonzero(folds == fold) for fold in range(folds.max() + 1)]
        yield from trials_of_each(fit, parts, self._shuffled)

    def _shuffled(self, columns: NDArray, rng: np.random.Generator) -> Floats:
        """Return an effect's columns (M, k) moved to other rows of the record that it acts on; of a constant to any."""
        moved = columns.copy()
        for begin, end in pairwise(self.model.starts):
            acting = begin + np.flatnonzero(columns[begin:end].any(axis=1))
            if len(acting) and np.allclose(columns[acting], columns[acting[0]]):
                acting = np.arange(begin, end)
            moved[acting] = columns[rng.permutation(acting)]
        return moved
