"""What a diagnosis says, whatever the record: lines for a terminal, and the page."""

import math
from pathlib import Path

import numpy as np

from ..diagnosis.cause import Cause
from ..diagnosis.hypothesis import Hypothesis
from ..diagnosis.order import is_stable
from ..diagnosis.result import Diagnosis, OrderOfEffects, Witness
from ..document.blocks import Page, Section, Table, Tone
from ..document.notation import Cell, half_width, sentence, unit_of, unit_text
from ..records import PositionRecord
from ..rounding import digits, exactly, interval, residual, upwards
from . import bench, beyond, calibration, evidence, witnesses
from .bench import cause_lines, of_bench
from .inspection import carried_section, record_sections
from .makers import cited, versions
from .pictures.residuals import gain_picture, held_out
from .verdict import cut_off, sentence_of, sentences_of, sets_of, verdict_line, verdict_sentence

MOST_SETS = 6
"""So many sets that remain are printed."""
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
    said += _bench_lines(result) if of_bench(result) else _carried_lines(result)
    said += evidence.power_lines(result)
    said += beyond.lines(result)
    bound = float(result.evidence.calibration.linearised.bound.min()) if result.next_positions else None
    for position in result.next_positions or ():
        said.append(f"measure next: {bench.position_text(position, bound)}")
    said += [f"measure next: {text}" for text in result.next or ()]
    warnings = result.evidence.calibration.warnings if of_bench(result) else result.warnings
    warnings = (*warnings, *([] if result.cut_off_at is None else [cut_off(result.cut_off_at)]))
    return said + [f"warning: {text}" for text in warnings]


def _bench_lines(result: Diagnosis) -> list[str]:
    nominal = result.evidence.calibration
    said = [
        f"{nominal.positions} positions, {nominal.measurements} readings, σ = {upwards(nominal.noise_bound, 3)} g "
        f"({nominal.noise_bound_basis}); nominal model: radius {residual(nominal.radius)}",
        *bench.proof_lines(nominal),
    ]
    said += witnesses.turn_lines(result)
    for finding in sets_of(result)[:MOST_SETS]:
        for cause in finding.causes:
            said += _cause_lines(cause, result)
        said.append(f"  radius with {'it' if len(finding.causes) == 1 else 'them'} {residual(finding.fit.radius)}")
    if len(sets_of(result)) > MOST_SETS:
        said.append(f"  ... and {len(sets_of(result)) - MOST_SETS} sets more")
    said += [f"  cannot be told from {' and '.join(place.title for place in same)}" for same in result.equal_sets]
    if (g := result.gain) is not None and g.over is None:
        said.append(
            f"held-out positions, simulated again ({int(np.isfinite(g.before).sum())} readings): "
            f"rms {digits(g.held_out_rms_before)} -> {digits(g.held_out_rms_after)} g, "
            f"max {upwards(g.held_out_max_before, 3)} -> {upwards(g.held_out_max_after, 3)} g"
        )
        said += [] if g.improves else ["warning: the extension does not improve the positions that were held out"]
    elif g is None and result.verdict == "explained":
        said.append("gain on held-out positions: not possible with these effects and positions")
    turned = [] if g is None else [one for one in (g, *(g.others or ())) if one.over is not None]
    said += [
        f"{one.over} that were held out, simulated again ({one.pieces} pieces): rms {digits(one.held_out_rms_before)} "
        f"-> {digits(one.held_out_rms_after)} {one.unit}"
        for one in turned
    ]
    if isinstance(result.judgement, Witness):
        said += witnesses.witness_lines(result.judgement)
    said += witnesses.each_lines(witnesses.witnesses_of(result))
    if (other := result.second_mounting) is not None:
        said.append(
            f"a second mounting ({other.mounting}) tells apart {' and '.join(other.separates)}: "
            f"correlation {digits(other.correlation_before)} -> {digits(other.correlation_after)}"
        )
    return [*said, *_structure_lines(result, "residual of accelerometer", 5)]


def _carried_lines(result: Diagnosis) -> list[str]:
    said = [f"to add: {text}" for text in result.missing or ()]
    if result.baseline.radius is None or result.noise_bound_arcmin is None:
        return said
    said.append(
        f"reference {result.reference}, {result.baseline_model} block; bound "
        f"{upwards(result.noise_bound_arcmin, 3)} arcmin ({result.noise_bound_from}); "
        f"radius {residual(result.baseline.radius)}"
    )
    said += bias_lines(result)
    sets = sets_of(result)
    for number, finding in enumerate(sets[:MOST_SETS]):
        said += ["or"] if number else []
        for cause in finding.causes:
            said += _cause_lines(cause, result)
    if sets and result.extended is not None:
        what = "the first set" if len(sets) > 1 else "it" if len(result.causes) == 1 else "them"
        said.append(f"radius with {what} {residual(result.extended.radius)}")
    if len(sets) > MOST_SETS:
        said.append(f"... and {len(sets) - MOST_SETS} sets more")
    said += _length_lines(result)
    said += [
        f"not used, simulated by the exported FMUs over {gain.over} ({gain.pieces} pieces): rms "
        f"{digits(gain.held_out_rms_before)} -> {digits(gain.held_out_rms_after)} arcmin, max "
        f"{upwards(gain.held_out_max_before, 3)} -> {upwards(gain.held_out_max_after, 3)}"
        for gain in ([] if result.gain is None else [result.gain, *(result.gain.others or ())])
    ]
    said += witnesses.each_lines(witnesses.witnesses_of(result))
    return [*said, *_why_lines(result), *_structure_lines(result, "error about axis", 4)]


def _cause_lines(cause: Cause, result: Diagnosis) -> list[str]:
    """A cause with its parameters."""
    said = [f"cause: {cause.place.title}: {sentence_of(cause, result)}"]
    for parameter, value, (low, high) in zip(cause.parameters, cause.values, cause.intervals, strict=True):
        shown, *ends = interval(value, low, high)
        text = f"  {parameter.name} {shown}, within [{', '.join(ends)}] {unit_of(parameter.unit)}"
        said.append(text.rstrip())
    told = "told" if of_bench(result) else "told in this record"
    return said + [f"  cannot be {told} from {other.title}" for other in cause.alike]


def _structure_lines(result: Diagnosis, what: str, most: int) -> list[str]:
    return [
        f"{what} {entry.get('accelerometer', entry.get('axis'))}: {digits(100 * entry['explained'])} % of it is "
        f"predicted by {entry['on']}; {digits(100 * entry['explainable'])} % is more than noise"
        for entry in (result.residual_structure or ())[:most]
    ]


def bias_lines(result: Diagnosis) -> list[str]:
    """The gyros' mean at rest that was taken out."""
    if result.bias_at_rest is None:
        return []
    shown = ", ".join(digits(math.degrees(value), 4) for value in result.bias_at_rest.radps)
    text = f"gyro bias at rest, taken out: {shown} deg/s"
    if result.bias_at_rest.rms_if_left_in_arcmin is not None:
        text += f"; left in it would make the errors {digits(result.bias_at_rest.rms_if_left_in_arcmin)} arcmin rms"
    return [text]


def _length_lines(result: Diagnosis) -> list[str]:
    """What each length of windows or moves says, and the order in which effects help."""

    def order_text(order: OrderOfEffects) -> str:
        steps = [f"{step.effect} {digits(step.held_out_rms_arcmin)}" for step in order.steps]
        helped = f", by order of help: {', '.join(steps)}" if steps else ", nothing helps"
        return f"left out {digits(order.held_out_rms_arcmin)}{helped}"

    said, lengths = [], result.lengths or ()
    for length in lengths:
        text = (
            f"over {length.over} ({length.pieces} pieces): rms {digits(length.rms_arcmin)} arcmin, largest "
            f"{upwards(length.max_arcmin, 3)}, bound {upwards(length.noise_bound_arcmin, 3)}, "
            f"radius {residual(length.radius)}"
        )
        said.append(text if length.order is None else f"{text}; {order_text(length.order)}")
        if length.order_as_measured is not None:
            said.append(f"  with the bias at rest left in: {order_text(length.order_as_measured)}")
    if result.order_stable is not None and len(lengths) > 1:
        stable = "the same at every length" if result.order_stable else "not stable over the lengths"
        said.append(f"the order of the effects is {stable}")
    raw = [length.order_as_measured for length in lengths if length.order_as_measured is not None]
    if len(raw) > 1:
        said.append(f"with the bias at rest left in it is {'the same' if is_stable(raw) else 'not stable'}")
    return said


def _why_lines(result: Diagnosis) -> list[str]:
    """Why nothing is named in a record that the simulation explains."""
    if result.verdict != "consistent":
        return []
    said = [
        "no effect is named: with the block's own parameters every error stays within the noise, so nothing more is "
        "supported"
    ]
    excluded = result.excluded or ()
    if excluded:
        said.append(f"{len({(e['effect'], e['where']) for e in excluded})} effects are bounded by the record:")
    for e in excluded:
        if e["where"] in ("gyro-block", "attitude-computer"):
            said.append(f"  {e['effect']} {e['parameter']} below {upwards(e['above'])} {unit_of(e['unit'])}".rstrip())
    if result.cannot_be_seen:
        names = dict.fromkeys(place.effect for place in result.cannot_be_seen)
        said.append(f"this record cannot show: {', '.join(names)}")
    return said


# The page


def page(result: Diagnosis, record: PositionRecord | None = None) -> Page:
    """Verdict, cause, gain and residuals; record (given where it is one of positions), model, evidence, what next."""
    named = result.causes if result.verdict == "explained" else ()
    if of_bench(result):
        assert record is not None
        name, nominal = record.path.name, result.evidence.calibration
        values = bench.calibrated_values(nominal)
        # With the effects that were found.
        after = {t["symbol"]: (t["after"], half_width(t["low"], t["high"])) for t in result.targets or ()}
        values |= {symbol: value for symbol, value in after.items() if symbol in values}
        first = [bench.measured_section(record, nominal), bench.bench_section(nominal, values, named)]
        key = bench.key_figures(nominal)
        if result.findings:
            key |= {f"with {evidence.first_words(result)}": f"{residual(result.findings[0].fit.radius)} σ"}
        shuffled = result.witness is not None and result.witness.shuffles
        rests_on = bench.provenance(nominal, {"seed of the shuffles": len(record)} if shuffled else {})
    else:
        name, own = result.evidence.found.record.path.name, result.baseline.parameters or ()
        # Where gravity is the reference the accelerometers stand among the block's own parameters, better known.
        forces = not any(p.name.startswith("accelerometer") for p in own)
        first = record_sections(result.evidence.found, result.warnings, forces=forces, told=bool(result.missing))
        first += [carried_section(result)] if result.evidence.parts else []
        key, rests_on = _key_of_carried(result), _provenance_of_carried(result)
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


def _key_of_carried(result: Diagnosis) -> dict[str, object]:
    """What stands below the verdict."""
    key: dict[str, object] = {"rows": len(result.evidence.found.record), "reference": result.reference}
    if result.baseline.radius is None or result.noise_bound_arcmin is None:
        return key
    key |= {f"bound, {evidence.quoted_words(result)}": f"{upwards(result.noise_bound_arcmin, 3)} arcmin"}
    key |= {"largest error": f"{residual(result.baseline.radius)} of its bound"}
    if result.extended is not None:
        key[f"with {evidence.first_words(result)}"] = residual(result.extended.radius)
    return key


def _provenance_of_carried(result: Diagnosis) -> dict[str, object]:
    """What the result rests on: record, options, versions, seeds."""
    record = result.evidence.found.record
    given: dict[str, object] = {"record": record.path.name, "record, SHA-256": record.sha256}
    given |= {"reference": result.reference, "gravity": f"{exactly(result.evidence.found.gravity)} m/s²"}
    given["model"] = f"{result.baseline_model} block"
    if record.rate is not None:
        given["a rate in the record is"] = result.evidence.rates
    if result.noise_bound_from:
        given["bounds from"] = result.noise_bound_from
    if witnesses.witnesses_of(result):
        given["seed of the shuffles"] = sum(part.error.size for part in result.evidence.parts)
    return given | versions()


def _errors(result: Diagnosis) -> list[Section]:
    """Residuals of readings, or errors of pieces, with their pictures; the first is over the record."""
    if of_bench(result):
        return evidence.residual_sections(result)
    bias = list(map(sentence, bias_lines(result)))
    return evidence.error_sections(result, bias) if result.evidence.parts else []


def answer_of(result: Diagnosis, files: list[Path] | None = None) -> list[Section]:
    """The cause with its size, what it gains, and the residuals; `files` belong to the cause."""
    told = [cause_section(result, files or []), gain_section(result), *_errors(result)[:1]]
    return [section for section in told if section is not None]


def sections_of(result: Diagnosis) -> list[Section]:
    """What stands behind the answer: further pictures of residuals, evidence, what is excluded, what is next."""
    if of_bench(result):
        values = evidence.target_section(result) or calibration.target_section(result.evidence.calibration)
        proof = bench.proof_section(result.evidence.calibration, result.evidence.numbers)
        after = bench.next_section(result.evidence.calibration.linearised, result.next_positions or ())
    else:
        values, proof = evidence.parameter_section(result), None
        after = Section("What to measure next", list(map(sentence, result.next))) if result.next else None
    told = [
        *_errors(result)[1:],
        hypothesis_section(result),
        beyond.level_section(result),
        values,
        proof,
        evidence.ranking_section(result),
        evidence.confusion_section(result),
        evidence.length_section(result),
        witnesses.judgement_section(result),
        evidence.structure_section(result),
        *evidence.excluded_sections(result),
        evidence.power_section(result),
        after,
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
        said.append(sentence(f"{evidence.nothing_tells(result)} could tell it from: {', '.join(same)}"))
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
    own = result.witness
    if of_bench(result):
        first = bench.calibration_sources(result.evidence.calibration)
        shuffled, left_out = own and own.shuffles, own and (own.folds or own.blocks)
        gained = result.gain
    else:
        found, carried = result.evidence.found, bool(result.evidence.parts)
        norm = found.accelerometers is not None and found.accelerometers.least_squares is not None
        first = cited(norm and "norm", found.gyros is not None and "allan")
        first += cited("gyros", "attitude", "simplex", result.tried and "chebyshev") if carried else []
        shuffled = left_out = result.judgement
        gained = carried
    return [
        *first,
        *cited(
            result.tried and "lawson",
            len(result.tried) > 1 and "angles",
            shuffled and "shuffles",
            left_out and "left-out",
            gained and "fmi",
        ),
    ]


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
