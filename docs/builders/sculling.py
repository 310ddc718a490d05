"""Drift of the velocity under sculling: a table of docs/figures.md; `python docs/builders/sculling.py docs`."""

import math
import sys
from pathlib import Path

import numpy as np
from numpy.polynomial import Polynomial

from costs import between_marks
from trihedron.fmus.instruments import VELOCITY_COMPUTER
from trihedron.fmus.source import instantiate, references
from trihedron.models.attitude_algorithms import Algorithm, adaptive
from trihedron.models.attitude_algorithms.definition import SUM
from trihedron.tools.files import write_text
from trihedron.tools.motion import algorithm_named

PAGE = "figures.md"
PHASES = (0.2, 0.8)
"""Approximate Ω Δt of one sample [rad]; adjusted so that a whole number of steps makes a period."""
SHOWN = (
    "mean-rate",
    "two-sample-rodrigues",
    "panov",
    "three-sample-coning",
    "four-sample-coning",
    "functional-iteration-8",
    "adaptive-degree",
)
"""Algorithms of the table."""
TURN = 1e-5
"""A: amplitude of the turn [rad]."""


def nearest_phase(algorithm: Algorithm, phase: float) -> float:
    """Return the nearest phase of a sample with which a whole number of steps makes a period."""
    return 2.0 * math.pi / algorithm.samples / round(2.0 * math.pi / (phase * algorithm.samples))


def products_by_distance(algorithm: Algorithm) -> dict[int, float]:
    """Return sums of the k_ij over pairs of one distance; for an iteration, those of the polynomial through its
    increments."""
    products = [(i, j, float(k)) for i, j, k in algorithm.products]
    if not products and algorithm.samples > 1:
        count = algorithm.samples
        at = np.arange(count + 1)
        angles = [Polynomial.fit(at, at > i, count) for i in range(count)]
        for i in range(count):
            for j in range(i + 1, count):
                swept = angles[i] * angles[j].deriv() - angles[j] * angles[i].deriv()
                products.append((i, j, 0.5 * float(swept.integ()(count) - swept.integ()(0))))
    sums: dict[int, float] = {}
    for i, j, k in products:
        for first in range(j) if i == SUM else [i]:
            sums[j - first] = sums.get(j - first, 0.0) + k
    return sums


def theory(algorithm: Algorithm, phase: float) -> float:
    """Return the relative drift: (Σ k_p 4 sin²(x/2) sin(p x) - (N x - sin N x)/2) / (N x/2)."""
    samples, factors = algorithm.samples, products_by_distance(algorithm)
    if algorithm.number == 27 and phase > 0.6:
        # Not smooth: each increment is a step, with those before it.
        samples, factors = 1, {p: getattr(adaptive, f"C_{p}") for p in range(1, 9)}
    whole = samples * phase
    made = sum(k * 4.0 * math.sin(0.5 * phase) ** 2 * math.sin(p * phase) for p, k in factors.items())
    return (made - 0.5 * (whole - math.sin(whole))) / (0.5 * whole)


def measured(algorithm: Algorithm, phase: float) -> float:
    """Return the relative drift over a second period of θ = A sin Ωt and f = B sin Ωt across it, by the computer
    itself."""
    count = round(2.0 * math.pi / phase)
    model, at = instantiate(VELOCITY_COMPUTER), references(VELOCITY_COMPUTER)
    model.set(at["algorithm"], algorithm.number)
    model.set(at["sample_period"], 1.0)
    assert model.initialise(0.0) == 0
    reached = []
    for k in range(2 * count):
        begin, end = k * phase, (k + 1) * phase
        model.set(at["increment[1]"], TURN * 2.0 * math.cos(0.5 * (begin + end)) * math.sin(0.5 * phase))
        model.set(at["velocity_increment[2]"], 2.0 * math.sin(0.5 * (begin + end)) * math.sin(0.5 * phase))
        assert model.do_step(float(k), 1.0) == 0
        reached.append(model.get(at["velocity[3]"]))
    # B J1(A), except for A²/8 of it.
    return (reached[-1] - reached[count - 1]) / (math.pi * TURN) - 1.0


def drift_table() -> str:
    """Return the remaining drift over the drift to compute, in Markdown."""
    lines = [
        "| algorithm | order | " + " | ".join(f"Ω Δt = {p:g}" for p in PHASES) + " |",
        "|---|---|" + "---|" * len(PHASES),
    ]
    for name in SHOWN:
        algorithm = algorithm_named(name)
        cells = [f"{measured(algorithm, nearest_phase(algorithm, phase)):.2e}" for phase in PHASES]
        lines.append(f"| `{name}` | {algorithm.order} | {' | '.join(cells)} |")
    return "\n".join(lines)


def make_page(docs: Path) -> Path:
    """Write the table into the page."""
    page = docs / PAGE
    write_text(page, between_marks(page.read_text(encoding="utf-8"), "drifts", drift_table()))
    return page


if __name__ == "__main__":
    print(make_page(Path(sys.argv[1] if len(sys.argv) > 1 else "docs")))
