"""What the diagnosis of a strapdown record says: page."""

import math
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ...models.effects import CATALOGUE
from ..diagnosis.result import Cause, Diagnosis, OrderOfEffects
from ..diagnosis.search import compared_places, is_stable, likeness
from ..document.blocks import Page, Section, Table, Tone
from ..document.numbers import Bar, Cell, Written, bars, minus, outwards, significant, to_bound, unit_text
from ..files import write_text
from .evidence import ALIKE, CONFUSION, MOST_BARS, MOST_RANKED, how_many_mend, shares, unrepeated
from .excluded import carried_excluded_sections
from .model import carried_model_section, effect_lines, own_words
from .pictures.rankings import likeness_picture
from .pictures.residuals import candidates
from .pictures.time import errors_over_quantities, errors_over_time, gain_picture, order_picture
from .record import measured_sections, strapdown_sources, versions
from .words import parameters_of, sentence_of, sets_of, witnesses_of

TONES: dict[str, Tone] = {"consistent": "good", "explained": "good"}
FEW_RIVALS = 3
"""Up to so many sets of effects are named in the verdict."""


def strapdown_page(result: Diagnosis) -> Page:
    """The page as HTML: verdict, record, model, errors, causes, evidence, gain, what is excluded, what next."""
    return Page(
        f"Diagnosis of {result.evidence.found.record.path.name}",
        verdict_sentence(result),
        strapdown_sections(result),
        tone=TONES.get(result.verdict, "attention"),
        key=key_figures(result),
        provenance=provenance(result),
        sources=strapdown_sources(result),
    )


def verdict_sentence(result: Diagnosis) -> str:
    """The verdict, with the causes when they are named."""
    period = result.evidence.found.sampling.period
    if result.verdict == "explained":
        return f"The simulation lacked this: {'; '.join(sentence_of(cause, period) for cause in result.causes)}."
    if result.verdict == "ambiguous":
        titles = [" and ".join(cause.place.title for cause in causes) for causes in sets_of(result)]
        few = result.complete is not False and len(titles) <= FEW_RIVALS
        rivals = " or ".join(titles) if few else f"{len(titles)} and more sets of effects"
        return f"The simulation lacks something, and the record does not say what: {rivals} would explain it."
    if result.verdict == "unexplained":
        radius = result.baseline.radius or 0.0
        said = f"The simulation lacks something: its largest error is {radius:.3g} times its bound, "
        return (
            said + ("and " + result.not_named[0] if result.not_named else "and nothing in the catalogue mends it") + "."
        )
    if result.verdict == "insufficient" and result.missing:
        return f"Too little was measured to judge the simulation. To add: {'; '.join(map(str, result.missing))}."
    if result.verdict == "consistent" and result.baseline.radius is not None:
        return (
            "Consistent: the simulation explains the record within its noise; no error is more than "
            f"{result.baseline.radius:.2g} of its bound, and no effect is named."
        )
    return VERDICTS[result.verdict].capitalize() + "."


def key_figures(result: Diagnosis) -> dict[str, object]:
    """What stands below the verdict."""
    key: dict[str, object] = {"rows": len(result.evidence.found.record), "reference": result.reference}
    if result.baseline.radius is None or result.noise_bound_arcmin is None:
        return key
    key |= {f"bound, {quoted_words(result)}": f"{result.noise_bound_arcmin:.3g} arcmin"}
    key |= {"largest error": f"{result.baseline.radius:.3g} of its bound"}
    if result.causes and result.extended is not None:
        key |= {"with the effect" if len(result.causes) == 1 else "with the effects": f"{result.extended.radius:.3g}"}
    return key


def strapdown_sections(result: Diagnosis) -> list[Section]:
    """Every section that the result has something for."""
    sections = measured_sections(result)
    if result.evidence.parts:
        sections += [carried_model_section(result), *error_sections(result)]
    if result.causes:
        sections.append(cause_section(result))
    if parameters_of(result):
        sections.append(parameter_section(result))
    sections += [*ranking_sections(result), *confusion_sections(result)]
    if result.lengths or ():
        sections.append(length_section(result))
    if result.gain is not None:
        sections.append(gain_section(result))
    if witnesses_of(result) or result.not_named:
        sections.append(witness_section(result))
    if result.residual_structure or ():
        sections.append(structure_section(result))
    sections += carried_excluded_sections(result)
    if result.next or ():
        sections.append(next_section(result))
    return sections


def ranking_sections(result: Diagnosis) -> list[Section]:
    """What each effect by itself would leave; a section, or none."""
    if not result.tried:
        return []
    shown = result.tried[:MOST_RANKED]
    return [
        Section(
            "Evidence: which effect mends it",
            [
                f"Each of the {len(result.tried)} effects that this record can show was added to the simulation in "
                f"turn. At or below one every error is within its bound. {how_many_mend(result.tried)}"
            ],
            candidates([title for title, _ in shown], [radius for _, radius in shown], "largest error over its bound"),
            f"Least largest error that each effect leaves, over its bound; the best {len(shown)}.",
        )
    ]


def confusion_sections(result: Diagnosis) -> list[Section]:
    """What could be taken for what in this record, and the classes; a section, or none."""
    if not result.tried:
        return []
    sets, ranked = [finding.fit.places for finding in result.findings], [title for title, _ in result.tried]
    compared = compared_places(result.evidence.classes.places, sets, ranked)
    if len(compared) < 2:
        return []
    rows: list[list[Cell]] = [
        [cause.place.title, ", ".join(place.title for place in cause.alike)]
        for finding in result.findings
        for cause in finding.causes
        if cause.equivalents
    ]
    imitated = ", beyond what the block's own parameters imitate" if parameters_of(result) else ""
    said = [ALIKE.format(f"in this record{imitated}")]
    if result.causes and not rows:
        said.append("What was found is alone in its class: this record tells it from every other effect.")
    return [
        Section(
            CONFUSION,
            said,
            likeness_picture([place.title for place in compared], likeness(result.evidence, compared)),
            "Cosine of the least angle between what two effects add to the errors.",
            Table(["effect", "nothing in this record tells it from"], unrepeated(rows)) if rows else None,
        )
    ]


def provenance(result: Diagnosis) -> dict[str, object]:
    """What the result rests on: record, options, versions, seeds."""
    record = result.evidence.found.record
    given: dict[str, object] = {"record": record.path.name, "record, SHA-256": record.sha256}
    given |= {"reference": result.reference, "gravity": f"{result.evidence.found.gravity:.8g} m/s²"}
    given["model"] = f"{result.baseline_model} block"
    if record.rate is not None:
        given["a rate in the record is"] = result.evidence.rates
    if result.noise_bound_from:
        given["bounds from"] = result.noise_bound_from
    if witnesses_of(result):
        given["seed of the shuffles"] = sum(part.error.size for part in result.evidence.parts)
    return given | versions()


def pictures(result: Diagnosis) -> dict[str, str]:
    """The page's pictures by name, for other documents: name -> SVG."""
    part = result.evidence.parts[result.evidence.quoted]
    time = result.evidence.found.record.time_s
    middle = 0.5 * (time[part.pieces.first] + time[part.pieces.last])
    after = left_of(result)
    found = {
        "time": errors_over_time(np.asarray(middle), part.error, after, part.bound, quoted_words(result)),
        "quantities": errors_over_quantities(result.evidence.quantities(), part.error, after),
    }
    orders = [(length.over, length.order) for length in result.lengths or () if length.order is not None]
    if orders:
        found["order"] = order_picture(orders)
    if result.gain is not None:
        found["gain"] = gain_picture(result.gain.before, result.gain.after, result.gain.to_json()["over"])
    return found


def write_pictures(result: Diagnosis, folder: Path, stem: str) -> list[Path]:
    """Write the pictures as <stem>-<name>.svg into a folder."""
    written = []
    for name, svg in pictures(result).items():
        written.append(folder / f"{stem}-{name}.svg")
        write_text(written[-1], svg)
    return written


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


VERDICTS = {
    "consistent": "consistent: the simulation explains the record within its noise; no effect is named",
    "insufficient": "insufficient: the record cannot tell whether the simulation is wrong",
    "explained": "explained: a smallest set of effects brings every error within its bound, and no other does",
    "ambiguous": "ambiguous: several sets of effects would bring every error within its bound",
    "unexplained": "unexplained: the simulation is falsified and nothing that can be named mends it",
}
MOST_LINES = 6


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
