"""Where a campaign's work is done: processes of this machine, or a Dask cluster. Who does what is their affair."""

import contextlib
import logging
import multiprocessing
import os
import signal
import threading
import time as clocks
from collections.abc import Callable, Iterator
from concurrent.futures import CancelledError, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from multiprocessing.connection import wait as wait_for
from typing import Any, Protocol

from trihedron.errors import InputError

MOST_JOBS = 1024
_AHEAD = 2
"""Batches for each worker of a cluster that are under way at once: the next one waits where it will be done."""
_START_SECONDS = 60.0
_RENEW_SECONDS = 5.0
_MOST_STILLBORN = 10
"""So many workers may end before they begin."""


class LostCluster(Exception):
    """The cluster is gone: its scheduler does not answer any more."""


class Killed(Exception):
    """The process that made a call ended.

    Attributes
    ----------
    working : bool
        whether it had begun to work: then what it was called for may be the cause
    """

    def __init__(self, *, working: bool) -> None:
        super().__init__("a worker process ended")
        self.working = working


class Engine(Protocol):
    """Something that calls functions elsewhere."""

    def free(self, busy: int) -> int:
        """How many more calls it should have, when so many are under way."""
        ...

    def workers(self) -> int:
        """How many it has."""
        ...

    def submit(self, function: Callable[..., Any], *arguments: Any) -> Future:
        """Call a function in a worker."""
        ...

    def result(self, future: Future) -> Any:
        """What a call that is done gave.

        Raises
        ------
        Killed
            its process ended
        LostCluster
            the whole cluster is gone
        Exception
            what the function raised
        """
        ...


def usable_cores() -> int:
    """Cores that this process may use."""
    with contextlib.suppress(AttributeError):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


def _begin() -> None:
    """In a new worker: Ctrl-C is for the main process; nobody works on when that one is gone."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    parent = multiprocessing.parent_process()
    if parent is not None:
        threading.Thread(target=_follow, args=(parent.sentinel,), daemon=True).start()


def _follow(sentinel: int) -> None:
    wait_for([sentinel])
    os._exit(1)


class LocalEngine:
    """So many processes, each its own pool of one: one that is killed takes nothing with it but its own batch."""

    def __init__(self, jobs: int) -> None:
        if not 1 <= jobs <= MOST_JOBS:
            raise InputError(f"--jobs {jobs}: must be a whole number from 1 to {MOST_JOBS}")
        self._jobs = jobs
        self._idle: list[ProcessPoolExecutor] = []
        self._begun: dict[ProcessPoolExecutor, Future] = {}
        self._used: dict[Future, ProcessPoolExecutor] = {}
        self._stillborn = 0

    def _started(self) -> ProcessPoolExecutor:
        from trihedron.campaign.work import alive

        # A new interpreter: a copy of this one would have copies of locks that nobody opens.
        pool = ProcessPoolExecutor(1, mp_context=multiprocessing.get_context("spawn"), initializer=_begin)
        self._begun[pool] = pool.submit(alive)
        return pool

    def free(self, busy: int) -> int:
        return self._jobs - busy

    def workers(self) -> int:
        return self._jobs

    def submit(self, function: Callable[..., Any], *arguments: Any) -> Future:
        while True:
            pool = self._idle.pop() if self._idle else self._started()
            try:
                future = pool.submit(function, *arguments)
            except BrokenProcessPool:
                # It was killed while it had nothing to do.
                self._dropped(pool)
                continue
            self._used[future] = pool
            return future

    def result(self, future: Future) -> Any:
        pool = self._used.pop(future)
        try:
            found = future.result()
        except BrokenProcessPool:
            raise Killed(working=self._dropped(pool)) from None
        except BaseException:
            self._idle.append(pool)
            raise
        self._idle.append(pool)
        self._stillborn = 0
        return found

    def _dropped(self, pool: ProcessPoolExecutor) -> bool:
        """Put a broken pool aside; whether its process had ever worked."""
        working = self._begun.pop(pool).exception(timeout=_START_SECONDS) is None
        pool.shutdown(wait=False, cancel_futures=True)
        self._stillborn = 0 if working else self._stillborn + 1
        if self._stillborn > _MOST_STILLBORN:
            raise RuntimeError("no worker process can be started: each ends before it does anything")
        return working

    def close(self, *, now: bool) -> None:
        """End the workers; `now`: in the middle of what they do."""
        for pool in self._begun:
            processes = list((pool._processes or {}).values())
            pool.shutdown(wait=not now, cancel_futures=True)
            if now:
                for process in processes:
                    process.kill()


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
def engine_of(name: str, jobs: int | None, scheduler: str | None) -> Iterator[Engine]:
    """An engine for as long as the block lasts.

    Parameters
    ----------
    name : "local" or "dask"
    jobs : int or None
        processes, of this machine; None: as many as there are cores
    scheduler : str or None
        address of a Dask scheduler; None: a cluster of local processes

    Raises
    ------
    InputError
        options that do not go together, a scheduler that does not answer, or Dask that is not installed
    """
    if name == "local":
        if scheduler is not None:
            raise InputError("--scheduler: goes with --engine dask")
        local = LocalEngine(usable_cores() if jobs is None else jobs)
        whole = False
        try:
            yield local
            whole = True
        finally:
            local.close(now=not whole)
        return
    if scheduler is not None and jobs is not None:
        raise InputError("--jobs: a cluster has its own workers; give --scheduler or --jobs, one of the two")
    with _dask(usable_cores() if jobs is None else jobs, scheduler) as dask:
        yield dask


@contextlib.contextmanager
def _dask(jobs: int, scheduler: str | None) -> Iterator[DaskEngine]:
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


def first_done(futures: list[Future], seconds: float) -> list[Future]:
    """Wait until some are done, or so long."""
    return list(wait(futures, timeout=seconds, return_when="FIRST_COMPLETED").done)
