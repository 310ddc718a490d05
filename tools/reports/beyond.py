"""What is told whatever the law, in words and on a page: place and quantity, the band, laws in it, what extends."""

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
from ..document.notation import Cell, sentence, unit_text
from ..evidence.pairs import GYROS, in_words
from ..rounding import digits, interval, residual, upwards
from .pictures.residuals import BandDrawn, band_picture

ARCSECONDS = math.degrees(1.0) * 3600.0
ANGLES = {"alpha": "α, outer axis", "beta": "β, inner axis"}
UNITS = {"hours": "h", "temperature": "°C", "sense": ""}
HOW_TO_READ = (
    "A function that leaves the band anywhere is excluded by this record and its noise bound, unless it bends more "
    "than any that is needed. What the model without effects can imitate is no part of the function: it is taken out."
)
POINTS = "Each point is a reading: what it says of the function, the model without effects being taken out."


def is_angular(where: str) -> bool:
    """Whether what errs at a place is an angle."""
    return where.endswith("axis") or where == "base"


def extension_texts(result: Diagnosis) -> list[str]:
    """Return in sentences what extends the model beyond the catalogue, and its gain."""
    law = result.extension
    if law is None:
        return []
    form = law.words
    if law.knots:
        form = f"a table of {len(law.knots)} knots" + (" of each gyro" if law.beside else "")
    texts = [
        f"Beyond the catalogue: {_where(law)} {form}, {_function_of(law)}, extends the model: "
        f"radius {residual(law.radius)}{_left_out(law)}{_needed(law)}."
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
    """The place of a law, of a gyro its number."""
    if law.where != GYRO_BLOCK or law.beside or not (law.axes or law.law):
        return law.where
    return f"gyro-{_gyro_of(law)}"


def _gyro_of(cause: Cause) -> int:
    """The number of the gyro that a table or a formula is of."""
    return cause.axes[0] if cause.axes else Formula.of(cause.law or "").target.index + 1


def _function_of(law: BeyondCatalogue) -> str:
    """Of what it is a function."""
    return f"{'functions' if law.beside else 'a function'} of {in_words(law.quantity)}"


def beyond_words(result: Diagnosis) -> str:
    """That the model is extended by what stands in no catalogue; empty where it is not."""
    if (law := result.extension) is None:
        return ""
    forms = ("A table of each gyro", "Formulas, ") if law.beside else ("A table", "The formula ")
    what = forms[0] if law.kind == "lookup" else f"{forms[1]}{law.words}"
    extend = "extend" if law.beside else "extends"
    return f"{what}, {_function_of(law)}, {extend} it beyond the catalogue: a description, no cause{_needed(law)}."


def _needed(law: BeyondCatalogue) -> str:
    """By how much larger a noise bound it would stand, where it does not."""
    if law.noise_bound_needed is None:
        return ""
    return f"; it would stand with a noise bound of {upwards(law.noise_bound_needed, 3)}"


def _left_out(law: StatedLaw) -> str:
    if law.left_out_rms is None or law.left_out_max is None:
        return ""
    return f", left out rms {digits(law.left_out_rms)} of the bound, max {upwards(law.left_out_max, 3)}"


def sections(result: Diagnosis) -> list[Section]:
    """The band of each place as a picture with laws and readings, and a table of the laws; none where there is none."""
    bands = result.bands or ((result.band,) if result.band else ())
    if not bands or result.beyond is None:
        return []
    first, *further = (
        _pictured(result.beyond, band, possible) for band, possible in zip(bands, result.beyond.each, strict=True)
    )
    _, picture, caption = first
    points = [POINTS] if "readings" in caption else []
    text = [sentence(text) for text in result.caution or ()] + [HOW_TO_READ, *points]
    head = Section("What the record says, whatever the law", text, picture, caption, _table(result))
    return [head, *(Section(title, (), picture, caption) for title, picture, caption in further)]


def _pictured(beyond: Beyond, band: BandOfFunctions, possible: Possible) -> tuple[str, Picture, str]:
    """The title, the picture and the caption of the band of one place."""
    circle, angular = possible.pair.circle, is_angular(band.where)
    across, up, error = (math.degrees(1.0) if circle else 1.0), 1e5, "1e-5 g"
    if angular or band.where in GYROS:
        up, error = (ARCSECONDS, "arcsec") if angular else (1e3, "1e-3 rad/s")
    at, values = beyond.readings
    by = "rad/s" if band.quantity.startswith("w") else "rad/s²" if band.quantity.startswith("d") else "g"
    unit = "deg" if circle else UNITS.get(band.quantity, "·".join([by] * len(band.quantity.split())))
    band_drawn = BandDrawn(
        at=across * np.array([knot["at"] for knot in band.knots]),
        low=up * np.array([knot["low"] for knot in band.knots]),
        high=up * np.array([knot["high"] for knot in band.knots]),
        knots=across * possible.knots,
        readings=(across * at, up * values),
        lines=[(name, up * values) for name, values in beyond.lines_of(possible)],
        quantity=f"{ANGLES.get(band.quantity, in_words(band.quantity))} [{unit}]".replace(" []", ""),
        error=f"{band.where.replace('-', ' ')} [{error}]",
        steps=band.steps,
        circle=circle,
    )
    what = f"What {band.where.replace('-', ' ')} errs by as a function of {in_words(band.quantity)}"
    caption = f"{what}: what the record leaves possible, laws{', and the readings' if len(at) else ''}."
    return what, band_picture(band_drawn), caption


def _table(result: Diagnosis) -> Table | None:
    """The laws that stand, and what extends the model."""
    rows: list[list[Cell]] = []
    law = result.extension
    laws = [*(result.laws or ()), *([law] if law is not None and law.kind == "lookup" else [])]
    for law in laws:
        name = law.words if not isinstance(law, BeyondCatalogue) or not law.knots else "table"
        left_out = "" if law.left_out_rms is None else digits(law.left_out_rms)
        for cause in law.causes:
            of = (
                name
                if not law.beside
                else f"gyro {_gyro_of(cause)}: {name if name == 'table' else words_of(cause.place)}"
            )
            for p, value, ends in zip(cause.parameters, cause.values, cause.intervals, strict=True):
                rows.append([of, p.name, *interval(value, *ends), unit_text(p.unit), residual(law.radius), left_out])
    header = ["law", "parameter", "estimate", "low", "high", "unit", "radius", "left out, rms"]
    return Table(header, rows) if rows else None


def proven_text(result: Diagnosis) -> str:
    """What is proven, whatever the law; empty where nothing is."""
    proven = result.proven
    if proven is None:
        return ""
    if proven.quantity and result.suffices:
        least = result.suffices[0]
        names = f"; this record does not tell it from {' and '.join(proven.same)}" if proven.same else ""
        return (
            f"proven, whatever the law: {least.in_words} suffices, radius {residual(least.radius)}, and nothing else "
            f"that is as simple{names}"
        )
    place = proven.place.replace("-", " ")
    if not proven.not_excluded:
        return f"proven, whatever the law: the {place} alone suffices, and no other place does"
    of = f"{'one of ' if len(proven.not_excluded) > 1 else ''}{', '.join(proven.not_excluded)}"
    return f"proven, whatever the law: the {place}; not on what it depends there: a function of {of} would do"


def bound_text(result: Diagnosis) -> str:
    """With which noise bound the model without effects would stand; empty where it stands or no single bound is."""
    if result.noise_bound_needed is None:
        return ""
    needed = upwards(result.noise_bound_needed, 3)
    if result.unit is None:
        return f"without any effect the model would stand with a noise bound of {needed} g"
    times = residual(result.radius)
    return f"without any effect the model would stand with bounds {times} times as large, of {needed} {result.unit}"


def level_texts(result: Diagnosis) -> list[str]:
    """Return what is proven of place and quantity, and the noise bound that would do without."""
    return [text for text in (proven_text(result), bound_text(result)) if text]


def level_section(result: Diagnosis) -> Section | None:
    """What suffices whatever the law; None where the model stands."""
    if not result.suffices and not proven_text(result):
        return None
    rows: list[list[Cell]] = [
        [function.where, function.on, function.form, str(function.complexity), residual(function.radius)]
        for function in result.suffices or ()
    ]
    header = ["place", "quantity", "form", "complexity", "radius"]
    # The band, where there is one, has the cautions.
    caution = () if result.band or result.bands else result.caution
    paragraphs = [sentence(text) for text in (proven_text(result), *caution, bound_text(result)) if text]
    return Section("Place and quantity", paragraphs, table=Table(header, rows) if rows else None)
