"""What a diagnosis says, whatever the record: lines for a terminal, and the page."""

from pathlib import Path

from ..diagnosis.hypothesis import Hypothesis
from ..diagnosis.result import Diagnosis
from ..document.blocks import Page, Section, Table, Tone
from ..document.notation import Cell, sentence, unit_of, unit_text
from ..records import PositionRecord
from ..rounding import digits, interval, residual, upwards
from . import bench, beyond, evidence, witnesses
from .bench import cause_lines
from .kinds import kind_of
from .makers import cited
from .pictures.residuals import gain_picture, held_out
from .verdict import MOST_SETS, cut_off, sentences_of, sets_of, verdict_line, verdict_sentence

ANSWERS = {
    "stands": "stands: it brings every error within its bound",
    "refuted": "refuted: no coefficients bring every error within its bound",
    "not needed": "not needed: the model stands without it",
    "cannot be told": "cannot be told: the model has the same in it, or the record is too short",
}
TONES: dict[str, Tone] = {"consistent": "good", "explained": "good"}


def containing_titles(result: Diagnosis) -> list[str]:
    """Titles of the sets that would do as well, as they contain the one that is named."""
    return [" and ".join(place.title for place in places) for places in result.containing_sets]


# Lines for a terminal


def lines(result: Diagnosis) -> list[str]:
    """Verdict, evidence, causes and gain."""
    said = [verdict_line(result)]
    why = result.not_named or ()
    said += [f"not named: {text}" for text in why[:MOST_SETS]]
    said += [f"not named: {len(why) - MOST_SETS} sets more"] if len(why) > MOST_SETS else []
    said += [f"against the first set: {text}" for text in result.objections or ()]
    said += hypothesis_lines(result)
    said += beyond.level_lines(result)
    said += [f"not excluded: {title}, which contains it" for title in containing_titles(result)]
    said += [f"caution: {text}" for text in result.caution or ()]
    said += kind_of(result).lines(result)
    said += evidence.power_lines(result)
    said += beyond.lines(result)
    bound = float(result.evidence.calibration.linearised.bound.min()) if result.next_positions else None
    for position in result.next_positions or ():
        said.append(f"measure next: {bench.position_text(position, bound)}")
    said += [f"measure next: {text}" for text in result.next or ()]
    warnings = (*result.warnings, *([] if result.cut_off_at is None else [cut_off(result.cut_off_at)]))
    return said + [f"warning: {text}" for text in warnings]


# The page


def page(result: Diagnosis, record: PositionRecord | None = None) -> Page:
    """Verdict, cause, gain and residuals; record (given where it is one of positions), model, evidence, what next."""
    name, first, key, rests_on = kind_of(result).record(result, record)
    answer = [*beyond.sections(result), *answer_of(result)]
    return Page(
        f"Diagnosis of {name}",
        verdict_sentence(result),
        [*answer, *first, *sections_of(result)],
        answer=len(answer),
        tone=TONES.get(result.verdict, "attention"),
        key=key,
        provenance=rests_on,
        sources=sources(result),
    )


def answer_of(result: Diagnosis, files: list[Path] | None = None) -> list[Section]:
    """The cause with its size, what it gains, and the residuals; `files` belong to the cause."""
    told = [cause_section(result, files or []), gain_section(result), *kind_of(result).errors(result)[:1]]
    return [section for section in told if section is not None]


def sections_of(result: Diagnosis) -> list[Section]:
    """What stands behind the answer: further pictures of residuals, evidence, what is excluded, what is next."""
    positions = result.next_positions
    told = [
        *kind_of(result).errors(result)[1:],
        hypothesis_section(result),
        beyond.level_section(result),
        *kind_of(result).values(result),
        evidence.ranking_section(result),
        evidence.confusion_section(result),
        evidence.length_section(result),
        witnesses.judgement_section(result),
        evidence.structure_section(result),
        *evidence.excluded_sections(result),
        evidence.power_section(result),
        bench.next_section(result.evidence.calibration.linearised, positions) if positions else None,
        Section("What to measure next", list(map(sentence, result.next))) if result.next else None,
    ]
    return [section for section in told if section is not None]


def cause_section(result: Diagnosis, files: list[Path]) -> Section | None:
    """The cause that was named, or the candidates that remain."""
    if not result.causes:
        return None
    named = result.verdict == "explained"
    rows: list[list[Cell]] = []
    for number, finding in enumerate(sets_of(result), start=1):
        for cause in finding.causes:
            for p, value, ends in zip(cause.parameters, cause.values, cause.intervals, strict=True):
                left = residual(finding.fit.radius)
                row = [cause.place.title, p.name, *interval(value, *ends), unit_text(p.unit), left]
                rows.append([None if named else number, *row])
    shown = sets_of(result)[:MOST_SETS]
    told = [sentences_of(finding, result) for finding in shown]
    said = [sentence(text if named else f"set {number}: {text}") for number, text in enumerate(told, start=1)]
    if len(sets_of(result)) > len(shown):
        said.append(f"The table has {len(sets_of(result)) - len(shown)} more; the first leave least.")
    same = [place.title for cause in result.causes for place in cause.alike]
    same += [" with ".join(place.title for place in places) for places in result.equal_sets]
    if same and named:
        said.append(f"By {result.evidence.told_by} it cannot be told from: {', '.join(same)}.")
    if (other := result.second_mounting) is not None:
        said.append(
            f"A second mounting, {other.mounting}, tells apart {' and '.join(other.separates)}: "
            f"their correlation falls from {digits(other.correlation_before)} to {digits(other.correlation_after)}."
        )
    if result.cut_off_at is not None:
        said.append(sentence(cut_off(result.cut_off_at)))
    header = ["set", "effect", "parameter", "estimate", "low", "high", "unit", "leaves, over its bound"]
    return Section(
        "The cause" if named else "Causes that remain",
        said,
        table=Table(header, rows).told(),
        files=files,
        equations=() if named else cause_lines([cause for finding in shown for cause in finding.causes]),
    )


def gain_section(result: Diagnosis) -> Section | None:
    """What the extended simulation gains on parts of the record that were not used."""
    if (gain := result.gain) is None:
        return None
    unit = gain.unit or result.unit or "g"
    rows: list[list[Cell]] = []
    for one in (gain, *(gain.others or ())):
        rms = (one.held_out_rms_before, one.held_out_rms_after)
        most = (one.held_out_max_before, one.held_out_max_after)
        what = [one.over or "positions", one.pieces or len(one.rows)]
        figures = (*map(digits, rms), *(upwards(figure, 3) for figure in most))
        rows.append([*what, *figures, one.unit or result.unit or "g"])
    said = (
        "The extended components were exported as FMUs, with parameters from the other parts of the record, and run by "
        f"the orchestrator. Over {rows[0][1]} {f'pieces of {gain.over}' if gain.over else 'positions'} the root "
        f"mean square error falls from {digits(gain.held_out_rms_before)} to {digits(gain.held_out_rms_after)} "
        f"{unit}."
    )
    if not gain.improves:
        said = said.replace("falls", "goes")
    if gain.over is None:
        sigma, numbers = result.evidence.calibration.noise_bound, result.evidence.numbers
        picture = held_out(gain.before / sigma, gain.after / sigma, [int(numbers[i]) for i in gain.rows])
        caption = "Measurement less simulation at the positions that were held out."
    else:
        picture = gain_picture(gain.before, gain.after, gain.over or "")
        caption = "Part of the pieces whose error is at most so large."
    header = ["over", "pieces", *(f"{name} {when}" for name in ("rms", "max") for when in ("before", "after")), "unit"]
    return Section("The gain on what was not used", [said], picture, caption, Table(header, rows))


def sources(result: Diagnosis) -> list[str]:
    """Of a diagnosis, whatever the record."""
    told, own = bool(result.judgement), result.witness
    more = cited(
        result.tried and "lawson",
        len(result.tried) > 1 and "angles",
        told and (own is None or own.shuffles) and "shuffles",
        told and (own is None or own.folds or own.blocks) and "left-out",
        result.gain and "fmi",
    )
    return list(dict.fromkeys([*kind_of(result).sources(result), *more]))


# Formulas that a person states


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


def _ends(low: float | None, high: float | None) -> tuple[float, float]:
    return (-float("inf") if low is None else low, float("inf") if high is None else high)
