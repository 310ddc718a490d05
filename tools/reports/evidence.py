"""What speaks for a verdict: readings that prove it, rankings, likeness, what was left out; what to measure next."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from matplotlib.patches import Patch
from numpy.typing import NDArray

from ...models.effects import EffectPlace
from ..calibration import Calibration
from ..calibration.estimates import chebyshev_centre
from ..calibration.model import Linearisation
from ..diagnosis import Diagnosis
from ..diagnosis.search import compared_places, likeness
from ..document.blocks import Download, Section, Table
from ..document.numbers import (
    Bar,
    Cell,
    Written,
    bars,
    half_width,
    minus,
    outwards,
    significant,
    symbol_text,
    to_bound,
    unit_text,
)
from ..document.theme import AXES, BAND, INK, WIDTH, drawing, say_empty, short, svg_text
from ..evidence.bench_effects import is_linear
from ..evidence.evidence import Fit
from .pictures.rankings import likeness_picture
from .pictures.residuals import candidates, next_directions
from .words import physical_words

MOST_RANKED = 16
CONFUSION = "Evidence: what could be taken for what"
ALIKE = (
    "How alike effects look {}: 1 means that the one can be sized to look just like the other, 0 that it cannot at "
    "all. Close to 1 it takes small noise to confuse them."
)


def centred(residual: NDArray, bound: NDArray, fit: Fit | None) -> NDArray:
    """Residuals (N, 3) over their bounds; of an extended fit, at its Chebyshev centre."""
    left = residual if fit is None else fit.left
    return (left / bound).reshape(-1, 3)


def proved(result: Calibration, numbers: NDArray) -> NDArray:
    """Readings (N, 3) of bool that prove a falsification; `numbers` are the record's own of its rows."""
    witness = {(reading.position, reading.accelerometer) for reading in result.witness}
    proof = np.zeros((len(result.linearised.reading), 3), dtype=bool)
    for i, axis in np.ndindex(*proof.shape):
        proof[i, axis] = (int(numbers[i]), axis + 1) in witness
    return proof


def centre_residual(result: Calibration) -> NDArray:
    """Residuals (N, 3) [g] where the largest of them, in units of its bound, is least."""
    here = result.linearised
    return here.residual_at(chebyshev_centre(here)[1]).reshape(-1, 3)


def witness_section(result: Calibration, numbers: NDArray) -> list[Section]:
    """The readings that prove that no parameters fit; a section, or none."""
    if not result.witness:
        return []
    here = result.linearised
    left = centre_residual(result) / here.bound.reshape(-1, 3)
    rows: list[list[Cell]] = [
        [
            int(numbers[i]),
            int(axis) + 1,
            Written(minus(f"{np.degrees(here.positions.alpha[i]):.4f}")),
            Written(minus(f"{np.degrees(here.positions.beta[i]):.4f}")),
            Written(minus(f"{here.input[i, axis]:.3f}")),
            Written(minus(f"{left[i, axis]:+.2f}")),
        ]
        for i, axis in np.argwhere(proved(result, numbers))
    ]
    return [
        Section(
            "Evidence: the readings that prove it",
            [
                f"These {len(result.witness)} readings alone, whatever the others are, cannot all be within "
                f"{result.radius:.3g} σ of any parameters' prediction. If one of them is known to be spoilt, leave its "
                "row out and look again."
            ],
            table=Table(
                ["position", "accelerometer", "α [deg]", "β [deg]", "its input [g]", "at best off by [σ]"], rows
            ),
        )
    ]


def ranking_section(result: Diagnosis) -> list[Section]:
    """What each effect would leave; a section, or none."""
    if not result.tried:
        return []
    shown = result.tried[:MOST_RANKED]
    return [
        Section(
            "Evidence: which effect mends it",
            [
                f"Each of the {len(result.tried)} effects of the catalogue that are linear was added to the model in "
                f"turn. At or below one σ the extended model explains every reading. {how_many_mend(result.tried)}",
                *refused_words(result),
            ],
            candidates([title for title, _ in shown], [radius for _, radius in shown]),
            f"Least largest residual that each effect leaves, in units of σ; the best {len(shown)}.",
        )
    ]


def how_many_mend(tried: Sequence[tuple[str, float]]) -> str:
    """How many effects, each with the radius that it leaves, bring everything within its bound."""
    mending = sum(radius <= 1.0 for _, radius in tried)
    return {0: "None of them does.", 1: "One does."}.get(mending, f"{mending} do.")


def refused_words(result: Diagnosis) -> list[str]:
    """How many effects mend the record by themselves and are still not among the sets that remain; none where none."""
    remaining = {
        place.title
        for finding in result.findings
        if len(finding.causes) == 1
        for cause in finding.causes
        for place in (cause.place, *cause.alike)
    }
    refused = sum(radius <= 1.0 and title not in remaining for title, radius in result.tried)
    if not refused or not remaining:
        return []
    which = "One of them is" if refused == 1 else f"{refused} of them are"
    return [
        f"{which} not among the sets that remain: only a size that is not possible, or only to first order, mends it."
    ]


def confusion_section(result: Diagnosis) -> list[Section]:
    """What could be taken for what at these positions, and the classes; a section, or none."""
    places = compared(result)
    if len(places) < 2:
        return []
    alike = likeness(result.evidence, places)
    rows: list[Sequence[Cell]] = [
        [cause.place.title, ", ".join(e.title for e in cause.alike)]
        for finding in result.findings
        for cause in finding.causes
        if cause.equivalents
    ]
    rows += [
        ["the set that was named", " and ".join(place.title for place in members)] for members in result.equal_sets
    ]
    said = [ALIKE.format("at the positions of this record, beyond what the model's parameters imitate")]
    if result.findings and not rows:
        said.append("What was found is alone in its class: some measurement on this bench tells it from every other.")
    return [
        Section(
            CONFUSION,
            said,
            likeness_picture([place.title for place in places], alike),
            "Cosine of the least angle between what two effects add to the readings.",
            Table(["effect", "no measurement with these mountings tells it from"], unrepeated(rows)) if rows else None,
        )
    ]


def unrepeated(rows: Sequence[Sequence[Cell]]) -> list[Sequence[Cell]]:
    """The rows, each once."""
    return [row for k, row in enumerate(rows) if row not in rows[:k]]


def compared(result: Diagnosis) -> tuple[EffectPlace, ...]:
    """The effects that were found, then the best ranked ones; those with a signature."""
    places = [place for place in result.evidence.places if is_linear(place) and place.effect != "outlier"]
    titles = [title for title, _ in result.tried]
    return compared_places(places, [finding.places for finding in result.findings], titles)


MOST_BARS = 18
FIGURES = ("rms_before", "rms_after", "max_before", "max_after")


def judgement_sections(result: Diagnosis) -> list[Section]:
    """Positions and times that were left out, and shuffles; a section, or none."""
    judgement = result.witness
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
    halves = [half_width(t["low"], t["high"]) for t in result.targets]
    drawn, reach = bars(
        [
            Bar(None, *(None if end is None else (end - t["after"]) / sigma for end in (t["low"], t["high"])))
            for t in result.targets
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


def shares(entries: Sequence[Mapping[str, Any]], of: str = "accelerometer") -> str:
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


OPTIONAL = ("mounting", "approach_alpha", "approach_beta")
MOST_LABELS = 24
"""Up to so many positions are numbered in the picture."""
SENSES = {1: "forwards", -1: "backwards"}


def next_positions_csv(positions: Sequence[Mapping[str, Any]]) -> str:
    """Positions as CSV: their number, both angles [deg], and mounting and senses of the approach where they matter."""
    names = ["position", "alpha_deg", "beta_deg", *(name for name in OPTIONAL if any(name in p for p in positions))]
    rows = [
        ",".join([str(k), *(str(position.get(name, "")) for name in names[1:])])
        for k, position in enumerate(positions, start=1)
    ]
    return "\n".join([",".join(names), *rows, ""])


def next_sections(here: Linearisation, positions: Sequence[Mapping[str, Any]]) -> list[Section]:
    """The proposed positions on the sphere, as a table and as a file; a section, or none."""
    if not positions:
        return []
    at = here.positions
    alpha, beta = (np.radians([float(p[name]) for p in positions]) for name in ("alpha_deg", "beta_deg"))
    header = ["no.", "α [deg]", "β [deg]"]
    columns = [name for name in OPTIONAL if any(name in p for p in positions)]
    header += [name.replace("approach_alpha", "α turned").replace("approach_beta", "β turned") for name in columns]
    separates = any(p.get("separates") for p in positions)
    header += ["tells apart", "by [σ]"] if separates else []
    rows: list[list[Cell]] = []
    for k, p in enumerate(positions, start=1):
        row: list[Cell] = [k, *(Written(minus(f"{float(p[name]):g}")) for name in ("alpha_deg", "beta_deg"))]
        row += [SENSES.get(p[name], str(p[name])) if name in p else "" for name in columns]
        if separates:
            apart = p.get("apart_g")
            told = None if apart is None else Written(f"{max(apart, 0.0) / sigma(here) + 0.0:.2g}")
            row += [", ".join(p.get("separates", ())), told]
        rows.append(row)
    said = ["Readings at these positions besides would determine what is open."]
    if separates:
        sure = len(deciding(here, positions))
        said = [
            "Predictions of the two candidates that a position is for differ there, or at another of the positions for "
            "the same two, by at least the last column, whatever their parameters. More than 2 σ decides between them "
            f"in any noise: {sure or 'none'} of {len(positions)} positions do."
        ]
    labels = [str(k) for k in range(1, len(positions) + 1)]
    return [
        Section(
            "Where to measure next",
            said,
            next_directions(at.alpha, at.beta, alpha, beta, labels if len(labels) <= MOST_LABELS else [""]),
            "The vertical as the inner frame sees it at each position; equal areas are equal solid angles.",
            Table(header, rows),
            download=Download(
                "next-positions.csv", next_positions_csv(positions), "next-positions.csv, to take to the table"
            ),
        )
    ]


def deciding(here: Linearisation, positions: Sequence[Mapping[str, Any]]) -> list[Mapping[str, Any]]:
    """The positions at which two candidates surely differ."""
    return [p for p in positions if p.get("apart_g") is not None and p["apart_g"] > 2.0 * sigma(here)]


def sigma(here: Linearisation) -> float:
    """σ as a fraction of g."""
    return float(here.bound.min())
