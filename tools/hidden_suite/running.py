"""Cases of a suite run one after the other, here or in several processes."""

import signal
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from contextlib import ExitStack
from multiprocessing import get_context
from typing import TypeVar

from ..errors import InputError
from ..progress import tracked

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
    with ExitStack() as stack:
        each = map if jobs == 1 else stack.enter_context(_pool(jobs)).map
        found = each(run, range(cases))
        return tuple(tracked(found, "cases", show=progress, total=cases))


def _pool(jobs: int) -> ProcessPoolExecutor:
    """Processes that begin anew: a fork would wait for ever for threads of polars that it does not have.

    Ctrl-C is for the process that started them; they end what they are at.
    """
    return ProcessPoolExecutor(
        jobs, mp_context=get_context("spawn"), initializer=signal.signal, initargs=(signal.SIGINT, signal.SIG_IGN)
    )
