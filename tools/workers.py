"""Processes that work, of this machine or of a Dask cluster; calls are made whatever is killed meanwhile.

Both are executors in the sense of `concurrent.futures`: joblib's loky, and Dask's own. `joblib.Parallel` is not used:
with one worker it works in this process, which a call may end, and on a Dask cluster it waits for ever for a call whose
worker was killed.
"""

import contextlib
import logging
import os
import shutil
import signal
import tempfile
import threading
import time as clocks
import warnings
from collections import Counter, deque
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import BrokenExecutor, CancelledError, Future, wait
from typing import Any, Protocol, TypeVar

from joblib.externals.loky import ProcessPoolExecutor

from .errors import InputError, nearest
from .locks import own_folder

ENGINES = ("local", "dask")
MOST_JOBS = 1024
AHEAD = 2
"""Calls for each worker that are under way at once: the next one waits where it will be made."""
LOSSES = 2
"""A call that was lost so often is made by itself, where no other call can be blamed for what happens."""
TRIES = 2
"""A call that ends so many processes by itself is given up."""
MOST_STILLBORN = 10
"""So many workers may end before they begin."""
WAIT_SECONDS, RENEW_SECONDS = 1.0, 5.0
IDLE_SECONDS = 300.0
"""A process of this machine that has nothing to do ends."""
Item = TypeVar("Item")
Found = TypeVar("Found")


class Killed(Exception):
    """The process that was to make a call ended."""


class LostCluster(Exception):
    """The cluster is gone: its scheduler does not answer any more."""


class Workers(Protocol):
    """Processes that calls are handed to."""

    kills: int
    """How often some ended while they had work."""

    def count(self) -> int:
        """How many there are; LostCluster where the cluster is gone."""
        ...

    def submit(self, function: Callable[..., Any], *arguments: Any) -> Future:
        """Have a function called that workers can import."""
        ...

    def result(self, future: Future) -> Any:
        """What a call that is done gave; raises Killed, LostCluster, or what the function raised."""
        ...


def completed(
    workers: Workers,
    function: Callable[[Item], Found],
    items: Iterable[Item],
    instead: Callable[[Item], Found] | None = None,
) -> Iterator[tuple[Item, Found]]:
    """What a function gives for each item, as it is done: few calls are under way, however many items there are.

    A call that was lost with a process that ended is made again, and the second time by itself. `instead` gives what
    stands for an item, which is hashable, that no process survives, while no other call is under way; Killed without
    it. Else LostCluster, or what the function raised.
    """
    waiting, alone = deque(items), deque[Item]()
    losses: Counter[Item] = Counter()
    under_way: dict[Future, Item] = {}
    while waiting or alone or under_way:
        room = AHEAD * max(1, workers.count()) - len(under_way)
        for _ in range(0 if alone else min(room, len(waiting))):
            item = waiting.popleft()
            under_way[workers.submit(function, item)] = item
        if alone and not under_way:
            item = alone.popleft()
            try:
                found = by_itself(workers, function, item)
            except Killed:
                if instead is None:
                    raise
                found = instead(item)
            yield item, found
        for future in wait(under_way, timeout=WAIT_SECONDS, return_when="FIRST_COMPLETED").done:
            item = under_way.pop(future)
            try:
                found = workers.result(future)
            except Killed:
                losses[item] += 1
                (alone if losses[item] >= LOSSES else waiting).appendleft(item)
            else:
                yield item, found


def by_itself(workers: Workers, function: Callable[[Item], Found], item: Item) -> Found:
    """What a function gives while no other call is under way; Killed where every process ends that makes the call."""
    for _ in range(TRIES):
        for _ in range(MOST_STILLBORN):
            with contextlib.suppress(Killed):
                _waited_for(workers, workers.submit(os.getpid))
                break
        else:
            raise RuntimeError("no worker process can be started: each ends before it does anything")
        with contextlib.suppress(Killed):
            return _waited_for(workers, workers.submit(function, item))
    raise Killed(f"each process ended that was given {item!r}")


def _waited_for(workers: Workers, future: Future) -> Any:
    while not wait([future], timeout=WAIT_SECONDS).done:
        workers.count()
    return workers.result(future)


@contextlib.contextmanager
def started(engine: str = "local", jobs: int | None = None, scheduler: str | None = None) -> Iterator[Workers]:
    """Workers for as long as the block lasts; where it ends by an exception, they end in the middle of what they do.

    Without `jobs` there are as many as cores; without the address of a Dask scheduler "dask" is a cluster of processes
    of this machine. An InputError for an unknown engine, options that do not go together, a scheduler that does not
    answer, or Dask that is not installed.
    """
    if engine not in ENGINES:
        raise InputError(f"engine '{engine}' is not known; {nearest(engine, ENGINES)}")
    if scheduler is not None and engine == "local":
        raise InputError("--scheduler: goes with --engine dask")
    if scheduler is not None and jobs is not None:
        raise InputError("--jobs: a cluster has its own workers; give --scheduler or --jobs, one of the two")
    number = usable_cores() if jobs is None else jobs
    if not 1 <= number <= MOST_JOBS:
        raise InputError(f"--jobs {number}: must be a whole number from 1 to {MOST_JOBS}")
    with _processes(number) if engine == "local" else _cluster(number, scheduler) as workers:
        yield workers


def usable_cores() -> int:
    """Cores that this process may use."""
    with contextlib.suppress(AttributeError):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


class _Processes:
    """So many processes of this machine, with a folder for their temporary files; when one ends, all are begun anew."""

    def __init__(self, jobs: int, folder: str) -> None:
        self.kills = 0
        self._jobs, self._folder = jobs, folder
        self.pool = self._begun()
        self._pool_of: dict[Future, ProcessPoolExecutor] = {}

    def _begun(self) -> ProcessPoolExecutor:
        arguments = (self._folder, os.getpid())
        return ProcessPoolExecutor(self._jobs, timeout=IDLE_SECONDS, initializer=_begin, initargs=arguments)

    def count(self) -> int:
        return self._jobs

    def submit(self, function: Callable[..., Any], *arguments: Any) -> Future:
        try:
            future = self.pool.submit(function, *arguments)
        except BrokenExecutor:
            # One was killed while it had nothing to do.
            self.pool = self._begun()
            future = self.pool.submit(function, *arguments)
        self._pool_of[future] = self.pool
        return future

    def result(self, future: Future) -> Any:
        pool = self._pool_of.pop(future)
        try:
            return future.result()
        except BrokenExecutor:
            if pool is self.pool:
                self.kills += 1
                self.pool = self._begun()
            raise Killed("a worker process ended") from None


@contextlib.contextmanager
def _processes(jobs: int) -> Iterator[_Processes]:
    with own_folder() as folder:
        processes = _Processes(jobs, str(folder))
        whole = False
        try:
            with warnings.catch_warnings():
                # That one of them stopped and another one was begun is nothing that anybody has to know.
                warnings.filterwarnings("ignore", message="A worker stopped")
                yield processes
                whole = True
        finally:
            with contextlib.nullcontext() if whole else _unheard_threads():
                processes.pool.shutdown(wait=True, kill_workers=not whole)


@contextlib.contextmanager
def _unheard_threads() -> Iterator[None]:
    """Let no thread print a traceback: loky's looks once more for calls that it has just given up (KeyError)."""
    before = threading.excepthook
    threading.excepthook = lambda _: None
    try:
        yield
    finally:
        threading.excepthook = before


def _begin(folder: str, parent: int) -> None:
    """In a new process: Ctrl-C is for the main one; nobody works on, or leaves files, when that one is gone."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    tempfile.tempdir = folder
    threading.Thread(target=_follow, args=(folder, parent), daemon=True).start()


def _follow(folder: str, parent: int) -> None:
    while os.getppid() == parent:
        clocks.sleep(0.5)
    shutil.rmtree(folder, ignore_errors=True)
    os._exit(1)


class _Cluster:
    """A Dask cluster, at an address or of local processes; `renew` asks for workers in place of those that are lost."""

    def __init__(self, client: Any, renew: Callable[[], None] = lambda: None) -> None:
        self.kills = 0
        self._client, self._renew = client, renew
        self._renewed = clocks.monotonic()
        self._executor = client.get_executor(pure=False)

    def count(self) -> int:
        if self._client.status != "running":
            raise LostCluster("the scheduler does not answer")
        if clocks.monotonic() - self._renewed > RENEW_SECONDS:
            # A worker that is killed as it starts is not started again by Dask.
            self._renewed = clocks.monotonic()
            self._renew()
        try:
            return sum(self._client.nthreads().values())
        except (OSError, TimeoutError, CancelledError) as error:
            raise LostCluster(str(error)) from error

    def submit(self, function: Callable[..., Any], *arguments: Any) -> Future:
        return self._executor.submit(function, *arguments)

    def result(self, future: Future) -> Any:
        from distributed import KilledWorker

        try:
            return future.result()
        except KilledWorker:
            self.kills += 1
            raise Killed("a worker of the cluster ended") from None
        except CancelledError as error:
            raise LostCluster("the scheduler does not answer") from error


@contextlib.contextmanager
def _cluster(jobs: int, scheduler: str | None) -> Iterator[_Cluster]:
    try:
        from dask import config
        from distributed import Client, LocalCluster, Security
    except ImportError as error:
        raise InputError("--engine dask: needs the extra 'cluster' (pip install 'trihedron[cluster]')") from error
    # A call whose worker ends comes back at once; what is done about it is the same as for local processes.
    quiet = {"distributed.scheduler.allowed-failures": 0, "distributed.comm.timeouts.connect": "10s"}
    with config.set(quiet), _silent_logs(), contextlib.ExitStack() as stack:
        if scheduler is None:
            # Its servers of pages cannot be left out, but have none, at whatever port is free.
            stack.enter_context(config.set({f"distributed.{who}.http.routes": [] for who in ("scheduler", "worker")}))
            security = None
            with contextlib.suppress(ImportError):
                # Needs cryptography: who has not the key, which no file holds, is not listened to.
                security = Security.temporary()
            folder = str(stack.enter_context(own_folder()))
            stack.enter_context(config.set({"temporary-directory": folder}))
            pages = {"dashboard": False, "dashboard_address": "127.0.0.1:0"}
            options: dict[str, Any] = {"host": "127.0.0.1", "silence_logs": logging.CRITICAL, "security": security}
            options |= {"scheduler_kwargs": pages, "env": {"TMPDIR": folder}}
            cluster: Any = LocalCluster(n_workers=jobs, threads_per_worker=1, **options)
            stack.callback(_close, cluster)
            client = stack.enter_context(Client(cluster))
            yield _Cluster(client, lambda: cluster.scale(jobs))
            with contextlib.suppress(TimeoutError):
                client.wait_for_workers(jobs, timeout=10)
            return
        try:
            client = Client(scheduler, timeout="10s")
        except (OSError, ValueError, TimeoutError) as error:
            first = (str(error).splitlines() or [type(error).__name__])[0]
            raise InputError(f"--scheduler {scheduler}: does not answer ({first})") from error
        try:
            yield _Cluster(client)
        finally:
            with contextlib.suppress(Exception):
                client.close(timeout=2)


def _close(cluster: Any) -> None:
    """End a local cluster; Dask asserts that no worker is just beginning anew, when all that was asked is done."""
    with contextlib.suppress(AssertionError):
        cluster.close()


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
