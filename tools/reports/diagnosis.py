"""The page of a diagnosis, whatever the record."""

import math
from pathlib import Path

from ..diagnosis.hypothesis import Hypothesis
from ..diagnosis.result import Diagnosis
from ..document.blocks import Page, Section, Table, Tone
from ..document.notation import Cell, sentence, unit_text
from ..records import PositionRecord
from ..rounding import digits, interval, residual, upwards
from . import beyond, evidence, witnesses
from .bench import cause_lines, next_sections
from .kinds import kind_of
from .pictures.residuals import gain_picture, held_out
from .sources import cited
from .verdict import MOST_SETS, cut_off, sentences_of, sets_of, verdict_sentence

ANSWERS = {
    "stands": "stands: it brings every error within its bound",
    "refuted": "refuted: no coefficients bring every error within its bound",
    "not needed": "not needed: the model stands without it",
    "cannot be told": "cannot be told: the model has the same in it, or the record is too short",
}
TONES: dict[str, Tone] = {"consistent": "good", "explained": "good"}


def diagnosis_page(result: Diagnosis, record: PositionRecord | None = None) -> Page:
    """Return what a diagnosis says, whatever the record.

    The answer is the cause or the candidates, the gain, the first residuals and what to bear in mind; behind it stand
    record, model, evidence, and what is excluded. `record` is that of positions, where the diagnosis is of one.
    """
    kind = kind_of(result)
    warnings = list(result.warnings)
    if result.cut_off_at is not None:
        warnings.append(cut_off(result.cut_off_at))
    about = kind.about(result)
    return Page(
        f"Diagnosis of {about.name}",
        verdict_sentence(result),
        [*beyond.sections(result), *answer_of(result), *remarks_of(result)],
        lambda: [*kind.record_sections(result, record), *sections_of(result)],
        tone=TONES.get(result.verdict, "attention"),
        key=about.key,
        provenance=about.provenance,
        sources=sources(result),
        warnings=warnings,
    )


def answer_of(result: Diagnosis, files: list[Path] | None = None) -> list[Section]:
    """Return the cause with its size, what it gains, and the residuals; `files` belong to the cause."""
    sections = [cause_section(result, files or []), gain_section(result), *kind_of(result).errors(result)[:1]]
    return [section for section in sections if section is not None]


def remarks_of(result: Diagnosis) -> list[Section]:
    """Return what to bear in mind, the answers to hypotheses, and what to measure next."""
    remarks = []
    for text in (result.not_named or ())[:MOST_SETS]:
        remarks.append(sentence(f"not named: {text}"))
    for text in result.objections or ():
        remarks.append(sentence(f"against the first set: {text}"))
    remarks += [sentence(text) for text in beyond.level_texts(result)]
    for places in result.containing_sets:
        titles = " and ".join([place.title for place in places])
        remarks.append(f"Not excluded: {titles}, which contains what is named.")
    if not (result.band or result.bands):
        remarks += [sentence(text) for text in result.caution or ()]
    remarks += kind_of(result).remarks(result)
    remarks += beyond.extension_texts(result)
    remarks += evidence.power_texts(result)
    sections = [Section("What to bear in mind", remarks)] if remarks else []
    sections += hypothesis_sections(result)
    if result.next_positions:
        sections += next_sections(result.evidence.calibration.linearised, result.next_positions)
    if result.next:
        sections.append(Section("What to measure next", [sentence(text) for text in result.next]))
    return sections


def sections_of(result: Diagnosis) -> list[Section]:
    """Return what stands behind the answer: further pictures of residuals, evidence, what is excluded."""
    sections = [
        *kind_of(result).errors(result)[1:],
        beyond.level_section(result),
        *kind_of(result).values(result),
        evidence.ranking_section(result),
        evidence.confusion_section(result),
        evidence.length_section(result),
        witnesses.judgement_section(result),
        evidence.structure_section(result),
        *evidence.excluded_sections(result),
        evidence.power_section(result),
    ]
    return [section for section in sections if section is not None]


def cause_section(result: Diagnosis, files: list[Path]) -> Section | None:
    """The cause that was named, or the candidates that remain."""
    if not sets_of(result):
        return None
    causes = sets_of(result)[0].causes
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
    same = [place.title for cause in causes for place in cause.alike]
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
        table=Table(header, rows).without_empty_columns(),
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


def hypothesis_sections(result: Diagnosis) -> list[Section]:
    """Return the formulas that were asked about, with their answers; none where none were."""
    if not result.hypotheses:
        return []
    rows: list[list[Cell]] = []
    paragraphs: list[str] = []
    equations: list[str] = []
    for hypothesis in result.hypotheses:
        texts = [ANSWERS[hypothesis.answer], *_besides(hypothesis, result.unit or "g")]
        paragraphs.append(sentence(f"{hypothesis.formula}: {'; '.join(texts)}"))
        radii = [residual(hypothesis.radius_before), residual(hypothesis.radius)]
        head = [hypothesis.formula, hypothesis.answer, *radii]
        for p in hypothesis.parameters:
            low = -math.inf if p.low is None else p.low
            high = math.inf if p.high is None else p.high
            rows.append([*head, p.name, *interval(p.estimate, low, high), unit_text(p.unit)])
        if not hypothesis.parameters:
            rows.append([*head, None, None, None, None, None])
        if hypothesis.finding is not None:
            equations += cause_lines([hypothesis.finding.causes[-1]])
    header = ["formula", "answer", "radius without", "with", "coefficient", "estimate", "low", "high", "unit"]
    table = Table(header, rows).without_empty_columns()
    return [Section("Hypotheses", paragraphs, table=table, equations=equations)]


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
