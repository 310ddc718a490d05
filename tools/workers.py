"""Calls made by several processes: of this machine (joblib's loky), or of a Dask cluster.

Both are executors of `concurrent.futures`. `joblib.Parallel` waits for ever for a call whose Dask worker ended.
"""

import contextlib
import logging
import multiprocessing
import os
import signal
import sys
import threading
import time
import warnings
from collections.abc import Callable, Generator, Iterable, Iterator
from concurrent.futures import FIRST_COMPLETED, BrokenExecutor, CancelledError, Executor, Future, wait
from itertools import islice
from typing import Any, Literal, TypeVar

from .errors import InputError, reason
from .locks import own_folder

with warnings.catch_warnings():
    # joblib warns where there is no shared memory; `_processes` refuses.
    warnings.simplefilter("ignore")
    from joblib.externals.loky import ProcessPoolExecutor

MOST_JOBS = 1024
AHEAD = 2
"""Calls for each process that are under way at once: the next one waits where it will be made."""
IDLE_SECONDS = 300.0
"""A process of this machine that has nothing to do ends."""
PARENT_SECONDS = 0.2
"""Time between two checks by a process that the main one is still there [s]."""
Argument = TypeVar("Argument")
Returned = TypeVar("Returned")


def made(
    function: Callable[[Argument], Returned],
    arguments: Iterable[Argument],
    *,
    engine: Literal["local", "dask"] = "local",
    jobs: int | None = None,
    scheduler: str | None = None,
) -> Generator[Returned, None, None]:
    """Yield the value of a function for each argument, in the order in which the calls end.

    One job of the local engine is this process. Without `jobs` there is a process for each core. Without the address of
    a Dask scheduler "dask" is a cluster of processes of this machine.

    Raises
    ------
    InputError
        options that do not go together, a scheduler that does not answer, Dask that is not installed, or a process that
        ended in the middle of a call
    """
    if scheduler is not None and engine == "local":
        raise InputError("--scheduler: goes with --engine dask")
    if scheduler is not None and jobs is not None:
        raise InputError("--jobs: a cluster has its own workers; give --scheduler or --jobs, one of the two")
    number = usable_cores() if jobs is None else jobs
    if not 1 <= number <= MOST_JOBS:
        raise InputError(f"--jobs {number}: must be a whole number from 1 to {MOST_JOBS}")
    if engine == "local" and number == 1:
        return (function(argument) for argument in arguments)
    executor = _processes(number) if engine == "local" else _cluster(number, scheduler)
    return _completed(executor, function, arguments)


def usable_cores() -> int:
    """Cores that this process may use."""
    with contextlib.suppress(AttributeError):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


Started = contextlib.AbstractContextManager[tuple[Executor, Callable[[], int]]]
"""An executor while the block lasts, and how many processes it has now."""


def _completed(
    started: Started, function: Callable[[Argument], Returned], arguments: Iterable[Argument]
) -> Generator[Returned, None, None]:
    waiting = iter(arguments)
    try:
        with started as (executor, count):
            running = set()
            while True:
                for argument in islice(waiting, max(AHEAD * count() - len(running), 0)):
                    running.add(executor.submit(function, argument))
                if not running:
                    return
                ended, running = wait(running, return_when=FIRST_COMPLETED)
                for future in ended:
                    yield future.result()
    except BrokenExecutor:
        raise InputError("--jobs: a worker process ended in the middle of its work") from None
    except CancelledError:
        raise InputError("--scheduler: the scheduler does not answer") from None


class OneProcess:
    """A process of its own for one call after another, which can be stopped in the middle of one."""

    def __init__(self) -> None:
        self._pool: ProcessPoolExecutor | None = None

    def call(self, function: Callable[..., Returned], *arguments: Any) -> Future[Returned]:
        """Begin a call, after those that were begun before."""
        if self._pool is None:
            _need_shared_memory(1)
            self._pool = ProcessPoolExecutor(1, initializer=_begin, initargs=(os.getpid(),))
        return self._pool.submit(function, *arguments)

    def stop(self) -> None:
        """End the process and its work; the next call has a new one."""
        pool, self._pool = self._pool, None
        if pool is not None:
            pool.shutdown(wait=False, kill_workers=True)


@contextlib.contextmanager
def _processes(jobs: int) -> Iterator[tuple[Executor, Callable[[], int]]]:
    _need_shared_memory(jobs)
    pool = ProcessPoolExecutor(jobs, timeout=IDLE_SECONDS, initializer=_begin, initargs=(os.getpid(),))
    completed = False
    try:
        with warnings.catch_warnings():
            # Loky tells that an idle process stopped and another one was begun.
            warnings.filterwarnings("ignore", message="A worker stopped")
            yield pool, lambda: jobs
            completed = True
    finally:
        hook = threading.excepthook
        if not completed:
            # Loky's thread looks once more for calls that it has just given up (KeyError).
            threading.excepthook = lambda _: None
        pool.shutdown(wait=True, kill_workers=not completed)
        threading.excepthook = hook


def _need_shared_memory(jobs: int) -> None:
    """Refuse processes where the system gives no semaphores, as with a shared memory that nobody can write."""
    context = multiprocessing.get_context("spawn" if os.name == "nt" else "fork")
    try:
        context.Semaphore(1)
    except (OSError, ImportError) as error:
        why = reason(error) if isinstance(error, OSError) else str(error)
        message = f"--jobs {jobs}: processes need shared memory that can be written, /dev/shm ({why}); give --jobs 1"
        raise InputError(message) from error


def _begin(parent: int) -> None:
    """Leave Ctrl-C to the main process, whose number is `parent`, and end with it, even if it is killed."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    threading.Thread(target=_end_with, args=(parent,), daemon=True).start()


def _end_with(parent: int) -> None:
    while os.getppid() == parent:
        time.sleep(PARENT_SECONDS)
    os._exit(1)


@contextlib.contextmanager
def _cluster(jobs: int, scheduler: str | None) -> Iterator[tuple[Executor, Callable[[], int]]]:
    try:
        from dask import config
        from distributed import Client, KilledWorker, LocalCluster, Security
    except ImportError as error:
        raise InputError("--engine dask: needs the extra 'cluster' (pip install 'trihedron[cluster]')") from error
    client: Any
    with contextlib.ExitStack() as stack:
        stack.enter_context(config.set({"distributed.comm.timeouts.connect": "10s"}))
        stack.enter_context(_silent_logs())
        address: Any = scheduler
        if scheduler is None:
            # Its servers of pages cannot be left out, but have none, at whatever port is free.
            stack.enter_context(config.set({f"distributed.{who}.http.routes": [] for who in ("scheduler", "worker")}))
            folder = str(stack.enter_context(own_folder()))
            stack.enter_context(config.set({"temporary-directory": folder}))
            security = None
            with contextlib.suppress(ImportError):
                # Needs cryptography: who has not the key, which no file holds, is not listened to.
                security = Security.temporary()
            try:
                address = LocalCluster(
                    n_workers=jobs,
                    threads_per_worker=1,
                    host="127.0.0.1",
                    silence_logs=logging.CRITICAL,
                    security=security,
                    scheduler_kwargs={"dashboard": False, "dashboard_address": "127.0.0.1:0"},
                    env={"TMPDIR": folder},
                )
            except (OSError, RuntimeError, TimeoutError) as error:
                raise InputError(f"--engine dask: a cluster of this machine does not start ({error})") from error
            stack.callback(_close, address)
        try:
            client = Client(address, timeout="10s")
        except (OSError, ValueError, TimeoutError) as error:
            first = (str(error).splitlines() or [type(error).__name__])[0]
            raise InputError(f"--scheduler {scheduler}: does not answer ({first})") from error
        stack.callback(client.close, timeout=2)

        known: set[str] = set()

        def count() -> int:
            try:
                workers = client.nthreads()
            except (OSError, TimeoutError) as error:
                raise CancelledError from error
            for lost in known - workers.keys():
                known.remove(lost)
                print(f"a worker of the cluster was lost ({lost}): its work is done again", file=sys.stderr, flush=True)
            known.update(workers)
            return max(1, sum(workers.values()))

        try:
            yield client.get_executor(pure=False), count
        except KilledWorker as error:
            raise InputError(f"--engine dask: {error}") from None


def _close(cluster: Any) -> None:
    """End a local cluster; Dask asserts that no worker is just beginning anew."""
    with contextlib.suppress(AssertionError):
        cluster.close()


@contextlib.contextmanager
def _silent_logs() -> Iterator[None]:
    """Keep Dask from telling of workers and schedulers that are lost."""
    names = [name for name in logging.root.manager.loggerDict if name.partition(".")[0] == "distributed"]
    levels = {logging.getLogger(name): logging.getLogger(name).level for name in names}
    for logger in levels:
        logger.setLevel(logging.CRITICAL + 1)
    try:
        yield
    finally:
        for logger, level in levels.items():
            logger.setLevel(level)
