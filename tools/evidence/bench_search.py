"""The search for sets of effects that explain a bench's readings, about a centre that few readings cannot draw.

Gross readings, exchanged channels and a common limit do not draw the centre. Where a large misfit makes the linear
model inaccurate, the search first fits the effects that stand out, and looks for others beside them.
"""

from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from ...models.arrays import Floats
from ...models.bench import admissible, nominal_input
from ...models.effects import EffectPlace
from ...models.effects.last_stage import EXCHANGED_READINGS, place_of
from ..bounded.programmes import SolverError, least_squares
from ..bounded.sets import Problem, project, sets_of_size
from ..bounded.work import Work
from ..calibration.estimates import widening
from ..calibration.model import Linearisation, linearise, predicted_input
from ..errors import InputError
from ..rounding import upwards
from .bench_model import (
    ASTRAY,
    LARGEST_OF_BENCH,
    Cast,
    Paid,
    Readings,
    Relaxation,
    growths_of,
    least_radius,
    model_work,
)
from .bench_visits import Circumstances, is_linear, signature_columns, untold_readings
from .bench_wander import wanders
from .cells import Cell, CellsAtRest
from .fit import Classes, Fit, blocks_of

USUAL = 0.9
"""The misfit that this part of the readings does not exceed is what draws the fit; a few readings may miss by more."""
ROUNDS = 12
"""Steps to a centre that few readings cannot draw."""
LOOSE = 10.0
"""A bound [g] within which a reading says nothing."""
GROSS = 1e-3
"""Where most misfits are above this [g], a limit that many readings reach may have drawn the model."""
AT_LIMIT, FEWEST_AT_LIMIT = 3.0, 3
"""Readings within this number of bounds of the largest of their channel are at a limit, where at least the second
number of them is."""
STANDS_OUT = 0.5
"""An effect stands out that leaves at most this part of the usual misfit."""
LEAST_SLACK = 0.05
SECOND_ORDER = 5.0
"""Error of the linear model over the square of the usual misfit, as fractions of g."""
TOO_MUCH = 0.3
"""With more slack than this, effects that stand out are fitted before others are sought."""
MOST_ANCHORS = 3
ALL_BUT_SAME = 1e-12
"""Columns depend on each other where this part of the product of two columns of size one is left."""
PROVEN_WANDER = 2
"""Number of effects for which a function of time counts, since it contains many; one more where time is not proven."""


CERTAIN_CHANGE = 1e-3
"""Change of an input [g], [g/rad] whose sense no effect turns."""
MOST_BYTES, MOST_KEPT = 2**32, 2**28
"""Most memory of the columns of a search, reached by some 4,000 positions, and of those of other centres [bytes]."""
CellNumber = tuple[EffectPlace, int]
"""An effect with an unknown number, and which cell of it."""


@dataclass(frozen=True, eq=False)
class Setting:
    """A setting of the search: a centre, the slack of the model linearised there, and cells of unknown numbers.

    The slack is in units of the bounds.
    """

    centre: Fit
    slack: float
    cells: tuple[CellNumber, ...]


def centre_of(readings: Readings, cast: Cast, start: NDArray, before: Fit | None = None) -> Fit:
    """Return the point, with effects, of about the least sum of absolute misfits, which few readings cannot draw.

    These are linear, or in a way that only adds columns. It begins at parameters (P,) of the bench, or where the fit
    `before` with all of the effects but the last is.
    """
    count, bound = len(start), readings.bound
    blocks = blocks_of(cast.places, cast.variants(readings, readings.rows(start)) or ())
    x = np.append(start, np.zeros(_stop(blocks)))
    if before is not None:
        x[: len(before.at)] = before.at
    for iteration in range(ROUNDS + 1):
        model = cast.model(readings, x[:count], x[count:], blocks)
        assert model is not None
        residual = readings.reading.ravel() - model.reading
        # Least squares with these bounds minimise the sum of absolute values; misfits within the noise count as one.
        loose = bound * np.sqrt(np.maximum(1.0, np.abs(residual / bound)))
        step = least_squares(model.jacobian / loose[:, None], residual / loose)
        settled = iteration == ROUNDS or np.abs(step).max(initial=0.0) < 0.1 * bound.min()
        if settled or not np.abs((x + step)[:count]).max() <= ASTRAY:
            radius = float(np.abs(residual / bound).max(initial=0.0))
            fields = (model.jacobian, radius, x, x[count:], model.variants)
            return Fit(cast.places, blocks, x, 0.0 * x, residual, bound, *fields)
        x = x + step
    raise AssertionError("the loop returns")


def without_last(readings: Readings, fit: Fit) -> Fit:
    """Return the model linear at the bench of a fit, with all of its effects but the last, at their sizes."""
    places, blocks, count = fit.places[:-1], fit.blocks[:-1], len(fit.point)
    return _linear_at(readings, places, fit.at[: count + _stop(blocks)], count)


def _stop(blocks: Sequence[slice]) -> int:
    """Return the number of coefficients of all blocks."""
    if not blocks:
        return 0
    return int(blocks[-1].stop)


def _linear_at(readings: Readings, places: tuple[EffectPlace, ...], x: NDArray, count: int) -> Fit:
    """Return the model with linear effects at (P + K,) parameters of the bench and coefficients."""
    blocks = blocks_of(places)
    model = Cast(places).model(readings, x[:count], x[count:], blocks)
    assert model is not None
    residual = readings.reading.ravel() - model.reading
    radius = float(np.abs(residual / readings.bound).max(initial=0.0))
    return Fit(places, blocks, x, 0.0 * x, residual, readings.bound, model.jacobian, radius, x, x[count:])


def usual_misfit(fit: Fit) -> float:
    """Return the quantile of the fit's residuals below which most of them lie, in units of the bounds."""
    return float(np.quantile(np.abs(fit.residual / fit.bound), USUAL))


def usual_centre(readings: Readings, start: NDArray) -> Fit:
    """The nominal model where few readings, channels that are exchanged, and a limit of a channel cannot draw it.

    It begins at a start (P,). Readings at the largest of their channel count for little where the others then agree far
    better: a limit that many reach draws all of them.
    """
    aligned = np.zeros(len(start))
    rows, bound, back = readings.rows(aligned), readings.bound, readings
    for place in EXCHANGED_READINGS.places:
        variants = readings.variants(place, rows)
        if variants:
            # Channels may be exchanged from the first variant's time on; from the last one's on they are, and are
            # swapped back.
            first, last = variants[0], variants[-1]
            assert last.mixed is not None
            bound = np.where(first.touched.ravel(), LOOSE, bound)
            open_ = (first.touched & ~last.touched).ravel()
            readings_back = np.einsum("nij,nj->ni", last.mixed, back.reading)
            back = replace(back, reading=readings_back, bound=np.where(open_, LOOSE, back.bound))
    centre = centre_of(readings, Cast(()), start)
    if bound is not readings.bound:
        centre = _linear_at(replace(readings, bound=bound), (), centre_of(back, Cast(()), aligned).at, len(start))
    size = np.abs(readings.reading)
    within = size > size.max(axis=0) - AT_LIMIT * readings.bound.reshape(-1, 3)
    limited = within & (within.sum(axis=0) >= FEWEST_AT_LIMIT)
    if usual_misfit(centre) * float(readings.bound.min()) > GROSS and limited.any():
        unlimited = centre_of(replace(readings, bound=np.where(limited.ravel(), LOOSE, bound)), Cast(()), aligned)
        told_rows = ~limited.ravel()
        before = np.quantile(np.abs(centre.residual / readings.bound)[told_rows], USUAL)
        after = np.quantile(np.abs(unlimited.residual / readings.bound)[told_rows], USUAL)
        if after <= STANDS_OUT * before:
            return unlimited
    return centre


def with_usual_signs(
    linearised: Linearisation, circumstances: Circumstances, noise_bound: NDArray, bounds: tuple[float, float]
) -> Linearisation:
    """The nominal model with the signs of the inputs at the centre, where gross readings drew the fit far from it.

    The noise bounds (3 N,) are fractions of g, the bounds are u^max and v^0max of (1.7).
    """
    p, at = linearised.parametrisation, linearised.positions
    point = usual_centre(Readings.of(linearised, circumstances), linearised.point).point
    sign = np.where(predicted_input(p, point, at) >= 0.0, 1, -1)
    if np.abs(point - linearised.point).max() <= bounds[1] or np.array_equal(sign, linearised.sign):
        return linearised
    relinearised = linearise(p, at, linearised.reading, point, noise_bound, sign)
    if p.symmetric:
        return relinearised
    matrices = p.matrices[at.mounting]
    certain = admissible(at.alpha, at.beta, matrices, bounds=bounds)
    certain &= (nominal_input(at.alpha, at.beta, matrices) >= 0.0) == (sign > 0)
    return replace(relinearised, bound=noise_bound + widening(relinearised, certain, noise_bound, bounds))


@dataclass(frozen=True, eq=False)
class BenchSearch:
    """The search in readings for sets of some effects beside the bench's own parameters.

    It begins at `start` (P,), the parameters of the nominal fit; `classes` are those of the linear effects.
    """

    readings: Readings
    start: Floats
    places: tuple[EffectPlace, ...]
    classes: Classes

    @cached_property
    def centre(self) -> Fit:
        """The nominal model where few readings, and channels that are exchanged, cannot draw it."""
        return usual_centre(self.readings, self.start)

    def slack(self, centre: Fit) -> float:
        """Return the error of the linear model, in units of the bounds: of second order in the usual misfit."""
        return LEAST_SLACK + SECOND_ORDER * usual_misfit(centre) ** 2 * float(self.readings.bound.min())

    @cached_property
    def cells(self) -> dict[EffectPlace, Sequence[Cell]]:
        """The cells that the search uses for each effect with an unknown number."""
        rows = self.readings.rows(self.centre.point)
        cells: dict[EffectPlace, Sequence[Cell]] = {}
        for place in self.places:
            if place.definition.searched is not None and (of_place := CellsAtRest(place, rows)):
                # There is a step for each row: together they would fill the memory.
                cells[place] = of_place if of_place.is_step else list(of_place)
        columns = sum(len(of_place) * len(of_place[0].numbers) for of_place in cells.values())
        if (size := 8 * columns * len(self.readings.bound)) > MOST_BYTES:
            raise InputError(
                f"{len(self.readings)} positions: the search for effects needs {upwards(size / 2**30)} GiB, and "
                f"{MOST_BYTES >> 30} GiB is the most; give a part of the record, or average repeated positions"
            )
        return cells

    @cached_property
    def every_cell(self) -> tuple[CellNumber, ...]:
        """Each cell of each effect with an unknown number."""
        numbers: list[CellNumber] = []
        for place, cells in self.cells.items():
            for number in range(len(cells)):
                numbers.append((place, number))
        return tuple(numbers)

    @cached_property
    def _open_cells(self) -> dict[frozenset[EffectPlace], list[int]]:
        """Cells that no bound refuses, by the set that their effect with an unknown number belongs to."""
        return {}

    @cached_property
    def relaxed(self) -> dict[EffectPlace, Relaxation]:
        """Relaxations of the effects that are not linear, or whose action the record leaves partly open."""
        # The effects that are sought turn the block, and with it the senses of inputs that hardly change.
        rows = self.readings.rows(self.centre.point, certain_change=CERTAIN_CHANGE)
        places = [place for place in self.classes.places if untold_readings([place], rows).any()]
        places += [place for place in self.places if not is_linear(place) and place not in self.cells]
        return {relaxation.place: relaxation for relaxation in self.readings.relaxations(rows, places)}

    @cached_property
    def _anchors(self) -> dict[tuple[EffectPlace, ...], tuple[list[Fit], list[Setting], tuple[CellNumber, ...]]]:
        return {}

    @cached_property
    def _problems(self) -> dict[tuple[object, ...], Problem]:
        """Searches beside a centre by their candidates: they are the same beside every choice of relaxed effects."""
        return {}

    def candidates(self, size: int, work: Work) -> Iterator[tuple[EffectPlace, ...]]:
        """Yield sets of a size that no bound refuses: linear effects, outliers, and effects that are not linear."""
        if np.abs(self.centre.point).max() > LARGEST_OF_BENCH:
            return
        if size > 1:
            limit, rows = 1.0 + self.slack(self.centre), self.readings.rows_with(self.centre)
            for wander in wanders(self.centre, rows, limit, work, proven=size == PROVEN_WANDER):
                yield (wander,)
        free = [place for place in self.classes.places if place not in self.relaxed]
        for count in range(min(size, len(self.relaxed)) + 1):
            for chosen in combinations(self.relaxed.values(), count):
                relaxed_places = [effect.place for effect in chosen]
                open_sets: dict[tuple[EffectPlace, ...], set[int]] = {}
                for linear, cells in self._linear_sets(self.centre, free, chosen, size - count, work):
                    places = tuple(sorted(linear, key=lambda place: place.title) + relaxed_places)
                    if places not in open_sets and not cells:
                        yield places
                    open_sets.setdefault(places, set()).update(cells)
                # A set waits for all open cells of its effect: each counts for the possible values.
                for places, open_cells in open_sets.items():
                    if open_cells:
                        self.leave_open(places, open_cells)
                        yield places

    def leave_open(self, places: Sequence[EffectPlace], cells: Collection[int]) -> None:
        """Fit the effect with an unknown number, in this set of effects, only in some of its cells."""
        self._open_cells[self._class_set(places)] = sorted(cells)

    def _class_set(self, places: Sequence[EffectPlace]) -> frozenset[EffectPlace]:
        return frozenset(self.classes.whole_class(place)[0] for place in places)

    def two_in_time(self, work: Work) -> bool:
        """Return whether no bound refuses two effects with unknown numbers, each in one cell.

        One effect in two of its cells counts only if it is a step: two steps are two events.
        """
        every, problem = self.every_cell, replace(self.problem(self.centre, [], self.every_cell), alike=0)
        for pair in sets_of_size(problem, 2, self.slack(self.centre), 0, work):
            (first, number), (second, _) = every[pair.effects[0]], every[pair.effects[1]]
            if first != second or not self.cells[first][number].one_sign:
                return True
        return False

    def acting(self, places: Sequence[EffectPlace]) -> dict[EffectPlace, Sequence[int]]:
        """Return the cells or variants of the nonlinear effects of a set that no bound refuses."""
        classes = self._class_set(places)
        bent: dict[EffectPlace, Sequence[int]] = {}
        for place in places:
            if place in self.cells:
                bent[place] = self._open_cells.get(classes, range(len(self.cells[place])))
            elif place in self.relaxed and (count := self.relaxed[place].ways):
                bent[place] = range(count)
        return bent

    def _linear_sets(
        self, centre: Fit, places: Sequence[EffectPlace], chosen: Sequence[Relaxation], size: int, work: Work
    ) -> Iterator[tuple[frozenset[EffectPlace], tuple[int, ...]]]:
        """Yield sets of a given number of linear effects and outliers, beside those of a centre, that no bound refuses.

        Each set comes with the cell of its effect with an unknown number, if it has one.
        """
        free = [place for place in places if place not in centre.places]
        cells: tuple[CellNumber, ...] = ()
        if size > 0:
            cells = self.every_cell
        if size > 0 and self.slack(centre) > TOO_MUCH:
            if centre.places not in self._anchors:
                work.add(2 * MOST_ANCHORS * ROUNDS * model_work(self.readings))
                settings = self.settings(centre)
                self._anchors[centre.places] = self.anchors(centre, free), settings, self.nearest(centre, settings)
            anchors, settings, cells = self._anchors[centre.places]
            for anchor in anchors:
                yield from self._linear_sets(anchor, places, chosen, size - 1, work)
            for setting in settings:
                yield from self._sets_of(setting, free, chosen, size, work)
            anchored = {anchor.places[-1] for anchor in anchors}
            free = [place for place in free if place not in anchored]
        yield from self._sets_of(Setting(centre, self.slack(centre), cells), free, chosen, size, work)

    def _sets_of(
        self, setting: Setting, free: Sequence[EffectPlace], chosen: Sequence[Relaxation], size: int, work: Work
    ) -> Iterator[tuple[frozenset[EffectPlace], tuple[int, ...]]]:
        """Yield the sets of `_linear_sets` for one setting, from its cells and the free effects."""
        cells, places = setting.cells, setting.centre.places
        key = (setting.centre, tuple(free), cells)
        if key not in self._problems:
            if sum(problem.columns.nbytes for problem in self._problems.values()) > MOST_KEPT:
                self._problems.clear()
            self._problems[key] = self.problem(setting.centre, free, cells)
        problem = self._problems[key]
        part, readings = self.beside(problem, chosen)
        for candidate in sets_of_size(part, size, setting.slack, work=work):
            outliers = [int(readings[row]) for row in candidate.outliers]
            if self._paid_radius(problem, chosen, candidate.effects, outliers, work) > 1.0 + setting.slack:
                continue
            effects, own_cells = set(places), []
            for number in candidate.effects:
                if number < len(free):
                    effects.add(free[number])
                else:
                    place, cell = cells[number - len(free)]
                    effects.add(place)
                    own_cells.append(cell)
            for row in outliers:
                effects.add(place_of(row // 3 + 1, row % 3 + 1))
            yield frozenset(effects), tuple(own_cells)

    def settings(self, centre: Fit) -> list[Setting]:
        """Return the settings beside a centre, one for each effect with an unknown number that helps most.

        An approximate number determines the bench, so that all cells of the effect can be judged there.
        """
        looked_at, settings = set[EffectPlace](), []
        for k in most_helpful(self.problem(centre, [], self.every_cell)):
            place, number = self.every_cell[k]
            if place in looked_at:
                continue
            cast = Cast((*centre.places, place), {place: number})
            about = centre_of(self.readings, cast, self.start, centre)
            if usual_misfit(about) <= STANDS_OUT * usual_misfit(centre):
                cells = tuple((place, own) for own in range(len(self.cells[place])))
                settings.append(Setting(without_last(self.readings, about), self.slack(about), cells))
            looked_at.add(place)
            if len(looked_at) == MOST_ANCHORS:
                break
        return settings

    def nearest(self, centre: Fit, settings: Sequence[Setting]) -> tuple[CellNumber, ...]:
        """Return a few cells at a centre for effects without a setting: those that reduce the residual most."""
        settled = {setting.cells[0][0] for setting in settings}
        cells = [cell for cell in self.every_cell if cell[0] not in settled]
        helpful = most_helpful(self.problem(centre, [], cells))
        return tuple(cells[k] for k in helpful[:MOST_ANCHORS])

    def anchors(self, centre: Fit, places: Sequence[EffectPlace]) -> list[Fit]:
        """Return centres with one more effect that stands out, the most helpful first."""
        anchors = []
        for k in most_helpful(self.problem(centre, places))[:MOST_ANCHORS]:
            about = centre_of(self.readings, Cast((*centre.places, places[k])), self.start, centre)
            if usual_misfit(about) <= STANDS_OUT * usual_misfit(centre):
                anchors.append(about)
        return anchors

    def problem(self, centre: Fit, places: Sequence[EffectPlace], cells: Sequence[CellNumber] = ()) -> Problem:
        """The search for effects beside those of a centre, and for others in some cells, in units of the bounds."""
        rows, bound = self.readings.rows_with(centre), self.readings.bound[:, None]

        def columns() -> Iterator[NDArray]:
            for place in places:
                yield signature_columns([place], rows) / bound
            for place, number in cells:
                yield self.cells[place][number].columns.reshape(len(bound), -1) / bound

        return Problem.of(centre.residual / bound[:, 0], centre.jacobian / bound, columns(), len(cells))

    def beside(self, problem: Problem, chosen: Sequence[Relaxation]) -> tuple[Problem, NDArray]:
        """The problem that bounds every set with these effects from below, and the readings (m,) that it keeps."""
        if not chosen:
            return problem, np.arange(len(problem.residual))
        bound = self.readings.bound
        nominal, widened, touched = [problem.nominal], bound, np.zeros(len(bound), dtype=bool)
        for relaxation in chosen:
            nominal.append(relaxation.columns / bound[:, None])
            widened = widened + relaxation.widening
            touched |= relaxation.touched
        untouched = np.flatnonzero(~touched)
        shrunk = (bound / widened)[untouched]
        rows = {
            "residual": problem.residual[untouched] * shrunk,
            "nominal": np.hstack(nominal)[untouched] * shrunk[:, None],
            "columns": problem.columns[untouched] * shrunk[:, None],
        }
        return replace(problem, **rows), untouched

    def _paid_radius(
        self,
        problem: Problem,
        chosen: Sequence[Relaxation],
        effects: Sequence[int],
        outliers: Sequence[int],
        work: Work,
    ) -> float:
        """Return a lower bound of a set's radius, in which the sizes of effects pay for their undetermined parts.

        The set has effects of the problem, outliers at some readings, and the `chosen` ones. The bound is 0 if the
        record determines each of these, or if `beside` gives one as good.
        """
        untold = [relaxation for relaxation in chosen if not relaxation.ways]
        if not untold:
            return 0.0
        noise, counted = self.readings.bound, np.ones(len(self.readings.bound), dtype=bool)
        counted[outliers] = False
        widening = np.zeros(len(noise))
        for relaxation in chosen:
            if relaxation.ways:
                counted &= ~relaxation.touched
                widening = widening + relaxation.widening
        blocks = [problem.nominal]
        blocks += [problem.columns[:, problem.blocks[effect]] for effect in effects]
        blocks += [relaxation.columns / noise[:, None] for relaxation in untold]
        jacobian, columns = np.hstack(blocks), {}
        rate = np.zeros(jacobian.shape)
        for column, relaxation in enumerate(untold, start=jacobian.shape[1] - len(untold)):
            columns[relaxation.place] = column
            rate[:, column] = relaxation.rate / noise
        bound = 1.0 + widening / noise
        growths = growths_of(Paid.of(columns, rate[counted]), rate[counted], np.zeros(jacobian.shape[1]))
        work.programme(*jacobian.shape)
        try:
            return least_radius(jacobian[counted], problem.residual[counted], bound[counted], growths)[0]
        except SolverError:
            # An unknown bound refuses nothing.
            return 0.0


def most_helpful(problem: Problem) -> list[int]:
    """Return candidates by their reduction of the robust sum of squares, largest first; none without a reduction."""
    projection = project(problem, 1.0 / np.maximum(1.0, np.abs(problem.residual)), together=False)
    starts, sizes = problem.layout
    gains = np.zeros(len(sizes))
    for width in np.unique(sizes):
        of_width = np.flatnonzero(sizes == width)
        columns = starts[of_width, None] + np.arange(width)
        products = projection.own[columns][..., :width]
        scale = np.sqrt(np.diagonal(products, axis1=1, axis2=2))
        scale = np.where(scale > 0.0, scale, 1.0)
        inverse = np.linalg.pinv(products / scale[:, :, None] / scale[:, None, :], rcond=ALL_BUT_SAME, hermitian=True)
        right = projection.product[columns] / scale
        gains[of_width] = np.einsum("np,npq,nq->n", right, inverse, right)
    # Gains that differ only by rounding keep their order.
    gains = np.round(gains / max(projection.residual @ projection.residual, 1e-300), 12)
    return [k for k in np.argsort(-gains, kind="stable").tolist() if gains[k] > 0.0]
