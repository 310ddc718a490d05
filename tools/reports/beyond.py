"""Proofs and laws outside the catalogue, in words and on a page: place and quantity, band, laws, extension."""

import math

import numpy as np

from ...models.effects.definition import GYRO_BLOCK
from ...models.effects.formula import Formula
from ..diagnosis.band import BandOfFunctions, Possible
from ..diagnosis.beyond import Beyond, BeyondCatalogue, StatedLaw
from ..diagnosis.cause import Cause
from ..diagnosis.laws import words_of
from ..diagnosis.result import Diagnosis
from ..document.blocks import Picture, Section, Table
from ..document.notation import raised, sentence
from ..evidence.pairs import GYROS, in_words
from ..rounding import digits, residual, upwards
from .bench import sizes_of
from .pictures.residuals import BandDrawn, band_picture

ARCSECONDS = math.degrees(1.0) * 3600.0
ANGLES = {"alpha": "α, outer axis", "beta": "β, inner axis"}
UNITS = {"hours": "h", "temperature": "°C", "sense": ""}
HOW_TO_READ = (
    "The record and its noise bound exclude a function that leaves the band, unless it bends more than necessary. The "
    "part that the nominal model can fit, such as bias and scale factor, is subtracted."
)
POINTS = "Each point is a reading after this subtraction."


def is_angular(where: str) -> bool:
    """Return True if the error at a place is an angle."""
    return where.endswith("axis") or where == "base"


def extension_texts(result: Diagnosis) -> list[str]:
    """Return sentences on the extension of the model beyond the catalogue, and its gain."""
    law = result.extension
    if law is None:
        return []
    form = f"the formula {law.words}"
    if law.knots:
        form = f"a curve through {len(law.knots)} points" + (" for each gyro" if law.beside else "")
    where = _where(law).replace("-", " ")
    where = where if where[-1].isdigit() else f"the {where}"
    texts = [
        f"Beyond the catalogue: {form}, {_function_of(law)}, describes the error of {where}, without a known "
        f"cause. Largest error with it: {residual(law.radius)} of its bound{_left_out(law)}{_needed(law)}."
    ]
    if law.gain is not None:
        gain, unit = law.gain, result.unit or "g"
        pieces = f"pieces, {gain.over}" if gain.over else "positions"
        texts.append(
            f"Held-out {pieces}, simulated again: rms {digits(gain.held_out_rms_before)} -> "
            f"{digits(gain.held_out_rms_after)} {unit}, max {upwards(gain.held_out_max_before, 3)} -> "
            f"{upwards(gain.held_out_max_after, 3)} {unit}."
        )
    return texts


def _where(law: StatedLaw) -> str:
    """Return the place of a law; for a gyro its number."""
    if law.where != GYRO_BLOCK or law.beside or not (law.axes or law.law):
        return law.where
    return f"gyro-{_gyro_of(law)}"


def _gyro_of(cause: Cause) -> int:
    """Return the gyro number of a table or a formula."""
    return cause.axes[0] if cause.axes else Formula.of(cause.law or "").target.index + 1


def _function_of(law: BeyondCatalogue) -> str:
    """Return the argument of a law's function."""
    return f"{'functions' if law.beside else 'a function'} of {in_words(law.quantity)}"


def beyond_words(result: Diagnosis) -> str:
    """Return a sentence on the extension of the model beyond the catalogue; empty if there is none."""
    law = result.extension
    if law is None:
        return ""
    form = "A table" if law.kind == "lookup" else f"The formula {law.words}"
    extends = "extends"
    if law.beside:
        form = "A table of each gyro" if law.kind == "lookup" else f"Formulas, {law.words}"
        extends = "extend"
    return f"{form}, {_function_of(law)}, {extends} it beyond the catalogue: a description, no cause{_needed(law)}."


def _needed(law: BeyondCatalogue) -> str:
    """Return the larger noise bound with which a law would explain the record; empty if it does already."""
    if law.noise_bound_needed is None:
        return ""
    return f"; it would stand with a noise bound of {upwards(law.noise_bound_needed, 3)}"


def _left_out(law: StatedLaw) -> str:
    if law.left_out_rms is None or law.left_out_max is None:
        return ""
    return f"; of readings that were left out {upwards(law.left_out_max, 3)} ({digits(law.left_out_rms)} rms)"


def sections(result: Diagnosis) -> list[Section]:
    """Return the band of each place as a picture with laws and readings, the first with a table of the laws."""
    bands = result.bands or ()
    if result.band:
        bands = (result.band,)
    if not bands or result.beyond is None:
        return []
    texts = [sentence(text) for text in dict.fromkeys((*result.caution, *result.beyond.caution))]
    texts.append(HOW_TO_READ)
    if len(result.beyond.readings[0]):
        texts.append(POINTS)
    pictured = []
    for band, possible in zip(bands, result.beyond.each, strict=True):
        title = f"Error of {band.where.replace('-', ' ')} over {in_words(band.quantity)}"
        pictured.append(Section(title, (), band_picture(_drawn(result.beyond, band, possible)), f"{title}."))
    first = pictured[0]
    pictured[0] = Section("Shape of the error", texts, first.picture, first.caption, _table(result))
    return pictured


def law_picture(result: Diagnosis, width: float) -> Picture | None:
    """Return the picture of the band of the first place; None without a band."""
    if result.beyond is None or not result.beyond.bands:
        return None
    return band_picture(_drawn(result.beyond, result.beyond.bands[0], result.beyond.possible), width)


def _drawn(beyond: Beyond, band: BandOfFunctions, possible: Possible) -> BandDrawn:
    """Return the band of one place, its laws and readings, in units for a drawing."""
    circle = possible.pair.circle
    across = math.degrees(1.0) if circle else 1.0
    up, error = _scale(band.where)
    at, values = beyond.readings
    quantity = ANGLES.get(band.quantity, in_words(band.quantity))
    unit = "deg" if circle else _unit_of_quantity(band.quantity)
    if unit:
        quantity = f"{quantity} [{unit}]"
    return BandDrawn(
        at=across * np.array([knot["at"] for knot in band.knots]),
        low=up * np.array([knot["low"] for knot in band.knots]),
        high=up * np.array([knot["high"] for knot in band.knots]),
        knots=across * possible.knots,
        readings=(across * at, up * values),
        lines=[(name, up * line) for name, line in beyond.lines_of(possible)],
        whole=[(name, up * line) for name, line in beyond.whole_lines_of(possible)],
        quantity=quantity,
        error=f"{band.where.replace('-', ' ')} [{error}]",
        steps=band.steps,
        circle=circle,
    )


def _scale(where: str) -> tuple[float, str]:
    """Return the factor for drawing an error at a place, and the resulting unit."""
    if is_angular(where):
        return ARCSECONDS, "arcsec"
    return (1e3, f"{raised(-3)} rad/s") if where in GYROS else (1e6, "µg")


def _unit_of_quantity(quantity: str) -> str:
    """Return the unit of a quantity that is not an angle; for a product that of its factors."""
    if quantity in UNITS:
        return UNITS[quantity]
    unit = "g"
    if quantity.startswith("w"):
        unit = "rad/s"
    elif quantity.startswith("d"):
        unit = "rad/s²"
    return "·".join([unit] * len(quantity.split()))


def _table(result: Diagnosis) -> Table | None:
    """Return the laws that explain the record, and a table that extends the model; None if there are none."""
    laws = list(result.laws or ())
    extension = result.extension
    if extension is not None and extension.kind == "lookup":
        laws.append(extension)
    rows = []
    for law in laws:
        left_out = "" if law.left_out_rms is None else digits(law.left_out_rms)
        for cause in law.causes:
            name = _law_name(law, cause)
            rows += [[name, *sizes, residual(law.radius), left_out] for sizes in sizes_of(cause)]
    header = ["law", "parameter", "estimate", "low", "high", "unit", "largest residual", "held-out rms"]
    return Table(header, rows)


def _law_name(law: StatedLaw, cause: Cause) -> str:
    """Return a law in words; for laws of several gyros, with the gyro of this cause."""
    is_table = isinstance(law, BeyondCatalogue) and bool(law.knots)
    name = "table" if is_table else law.words
    if not law.beside:
        return name
    return f"gyro {_gyro_of(cause)}: {name if is_table else words_of(cause.place)}"


def proven_text(result: Diagnosis) -> str:
    """Return the proof of place and quantity; empty if there is none."""
    proven = result.proven
    if proven is None:
        return ""
    head = "proven: "
    if proven.quantity and result.suffices:
        least = result.suffices[0]
        within = residual(least.radius)
        text = f"{head}{least.in_words} explains the record, largest residual {within}; nothing equally simple does"
        if proven.same:
            text += f"; this record cannot distinguish it from {' and '.join(proven.same)}"
        return text
    place = proven.place.replace("-", " ")
    if not proven.not_excluded:
        return f"{head}the error is at {place}; no other place explains the record"
    quantities = ", ".join(proven.not_excluded)
    if len(proven.not_excluded) > 1:
        quantities = f"one of: {quantities}"
    return f"{head}the error is at {place}. Open: the quantity, {quantities}"


def bound_text(result: Diagnosis) -> str:
    """Return the noise bound with which the model without effects would fit; empty if it fits or there is no single
    bound."""
    if result.noise_bound_needed is None:
        return ""
    needed = upwards(result.noise_bound_needed, 3)
    if result.unit is None:
        return f"without effects the model would fit with a noise bound of {needed} g"
    times = residual(result.radius)
    return f"without effects the model would fit with bounds {times} times as large, of {needed} {result.unit}"


def level_section(result: Diagnosis) -> Section | None:
    """Return the functions that suffice for any law; None if the model fits."""
    if not result.suffices:
        return None
    rows = []
    for function in result.suffices or ():
        rows.append([function.where, function.on, function.form, function.complexity, residual(function.radius)])
    header = ["place", "quantity", "form", "complexity", "radius"]
    return Section("Place and quantity", table=Table(header, rows))
