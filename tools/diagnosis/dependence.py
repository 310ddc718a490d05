"""Place and quantity before law: find the inputs that a misfit depends on, for any law.

`dependence(evidence)` asks the evidence for its `pairs()` of a place and a quantity. For each it seeks the least
complex functions with which the model stands, within the bounds of the search. Complexity counts the coefficients that
these functions add to the model, and one more for each number that is searched for. The columns of an effect of the
catalogue count in the same way. What suffices where nothing else does that is hardly more complex, a rival, is proven.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from heapq import heapify, heappop, heappush
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import qr

from ...models.arrays import Floats
from ...models.effects.lookup import TURNS
from ..bounded.elimination import eliminated, settled_beside
from ..bounded.programmes import chebyshev_radius, column_space, spaces_beyond
from ..bounded.set_bounds import ACCEPTED, REFUSED, UNDECIDED, settle
from ..bounded.sets import Problem, sharp_weights
from ..bounded.work import Work
from ..evidence.evidence import Evidence, Reader
from ..evidence.fit import FAINT
from ..evidence.pairs import WAVES, Form, Pair, function_in_words, named
from ..evidence.rows import Channel
from ..fields import Count, Number
from ..result import Result

RIVAL = 1.5
"""A pair whose complexity is at most this factor times the least, or one coefficient more, is a rival of the
simplest."""
NEAR = 1.3
"""Below this radius a slightly larger noise bound is a candidate like any other: nothing is proven."""
MOST_SECOND_ORDER = 1.0
"""Largest error of the linear model for which functions are judged [bounds]."""
FURTHER_NUMBERS = 2
"""A function that leaves more than a bound, by the uncertainty of the linear model, is a proof where this number of
further coefficients mends it."""
OWN = 1e-7
"""Part of a column beyond the model below which the model imitates it."""
AGREED = 1e-7
"""Least change of the radius in a new linearisation; below it the radius is that of the exact model."""
MOST_ROUNDS = 4
"""Most new linearisations of the model."""
LARGEST_PART = 0.5
"""Most coefficients of a function, as a part of the number of values of its quantity."""
DEPENDENT = 1e-12
"""Part (squared) of a column below which it depends on the others."""
SHARPENED = 6
"""Rounds that sharpen the weights of the model without functions."""
ALIKE = 0.1
"""Least distance of two functions, relative to their size, at which they count as different."""
WAVES_APART, FINEST_WAVES, MOST_REFINED = WAVES[1] - WAVES[0], 1.0 / 256.0, 4
"""Spacing of the waves that are tried over the range of a quantity, the finest spacing, and the number of refused waves
about which finer ones are tried."""
SMOOTH_ORDER = 4
"""Highest power, or harmonic, of the functions by which two quantities are compared."""
KERNEL_LENGTHS = (0.15, 0.35, 0.8, 2.0)
"""Lengths over which the functions that are tried vary: of the spread of a quantity, radians of an angle."""
NOISE_PARTS = (0.03, 0.3)
"""Parts of the residual's variance that are put down to noise in the fit of such a function."""
MOST_ROWS = 400
"""Most rows that are used of a longer record, spread over it."""
NONE = np.full(5, -1)


@dataclass(frozen=True, eq=False)
class Standing:
    """A pair with the least complex functions of it that make the model fit, and their radius.

    `radius_of_next`: where that is more than the bounds, the least radius of functions that need a number or two more.
    """

    pair: Pair
    form: Form
    complexity: int
    radius: float
    radius_of_next: float = np.inf


@dataclass(frozen=True, eq=False)
class Dependence:
    """Functions of one quantity at one place that mend a falsified model.

    `standing`: pairs that make the model fit, the least complex first, up to `most_of_rivals` of it. `freedoms`: ways
    in which a place may act that make the model fit when each reading has its own value. `radius` is that of the model
    without functions. A function is a proof up to the radius `limit` and the complexity `most_complex`.
    `listed_elsewhere`, `listed_otherwise`: true if an equally simple set of the catalogue acts at another place, or
    depends on another quantity.
    """

    standing: tuple[Standing, ...]
    freedoms: tuple[str, ...]
    places: tuple[str, ...]
    radius: float
    limit: float = np.inf
    most_complex: float = np.inf
    listed_elsewhere: bool = False
    listed_otherwise: bool = False

    def shows(self, standing: Standing) -> bool:
        """Return true if a function shows its place and quantity: within bounds, with far fewer numbers than pieces."""
        radius = min(standing.radius, standing.radius_of_next)
        return radius <= self.limit and standing.complexity <= self.most_complex

    @property
    def is_near(self) -> bool:
        """Return true if a slightly larger noise bound would make the model fit."""
        return self.radius < NEAR

    @property
    def is_of_one_move(self) -> bool:
        """Return true if only one move misfits: any change in that move explains it as well."""
        return any(standing.form.kind == "while" for standing in self.standing)

    @property
    def least(self) -> int | None:
        """Return the least complexity that makes the model fit."""
        return self.standing[0].complexity if self.standing else None

    @property
    def place(self) -> str | None:
        """The place that is proven; None where several would do, or none does."""
        places = {standing.pair.where for standing in self.standing} or set(self.places)
        # If all other places are refuted for any function, no function needs to show the place.
        shown = len(set(self.places)) == 1 or any(self.shows(standing) for standing in self.standing)
        sure = len(places) == 1 and shown and not self.is_near and not self.listed_elsewhere
        return next(iter(places)) if sure else None

    @property
    def quantities(self) -> tuple[str, ...]:
        """Return the quantities that the misfit may depend on at the proven place, the least complex first."""
        if self.place is None:
            return ()
        return tuple(dict.fromkeys(standing.pair.name for standing in self.standing))

    @cached_property
    def proven(self) -> Standing | None:
        """Return the proven place and quantity; None where another place or quantity would do as well."""
        if self.place is None or not self.standing or self.listed_otherwise or self.is_of_one_move:
            return None
        first, *further = self.standing
        if not self.shows(first):
            return None
        return first if all(is_same(first.pair, standing.pair) for standing in further) else None


class Suffices(Result):
    """A function of one quantity at one place, times a known factor, that alone makes the model fit.

    Attributes
    ----------
    where : str
    quantity : str
        "n1" to "n3", inputs; two of them, their product; "alpha", "beta", "hours", "temperature", "sense" of approach
    factor : str or None
        quantity by which the function is multiplied; "tilt" where not the turn about an axis depends on it
    form : str
        form of the function: "pieces" of a line or "around" a circle, all equal; "powers"; "harmonics" up to an order,
        or one "harmonic"; a "jump", a "sawtooth", a "wave"; "while" one move lasts; "values" where it has few
    complexity : int
        coefficients beside the model's, and one more for each number that was searched for
    radius : float
        least largest error over its bound that such a function leaves
    """

    where: str
    quantity: str
    factor: str | None
    form: str
    complexity: Count
    radius: Number

    @staticmethod
    def of(standing: Standing) -> "Suffices":
        """Return a sufficient function in its published form."""
        pair = standing.pair
        return Suffices(
            where=pair.where,
            quantity=pair.quantity,
            factor=pair.factor or None,
            form=standing.form.kind,
            complexity=standing.complexity,
            radius=standing.radius,
        )

    @property
    def in_words(self) -> str:
        """Place and quantity in words."""
        return function_in_words(self.where, self.quantity, self.factor)

    @property
    def on(self) -> str:
        """The quantity with its factor, as a law begins with it."""
        return named(self.quantity, self.factor)


class Proven(Result):
    """A place proven for any law, with its quantity if only one suffices.

    Attributes
    ----------
    place : str
    quantity, factor : str or None
        None where several quantities would do, or no function of one was found
    complexity : int or None
        least complexity of a function of it that suffices
    same : tuple of str
        quantities that the record cannot tell from it
    not_excluded : tuple of str
        quantities that would do, where none is proven
    """

    place: str
    quantity: str | None = None
    factor: str | None = None
    complexity: Count | None = None
    same: tuple[str, ...] = ()
    not_excluded: tuple[str, ...] = ()

    @property
    def on(self) -> str | None:
        """The quantity with its factor, as a law begins with it."""
        return named(self.quantity, self.factor) if self.quantity else None

    @staticmethod
    def of(dependence: Dependence) -> "Proven | None":
        """Return the proven place and quantity; None where nothing is proven."""
        if dependence.place is None:
            return None
        first, names = dependence.proven, dependence.quantities
        if first is None:
            return Proven(place=dependence.place, not_excluded=names)
        return Proven(
            place=dependence.place,
            quantity=first.pair.quantity,
            factor=first.pair.factor or None,
            complexity=first.complexity,
            same=tuple(name for name in names if name != first.pair.name),
        )


def most_of_rivals(least: float) -> float:
    """Return the largest complexity of a rival of a function with the given complexity."""
    return max(RIVAL * least, least + 1.0)


def is_same(first: Pair, second: Pair) -> bool:
    """Return true if two pairs of a place depend on the same quantity, as far as these rows can tell.

    This holds if one quantity is a function of the other, as n3 = cos α is one of α: a model that fits by one fits by
    both.
    """
    if first.depends_on == second.depends_on:
        return True
    if first.where != second.where or first.told or second.told or first.factor != second.factor:
        return False
    return _within(first, second) or _within(second, first)


def _within(inner: Pair, outer: Pair) -> bool:
    """Return true if smooth functions of one quantity are functions of the other."""
    *_, smooth = inner.ladders()
    functions = inner.columns(next(form for form in smooth if form.count >= SMOOTH_ORDER))
    for ladder in outer.ladders():
        finest = [form for form in ladder if form.count <= LARGEST_PART * len(outer.values)][-1]
        space = column_space(outer.columns(finest))
        remaining = functions - space @ (space.T @ functions)
        if (np.linalg.norm(remaining, axis=0) <= ALIKE * np.linalg.norm(functions, axis=0)).all():
            return True
    return False


def dependence(evidence: Evidence, work: Work | None = None) -> Dependence | None:
    """Return the possible dependences of the misfit; None of evidence without pairs, or if the model fits.

    None, too, if the misfit is so large that the linear model may be wrong by more than a bound. The cost is added to
    the work.
    """
    pairs = evidence.reader.pairs
    if not pairs or not evidence.model.falsified or evidence.model.second_order > MOST_SECOND_ORDER:
        return None
    return Search(evidence, pairs, work or Work()).dependence


@dataclass(frozen=True, eq=False)
class Trial:
    """One form of a pair, and the orthonormal columns (M, K) that it adds to the model; None until computed.

    Then `least` is its number of coefficients less those that the model may imitate.
    """

    pair: Pair
    form: Form
    space: Floats | None
    least: int = 0

    @property
    def complexity(self) -> int:
        """Return the number of coefficients beyond the model plus searched numbers, or a lower bound of it."""
        return (self.least if self.space is None else self.space.shape[1]) + self.form.searched


@dataclass(frozen=True, eq=False)
class Search:
    """The search for the least complex functions, by bounds first and programmes where these leave it open."""

    evidence: Evidence
    pairs: Sequence[Pair]
    work: Work

    @cached_property
    def problem(self) -> Problem:
        """The model without functions, rows in units of their bounds, its columns orthonormal."""
        bound = self.evidence.rows.bound
        return Problem.of(
            self.evidence.rows.residual / bound, column_space(self.evidence.rows.nominal / bound[:, None]), []
        )

    @cached_property
    def weights(self) -> Floats:
        """Weights (M,) that refuse most."""
        count = len(self.problem.residual)
        return sharp_weights(self.problem, np.full(count, 1.0 / count), SHARPENED)

    @cached_property
    def limit(self) -> float:
        """Return the radius up to which the linear model counts as a fit, because the exact one may fit."""
        return self.evidence.model.limit + max(self.evidence.model.second_order, FAINT)

    @cached_property
    def told(self) -> float:
        """Return the radius up to which a form identifies a function.

        A function that differs from the form by no more than `FAINT` of a bound, which is never shown, leaves no more
        than the bounds. Of a model that is not linearised anew the bounds alone count.
        """
        model, reader = self.evidence.model, self.evidence.reader
        if reader.about(reader.rows.point) is None:
            return model.limit
        return model.limit + FAINT

    @property
    def dependence(self) -> Dependence:
        """Return the dependence found."""
        freedoms = self.freedoms
        standing = tuple(self.standing(freedoms))
        places = tuple(dict.fromkeys(pair.freedom.split()[0] for pair in self.pairs if pair.freedom in freedoms))
        model = self.evidence.model
        most_complex = LARGEST_PART * self.evidence.rows.piece_count
        return Dependence(standing, tuple(freedoms), places, model.radius, self.told, most_complex)

    @cached_property
    def freedoms(self) -> list[str]:
        """Ways in which a place may act that make the model fit when each reading has its own value."""
        first: dict[str, Pair] = {}
        for pair in self.pairs:
            if pair.factor in ("", "tilt", *TURNS):
                first.setdefault(pair.freedom, pair)
        freedoms = []
        for freedom in dict.fromkeys(pair.freedom for pair in self.pairs):
            pair = first[freedom]
            if pair.anything or self.stands_freely(pair.spread(np.eye(len(pair.values)))):
                freedoms.append(freedom)
        return freedoms

    def stands_freely(self, columns: NDArray) -> bool:
        """Return true if the model fits with an unknown for each value, of columns (M, K)."""
        system = np.column_stack((self.problem.nominal, self.problem.residual))
        over_bounds = columns / self.evidence.rows.bound[:, None]
        remaining = eliminated(system, over_bounds)
        if remaining is None:
            self.work.add(50.0 + 0.1 * system.size)
            verdict = settled_beside(system, over_bounds, self.weights, self.limit)
            return self.stands(self.space_of(columns)) if verdict == UNDECIDED else verdict == ACCEPTED
        if not len(remaining):
            return True
        self.work.programme(*remaining.shape)
        return chebyshev_radius(remaining[:, :-1], remaining[:, -1], np.ones(len(remaining)))[0] <= self.limit

    def space_of(self, columns: NDArray) -> Floats:
        """Return the space that columns (M, K) add to the model."""
        self.work.add(20.0 + 2e-3 * columns.size * columns.shape[1])
        return spaces_beyond(self.problem.nominal, [columns / self.evidence.rows.bound[:, None]])[0]

    def stands(self, space: NDArray) -> bool:
        """Return true if the model fits with columns (M, K) added."""
        matrix, residual = np.ascontiguousarray(np.hstack((self.problem.nominal, space))), self.problem.residual
        if not space.shape[1]:
            return False
        rows, columns = matrix.shape
        self.work.add(50.0 + 5e-3 * rows * columns * columns)
        system = (matrix, residual, columns, *self.problem.layout)
        verdict, _ = settle(system, NONE, self.weights.copy(), self.limit**2)
        if verdict in (REFUSED, ACCEPTED):
            return bool(verdict == ACCEPTED)
        return self.radius(matrix) <= self.limit

    def radius(self, matrix: NDArray) -> float:
        """The radius that columns (M, K) leave."""
        self.work.programme(*matrix.shape)
        return chebyshev_radius(matrix, self.problem.residual, np.ones(len(matrix)))[0]

    def exact_radius(self, trial: Trial) -> float | None:
        """The radius that a function leaves of the exact model, linearised at its own fit.

        None of a model that is not linearised anew.
        """
        reader, pair, last = self.evidence.reader, trial.pair, np.inf
        for _ in range(MOST_ROUNDS):
            radius, step = self.fit_with(reader, pair.columns(trial.form))
            if abs(radius - last) <= AGREED:
                return radius
            moved = reader.about(reader.rows.point + step)
            if moved is None:
                return None
            reader, last = moved, radius
            pair = next(one for one in reader.pairs if one.is_named_as(pair))
        return radius

    def fit_with(self, reader: Reader, columns: NDArray) -> tuple[float, Floats]:
        """The radius that columns (M, K) leave, and the step (P,) of the model's parameters to it.

        Columns that the model imitates are left out; those that add most are used. They keep their own values, because
        changes of the model's parameters in their place would have a second order.
        """
        bound = reader.rows.bound
        nominal, added = reader.rows.nominal / bound[:, None], columns / bound[:, None]
        base = column_space(nominal)
        decomposition = qr(added - base @ (base.T @ added), mode="r", pivoting=True)
        sizes, order = np.asarray(decomposition[0]), np.asarray(decomposition[-1])
        own = np.abs(np.diag(sizes)) > OWN * np.linalg.norm(added, axis=0).max()
        matrix = np.hstack((nominal, added[:, order[: own.sum()]]))
        self.work.programme(*matrix.shape)
        radius, step, _ = chebyshev_radius(matrix, reader.rows.residual / bound, np.ones(len(bound)))
        return radius, step[: nominal.shape[1]]

    def standing(self, freedoms: Sequence[str]) -> Iterator[Standing]:
        """Return the least complex functions of each pair, up to the complexity of a rival of the least complex."""
        every = (trial for pair in self.pairs if pair.freedom in freedoms for trial in self.trials(pair))
        # Waiting trials come before trials of equal complexity; then the order of arrival counts.
        queue = [(trial.complexity, trial.space is not None, k, trial) for k, trial in enumerate(every)]
        heapify(queue)
        standing_pairs: list[Pair] = []
        most = np.inf
        while queue:
            complexity, _, number, trial = heappop(queue)
            if complexity > most:
                return
            if trial.space is None:
                trial = replace(trial, space=self.space_of(trial.pair.columns(trial.form)))
                heappush(queue, (trial.complexity, True, number, trial))
                continue
            # Several places with functions of their own contain each of them: no rivals of one that stands.
            is_standing = any(pair in standing_pairs for pair in (trial.pair, *trial.pair.members))
            if is_standing or not self.stands(trial.space):
                continue
            radius, radius_of_next = self.exact_radius(trial), np.inf
            if radius is None:
                radius = self.radius(np.hstack((self.problem.nominal, trial.space)))
                if radius > self.told:
                    radius_of_next = self.radius_of_next(trial)
            elif radius > self.told:
                continue
            standing_pairs.append(trial.pair)
            most = min(most, most_of_rivals(trial.complexity))
            yield Standing(trial.pair, trial.form, trial.complexity, radius, radius_of_next)

    def radius_of_next(self, trial: Trial) -> float:
        """The least radius of forms of its pair that have a number or two more than a trial."""
        least = np.inf
        for ladder in trial.pair.ladders():
            for form in ladder:
                space = self.space_of(trial.pair.columns(form))
                if trial.complexity < space.shape[1] <= trial.complexity + FURTHER_NUMBERS:
                    least = min(least, self.radius(np.hstack((self.problem.nominal, space))))
        return least

    def trials(self, pair: Pair) -> Iterator[Trial]:
        """Return all forms of a pair that may fit."""
        for ladder in pair.ladders():
            forms = [form for form in ladder if form.count <= LARGEST_PART * len(pair.values)]
            # Functions of many pieces include those of a half or a third of the number.
            finest = forms[-2:]
            columns = [pair.columns(form) for form in finest]
            spaces = [self.space_of(added) for added in columns]
            if not any(self.stands(space) for space in spaces):
                continue
            for form, space in zip(finest, spaces, strict=True):
                yield Trial(pair, form, space)
            imitated = max(c.shape[1] - s.shape[1] for c, s in zip(columns, spaces, strict=True))
            for form in forms[:-2]:
                yield Trial(pair, form, None, max(0, pair.size(form) - imitated))
        forms = [*pair.single(), *(self.waves_between(pair) if pair.waves else ())]
        if forms:
            yield from self.open_trials(pair, forms)

    def waves_between(self, pair: Pair) -> list[Form]:
        """Yield waves between those of the grid, closer and closer to the least refuted ones.

        A wave that is a little off in its frequency is far off at the ends of a record.
        """
        bounds: dict[float, float] = {}
        step, waves = 2.0 * WAVES_APART, list(WAVES)
        while True:
            blocks = pair.columns_of([Form("wave", at=at) for at in waves])
            bounds |= dict(zip(waves, self.bounds(blocks).tolist(), strict=True))
            step *= 0.5
            if step <= FINEST_WAVES:
                return [Form("wave", at=at) for at in bounds if at not in WAVES]
            nearest = sorted(bounds, key=lambda at: bounds[at])[:MOST_REFINED]
            between = {at - 0.5 * step for at in nearest} | {at + 0.5 * step for at in nearest}
            waves = sorted(between - set(bounds))

    def open_trials(self, pair: Pair, forms: Sequence[Form]) -> Iterator[Trial]:
        """Return the forms that the weights do not refute."""
        every = pair.columns_of(forms)
        for form, columns, bound in zip(forms, every, self.bounds(every), strict=True):
            if bound > self.limit:
                continue
            space = self.space_of(columns)
            if space.shape[1]:
                yield Trial(pair, form, space)

    @cached_property
    def weighted(self) -> tuple[NDArray, NDArray, NDArray]:
        """Roots (M,) of the weights, a basis of the weighted model, and the weighted residual without it."""
        root = np.sqrt(self.weights)
        basis = column_space(root[:, None] * self.problem.nominal)
        residual = root * self.problem.residual
        return root, basis, residual - basis @ (basis.T @ residual)

    def bounds(self, blocks: Sequence[NDArray]) -> Floats:
        """Return lower bounds (n,) of the radii for n blocks of a few columns (M, k), each alone."""
        root, basis, residual = self.weighted
        columns, explained = np.vstack([block.T for block in blocks]), np.zeros(len(blocks))
        self.work.add(2.0 * len(blocks) + 1e-4 * columns.size * basis.shape[1])
        columns *= root / self.evidence.rows.bound
        columns -= (columns @ basis) @ basis.T
        widths = np.array([block.shape[1] for block in blocks])
        first, products = np.cumsum(widths) - widths, columns @ residual
        for width in np.unique(widths):
            alike = np.flatnonzero(widths == width)
            at = first[alike][:, None] + np.arange(width)
            columns_alike, product = columns[at], products[at]
            inverse = np.linalg.pinv(columns_alike @ columns_alike.swapaxes(1, 2), rcond=DEPENDENT, hermitian=True)
            explained[alike] = np.einsum("np,npq,nq->n", product, inverse, product)
        return np.sqrt(np.maximum(0.0, residual @ residual - explained))


def residual_structure(channels: Sequence[Channel]) -> tuple[dict[str, Any], ...]:
    """Return the part of the residual that a smooth function of one quantity predicts at left-out readings.

    Each entry has the label of a component and the quantity ``on``. ``explained``: the part of the residual's sum of
    squares that is predicted when each reading is left out in turn. ``explainable``: the mean part that exceeds uniform
    noise within the bound. The most telling quantity comes first, then those of several variables.
    """
    single: list[dict[str, Any]] = []
    joint: list[dict[str, Any]] = []
    for channel in channels:
        rows = np.unique(np.linspace(0, len(channel.error) - 1, MOST_ROWS).round().astype(int))
        error, bound = channel.error[rows], channel.bound[rows]
        total, explainable = float((error**2).sum()), 0.0
        if total > 0.0:
            explainable = max(0.0, 1.0 - float((bound**2).sum()) / 3.0 / total)

        circles = {name: on_circle(angle[rows]) for name, angle in channel.angles.items()}
        of_one = dict(circles)
        for name, values in channel.quantities.items():
            of_one[name] = in_deviations(values[rows])
        of_several: dict[str, NDArray] = {}
        if circles:
            of_several[" and ".join(circles)] = np.hstack(list(circles.values()))
        for name, values in channel.joint.items():
            of_several[name] = in_deviations(values[rows])
        for points_of, entries in ((of_one, single), (of_several, joint)):
            for on, points in points_of.items():
                share = predicted_share(points, error)
                entries.append({**channel.label, "on": on, "explained": share, "explainable": explainable})
    for entries in (single, joint):
        entries.sort(key=lambda entry: -round(float(entry["explained"]), 9))
    return (*single, *joint)


def on_circle(angle: NDArray) -> NDArray:
    """An angle (N,) as a point (N, 2) of the unit circle."""
    return np.stack((np.cos(angle), np.sin(angle)), axis=1)


def in_deviations(values: NDArray) -> NDArray:
    """Quantities (N, k) in units of their standard deviation; zeros where they do not vary."""
    deviation = values.std(axis=0)
    varies = deviation > 1e-12 * np.abs(values).max(initial=0.0)
    return (values - values.mean(axis=0)) / np.where(varies, deviation, np.inf)


def predicted_share(coordinates: NDArray, residual: NDArray) -> float:
    """Part of the sum of squares that a smooth function of coordinates (N, k) predicts of readings left out in turn.

    Kernel regression with Gaussian functions of several lengths; the length and the noise that predict best are taken.
    The errors of readings left out follow from one decomposition: e_i = [K⁻¹ r]_i / [K⁻¹]_ii.
    """
    total = float((residual**2).sum())
    if total == 0.0 or not np.ptp(coordinates, axis=0).any():
        return 0.0
    square = ((coordinates[:, None, :] - coordinates[None, :, :]) ** 2).sum(axis=2)
    least = total
    for length in KERNEL_LENGTHS:
        values, vectors = np.linalg.eigh(np.exp(-0.5 * square / length**2))
        weights = vectors.T @ residual
        for noise in NOISE_PARTS:
            inverse = 1.0 / (np.maximum(values, 0.0) + noise)
            errors = (vectors @ (inverse * weights)) / ((vectors**2) @ inverse)
            least = min(least, float((errors**2).sum()))
    return max(0.0, 1.0 - least / total)
