"""Reproduction of a paper on attitude algorithms: its published errors, and how its simulation departed from its text.

Source: Chelnokov, Perelyaev, Chelnokova 2016 (Izv. Saratov Univ., Ser. Math. Mech. Inform. 16(1)), Tables 1 to 3 and
section 3.1.1. With every switch of `Conditions` on, the published errors come out; with every switch off, the true
errors of the methods do.
"""

import csv
import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from importlib.resources import files

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from ...models.attitude_algorithms import Algorithm
from ...models.harmonic_motion import HARMONICS, store_harmonics
from ..errors import InputError, nearest
from ..motion.attitude import algorithm_named
from ..result import Result

ALGORITHM_OF_PRINT = {
    "(7.18)": "mean-rate",
    "(7.20)": "one-sample-quaternion",
    "(7.22)": "two-sample-quaternion",
    "(19)": "one-sample-rodrigues",
    "(20)": "one-sample-rodrigues-symmetric",
    "(22)": "two-sample-rodrigues",
    "[1, p. 355]": "two-sample-textbook-as-run",
    "(24), (25)": "panov",
    "(24), remark 3": "panov-cut-off",
}
"""The algorithm that gives the published errors, for each name in print."""

ANGLES = ("ψ", "ϑ", "γ")
TABLES = {"1": "Table 1", "2": "Table 2", "3": "Table 3", "3.1.1": "section 3.1.1"}

SLOW_AMPLITUDES_DEG = {
    "1": (15.0, 5.0, 15.0),
    "2": (30.0, 10.0, 30.0),
    "3": (15.0, 5.0, 15.0),
    "4": (30.0, 10.0, 30.0),
    "5": (60.0, 20.0, 60.0),
    "6": (120.0, 40.0, 120.0),
    "small": (1.0, 2.0, 3.0),
}
"""Amplitudes [deg] of the motions with one harmonic in each angle."""

SLOW_FREQUENCIES = (1.0, 0.5, 1.0)
"""[Hz]"""

FAST_FREQUENCIES = ((380.0, 60.0), (400.0, 80.0), (420.0, 100.0))
"""First and second harmonics of the compositions in each angle [Hz]."""

THIRD_FREQUENCIES = {"first": (1.0, 1.0, 1.0), "second": (1.0, 2.0, 3.0)}
"""Third harmonics of the compositions [Hz]."""

THIRD_AMPLITUDES_DEG = (6.0, 8.0, 10.0)
TYPED_DEG = {2.0 / 60.0: 0.0333, 2.5 / 3600.0: 0.000694, 20.0 / 60.0: 0.333, 25.0 / 3600.0: 0.00694}
"""Amplitudes as they must have been typed [deg]."""

MOTIONS = (*SLOW_AMPLITUDES_DEG, *THIRD_FREQUENCIES)
"""Names of the motions: the variants of Table 1, the small amplitudes of 3.1.1, the two compositions."""

PAPER_PI = 3.141592
"""π of the paper's program (fitted): 2.1e-7 too small."""

NODES_AS_RUN = {("3.1.1", "(22)", 0.01, 21): 41}
"""Rows that come out with another M than the printed one."""


class PublishedRow(Result):
    """One row: the largest errors of ψ, ϑ, γ over 600 s.

    Attributes
    ----------
    row : int
        its number, from 1
    table : str
        key of `TABLES`
    algorithm : str
        its name in print
    h_s : float
        step [s]
    nodes : int
        M as printed
    motion : str
        1 to 6: variants of Table 1; small: small amplitudes; first, second: compositions of harmonics
    published_deg : tuple of float
        printed errors of ψ, ϑ, γ [deg]
    """

    row: int
    table: str
    algorithm: str
    h_s: float
    nodes: int = Field(alias="M")
    motion: str
    published_deg: tuple[float, float, float]

    @property
    def method(self) -> Algorithm:
        """The algorithm that was run."""
        return algorithm_named(ALGORITHM_OF_PRINT[self.algorithm])

    @property
    def title(self) -> str:
        """Return the title of the row in reports."""
        return f"{TABLES[self.table]}, {self.algorithm}, h = {self.h_s:g} s, M = {self.nodes}, motion {self.motion}"


def table_rows(paper: str) -> Iterator[dict[str, str]]:
    """The rows of a paper's tables as the package holds them, "attitude" or "calibration", by the columns' names."""
    text = files("trihedron.tools.papers").joinpath(f"{paper}.csv").read_text(encoding="utf-8")
    return csv.DictReader(line for line in text.splitlines() if not line.startswith("#"))


def published_rows() -> tuple[PublishedRow, ...]:
    """All published rows, in the order of the paper."""
    rows = []
    for number, row in enumerate(table_rows("attitude"), start=1):
        published = row["psi_deg"], row["theta_deg"], row["gamma_deg"]
        rows.append(PublishedRow.model_validate({"row": number, "published_deg": published, **row}))
    return tuple(rows)


@dataclass(frozen=True)
class Conditions:
    """Conditions of the run of a row: a switch that is on follows `CAUSES`; off, it follows the paper's text.

    With `short_pi`, `trapezoid` and `not_normalised` off π, increments and the angles' quaternions are exact.
    """

    short_pi: bool = True
    trapezoid: bool = True
    nodes_over_step: bool = True
    not_normalised: bool = True
    other_frequencies: bool = True
    smaller_theta: bool = True
    typed_amplitudes: bool = True
    series_cut: bool = True
    nodes_as_run: bool = True

    @property
    def pi(self) -> float:
        """π of the motion."""
        return PAPER_PI if self.short_pi else math.pi

    def without(self, *switches: str) -> "Conditions":
        """The same conditions with these switches off."""
        return replace(self, **dict.fromkeys(switches, False))

    def algorithm(self, row: PublishedRow) -> Algorithm:
        """The algorithm that runs."""
        named = row.method
        if self.series_cut:
            return named
        full = {"two-sample-textbook-as-run": "two-sample-textbook", "panov-cut-off": "panov-series"}
        return algorithm_named(full.get(named.name, named.name))

    def intervals(self, row: PublishedRow) -> int:
        """Intervals of the trapezoid rule in one gyro sample; 0: increments are exact."""
        if not self.trapezoid:
            return 0
        nodes = row.nodes
        if self.nodes_as_run:
            nodes = NODES_AS_RUN.get((row.table, row.algorithm, row.h_s, row.nodes), nodes)
        return (nodes - 1) // row.method.samples if self.nodes_over_step else nodes - 1


PAPER = Conditions()
"""As the paper's program ran."""

EXACT = PAPER.without("short_pi", "trapezoid", "not_normalised")
"""The same motions and algorithms with exact π, exact increments and normalised quaternions: true method error."""


@dataclass(frozen=True)
class WrongCondition:
    """A switch of `Conditions`: the departure, its effect on the published numbers, and rows that show it."""

    switch: str
    sentence: str
    shown_on: tuple[int, ...]


CAUSES = (
    WrongCondition(
        "short_pi",
        "π = 3.141592 in 2π f t detunes 400 + 100 Hz and 420 + 80 Hz from the 500 Hz of the updates: "
        'the whole "instability" of ψ',
        (71, 88),
    ),
    WrongCondition("trapezoid", "the trapezoid rule makes the printed error of (22), not the method", (1, 13)),
    WrongCondition("nodes_over_step", "the M nodes lie over the whole step, not over each gyro sample", (1, 13)),
    WrongCondition(
        "not_normalised",
        "angles were taken from quaternions that had left the unit sphere: the advantage over [1, p. 355]",
        (25, 31),
    ),
    WrongCondition("series_cut", "[1, p. 355] ran without φ⁴/384, and Panov's of remark 3 without φ³/48", (32, 53)),
    WrongCondition("other_frequencies", "variants 3 and 4 ran at 4π + 1 rad/s in ψ and γ, not at 4π", (10, 11, 34)),
    WrongCondition("smaller_theta", "the second harmonic of ϑ was 1.5' and 15', not 2' and 20'", (71, 88)),
    WrongCondition("typed_amplitudes", "amplitudes were typed as rounded decimals of a degree: 2' as 0.0333", (71, 88)),
    WrongCondition("nodes_as_run", "this row ran with M = 41, not with M = 21", (56,)),
)
"""Every switch of `Conditions`."""


def paper_motion(name: str, conditions: Conditions) -> NDArray:
    """A motion, one of `MOTIONS`, as the harmonics that `trihedron.models.harmonic_motion` takes, shape (36,).

    Amplitude [rad], circular frequency [rad/s] and phase of each; an InputError where no motion has this name.
    """
    if name not in MOTIONS:
        raise InputError(f"motion {name}: is not known; {nearest(name, MOTIONS)}")
    harmonics = [0.0] * (9 * HARMONICS)
    for axis in range(3):
        amplitudes_deg, frequencies, phases = np.zeros((3, HARMONICS))
        if name in THIRD_FREQUENCIES:
            (frequencies[0], frequencies[1]), frequencies[2] = FAST_FREQUENCIES[axis], THIRD_FREQUENCIES[name][axis]
            amplitudes_deg[:3] = _composition_amplitudes_deg(name, axis, conditions)
        else:
            frequencies[0] = _slow_frequency(name, axis, conditions)
            amplitudes_deg[0] = SLOW_AMPLITUDES_DEG[name][axis]
        amplitudes = np.radians(amplitudes_deg).tolist()
        store_harmonics(axis, conditions.pi, amplitudes, frequencies.tolist(), phases.tolist(), harmonics)
    return np.array(harmonics)


def _slow_frequency(name: str, axis: int, conditions: Conditions) -> float:
    if name not in ("3", "4"):
        return SLOW_FREQUENCIES[axis]
    printed = 2.0 * SLOW_FREQUENCIES[axis]
    if conditions.other_frequencies and axis != 1:
        return printed + 1.0 / (2.0 * conditions.pi)
    return printed


def _composition_amplitudes_deg(name: str, axis: int, conditions: Conditions) -> tuple[float, float, float]:
    scale = 1.0 if name == "first" else 10.0
    minutes = (1.0, 1.5 if conditions.smaller_theta else 2.0, 2.0)[axis]
    first, second = scale * 2.5 / 3600.0, scale * minutes / 60.0
    if conditions.typed_amplitudes:
        first, second = _as_typed(first), _as_typed(second)
    return first, second, THIRD_AMPLITUDES_DEG[axis]


def _as_typed(amplitude_deg: float) -> float:
    return next((typed for full, typed in TYPED_DEG.items() if abs(amplitude_deg - full) < 1e-9), amplitude_deg)


ATTEMPTS = "tried without success: exact π, other T, errors taken at every n-th step only, words of 36 to 42 bits"


UNEXPLAINED: tuple[tuple[tuple[int, ...], str], ...] = (
    (
        (5, 17),
        "variant 5: ψ and γ are printed 8e-6 degrees larger, ϑ agrees to four digits; tried without success: exact π, "
        "T from 60 to 1200 s, normalised quaternions",
    ),
    ((36,), "γ in print is 5.74e-7, surely for 5.74e-6: the text has it two orders below 5.97e-4"),
    (
        (43, 45),
        "not possible as the largest errors of one run: an error of ϑ that is drift about the third axis is seen in γ "
        f"with sin 15° of its size, which is more than the γ in print; {ATTEMPTS}",
    ),
    (
        (46,),
        "ϑ fits normalised quaternions, γ fits quaternions that are not, ψ lies halfway between: (7.20) itself is "
        "reconstructed, the book was not at hand",
    ),
    ((38, 74, 75, 80), f"drift in ψ or γ comes out larger than in print; {ATTEMPTS}"),
    ((62, 69), f"ψ comes out 14 % larger than in print from the first second on; {ATTEMPTS}"),
    (
        (78, 83),
        "(7.20) and (19) carry the same three numbers in print: one row is a copy, and neither fits it in all angles",
    ),
    ((79, 84), f"ϑ comes out 6 % larger and 8 % smaller than in print, while ψ agrees; {ATTEMPTS}"),
)
"""Rows that are not reproduced, and the known facts about them."""
