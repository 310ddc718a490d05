"""Accuracy against cost of the attitude algorithms: the numbers and pictures of the page that helps to choose one.

`python docs/builders/choosing.py docs` makes the tables of docs/choose-an-attitude-algorithm.md and the
pictures under docs/pictures again.
"""

import math
import sys
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from operations import operations_of_update
from trihedron.models.attitude_algorithms import ALGORITHMS, Algorithm
from trihedron.models.attitude_algorithms.inputs import INPUT_KINDS, order_with
from trihedron.models.harmonic_motion import store_harmonics
from trihedron.tools.files import write_text
from trihedron.tools.motion.attitude import algorithm_named, angle_between, attitudes_of_angles
from trihedron.tools.motion.compare import Samples, read_increments, run_algorithm, sample_motion
from trihedron.tools.papers.attitude import EXACT, paper_motion
from trihedron.tools.progress import progress_bar
from trihedron.tools.reports.pictures import (
    ALERT,
    BAND,
    FIRST,
    MUTED,
    SECOND,
    THIRD,
    WIDTH,
    drawing,
    power_of_ten,
    svg_text,
)
from trihedron.tools.rounding import downwards

PAGE = "choose-an-attitude-algorithm.md"

COMPARED = {
    "mean-rate": "(7.18)",
    "one-sample-rodrigues": "(19)",
    "two-sample-rodrigues": "(22)",
    "two-sample-rodrigues-second-iterate": "(23)",
    "two-sample-quaternion": "(7.22)",
    "two-sample-rotation-vector": "2-sample φ",
    "panov-series": "Panov, series",
    "four-sample-coning": "4-sample coning",
    "functional-iteration-4": "iteration, 4",
    "functional-iteration-8": "iteration, 8",
    "adaptive-degree": "adaptive",
}
"""The algorithms of the tables, with a short name for the pictures."""

DURATION = 60.0
"""Length of every run [s]."""

CONE = math.radians(1.0)
"""Half angle of the coning motion."""


@dataclass(frozen=True)
class Situation:
    """A motion and a rate of gyro samples.

    Attributes
    ----------
    motion : str
        of `trihedron.tools.papers.attitude.MOTIONS`
    rate : float
        gyro samples [Hz]
    title : str
    """

    motion: str
    rate: float
    title: str


SITUATIONS = (
    Situation("1", 100.0, "slow, large: ±15°, 1 Hz, at 100 Hz"),
    Situation("first", 2000.0, "vibration 60 to 420 Hz, 2.5'' and 2', at 2 kHz"),
    Situation("second", 1000.0, "ten times stronger, at 1 kHz"),
)
ADAPTIVE = "adaptive-degree"

CHARTED = (
    ("slow, ±15° at 1 Hz, 100 Hz", "1", 100.0),
    ("cone of 1° at 51 Hz, 1 kHz", "coning", 1000.0),
    ("vibration to 420 Hz, 2 kHz", "first", 2000.0),
)
"""Motions of the chart with the rates of their gyro samples [Hz]."""

CHARTED_DURATION = 20.0
"""Length of its runs [s]."""

READINGS = {"exact": (0.0, 0.0), "quanta of 0.5″": (0.5 * math.pi / 648000.0, 0.0), "noise of 20″/s": (0.0, 1e-4)}
"""What gyros make of the motions: quantum [rad] and bound of the noise [rad/s]."""

TIMES = 16
"""How often gyros with quanta or noise are drawn: by one draw alone a worse algorithm may look better by luck."""

ENOUGH = 1.2

KINDS: dict[str, dict[str, Any]] = {
    "formulas": {"color": MUTED.light, "marker": "o", "label": "formulas"},
    "products": {"color": SECOND.light, "marker": "s", "label": "products"},
    "iteration": {"color": THIRD.light, "marker": "^", "label": "iteration"},
}
"""Marks of the algorithms, by the module that they stand in."""

RATES = (500.0, 600.0, 700.0, 800.0, 900.0, 1000.0, 1200.0, 1400.0, 1600.0, 2000.0, 2800.0, 4000.0, 8000.0)
"""Gyro sample rates of the picture of aliasing [Hz]."""

ALIASING_MOTION = "second"
HIGHEST_FREQUENCY = 420.0
"""Of the compositions [Hz]."""

ALIASING_SHOWN = ("mean-rate", "two-sample-rodrigues", "functional-iteration-4", "functional-iteration-8")
CONING_SHOWN = ("mean-rate", "two-sample-rodrigues", "panov", "four-sample-coning", "functional-iteration-8")
CONING_PHASES = tuple(float(x) for x in np.geomspace(0.05, 0.5 * math.pi, 24))
"""Ω Δt: phase of the cone in one gyro sample [rad]."""
LOOKS = (
    {"color": MUTED.light, "marker": "v", "linestyle": "solid"},
    {"color": FIRST.light, "marker": "o", "linestyle": "solid"},
    {"color": SECOND.light, "marker": "s", "linestyle": (0, (5, 1.6))},
    {"color": ALERT.light, "marker": "D", "linestyle": (0, (3, 1.2, 1, 1.2))},
    {"color": THIRD.light, "marker": "^", "linestyle": (0, (1.4, 1.2))},
)
"""Lines of up to five algorithms: they can be told apart without colours."""


def situation_errors(situation: Situation, algorithms: Sequence[Algorithm]) -> list[float]:
    """Largest angle between computed and true attitude over `DURATION` [rad] for each algorithm, increments exact."""
    count = round(DURATION * situation.rate)
    samples = sample_motion(paper_motion(situation.motion, EXACT), 1.0 / situation.rate, count)
    return [_error(algorithm, samples.increments, samples.angles_at_steps(algorithm)) for algorithm in algorithms]


def _error(algorithm: Algorithm, increments: np.ndarray, angles: np.ndarray) -> float:
    attitudes = run_algorithm(algorithm, increments, renormalise=True)
    return float(angle_between(attitudes, attitudes_of_angles(angles)).max())


def operations_per_sample(algorithm: Algorithm) -> float:
    """Operations of the algorithm for one gyro sample, on increments of the slow, large motion."""
    samples = sample_motion(paper_motion("1", EXACT), 0.01, 2 * algorithm.samples)
    return operations_of_update(algorithm, samples.increments) / algorithm.samples


def relative_coning_drift(algorithm: Algorithm, phase: float) -> float:
    """Drift under pure coning that an algorithm leaves, as a fraction of the drift that it has to compute.

    Parameters
    ----------
    phase : float
        Ω Δt of one gyro sample [rad]

    Returns
    -------
    float
        without sign. One update on a body axis frame of the cone: each update errs by the same rotation in a frame that
        goes round with the cone, so its component along the axis of the cone is the drift.
    """
    samples = algorithm.samples
    windows = 3
    u = phase * np.arange(windows * samples + 1)
    sine, slow = math.sin(CONE), 2.0 * math.sin(0.5 * CONE) ** 2
    # λ = (cos(a/2), 0, sin(a/2) cos Ωt, sin(a/2) sin Ωt); ω = 2 λ* ∘ dλ/dt
    # = Ω (-(1 - cos a), -sin a sin Ωt, sin a cos Ωt).
    integral = np.column_stack((-slow * u, sine * np.cos(u), sine * np.sin(u)))
    attitudes = run_algorithm(algorithm, np.diff(integral, axis=0))
    half = 0.5 * CONE
    at = u[::samples]
    true = np.column_stack(
        (np.full(len(at), math.cos(half)), np.zeros(len(at)), math.sin(half) * np.cos(at), math.sin(half) * np.sin(at))
    )
    before, after = attitudes[-2] / np.linalg.norm(attitudes[-2]), attitudes[-1] / np.linalg.norm(attitudes[-1])
    computed = _times(_conjugate(before), after)
    expected = _times(_conjugate(true[-2]), true[-1])
    # The error of one update in the reference frame: λ_n ∘ error ∘ λ_n*.
    error = _times(_times(true[-1], _times(_conjugate(expected), computed)), _conjugate(true[-1]))
    return abs(2.0 * float(error[1])) / (slow * phase * samples)


def _conjugate(q: np.ndarray) -> np.ndarray:
    return q * np.array([1.0, -1.0, -1.0, -1.0])


def _times(p: np.ndarray, q: np.ndarray) -> np.ndarray:
    vector = p[0] * q[1:] + q[0] * p[1:] + np.cross(p[1:], q[1:])
    return np.array([p[0] * q[0] - p[1:] @ q[1:], *vector])


def accuracy_table(errors: Sequence[Sequence[float]]) -> str:
    """Markdown: operations per sample and largest error [deg] in each situation.

    Parameters
    ----------
    errors : sequence of sequence of float
        for each situation, the errors of the compared algorithms [rad]
    """
    lines = [
        "| algorithm | operations per sample | " + " | ".join(s.title for s in SITUATIONS) + " |",
        "|---|---|" + "---|" * len(SITUATIONS),
    ]
    for k, (name, short) in enumerate(COMPARED.items()):
        cells = (f"{math.degrees(found[k]):.1e}" for found in errors)
        cost = operations_per_sample(algorithm_named(name))
        lines.append(f"| `{name}`, {short} | {cost:.0f} | " + " | ".join(cells) + " |")
    return "\n".join(lines)


def order_table() -> str:
    """Markdown: samples, orders and range of every algorithm."""
    lines = [
        "| algorithm | source | samples per step | order | with rates | mixed | order under coning "
        "| longest increment [rad] |",
        "|---|---|---|---|---|---|---|---|",
    ]
    lines += [
        f"| `{a.name}` | {a.source} | {a.samples}{' and those before' if a.previous else ''} | "
        f"{' | '.join(str(order_with(kind, a) or '-') for kind in INPUT_KINDS)} | "
        f"{a.coning_order} | {downwards(a.max_increment)} |"
        for a in ALGORITHMS
    ]
    return "\n".join(lines)


def aliasing_table(errors: Sequence[Sequence[float]], rates: Sequence[float]) -> str:
    """Markdown: largest error [deg] at each rate of gyro samples."""
    lines = [
        "| gyro samples [Hz] | " + " | ".join(f"`{name}`" for name in ALIASING_SHOWN) + " |",
        "|---|" + "---|" * len(ALIASING_SHOWN),
    ]
    for rate, found in zip(rates, errors, strict=True):
        lines.append(f"| {rate:g} | " + " | ".join(f"{math.degrees(error):.1e}" for error in found) + " |")
    return "\n".join(lines)


@dataclass(frozen=True)
class Cell:
    """One field of the chart: of every algorithm the operations per gyro sample and the largest error [deg].

    The error is the root mean square over all draws of quanta or noise.

    `operations` and `degrees` go by the algorithm's name; `title` says motion and readings.
    """

    title: str
    operations: dict[str, float]
    degrees: dict[str, float]

    @property
    def frontier(self) -> list[str]:
        """Those that no cheaper one betters, from the cheapest on."""
        best: list[str] = []
        for name in sorted(self.degrees, key=lambda name: (self.operations[name], self.degrees[name])):
            if not best or self.degrees[name] < self.degrees[best[-1]]:
                best.append(name)
        return best

    @property
    def enough(self) -> str:
        """The cheapest whose error is at most `ENOUGH` times the least."""
        return next(name for name in self.frontier if self.degrees[name] <= ENOUGH * min(self.degrees.values()))


def charted_cells(step: Callable[[], None] = lambda: None) -> list[Cell]:
    """Every algorithm on the motions of `CHARTED`, its gyros exact, with quanta and with noise."""
    cells = []
    costs = {a.name: operations_per_sample(a) for a in ALGORITHMS}
    for title, motion, rate in CHARTED:
        samples = sample_motion(_harmonics(motion), 1.0 / rate, round(CHARTED_DURATION * rate))
        for reading, (quantum, noise) in READINGS.items():
            drawn = [_read(samples, quantum, noise, seed) for seed in range(1, 1 + (TIMES if quantum + noise else 1))]
            increments = drawn[0]
            found = {
                a.name: math.degrees(_rms_error(a, drawn, samples.angles_at_steps(a)))
                for a in ALGORITHMS
                if np.linalg.norm(increments, axis=1).max() <= a.max_increment
            }
            adaptive = algorithm_named(ADAPTIVE)
            window = increments[len(increments) // 2 :][: 2 * adaptive.samples]
            own = {name: costs[name] for name in found}
            own[ADAPTIVE] = operations_of_update(adaptive, window) / adaptive.samples
            cells.append(Cell(f"{title}, {reading}", own, found))
            step()
    return cells


def _read(samples: Samples, quantum: float, noise: float, seed: int) -> np.ndarray:
    """What gyros make of increments; the first quantum is in part passed when the motion begins."""
    exact = samples.increments.copy()
    exact[0] += quantum * np.random.default_rng(seed).uniform(-0.5, 0.5, 3)
    begun = replace(samples, increments=exact)
    return read_increments(begun, np.zeros(9), np.zeros(3), quantum, noise, seed) if quantum + noise else exact


def _rms_error(algorithm: Algorithm, drawn: Sequence[np.ndarray], angles: np.ndarray) -> float:
    return math.sqrt(sum(_error(algorithm, increments, angles) ** 2 for increments in drawn) / len(drawn))


def _harmonics(motion: str) -> np.ndarray:
    """Of a motion of the paper, or of a cone of 1° at 51 Hz: ϑ = A sin Ωt, γ = A cos Ωt - A."""
    if motion != "coning":
        return paper_motion(motion, EXACT)
    harmonics, rest, quarter = [0.0] * 36, [0.0] * 2, 0.5 * math.pi
    store_harmonics(1, math.pi, [CONE, 0.0, *rest], [51.0, 0.0, *rest], [0.0, 0.0, *rest], harmonics)
    store_harmonics(2, math.pi, [CONE, -CONE, *rest], [51.0, 0.0, *rest], [quarter, quarter, *rest], harmonics)
    return np.array(harmonics)


def beside_the_line(cell: Cell) -> float:
    """Error of the adaptive algorithm, of the least of those that are no costlier."""
    own = cell.operations[ADAPTIVE]
    least = min(error for name, error in cell.degrees.items() if cell.operations[name] <= own)
    return cell.degrees[ADAPTIVE] / least


def picking_table(cells: Sequence[Cell]) -> str:
    """Markdown: of each field of the chart what is enough, what is best, and how far the adaptive one is from it."""
    lines = [
        f"| motion, readings | cheapest within {ENOUGH:g} times of the best | its operations | best | its error [deg] "
        f"| `{ADAPTIVE}`: operations | its error, of the best that is no costlier |",
        "|---|---|---|---|---|---|---|",
    ]
    for cell in cells:
        best = min(cell.degrees, key=lambda name: (cell.degrees[name], cell.operations[name]))
        said = (
            cell.title,
            f"`{cell.enough}`",
            f"{cell.operations[cell.enough]:.0f}",
            f"`{best}`",
            f"{cell.degrees[best]:.1e}",
            f"{cell.operations[ADAPTIVE]:.0f}",
            f"{beside_the_line(cell):.2f}",
        )
        lines.append(f"| {' | '.join(said)} |")
    return "\n".join(lines)


def accuracy_against_cost(cells: Sequence[Cell]) -> str:
    """Error of all algorithms over operations per gyro sample, motions down, readings across: down and left is better
    (SVG)."""
    with drawing():
        across = len(READINGS)
        figure = Figure(figsize=(WIDTH, 7.5), layout="constrained")
        panels = figure.subplots(len(cells) // across, across, sharex=True, sharey="row")
        for axes, cell in zip(panels.flat, cells, strict=True):
            frontier = cell.frontier
            x, y = ([of[name] for name in frontier] for of in (cell.operations, cell.degrees))
            axes.plot([*x, 6000.0], [*y, y[-1]], color=FIRST.light, drawstyle="steps-post", linewidth=0.9)
            for kind, look in KINDS.items():
                names = [a.name for a in ALGORITHMS if a.kernel.__module__.endswith(kind) and a.name in cell.degrees]
                names = [name for name in names if name != ADAPTIVE]
                places = ([of[name] for name in names] for of in (cell.operations, cell.degrees))
                axes.plot(*places, linestyle="none", markersize=3.2, **look)
            axes.plot(
                cell.operations[ADAPTIVE],
                cell.degrees[ADAPTIVE],
                "*",
                color=ALERT.light,
                markersize=8,
                label="adaptive",
            )
            axes.set_xscale("log")
            axes.set_yscale("log")
            axes.set_xlim(25.0, 6000.0)
            axes.yaxis.set_major_formatter(power_of_ten)
            axes.xaxis.set_major_formatter(lambda value, _: f"{value:g}")
            axes.set_title(cell.title.replace(", ", "\n"), fontsize=8)
        panels[0, 0].legend(fontsize=6.5, loc="upper right")
        figure.supxlabel("operations per gyro sample (a division, root, sine or cosine counts as ten)", fontsize=8)
        figure.supylabel(
            f"largest error in {CHARTED_DURATION:g} s [deg], rms of {TIMES} draws of quanta or noise", fontsize=8
        )
        return svg_text(figure, "Error of all attitude algorithms against their cost, by motion and readings")


def coning_drift(names: Sequence[str], phases: Sequence[float], drift: Sequence[Sequence[float]]) -> str:
    """Relative drift of each algorithm under coning over Ω Δt, the phase [rad] of the cone in a gyro sample (SVG)."""
    with drawing():
        figure = Figure(figsize=(WIDTH, 3.8), layout="constrained")
        axes = figure.subplots()
        for name, values, look in zip(names, drift, LOOKS, strict=False):
            axes.loglog(phases, values, label=name, markersize=3, markevery=4, **look)
        axes.set_ylim(1e-12, 3.0)
        axes.set_xlim(min(phases) / 1.1, 1.1 * max(phases))
        axes.set_xticks([0.05, 0.1, 0.2, 0.5, 1.0, np.pi / 2])
        axes.xaxis.set_major_formatter(lambda value, _: "π/2" if value > 1.5 else f"{value:g}")
        axes.xaxis.set_minor_formatter(lambda _, __: "")
        axes.yaxis.set_major_formatter(power_of_ten)
        axes.set_xlabel("Ω Δt: phase of the cone in one gyro sample [rad]")
        axes.set_ylabel("drift left, of the drift to compute")
        axes.legend(loc="lower right", handlelength=3.2)
        return svg_text(figure, "Relative drift of attitude algorithms under coning")


def aliasing(
    names: Sequence[str], rates: Sequence[float], errors: Sequence[Sequence[float]], highest_frequency: float
) -> str:
    """Error [rad] of each algorithm at each rate of the gyro samples [Hz]; shaded where these cannot show the motion,
    below twice its highest frequency (SVG)."""
    table = np.degrees(errors)
    with drawing():
        figure = Figure(figsize=(WIDTH, 3.8), layout="constrained")
        axes = figure.subplots()
        axes.axvspan(min(rates) / 1.2, 2.0 * highest_frequency, color=BAND.light, linewidth=0)
        for k, name in enumerate(names):
            axes.loglog(rates, table[:, k], label=name, markersize=3.5, **LOOKS[k])
        axes.set_xlim(min(rates) / 1.2, 1.2 * max(rates))
        axes.set_xticks([500.0, 1000.0, 2000.0, 4000.0, 8000.0])
        axes.xaxis.set_major_formatter(lambda value, _: f"{value:g}")
        axes.xaxis.set_minor_formatter(lambda _, __: "")
        axes.yaxis.set_major_formatter(power_of_ten)
        axes.set_xlabel("gyro samples [Hz]; shaded: fewer than two in a period of the fastest vibration")
        axes.set_ylabel("largest error in 60 s [deg]")
        axes.legend(loc="upper right", handlelength=3.2)
        return svg_text(figure, "Error of attitude algorithms over the rate of the gyro samples")


def make_page(docs: Path, *, progress: bool = False) -> list[Path]:
    """Write the pictures, and the tables between the marks of the page; returns the files."""
    compared = [algorithm_named(name) for name in COMPARED]
    shown = [algorithm_named(name) for name in ALIASING_SHOWN]
    coning = [algorithm_named(name) for name in CONING_SHOWN]
    with progress_bar(
        "comparing algorithms", len(SITUATIONS) + len(RATES) + len(CHARTED) * len(READINGS) + 1, show=progress
    ) as advance:

        def each(situation: Situation, algorithms: Sequence[Algorithm]) -> list[float]:
            found = situation_errors(situation, algorithms)
            advance(1)
            return found

        cells = charted_cells(lambda: advance(1))
        errors = [each(situation, compared) for situation in SITUATIONS]
        by_rate = [each(Situation(ALIASING_MOTION, rate, ""), shown) for rate in RATES]
        drift = [[relative_coning_drift(a, phase) for phase in CONING_PHASES] for a in coning]
        advance(1)
    pictures = {
        "attitude-accuracy.svg": accuracy_against_cost(cells),
        "attitude-coning.svg": coning_drift(CONING_SHOWN, CONING_PHASES, drift),
        "attitude-aliasing.svg": aliasing(ALIASING_SHOWN, RATES, by_rate, HIGHEST_FREQUENCY),
    }
    tables = {
        "accuracy": accuracy_table(errors),
        "picking": picking_table(cells),
        "aliasing": aliasing_table(by_rate, RATES),
        "orders": order_table(),
    }
    page = docs / PAGE
    text = page.read_text(encoding="utf-8")
    for name, table in tables.items():
        text = between_marks(text, name, table)
    write_text(page, text)
    for name, picture in pictures.items():
        write_text(docs / "pictures" / name, picture)
    return [page, *(docs / "pictures" / name for name in pictures)]


def between_marks(text: str, name: str, table: str) -> str:
    """Replace what stands between `<!-- name -->` and `<!-- end of name -->`.

    Raises
    ------
    ValueError
        the marks are not there
    """
    first, last = f"<!-- {name} -->", f"<!-- end of {name} -->"
    begin, end = text.index(first) + len(first), text.index(last)
    return f"{text[:begin]}\n{table}\n{text[end:]}"


if __name__ == "__main__":
    for file in make_page(Path(sys.argv[1] if len(sys.argv) > 1 else "docs"), progress=True):
        print(file)
