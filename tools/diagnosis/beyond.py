"""Beyond the catalogue: the functions and laws that fit a record, and the extension of the model."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Annotated, Any, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import Field
from typing_extensions import TypedDict

from ...models.arrays import Floats
from ...models.effects import EffectPlace
from ...models.effects.definition import GYRO_BLOCK
from ...models.effects.lookup import BASE, TURN, Table
from ...models.effects.mounting import MOUNTING
from ..bounded.programmes import SolverError
from ..bounded.work import Work
from ..evidence.evidence import Evidence
from ..evidence.fit import Fit, Gain
from ..evidence.pairs import GYROS, LEAST_AROUND, PIECES, Form, Pair, in_words
from ..fields import Number, Ordered
from ..rounding import digits
from .band import BandOfFunctions, Possible
from .cause import Cause, SizedParameter
from .dependence import LARGEST_PART, NEAR
from .laws import MOST_WORK, Law, Laws, words_of
from .witness import rms

MOST_LAWS = 8
"""Number of laws that are stated."""
MOST_NAMED = 5
"""Number of laws that a sentence names."""
NARROW = 0.5
"""A band is narrow where it reaches nowhere farther from a law than this part of the law's own size."""
TELLS = 0.05
"""A reading tells of a function that changes it by at least this part (squared) of the most."""
MORE_PIECES, MOST_PART = (32, 40, 48, 64), 0.7
"""Pieces of tables beyond those that are sought for a proof, up to this part of the values of the quantity."""
PREDICTS = 1.0
"""Largest rms error of left-out readings, over their bounds, with which a law counts as predicting them."""
AS_GOOD = 1.1
"""A formula extends the model where its error on left-out data is at most this factor times that of a table."""


class StatedLaw(Cause):
    """A law that makes the model fit, and its errors at readings left out of the fit.

    Attributes
    ----------
    radius : float
        the largest error over its bound
    left_out_rms, left_out_max : float or None
        errors of positions that were left out, over their bounds; None where that is not possible
    shape : (float, float) or None
        of a law with a number that gives its shape, the ends of all its values that stand
    beside : tuple of Cause or None
        other effects of the same extension: of three gyros with a function each, those of the others
    """

    radius: Number
    left_out_rms: Number | None
    left_out_max: Number | None
    shape: tuple[Number, Number] | None = None
    beside: tuple[Cause, ...] | None = None

    @property
    def causes(self) -> tuple[Cause, ...]:
        """Return all effects of the extension."""
        return (self, *(self.beside or ()))

    @property
    def words(self) -> str:
        """Return the name of an effect of the catalogue, or the term that formulas add."""
        return " with ".join(words_of(cause.place) for cause in self.causes)


class FoundKnot(TypedDict):
    """A knot of a table, with the estimate and the interval of the function there; None: unbounded."""

    at: Number
    estimate: Number
    low: Number | None
    high: Number | None


class BeyondCatalogue(StatedLaw):
    """An effect outside the catalogue that extends the model.

    Errors may reach their bounds while the function bends between the knots. A table then does not fit, or needs a set
    of knots so fine that left-out readings cannot judge it. The extension is then a table that needs a slightly larger
    noise bound; its intervals hold all tables that fit with one `NEAR` times as large.

    Attributes
    ----------
    kind : str
        "formula" or "lookup", a table of knots
    quantity, factor : str
        quantity of the function, and its factor
    knots : tuple of FoundKnot or None
        knots of a table; of several, those of the first
    noise_bound_needed : float or None
        the noise bound with which it would fit, where it does not
    gain : Gain or None
        gain on positions that were not used, simulated by the extended components
    """

    kind: Literal["formula", "lookup"]
    quantity: str
    factor: str | None = None
    knots: tuple[Annotated[FoundKnot, Ordered], ...] | None = None
    noise_bound_needed: Number | None = None
    gain: Gain | None = None
    fit: Any = Field(default=None, exclude=True)


@dataclass(frozen=True, eq=False)
class Beyond:
    """Result for the functions of one quantity at one place.

    `form`: the simplest functions that suffice; `listed`: fits of sets of effects of the catalogue that stand.
    """

    evidence: Evidence
    pair: Pair
    form: Form
    listed: Sequence[Fit] = ()

    @cached_property
    def each(self) -> tuple[Possible, ...]:
        """Return the possible functions of each place of the pair, next to those of the others."""
        return Possible.each(self.evidence, self.pair, self.form.kind in ("jump", "sawtooth"))

    @property
    def possible(self) -> Possible:
        """Return the possible functions of the first place."""
        return self.each[0]

    @cached_property
    def laws(self) -> list[Law]:
        """Return the laws that fit, those of the catalogue first."""
        return Laws(self.evidence, self.pair, self.each, self._work).standing(self.listed)[:MOST_LAWS]

    @cached_property
    def _work(self) -> Work:
        """Return the budget of work for the laws."""
        return Work(MOST_WORK, "formulas of the function")

    @cached_property
    def bands(self) -> tuple[BandOfFunctions, ...]:
        """The band of each place; none where the programmes have no solution."""
        try:
            return tuple(BandOfFunctions.of(possible) for possible in self.each)
        except SolverError:
            return ()

    # Tables

    @cached_property
    def table(self) -> Fit | None:
        """The model with a table of few knots that does; None where the place knows no table, or none does."""
        for places in self._tables():
            try:
                fits = self.evidence.including(places).model.mended(places, Work())
            except ValueError:
                return None
            if fits:
                return fits[0]
        return None

    def _tables(self) -> Iterator[tuple[EffectPlace, ...]]:
        """Yield a table that suffices, or tables with more and more knots until one suffices.

        For several places, one table of each.
        """
        pair, form = self.pair, self.form
        if form.kind == "jump":
            law = Table(pair.quantity.replace(" ", "*"), "jumps at", (form.at,), pair.factor).law
            yield tuple(member.table(law) for member in pair.members or (pair,))
            return
        around = form.kind == "around" or pair.circle
        counts = [form.count] if form.kind in ("pieces", "around") else []
        most = MOST_PART * len(np.unique(pair.values))
        for count in (*PIECES, *MORE_PIECES):
            if LEAST_AROUND <= count <= most and count not in counts:
                counts.append(count)
        kind: Literal["around", "pieces"] = "around" if around else "pieces"
        for count in counts:
            pieces = form if form.kind in ("pieces", "around") and count == form.count else Form(kind, count)
            knots = [np.sort(pieces.knots(possible.pair.values)) for possible in self.each]
            if places := self._places_of(knots, around=around):
                yield places

    @property
    def near_tables(self) -> list[Fit]:
        """The model with tables with which a slightly larger noise bound would do, the nearest first.

        About the same number of values of the quantity lies between neighbouring knots, so that some remain when others
        are left out.
        """
        circle, fits = self.pair.circle, []
        values = [np.unique(_on_circle(possible.pair)) for possible in self.each]
        for count in PIECES:
            if not LEAST_AROUND <= count <= LARGEST_PART * len(values[0]):
                continue
            parts = np.arange(count) / count if circle else np.linspace(0.0, 1.0, count + 1)
            places = self._places_of([np.unique(np.quantile(at_place, parts)) for at_place in values], around=circle)
            fit = self._refitted(places)
            if fit is not None and fit.radius < NEAR:
                fits.append(fit)
        return sorted(fits, key=lambda fit: fit.radius)

    def _refitted(self, places: Sequence[EffectPlace]) -> Fit | None:
        """The model with tables; None where there are none, a place knows no table, or the fit runs away."""
        if not places:
            return None
        try:
            return self.evidence.including(places).model.refit(places)
        except ValueError:
            return None

    def _places_of(self, every: Sequence[NDArray], *, around: bool) -> tuple[EffectPlace, ...]:
        """The table at each place with these knots (K,); none where it would be nothing."""
        places, kind = [], "around" if around else "at"
        for possible, knots in zip(self.each, every, strict=True):
            zero, pair = replace(possible, others=()).functions(knots).zero, possible.pair
            if len(zero) == len(knots):
                return ()
            law = Table(pair.quantity.replace(" ", "*"), kind, tuple(knots.tolist()), pair.factor, zero).law
            places.append(pair.table(law))
        return tuple(places)

    # Sentences

    @property
    def caution(self) -> tuple[str, ...]:
        """Return the other laws at the same place and of the same quantity that fit as well; empty if none does."""
        return () if self.is_one_law else (f"{self.in_words}: {self._laws_in_words}",)

    @property
    def is_one_law(self) -> bool:
        """Return true if one law alone fits, and no other smooth function of its size does."""
        # Laws of several places whose shape a number gives are not tried.
        if len(self.laws) != 1 or not self.bands or self._work.is_done or self.pair.members:
            return False
        band, function = self.possible.band, self.possible.drawn(self.laws[0].fit)
        at_knots = function[np.searchsorted(self.possible.knots, band.knots)]
        apart = np.maximum(band.high - at_knots, at_knots - band.low).max()
        return bool(apart <= NARROW * np.ptp(function))

    @cached_property
    def readings(self) -> tuple[Floats, Floats]:
        """Return values (n,) of the quantity, and the readings of the function there (n,).

        Each value is the first function drawn, plus the reading's miss divided by the reading's derivative by the
        function. Readings with a small derivative are left out. Empty for a carried block: its errors are integrals.
        """
        if self.pair.anything:
            return np.zeros(0), np.zeros(0)
        pair, evidence, drawn = self.pair, self.evidence, self.lines_of(self.possible)[0][1]
        spread = self.possible.sign * pair.spread(np.eye(len(pair.values)))
        errors = evidence.rows.residual - self.possible.every.unknown.columns @ drawn
        errors = errors - evidence.rows.nominal @ np.linalg.lstsq(evidence.rows.nominal, errors, rcond=None)[0]
        weight = (spread**2).sum(axis=0)
        tells = weight >= TELLS * weight.max()
        says = self.possible.hats(self.possible.knots) @ drawn + spread.T @ errors / np.where(tells, weight, 1.0)
        return _on_circle(pair)[tells], says[tells]

    def lines_of(self, possible: Possible) -> list[tuple[str, Floats]]:
        """Return functions (K,) of a place to draw, by name: laws; if none fits, a table or the smoothest function."""
        if self.laws:
            return [(law.words, possible.drawn(law.fit)) for law in self.laws]
        if self.table is not None:
            return [("table of knots", possible.drawn(self.table))]
        return [("bends least", possible.least)]

    def whole_lines_of(self, possible: Possible) -> list[tuple[str, Floats]]:
        """Return the laws (K,) of a place with the bias and scale that the model imitates, by name.

        There are none for a carried block: its errors are integrals.
        """
        return [] if self.pair.anything else [(law.words, possible.whole(law.fit)) for law in self.laws]

    @property
    def in_words(self) -> str:
        """Place, quantity, and the size of the function that bends least."""
        pair, in_all = self.pair, max(float(np.ptp(possible.least)) for possible in self.each)
        times = in_words(pair.factor)
        of = f"{times} times a function" if times else "a function"
        unit = "g"
        if pair.where in (*GYROS, GYRO_BLOCK):
            unit = "rad/s"
        elif pair.where.endswith("axis") or pair.where in (BASE, MOUNTING):
            unit = "rad"
        most = " at most" if pair.members else ""
        return (
            f"{pair.where.replace('-', ' ')}: {of} of {in_words(pair.quantity)}, {digits(in_all)} {unit} in all{most}"
        )

    @property
    def _laws_in_words(self) -> str:
        words = list(dict.fromkeys(law.words for law in self.laws))
        names, further = words[:MOST_NAMED], len(words) - MOST_NAMED
        if further > 0:
            names.append(f"{further} more")
        if not names:
            return "no effect of the catalogue and no short formula fits"
        if len(names) == 1:
            return f"{names[0]} fits, as does any other function within the band"
        return f"{', '.join(names[:-1])} and {names[-1]} fit"

    # Estimates

    def stated(self, law: Law) -> StatedLaw:
        """Return a law with its intervals and its errors at the readings left out."""
        first, *further = self._causes(self._centred(law.fit))
        return StatedLaw(**_keys_of(first, further), **self._left_out(law.fit), shape=law.shape)

    def _centred(self, fit: Fit) -> Fit:
        return fit.centred(self.evidence.model.room, self.evidence.model.effort.most_rows)

    def _causes(self, fit: Fit) -> list[Cause]:
        """The effects of a centred fit, with intervals."""
        widening = 0.0 if fit.radius <= self.evidence.model.limit else (NEAR - 1.0) * float(fit.bound.min())
        intervals = fit.intervals(self.evidence.model.room + widening, self.evidence.model.effort.most_rows)
        causes = []
        for place, values, possible in zip(fit.places, fit.values(), intervals, strict=True):
            ends = self.evidence.reader.told(place, possible)
            inside = [min(max(value, low), high) for value, (low, high) in zip(values, ends, strict=True)]
            causes.append(Cause.found(place, (), inside, ends))
        return causes

    def _folds(self, fit: Fit) -> dict[int, float]:
        """Errors of readings that were left out, over their bounds, by their numbers; of those that are predicted."""
        trial = next(iter(self.evidence.including(fit.places).reader.trials(fit)), None)
        if trial is None or trial.folds is None or trial.rows is None:
            return {}
        errors = np.abs(trial.folds[1]) / float(np.median(fit.bound))
        return dict(zip(trial.rows.tolist(), errors, strict=True))

    def _left_out(self, fit: Fit) -> dict[str, Any]:
        """Radius, and errors of positions that were left out, over their bounds."""
        errors = np.array(list(self._folds(fit).values()))
        if not len(errors):
            return {"radius": fit.radius, "left_out_rms": None, "left_out_max": None}
        return {"radius": fit.radius, "left_out_rms": rms(errors), "left_out_max": float(errors.max())}

    def _errors_alike(self, fits: Sequence[Fit]) -> list[float]:
        """Return rms errors, over their bounds, of the left-out readings that all the fits predict."""
        folds = [self._folds(fit) for fit in fits]
        rows: set[int] | None = None
        for errors in folds:
            if errors:
                rows = set(errors) if rows is None else rows & set(errors)
        in_order, alike = sorted(rows or ()), []
        for errors in folds:
            if errors and in_order:
                alike.append(rms(np.array([errors[row] for row in in_order])))
            else:
                alike.append(np.inf)
        return alike

    def extension(self, rerun: bool) -> BeyondCatalogue | None:
        """Return the extension of the model: the formula or table that predicts the left-out readings best.

        `rerun`: simulate the held-out readings again. If no fitting law predicts any of them, return a table that does,
        with a slightly larger noise bound. None if there is none.
        """
        fits = [law.fit for law in self.laws if not law.is_listed]
        if self.table is not None:
            fits.append(self.table)
        errors = self._errors_alike(fits)
        if min(errors, default=np.inf) > PREDICTS:
            # Knots that few readings determine fail where these are left out: other knots may do better.
            near = [fit for fit in self.near_tables if self._folds(fit)]
            fits += [fit for fit in near if fit.radius <= self.evidence.model.limit]
            errors = self._errors_alike(fits)
            if near and not np.isfinite(errors).any():
                fits, errors = near, self._errors_alike(near)
        if not fits:
            return None
        # Formulas come before the table: among those that predict about equally well, the first is the simplest.
        as_good = [fit for fit, error in zip(fits, errors, strict=True) if error <= AS_GOOD * min(errors)]
        chosen, gain = self._with_gain(as_good, rerun)
        fit = self._centred(chosen)
        first, *further = self._causes(fit)
        keys: dict[str, Any] = {"kind": first.effect, "quantity": self.pair.quantity}
        if self.pair.factor:
            keys["factor"] = self.pair.factor
        bound = self.evidence.reader.stated_bound
        if fit.radius > self.evidence.model.limit and bound is not None:
            keys["noise_bound_needed"] = fit.radius * bound
        if first.effect == "lookup" and (knots := _knots_of(first.law or "", first.parameters)):
            keys["knots"] = knots
        return BeyondCatalogue(**_keys_of(first, further), **self._left_out(chosen), **keys, gain=gain, fit=fit)

    def _with_gain(self, fits: Sequence[Fit], rerun: bool) -> tuple[Fit, Gain | None]:
        """Return the first fit whose held-out readings can be simulated again, with its gain; else the first fit."""
        for fit in fits:
            if not rerun:
                break
            gain = self.evidence.including(fit.places).gain(self._centred(fit))
            if gain is not None:
                return fit, gain
        return fits[0], None


def _on_circle(pair: Pair) -> Floats:
    """The values (n,) of a quantity, angles within one turn."""
    return pair.values % TURN if pair.circle else pair.values


def _keys_of(first: Cause, further: Sequence[Cause]) -> dict[str, Any]:
    """Keys of a law that is made of these effects."""
    keys: dict[str, Any] = {name: getattr(first, name) for name in first.model_fields_set}
    if further:
        keys["beside"] = tuple(further)
    return keys


def _knots_of(law: str, parameters: Sequence[SizedParameter]) -> tuple[FoundKnot, ...]:
    """Return the knots of a table with their estimates; empty for a table that jumps."""
    table = Table.of(law)
    if table.kind == "jumps at":
        return ()
    stated = dict(zip(table.entries, parameters, strict=True))
    knots = []
    for number, at in enumerate(table.knots):
        if (sized := stated.get(number)) is None:
            knots.append(FoundKnot(at=at, estimate=0.0, low=0.0, high=0.0))
        else:
            knots.append(FoundKnot(at=at, estimate=sized.estimate, low=sized.low, high=sized.high))
    return tuple(knots)


def keys_of(beyond: Beyond, *, extend: bool, rerun: bool) -> Mapping[str, Any]:
    """Return the keys of the result for a proven place and quantity, for any law.

    `extend`: whether the model is to be extended by effects outside the catalogue; `rerun` is as for
    `Beyond.extension`.
    """
    if not beyond.bands:
        return {}
    keys: dict[str, Any] = {"beyond": beyond}
    if beyond.pair.members:
        keys["bands"] = beyond.bands
    else:
        keys["band"] = beyond.bands[0]
    if beyond.caution:
        keys["caution"] = beyond.caution
    # Several effects of one place that add up to a law are reported as causes.
    laws = [beyond.stated(law) for law in beyond.laws if len(law.fit.places) in (1, len(beyond.each))]
    if laws:
        keys["laws"] = tuple(laws)
    extension = beyond.extension(rerun) if extend else None
    if extension is not None:
        keys["extension"] = extension
    return keys
