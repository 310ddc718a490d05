"""The page of one explanation of a diagnosis: its curve, its residuals, its gain, and what tells it from the next."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any, cast

import numpy as np
from numpy.typing import NDArray

from ...models.arrays import Ints
from ..diagnosis.added import Added, added_by
from ..diagnosis.result import Diagnosis, Explanation
from ..document.blocks import Page, Section
from ..document.notation import sentence
from ..errors import InputError
from ..evidence.evidence import Evidence
from ..rounding import digits, residual, upwards
from . import diagnosis as pages
from .pictures import residuals as pictures
from .terminal import advice_text

NOTICEABLE = 0.05
"""Part of the largest addition above which another channel has a curve."""
MOST_CURVES = 3
NOT_MEASURED = "The gain on left-out readings was not measured"
WHY_NOT = {
    "rows": "a wrong row says nothing about any other row",
    "stretch": "a stretch that is set aside says nothing about the other rows",
    "sigma": "a larger noise bound predicts nothing",
    "function": "a function of any shape has no values outside the readings that it was fitted to",
}

LABELS = {
    "input": "its input [g]",
    "alpha": "α [deg]",
    "beta": "β [deg]",
    "time": "time [h]",
    "temperature": "T [°C]",
}
"""Quantities of a reading at rest, and their names in a picture."""
ROW = "row"


@dataclass(frozen=True, eq=False)
class ChannelRows:
    """Rows (n,) of the evidence that belong to one channel, and the quantities (n,) to draw them against, by label."""

    title: str
    rows: Ints
    quantities: Mapping[str, NDArray]


def explanation_page(result: Diagnosis, number: int) -> Page:
    """Return the page of one of the explanations of a diagnosis.

    Raises
    ------
    InputError
        if the diagnosis has no such explanation
    """
    if not 0 <= number < len(result.explanations):
        raise InputError(f"explanation {number + 1}: the diagnosis has {len(result.explanations)}")
    explanation = result.explanations[number]
    following = [section for section in pages.remarks_of(result) if section.title.startswith("Next measurements")]
    sections: list[Section | None] = []
    if len(result.explanations) > 1:
        rival = result.explanations[number + 1 if number + 1 < len(result.explanations) else number - 1]
        tells = [f"The other one is: {sentence(rival.sentence)}"]
        tells += [] if following else [advice_text(result)]
        sections.append(Section("What tells it from the next", tells))
    added = None if result.evidence is None else added_by(result.evidence, explanation)
    sections += _curve_sections(result.evidence, explanation, added)
    sections.append(_gain_section(result, explanation, added))
    if explanation is result.best:
        sections.append(pages.gain_section(result))
    noun = "number" if explanation.numbers == 1 else "numbers"
    title = explanation.sentence[:1].upper() + explanation.sentence[1:]
    shown = [section for section in sections if section is not None]
    return Page(title, f"It needs {explanation.numbers} {noun}.", [*shown, *following])


def _curve_sections(evidence: Evidence | None, explanation: Explanation, added: Added | None) -> list[Section | None]:
    """Return the pictures of what an explanation adds, and of the residuals without it and with it."""
    if evidence is None or added is None:
        return [Section("What it adds to the readings", ["Its model has other parameters: no curve can be drawn."])]
    channels = list(channels_of(evidence))
    aside = np.isnan(added.remaining)
    # Beside an effect that acts everywhere, readings that are set aside would hide its curve.
    hidden = aside & bool(explanation.causes)
    curve, without = (np.where(hidden, np.nan, values) for values in (added.added, added.without))
    largest = [float(np.nanmax(np.abs(curve[channel.rows]), initial=0.0)) for channel in channels]
    most = sorted(range(len(channels)), key=lambda k: -largest[k])[:MOST_CURVES]
    shown = [channels[k] for k in sorted(most) if largest[k] >= NOTICEABLE * max(largest)]
    on = min(shown[0].quantities, key=lambda name: _roughness(shown, name, curve))
    if aside.any() and not hidden.any() and ROW in shown[0].quantities:
        on = ROW
    if explanation.kind == "sigma":
        text = "It adds nothing to any reading: it says that the noise is larger than its bound."
    else:
        text = (
            f"At most {upwards(max(largest), 3)} σ. The curve is what the explanation adds at each reading; the "
            "circles are the readings less the model without it, with the parameters that belong to the explanation."
        )
    if hidden.any():
        text += " Readings that it sets aside are not drawn."
    elif aside.any():
        text += " Readings that it sets aside are off by what the curve shows; everywhere else it adds nothing."
    titles = [channel.title for channel in shown]
    values = [channel.quantities[on] for channel in shown]
    parts = [(without[channel.rows], curve[channel.rows]) for channel in shown]
    before = evidence.model.baseline
    errors = before.left / before.allowed
    # Of a carried record only one part has more quantities than time.
    like = shown[0] if len(shown[0].quantities) > 1 else max(channels, key=lambda channel: len(channel.quantities))
    alike = [channel for channel in channels if channel.quantities.keys() == like.quantities.keys()]
    drawn = [(c.title, c.quantities, errors[c.rows], added.remaining[c.rows]) for c in alike]
    return [
        Section("What it adds to the readings", [text], pictures.additions(titles, on, values, parts)),
        Section(
            "Residuals before and after",
            [],
            pictures.residuals_by_quantity(drawn),
            "Residuals without the explanation and with it, in units of the noise bound; the band is the bound.",
        ),
    ]


def _roughness(channels: list[ChannelRows], name: str, added: NDArray) -> float:
    """Return how much a curve goes up and down over a quantity, relative to its height."""
    rough = 0.0
    for channel in channels:
        values = channel.quantities.get(name)
        if values is None or np.ptp(values) == 0.0:
            return np.inf
        curve = added[channel.rows][np.argsort(values, kind="stable")]
        curve = curve[np.isfinite(curve)]
        rough += float(np.abs(np.diff(curve)).sum() / max(np.ptp(curve), 1e-12))
    return round(rough, 3)


def channels_of(evidence: Evidence) -> Iterator[ChannelRows]:
    """Yield the channels of the rows of any evidence: accelerometers, turns, parts of a carried record."""
    rows, reader, model = evidence.rows, cast("Any", evidence.reader), evidence.model
    if members := getattr(model, "members", ()):
        for label, member, start in zip(model.labels, members, model.starts, strict=False):
            for channel in channels_of(member):
                yield ChannelRows(f"{label}: {channel.title}", channel.rows + start, channel.quantities)
    elif rows.parts:
        yield from _channels_of_parts(evidence)
    elif rows.are_readings:
        of_positions = reader.of_positions.reshape(-1, 3)
        for p, channel in enumerate(reader.channels()):
            quantities: dict[str, NDArray] = {}
            for name, label in LABELS.items():
                if name in channel.quantities:
                    quantities[label] = channel.quantities[name][:, 0]
                elif name in channel.angles:
                    quantities[label] = np.degrees(channel.angles[name]) % 360.0
            quantities[ROW] = np.asarray(reader.numbers, dtype=float)
            yield ChannelRows(f"accelerometer {p + 1}", of_positions[:, p], quantities)
        turns = reader.turns_of(None)
        if turns is not None:
            first = len(rows.residual) - 3 * len(turns.first)
            outer, inner = np.degrees(turns.turned).T
            over_turns = {"time [s]": turns.first, "outer turn [deg]": outer, "inner turn [deg]": inner}
            for p in range(3):
                numbers = first + 3 * np.arange(len(turns.first)) + p
                yield ChannelRows(f"turns by gyro {p + 1}", numbers, over_turns)
    else:
        numbers = np.arange(len(rows.residual))
        yield ChannelRows("all readings", numbers, {"number of the reading": numbers + 1.0})


def _channels_of_parts(evidence: Evidence) -> Iterator[ChannelRows]:
    """Yield the components of each part of a carried record over time; of the quoted part over all its quantities."""
    start, reader = 0, cast("Any", evidence.reader)
    time_s = reader.found.record.time_s
    for part in evidence.rows.parts:
        numbers = start + np.arange(part.error.size).reshape(part.error.shape)
        start += part.error.size
        middle = 0.5 * (time_s[part.pieces.first] + time_s[part.pieces.last])
        quantities: dict[str, NDArray] = {"time [s]": middle}
        if part is reader.quoted_part:
            of_pieces = reader.quantities()
            for axis in range(3):
                quantities[f"turn about axis {axis + 1} [deg]"] = np.degrees(of_pieces["turn"][:, axis])
            if "temperature" in of_pieces:
                quantities["temperature [°C]"] = of_pieces["temperature"][:, 0]
        for component, of_component in enumerate(numbers.T, start=1):
            title = f"{part.label}, component {component}" if len(numbers.T) > 1 else part.label
            yield ChannelRows(title, of_component, quantities)


def _gain_section(result: Diagnosis, explanation: Explanation, added: Added | None) -> Section:
    """Return the errors without an explanation and with it: at all readings, and at those that were left out."""
    texts = []
    if result.radius is not None and explanation.radius is not None:
        before, after = residual(result.radius), residual(explanation.radius)
        texts.append(f"Largest error over its bound: {before} without it, {after} with it.")
    gain = explanation.extension.gain if explanation.extension is not None else None
    if added is not None and added.left_out is not None:
        rms, largest = [], []
        for errors in added.left_out:
            rms.append(digits(float(np.sqrt(np.mean(errors**2)))))
            largest.append(upwards(float(np.abs(errors).max()), 3))
        texts.append(
            "Readings that were left out and predicted from the others: without it "
            f"{rms[0]} σ rms and {largest[0]} σ at most, with it {rms[1]} σ rms and {largest[1]} σ at most."
        )
    elif gain is not None:
        unit = gain.unit or result.unit or "g"
        before, after = digits(gain.held_out_rms_before), digits(gain.held_out_rms_after)
        texts.append(f"Held-out readings, simulated again: {before} {unit} rms without it, {after} {unit} with it.")
    elif explanation is not result.best or result.gain is None:
        why = WHY_NOT.get(explanation.kind, "the other readings do not determine this explanation")
        texts.append(f"{NOT_MEASURED}: {why}.")
    return Section("Gain", texts)
