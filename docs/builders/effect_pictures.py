"""What each effect of the catalogue does to readings, drawn against what it depends on."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

from trihedron.models.effects import POSITION_EFFECTS, Effect, EffectPlace
from trihedron.tools.calibration.model import Linearisation, Positions, linearise, parametrise
from trihedron.tools.evidence.bench_effects import Circumstances, Visits, acted_on, signature_columns
from trihedron.tools.reports.pictures import AXES, DASHES, WIDTH, drawing, svg_text

POINTS = 181
COLUMNS = 4
SHOWN_LEVELS = {"dead-zone": 0.2, "saturation": 0.8, "quantisation": 0.2}
"""Levels [g] at which effects that are not linear are drawn: coarse ones, so that they can be seen."""
SHOWN_ORDER = 2


@dataclass(frozen=True)
class Sweep:
    """A row of positions along which one thing changes.

    Attributes
    ----------
    label : str
        what changes, with its unit
    along : (N,) array
        its values
    at : Positions
    circumstances : Circumstances
    """

    label: str
    along: NDArray
    at: Positions
    circumstances: Circumstances


def shown_place(effect: Effect) -> EffectPlace:
    """The place at which an effect is drawn: the first, of second order where it has orders."""
    places = [place for place in effect.places if place.order in (None, SHOWN_ORDER)]
    return (places or [EffectPlace("outlier", "position-91", None, (1,))])[0]


def sweep_of(effect: Effect, place: EffectPlace) -> Sweep:
    """Along what an effect is drawn: time, temperature, an angle of the table, or the input of the accelerometer."""
    steps = np.linspace(0.0, 1.0, POINTS)
    turn, still, ones = 2.0 * math.pi * steps, np.zeros(POINTS), np.ones(POINTS)
    hours, temperature, senses = still, 20.0 * ones, ones
    # At α = 90° the first input is sin β; a tilted table shows turns of every kind.
    alpha, beta, label = 0.5 * math.pi * ones, math.asin(1.0) * (2.0 * steps - 1.0), "input [g]"
    along = np.sin(beta)
    if effect.name.endswith("drift"):
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
    """Changes (N, 3) of the readings, over the size of a linear effect [g per unit], or at a level [g]."""
    here = perfect_bench(sweep.at)
    rows = Visits(here.parametrisation, sweep.at, sweep.circumstances).rows(here.point)
    if effect.variants is not None:
        clean = rows.prediction
        return acted_on([(place, (SHOWN_LEVELS[effect.name],))], rows, clean) - clean
    if effect.name == "hysteresis":
        # One axis moves, and the way there and back of the input is known.
        rows = replace(rows, input_sense=np.repeat(sweep.circumstances.sense_beta[:, None], 3, axis=1))
    columns = signature_columns([place], rows)
    return columns[:, 0].reshape(-1, 3)


def perfect_bench(at: Positions) -> Linearisation:
    """A bench without errors."""
    p = parametrise({"identity": np.eye(3)})
    count = len(at.alpha)
    return linearise(p, at, np.zeros((count, 3)), np.zeros(len(p.symbols)), np.ones(3 * count))


def effect_sheet(effects: Sequence[Effect] | None = None) -> str:
    """Every effect of the catalogue, one small picture each (SVG).

    Parameters
    ----------
    effects : sequence of Effect, optional
        by default those that a record of positions can show
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
