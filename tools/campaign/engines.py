"""Where a campaign's work is done: processes of this machine, or a Dask cluster. Who does what is their affair."""

import contextlib
import multiprocessing
import os
import shutil
import signal
import tempfile
import threading
from collections.abc import Callable, Iterator
from concurrent.futures import Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from multiprocessing.connection import wait as wait_for
from typing import Any, Protocol

from ..errors import InputError, nearest

MOST_JOBS = 1024
_START_SECONDS = 60.0
_KILL = getattr(signal, "SIGKILL", signal.SIGTERM)
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


def _begin(folder: str) -> None:
    """In a new worker: Ctrl-C is for the main process; nobody works on, or leaves files, when that one is gone."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    tempfile.tempdir = folder
    parent = multiprocessing.parent_process()
    if parent is not None:
        threading.Thread(target=_follow, args=(parent.sentinel, folder), daemon=True).start()


def _follow(sentinel: int, folder: str) -> None:
    wait_for([sentinel])
    shutil.rmtree(folder, ignore_errors=True)
    os._exit(1)


class LocalEngine:
    """So many processes, each its own pool of one: one that is killed takes nothing with it but its own batch."""

    def __init__(self, jobs: int) -> None:
        if not 1 <= jobs <= MOST_JOBS:
            raise InputError(f"--jobs {jobs}: must be a whole number from 1 to {MOST_JOBS}")
        self._jobs = jobs
        self._idle: list[ProcessPoolExecutor] = []
        self._begun: dict[ProcessPoolExecutor, Future] = {}
        self._folders: dict[ProcessPoolExecutor, str] = {}
        self._used: dict[Future, ProcessPoolExecutor] = {}
        self._stillborn = 0

    def _started(self) -> ProcessPoolExecutor:
        from .work import alive

        # A new interpreter: a copy of this one would have copies of locks that nobody opens.
        context = multiprocessing.get_context("spawn")
        folder = tempfile.mkdtemp(prefix="trihedron-worker-")
        pool = ProcessPoolExecutor(1, mp_context=context, initializer=_begin, initargs=(folder,))
        self._folders[pool] = folder
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
        shutil.rmtree(self._folders.pop(pool), ignore_errors=True)
        self._stillborn = 0 if working else self._stillborn + 1
        if self._stillborn > _MOST_STILLBORN:
            raise RuntimeError("no worker process can be started: each ends before it does anything")
        return working

    def close(self, *, now: bool) -> None:
        """End the workers; `now`: in the middle of what they do."""
        for pool, begun in self._begun.items():
            working = begun.done() and begun.exception() is None
            if now and working:
                with contextlib.suppress(OSError):
                    os.kill(begun.result(), _KILL)
            # One that has not begun ends by itself, as soon as it has.
            pool.shutdown(wait=working, cancel_futures=True)
            shutil.rmtree(self._folders[pool], ignore_errors=True)


ENGINES = ("local", "dask")


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
        an unknown name, options that do not go together, a scheduler that does not answer, or Dask that is not
        installed
    """
    if name not in ENGINES:
        raise InputError(f"engine '{name}' is not known; {nearest(name, ENGINES)}")
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
    from .dask_engine import dask_engine

    with dask_engine(usable_cores() if jobs is None else jobs, scheduler) as dask:
        yield dask


def first_done(futures: list[Future], seconds: float) -> list[Future]:
    """Wait until some are done, or so long."""
    return list(wait(futures, timeout=seconds, return_when="FIRST_COMPLETED").done)
