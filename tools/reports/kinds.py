"""What a diagnosis shows of its record: of rests on a table, whole benches among them, and of blocks that are carried.

Whatever the record, the same is asked; what kind of evidence it is, is looked up here alone.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from ..diagnosis.cause import Cause
from ..diagnosis.helps import is_stable
from ..diagnosis.result import Diagnosis, OrderOfEffects
from ..diagnosis.witness import Witness
from ..document.blocks import Section
from ..document.notation import half_width, sentence, unit_of
from ..evidence.bench import Bench
from ..evidence.carried_run import CarriedRecord
from ..evidence.evidence import Evidence
from ..motion.norm import norm_values
from ..records import PositionRecord
from ..rounding import digits, exactly, interval, residual, upwards
from . import bench, calibration, evidence, witnesses
from .inspection import carried_section, record_sections
from .makers import cited, versions
from .verdict import MOST_SETS, sentence_of, sets_of

Told = dict[str, object]


@dataclass(frozen=True)
class Kind:
    """What a page and lines have of one kind of record.

    `lines`: evidence and causes; `record`: its name, what was measured and the model, what stands below the verdict,
    what all rests on; `errors`: residuals, the first over the record; `values`: what is fitted, and what proves it
    false; `sources`.
    """

    lines: Callable[[Diagnosis], list[str]]
    record: Callable[[Diagnosis, PositionRecord | None], tuple[str, list[Section], Told, Told]]
    errors: Callable[[Diagnosis], list[Section]]
    values: Callable[[Diagnosis], list[Section | None]]
    sources: Callable[[Diagnosis], list[str]]


def kind_of(result: Diagnosis) -> Kind:
    """What shows the record of a diagnosis."""
    return next(KINDS[kind] for kind in type(result.evidence).__mro__ if kind in KINDS)


def _cause_lines(cause: Cause, result: Diagnosis) -> list[str]:
    """A cause with its parameters."""
    said = [f"cause: {cause.place.title}: {sentence_of(cause, result)}"]
    for parameter, value, (low, high) in zip(cause.parameters, cause.values, cause.intervals, strict=True):
        shown, *ends = interval(value, low, high)
        text = f"  {parameter.name} {shown}, within [{', '.join(ends)}] {unit_of(parameter.unit)}"
        said.append(text.rstrip())
    return said + [f"  cannot be told from {other.title} by {result.evidence.told_by}" for other in cause.alike]


def _structure_lines(result: Diagnosis, what: str, most: int) -> list[str]:
    return [
        f"{what} {entry.get('accelerometer', entry.get('axis'))}: {digits(100 * entry['explained'])} % of it is "
        f"predicted by {entry['on']}; {digits(100 * entry['explainable'])} % is more than noise"
        for entry in (result.residual_structure or ())[:most]
    ]


def _bench_lines(result: Diagnosis) -> list[str]:
    """What the readings say, and for a whole bench the turns."""
    nominal = result.evidence.calibration
    said = [
        f"{nominal.positions} positions, {nominal.measurements} readings, σ = {upwards(nominal.noise_bound, 3)} g "
        f"({nominal.sigma.basis}); nominal model: radius {residual(nominal.radius)}",
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


def _bench_record(result: Diagnosis, record: PositionRecord | None) -> tuple[str, list[Section], Told, Told]:
    """The positions, and the calibration with the effects that were found."""
    assert record is not None
    named = result.causes if result.verdict == "explained" else ()
    nominal = result.evidence.calibration
    values = bench.calibrated_values(nominal)
    after = {t["symbol"]: (t["after"], half_width(t["low"], t["high"])) for t in result.targets or ()}
    values |= {symbol: value for symbol, value in after.items() if symbol in values}
    first = [bench.measured_section(record, nominal), bench.bench_section(nominal, values, named)]
    key = bench.key_figures(nominal)
    if result.findings:
        key |= {f"with {evidence.first_words(result)}": f"{residual(result.findings[0].fit.radius)} σ"}
    shuffled = result.witness is not None and result.witness.shuffles
    return (
        record.path.name,
        first,
        key,
        bench.provenance(nominal, {"seed of the shuffles": len(record)} if shuffled else {}),
    )


def _bench_values(result: Diagnosis) -> list[Section | None]:
    nominal = result.evidence.calibration
    values = evidence.target_section(result) or calibration.target_section(nominal)
    return [values, bench.proof_section(nominal, result.evidence.numbers)]


def _carried_lines(result: Diagnosis) -> list[str]:
    """What the simulation misses over each length, and why nothing is named."""
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


def _carried_record(result: Diagnosis, record: PositionRecord | None) -> tuple[str, list[Section], Told, Told]:
    """The record as it was inspected, and what carries the attitude."""
    own = result.baseline.parameters or ()
    # Where gravity is the reference the accelerometers stand among the block's own parameters, better known.
    forces = not any(p.name.startswith("accelerometer") for p in own)
    first = record_sections(result.evidence.found, result.warnings, forces=forces, told=bool(result.missing))
    first += [carried_section(result)] if result.evidence.parts else []
    return result.evidence.found.record.path.name, first, _key_of_carried(result), _provenance_of_carried(result)


def _carried_errors(result: Diagnosis) -> list[Section]:
    bias = list(map(sentence, bias_lines(result)))
    return evidence.error_sections(result, bias) if result.evidence.parts else []


def _carried_sources(result: Diagnosis) -> list[str]:
    found, carried = result.evidence.found, bool(result.evidence.parts)
    norm = norm_values(found.accelerometers) is not None
    first = cited(norm and "norm", found.gyros is not None and "allan")
    return first + cited("gyros", "attitude", "simplex", result.tried and "chebyshev", "fmi") if carried else first


KINDS: dict[type[Evidence], Kind] = {
    Bench: Kind(
        _bench_lines,
        _bench_record,
        evidence.residual_sections,
        _bench_values,
        lambda result: bench.calibration_sources(result.evidence.calibration),
    ),
    CarriedRecord: Kind(
        _carried_lines,
        _carried_record,
        _carried_errors,
        lambda result: [evidence.parameter_section(result)],
        _carried_sources,
    ),
}
"""By the evidence of a record, what shows it."""
