"""Test a formula that a person states against a record."""

from collections.abc import Sequence
from typing import Any, Literal

from pydantic import Field

from ...models.effects import EffectPlace
from ...models.effects.formula import OF_TABLE, Formula
from ..bounded.programmes import same_space, spaces_beyond
from ..bounded.work import Work
from ..errors import InputError, one_line
from ..evidence.evidence import Evidence
from ..evidence.fit import Gain
from ..fields import Number
from ..result import Told
from .cause import Finding, NamedEffect, SizedParameter, finding_of
from .witness import judgement_of, objections_of

Answer = Literal["stands", "refuted", "not needed", "cannot be told"]


class Hypothesis(Told):
    """A formula that a person states, and the result of its test on a record.

    Attributes
    ----------
    formula, where : str
        as it is written in one way; the place of its effect
    answer : str
        "stands": the model is falsified, and is not with the formula; "refuted": it is falsified with the formula, too;
        "not needed": it is not falsified without the formula, and the intervals limit the coefficients; "cannot be
        told": the model contains the formula, the record is too short, or the work has reached its limit
    radius_before, radius : float
        least largest error over its bound, without the formula and with it
    parameters : tuple of SizedParameter
        the unknown coefficients, as far as they are possible
    objections : tuple of str
        objections of the left-out readings
    gain : Gain or None
        prediction of unused readings by a formula that fits
    equivalents : tuple of NamedEffect
        effects of the catalogue that are the same by another name
    as_well : tuple of tuple of NamedEffect
        smallest sets of the catalogue that stand, too
    finding : Finding or None
        the model with a formula that stands
    """

    formula: str
    where: str
    answer: Answer
    radius_before: Number
    radius: Number
    parameters: tuple[SizedParameter, ...]
    objections: tuple[str, ...]
    gain: Gain | None
    equivalents: tuple[NamedEffect, ...]
    as_well: tuple[tuple[NamedEffect, ...], ...]
    finding: Any = Field(default=None, exclude=True)


def places_of(formulas: Sequence[str], *, at_table: bool, with_gyros: bool) -> tuple[EffectPlace, ...]:
    """Return the effects of formulas, each once; an InputError for an invalid or inapplicable formula.

    A record is of a table, of gyros, or of both.
    """
    places: dict[EffectPlace, None] = {}
    for text in formulas:
        try:
            formula = Formula.of(str(text))
            place = formula.place
            place.definition  # noqa: B018  (a formula that has no kernel is refused here)
        except ValueError as error:
            raise InputError(f"--hypothesis '{one_line(str(text))[:60]}': {error}") from error
        if why := _foreign(formula, at_table, with_gyros):
            raise InputError(f"--hypothesis '{one_line(str(text))[:60]}': {why}")
        places[place] = None
    return tuple(places)


def _foreign(formula: Formula, at_table: bool, with_gyros: bool) -> str:
    """Return the reason why a formula does not apply to a record of a table, or of gyros; empty if it does."""
    component = formula.target.component
    if component == "GyroBlock" and not with_gyros:
        return (
            f"{formula.name} is of a strapdown record, or of a bench record whose place is given (--latitude-deg, "
            "--azimuth-deg); of positions of a table f1, f2, f3, alpha, beta, kappa and epsilon can err"
        )
    if component == "TurntableMotion" and not at_table:
        return f"{formula.name} is of a record of a table; of a block that is carried w1, w2, w3, f1, f2 and f3 can err"
    for name in formula.quantities:
        if name in OF_TABLE and not at_table:
            return f"{name} is of a record of a table; a block that is carried has n1, n2, n3"
    return ""


def answered(
    evidence: Evidence, place: EffectPlace, findings: Sequence[Finding] = (), *, rerun: bool = True
) -> Hypothesis:
    """Test a formula on a record, next to the smallest sets of the catalogue that fit."""
    keys = _untold(evidence, place)
    if evidence.reader.missing() or _adds_nothing(evidence, place):
        return Hypothesis(answer="cannot be told", **keys)
    same = _same_in_catalogue(evidence, place)
    keys["equivalents"] = tuple(NamedEffect.of(effect) for effect in same)
    fits = evidence.model.mended([place], Work())
    if not fits:
        return Hypothesis(answer="refuted", **{**keys, "radius": _radius_with(evidence, place)})
    finding = finding_of(evidence, fits)
    keys |= {"radius": finding.fit.radius, "parameters": finding.causes[-1].parameters}
    if not evidence.model.falsified:
        return Hypothesis(answer="not needed", **keys)
    objections = [] if finding.acts else ["it may be zero"]
    objections += evidence.reader.objections()
    objections += objections_of(judgement_of(evidence, finding.fit))
    as_well = []
    for finding_beside in findings:
        # The formula by another name is no other set.
        if len(finding_beside.places) != 1 or not set(finding_beside.places) <= set(same):
            as_well.append(tuple(NamedEffect.of(effect) for effect in finding_beside.places))
    keys |= {"objections": tuple(objections), "as_well": tuple(as_well), "finding": finding}
    keys["gain"] = evidence.gain(finding.fit) if rerun else None
    return Hypothesis(answer="stands", **keys)


def not_answered(evidence: Evidence, place: EffectPlace) -> Hypothesis:
    """Return a formula whose test the limit of work ended."""
    return Hypothesis(answer="cannot be told", **_untold(evidence, place))


def _untold(evidence: Evidence, place: EffectPlace) -> dict[str, Any]:
    before = 0.0 if evidence.reader.missing() else evidence.model.refit(()).radius
    keys: dict[str, Any] = {"formula": place.law, "where": place.where, "radius_before": before, "radius": before}
    return keys | dict.fromkeys(("parameters", "objections", "equivalents", "as_well"), ()) | {"gain": None}


def _same_in_catalogue(evidence: Evidence, place: EffectPlace) -> tuple[EffectPlace, ...]:
    """Effects of the catalogue that add the same to the model wherever it is measured."""
    try:
        (space,) = evidence.model.spaces_of([place])
    except ValueError:
        # Somewhere it is not a number.
        return ()
    classes = evidence.model.classes
    for first, own_space in zip(classes.places, classes.spaces, strict=True):
        if same_space(space, own_space):
            # If they run beside the catalogue, formulas have classes, too.
            return tuple(effect for effect in classes.whole_class(first) if not effect.law)
    return ()


def _adds_nothing(evidence: Evidence, place: EffectPlace) -> bool:
    """Return true if the model without effects can do all that a formula does at the rows of the record."""
    (space,) = spaces_beyond(evidence.rows.nominal, [evidence.rows.columns_of([place])])
    return space.shape[1] == 0


def _radius_with(evidence: Evidence, place: EffectPlace) -> float:
    """Radius of the model with a formula."""
    try:
        return evidence.model.refit([place]).radius
    except ValueError:
        # The exact fit runs away: that of the linear model.
        return evidence.model.alone(place)
