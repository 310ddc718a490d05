"""Reference pages and pictures, made from the source: `python docs/builders/reference.py DOCS`."""

import math
import re
import sys
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Patch, Polygon
from numpy.typing import NDArray

from trihedron.fmus import components
from trihedron.fmus.component import Component, Variable
from trihedron.fmus.units import UNITS
from trihedron.models.effects import CATALOGUE, POSITION_EFFECTS, Effect, EffectParameter, EffectPlace
from trihedron.tools.bounded.centre import Bounded, analytic_centre
from trihedron.tools.calibration.model import Linearisation, Positions, linearise, parametrise
from trihedron.tools.diagnosis import diagnose
from trihedron.tools.evidence.bench_visits import Circumstances, Visits, acted_on, signature_columns
from trihedron.tools.files import write_text
from trihedron.tools.reports.evidence import residual_sections
from trihedron.tools.reports.pictures import (
    ALERT,
    AXES,
    BAND,
    DASHES,
    FIRST,
    INK,
    MUTED,
    SECOND,
    THIRD,
    WIDTH,
    drawing,
    svg_text,
)
from trihedron.tools.trials.bench import NOISE_BOUND
from trihedron.tools.trials.draw import draw_alone

PICTURE_SEED = 2026
"""Seed of the record in the README."""

POINTS = 181
COLUMNS = 4
SHOWN_LEVELS = {
    "dead-zone": (0.2,),
    "saturation": (0.8,),
    "quantisation": (0.2,),
    "exchanged-readings": (0.5,),
    "bias-step": (1.0, 0.5),
    "scale-step": (1.0, 0.5),
    "mounting-slip": (0.3, -0.5, 0.4, 0.5),
    "warm-up": (1.0, 0.25),
    "thermal-lag": (0.1, 0.0, 0.1),
}
"""Levels [g], and times [h], at which effects that are not linear are drawn: coarse, to be visible."""
SHOWN_ORDER = 2
READINGS = np.array([[1.0, 0.15], [0.25, 1.0], [0.75, -0.85]])
"""Dependence of three readings on two parameters."""
TRUTH = np.array([0.2, 0.1])
ERRORS = np.array([-0.6, 0.5, 0.8])
"""Errors of the readings in units of σ."""
MOVED = np.array([0.0, 0.0, 2.2])
"""Change of the readings by the missing effect, in units of σ."""
REACH = 3.1


INTRODUCTION = """# Reference: components and effects

`trihedron export NAME` writes a component as FMU. `trihedron check NAME.fmu` lists its variables;
`documentation/index.html` in the FMU has their units, start values and equations.

| component | content |
|---|---|
"""

COMPONENTS_INTRODUCTION = """# Components

Start value and unit of a variable are in brackets. Vectors have elements `name[1]`, `name[2]`, ... Parameters are fixed
unless marked *tunable*.
"""

EFFECTS_INTRODUCTION = """## Effects

The picture shows the change of the readings of accelerometers 1 (solid), 2 (dashed) and 3 (dotted) of a perfect bench.
Dead zone and rounding are 0.2 g, saturation is 0.8 g, harmonics are of second order.

![Effects](pictures/effects.svg)

The tables give the largest size that the diagnosis considers; t is the time in hours, p the axis.
"""

ALGORITHM = "the number of a row of the [table of algorithms](attitude-algorithms.md#orders)"
"""Meaning of a variable that selects an algorithm, in place of their list."""

GROUPS = (("Inputs", "input"), ("Parameters", "parameter"), ("Outputs", "output"))


def reference_page() -> str:
    """Return the components and the catalogue of effects, in Markdown."""
    rows = "".join(f"| `{component.name}` | {component.description} |\n" for component in components().values())
    parts = [INTRODUCTION + rows, EFFECTS_INTRODUCTION]
    by_place: dict[str, list[str]] = {}
    for effect in CATALOGUE.values():
        if not effect.of_law:
            by_place.setdefault(place_text(effect), []).append(effect_line(effect))
    for place, lines in by_place.items():
        parts += [f"### {place}", "", "| effect | change | parameters |", "|---|---|---|", *lines, ""]
    return "\n".join(parts)


def components_page() -> str:
    """Return the components with equations and variables, in Markdown."""
    parts = [COMPONENTS_INTRODUCTION]
    described: dict[tuple, str] = {}
    for component in components().values():
        parts += component_lines(component, described)
    return "\n".join(parts)


def component_lines(component: Component, described: dict[tuple, str]) -> list[str]:
    """Return a component's equations and its variables, which join those that were `described` with a component."""
    lines = [f"## {component.name}", "", f"{component.description}. Source: {component.source}.", ""]
    lines += [*(f"    {line}" for line in component.equations), ""]
    for title, causality in GROUPS:
        items: list[str] = []
        known: dict[str, list[str]] = {}
        for variables in alike([v for v in component.interface if v.causality == causality]):
            key = (variables[0].name, variables[0].description, variables[0].starts)
            if key in described:
                known.setdefault(described[key], []).extend(name_text(v) for v in variables)
            else:
                described[key] = component.name
                items.append(variables_line(variables))
        items += [f"- as in [{name}](#{name.lower()}): {', '.join(names)}" for name, names in known.items()]
        lines += [f"**{title}**", "", *items, ""] if items else []
    return lines


def alike(variables: Sequence[Variable]) -> list[list[Variable]]:
    """Return the variables in groups; those whose descriptions differ in digits only are of one group."""
    groups: dict[str, list[Variable]] = {}
    for variable in variables:
        groups.setdefault(re.sub(r"\d", "", variable.description), []).append(variable)
    return list(groups.values())


def name_text(variable: Variable) -> str:
    """Return the name of a variable with its indices."""
    return f"`{variable.name}[1..{variable.size}]`" if variable.size else f"`{variable.name}`"


def variables_line(variables: Sequence[Variable]) -> str:
    """Return an item of a list for variables that mean the same: names, start value, unit, meaning of the first."""
    variable = variables[0]
    values = variable.starts if len(set(variable.starts)) > 1 else variable.starts[:1]
    start = ", ".join(f"{value:g}" for value in values) if variable.causality != "output" else ""
    unit = UNITS[variable.unit].name if variable.type == "real" and variable.unit != "1" else ""
    tunable = "tunable" if variable.variability == "tunable" else ""
    details = ", ".join(text for text in (f"{start} {unit}".strip(), tunable) if text)
    text = ", ".join(name_text(v) for v in variables) + (f" ({details})" if details else "")
    meaning = ALGORITHM if variable.name == "algorithm" else variable.description
    return f"- {text}: {meaning}" + (", and so on" if len(variables) > 1 else "")


def place_text(effect: Effect) -> str:
    """Return the places of an effect as a heading, with the component that it extends."""
    places = ", ".join(dict.fromkeys(place.where for place in effect.places)) or "any reading"
    places = places.replace("accelerometer-1, accelerometer-2, accelerometer-3", "accelerometer-1 to accelerometer-3")
    return f"{places} ({effect.component})" if effect.component else places


def effect_line(effect: Effect) -> str:
    """Return a row of the table of effects."""
    variants: dict[str, list[str]] = {}
    parameters: dict[str, EffectParameter] = {}
    for place in effect.places:
        words = place.title.removeprefix(effect.name).strip().removeprefix(place.where).strip()
        kind, _, values = words.partition(" ")
        if values and values not in variants.setdefault(kind, []):
            variants[kind].append(values)
        parameters.update({p.name: p for p in effect.at(place).parameters})
    name = f"`{effect.name}`" + "".join(f", {kind} {', '.join(values)}" for kind, values in variants.items())
    limits: dict[tuple[str, float], list[str]] = {}
    for p in parameters.values() or effect.parameters:
        limits.setdefault((p.unit, p.largest), []).append(p.name)
    texts = []
    for (unit, largest), names in limits.items():
        stem = names[0].rstrip("0123456789_")
        numbered = len(names) > 2 and all(name.startswith(f"{stem}_") for name in names)
        shown = f"{names[0]}..{names[-1].removeprefix(f'{stem}_')}" if numbered else ", ".join(names)
        limit = "π" if largest == math.pi else f"{largest:g}"
        texts.append(f"{shown} ≤ {limit} {unit.removeprefix('1')}".strip())
    sizes = ", ".join(texts).replace("_", "\\_")
    return f"| {name} | {formula_text(effect)} | {sizes} |"


def formula_text(effect: Effect) -> str:
    """Return an effect's formula with its parameters' names; if places differ, each formula."""
    letters = {"p": "p", "i": "i", "j": "j", "angle": "angle", "order": "order"}
    names = {p.name: p.name for place in effect.places for p in effect.at(place).parameters}
    names |= {p.name: p.name for p in effect.parameters}
    formulas = dict.fromkeys(effect.at(place).formula for place in effect.places or ())
    texts = [formula.format(**letters, **names).replace("'", "") for formula in formulas or {effect.formula: None}]
    texts = [re.sub(r"\((\w*phase)\)", r"\1", text) for text in texts]
    # A matrix is shown by its first and its last element, a vector by its element p.
    texts = [re.sub(r"\[(\w+) ;.*; (\w+)\]", r"[\1 … \2]", text).replace(", t in hours", "") for text in texts]
    texts = [re.sub(r"\(([^(,]*_1[^(,]*), [^(]*_2[^(,]*, [^(]*_3[^(]*?\)", element_text, text) for text in texts]
    return "; ".join(text.replace("|", "\\|").replace("_", "\\_").replace("*", "\\*") for text in texts if text)


def element_text(vector: re.Match) -> str:
    """Return the element p of a vector in brackets; the vector itself if its elements differ in more than the index."""
    elements = vector.group().strip("()").split(", ")
    general = [element.replace(f"_{k}", "_p") for k, element in enumerate(elements, 1)]
    return general[0] if len(set(general)) == 1 else vector.group()


@dataclass(frozen=True)
class Sweep:
    """A row of positions along which one quantity changes.

    Attributes
    ----------
    label : str
        the quantity, with its unit
    along : (N,) array
        its values
    at : Positions
        the positions
    circumstances : Circumstances
        times, temperatures and senses of approach
    """

    label: str
    along: NDArray
    at: Positions
    circumstances: Circumstances


def shown_place(effect: Effect) -> EffectPlace:
    """Return the place at which an effect is drawn: the first, of second order if it has orders."""
    places = [place for place in effect.places if place.order in (None, SHOWN_ORDER)]
    return (places or [EffectPlace("outlier", "position-91", None, (1,))])[0]


def sweep_of(effect: Effect, place: EffectPlace) -> Sweep:
    """Return the sweep for an effect: time, temperature, an angle of the table, or the input of the accelerometer."""
    steps = np.linspace(0.0, 1.0, POINTS)
    turn, still, ones = 2.0 * math.pi * steps, np.zeros(POINTS), np.ones(POINTS)
    hours, temperature, senses = still, 20.0 * ones, ones
    # At α = 90° the first input is sin β; a tilted table shows turns of every kind.
    alpha, beta, label = 0.5 * math.pi * ones, math.asin(1.0) * (2.0 * steps - 1.0), "input [g]"
    along = np.sin(beta)
    if effect.name.endswith(("drift", "step", "slip")) or effect.name in (
        "exchanged-readings",
        "warm-up",
        "thermal-lag",
    ):
        # A temperature that jumps shows a lag.
        temperature = np.where(steps < 0.2, 20.0, 30.0)
        hours, label, along = steps, "time [h]", steps
        alpha, beta = 1.1 * ones, 0.6 * ones
    elif "temperature" in effect.needs:
        temperature, label = 10.0 + 20.0 * steps, "temperature [°C]"
        alpha, beta, along = 1.1 * ones, 0.6 * ones, temperature
    elif place.where == "outer-axis":
        alpha, beta, label, along = turn, 0.6 * ones, "outer angle [°]", 360.0 * steps
    elif place.where == "inner-axis":
        alpha, beta, label, along = 1.1 * ones, turn, "inner angle [°]", 360.0 * steps
    elif place.effect == "outlier":
        label, along = "position", np.arange(1.0, POINTS + 1.0)
    if effect.name in ("backlash", "hysteresis"):
        # There and back.
        half = POINTS // 2
        order = np.append(np.arange(0, POINTS, 2), np.arange(POINTS - 2, -1, -2))
        alpha, beta, along = alpha[order], beta[order], along[order]
        senses = np.append(np.ones(half + 1), -np.ones(POINTS - half - 1))
    circumstances = Circumstances(hours, temperature, senses, senses, True)
    return Sweep(label, along, Positions(alpha, beta, np.zeros(POINTS, dtype=int)), circumstances)


def change_along(effect: Effect, place: EffectPlace, sweep: Sweep) -> NDArray:
    """Return changes (N, 3) of the readings, over the size of a linear effect [g per unit], or at a level [g]."""
    here = perfect_bench(sweep.at)
    rows = Visits(here.parametrisation, sweep.at, sweep.circumstances).rows(here.point)
    if not effect.linear:
        clean = rows.prediction
        if effect.component == "TurntableMotion":
            *turns, start = SHOWN_LEVELS[effect.name]
            return rows.by_slip @ np.array(turns) * (rows.hours > start)[:, None]
        return acted_on([(place, SHOWN_LEVELS[effect.name])], rows, clean) - clean
    if effect.name == "hysteresis":
        # One axis moves, and the input's way there and back is known.
        rows = replace(rows, input_sense=np.repeat(sweep.circumstances.sense_beta[:, None], 3, axis=1))
    columns = signature_columns([place], rows)
    return columns[:, 0].reshape(-1, 3)


def perfect_bench(at: Positions) -> Linearisation:
    """Return a bench without errors."""
    p = parametrise({"identity": np.eye(3)})
    count = len(at.alpha)
    return linearise(p, at, np.zeros((count, 3)), np.zeros(len(p.symbols)), np.ones(3 * count))


def effect_sheet(effects: Sequence[Effect] | None = None) -> str:
    """Return every effect of the catalogue, one small picture each (SVG).

    Parameters
    ----------
    effects : sequence of Effect, optional
        by default those that a record of positions can show

    Returns
    -------
    str
        the SVG
    """
    shown = list(POSITION_EFFECTS.values()) if effects is None else list(effects)
    lines = -(-len(shown) // COLUMNS)
    with drawing():
        figure = Figure(figsize=(WIDTH, 1.55 * lines), layout="constrained")
        grid = figure.subplots(lines, COLUMNS, squeeze=False).ravel()
        for axes, effect in zip(grid, shown, strict=False):
            place = shown_place(effect)
            sweep = sweep_of(effect, place)
            change = change_along(effect, place, sweep)
            for p in range(3):
                if np.any(change[:, p] != 0.0):
                    axes.plot(sweep.along, change[:, p], color=AXES[p].light, linestyle=DASHES[p], linewidth=1.1)
            axes.set_title(effect.name + (f" ({SHOWN_ORDER})" if place.order else ""), fontsize=7.5)
            axes.set_xlabel(sweep.label, fontsize=6.5)
            axes.tick_params(labelsize=6)
        for axes in grid[len(shown) :]:
            axes.set_visible(False)
        return svg_text(figure, "What each effect does to the readings of the three accelerometers")


def strips_picture() -> str:
    """Draw three readings with their bounds in the plane of two parameters: consistent, and falsified (SVG)."""
    with drawing():
        figure = Figure(figsize=(WIDTH, 3.5), layout="constrained")
        panels = figure.subplots(1, 2, sharey=True)
        for axes, moved, title in zip(panels, (0.0 * MOVED, MOVED), ("consistent", "falsified"), strict=True):
            _strips(axes, READINGS @ TRUTH + ERRORS + moved)
            axes.set_title(title)
        panels[0].set_ylabel("second parameter [σ]")
        return svg_text(figure, "Three readings allow three strips of parameters; with and without a common point")


def interval_picture() -> str:
    """Draw a guaranteed error and an exact interval on the set of possible parameters (SVG)."""
    reading = READINGS @ TRUTH + ERRORS
    with drawing():
        figure = Figure(figsize=(WIDTH, 4.6), layout="constrained")
        above, below = figure.subplots(2, 1, sharex=True, height_ratios=(4.2, 1.0))
        corners = _strips(above, reading)
        above.set_ylabel("second parameter [σ]")
        above.set_aspect("auto")
        above.set_ylim(-2.2, 1.6)
        low, high = float(corners[:, 0].min()), float(corners[:, 0].max())
        weights = _best_weights(np.array([1.0, 0.0]))
        estimate, error = float(weights @ reading), float(np.abs(weights).sum())
        look: dict[str, Any] = {"solid_capstyle": "butt"}
        below.plot([estimate - error, estimate + error], [0.0, 0.0], color=BAND.light, linewidth=15.0, **look)
        below.plot([low, high], [0.0, 0.0], color=FIRST.light, linewidth=4.0, label="low to high", **look)
        below.plot([estimate], [0.0], "o", mfc="none", mec=INK.light, markersize=4.5, label="a priori")
        centre = analytic_centre(Bounded(READINGS, reading, np.ones(len(reading))))
        assert centre is not None
        above.plot(*centre, "o", color=INK.light, markersize=4.5)
        below.plot([centre[0]], [0.0], "o", color=INK.light, markersize=4.5, label="estimate")
        below.plot([TRUTH[0]] * 2, [-0.45, 0.45], color=SECOND.light, linewidth=2.0, label="truth")
        for end in (low, high):
            above.axvline(end, color=MUTED.light, linestyle=":")
            below.axvline(end, color=MUTED.light, linestyle=":")
        below.set_ylim(-0.7, 0.7)
        below.set_yticks([])
        below.grid(visible=False)
        above.set_xlabel("")
        below.set_xlabel("first parameter [σ]")
        band = Patch(facecolor=BAND.light, label="guaranteed error")
        figure.legend(handles=[band, *below.get_legend_handles_labels()[0]], loc="outside upper left", ncols=5)
        return svg_text(figure, "The set of possible parameters, its extent along the first, and the guaranteed error")


def _strips(axes: Axes, reading: NDArray) -> NDArray:
    """Draw the strips |r − f·x| ≤ 1 and their common points; return the corners (K, 2) of these."""
    colours = (FIRST, SECOND, THIRD)
    for row, value, colour in zip(READINGS, reading, colours, strict=True):
        along = np.array([-row[1], row[0]]) / np.linalg.norm(row)
        middle = row * value / (row @ row)
        across = row / (row @ row)
        ends = [middle + s * 12.0 * along + t * across for s, t in ((-1, -1), (1, -1), (1, 1), (-1, 1))]
        axes.add_patch(Polygon(ends, facecolor=colour.light, alpha=0.16, linewidth=0))
        for t in (-1.0, 1.0):
            line = np.array([middle - 12.0 * along + t * across, middle + 12.0 * along + t * across])
            axes.plot(line[:, 0], line[:, 1], color=colour.light, linewidth=1.0)
    corners = _corners(reading)
    if len(corners):
        axes.add_patch(Polygon(corners, facecolor=INK.light, alpha=0.55, linewidth=0))
        axes.plot(*TRUTH, marker="+", color=INK.light, markersize=9, markeredgewidth=1.6)
    else:
        axes.text(0.03, 0.04, "no common point", transform=axes.transAxes, color=ALERT.light)
    axes.set_xlim(-REACH, REACH)
    axes.set_ylim(-REACH, REACH)
    axes.set_aspect("equal")
    axes.set_xlabel("first parameter [σ]")
    return corners


def _corners(reading: NDArray) -> NDArray:
    """Return the corners (K, 2) of the polygon in which all strips meet, in order around it; none if they do not
    meet."""
    found = []
    for i in range(len(READINGS)):
        for j in range(i):
            for s in (-1.0, 1.0):
                for t in (-1.0, 1.0):
                    x = np.linalg.solve(READINGS[[i, j]], reading[[i, j]] + np.array([s, t]))
                    if np.abs(READINGS @ x - reading).max() <= 1.0 + 1e-9:
                        found.append(x)
    if not found:
        return np.zeros((0, 2))
    corners = np.array(found)
    away = corners - corners.mean(axis=0)
    return corners[np.argsort(np.arctan2(away[:, 1], away[:, 0]), kind="stable")]


def _best_weights(target: NDArray) -> NDArray:
    """Return weights (3,) of least sum of absolute values with which the rows add up to a target: two of them."""
    best = np.full(len(READINGS), np.inf)
    for i in range(len(READINGS)):
        for j in range(i):
            weights = np.zeros(len(READINGS))
            weights[[i, j]] = np.linalg.solve(READINGS[[i, j]].T, target)
            if np.abs(weights).sum() < np.abs(best).sum():
                best = weights
    return best


def readme_picture() -> str:
    """Draw residuals of a record with a hidden effect, before and after the extension of the simulation (SVG)."""
    record = draw_alone(PICTURE_SEED, effects=["quadratic"]).measured()
    sections = residual_sections(diagnose(record, noise_bound=NOISE_BOUND, rerun=False))
    picture = sections[0].picture
    return "" if picture is None else picture.svg()


def main(arguments: list[str]) -> None:
    """Write reference.md and its pictures into the named folder."""
    docs = Path(arguments[0]) if arguments else Path("docs")
    write_text(docs / "reference.md", reference_page())
    write_text(docs / "pictures" / "residuals.svg", readme_picture())
    write_text(docs / "pictures" / "effects.svg", effect_sheet())
    write_text(docs / "pictures" / "strips.svg", strips_picture())
    write_text(docs / "pictures" / "intervals.svg", interval_picture())


if __name__ == "__main__":
    main(sys.argv[1:])
