"""The shortlist of a falsified record: its faults, effects, and functions of one quantity, on one scale.

The scale is the count of numbers that an explanation adds to the model. One that needs at most one number more than the
simplest is its rival.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from ..evidence.evidence import Evidence
from ..rounding import exactly
from ..sieve import Simple, joint_faults, rows_beside_effects, simple_faults, too_small_bounds
from .candidates import Candidates
from .cause import Finding
from .dependence import Dependence, Standing
from .result import Explanation
from .rivals import OUTLIER, complexity_of

NOTHING_PROVEN = 1.3
"""Below this radius no fault of the record is named: a slightly larger noise bound would do as well."""
CLOSE = 1
"""Numbers more than the simplest explanation with which another is its rival."""


def single_faults(evidence: Evidence) -> tuple[Simple, ...]:
    """Return the faults of a record that make the model fit alone, the simplest first."""
    kinds = too_small_bounds if evidence.model.radius < NOTHING_PROVEN else simple_faults
    return simplest_first(kinds(evidence))


def pairs_of_faults(evidence: Evidence) -> tuple[Simple, ...]:
    """Return the pairs of causes, one of them a fault, that make the model fit, the simplest first."""
    return simplest_first([*joint_faults(evidence), *rows_beside_effects(evidence)])


def simplest_first(faults: Sequence[Simple]) -> tuple[Simple, ...]:
    """Return faults in the order of their numbers, then of their radius."""
    return tuple(sorted(faults, key=lambda fault: (fault.numbers, fault.radius)))


@dataclass(frozen=True, eq=False)
class Shortlist:
    """Faults of a record, at least one, the simplest first, and what else makes the model fit with as few numbers."""

    faults: Sequence[Simple]
    findings: Sequence[Finding]
    functions: Sequence[Standing]

    @staticmethod
    def of(faults: Sequence[Simple], candidates: Candidates | None, dependence: Dependence | None) -> "Shortlist":
        """Return the faults with those sets and functions that need at most one number more than the first fault."""
        least = faults[0].numbers
        findings = []
        for finding in candidates.findings if candidates else ():
            # Single readings are rows.
            acts = any(place.effect != OUTLIER for place in finding.fit.places)
            if acts and complexity_of(finding.fit.places) <= least + CLOSE:
                findings.append(finding)
        broken = {fault.where for fault in faults if fault.kind == "break"}
        functions = []
        for standing in dependence.standing if dependence else ():
            is_break = (standing.pair.where,) in broken and _is_of_time(standing)
            if standing.complexity <= least and not is_break:
                functions.append(standing)
        return Shortlist(faults, findings, functions)

    @property
    def first(self) -> Simple:
        """The simplest fault."""
        return self.faults[0]

    @property
    def is_beaten(self) -> bool:
        """Return true if an effect or a function is simpler by more than a rival may be."""
        numbers = [complexity_of(finding.fit.places) for finding in self.findings]
        numbers += [standing.complexity for standing in self.functions]
        return min(numbers, default=math.inf) + CLOSE < self.first.numbers

    @property
    def has_simpler_function(self) -> bool:
        """Return true if a function of a quantity needs fewer numbers than the simplest fault."""
        return any(standing.complexity < self.first.numbers for standing in self.functions)

    @property
    def names_the_first(self) -> bool:
        """Return true if the simplest fault has no rival."""
        close = [fault for fault in self.faults if fault.numbers <= self.first.numbers + CLOSE]
        return len(close) == 1 and not self.findings and not self.functions

    @property
    def explanations(self) -> list[Explanation]:
        """Return the faults and the functions as results have them; findings need their calibrations, too."""
        explanations = [Explanation.of_simple(fault) for fault in self.faults]
        return explanations + [Explanation.of_function(standing) for standing in self.functions]


def _is_of_time(standing: Standing) -> bool:
    """Return true if a function is one of time, as a break is; or a step of a quantity that is one between two rows."""
    if standing.form.kind != "jump":
        return standing.pair.quantity == "hours"
    is_after = standing.pair.values > standing.form.at
    return int(np.count_nonzero(is_after[1:] != is_after[:-1])) == 1


def next_step(fault: Simple) -> tuple[str, ...]:
    """Return the advice on a fault: correct or measure rows again, calibrate apart, give another bound."""
    if fault.kind == "sigma":
        bound = exactly(fault.change["noise_bound"])
        return (f"find why errors reach {bound} g; if that is the noise, give --noise-bound {bound}",)
    if fault.kind == "rows" and not fault.rows:
        return ("look at the record there and at the notes of that time, or measure these pieces again",)
    if fault.before_row is not None:
        return (f"calibrate the rows before row {fault.before_row} and those from it on apart from each other",)
    if fault.time_s is not None:
        return (
            f"calibrate what was measured before {exactly(round(fault.time_s))} s and after it apart from each other",
        )
    if not fault.rows:
        return ()
    return (_correction(fault.change, rows_in_words(fault.rows), "it" if len(fault.rows) == 1 else "them"),)


def _correction(change: Mapping[str, Any], rows: str, them: str) -> str:
    """Return how to undo a change of rows; of an unknown one to check them."""
    otherwise = f"until then leave {them} out"
    if "exchanged" in change:
        first, second = change["exchanged"]
        return f"swap {first} and {second} back in {rows} of the file; {otherwise}"
    if "rotated" in change:
        return f"put f1_mps2, f2_mps2 and f3_mps2 back in their order in {rows} of the file; {otherwise}"
    for column, value in change.items():
        if value == "sign":
            return f"turn the sign of {column} in {rows} of the file; {otherwise}"
    if "readings_of_row" in change:
        return f"measure {rows} again: the readings are a copy; {otherwise}"
    return f"check {rows} against the notes, or measure {them} again; {otherwise}"


def rows_in_words(rows: Sequence[int]) -> str:
    """Return rows of a file in words: "row 20", "rows 19 to 30", "rows 6, 18 and 30"."""
    if len(rows) == 1:
        return f"row {rows[0]}"
    first, last = rows[0], rows[-1]
    if len(rows) > 2 and len(rows) == last - first + 1:
        return f"rows {first} to {last}"
    return f"rows {', '.join(map(str, rows[:-1]))} and {last}"
