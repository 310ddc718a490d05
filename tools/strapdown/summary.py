"""What `trihedron diagnose` prints of a strapdown record."""

import math
from typing import TYPE_CHECKING

from ...models.effects import CATALOGUE
from ..diagnosis.result import Cause
from ..evidence.gain import ARCMIN
from ..summaries import unit_of
from .judging import Order, is_stable

if TYPE_CHECKING:
    from polars import DataFrame

    from .result import StrapdownDiagnosis

VERDICTS = {
    "consistent": "consistent: the simulation explains the record within its noise; no effect is named",
    "insufficient": "insufficient: the record cannot tell whether the simulation is wrong",
    "explained": "explained: a smallest set of effects brings every error within its bound, and no other does",
    "ambiguous": "ambiguous: several sets of effects would bring every error within its bound",
    "unexplained": "unexplained: the simulation is falsified and nothing that can be named mends it",
}
MOST_LINES = 6


def diagnosis_lines(result: "StrapdownDiagnosis") -> list[str]:
    """Verdict, evidence, causes and gain."""
    lines = [VERDICTS[result.verdict]]
    lines += [f"to add: {text}" for text in result.missing]
    if result.radius is None or result.noise_bound is None:
        return lines + [f"warning: {text}" for text in result.warnings]
    lines.append(
        f"reference {result.reference}, {result.baseline} block; bound {result.noise_bound / ARCMIN:.3g} arcmin "
        f"({result.noise_bound_from}); radius {result.radius:.3f}"
    )
    lines += bias_lines(result)
    for number, causes in enumerate(result.candidates[:MOST_LINES] if result.causes else ()):
        if number:
            lines.append("or")
        for cause in causes:
            lines += cause_lines(cause, result.inspection.sampling.period)
    if result.causes:
        what = "the first set" if len(result.candidates) > 1 else "it" if len(result.causes) == 1 else "them"
        lines.append(f"radius with {what} {result.extended_radius:.3f}")
    if len(result.candidates) > MOST_LINES:
        lines.append(f"... and {len(result.candidates) - MOST_LINES} sets more")
    lines += length_lines(result)
    lines += gain_lines(result)
    lines += [
        f"left out: rms {w.without:.2f} -> {w.with_it:.2f} of the bound by {w.place.title}; as good when shuffled: "
        f"{w.as_good} of {w.shuffles}"
        for w in result.witnesses
    ]
    lines += [f"not named: {text}" for text in result.objections]
    lines += why_lines(result)
    for entry in result.residual_structure[:4]:
        lines.append(
            f"error about axis {entry['axis']}: {100 * entry['explained']:.0f} % of it is predicted by {entry['on']}; "
            f"{100 * entry['explainable']:.0f} % is more than noise"
        )
    lines += [f"measure next: {text}" for text in result.separate]
    return lines + [f"warning: {text}" for text in result.warnings]


def bias_lines(result: "StrapdownDiagnosis") -> list[str]:
    """The mean at rest that was taken out."""
    if result.bias_at_rest is None:
        return []
    shown = ", ".join(f"{math.degrees(value):+.4f}" for value in result.bias_at_rest)
    text = f"gyro bias at rest, taken out: {shown} deg/s"
    if result.bias_left_in is not None:
        text += f"; left in it would make the errors {result.bias_left_in / ARCMIN:.3g} arcmin rms"
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
        text = f"  {parameter.name} {value:+.4e}, within [{low:+.4e}, {high:+.4e}] {unit_of(parameter.unit)}"
        lines.append(text.rstrip())
    return lines + [f"  cannot be told in this record from {other.title}" for other in cause.equivalents]


def length_lines(result: "StrapdownDiagnosis") -> list[str]:
    """What each length of windows or moves says."""
    lines = []
    for length in result.lengths:
        text = (
            f"over {length.label} ({length.pieces} pieces): rms {length.rms / ARCMIN:.3g} arcmin, largest "
            f"{length.largest / ARCMIN:.3g}, bound {length.bound / ARCMIN:.3g}, radius {length.radius:.3g}"
        )
        if length.order is not None:
            text += f"; {order_text(length.order)}"
        lines.append(text)
        if length.as_measured is not None:
            lines.append(f"  with the bias at rest left in: {order_text(length.as_measured)}")
    if result.order_stable is not None and len(result.lengths) > 1:
        lines.append(
            "the order of the effects is the same at every length"
            if result.order_stable
            else "the order of the effects is not stable over the lengths"
        )
    raw = [length.as_measured for length in result.lengths if length.as_measured is not None]
    if len(raw) > 1:
        lines.append(f"with the bias at rest left in it is {'the same' if is_stable(raw) else 'not stable'}")
    return lines


def order_text(order: Order) -> str:
    """Errors that were left out, effect after effect."""
    steps = [f"{place.effect} {left / ARCMIN:.3g}" for place, left in order.steps]
    helped = f", by order of help: {', '.join(steps)}" if steps else ", nothing helps"
    return f"left out {order.start / ARCMIN:.3g}{helped}"


def gain_lines(result: "StrapdownDiagnosis") -> list[str]:
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


def why_lines(result: "StrapdownDiagnosis") -> list[str]:
    """Why nothing is named in a record that the simulation explains."""
    if result.verdict != "consistent":
        return []
    lines = [
        "no effect is named: with the block's own parameters every error stays within the noise, so nothing more is "
        "supported"
    ]
    if result.excluded:
        lines.append(f"{len({(e['effect'], e['where']) for e in result.excluded})} effects are bounded by the record:")
        shown = [e for e in result.excluded if e["where"] in ("gyro-block", "attitude-computer")]
        below = (f"  {e['effect']} {e['parameter']} below {e['above']:.2g} {unit_of(e['unit'])}" for e in shown)
        lines += [text.rstrip() for text in below]
    if result.not_seen:
        names = dict.fromkeys(place.effect for place in result.not_seen)
        lines.append(f"this record cannot show: {', '.join(names)}")
    return lines


def causes_table(result: "StrapdownDiagnosis") -> "DataFrame":
    """Causes and their parameters."""
    import polars as pl

    rows = [
        (cause.place.effect, cause.place.where, parameter.name, parameter.unit, value, low, high)
        for causes in (result.candidates if result.causes else ())
        for cause in causes
        for parameter, value, (low, high) in zip(
            CATALOGUE[cause.place.effect].at(cause.place).parameters, cause.values, cause.intervals, strict=True
        )
    ]
    header = ["effect", "where", "parameter", "unit", "estimate", "low", "high"]
    kinds = dict(zip(header, [pl.String] * 4 + [pl.Float64] * 3, strict=True))
    return pl.DataFrame([list(row) for row in rows], schema=kinds, orient="row")
