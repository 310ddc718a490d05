"""A suite of strapdown records run: cases drawn, measured, diagnosed, held against their secrets."""

from dataclasses import dataclass
from functools import partial
from pathlib import Path

from ..errors import InputError
from ..hidden_suite.running import run_cases
from ..records import write_record
from ..strapdown.diagnosis import diagnose_strapdown
from .cases import SIZES, draw_case, draw_clean
from .outcomes import StrapdownOutcome, outcome_of


@dataclass(frozen=True)
class StrapdownOptions:
    """What a suite draws.

    Attributes
    ----------
    clean : bool
        hide nothing
    effects : tuple of str
        names to draw from; all that a record can hide where there are none
    sizes : (float, float)
        least and largest, relative to that of sure detection
    """

    clean: bool = False
    effects: tuple[str, ...] = ()
    sizes: tuple[float, float] = SIZES


@dataclass(frozen=True)
class StrapdownSuite:
    """A suite and what came of it.

    Attributes
    ----------
    options : StrapdownOptions
    seed : int
    outcomes : tuple of StrapdownOutcome
        in the order of the cases
    """

    options: StrapdownOptions
    seed: int
    outcomes: tuple[StrapdownOutcome, ...]


def run_strapdown_suite(
    options: StrapdownOptions,
    cases: int,
    seed: int,
    *,
    records: Path | None = None,
    jobs: int = 1,
    progress: bool = False,
) -> StrapdownSuite:
    """Draw, measure and diagnose strapdown records; the diagnosis gets the record and nothing else.

    Parameters
    ----------
    options : StrapdownOptions
    cases : int
        how many; case i is the same whatever their number
    seed : int
    records : Path, optional
        existing folder in which every record is written too
    jobs : int
        processes
    progress : bool
        show a bar on standard error, where that is a terminal

    Raises
    ------
    InputError
        numbers out of range, or an effect that cannot be hidden
    """
    if not 0.0 < options.sizes[0] <= options.sizes[1] <= 1e3:
        raise InputError(f"--size {options.sizes[0]:g} {options.sizes[1]:g}: give the least and the greatest, above 0")
    run = partial(run_case, options, seed, records)
    return StrapdownSuite(options, seed, run_cases(run, cases, seed, jobs=jobs, progress=progress))


def run_case(options: StrapdownOptions, seed: int, records: Path | None, index: int) -> StrapdownOutcome:
    """One case from the drawing to the outcome."""
    case = draw_clean(seed, index) if options.clean else draw_case(seed, index, options.effects, options.sizes)
    record = case.record()
    if records is not None:
        write_record(record, records / f"case-{index:05d}.csv")
    return outcome_of(case, diagnose_strapdown(record, rerun=False))
