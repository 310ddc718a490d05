"""How far a record carries a verdict: lines for a terminal, sentences and a table for the page."""

from ..diagnosis.result import Diagnosis
from ..document.blocks import Section, Table
from ..document.notation import Cell, sentence
from ..rounding import residual, upwards
from .bench import of_bench


def level_lines(result: Diagnosis) -> list[str]:
    """What is proven of place and quantity, and the noise bound that would do without."""
    return [text for text in (proven_text(result), bound_text(result)) if text]


def proven_text(result: Diagnosis) -> str:
    """What is proven, whatever the law; empty where nothing is."""
    proven = result.proven
    if proven is None:
        return ""
    if proven.quantity and result.suffices:
        least = result.suffices[0]
        names = f"; this record does not tell it from {' and '.join(proven.same)}" if proven.same else ""
        return (
            f"proven, whatever the law: {least.in_words} suffices, radius {residual(least.radius)}, and nothing else "
            f"that is as simple{names}"
        )
    place = proven.place.replace("-", " ")
    if not proven.not_excluded:
        return f"proven, whatever the law: the {place} alone suffices, and no other place does"
    return f"proven, whatever the law: the {place}, by a function of one of {', '.join(proven.not_excluded)}"


def bound_text(result: Diagnosis) -> str:
    """With which noise bound the model without effects would stand; empty where it stands or no single bound is."""
    if result.noise_bound_needed is None:
        return ""
    return f"without any effect the model would stand with a noise bound of {upwards(result.noise_bound_needed, 3)} g"


def level_section(result: Diagnosis) -> Section | None:
    """What suffices whatever the law; None where the model stands."""
    if not result.suffices and not proven_text(result):
        return None
    rows: list[list[Cell]] = [
        [one.where, one.on, one.form, str(one.complexity), residual(one.radius)] for one in result.suffices or ()
    ]
    header = ["place", "quantity", "form", "complexity", "radius"]
    # The band, where there is one, has the cautions.
    caution = () if result.band else result.caution
    paragraphs = [sentence(text) for text in (proven_text(result), *caution, bound_text(result)) if text]
    return Section("Place and quantity", paragraphs, table=Table(header, rows) if rows else None)


def only_unlisted(result: Diagnosis) -> bool:
    """Whether a record is ambiguous only by what is in no catalogue."""
    return (
        of_bench(result) and result.verdict == "ambiguous" and not result.alternatives and result.complete is not False
    )
