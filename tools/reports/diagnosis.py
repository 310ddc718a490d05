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
    if result.evidence is None:
        return _page_of_file(result)
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


def _page_of_file(result: Diagnosis) -> Page:
    """Return what a diagnosis that came from its file says: the verdict, and the causes with their intervals."""
    rows: list[list[Cell]] = []
    texts = []
    for number, explanation in enumerate(result.explanations, start=1):
        for cause in explanation.causes:
            texts.append(sentence(cause.sentence))
            for p, value, ends in zip(cause.parameters, cause.values, cause.intervals, strict=True):
                rows.append([number, cause.place.title, p.name, *interval(value, *ends), unit_text(p.unit)])
    header = ["set", "effect", "parameter", "estimate", "low", "high", "unit"]
    table = Table(header, rows) if rows else None
    answer = [Section("What explains the record", texts, table=table)] if texts else []
    return Page(
        "A diagnosis from its file",
        f"{result.verdict.capitalize()}.",
        answer,
        tone=TONES.get(result.verdict, "attention"),
        key={"largest residual over its bound": residual(result.radius)},
        warnings=result.warnings,
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
    remarks += witnesses.evidence_lines(result)
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
    """Return the cause that is named, or the candidates that remain; None where there are neither."""
    sets = sets_of(result)
    if not sets:
        return None
    named = result.verdict == "explained"
    first_sets = sets[:MOST_SETS]
    rows: list[list[Cell]] = []
    for number, finding in enumerate(sets, start=1):
        for cause in finding.causes:
            for p, value, ends in zip(cause.parameters, cause.values, cause.intervals, strict=True):
                size = [p.name, *interval(value, *ends), unit_text(p.unit), residual(finding.fit.radius)]
                rows.append([None if named else number, cause.place.title, *size])
    paragraphs = []
    for number, finding in enumerate(first_sets, start=1):
        text = sentences_of(finding, result)
        paragraphs.append(sentence(text if named else f"set {number}: {text}"))
    paragraphs += _cause_remarks(result)
    equations = []
    for finding in first_sets:
        equations += cause_lines(finding.causes)
    header = ["set", "effect", "parameter", "estimate", "low", "high", "unit", "leaves, over its bound"]
    table = Table(header, rows).without_empty_columns()
    title = "The cause" if named else "Causes that remain"
    return Section(title, paragraphs, table=table, files=files, equations=equations)


def _cause_remarks(result: Diagnosis) -> list[str]:
    """Return in sentences further sets, what the cause cannot be told from, and what would tell candidates apart."""
    remarks = []
    further = len(sets_of(result)) - MOST_SETS
    if further > 0:
        remarks.append(f"The table has {further} more; the first leave least.")
    same = []
    for cause in sets_of(result)[0].causes:
        same += [place.title for place in cause.alike]
    for places in result.equal_sets:
        same.append(" with ".join([place.title for place in places]))
    if same and result.verdict == "explained":
        remarks.append(f"By {result.evidence.told_by} it cannot be told from: {', '.join(same)}.")
    second = result.second_mounting
    if second is not None:
        remarks.append(
            f"A second mounting, {second.mounting}, tells apart {' and '.join(second.separates)}: "
            f"their correlation falls from {digits(second.correlation_before)} to {digits(second.correlation_after)}."
        )
    return remarks


def gain_section(result: Diagnosis) -> Section | None:
    """Return what the extended simulation gains on parts of the record that were not used; None without a gain."""
    gain = result.gain
    if gain is None:
        return None
    rows: list[list[Cell]] = []
    for part in (gain, *(gain.others or ())):
        rows.append(
            [
                part.over or "positions",
                part.pieces or len(part.rows),
                digits(part.held_out_rms_before),
                digits(part.held_out_rms_after),
                upwards(part.held_out_max_before, 3),
                upwards(part.held_out_max_after, 3),
                part.unit or result.unit or "g",
            ]
        )
    _, count, before, after, *_, unit = rows[0]
    pieces = f"pieces of {gain.over}" if gain.over else "positions"
    goes = "falls" if gain.improves else "goes"
    text = (
        "The extended components were exported as FMUs, with parameters from the other parts of the record, and run by "
        f"the orchestrator. Over {count} {pieces} the root mean square error {goes} from {before} to {after} {unit}."
    )
    if gain.over is None:
        sigma = result.evidence.calibration.noise_bound
        numbers = [int(result.evidence.numbers[i]) for i in gain.rows]
        picture = held_out(gain.before / sigma, gain.after / sigma, numbers)
        caption = "Measurement less simulation at the positions that were held out."
    else:
        picture = gain_picture(gain.before, gain.after, gain.over)
        caption = "Part of the pieces whose error is at most so large."
    header = ["over", "pieces", "rms before", "rms after", "max before", "max after", "unit"]
    return Section("The gain on what was not used", [text], picture, caption, Table(header, rows))


def sources(result: Diagnosis) -> list[str]:
    """Return where the methods of a diagnosis are published."""
    witness = result.witness
    judged = bool(result.judgement)
    shuffled = judged and (witness is None or witness.shuffles)
    left_out = judged and (witness is None or witness.folds or witness.blocks)
    methods = cited(
        result.tried and "lawson",
        len(result.tried) > 1 and "angles",
        shuffled and "shuffles",
        left_out and "left-out",
        result.gain and "fmi",
    )
    return list(dict.fromkeys(kind_of(result).sources(result) + methods))


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


def _besides(hypothesis: Hypothesis, unit: str) -> list[str]:
    """Return what was left out says of a formula, what it is by another name, and what would do as well."""
    texts = [f"against it: {text}" for text in hypothesis.objections]
    gain = hypothesis.gain
    if gain is not None:
        rms = f"{digits(gain.held_out_rms_before)} -> {digits(gain.held_out_rms_after)} {unit}"
        texts.append(f"not used, simulated again: rms {rms}")
    if hypothesis.equivalents:
        names = [effect.place.title for effect in hypothesis.equivalents]
        texts.append(f"by another name: {', '.join(names)}")
    if hypothesis.as_well:
        sets = []
        for effects in hypothesis.as_well:
            sets.append(" and ".join([effect.place.title for effect in effects]))
        further = f"; {len(sets) - 3} sets more" if len(sets) > 3 else ""
        texts.append(f"would do as well: {'; '.join(sets[:3])}{further}")
    elif hypothesis.answer == "stands":
        texts.append("nothing in the catalogue that was tried, of this size or smaller, would do as well")
    return texts
