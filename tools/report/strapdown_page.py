"""The page of `trihedron diagnose` for a strapdown record."""

import math
from pathlib import Path

import numpy as np

from trihedron import __version__
from trihedron.models.effects import CATALOGUE
from trihedron.report.allan_pictures import allan_picture
from trihedron.report.judgement_sections import MOST_BARS
from trihedron.report.page import Section, Table, Tone, render_page
from trihedron.report.strapdown_pictures import (
    errors_over_quantities,
    errors_over_time,
    gain_picture,
    order_picture,
)
from trihedron.strapdown.gain import ARCMIN
from trihedron.strapdown.inspection import inspection_text
from trihedron.strapdown.result import StrapdownDiagnosis
from trihedron.strapdown.summary import VERDICTS, bias_lines, sentence_of

TONES: dict[str, Tone] = {"consistent": "good", "explained": "good"}


def strapdown_page(result: StrapdownDiagnosis) -> str:
    """The page as HTML: verdict, record, errors, causes, order, gain, what the record bounds."""
    record = result.inspection.record
    key: dict[str, object] = {"rows": len(record), "reference": result.reference, "baseline": result.baseline}
    if result.radius is not None and result.noise_bound is not None:
        key |= {"bound": f"{result.noise_bound / ARCMIN:.3g} arcmin", "radius": f"{result.radius:.3g}"}
    return render_page(
        f"Diagnosis of {record.path.name}",
        verdict_sentence(result),
        strapdown_sections(result),
        tone=TONES.get(result.verdict, "attention"),
        key=key,
        provenance={"trihedron": __version__, "record": record.sha256, "bounds from": result.noise_bound_from},
    )


def verdict_sentence(result: StrapdownDiagnosis) -> str:
    """The verdict, with the causes when they are named."""
    period = result.inspection.sampling.period
    if result.verdict == "explained":
        return f"The simulation lacked this: {'; '.join(sentence_of(cause, period) for cause in result.causes)}."
    if result.verdict == "insufficient" and result.missing:
        return f"Too little was measured to judge the simulation. To add: {'; '.join(result.missing)}."
    return VERDICTS[result.verdict].capitalize() + "."


def strapdown_sections(result: StrapdownDiagnosis) -> list[Section]:
    """Every section that the result has something for."""
    record = result.inspection.record
    sections = [
        Section(
            "What was measured",
            inspection_text(result.inspection).split("\n"),
            allan_picture(record, result.inspection.rests, result.inspection.sampling.period),
            "Allan deviation over the rests.",
        )
    ]
    if result.parts:
        sections += error_sections(result)
    if result.causes:
        sections.append(cause_section(result))
    if result.lengths:
        sections.append(length_section(result))
    if result.gain is not None:
        sections.append(gain_section(result))
    if result.witnesses or result.objections:
        sections.append(witness_section(result))
    if result.residual_structure:
        sections.append(structure_section(result))
    if result.separate:
        sections.append(Section("What to measure next", [f"{text}." for text in result.separate]))
    if result.parameters:
        sections.append(parameter_section(result))
    if result.excluded or result.not_seen:
        sections.append(excluded_section(result))
    return sections


def error_sections(result: StrapdownDiagnosis) -> list[Section]:
    """Errors over time and over what they may depend on."""
    part = result.parts[result.quoted]
    time = result.inspection.record.time_s
    middle = 0.5 * (time[part.segments.first] + time[part.segments.last])
    after = result.left[result.quoted] if result.causes else None
    what = "moves" if part.segments.kind == "moves" else f"windows of {part.label}"
    carried = (
        "The simulation carries the direction of gravity from rest to rest"
        if result.reference == "gravity"
        else "The simulation carries the attitude over windows, and the true attitude says how far it is wrong"
    )
    return [
        Section(
            "What the simulation gets wrong",
            [
                f"{carried}: gyro compensation and attitude computer, two FMUs that the orchestrator feeds with the "
                f"record's increments. Least possible largest error of the {result.baseline} block: "
                f"{result.radius or 0.0:.3g} of its bound.",
                f"The bounds come from {result.noise_bound_from}.",
                *(f"{line}." for line in bias_lines(result)),
            ],
            errors_over_time(middle, part.error, after, part.bound, what),
            f"Error over each of the {what}.",
        ),
        Section(
            "Against rate, orientation and temperature",
            [],
            errors_over_quantities(result.quantities, part.error, after),
            f"The same errors of the {what} against what they may depend on.",
        ),
    ]


def cause_section(result: StrapdownDiagnosis) -> Section:
    """The causes, or the sets that remain."""
    rows = [
        [number, cause.place.title, parameter.name, value, finite(low), finite(high), parameter.unit]
        for number, causes in enumerate(result.candidates, start=1)
        for cause in causes
        for parameter, value, (low, high) in zip(
            CATALOGUE[cause.place.effect].at(cause.place).parameters, cause.values, cause.intervals, strict=True
        )
    ]
    period = result.inspection.sampling.period
    told = [sentence_of(cause, period).capitalize() + "." for cause in result.causes]
    told.append(
        f"With {'it' if len(told) == 1 else 'them'} the largest error is {result.extended_radius:.3g} of its bound."
    )
    header = ["set", "effect", "parameter", "estimate", "low", "high", "unit"]
    title = "The causes" if result.verdict == "explained" else "Sets of effects that remain"
    return Section(title, told, table=Table(header, rows))


def length_section(result: StrapdownDiagnosis) -> Section:
    """What each length says, and the order of the effects."""
    header = [
        "over",
        "pieces",
        "bound [arcmin]",
        "rms [arcmin]",
        "largest [arcmin]",
        "radius",
        "smallest sets that stand",
    ]
    rows = [
        [
            length.label,
            length.pieces,
            length.bound / ARCMIN,
            length.rms / ARCMIN,
            length.largest / ARCMIN,
            length.radius,
            "; ".join(" + ".join(place.effect for place in places) or "none needed" for places in length.sets[:4])
            or "none up to three effects",
        ]
        for length in result.lengths
    ]
    orders = [length.order for length in result.lengths if length.order is not None]
    said = []
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


def gain_section(result: StrapdownDiagnosis) -> Section:
    """Errors of pieces that were not used."""
    assert result.gain is not None
    summary = result.gain.summary()
    rows = [
        [
            row["over"],
            row["pieces"],
            row["held_out_rms_before"],
            row["held_out_rms_after"],
            row["held_out_max_before"],
            row["held_out_max_after"],
        ]
        for row in [summary, *summary["others"]]
    ]
    header = ["over", "pieces", "rms before", "rms after", "max before", "max after"]
    return Section(
        "The gain on parts of the record that were not used",
        [
            "The extended components were exported as FMUs, with parameters from the other parts of the record, and "
            "run by the orchestrator. Errors in arcminutes."
        ],
        gain_picture(result.gain.before[0], result.gain.after[0], summary["over"]),
        "Part of the pieces whose error is at most so large.",
        Table(header, rows),
    )


def witness_section(result: StrapdownDiagnosis) -> Section:
    """What was left out says of each effect, and why effects are not named."""
    rows = [[w.place.title, w.without, w.with_it, f"{w.as_good} of {w.shuffles}"] for w in result.witnesses]
    header = ["effect", "rms without, of the bound", "rms with it", "as good when shuffled"]
    said = [f"Not named: {text}." for text in result.objections]
    return Section("Left out, and shuffled", said, table=Table(header, rows) if rows else None)


def structure_section(result: StrapdownDiagnosis) -> Section:
    """What an unexplained error depends on."""
    rows = [[e["axis"], e["on"], e["explained"], e["explainable"]] for e in result.residual_structure[:MOST_BARS]]
    return Section(
        "What the error depends on",
        ["How much of the error about each axis a smooth function of one quantity predicts where it was left out."],
        table=Table(["axis", "quantity", "predicted part", "more than noise"], rows),
    )


def parameter_section(result: StrapdownDiagnosis) -> Section:
    """The baseline's parameters."""
    rows = [[p.name, p.estimate, p.low, p.high, p.unit] for p in result.parameters]
    return Section(
        "The block's own parameters",
        ["They belong to any block of this kind and are no effects: estimates, and what the record leaves possible."],
        table=Table(["parameter", "estimate", "low", "high", "unit"], rows),
    )


def excluded_section(result: StrapdownDiagnosis) -> Section:
    """Sizes that contradict the record, and effects that it cannot show."""
    rows = [
        [
            f"{e['effect']} {e['where']}{''.join(f' {a}' for a in e.get('axes', ()))}",
            e["parameter"],
            e["above"],
            e["unit"],
        ]
        for e in result.excluded
    ]
    said = ["Larger sizes of these effects contradict the record."] if rows else []
    if result.not_seen:
        names = dict.fromkeys(place.effect for place in result.not_seen)
        said.append(f"This record could show at no possible size, and they were not searched: {', '.join(names)}.")
    table = Table(["effect", "parameter", "excluded above", "unit"], rows) if rows else None
    return Section("What the record excludes", said, table=table)


def finite(value: float) -> float | None:
    """The value, or None where it is not bounded."""
    return value if math.isfinite(value) else None


def pictures(result: StrapdownDiagnosis) -> dict[str, str]:
    """The page's pictures by name, for other documents: name -> SVG."""
    part = result.parts[result.quoted]
    time = result.inspection.record.time_s
    middle = 0.5 * (time[part.segments.first] + time[part.segments.last])
    after = result.left[result.quoted] if result.causes else None
    what = "moves" if part.segments.kind == "moves" else f"windows of {part.label}"
    found = {
        "time": errors_over_time(np.asarray(middle), part.error, after, part.bound, what),
        "quantities": errors_over_quantities(result.quantities, part.error, after),
    }
    orders = [length.order for length in result.lengths if length.order is not None]
    if orders:
        found["order"] = order_picture(orders)
    if result.gain is not None:
        found["gain"] = gain_picture(result.gain.before[0], result.gain.after[0], result.gain.summary()["over"])
    return found


def write_pictures(result: StrapdownDiagnosis, folder: Path, stem: str) -> list[Path]:
    """Write the pictures as <stem>-<name>.svg into a folder."""
    from trihedron.writing import write_text

    written = []
    for name, svg in pictures(result).items():
        written.append(folder / f"{stem}-{name}.svg")
        write_text(written[-1], svg)
    return written
