"""Compare explanations inside and outside the catalogue: by complexity, and by whether they are the same."""

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from ...models.arrays import Floats
from ...models.effects import EffectPlace
from ...models.effects.definition import GYRO_BLOCK
from ...models.effects.lookup import Table
from ...models.effects.mounting import MOUNTING
from ..bounded.programmes import column_space
from ..bounded.work import Work
from ..evidence.evidence import Evidence
from ..evidence.fit import Fit, estimated, least_radius
from ..evidence.pairs import GYROS, LEAST_AROUND, PIECES, Form, Pair
from ..rounding import digits
from .dependence import LARGEST_PART, Dependence, Standing, most_of_rivals

LIKE = 0.05
"""An effect is a function of a quantity where at most this part of it is none."""
SURE_SECOND_ORDER = 0.3
"""Largest error of the linear model with which a set that fits is a rival [bounds]."""
NOT_COMPARED = "functions outside the catalogue were not compared: the misfit is too large for the linear model"
ROUGHLY = (
    "the misfit is so large that the linear model, by which functions are compared, may be wrong: other laws may fit"
)
CHOSEN = re.compile(r"\*\* \d|(?:sin|cos)\(\d+ \*")
"""The power or the order of a formula, which was searched for."""
OUTLIER = "outlier"
"""A single reading: no quantity is its cause, though a function with a spike where it was read would do as much."""
TABLES = ("lookup", "bias-wander")
"""Effects whose law gives the knots."""
MOST_RIVALS = 3
"""Number of rivals that further positions are to tell apart."""
FURTHER = 2
"""Place and quantity of each further effect of a set are searched for, too."""


def complexity_of(places: Sequence[EffectPlace]) -> int:
    """Parameters of effects, and one more for each number that is searched for.

    Searched numbers are an order, the reading of an outlier, the power or order of a formula, and place and quantity of
    each effect after the first.
    """
    complexity = FURTHER * (len(places) - 1)
    for place in places:
        complexity += len(place.definition.parameters)
        complexity += place.order is not None or place.effect == OUTLIER or bool(CHOSEN.search(place.law))
    return complexity


def least_complexity(size: int) -> int:
    """Return the least complexity of a set of `size` effects."""
    return size + FURTHER * (size - 1)


def _instrument(place: EffectPlace) -> str:
    """Return the place of an effect; for a single reading, the accelerometer."""
    return f"accelerometer-{place.axes[0]}" if place.effect == OUTLIER else place.where


def _is_table_of(place: EffectPlace, pair: Pair) -> bool:
    """Return true if the law of an effect is a table of the quantity of a pair."""
    if place.effect not in TABLES or place != replace(pair.table(place.law), effect=place.effect):
        return False
    table = Table.of(place.law)
    return (table.quantity.replace("*", " "), table.factor) == (pair.quantity, pair.factor)


@dataclass(frozen=True, eq=False)
class Listed:
    """Compare effects of the catalogue with functions of pairs: which are equivalent."""

    evidence: Evidence
    _spaces: dict[int, tuple[Pair, list[Floats]]] = field(default_factory=dict)

    def is_of(self, fit: Fit, pair: Pair) -> bool:
        """Return true if the effects of a fit, or the part of them that is needed, are functions of a pair."""
        return self.is_wholly_of(fit, pair) or self.is_partly_of(fit, pair)

    def is_partly_of(self, fit: Fit, pair: Pair) -> bool:
        """Return true if only the part that is a function of a pair is needed: one gyro, or one turn of the block."""
        home = GYRO_BLOCK if pair.where in GYROS else MOUNTING
        if pair.where not in (*GYROS, MOUNTING) or any(place.where != home for place in fit.places):
            return False
        columns = fit.jacobian[:, len(fit.point) :]
        within = np.zeros(columns.shape[1], dtype=bool)
        for k in range(columns.shape[1]):
            within[k] = self._are_within(columns[:, [k]], pair)
        matrix = np.hstack((self.evidence.rows.nominal, columns[:, within]))
        free = np.full(matrix.shape[1], np.inf)
        squares = estimated(matrix, self.evidence.rows.residual)
        return least_radius(matrix, self.evidence.rows.residual, (-free, free), squares)[0] <= self.evidence.model.limit

    def is_wholly_of(self, fit: Fit, pair: Pair) -> bool:
        """Return true if all effects of a fit are functions of a pair."""
        columns = fit.jacobian[:, len(fit.point) :]
        for place, block, _ in fit.ways:
            if place.definition.variants is not None:
                # An effect that does more than add its columns depends on its accelerometer's own input.
                is_function = place.where == pair.where and f"n{place.where[-1]}" in pair.depends_on
            else:
                is_function = _is_table_of(place, pair) or self._are_within(columns[:, block], pair)
            if not is_function:
                return False
        return True

    def beside(self, dependence: Dependence, fits: Sequence[Fit]) -> Dependence:
        """Return the dependence, marked where a set of the catalogue explains the misfit as simply.

        Among the many sets of several effects some fit by chance when one function suffices. Such a set must be no more
        complex than the function; single effects and readings no more complex than rivals may be.
        """
        least = np.inf if dependence.least is None else dependence.least
        for fit in fits:
            of_readings = all(place.effect == OUTLIER for place in fit.places)
            most = most_of_rivals(least) if len(fit.places) == 1 or of_readings else least
            if dependence.listed_elsewhere or complexity_of(fit.places) > most:
                continue
            if of_readings or not any(self.is_of(fit, standing.pair) for standing in dependence.standing):
                elsewhere = {_instrument(place) for place in fit.places} != {dependence.place}
                dependence = replace(dependence, listed_elsewhere=elsewhere, listed_otherwise=True)
        return dependence

    @cached_property
    def base(self) -> Floats:
        """The space (M, P) of the model."""
        return column_space(self.evidence.rows.nominal / self.evidence.rows.bound[:, None])

    def _beyond_model(self, columns: NDArray) -> Floats:
        """Return the part of columns (M, K) that lies outside the model."""
        columns = columns / self.evidence.rows.bound[:, None]
        return columns - self.base @ (self.base.T @ columns)

    def _are_within(self, columns: NDArray, pair: Pair) -> bool:
        """Return true if functions of a pair, together with the model, contain columns (M, K)."""
        added = self._beyond_model(columns)
        size = np.linalg.norm(added)
        beyond = [np.linalg.norm(added - space @ (space.T @ added)) for space in self._spaces_of(pair)]
        return bool(min(beyond, default=np.inf) <= LIKE * size)

    def _spaces_of(self, pair: Pair) -> list[Floats]:
        """Return the spaces that functions of a pair add to the model: the freest of each form, and each jump."""
        if id(pair) not in self._spaces:
            forms = []
            for ladder in pair.ladders():
                fine = [form for form in ladder if form.count <= LARGEST_PART * len(pair.values)]
                forms.append((fine or ladder[:1])[-1])
            spaces = []
            for form in (*forms, *pair.single()):
                spaces.append(column_space(self._beyond_model(pair.columns(form))))
            self._spaces[id(pair)] = pair, spaces
        return self._spaces[id(pair)][1]


@dataclass(frozen=True, eq=False)
class Unlisted:
    """Fitting functions outside the catalogue, next to the first set of the catalogue that fits.

    Attributes
    ----------
    rivals : tuple of Standing
        functions of another place or quantity, as simple as the set
    same : Standing or None
        a function of one quantity that does what several effects of the set do together
    percent : float or None
        by so much a larger noise bound would do without them, where that is little
    alike : tuple of Pair
        pairs that hold the set, as far as these rows tell, where none has all quantities of another
    compared, roughly : bool
        whether functions that are in no catalogue could be compared; whether by a linear model that may be wrong
    held : Standing or None
        the simplest function that holds the set
    proven : bool
        true if the one rival is the proven place and quantity
    """

    rivals: tuple[Standing, ...]
    same: Standing | None
    percent: float | None
    alike: tuple[Pair, ...] = ()
    compared: bool = True
    roughly: bool = False
    held: Standing | None = None
    proven: bool = False

    @staticmethod
    def of(dependence: Dependence | None, listed: Listed, fit: Fit) -> "Unlisted":
        """Return the functions outside the catalogue next to the fit of a set."""
        if dependence is None:
            # A record without pairs is not compared by its kind, which is not a caution of its own.
            return Unlisted((), None, None, compared=not listed.evidence.reader.pairs)
        # A fit within the error of the linear model only is not a rival, and no proof that there is none.
        compared = listed.evidence.model.second_order <= SURE_SECOND_ORDER
        holding = [standing for standing in dependence.standing if listed.is_of(fit, standing.pair)]
        # If only a part of a set is needed, that part counts.
        most = complexity_of(fit.places)
        for standing in holding:
            if not listed.is_wholly_of(fit, standing.pair):
                most = min(most, standing.complexity)
        rivals = []
        for standing in dependence.standing:
            if compared and standing not in holding and standing.complexity <= most:
                rivals.append(standing)
        # If not all sets are tried, some that fit are more complex than the proven function, and elsewhere.
        proven = dependence.proven is not None and len(fit.places) > listed.evidence.model.effort.most_known_alone
        if proven:
            # All fitting functions share one quantity, for this record: no rival of itself, but of a set elsewhere.
            rivals = [] if holding else rivals[:1]
        alike = _of_other_quantities([standing.pair for standing in holding])
        held = holding[0] if holding else None
        return Unlisted(
            rivals=tuple(rivals),
            same=held if len(fit.places) > 1 else None,
            percent=100.0 * (dependence.radius - 1.0) if dependence.is_near else None,
            alike=alike if len(alike) > 1 else (),
            compared=compared,
            roughly=not compared,
            held=held,
            proven=proven,
        )

    @property
    def caution(self) -> tuple[str, ...]:
        """Return sentences on the explanations that are not excluded."""
        sentences = []
        for rival in self.rivals:
            text = f"equally simple, outside the catalogue: {rival.pair.in_words}"
            if self.proven:
                text = f"the proven function is no more complex than these effects: {rival.pair.in_words}"
            sentences.append(text)
        if self.same is not None:
            sentences.append(
                f"{self.same.pair.in_words} equals these effects together: which laws make it up is not proven"
            )
        if self.alike:
            sentences.append(f"this record does not tell {' from '.join(pair.in_words for pair in self.alike)}")
        if self.percent is not None:
            sentences.append(f"a noise bound that is {digits(self.percent)} % larger would do without any cause")
        if not self.compared:
            sentences.append(ROUGHLY if self.roughly else NOT_COMPARED)
        return tuple(sentences)

    def fits(self, evidence: Evidence) -> list[Fit]:
        """Return the rivals as fitted tables: of each, the one with fewest knots that fits."""
        fits = []
        for rival in self.rivals[:MOST_RIVALS]:
            fit = _table_fit(evidence, rival)
            if fit is not None:
                fits.append(fit)
        return fits


def _of_other_quantities(pairs: Sequence[Pair]) -> tuple[Pair, ...]:
    """Return one pair for each choice of quantities; none with all quantities of another, whose functions it holds."""
    first: dict[frozenset[str], Pair] = {}
    for pair in pairs:
        first.setdefault(pair.depends_on, pair)
    return tuple(pair for quantities, pair in first.items() if not any(other < quantities for other in first))


def _table_fit(evidence: Evidence, rival: Standing) -> Fit | None:
    """Return the fit of the table with fewest knots that fits; None if none fits or no component has such a table."""
    for law in _tables(rival):
        try:
            place = rival.pair.table(law)
            fits = evidence.including([place]).model.mended([place], Work())
        except ValueError:
            return None
        if fits:
            return fits[0]
    return None


def _tables(rival: Standing) -> Iterator[str]:
    """Yield laws of tables that might replace a form, with more and more knots."""
    pair, form = rival.pair, rival.form
    quantity = pair.quantity.replace(" ", "*")
    if form.kind == "jump":
        yield Table(quantity, "jumps at", (form.at,), pair.factor).law
        return
    kind, pieces, least = ("around", "around", LEAST_AROUND) if pair.circle else ("at", "pieces", 1)
    for count in PIECES:
        if least <= count <= LARGEST_PART * len(pair.values):
            knots = np.sort(Form(pieces, count).knots(pair.values))
            yield Table(quantity, kind, tuple(knots.tolist()), pair.factor).law
