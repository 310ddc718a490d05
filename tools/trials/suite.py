"""Records with secrets: a single one, or a suite of many that are diagnosed and counted."""

import csv
import io
import json
import math
import tomllib
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from importlib import resources
from itertools import pairwise
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
from pydantic import Field

from ..errors import InputError, nearest
from ..files import write_text
from ..own_effects import with_effects_of
from ..progress import tracked
from ..records import PositionRecord, write_record
from ..result import ABSENT, Result, Told
from ..rounding import digits, exactly
from ..workers import made
from .case import Case, Options
from .draw import draw_alone, draw_case
from .outcome import KINDS, Outcome, diagnosed_case, judged_case

if TYPE_CHECKING:
    from polars import DataFrame

BINS = (0.0, 0.25, 0.35, 0.5, 0.7, 1.0, 1.4, 2.0, 2.8, 4.0, 5.7, 8.0, 16.0, math.inf)
"""Edges of the sizes, relative to that of sure detection, over which detection is counted."""
MOST_CASES, MOST_JOBS = 100_000, 64


# One record


@dataclass(frozen=True, repr=False)
class HiddenRecord:
    """A "measured" record and its secret; printing it does not reveal the secret."""

    record: PositionRecord
    secret: dict[str, Any]

    def __repr__(self) -> str:
        return repr(self.record)

    def _repr_html_(self) -> str | None:
        return self.record._repr_html_()

    def to_polars(self) -> "DataFrame":
        """Return the record."""
        return self.record.to_polars()


def hidden_record(seed: int, *, effects: Sequence[str] | None = None, symmetric: bool = False) -> HiddenRecord:
    """Draw a single record of a table's positions, and measure it; arguments as for `draw_alone`."""
    case = draw_alone(seed, effects=effects, symmetric=symmetric)
    return HiddenRecord(case.measured(), case.answer())


def write_hidden_record(case: Case, path: Path, answer: Path | None) -> None:
    """Measure a case and write its record; the secret goes to `answer`, or nowhere.

    The record is CSV; the answer is JSON, the secret and the instrument's true parameters.

    Raises
    ------
    InputError
        if a file cannot be written; then neither is written
    """
    record = case.measured(progress=True)
    if answer is not None:
        write_text(answer, json.dumps(case.answer(), indent=2) + "\n")
    try:
        instrument = case.instrument
        write_record(instrument.as_measured(record), path, decimals=instrument.decimals)
    except InputError:
        if answer is not None:
            answer.unlink(missing_ok=True)
        raise


# Many


class Detection(Result):
    """Cases within a range of sizes relative to that of sure detection."""

    low: float
    """lower end of the range"""
    high: float | None
    """upper end; None: any larger size"""
    cases: int
    detected: int
    named: int
    """number of cases, of falsified models, and of correctly named effects"""


class Suite(Told):
    """A suite of records with its outcomes. Keys of only one kind of record are left out of the other's."""

    schema_: Literal["trihedron.hidden-suite/1", "trihedron.hidden-strapdown-suite/1"] = Field(alias="schema")
    mode: str = ABSENT
    records: int = ABSENT
    clean: bool = ABSENT
    effects: tuple[str, ...]
    positions: tuple[int, int] = ABSENT
    noise: str = ABSENT
    size: tuple[float, float] | None
    seed: int
    """options as in `Options`; for a block moved by hand a flag for clean records, which have no size"""
    cases: int
    redrawn: int = ABSENT
    """number of rejected effects (of a table)"""
    outcomes: dict[str, int]
    """number of each kind, in the order of `KINDS`"""
    false_alarms: dict[str, int]
    """number of clean records, and of those with a named effect"""
    confusion: dict[str, dict[str, int]]
    """secret in words -> outcome in words -> count"""
    by_reference: dict[str, dict[str, int]] = ABSENT
    """for blocks: "gravity", "truth" -> number of each kind"""
    detection: tuple[Detection, ...] = ABSENT
    """for a table: single effects by their size; ranges without cases are left out"""
    size_errors: dict[str, int | float | None]
    """relative errors of the estimated sizes; number of true values inside their intervals"""
    results: tuple[Outcome, ...]
    """outcomes in the order of the cases"""

    @property
    def strapdown(self) -> bool:
        """True for records of a block moved by hand."""
        return self.mode is None


@dataclass(frozen=True)
class NamedSuite:
    """A suite of `scenarios/hidden/suites.toml`: its options, number of cases, and seed."""

    options: Options
    cases: int
    seed: int


def named_suite(name: str) -> NamedSuite:
    """Return the suite of this name.

    Raises InputError if there is none.
    """
    text = resources.files("trihedron.scenarios").joinpath("hidden", "suites.toml").read_text(encoding="utf-8")
    suites = tomllib.loads(text)
    if name not in suites:
        raise InputError(f"--suite {name}: {nearest(name, tuple(suites))}")
    entry: dict[str, Any] = suites[name]
    entry |= {key: tuple(value) for key, value in entry.items() if isinstance(value, list)}
    cases, seed = entry.pop("cases"), entry.pop("seed")
    return NamedSuite(Options(**entry), cases, seed)


def run_suite(
    options: Options, cases: int, seed: int, *, records: Path | None = None, jobs: int = 1, progress: bool = False
) -> Suite:
    """Draw, measure and diagnose cases; the diagnosis gets only the record and the known facts beside it.

    A campaign of kind "hidden" runs the same cases into a folder from which it can be resumed; a suite is one value at
    its end.

    Parameters
    ----------
    options : Options
        options of the cases
    cases : int
        number of cases; case i does not depend on it
    seed : int
        seed of the suite
    records : Path, optional
        existing folder in which every record is written too
    jobs : int
        number of processes; 1: only this one
    progress : bool
        show a bar on standard error if that is a terminal

    Returns
    -------
    Suite
        the outcomes and their counts

    Raises
    ------
    InputError
        for numbers out of range, or instruments that cannot hide such effects
    """
    limits = (("cases", cases, 1, MOST_CASES), ("seed", seed, 0, 2**31 - 1), ("jobs", jobs, 1, MOST_JOBS))
    for name, number, least, most in limits:
        if not least <= number <= most:
            raise InputError(f"--{name} {number}: must be a whole number from {least} to {most}")
    run = partial(run_case, options, seed, records)

    outcomes = list(tracked(made(run, range(cases), jobs=jobs), "cases", show=progress, total=cases))
    return suite_of(options, seed, sorted(outcomes, key=lambda outcome: outcome.case))


def run_case(options: Options, seed: int, records: Path | None, index: int) -> Outcome:
    """Run one case from the drawing to the outcome."""
    # A worker process does not know the user's file of effects.
    with with_effects_of(options.own):
        case = draw_case(options, seed, index)
        record = case.measured()
        if records is not None:
            if isinstance(record, dict):
                several = record
            else:
                several = {"": record}
            for label, day in several.items():
                name = f"case-{index:05d}{label and '-'}{label}.csv"
                write_record(case.instrument.as_measured(day), records / name)
        return judged_case(case, diagnosed_case(case, record))


def suite_of(options: Options, seed: int, outcomes: Sequence[Outcome]) -> Suite:
    """Return a suite from the outcomes of its cases, in their order."""
    clean = []
    for outcome in outcomes:
        if outcome.is_clean:
            clean.append(outcome)
    size_errors: list[float] = []
    inside = []
    for outcome in outcomes:
        size_errors += outcome.size_errors
        if outcome.inside is not None:
            inside.append(outcome.inside)
    errors: dict[str, Any] = {"estimates": len(size_errors), "mean": None, "rms": None, "largest": None}
    if size_errors:
        sizes = np.array(size_errors)
        errors["mean"] = float(sizes.mean())
        errors["rms"] = float(np.sqrt(np.mean(sizes**2)))
        errors["largest"] = float(np.abs(sizes).max())
    errors |= {"cases_with_intervals": len(inside), "inside_intervals": sum(inside)}
    records_entry = {}
    if options.records > 1:
        records_entry = {"records": options.records}
    of_kind: dict[str, Any] = {
        "schema": "trihedron.hidden-suite/1",
        "mode": options.mode,
        **records_entry,
        "positions": options.positions,
        "noise": options.noise,
        "size": options.size,
        "redrawn": sum(outcome.redrawn for outcome in outcomes),
        "detection": tuple(detection(outcomes)),
    }
    if options.strapdown:
        del errors["mean"]
        size = None
        if options.mode != "clean":
            size = options.sizes
        by_reference = {}
        for reference in ("gravity", "truth"):
            of_reference = [outcome for outcome in outcomes if outcome.reference == reference]
            if of_reference:
                by_reference[reference] = kinds(of_reference)
        of_kind = {
            "schema": "trihedron.hidden-strapdown-suite/1",
            "clean": options.mode == "clean",
            "size": size,
            "by_reference": by_reference,
        }
    confused = {}
    for name, row in confusion(outcomes).items():
        confused[name] = dict(sorted(row.items()))
    return Suite(
        **of_kind,
        effects=options.effects,
        seed=seed,
        cases=len(outcomes),
        outcomes=kinds(outcomes),
        false_alarms={"clean": len(clean), "alarms": sum(outcome.outcome != "right" for outcome in clean)},
        confusion=confused,
        size_errors=errors,
        results=tuple(outcomes),
    )


def kinds(outcomes: Sequence[Outcome]) -> dict[str, int]:
    """Return the number of each kind, in the order of `KINDS`."""
    counts = Counter(outcome.outcome for outcome in outcomes)
    kinds_there = {}
    for kind in KINDS:
        if counts[kind]:
            kinds_there[kind] = counts[kind]
    return kinds_there


def confusion(outcomes: Sequence[Outcome]) -> dict[str, Counter[str]]:
    """Return secret in words -> outcome in words -> count."""
    table: dict[str, Counter[str]] = {}
    for outcome in sorted(outcomes, key=lambda outcome: outcome.hidden_words):
        table.setdefault(outcome.hidden_words, Counter())[outcome.named_words] += 1
    return table


def detection(outcomes: Sequence[Outcome]) -> list[Detection]:
    """Return counts of single effects by their size relative to sure detection; ranges without cases are left out."""
    singles = []
    for outcome in outcomes:
        if len(outcome.secrets) == 1 and outcome.fault is None:
            singles.append(outcome)
    ranges = []
    for low, high in pairwise(BINS):
        within = []
        for outcome in singles:
            if low <= outcome.secrets[0].relative_size < high:
                within.append(outcome)
        if within:
            detected = sum(outcome.verdict not in ("consistent", "insufficient") for outcome in within)
            right = sum(outcome.outcome == "right" for outcome in within)
            top = None
            if math.isfinite(high):
                top = high
            ranges.append(Detection(low=low, high=top, cases=len(within), detected=detected, named=right))
    return ranges


def cases_csv(suite: Suite) -> str:
    """Return one row for each case."""
    rows = [_row(outcome) for outcome in suite.results]
    stream = io.StringIO()
    writer = csv.DictWriter(stream, list(rows[0]), lineterminator="\n")
    writer.writeheader()
    writer.writerows(rows)
    return stream.getvalue()


def _row(o: Outcome) -> dict[str, object]:
    size, above = o.relative_size, ""
    if o.secrets:
        first = o.secrets[0]
        limits = []
        for x in (first.surely_detected, first.rivals_excluded):
            limits.append(math.inf if x is None else x)
        detected, excluded = limits
        above = digits(excluded / detected, 4)
    size_in_words = ""
    if size is not None:
        size_in_words = digits(size, 4)
    sizes = {"hidden": o.titles(named=False), "size_over_detection": size_in_words}
    radius = ""
    if o.radius is not None:
        radius = exactly(o.radius)
    inside = ""
    if o.inside is not None:
        inside = int(o.inside)
    judgement = {
        "radius": radius,
        "verdict": o.verdict,
        "outcome": o.outcome,
        "named": o.titles(named=True),
        "inside": inside,
    }
    if o.reference is not None:
        return {"case": o.case, "reference": o.reference, "rows": o.rows, **sizes, **judgement}
    drawn = {"positions": o.positions, "mountings": " ".join(o.mountings), "baseline": o.baseline, "noise": o.noise}
    errors = " ".join(digits(error, 4) for error in o.errors)
    return {"case": o.case, **drawn, **sizes, "exclusion_over_detection": above, **judgement, "error": errors}
