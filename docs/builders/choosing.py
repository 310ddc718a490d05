"""Accuracy against cost of the attitude algorithms: the numbers and pictures of the page that helps to choose one.

`python docs/builders/choosing.py docs` makes the tables of docs/choose-an-attitude-algorithm.md and the
pictures under docs/pictures again.
"""

import math
import sys
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from types import FunctionType, SimpleNamespace
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from scipy.optimize import isotonic_regression

from trihedron.models.attitude_algorithms import ALGORITHMS, PRODUCTS, Algorithm
from trihedron.models.attitude_algorithms.computer import HALF_TABLE_SIZE, TABLE_SIZE, WORK_SIZE, prepare_update
from trihedron.models.rotation import multiply
from trihedron.tools.files import write_text
from trihedron.tools.motion.attitude import algorithm_named, angle_between, attitudes_of_angles
from trihedron.tools.motion.compare import run_algorithm, sample_motion
from trihedron.tools.papers.attitude import EXACT, paper_motion
from trihedron.tools.progress import progress_bar
from trihedron.tools.reports.pictures import (
    ALERT,
    BAND,
    FIRST,
    INK,
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


COSTLY = 10
"""What a division, a root, a sine, a cosine or an arctangent counts as, in additions or multiplications."""


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


def operations_of_update(algorithm: Algorithm, increments: np.ndarray) -> int:
    """Operations of one step of an algorithm and of the quaternion product that follows it.

    Parameters
    ----------
    increments : ndarray, shape (2 * samples, 3)
        of the step before and of this one [rad]: what some algorithms do depends on them
    """
    tally = [0]
    number = _counting_number(tally)
    table, half_table = [0.0] * TABLE_SIZE, [0.0] * HALF_TABLE_SIZE
    prepare_update(float(algorithm.number), list(PRODUCTS), table, half_table)
    values = [number(value) for value in np.asarray(increments).reshape(-1)]
    half = 3 * algorithm.samples
    given: dict[str, Any] = {
        "previous": values[:half],
        "known": 1.0,
        "g": values[half:],
        "count": algorithm.samples,
        "first": 0,
        "table": table,
        "half_table": half_table,
        "turned": [number(0.0)] * 4,
        "part": [number(0.0)] * 4,
        "products": table,
        "weighted": [number(0.0)] * 4,
    }
    kernel = algorithm.kernel
    names = kernel.__code__.co_varnames[: kernel.__code__.co_argcount]
    _counting(kernel, tally)(*(given[name] if name in given else [number(0.0)] * WORK_SIZE for name in names))
    attitude = [number(1.0), number(0.0), number(0.0), number(0.0)]
    multiply(attitude, given["turned"], attitude)
    return tally[0]


def _counting_number(tally: list[int]) -> type[float]:
    """A float whose arithmetic is counted; results count too."""

    def counted(operation: Callable[[float, float], float], cost: int) -> Callable[[float, float], float]:
        def apply(a: float, b: float) -> float:
            tally[0] += cost
            return Number(operation(float(a), float(b)))

        return apply

    class Number(float):
        __add__ = __radd__ = counted(lambda a, b: a + b, 1)
        __sub__ = counted(lambda a, b: a - b, 1)
        __rsub__ = counted(lambda a, b: b - a, 1)
        __mul__ = __rmul__ = counted(lambda a, b: a * b, 1)
        __truediv__ = counted(lambda a, b: a / b, COSTLY)
        __rtruediv__ = counted(lambda a, b: b / a, COSTLY)

    return Number


def _counting(kernel: Any, tally: list[int]) -> FunctionType:
    """The kernel with functions of `math` that are counted, in all that it calls."""

    def counted(function: Callable[..., float]) -> Callable[..., float]:
        def apply(*arguments: float) -> float:
            tally[0] += COSTLY
            return function(*arguments)

        return apply

    functions = {name: counted(getattr(math, name)) for name in ("sqrt", "sin", "cos", "atan2")}
    replaced = SimpleNamespace(**functions, floor=math.floor, fabs=math.fabs, pi=math.pi)
    names = {name: kernel.__globals__[name] for name in kernel.__code__.co_names if name in kernel.__globals__}
    for name, value in names.items():
        if name == "math":
            names[name] = replaced
        elif isinstance(value, FunctionType):
            names[name] = _counting(value, tally)
    return FunctionType(kernel.__code__, names, kernel.__name__)


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
        "| algorithm | source | samples per step | order | order under coning | longest increment [rad] |",
        "|---|---|---|---|---|---|",
    ]
    lines += [
        f"| `{a.name}` | {a.source} | {a.samples}{' and those before' if a.previous else ''} | {a.order} | "
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


def accuracy_against_cost(
    situations: Sequence[Situation], names: Sequence[str], costs: Sequence[float], errors: Sequence[Sequence[float]]
) -> str:
    """Error [rad] of the named algorithms over operations per gyro sample, for each situation: the further down and
    left the better (SVG)."""
    with drawing():
        figure = Figure(figsize=(WIDTH, 9.0), layout="constrained")
        for axes, situation, found in zip(figure.subplots(len(situations), 1), situations, errors, strict=True):
            degrees = np.degrees(found)
            best = _best_for_cost(costs, degrees)
            axes.plot(np.array(costs)[best], degrees[best], color=FIRST.light, drawstyle="steps-post", linewidth=0.9)
            axes.plot(costs, degrees, marker="o", linestyle="none", markersize=4, color=INK.light)
            axes.plot(np.array(costs)[best], degrees[best], "o", markersize=4.5, color=FIRST.light)
            axes.set_xscale("log")
            axes.set_yscale("log")
            axes.set_xlim(25.0, 6000.0)
            low, high = float(degrees.min()), float(degrees.max())
            axes.set_ylim(low / 10.0**1.5, high * 10.0**1.5)
            _name_points(axes, names, costs, degrees, np.log10(high / low) + 3.0)
            axes.yaxis.set_major_formatter(power_of_ten)
            axes.xaxis.set_major_formatter(lambda value, _: f"{value:g}")
            axes.set_title(situation.title)
            axes.set_ylabel("largest error in 60 s [deg]")
        axes.set_xlabel("operations per gyro sample (a division, root, sine or cosine counts as ten)")
        return svg_text(figure, "Error of attitude algorithms against their cost in three situations")


def _name_points(axes: Axes, names: Sequence[str], costs: Sequence[float], degrees: np.ndarray, decades: float) -> None:
    """Names right of the points, moved apart where they would meet."""
    for cheap in (True, False):
        group = [k for k in range(len(names)) if (costs[k] < 400.0) == cheap]
        group.sort(key=lambda k: (degrees[k], -costs[k]))
        x = 1.25 * max(costs[k] for k in group)
        for k, height in zip(group, _apart(np.log10(degrees[group]), 0.07 * decades), strict=True):
            axes.annotate(
                names[k],
                (costs[k], degrees[k]),
                xytext=(x, 10.0**height),
                fontsize=7.5,
                va="center",
                arrowprops={"arrowstyle": "-", "color": MUTED.light, "linewidth": 0.4, "shrinkA": 1.0, "shrinkB": 3.0},
            )


def _apart(heights: np.ndarray, room: float) -> np.ndarray:
    """Ascending heights moved as little as need be until neighbours have `room` between them."""
    offset = room * np.arange(len(heights))
    return isotonic_regression(heights - offset).x + offset


def _best_for_cost(costs: Sequence[float], degrees: np.ndarray) -> list[int]:
    """Those that no cheaper one betters, from the cheapest on."""
    best: list[int] = []
    for k in sorted(range(len(costs)), key=lambda k: (costs[k], degrees[k])):
        if not best or degrees[k] < degrees[best[-1]]:
            best.append(k)
    return best


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
    with progress_bar("comparing algorithms", len(SITUATIONS) + len(RATES) + 1, show=progress) as advance:

        def each(situation: Situation, algorithms: Sequence[Algorithm]) -> list[float]:
            found = situation_errors(situation, algorithms)
            advance(1)
            return found

        errors = [each(situation, compared) for situation in SITUATIONS]
        by_rate = [each(Situation(ALIASING_MOTION, rate, ""), shown) for rate in RATES]
        drift = [[relative_coning_drift(a, phase) for phase in CONING_PHASES] for a in coning]
        advance(1)
    costs = [operations_per_sample(algorithm) for algorithm in compared]
    pictures = {
        "attitude-accuracy.svg": accuracy_against_cost(SITUATIONS, list(COMPARED.values()), costs, errors),
        "attitude-coning.svg": coning_drift(CONING_SHOWN, CONING_PHASES, drift),
        "attitude-aliasing.svg": aliasing(ALIASING_SHOWN, RATES, by_rate, HIGHEST_FREQUENCY),
    }
    tables = {"accuracy": accuracy_table(errors), "aliasing": aliasing_table(by_rate, RATES), "orders": order_table()}
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
