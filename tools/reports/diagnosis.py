"""The page of a diagnosis of any record."""

import math
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from ..diagnosis.cause import Cause, Finding
from ..diagnosis.hypothesis import Hypothesis
from ..diagnosis.result import Diagnosis
from ..document.blocks import Page, Picture, Section, Table, Tone
from ..document.notation import Cell, sentence, unit_text
from ..motion.inspect import Inspection
from ..motion.norm import norm_values
from ..records import PositionRecord
from ..rounding import digits, exactly, interval, residual, upwards
from . import bench, beyond, calibration, evidence, witnesses
from .bench import cause_lines, next_sections, sizes_of
from .inspection import record_sections
from .noise import against_sections
from .pictures import WIDTH
from .pictures.residuals import held_out, matrix_picture, shares_of_pieces
from .sources import cited, versions
from .terminal import detection_limit, is_weak, terminal_lines

ANSWERS = {
    "stands": "fits: it brings every error within its bound",
    "refuted": "refuted: no coefficients bring every error within its bound",
    "not needed": "not needed: the model fits without it",
    "cannot be told": "cannot be decided: the model already contains it, or the record is too short",
}
OF_RECORD = ("sigma", "rows", "stretch", "break")
"""Kinds of explanations that name a fault of the record, not of the simulation."""
TONES: dict[str, Tone] = {"consistent": "good", "explained": "good"}


def diagnosis_page(result: Diagnosis, record: PositionRecord | None = None) -> Page:
    """Return the page of a diagnosis of any record.

    The answer is the cause or the candidates, the gain, the first residuals and the cautions. Record, model, evidence
    and excluded effects follow. `record` is the record of positions, if the diagnosis has one.
    """
    if result.sources is None:
        return _page_of_file(result)
    warnings = list(result.warnings)
    verdict = diagnosis_sentence(result)
    if result.cut_off_at is not None and "cut off" not in verdict:
        warnings.append(cut_off(result.cut_off_at))
    turns = [] if result.calibration.linearised is None else witnesses.turn_sections(result)
    return Page(
        _title(result),
        verdict,
        turns + beyond.sections(result) + answer_of(result) + noise_sections(result) + remarks_of(result),
        lambda: _record_sections(result, record) + sections_of(result),
        tone=TONES.get(result.verdict, "attention"),
        key=_key(result),
        provenance=_provenance(result),
        sources=sources(result),
        warnings=warnings,
        screen=terminal_lines(result, verdict, warnings),
    )


def _page_of_file(result: Diagnosis) -> Page:
    """Return the page of a diagnosis read from its file: the verdict, and the causes with their intervals."""
    rows = []
    texts = []
    for number, explanation in enumerate(result.explanations, start=1):
        if explanation.kind in OF_RECORD:
            texts.append(explanation.sentence)
        for cause in explanation.causes:
            texts.append(sentence(cause.sentence))
            rows += [[number, cause.place.title, *sizes] for sizes in sizes_of(cause)]
    header = ["set", "effect", "parameter", "estimate", "low", "high", "unit"]
    table = Table(header, rows)
    answer = [Section("Explanations", texts, table=table)]
    return Page(
        "A diagnosis from its file",
        f"{result.verdict.capitalize()}.",
        answer,
        tone=TONES.get(result.verdict, "attention"),
        key={"largest residual over its bound": residual(result.radius)},
        warnings=result.warnings,
    )


def answer_of(result: Diagnosis) -> list[Section]:
    """Return the cause with its size, its gain, and the residuals."""
    sections = [cause_section(result), change_section(result), gain_section(result)]
    sections += _errors(result)[:1]
    return [section for section in sections if section is not None]


def noise_sections(result: Diagnosis) -> list[Section]:
    """Return the answer on the simulation's noise, where it was asked about."""
    if result.noise is None:
        return []
    return against_sections(result.noise)


def change_section(result: Diagnosis) -> Section | None:
    """Return the change at a break with the values that the record leaves possible; None without a break."""
    first = result.explanations[0] if result.explanations else None
    if first is None or first.kind != "break" or not first.change:
        return None
    rows = []
    for name, value in first.change.items():
        if first.within is None:
            rows.append([name, digits(value), None, None])
        else:
            rows.append([name, *interval(value, *first.within[name])])
    table = Table(["change", "estimate", "low", "high"], rows)
    return Section("The change", [first.sentence], table=table)


def remarks_of(result: Diagnosis) -> list[Section]:
    """Return the cautions, the answers to hypotheses, and the next measurements."""
    remarks = []
    for text in (result.not_named or ())[:MOST_SETS]:
        remarks.append(sentence(f"not named: {text}"))
    for text in result.objections or ():
        remarks.append(sentence(f"against the first set: {text}"))
    if result.verdict != "unexplained":
        # There the answer has it.
        remarks += [sentence(text) for text in (beyond.proven_text(result),) if text]
    remarks += [sentence(text) for text in (beyond.bound_text(result),) if text]
    for places in result.containing_sets:
        titles = " and ".join([place.title for place in places])
        remarks.append(f"Not excluded: {titles}, which contains the named effect.")
    if not (result.band or result.bands):
        remarks += [sentence(text) for text in result.caution or ()]
    remarks += _remarks(result)
    remarks += beyond.extension_texts(result)
    sections = [Section("Cautions", remarks)]
    sections += hypothesis_sections(result)
    if result.next_positions:
        sections += next_sections(result.calibration.linearised, result.next_positions)
    if result.next:
        sections.append(Section("Next measurements", [sentence(text) for text in result.next]))
    return sections


def sections_of(result: Diagnosis) -> list[Section]:
    """Return the details: further pictures of residuals, evidence, excluded effects."""
    sections: list[Section | None] = []
    sections += _errors(result)[1:]
    sections.append(beyond.level_section(result))
    sections += _values(result)
    sections.append(evidence.ranking_section(result))
    sections.append(evidence.confusion_section(result))
    sections.append(evidence.length_section(result))
    sections.append(witnesses.judgement_section(result))
    sections.append(evidence.structure_section(result))
    sections += evidence.excluded_sections(result)
    sections.append(evidence.power_section(result))
    return [section for section in sections if section is not None]


def cause_section(result: Diagnosis, files: Sequence[Path] = ()) -> Section | None:
    """Return the named cause, or the remaining candidates, with their files; None if there are neither."""
    sets = sets_of(result)
    if not sets:
        return None
    is_named = result.verdict == "explained"
    first_sets = sets[:MOST_SETS]
    rows = []
    for number, finding in enumerate(sets, start=1):
        for cause in finding.causes:
            for sizes in sizes_of(cause):
                rows.append([None if is_named else number, cause.place.title, *sizes, residual(finding.fit.radius)])
    verdict = diagnosis_sentence(result)
    paragraphs = []
    for number, finding in enumerate(first_sets, start=1):
        text = sentences_of(finding, result)
        if not is_named:
            paragraphs.append(f"Set {number}: {text}.")
        elif text not in verdict:
            paragraphs.append(sentence(text))
    paragraphs += _cause_remarks(result)
    equations = []
    for finding in first_sets:
        equations += cause_lines(finding.causes)
    header = ["set", "effect", "parameter", "estimate", "low", "high", "unit", "largest residual"]
    table = Table(header, rows)
    title = "The cause" if is_named else "Causes that remain"
    matrix = _matrix(first_sets[0])
    caption = "Estimate, and the interval below it. A frame marks an element that cannot be zero." if matrix else ""
    return Section(title, paragraphs, matrix, caption, table, files, equations)


def _matrix(finding: Finding) -> Picture | None:
    """Return the first matrix of the gyros in a set as a picture; None without one."""
    for cause in finding.causes:
        if len(cause.parameters) == 9:
            ends = np.array(cause.intervals).reshape(3, 3, 2)
            columns = [f"by {p.description.partition(' by ')[2]}" for p in cause.place.definition.parameters[:3]]
            values = np.reshape(cause.values, (3, 3))
            return matrix_picture(values, ends[..., 0], ends[..., 1], columns, unit_text(cause.parameters[0].unit))
    return None


def _cause_remarks(result: Diagnosis) -> list[str]:
    """Return sentences on further sets, effects indistinguishable from the cause, and measurements that separate
    candidates."""
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
        remarks.append(f"Not distinguishable by {result.sources.told_by}: {', '.join(same)}.")
    second = result.second_mounting
    if second is not None:
        remarks.append(
            f"A second mounting, {second.mounting}, distinguishes {' and '.join(second.separates)}: "
            f"their correlation falls from {digits(second.correlation_before)} to {digits(second.correlation_after)}."
        )
    return remarks


def gain_section(result: Diagnosis) -> Section | None:
    """Return the gain of the extended simulation on unused parts of the record; None without a gain."""
    gain = result.gain
    if gain is None:
        return None
    rows = []
    parts = [gain]
    parts += gain.others or ()
    for part in parts:
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
    _, count, before, after, _, _, unit = rows[0]
    pieces = f"pieces of {gain.over}" if gain.over else "positions"
    goes = "falls" if gain.improves else "goes"
    text = (
        "The extended components were exported as FMUs, with parameters from the other parts of the record, and run by "
        f"the orchestrator. Over {count} {pieces} the root mean square error {goes} from {before} to {after} {unit}."
    )
    caption = "Part of the pieces whose error is at most so large."
    if gain.over is None:
        caption = "Measurement less simulation at the held-out positions."
    header = ["over", "pieces", "rms before", "rms after", "max before", "max after", "unit"]
    return Section("Gain on held-out data", [text], gain_picture(result), caption, Table(header, rows))


def gain_picture(result: Diagnosis, width: float = WIDTH) -> Picture | None:
    """Return the errors of unused positions or pieces, before and after; None without a gain."""
    gain = result.gain
    if gain is None:
        return None
    if gain.over is not None:
        return shares_of_pieces(gain.before, gain.after, gain.over)
    sigma = result.calibration.noise_bound
    numbers = [int(result.sources.numbers[i]) for i in gain.rows]
    return held_out(gain.before / sigma, gain.after / sigma, numbers, width)


# The content of the result selects the sections: residuals of readings for a linearised calibration, errors of the
# attitude for a carried block.


def _inspection(result: Diagnosis) -> Inspection | None:
    """Return the inspection of a record of gyros and accelerometers; None for another record."""
    return getattr(result.sources, "found", None)


def _title(result: Diagnosis) -> str:
    inspection, source = _inspection(result), result.calibration.provenance
    name = "a record"
    if inspection is not None:
        name = inspection.record.path.name
    elif source is not None:
        name = source.record
    return f"Diagnosis of {name}"


AFTER = {"rows": "without wrong rows", "stretch": "without the stretch", "break": "with the break"}
"""Kind of an explanation of the record, and its figure below the verdict."""


def _key(result: Diagnosis) -> dict[str, object]:
    """Return the figures below the verdict."""
    with_effects = f"with {evidence.first_words(result)}"
    inspection = _inspection(result)
    if inspection is not None:
        key: dict[str, object] = {"rows": len(inspection.record), "reference": result.reference}
        if result.radius is not None and result.noise_bound_arcmin is not None:
            key[f"bound, {evidence.quoted_words(result)}"] = f"{upwards(result.noise_bound_arcmin, 3)} arcmin"
            key["largest error"] = f"{residual(result.radius)} times its bound"
            if result.best is not None:
                key[with_effects] = residual(result.best.radius)
        return key
    key = bench.key_figures(result.calibration)
    if result.findings:
        key[with_effects] = f"{residual(result.findings[0].fit.radius)} σ"
    elif result.best is not None and result.best.kind in AFTER and result.best.radius is not None:
        key[AFTER[result.best.kind]] = f"{residual(result.best.radius)} σ"
    return key


def _provenance(result: Diagnosis) -> dict[str, object]:
    """Return the provenance of a diagnosis: the record, options, versions."""
    nominal, inspection = result.calibration, _inspection(result)
    if inspection is None:
        shuffled = result.witness is not None and result.witness.shuffles
        return bench.provenance(nominal, {"seed of the shuffles": nominal.positions} if shuffled else {})
    record = inspection.record
    facts: dict[str, object] = {
        "record": record.path.name,
        "record, SHA-256": record.sha256,
        "reference": result.reference,
        "gravity": f"{exactly(inspection.gravity)} m/s²",
        "model": f"{result.baseline_model} block",
    }
    if record.rate is not None:
        facts["a rate in the record is"] = result.sources.rates
    if nominal.sigma.basis:
        facts["bounds from"] = nominal.sigma.basis
    if witnesses.witnesses_of(result):
        facts["seed of the shuffles"] = sum(part.error.size for part in result.sources.rows.parts)
    return facts | versions()


def _record_sections(result: Diagnosis, record: PositionRecord | None) -> list[Section]:
    """Return the description of the record."""
    inspection = _inspection(result)
    if inspection is not None:
        # If gravity is the reference, the accelerometers are among the block's own parameters, better known.
        forces = not any(p.symbol.startswith("accelerometer") for p in result.stated.parameters)
        return record_sections(inspection, result.warnings, forces=forces, gaps_named=bool(result.missing))
    return [] if record is None else [bench.measured_section(record, result.calibration)]


def _errors(result: Diagnosis) -> list[Section]:
    """Return the residuals of the record, beginning with those over the record."""
    if result.calibration.linearised is not None:
        return evidence.residual_sections(result)
    if _inspection(result) is not None and result.sources.rows.parts:
        return evidence.error_sections(result, evidence.bias_texts(result))
    return []


def _values(result: Diagnosis) -> list[Section | None]:
    """Return the fitted parameters, and the proof of a falsification."""
    nominal = result.calibration
    if nominal.linearised is None:
        return [evidence.parameter_section(result)]
    targets = evidence.moved_targets_section(result) or calibration.target_section(nominal)
    return [targets, bench.proof_section(nominal, result.sources.numbers)]


def _remarks(result: Diagnosis) -> list[str]:
    """Return remarks on the two witnesses, a missing gain, missing data, and effects that the record cannot show."""
    gain = result.gain
    if result.calibration.linearised is not None:
        remarks = []
        if gain is None and result.findings and result.verdict == "explained":
            remarks.append("Gain on held-out positions: not possible with these effects and positions.")
        if gain is not None and gain.over is None and not gain.improves:
            remarks.append("The extension does not improve the held-out positions.")
        return remarks
    remarks = [sentence(f"add {text}") for text in result.missing or ()]
    if result.verdict != "consistent":
        return remarks
    remarks.append(
        "No effect is named: with the block's own parameters every error stays within the noise, so nothing more is "
        "supported."
    )
    if result.excluded:
        effects = {(entry["effect"], entry["where"]) for entry in result.excluded}
        remarks.append(f"The record bounds {len(effects)} effects.")
    if result.cannot_be_seen:
        names = dict.fromkeys(place.effect for place in result.cannot_be_seen)
        remarks.append(f"This record cannot show: {', '.join(names)}.")
    return remarks


def sources(result: Diagnosis) -> list[str]:
    """Return the publications of the methods of a diagnosis."""
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
    return list(dict.fromkeys(_sources_of_model(result) + methods))


def _sources_of_model(result: Diagnosis) -> list[str]:
    if result.calibration.linearised is not None:
        return bench.calibration_sources(result.calibration)
    inspection = _inspection(result)
    if inspection is None:
        return cited("simplex", result.tried and "chebyshev")
    norm = norm_values(inspection.accelerometers) is not None
    first = cited(norm and "norm", inspection.gyros is not None and "allan")
    if not result.sources.rows.parts:
        return first
    return first + cited("gyros", "attitude", "simplex", result.tried and "chebyshev", "fmi")


# The verdict in words: the named effects, other possible ones, untried ones

FEW_RIVALS = 3
"""Largest number of sets of effects that the verdict names."""
MOST_MISSING = 3
"""Largest number of missing rests and moves that the verdict names; the page names all."""
OTHERS_MAY = "and others may that were not tried: the search was cut off"
MOST_SETS = 6
"""Largest number of remaining sets that are printed."""


def diagnosis_sentence(result: Diagnosis) -> str:
    """Return the verdict, with the named cause and the assumption on which it rests."""
    proviso = evidence.proviso_of(result)
    return f"{_verdict(result)} {sentence(proviso)}" if proviso else _verdict(result)


DOES_NOT_FIT = "The model without effects does not explain the record"
COUNTS = {1: "One effect explains the record", 2: "Two effects together explain the record"}


def _verdict(result: Diagnosis) -> str:
    if result.verdict == "explained":
        return _explained(result)
    if result.verdict == "ambiguous":
        return _ambiguous(result)
    if result.verdict == "unexplained":
        return _unexplained(result)
    if result.verdict == "insufficient":
        more = bench.measure_words(result.next_positions or ())
        return f"Too little was measured to judge the simulation: {missing_words(result)}.{more}"
    return _consistent(result)


def _consistent(result: Diagnosis) -> str:
    """Return the verdict on a model that stands, with the size of the errors that could still be there."""
    text = (
        "Consistent: the simulation explains the record within its noise; no error is more than "
        f"{residual(result.radius or 0.0)} of its bound, and no effect is named."
    )
    limit = detection_limit(result)
    if is_weak(result):
        return f"Consistent, but too weak to judge the instrument: errors below {limit} could be hidden."
    return f"{text} Errors below {limit} could be there and not show." if limit else text


def _explained(result: Diagnosis) -> str:
    """Return the named explanation, with what speaks against it: an untried rival, or held-out parts."""
    if result.best is not None and result.best.kind in OF_RECORD:
        text = result.best.sentence
        if result.cut_off_at is not None:
            text += f" But {cut_off(result.cut_off_at)}."
    else:
        causes = result.findings[0].causes
        head = COUNTS.get(len(causes), f"{len(causes)} effects together explain the record")
        text = f"{head}: {sentences_of(result.findings[0], result)}."
    gain = result.gain
    if gain is not None and not gain.improves:
        before, after = digits(gain.held_out_rms_before), digits(gain.held_out_rms_after)
        text += (
            f" But it does not predict what was held out: the rms error goes from {before} to {after} "
            f"{gain.unit or result.unit or 'g'}."
        )
    return text


def _ambiguous(result: Diagnosis) -> str:
    """Return the sets that would explain the record, and the objection to the first."""
    text = f"{DOES_NOT_FIT}. {rivals(result)}"
    if any(explanation.kind in OF_RECORD for explanation in result.explanations):
        sentences = [explanation.sentence.rstrip(".") for explanation in result.explanations[:FEW_RIVALS]]
        text = f"The record does not tell which of these is true: {'; or: '.join(sentences)}."
    if result.objections:
        text += f" But {result.objections[0]}."
    if only_unlisted(result):
        text += f" {sentence(result.caution[0])}"
    return text


def _unexplained(result: Diagnosis) -> str:
    """Return a sentence on an unexplained record: an objection, a cut-off, a place, or the residual."""
    least = f"with the best parameters its largest error is {residual(result.radius or 0.0)} times its bound"
    proven = beyond.proven_text(result)
    if proven:
        return f"{DOES_NOT_FIT}. {sentence(proven)}"
    if result.not_named:
        return f"{DOES_NOT_FIT}: {least}. Not named: {result.not_named[0]}."
    if result.cut_off_at is not None:
        return f"{DOES_NOT_FIT}: {least}. {sentence(cut_off(result.cut_off_at))}"
    text = f"{DOES_NOT_FIT}: {least}. No set of up to three effects of the catalogue makes it fit."
    return f"{text} {beyond.beyond_words(result)}".rstrip()


def missing_words(result: Diagnosis) -> str:
    """Return the missing data, or the undetermined targets."""
    texts = [gap for gap in result.missing or () if isinstance(gap, str)]
    if len(texts) > MOST_MISSING:
        return f"add {len(texts)} rests or moves: {'; '.join(texts[: MOST_MISSING - 1])} and others"
    if texts:
        return f"add {'; '.join(texts)}"
    return f"the readings do not determine {bench.open_targets(result.calibration)}"


def rivals(result: Diagnosis) -> str:
    """Return the remaining sets of effects, few by their names, and the use of further positions."""
    sets = sets_of(result)
    text = f"{len(sets)} sets of effects would each explain it"
    if len(sets) == 1:
        text = f"This effect would explain it: {sets[0].title}"
    elif len(sets) <= FEW_RIVALS:
        text = f"Each of these would explain it: {'; or '.join([finding.title for finding in sets])}"
    if result.cut_off_at is not None:
        text += f", {OTHERS_MAY}"
    proposed = len(result.next_positions or ())
    if not proposed:
        nothing_decides = result.next_positions is not None and result.calibration.linearised is not None
        return f"{text}. No further position surely tells two of them apart." if nothing_decides else f"{text}."
    sure = len(bench.deciding(result.calibration.linearised, result.next_positions or ()))
    if sure == proposed:
        positions = "position decides" if proposed == 1 else "positions decide"
        return f"{text}. Readings at {proposed} further {positions}."
    tells = {0: "none surely tells", 1: "one surely tells"}.get(sure, f"{sure} surely tell")
    return f"{text}. Of the {proposed} proposed positions, {tells} two of them apart."


def sets_of(result: Diagnosis) -> tuple[Finding, ...]:
    """Return the remaining sets, the best first; only one if a cause is named."""
    return result.findings if result.verdict in ("explained", "ambiguous") else ()


def cause_sentence(cause: Cause, result: Diagnosis) -> str:
    """Return a cause in a sentence; latency also in samples."""
    if cause.place.effect == "latency":
        return f"{cause.sentence}, {digits(abs(cause.values[0]) / result.sources.found.sampling.period)} samples"
    return cause.sentence


def sentences_of(finding: Finding, result: Diagnosis) -> str:
    """Return the causes of a set in a sentence."""
    return "; ".join(cause_sentence(cause, result) for cause in finding.causes)


def cut_off(size: int) -> str:
    """Return a sentence on a search that was cut off among sets of this size."""
    smaller = {1: "", 2: "no single effect will do; ", 3: "no set of one or two effects will do; "}[size]
    sets = {1: "single effects", 2: "sets of two", 3: "sets of three"}[size]
    return f"the search was cut off: {smaller}{sets} were not all tried"


def only_unlisted(result: Diagnosis) -> bool:
    """Return True if a record is ambiguous only because of faults outside the catalogue."""
    alone = result.verdict == "ambiguous" and len(result.sets) < 2 and result.complete is not False
    return alone and bool(result.caution)


# Formulas that the user states


def hypothesis_sections(result: Diagnosis) -> list[Section]:
    """Return the user's formulas, with their answers; empty without any."""
    if not result.hypotheses:
        return []
    rows = []
    paragraphs: list[str] = []
    equations: list[str] = []
    for hypothesis in result.hypotheses:
        texts = [ANSWERS[hypothesis.answer]]
        texts += _besides(hypothesis, result.unit or "g")
        paragraphs.append(sentence(f"{hypothesis.formula}: {'; '.join(texts)}"))
        before, after = residual(hypothesis.radius_before), residual(hypothesis.radius)
        head: list[Cell] = [hypothesis.formula, hypothesis.answer, before, after]
        for p in hypothesis.parameters:
            least = -math.inf if p.low is None else p.low
            most = math.inf if p.high is None else p.high
            estimate, low, high = interval(p.estimate, least, most)
            coefficient: list[Cell] = [p.name, estimate, low, high, unit_text(p.unit)]
            rows.append(head + coefficient)
        if not hypothesis.parameters:
            empty: list[Cell] = [None] * 5
            rows.append(head + empty)
        if hypothesis.finding is not None:
            equations += cause_lines([hypothesis.finding.causes[-1]])
    header = ["formula", "answer", "radius without", "with", "coefficient", "estimate", "low", "high", "unit"]
    table = Table(header, rows)
    return [Section("Hypotheses", paragraphs, table=table, equations=equations)]


def _besides(hypothesis: Hypothesis, unit: str) -> list[str]:
    """Return the result of held-out parts for a formula, its other names, and equally good alternatives."""
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
