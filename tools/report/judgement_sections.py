"""What stands behind a named cause on the page of a diagnosis, and what stands in place of one."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from matplotlib.patches import Patch

from ..diagnosis import Diagnosis
from ..summaries import physical_words
from .bars import Bar, bars
from .cells import Cell
from .page import Section, Table
from .rounding import outwards, significant, symbol_text, to_bound, unit_text
from .svg import drawing, say_empty, short, svg_text
from .theme import AXES, BAND, INK, WIDTH

MOST_BARS = 18
FIGURES = ("rms_before", "rms_after", "max_before", "max_after")


def judgement_sections(result: Diagnosis) -> list[Section]:
    """Positions and times that were left out, and shuffles; a section, or none."""
    judgement = result.judgement
    if judgement is None:
        return []
    rows: list[list[Cell]] = [
        [name, part["scored"], *(significant(part[figure]) for figure in FIGURES)]
        for name, score in (("every fifth position", judgement.folds), ("every quarter of the time", judgement.blocks))
        if score is not None
        for part in [score.to_json()]
    ]
    said = [
        "Parts of the record were left out in turn and predicted by the rest, without and with the effects. This is a "
        "second witness, no evidence: almost any effect improves some of it."
    ]
    if judgement.shuffles:
        said.append(
            "Shuffled over the positions, the effects predicted what was left out as well in "
            f"{judgement.shuffles.as_good} of {judgement.shuffles.tried} trials."
        )
    said += [f"Warning: {warning}." for warning in judgement.warnings]
    header = ["left out", "readings", "rms before [g]", "rms after [g]", "max before [g]", "max after [g]"]
    return [Section("Left out, and shuffled", said, table=Table(header, rows) if rows else None)]


def target_sections(result: Diagnosis) -> list[Section]:
    """What the effects do to the calibration; a section, or none."""
    if not result.targets:
        return []
    known = {row.symbol: row for row in result.evidence.calibration.parameters}
    sigma = result.evidence.calibration.noise_bound
    halves = [None if None in (t["low"], t["high"]) else 0.5 * (t["high"] - t["low"]) for t in result.targets]
    drawn, reach = bars(
        [
            Bar(None, *((None, None) if half is None else ((t[end] - t["after"]) / sigma for end in ("low", "high"))))
            for t, half in zip(result.targets, halves, strict=True)
        ]
    )
    rows: list[list[Cell]] = []
    for t, half, bar in zip(result.targets, halves, drawn, strict=True):
        moved = to_bound(t["after"] - t["before"], half)
        ends = outwards(t["low"], t["high"], half)
        own = known.get(t["symbol"])
        words, unit = ("", "") if own is None else (physical_words(own.name), unit_text(own.unit))
        rows.append([symbol_text(t["symbol"]), words, to_bound(t["after"], half), moved, bar, *ends, unit])
    header = ["target", "meaning", "with the effects", "moved by", "interval", "low", "high", "unit"]
    caption = f"Drawn from −{reach:.2g} to {reach:.2g} σ about each target with the effects: what the readings leave."
    return [
        Section(
            "Targets, and what the effects do to them",
            ["The estimates without the effects are wrong by what they move; the intervals are those with them."],
            table=Table(header, rows, caption),
        )
    ]


def structure_sections(result: Diagnosis) -> list[Section]:
    """What an unexplained residual depends on; a section, or none."""
    if not result.residual_structure:
        return []
    shown = sorted(result.residual_structure, key=lambda entry: -float(entry["explained"]))[:MOST_BARS]
    return [
        Section(
            "What the residual depends on",
            [
                "Nothing in the catalogue makes the model consistent, alone or in sets of up to three. This is how "
                "much of the residual a smooth function of one quantity, or of all angles or inputs, predicts at "
                "readings that were left out; the band is what is more than noise within its bound."
            ],
            shares(shown),
            "Part of the residual's sum of squares that is predicted.",
        )
    ]


def shares(entries: Sequence[dict[str, Any]], of: str = "accelerometer") -> str:
    """Bars of what each quantity predicts of the residual, before what is predictable at all (SVG).

    `of` names the entry that has the number of the accelerometer, or of the axis.
    """
    labels = [short(f"{of} {entry[of]}: {entry['on']}") for entry in entries]
    with drawing():
        figure = Figure(figsize=(WIDTH, 1.05 + 0.24 * max(len(labels), 2)), layout="constrained")
        axes = figure.subplots()
        y = np.arange(len(labels))
        axes.barh(y, [entry["explainable"] for entry in entries], height=0.86, color=BAND.light, linewidth=0)
        colours = [AXES[int(entry[of]) - 1].light for entry in entries]
        axes.barh(y, [entry["explained"] for entry in entries], height=0.52, color=colours, linewidth=0)
        axes.set_yticks(y, labels)
        axes.tick_params(axis="y", length=0, labelcolor=INK.light)
        axes.set_ylim(max(len(labels), 2) - 0.4, -0.6)
        axes.set_xlim(0.0, 1.0)
        axes.grid(visible=False, axis="y")
        axes.set_xlabel("part of the residual's sum of squares")
        figure.legend(handles=[Patch(facecolor=BAND.light, label="more than noise")], loc="outside upper left")
        if not labels:
            say_empty(axes)
        return svg_text(figure, f"How much of the residual of each {of} each quantity predicts")
