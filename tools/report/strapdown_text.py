"""What `trihedron diagnose` prints of a strapdown record."""

import math
from collections.abc import Sequence

from ...models.effects import CATALOGUE
from ..diagnosis.lengths import is_stable
from ..diagnosis.result import BaselineParameter, Cause, Diagnosis, EffectWitness, OrderOfEffects

VERDICTS = {
    "consistent": "consistent: the simulation explains the record within its noise; no effect is named",
    "insufficient": "insufficient: the record cannot tell whether the simulation is wrong",
    "explained": "explained: a smallest set of effects brings every error within its bound, and no other does",
    "ambiguous": "ambiguous: several sets of effects would bring every error within its bound",
    "unexplained": "unexplained: the simulation is falsified and nothing that can be named mends it",
}
MOST_LINES = 6


def sets_of(result: Diagnosis) -> Sequence[Sequence[Cause]]:
    """The sets that remain, the best first; one where a cause is named."""
    return (result.causes, *(result.alternatives or ())) if result.causes else ()


def parameters_of(result: Diagnosis) -> Sequence[BaselineParameter]:
    """The block's own parameters."""
    return result.baseline.parameters or ()


def witnesses_of(result: Diagnosis) -> Sequence[EffectWitness]:
    """What was left out says of each effect of the first set."""
    return result.judgement if isinstance(result.judgement, tuple) else ()


def diagnosis_lines(result: Diagnosis) -> list[str]:
    """Verdict, evidence, causes and gain."""
    lines = [VERDICTS[result.verdict]]
    lines += [f"to add: {text}" for text in result.missing or ()]
    if result.baseline.radius is None or result.noise_bound_arcmin is None:
        return lines + [f"warning: {text}" for text in result.warnings]
    lines.append(
        f"reference {result.reference}, {result.baseline_model} block; bound {result.noise_bound_arcmin:.3g} arcmin "
        f"({result.noise_bound_from}); radius {result.baseline.radius:.3f}"
    )
    lines += bias_lines(result)
    for number, causes in enumerate(sets_of(result)[:MOST_LINES] if result.causes else ()):
        if number:
            lines.append("or")
        for cause in causes:
            lines += cause_lines(cause, result.evidence.found.sampling.period)
    if result.causes and result.extended is not None:
        what = "the first set" if len(sets_of(result)) > 1 else "it" if len(result.causes) == 1 else "them"
        lines.append(f"radius with {what} {result.extended.radius:.3f}")
    if len(sets_of(result)) > MOST_LINES:
        lines.append(f"... and {len(sets_of(result)) - MOST_LINES} sets more")
    lines += length_lines(result)
    lines += gain_lines(result)
    lines += [
        f"left out: rms {w.rms_without:.2f} -> {w.rms_with:.2f} of the bound by {w.title}; as good when "
        f"shuffled: {w.shuffles.as_good} of {w.shuffles.tried}"
        for w in witnesses_of(result)
    ]
    lines += [f"not named: {text}" for text in result.not_named or ()]
    lines += why_lines(result)
    for entry in (result.residual_structure or ())[:4]:
        lines.append(
            f"error about axis {entry.get('axis')}: {100 * entry['explained']:.0f} % of it is predicted by "
            f"{entry['on']}; {100 * entry['explainable']:.0f} % is more than noise"
        )
    lines += [f"measure next: {text}" for text in result.next or ()]
    return lines + [f"warning: {text}" for text in result.warnings]


def bias_lines(result: Diagnosis) -> list[str]:
    """The mean at rest that was taken out."""
    if result.bias_at_rest is None:
        return []
    shown = ", ".join(f"{math.degrees(value):+.4f}" for value in result.bias_at_rest.radps)
    text = f"gyro bias at rest, taken out: {shown} deg/s"
    if result.bias_at_rest.rms_if_left_in_arcmin is not None:
        text += f"; left in it would make the errors {result.bias_at_rest.rms_if_left_in_arcmin:.3g} arcmin rms"
    return [text]


def sentence_of(cause: Cause, period: float) -> str:
    """What an engineer is told; latency also in samples."""
    if cause.place.effect == "latency":
        return f"{cause.sentence}, {abs(cause.values[0]) / period:.2f} samples"
    return cause.sentence


def cause_lines(cause: Cause, period: float) -> list[str]:
    """A cause with its parameters."""
    lines = [f"cause: {cause.place.title}: {sentence_of(cause, period)}"]
    parameters = CATALOGUE[cause.place.effect].at(cause.place).parameters
    for parameter, value, (low, high) in zip(parameters, cause.values, cause.intervals, strict=True):
        text = f"  {parameter.name} {value:+.4e}, within [{low:+.4e}, {high:+.4e}] {_unit(parameter.unit)}"
        lines.append(text.rstrip())
    return lines + [f"  cannot be told in this record from {other.title}" for other in cause.alike]


def length_lines(result: Diagnosis) -> list[str]:
    """What each length of windows or moves says."""
    lines = []
    for length in result.lengths or ():
        text = (
            f"over {length.over} ({length.pieces} pieces): rms {length.rms_arcmin:.3g} arcmin, largest "
            f"{length.max_arcmin:.3g}, bound {length.noise_bound_arcmin:.3g}, radius {length.radius:.3g}"
        )
        if length.order is not None:
            text += f"; {order_text(length.order)}"
        lines.append(text)
        if length.order_as_measured is not None:
            lines.append(f"  with the bias at rest left in: {order_text(length.order_as_measured)}")
    if result.order_stable is not None and len(result.lengths or ()) > 1:
        lines.append(
            "the order of the effects is the same at every length"
            if result.order_stable
            else "the order of the effects is not stable over the lengths"
        )
    raw = [length.order_as_measured for length in result.lengths or () if length.order_as_measured is not None]
    if len(raw) > 1:
        lines.append(f"with the bias at rest left in it is {'the same' if is_stable(raw) else 'not stable'}")
    return lines


def order_text(order: OrderOfEffects) -> str:
    """Errors that were left out, effect after effect."""
    steps = [f"{step.effect} {step.held_out_rms_arcmin:.3g}" for step in order.steps]
    helped = f", by order of help: {', '.join(steps)}" if steps else ", nothing helps"
    return f"left out {order.held_out_rms_arcmin:.3g}{helped}"


def gain_lines(result: Diagnosis) -> list[str]:
    """Errors of pieces that were not used, before and after."""
    if result.gain is None:
        return []
    summary = result.gain.to_json()
    return [
        f"not used, simulated by the exported FMUs over {row['over']} ({row['pieces']} pieces): rms "
        f"{row['held_out_rms_before']:.3g} -> {row['held_out_rms_after']:.3g} arcmin, max "
        f"{row['held_out_max_before']:.3g} -> {row['held_out_max_after']:.3g}"
        for row in [summary, *summary["others"]]
    ]


def why_lines(result: Diagnosis) -> list[str]:
    """Why nothing is named in a record that the simulation explains."""
    if result.verdict != "consistent":
        return []
    lines = [
        "no effect is named: with the block's own parameters every error stays within the noise, so nothing more is "
        "supported"
    ]
    if result.excluded or ():
        lines.append(
            f"{len({(e['effect'], e['where']) for e in result.excluded or ()})} effects are bounded by the record:"
        )
        shown = [e for e in result.excluded or () if e["where"] in ("gyro-block", "attitude-computer")]
        below = (f"  {e['effect']} {e['parameter']} below {e['above']:.2g} {_unit(e['unit'])}" for e in shown)
        lines += [text.rstrip() for text in below]
    if result.cannot_be_seen or ():
        names = dict.fromkeys(place.effect for place in result.cannot_be_seen or ())
        lines.append(f"this record cannot show: {', '.join(names)}")
    return lines


def _unit(unit: str) -> str:
    """A unit behind a number: nothing for what has none."""
    return "" if unit == "1" else unit
