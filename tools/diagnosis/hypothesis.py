"""What a record says of a formula that a person states: is it this?"""

from collections.abc import Sequence
from typing import Any, Literal

from pydantic import Field

from ...models.effects import EffectPlace
from ...models.effects.formula import OF_TABLE, Formula
from ..bounded.programmes import same_space, spaces_beyond
from ..errors import InputError, one_line
from ..evidence.evidence import Evidence
from ..evidence.fit import Gain
from ..result import Told
from .cause import Finding, NamedEffect, Number, SizedParameter

Answer = Literal["stands", "refuted", "not needed", "cannot be told"]


class Hypothesis(Told):
    """A formula that a person states, and what a record says of it.

    Attributes
    ----------
    formula, where : str
        as it is written in one way; the place of its effect
    answer : str
        "stands": the model is falsified, and with the formula it is not; "refuted": with the formula it is, too; "not
        needed": it is not without it, and the intervals say how large the coefficients may be; "cannot be told": the
        model has the same in it, or the record is too short
    radius_before, radius : float
        least largest error over its bound, without the formula and with it
    parameters : tuple of SizedParameter
        the unknown coefficients, as far as they are possible
    objections : tuple of str
        what was left out says against it
    gain : Gain or None
        of a formula that stands: what it predicts of what was not used
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
    """The effects of formulas, each once; an InputError for what is no formula, or not one of such a record.

    A record is of a table, of gyros, or of both.
    """
    found = []
    for text in formulas:
        where = f"--hypothesis '{one_line(str(text))[:60]}'"
        try:
            formula = Formula.of(str(text))
            place, component = formula.place, formula.target.component
            place.definition  # noqa: B018  (a formula that has no kernel is refused here)
        except ValueError as error:
            raise InputError(f"{where}: {error}") from error
        if component == "GyroBlock" and not with_gyros:
            other = (
                "strapdown record, or of a bench record whose place is given (--latitude-deg, --azimuth-deg); of "
                "positions of a table f1, f2, f3, alpha, beta, kappa and epsilon can err"
            )
            raise InputError(f"{where}: {formula.name} is of a {other}")
        if component == "TurntableMotion" and not at_table:
            other = "record of a table; of a block that is carried w1, w2, w3, f1, f2 and f3 can err"
            raise InputError(f"{where}: {formula.name} is of a {other}")
        if not at_table and (missing := [name for name in formula.quantities if name in OF_TABLE]):
            raise InputError(f"{where}: {missing[0]} is of a record of a table; a block that is carried has n1, n2, n3")
        found.append(place)
    return tuple(dict.fromkeys(found))


def answer_of(place: EffectPlace, before: float, answer: Answer, **more: Any) -> Hypothesis:
    """The hypothesis with an answer, the radius `before` it, and nothing else but `more`."""
    nothing: dict[str, Any] = dict.fromkeys(("parameters", "objections", "equivalents", "as_well"), ())
    told = {"formula": place.law, "where": place.where, "answer": answer, "radius_before": before, "radius": before}
    return Hypothesis.model_validate({**nothing, **told, "gain": None, **more})


def same_in_catalogue(evidence: Evidence, place: EffectPlace) -> tuple[EffectPlace, ...]:
    """Effects of the catalogue that add the same to the model wherever it is measured."""
    try:
        own = evidence.space_of(place)
    except ValueError:
        # Somewhere it is no number.
        return ()
    classes = evidence.classes
    of_classes = zip(classes.places, classes.spaces, strict=True)
    same = next((classes.whole_class(first) for first, space in of_classes if same_space(own, space)), ())
    # Where they are run beside the catalogue, formulas have classes too.
    return tuple(other for other in same if not other.law)


def adds_nothing(evidence: Evidence, place: EffectPlace) -> bool:
    """Whether the model without effects does all that a formula does at the rows of the record."""
    (space,) = spaces_beyond(evidence.nominal, [evidence.columns_of([place])])
    return space.shape[1] == 0


def radius_with(evidence: Evidence, place: EffectPlace) -> float:
    """Radius of the model with a formula."""
    try:
        return evidence.refit([place]).radius
    except ValueError:
        # The exact fit runs away: that of the linear model.
        return evidence.alone(place)


def others_that_stand(findings: Sequence[Finding], same: Sequence[EffectPlace]) -> tuple[tuple[NamedEffect, ...], ...]:
    """The smallest sets that a search found, but for those that are the formula by another name."""
    return tuple(
        tuple(NamedEffect.of(place) for place in finding.places)
        for finding in findings
        if not (len(finding.places) == 1 and finding.places[0] in same)
    )
