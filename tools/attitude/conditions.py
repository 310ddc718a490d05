"""What the paper's simulation did otherwise than its text says, or wrongly: each a switch.

With every switch on, the published errors come out; with every switch off, the true errors of the methods do.
"""

import math
from dataclasses import dataclass, replace

from ...models.attitude_algorithms import Algorithm
from .published import PublishedRow, algorithm_named

PAPER_PI = 3.141592
"""π of the paper's program (fitted): 2.1e-7 too small."""

NODES_AS_RUN = {("3.1.1", "(22)", 0.01, 21): 41}
"""Rows that come out with another M than the printed one."""


@dataclass(frozen=True)
class Conditions:
    """Under which conditions a row is run; a switch that is off is what the text says, or exact.

    Attributes
    ----------
    short_pi : bool
        π = 3.141592 in every 2π f t, not π
    trapezoid : bool
        increments by the trapezoid rule with M nodes, not exact
    nodes_over_step : bool
        the M nodes lie over the whole step of the algorithm, not over each gyro sample
    not_normalised : bool
        the angles are taken from the quaternion as it is, not from its normalised one
    other_frequencies : bool
        variants 3 and 4 of Table 1 run at 4π + 1 and 2π rad/s, not at 4π and 2π
    smaller_theta : bool
        second harmonic of ϑ in Tables 2 and 3: 1.5' and 15', not 2' and 20'
    typed_amplitudes : bool
        2' and 2.5'' typed as 0.0333 and 0.000694 degrees, 20' and 25'' as 0.333 and 0.00694
    series_cut : bool
        [1, p. 355] without φ⁴/384, remark 3 without φ³/48: one term less than the text says
    nodes_as_run : bool
        M of `NODES_AS_RUN` in place of the printed one
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
        named = row.algorithm
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
            nodes = NODES_AS_RUN.get((row.table, row.print_name, row.step, row.nodes), nodes)
        return (nodes - 1) // row.algorithm.samples if self.nodes_over_step else nodes - 1


PAPER = Conditions()
"""As the paper's program ran."""

EXACT = PAPER.without("short_pi", "trapezoid", "not_normalised")
"""The same motions and algorithms with exact π, exact increments and normalised quaternions: true method error."""


@dataclass(frozen=True)
class Cause:
    """A switch of `Conditions`: what it does to the published numbers, and rows that show it.

    Attributes
    ----------
    switch : str
        name of the field of `Conditions`
    sentence : str
        what was done, and with what effect
    shown_on : tuple of int
        numbers of published rows
    """

    switch: str
    sentence: str
    shown_on: tuple[int, ...]


CAUSES = (
    Cause(
        "short_pi",
        "π = 3.141592 in 2π f t detunes 400 + 100 Hz and 420 + 80 Hz from the 500 Hz of the updates: "
        'the whole "instability" of ψ',
        (71, 88),
    ),
    Cause("trapezoid", "the trapezoid rule makes the printed error of (22), not the method", (1, 13)),
    Cause("nodes_over_step", "the M nodes lie over the whole step, not over each gyro sample", (1, 13)),
    Cause(
        "not_normalised",
        "angles were taken from quaternions that had left the unit sphere: the advantage over [1, p. 355]",
        (25, 31),
    ),
    Cause("series_cut", "[1, p. 355] ran without φ⁴/384, and Panov's of remark 3 without φ³/48", (32, 53)),
    Cause("other_frequencies", "variants 3 and 4 ran at 4π + 1 rad/s in ψ and γ, not at 4π", (10, 11, 34)),
    Cause("smaller_theta", "the second harmonic of ϑ was 1.5' and 15', not 2' and 20'", (71, 88)),
    Cause("typed_amplitudes", "amplitudes were typed as rounded decimals of a degree: 2' as 0.0333", (71, 88)),
    Cause("nodes_as_run", "this row ran with M = 41, not with M = 21", (56,)),
)
"""Every switch of `Conditions`."""
