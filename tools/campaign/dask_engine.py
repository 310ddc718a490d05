"""A Dask cluster as the place where a campaign's work is done."""

import contextlib
import logging
import time as clocks
from collections.abc import Callable, Iterator
from concurrent.futures import CancelledError, Future
from typing import Any

from ..errors import InputError
from .engines import MOST_JOBS, Killed, LostCluster

_AHEAD = 2
"""Batches for each worker of a cluster that are under way at once: the next one waits where it will be done."""
_RENEW_SECONDS = 5.0


class DaskEngine:
    """A Dask cluster: the one at an address, or one of local processes.

    Parameters
    ----------
    client : distributed.Client
    renew : callable
        asks for workers in place of those that are gone for good
    """

    def __init__(self, client: Any, renew: Callable[[], None] = lambda: None) -> None:
        self._client, self._renew = client, renew
        self._renewed = clocks.monotonic()
        self._executor = client.get_executor(pure=False)

    def workers(self) -> int:
        try:
            return sum(self._client.nthreads().values())
        except (OSError, TimeoutError, CancelledError) as error:
            raise LostCluster(str(error)) from error

    def free(self, busy: int) -> int:
        if self._client.status != "running":
            raise LostCluster("the scheduler does not answer")
        if clocks.monotonic() - self._renewed > _RENEW_SECONDS:
            # A worker that is killed as it starts is not started again by Dask.
            self._renewed = clocks.monotonic()
            self._renew()
        return _AHEAD * max(1, self.workers()) - busy

    def submit(self, function: Callable[..., Any], *arguments: Any) -> Future:
        return self._executor.submit(function, *arguments)

    def result(self, future: Future) -> Any:
        from distributed import KilledWorker

        try:
            return future.result()
        except KilledWorker:
            raise Killed(working=True) from None
        except CancelledError as error:
            raise LostCluster("the scheduler does not answer") from error


@contextlib.contextmanager
def dask_engine(jobs: int, scheduler: str | None) -> Iterator[DaskEngine]:
    """A cluster for as long as the block lasts: the one at an address, or one of so many local processes.

    Raises
    ------
    InputError
        a scheduler that does not answer, or Dask that is not installed
    """
    try:
        from dask import config
        from distributed import Client, LocalCluster
    except ImportError as error:
        raise InputError("--engine dask: needs the extra 'cluster' (pip install 'trihedron[cluster]')") from error
    if not 1 <= jobs <= MOST_JOBS:
        raise InputError(f"--jobs {jobs}: must be a whole number from 1 to {MOST_JOBS}")
    # A batch whose worker ends comes back at once; what is done about it is the same as for local processes.
    quiet = {"distributed.scheduler.allowed-failures": 0, "distributed.comm.timeouts.connect": "10s"}
    with config.set(quiet), _silent_logs(), contextlib.ExitStack() as stack:
        if scheduler is None:
            options: dict[str, Any] = {"dashboard_address": None, "silence_logs": logging.CRITICAL}
            cluster: Any = stack.enter_context(LocalCluster(n_workers=jobs, threads_per_worker=1, **options))
            client = stack.enter_context(Client(cluster))
            yield DaskEngine(client, lambda: cluster.scale(jobs))
            return
        try:
            client = Client(scheduler, timeout="10s")
        except (OSError, ValueError, TimeoutError) as error:
            raise InputError(f"--scheduler {scheduler}: does not answer ({_first_line(error)})") from error
        try:
            yield DaskEngine(client)
        finally:
            with contextlib.suppress(Exception):
                client.close(timeout=2)


@contextlib.contextmanager
def _silent_logs() -> Iterator[None]:
    """What Dask says of workers and schedulers that are lost is said in our own words."""
    names = [name for name in logging.root.manager.loggerDict if name.partition(".")[0] == "distributed"]
    loggers = [logging.getLogger(name) for name in names]
    levels = [logger.level for logger in loggers]
    for logger in loggers:
        logger.setLevel(logging.CRITICAL + 1)
    try:
        yield
    finally:
        for logger, level in zip(loggers, levels, strict=True):
            logger.setLevel(level)


def _first_line(error: BaseException) -> str:
    return (str(error).splitlines() or [type(error).__name__])[0]
