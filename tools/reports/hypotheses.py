"""What is said of formulas that a person states: lines for a terminal, sentences and a table for the page."""

from ..diagnosis.hypothesis import Hypothesis
from ..diagnosis.result import Diagnosis
from ..document.blocks import Section, Table
from ..document.notation import Cell, sentence, unit_of, unit_text
from ..rounding import digits, interval, residual
from .bench import cause_lines

ANSWERS = {
    "stands": "stands: it brings every error within its bound",
    "refuted": "refuted: no coefficients bring every error within its bound",
    "not needed": "not needed: the model stands without it",
    "cannot be told": "cannot be told: the model has the same in it, or the record is too short",
}


def hypothesis_lines(result: Diagnosis) -> list[str]:
    """Each formula with its answer, its coefficients and what speaks for others."""
    said = []
    for one in result.hypotheses or ():
        radius = f"radius {residual(one.radius_before)} -> {residual(one.radius)}"
        said.append(f"hypothesis {one.formula}: {ANSWERS[one.answer]}; {radius}")
        for p in one.parameters:
            shown, *ends = interval(p.estimate, *_ends(p.low, p.high))
            said.append(f"  {p.name} {shown}, within [{', '.join(ends)}] {unit_of(p.unit)}".rstrip())
        said += [f"  {text}" for text in _besides(one, result.unit or "g")]
    return said


def _ends(low: float | None, high: float | None) -> tuple[float, float]:
    return (-float("inf") if low is None else low, float("inf") if high is None else high)


def _besides(one: Hypothesis, unit: str) -> list[str]:
    """What was left out says of a formula, what it is by another name, and what would do as well."""
    said = [f"against it: {text}" for text in one.objections]
    if one.gain is not None:
        said.append(
            f"not used, simulated again: rms {digits(one.gain.held_out_rms_before)} -> "
            f"{digits(one.gain.held_out_rms_after)} {unit}"
        )
    if one.equivalents:
        said.append(f"by another name: {', '.join(other.place.title for other in one.equivalents)}")
    if one.as_well:
        sets = [" and ".join(named.place.title for named in places) for places in one.as_well]
        more = f"; {len(sets) - 3} sets more" if len(sets) > 3 else ""
        said.append(f"would do as well: {'; '.join(sets[:3])}{more}")
    elif one.answer == "stands":
        said.append("nothing in the catalogue that was tried, of this size or smaller, would do as well")
    return said


def hypothesis_section(result: Diagnosis) -> Section | None:
    """The formulas that were asked about, with their answers."""
    if not result.hypotheses:
        return None
    rows: list[list[Cell]] = []
    said: list[str] = []
    equations: list[str] = []
    for one in result.hypotheses:
        text = "; ".join([ANSWERS[one.answer], *_besides(one, result.unit or "g")])
        said.append(sentence(f"{one.formula}: {text}"))
        radii = [residual(one.radius_before), residual(one.radius)]
        for p in one.parameters:
            ends = interval(p.estimate, *_ends(p.low, p.high))
            rows.append([one.formula, one.answer, *radii, p.name, *ends, unit_text(p.unit)])
        if not one.parameters:
            rows.append([one.formula, one.answer, *radii, None, None, None, None, None])
        if one.finding is not None:
            equations += cause_lines([one.finding.causes[-1]])
    header = ["formula", "answer", "radius without", "with", "coefficient", "estimate", "low", "high", "unit"]
    return Section("Hypotheses", said, table=Table(header, rows), equations=tuple(equations))
