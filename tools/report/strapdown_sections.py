"""Sections of the page of a strapdown record: errors, causes, lengths, gain, what was left out, parameters."""

import math

from numpy.typing import NDArray

from ...models.effects import CATALOGUE
from ..diagnosis.result import Diagnosis
from .bars import Bar, bars
from .cells import Cell, Written
from .judgement_sections import MOST_BARS, shares
from .page import Section, Table
from .rounding import minus, outwards, significant, to_bound, unit_text
from .strapdown_model import effect_lines, own_words
from .strapdown_pictures import errors_over_quantities, errors_over_time, gain_picture, order_picture
from .strapdown_text import bias_lines, parameters_of, sentence_of, sets_of, witnesses_of


def quoted_words(result: Diagnosis) -> str:
    """The pieces whose errors are quoted."""
    part = result.evidence.parts[result.evidence.quoted]
    return "moves" if part.pieces.kind == "moves" else f"windows of {part.label}"


def left_of(result: Diagnosis) -> NDArray | None:
    """What the best set leaves of the quoted errors; None where nothing is named."""
    return result.evidence.split(result.findings[0].fit.left)[result.evidence.quoted] if result.causes else None


def error_sections(result: Diagnosis) -> list[Section]:
    """Errors over time, without the effects and with them, and over what they may depend on."""
    part = result.evidence.parts[result.evidence.quoted]
    time = result.evidence.found.record.time_s
    middle = 0.5 * (time[part.pieces.first] + time[part.pieces.last])
    after = left_of(result)
    what = quoted_words(result)
    carried = (
        "The simulation carries the direction of gravity from rest to rest"
        if result.reference == "gravity"
        else "The simulation carries the attitude over windows, and the true attitude says how far it is wrong"
    )
    radius = result.baseline.radius or 0.0
    least = f"Whatever the block's parameters, the largest error is at least {radius:.3g} of its bound"
    if result.bias_at_rest is not None:
        least = f"The largest error of the block as delivered is {radius:.3g} of its bound"
    if result.causes:
        least += f"; with {' and '.join(cause.place.title for cause in result.causes)} it is "
        least += f"{result.extended.radius if result.extended else 0.0:.3g} of it"
    axes = "two axes across it" if part.error.shape[1] == 2 else "three axes"
    return [
        Section(
            "Errors before and after" if after is not None else "Errors",
            [
                f"{carried}: gyro compensation and attitude computer, two FMUs that the orchestrator feeds with the "
                f"record's increments. {least}.",
                f"The bounds come from {result.noise_bound_from}.",
                *(f"{line[0].upper()}{minus(line[1:])}." for line in bias_lines(result)),
            ],
            errors_over_time(middle, part.error, after, part.bound, what),
            f"Size of the error over each of the {what}. The line is the bound about each of {axes}: a size may be "
            f"{'√2' if part.error.shape[1] == 2 else '√3'} of it.",
        ),
        Section(
            "Errors against rate, turn and orientation",
            [],
            errors_over_quantities(result.evidence.quantities(), part.error, after),
            f"The same errors of the {what} against what they may depend on.",
        ),
    ]


def cause_section(result: Diagnosis) -> Section:
    """The causes, or the sets that remain."""
    named = result.verdict == "explained"
    rows: list[list[Cell]] = []
    for number, causes in enumerate(sets_of(result), start=1):
        for cause in causes:
            parameters = CATALOGUE[cause.place.effect].at(cause.place).parameters
            for parameter, value, (low, high) in zip(parameters, cause.values, cause.intervals, strict=True):
                half = 0.5 * (high - low)
                ends = outwards(low, high, half)
                row: list[Cell] = [cause.place.title, parameter.name, to_bound(value, half), *ends]
                rows.append([*([] if named else [number]), *row, unit_text(parameter.unit)])
    period = result.evidence.found.sampling.period
    told = []
    for number, causes in enumerate(sets_of(result), start=1):
        sentence = "; ".join(sentence_of(cause, period) for cause in causes)
        told.append(f"{sentence[0].upper()}{sentence[1:]}." if named else f"Set {number}: {sentence}.")
    same = [place.title for cause in result.causes for place in cause.alike]
    if same and named:
        told.append(f"Nothing in this record could tell it from: {', '.join(same)}.")
    if result.complete is False:
        told.append("The search was cut off: more sets of effects would bring every error within its bound.")
    header = [*([] if named else ["set"]), "effect", "parameter", "estimate", "low", "high", "unit"]
    shown = [] if named else [line for causes in sets_of(result) for line in effect_lines(causes)]
    return Section("The cause" if named else "Causes that remain", told, table=Table(header, rows), equations=shown)


def length_section(result: Diagnosis) -> Section:
    """What each length says, and the order of the effects."""
    header = ["over", "pieces", "bound [arcmin]", "rms [arcmin]", "largest [arcmin]", "over its bound",
              "smallest sets that stand"]  # fmt: skip
    rows: list[list[Cell]] = [
        [
            length.over,
            length.pieces,
            *(significant(value, 3) for value in (length.noise_bound_arcmin, length.rms_arcmin, length.max_arcmin)),
            significant(length.radius, 3),
            "; ".join(
                " + ".join(place.effect for place in places) or "none needed" for places in length.smallest_sets[:4]
            )
            or "none up to three effects",
        ]
        for length in result.lengths or ()
    ]
    orders = [(length.over, length.order) for length in result.lengths or () if length.order is not None]
    said = ["Each length of the pieces by itself, and what it needs."]
    if orders:
        said.append(
            "Parts of the record were left out in turn and predicted from the rest, with one more effect at a time: "
            "the one that helps most."
        )
    if result.order_stable is not None and len(orders) > 1:
        said.append(
            "The order is the same at every length."
            if result.order_stable
            else "The order is not stable: it differs between the lengths."
        )
    return Section(
        "Length by length",
        said,
        order_picture(orders) if orders else None,
        "What is left of the errors that were left out, effect after effect." if orders else "",
        Table(header, rows),
    )


def gain_section(result: Diagnosis) -> Section:
    """Errors of pieces that were not used."""
    assert result.gain is not None
    summary = result.gain.to_json()
    figures = ("held_out_rms_before", "held_out_rms_after", "held_out_max_before", "held_out_max_after")
    rows: list[list[Cell]] = [
        [row["over"], row["pieces"], *(significant(row[figure], 3) for figure in figures)]
        for row in [summary, *summary["others"]]
    ]
    times = ["rms before [arcmin]", "rms after [arcmin]", "max before [arcmin]", "max after [arcmin]"]
    return Section(
        "The gain on parts of the record that were not used",
        [
            "The extended components were exported as FMUs, with parameters from the other parts of the record, and "
            f"run by the orchestrator. Over {summary['over']} the root mean square error falls from "
            f"{summary[figures[0]]:.3g} to {summary[figures[1]]:.3g} arcmin."
        ],
        gain_picture(result.gain.before, result.gain.after, summary["over"]),
        "Part of the pieces whose error is at most so large.",
        Table(["over", "pieces", *times], rows),
    )


def witness_section(result: Diagnosis) -> Section:
    """What was left out says of each effect, and why effects are not named."""
    rows: list[list[Cell]] = [
        [
            w.title,
            significant(w.rms_without, 3),
            significant(w.rms_with, 3),
            Written(f"{w.shuffles.as_good} of {w.shuffles.tried}"),
        ]
        for w in witnesses_of(result)
    ]
    said = [
        "Parts of the record were left out in turn and predicted from the rest, without an effect and with it; then "
        "its signature was shuffled over the pieces. This is a second witness: an effect that does not help, or whose "
        "shuffles do as well, is not named."
    ]
    said += [f"Not named: {text}." for text in result.not_named or ()]
    header = ["effect", "rms over the bound without it", "with it", "shuffles that do as well"]
    return Section("Left out, and shuffled", said, table=Table(header, rows) if rows else None)


def structure_section(result: Diagnosis) -> Section:
    """What an unexplained error depends on."""
    shown = (result.residual_structure or ())[:MOST_BARS]
    return Section(
        "What the error depends on",
        [
            "How much of the error about each axis a smooth function of one quantity predicts at pieces that were left "
            "out; the band is what is more than noise within its bound."
        ],
        shares([dict(entry) for entry in shown], "axis"),
        "Part of the error's sum of squares that is predicted.",
    )


def next_section(result: Diagnosis) -> Section:
    """What to add to the record so that the sets can be told apart."""
    return Section("What to measure next", [f"{text[0].upper()}{text[1:]}." for text in result.next or ()])


def parameter_section(result: Diagnosis) -> Section:
    """The block's own parameters, each with its interval drawn."""
    bounded = all(p.low is not None and p.high is not None for p in parameters_of(result))
    drawn = interval_bars(result) if bounded else [None] * len(parameters_of(result))
    rows: list[list[Cell]] = []
    for p, bar in zip(parameters_of(result), drawn, strict=True):
        half = None if p.low is None or p.high is None else 0.5 * (p.high - p.low)
        ends = [bar, *outwards(p.low, p.high, half)] if bounded else []
        rows.append([own_words(p.name), to_bound(p.estimate, half), *ends, unit_text(p.unit)])
    said = "They belong to any block of this kind and are no effects."
    if not bounded:
        said += " The estimates are those of a block that the record contradicts: no interval is given."
    header = ["parameter", "estimate", *(["interval", "low", "high"] if bounded else []), "unit"]
    caption = "What the record leaves possible, drawn about the estimate: one scale for all of one unit."
    return Section("The block's own parameters", [said], table=Table(header, rows, caption if bounded else ""))


def interval_bars(result: Diagnosis) -> list[Cell]:
    """The intervals about their estimates, those of one unit on one scale."""
    found: list[Cell] = [None] * len(parameters_of(result))
    for unit in dict.fromkeys(p.unit for p in parameters_of(result)):
        at = [k for k, p in enumerate(parameters_of(result)) if p.unit == unit]
        ends = [(p.low, p.high, p.estimate) for p in (parameters_of(result)[k] for k in at)]
        widest = max((0.5 * (high - low) for low, high, _ in ends if low is not None and high is not None), default=0.0)
        if not widest > 0.0 or not math.isfinite(widest):
            continue
        drawn, _ = bars([Bar(None, *(over(end, middle, widest) for end in pair)) for *pair, middle in ends])
        for k, bar in zip(at, drawn, strict=True):
            found[k] = bar
    return found


def over(end: float | None, middle: float, scale: float) -> float | None:
    """An end less the estimate, in units of the scale."""
    return None if end is None else (end - middle) / scale
