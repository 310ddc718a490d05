"""Cases of a suite run one after the other, here or in several processes."""

from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from contextlib import ExitStack
from typing import TypeVar

from rich.console import Console
from rich.progress import track

from trihedron.errors import InputError

MOST_CASES = 100_000
Outcome = TypeVar("Outcome")


def run_cases(
    run: Callable[[int], Outcome], cases: int, seed: int, *, jobs: int = 1, progress: bool = False
) -> tuple[Outcome, ...]:
    """What came of each case, in the order of the cases.

    Parameters
    ----------
    run : callable
        number of a case -> what came of it; importable where there are several processes
    cases : int
        how many
    seed : int
        of the suite; only its range is looked at
    jobs : int
        processes
    progress : bool
        show a bar on standard error, where that is a terminal

    Raises
    ------
    InputError
        numbers out of range
    """
    for name, number, least, most in (
        ("cases", cases, 1, MOST_CASES),
        ("seed", seed, 0, 2**31 - 1),
        ("jobs", jobs, 1, 64),
    ):
        if not least <= number <= most:
            raise InputError(f"--{name} {number}: must be a whole number from {least} to {most}")
    console = Console(stderr=True)
    hidden = not (progress and console.is_terminal)
    with ExitStack() as stack:
        each = map if jobs == 1 else stack.enter_context(ProcessPoolExecutor(jobs)).map
        found = each(run, range(cases))
        return tuple(track(found, "cases", total=cases, console=console, disable=hidden, transient=True))
