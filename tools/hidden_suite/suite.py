"""A suite run: cases drawn, measured, diagnosed, held against their secrets."""

import tomllib
from dataclasses import dataclass
from functools import partial
from importlib import resources
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ..diagnosis import Diagnosis, diagnose
from ..errors import InputError, nearest
from ..hidden_cases import NOISE_BOUND
from ..records import PositionRecord, write_record
from ..shown import Shown
from .cases import SuiteCase, SuiteOptions, draw_case
from .measurement import measure_case
from .outcomes import Outcome, outcome_of
from .running import run_cases

if TYPE_CHECKING:
    from polars import DataFrame


@dataclass(frozen=True, repr=False)
class Suite(Shown):
    """A suite and what came of it.

    Attributes
    ----------
    options : SuiteOptions
    seed : int
    outcomes : tuple of Outcome
        in the order of the cases
    """

    options: SuiteOptions
    seed: int
    outcomes: tuple[Outcome, ...]

    def lines(self) -> list[str]:
        """Counts, confusion, detection, errors of the sizes."""
        from .summary import suite_text

        shown: Any = self
        return suite_text(shown).split("\n")

    def to_json(self) -> dict[str, Any]:
        """The object of schema trihedron.hidden-suite/1."""
        from .summary import suite_json

        shown: Any = self
        return suite_json(shown)

    def to_polars(self) -> "DataFrame":
        """A row for each case."""
        import io

        import polars as pl

        from .summary import cases_csv

        shown: Any = self
        return pl.read_csv(io.StringIO(cases_csv(shown)))


@dataclass(frozen=True)
class NamedSuite:
    """A suite of `scenarios/hidden/suites.toml`.

    Attributes
    ----------
    options : SuiteOptions
    cases, seed : int
    """

    options: SuiteOptions
    cases: int
    seed: int


def named_suite(name: str) -> NamedSuite:
    """The suite of that name; InputError where there is none."""
    text = resources.files("trihedron.scenarios").joinpath("hidden", "suites.toml").read_text(encoding="utf-8")
    suites = tomllib.loads(text)
    if name not in suites:
        raise InputError(f"--suite {name}: {nearest(name, tuple(suites))}")
    entry = suites[name]
    size = tuple(entry["size"]) if "size" in entry else None
    options = SuiteOptions(
        mode=entry["mode"], positions=tuple(entry["positions"]), noise=entry.get("noise", "all"), size=size
    )
    return NamedSuite(options, entry["cases"], entry["seed"])


def run_suite(
    options: SuiteOptions,
    cases: int,
    seed: int,
    *,
    records: Path | None = None,
    jobs: int = 1,
    progress: bool = False,
) -> Suite:
    """Draw, measure and diagnose cases; the diagnosis gets the record, σ and the mountings, and nothing else.

    Parameters
    ----------
    options : SuiteOptions
    cases : int
        how many; case i is the same whatever their number
    seed : int
    records : Path, optional
        existing folder in which every record is written too
    jobs : int
        processes
    progress : bool
        show a bar on standard error, where that is a terminal

    Returns
    -------
    Suite

    Raises
    ------
    InputError
        numbers out of range, or benches that cannot hide what is asked for
    """
    run = partial(run_case, options, seed, records)
    return Suite(options, seed, run_cases(run, cases, seed, jobs=jobs, progress=progress))


def run_case(options: SuiteOptions, seed: int, records: Path | None, index: int) -> Outcome:
    """One case from the drawing to the outcome."""
    case = draw_case(options, seed, index)
    record = measure_case(case)
    if records is not None:
        write_record(record, records / f"case-{index:05d}.csv")
    return outcome_of(case, diagnosed(case, record))


def diagnosed(case: SuiteCase, record: PositionRecord, *, rerun: bool = False) -> Diagnosis:
    """The diagnosis of a case's record; what is known beside it are σ, the mountings and the kind of block."""
    return diagnose(
        record,
        noise_bound=NOISE_BOUND,
        baseline=case.bench.baseline,
        mounting=case.bench.matrices,
        rerun=rerun,
    )
