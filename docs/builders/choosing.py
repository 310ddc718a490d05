"""Accuracy against cost of the attitude algorithms: the numbers and pictures of the page that helps to choose one.

`python docs/builders/choosing.py docs` makes the tables of docs/choose-an-attitude-algorithm.md and the
pictures under docs/pictures again.
"""

import math
import sys
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from trihedron.models.attitude_algorithms import ALGORITHMS, Algorithm
from trihedron.models.attitude_algorithms.inputs import INPUT_KINDS, order_with
from trihedron.tools.files import write_text
from trihedron.tools.motion.attitude import algorithm_named, angle_between, attitudes_of_angles
from trihedron.tools.motion.choice import ADAPTIVE, ENOUGH, Choice, choose_algorithm, cone, course_of_harmonics
from trihedron.tools.motion.compare import run_algorithm, sample_motion
from trihedron.tools.motion.operations import operations_of_update
from trihedron.tools.papers.attitude import EXACT, paper_motion
from trihedron.tools.progress import progress_bar
from trihedron.tools.reports.choice import chart
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


def charted(step: Callable[[], None] = lambda: None) -> list[Choice]:
    """Every algorithm on the motions of `CHARTED`, its gyros exact, with quanta and with noise."""
    found = []
    for title, motion, rate in CHARTED:
        harmonics = cone(CONE, 51.0) if motion == "coning" else paper_motion(motion, EXACT)
        course = course_of_harmonics(harmonics, rate, CHARTED_DURATION)
        for reading, (quantum, noise) in READINGS.items():
            found.append(choose_algorithm(course, f"{title}, {reading}", quantum=quantum, noise_bound=noise))
            step()
    return found


def picking_table(choices: Sequence[Choice]) -> str:
    """Markdown: of each field of the chart what is enough, what is best, and how far the adaptive one is from it."""
    lines = [
        f"| motion, readings | cheapest within {ENOUGH:g} times of the best | its operations | best | its error [deg] "
        f"| `{ADAPTIVE}`: operations | its error, of the best that is no costlier |",
        "|---|---|---|---|---|---|---|",
    ]
    for found in choices:
        (adaptive, beside), best = found.adaptive, found.best
        said = (
            found.title,
            f"`{found.enough.algorithm}`",
            f"{found.enough.operations:.0f}",
            f"`{best.algorithm}`",
            f"{math.degrees(best.error or 0.0):.1e}",
            f"{adaptive.operations:.0f}",
            f"{beside:.2f}",
        )
        lines.append(f"| {' | '.join(said)} |")
    return "\n".join(lines)


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

        choices = charted(lambda: advance(1))
        errors = [each(situation, compared) for situation in SITUATIONS]
        by_rate = [each(Situation(ALIASING_MOTION, rate, ""), shown) for rate in RATES]
        drift = [[relative_coning_drift(a, phase) for phase in CONING_PHASES] for a in coning]
        advance(1)
    pictures = {
        "attitude-accuracy.svg": chart(choices),
        "attitude-coning.svg": coning_drift(CONING_SHOWN, CONING_PHASES, drift),
        "attitude-aliasing.svg": aliasing(ALIASING_SHOWN, RATES, by_rate, HIGHEST_FREQUENCY),
    }
    tables = {
        "accuracy": accuracy_table(errors),
        "picking": picking_table(choices),
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
