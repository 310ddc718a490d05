"""The evidence for a diagnosis: residuals, alternatives, confusions, left-out parts, exclusions."""

import math
import re
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from ...models.effects import EffectPlace
from ..diagnosis.result import Diagnosis
from ..diagnosis.search import compared_places, likeness
from ..document.blocks import Picture, Section, Table
from ..document.notation import (
    Bar,
    Cell,
    Drawn,
    bars,
    bars_by_unit,
    half_width,
    symbol_text,
    unit_text,
)
from ..evidence.power import PIECES, SECTORS
from ..rounding import digits, exactly, interval, residual, to_bound, upwards
from .bench import NO_RESIDUAL, physical_words, proved
from .inspection import own_words
from .pictures import residuals as pictures

MOST_RANKED = 16
MOST_BARS = 18


def first_words(result: Diagnosis) -> str:
    """Return the subject of figures with effects: the named effects, or the first of the remaining sets."""
    if result.verdict == "unexplained":
        return "the set that is not named"
    if result.verdict != "explained":
        return "the first of the sets that remain"
    return "the effect" if result.best is not None and len(result.best.causes) == 1 else "the effects"


def residual_sections(result: Diagnosis) -> list[Section]:
    """Return residuals of readings without and with the effects, over the angles, over the inputs.

    There are none if parameters fit any readings.
    """
    nominal = result.calibration
    linearised = nominal.linearised
    if (nominal.radius or 0.0) < NO_RESIDUAL:
        return []
    least = residual(nominal.radius)
    text = f"The nominal model explains every reading within {least} σ."
    if (nominal.radius or 0.0) > 1.0:
        text = f"Whatever its parameters, the nominal model leaves a largest residual of at least {least} σ."
    before = (linearised.residual / linearised.bound).reshape(-1, 3)
    after = None
    if result.findings:
        finding = result.findings[0]
        which = "" if result.verdict == "explained" else f", {finding.title},"
        text += f" With {first_words(result)}{which} it leaves {residual(finding.fit.radius)} σ."
        over_bounds = finding.fit.left / finding.fit.allowed
        after = over_bounds[result.sources.of_positions].reshape(-1, 3)
    proof = proved(nominal, result.sources.numbers)
    return [
        Section(
            "Residuals before and after" if result.findings else "Residuals",
            [text],
            pictures.residuals(linearised.positions, before, after, proof),
            "Residuals over the angles of the outer and the inner axis; the band is the noise bound.",
        ),
        Section(
            "Residuals against the inputs",
            [],
            pictures.residuals_over_inputs(linearised.input, before, after, proof),
            "Residuals of each accelerometer against its own input.",
        ),
    ]


def proviso_of(result: Diagnosis) -> str:
    """Return the assumption on the true attitude's error on which a verdict rests; empty if there is none."""
    if result.reference_bound_arcmin is None or result.verdict in ("unexplained", "insufficient"):
        return ""
    places = result.findings[0].fit.places if result.findings else ()
    least = upwards(result.sources.needed(places), 3)
    return (
        f"this holds if the true attitude errs by {exactly(result.reference_bound_arcmin)} arcmin at most at any row, "
        f"as stated, which no record tells; less than {least} would not do, and "
        "near that the intervals are too narrow"
    )


def quoted_words(result: Diagnosis) -> str:
    """Return the name of the pieces whose errors are quoted."""
    part = result.sources.quoted_part
    return "moves" if part.pieces.kind == "moves" else f"windows of {part.label}"


def error_pictures(result: Diagnosis) -> dict[str, Picture]:
    """Return errors of pieces without and with the effects over time, and over possible causes, as SVG."""
    sources = result.sources
    part, time = sources.quoted_part, sources.found.record.time_s
    middle = 0.5 * (time[part.pieces.first] + time[part.pieces.last])
    after = sources.quoted_errors(result.findings[0].fit) if result.findings else None
    return {
        "time": pictures.errors_over_time(np.asarray(middle), part.error, after, part.bound, quoted_words(result)),
        "quantities": pictures.errors_over_quantities(sources.quantities(), part.error, after),
    }


def bias_texts(result: Diagnosis) -> list[str]:
    """Return a sentence on the gyros' mean at rest that was subtracted."""
    if result.bias_at_rest is None:
        return []
    rates = ", ".join([digits(math.degrees(rate), 4) for rate in result.bias_at_rest.radps])
    text = f"Gyro bias at rest, taken out: {rates} deg/s"
    if result.bias_at_rest.rms_if_left_in_arcmin is not None:
        text += f"; left in it would make the errors {digits(result.bias_at_rest.rms_if_left_in_arcmin)} arcmin rms"
    return [f"{text}."]


def error_sections(result: Diagnosis, bias: Sequence[str]) -> list[Section]:
    """Return errors of pieces without and with the effects; `bias` is the text on the subtracted mean of the gyros."""
    what, errors = quoted_words(result), error_pictures(result)
    carried = (
        "The simulation carries the direction of gravity from rest to rest"
        if result.reference == "gravity"
        else "The simulation carries the attitude over windows, and the true attitude says how far it is wrong"
    )
    radius = result.radius or 0.0
    least = f"With the best parameters of the block the largest error is {residual(radius)} times its bound"
    if result.bias_at_rest is not None:
        least = f"The largest error of the block as delivered is {residual(radius)} times its bound"
    if result.findings:
        least += f"; with {result.findings[0].title} it is {residual(result.findings[0].fit.radius)} of it"
    two = result.sources.quoted_part.error.shape[1] == 2
    about, size = ("two axes across it", "√2") if two else ("three axes", "√3")
    texts = [
        f"{carried}: gyro compensation and attitude computer, two FMUs that the orchestrator feeds with the "
        f"record's increments. {least}.",
        f"The bounds come from {result.calibration.sigma.basis}.",
    ]
    texts += bias
    return [
        Section(
            "Errors before and after" if result.findings else "Errors",
            texts,
            errors["time"],
            f"Size of the error over each of the {what}. The line is the bound about each of {about}: a size may be "
            f"{size} of it.",
        ),
        Section(
            "Errors against rate, turn and orientation",
            [],
            errors["quantities"],
            f"The same errors of the {what} against what they may depend on.",
        ),
    ]


def moved_targets_section(result: Diagnosis) -> Section | None:
    """Return the change of the calibration by the effects; None if there are none."""
    if not result.targets:
        return None
    nominal = result.calibration
    named = {p.symbol: p for p in (*result.stated.parameters, *nominal.parameters)}
    intervals = []
    for target in result.targets:
        low, high = target["low"], target["high"]
        if low is not None:
            low = (low - target["after"]) / nominal.noise_bound
        if high is not None:
            high = (high - target["after"]) / nominal.noise_bound
        intervals.append(Bar(None, low, high))
    drawn, reach = bars(intervals)
    rows = []
    for target, bar in zip(result.targets, drawn, strict=True):
        symbol, low, high = target["symbol"], target["low"], target["high"]
        moved = to_bound(target["after"] - target["before"], half_width(low, high))
        meaning, unit = "", ""
        if symbol in named:
            meaning, unit = physical_words(named[symbol].name), unit_text(named[symbol].unit)
        after, lowest, highest = interval(target["after"], low, high)
        rows.append([symbol_text(symbol), meaning, after, moved, bar, lowest, highest, unit])
    header = ["target", "meaning", "with the effects", "moved by", "interval", "low", "high", "unit"]
    caption = (
        f"Drawn from −{upwards(reach)} to {upwards(reach)} σ about each target with the effects: what the readings "
        "leave."
    )
    return Section(
        "Targets, and what the effects do to them",
        ["The estimates without the effects are wrong by what they move; the intervals are those with them."],
        table=Table(header, rows, caption),
    )


def parameter_section(result: Diagnosis) -> Section | None:
    """Return the parameters of a carried block, each with its interval; None if there are none."""
    parameters = result.stated.parameters
    if not parameters:
        return None
    bounded = all(half_width(p.low, p.high) is not None for p in parameters)
    drawn = _interval_bars(parameters) if bounded else [None] * len(parameters)
    rows = []
    for p, bar in zip(parameters, drawn, strict=True):
        value, low, high = interval(p.estimate, p.low, p.high)
        row: list[Cell] = [own_words(p.symbol), value, bar]
        row += [low, high] if bounded else [None, None]
        row.append(unit_text(p.unit))
        rows.append(row)
    text = "They belong to any block of this kind and are no effects."
    caption = "Possible values, drawn about the estimate: one scale for all of one unit."
    if not bounded:
        text += " The estimates are those of a block that the record contradicts: no interval is given."
        caption = ""
    header = ["parameter", "estimate", "interval", "low", "high", "unit"]
    return Section("The block's own parameters", [text], table=Table(header, rows, caption))


def _interval_bars(parameters: Sequence[Any]) -> list[Drawn | None]:
    """Return the interval of each parameter about its estimate, drawn in one scale for all of one unit."""
    intervals = [Bar(None, p.low - p.estimate, p.high - p.estimate) for p in parameters]
    return bars_by_unit(intervals, [p.unit for p in parameters])


def ranking_section(result: Diagnosis) -> Section | None:
    """Return the remaining residual with each single effect; None if none were tried."""
    if not result.tried:
        return None
    best = result.tried[:MOST_RANKED]
    mending = {title for title, radius in result.tried if radius <= 1.0}
    how_many = {0: "None of them does.", 1: "One does."}.get(len(mending), f"{len(mending)} do.")
    paragraphs = [
        f"Each of the {len(result.tried)} effects that could be tried by itself was added to the model in turn. At or "
        f"below one everything is within its bound. {how_many}"
    ]
    remaining = set()
    for finding in result.findings:
        if len(finding.causes) == 1:
            remaining.add(finding.causes[0].place.title)
            remaining |= {place.title for place in finding.causes[0].alike}
    refused = len(mending - remaining)
    if refused and remaining and result.sources.model.effort.most_known_alone:
        which = "One of them is" if refused == 1 else f"{refused} of them are"
        paragraphs.append(
            f"{which} not among the sets that remain: only a size that is not possible, or only to first order, mends "
            "it."
        )
    titles = [title for title, _ in best]
    radii = [radius for _, radius in best]
    return Section(
        "Evidence: residual with each effect",
        paragraphs,
        pictures.candidates(titles, radii),
        f"Largest residual with each effect, in units of its bound; the best {len(best)}.",
    )


def confusion_section(result: Diagnosis) -> Section | None:
    """Return possible confusions in this record, and the classes; None for fewer than two effects."""
    titles = [title for title, _ in result.tried]
    sets = [finding.fit.places for finding in result.findings]
    places = compared_places(result.sources.model.classes.places, sets, titles) if titles else ()
    if len(places) < 2:
        return None
    rows = _equivalent_rows(result)
    beyond = ", beyond what the model's parameters imitate" if result.sources.rows.names else ""
    paragraphs = [
        f"Likeness of effects in this record{beyond}: at 1 an effect of suitable size equals the other, at 0 they have "
        "nothing in common. Close to 1 a little noise confuses them."
    ]
    if result.findings and not rows:
        paragraphs.append(f"No other effect belongs to its class: every other one differs in {result.sources.told_by}.")
    header = ["effect", f"cannot be told by {result.sources.told_by} from"]
    return Section(
        "Evidence: similar effects",
        paragraphs,
        pictures.likeness_picture([place.title for place in places], likeness(result.sources.rows, places)),
        "Cosine of the least angle between what two effects add to the readings.",
        Table(header, rows),
    )


def _equivalent_rows(result: Diagnosis) -> list[list[Cell]]:
    """Return effects with those that no such record tells from them, each once."""
    rows = []
    for finding in result.findings:
        for cause in finding.causes:
            row: list[Cell] = [cause.place.title, ", ".join([place.title for place in cause.alike])]
            if cause.equivalents and row not in rows:
                rows.append(row)
    for places in result.equal_sets:
        rows.append(["the set that was named", " and ".join([place.title for place in places])])
    return rows


def length_section(result: Diagnosis) -> Section | None:
    """Return the results for each length, and the order of the effects; None if there is one length."""
    if not result.lengths:
        return None
    rows = []
    for length in result.lengths:
        sets = []
        for places in length.smallest_sets[:4]:
            sets.append(" + ".join([place.effect for place in places]) or "none needed")
        rows.append(
            [
                length.over,
                length.pieces,
                upwards(length.noise_bound_arcmin, 3),
                digits(length.rms_arcmin),
                upwards(length.max_arcmin, 3),
                residual(length.radius),
                "; ".join(sets) or "none up to three effects",
            ]
        )
    header = ["over", "pieces", "bound [arcmin]", "rms [arcmin]", "largest [arcmin]", "over its bound"]
    header.append("smallest sets that stand")
    table = Table(header, rows)
    paragraphs = ["Each length of the pieces by itself, and what it needs."]
    orders = orders_of(result)
    if not orders:
        return Section("Length by length", paragraphs, table=table)
    paragraphs.append(
        "Parts of the record were left out in turn and predicted from the rest, with one more effect at a time: "
        "the one that helps most."
    )
    if result.order_stable is not None and len(orders) > 1:
        order = "the same at every length" if result.order_stable else "not stable: it differs between the lengths"
        paragraphs.append(f"The order is {order}.")
    caption = "Errors on left-out data, effect after effect."
    return Section("Length by length", paragraphs, pictures.order_picture(orders), caption, table)


def orders_of(result: Diagnosis) -> list[tuple[str, Any]]:
    """Return the order of the effects at each length that has one."""
    orders = []
    for length in result.lengths or ():
        if length.order is not None:
            orders.append((length.over, length.order))
    return orders


def structure_section(result: Diagnosis) -> Section | None:
    """Return the quantities on which an unexplained residual depends."""
    if not result.residual_structure:
        return None
    entries = sorted(result.residual_structure, key=lambda entry: -float(entry["explained"]))[:MOST_BARS]
    of = "accelerometer" if "accelerometer" in entries[0] else "axis"
    return Section(
        "Dependence of the residual",
        f"This is how much of the residual of each {of} a smooth function of one quantity, or of several together, "
        "predicts where it was left out; the band is what is more than noise within its bound.",
        pictures.shares(entries, of),
        "Part of the residual's sum of squares that is predicted.",
    )


_OF_A_GYRO = re.compile(r"(?P<name>[a-z]+)_(?P<gyro>[123])_?(?P<axes>[123]{0,2})")
COLUMNS = {
    "gyros": ("gyro 1", "gyro 2", "gyro 3", "block"),
    "accelerometers": ("accelerometer 1", "accelerometer 2", "accelerometer 3"),
    "table": ("outer axis", "inner axis", "base", "mounting"),
}
"""Parts of a system that effects act on, and the places of each."""


def excluded_sections(result: Diagnosis) -> list[Section]:
    """Return upper bounds of effects that were not found, a column for each place; and effects that cannot be seen."""
    bounds: dict[str, dict[tuple[str, str, str], dict[str, Cell]]] = {part: {} for part in COLUMNS}
    for entry in result.excluded or ():
        part, words, parameter, column = excluded_words(entry)
        key = (words, parameter, unit_text(entry["unit"]))
        bounds[part].setdefault(key, {})[column] = upwards(entry["above"])
    sections = []
    paragraphs = ["Larger sizes of these effects contradict the record. Bounds are rounded up."]
    for part, entries in bounds.items():
        rows = []
        for (words, parameter, unit), sizes in entries.items():
            row: list[Cell] = [words, parameter]
            row += [sizes.get(column) for column in COLUMNS[part]]
            row.append(unit)
            rows.append(row)
        if rows:
            header = ["effect", "parameter"]
            header += COLUMNS[part]
            header.append("unit")
            table = Table(header, rows)
            sections.append(Section(f"Excluded: effects of the {part}", paragraphs, table=table))
            paragraphs = []
    if result.cannot_be_seen:
        names = ", ".join(dict.fromkeys([place.effect for place in result.cannot_be_seen]))
        text = f"No possible size of these effects would show in this record, and they were not searched: {names}."
        sections.append(Section("Limits of the record", [text]))
    return sections


OWN_QUANTITIES = {
    ("accelerometer", "n"): "own input",
    ("gyro", "w"): "own rate",
    ("gyro", "a"): "own angular acceleration",
    ("gyro", "n"): "own specific force",
}
"""Quantities that have one name for every instrument."""


def power_section(result: Diagnosis) -> Section | None:
    """Return the detection limits of faults outside the catalogue; None if they are unknown."""
    sizes: dict[tuple[str, str, str], dict[str, Cell]] = {}
    for entry in result.power or ():
        key = (_quantity_words(entry, "quantity"), _quantity_words(entry, "factor"), unit_text(entry["unit"]))
        size = upwards(math.inf if entry["size"] is None else entry["size"], 2)
        sizes.setdefault(key, {})[entry["place"].replace("-", " ")] = size
    if not sizes:
        return None
    with_size: set[str] = set()
    for of_place in sizes.values():
        with_size |= of_place.keys()
    columns = []
    for places in COLUMNS.values():
        columns += [place for place in places if place in with_size]
    rows = []
    for (quantity, factor, unit), of_place in sizes.items():
        row: list[Cell] = [quantity, factor]
        row += [of_place.get(column) for column in columns]
        row.append(unit)
        rows.append(row)
    header = ["function of", "times"]
    header += columns
    header.append("unit")
    return Section(
        "Detection limits outside the catalogue",
        [
            "An error of this size, as a function of one quantity at one place, contradicts the nominal model for any "
            "noise within its bound. The functions are linear between knots: "
            f"{PIECES} pieces over the range of the quantity, {SECTORS} around a circle. The part that the model's "
            "parameters can fit does not count. A sharper function, or one of several quantities, can hide at a larger "
            "size. inf: no size is detected."
        ],
        table=Table(header, rows),
    )


def _quantity_words(entry: Mapping[str, Any], key: str) -> str:
    """Return a quantity of an unlisted fault, or its factor, as a table has it."""
    kind, number = entry["place"][:-2], entry["place"][-1]
    words = {"tilt": "tilt of the axis"}
    for (instrument, name), own_name in OWN_QUANTITIES.items():
        if instrument == kind:
            words[name + number] = own_name
    name = entry.get(key) or ""
    return words.get(name, name).replace("hours", "time").replace("alpha", "α").replace("beta", "β")


def excluded_words(entry: Mapping[str, Any]) -> tuple[str, str, str, str]:
    """Return an effect's part, its name and parameter in words, and the column of its largest possible size."""
    column = entry["where"].replace("-", " ")
    part = next((part for part, columns in COLUMNS.items() if column in columns), "gyros")
    if part == "gyros":
        words, gyro = gyro_parameter_words(entry["parameter"])
        return part, entry["effect"], words, f"gyro {gyro}" if gyro else "block"
    axes = tuple(entry.get("axes", ()))
    place = EffectPlace(entry["effect"], entry["where"], entry.get("order"), axes, entry.get("law", ""))
    return part, place.title.replace(f" {place.where}", ""), entry["parameter"], column


def gyro_parameter_words(parameter: str) -> tuple[str, str]:
    """Return a parameter without its gyro, and the gyro's number: "gamma_12" is "gamma, axis 2" of gyro 1."""
    match = _OF_A_GYRO.fullmatch(parameter)
    if match is None:
        return parameter, ""
    axes = match["axes"]
    if not axes:
        return match["name"], match["gyro"]
    return f"{match['name']}, {'axis' if len(axes) == 1 else 'axes'} {' '.join(axes)}", match["gyro"]
