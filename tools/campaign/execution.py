"""A campaign, carried out: what is missing is computed in batches, in any order, by workers that may be killed."""

import time as clocks
from collections import Counter, deque
from collections.abc import Callable, Iterable
from concurrent.futures import Future
from dataclasses import dataclass, field

from .engines import Engine, Killed, first_done
from .file import Campaign
from .order import Order
from .partitions import runs_of
from .work import Computed, compute, try_run

BATCH_SECONDS = 2.0
"""A batch is to take about so long: long against handing it over, short against what a killed worker loses."""
SHARES = 3
"""At the end a batch is at most this part of each worker's share of what is left."""
KILLS = 2
"""A partition, then a run, that ended so many workers is looked into, then recorded as failed."""
WAIT_SECONDS = 1.0
MEMORY = 0.7
"""How much the measured time of the past counts."""


@dataclass
class Batches:
    """What is still to be handed out, and in which portions: whole partitions, as many as take about so long.

    Attributes
    ----------
    waiting : deque of int
        partitions
    alone : set of int
        partitions that are handed out each by itself, as one of them may be deadly
    seconds : float or None
        that a partition takes, measured
    """

    waiting: deque[int]
    alone: set[int] = field(default_factory=set)
    seconds: float | None = None

    def next(self, workers: int) -> list[int]:
        """The partitions of the next batch."""
        first = self.waiting.popleft()
        if first in self.alone or self.seconds is None:
            return [first]
        wanted = round(BATCH_SECONDS / max(self.seconds, 1e-6))
        most = max(1, min(wanted, (len(self.waiting) + 1) // (SHARES * workers)))
        batch = [first]
        while len(batch) < most and self.waiting and self.waiting[0] not in self.alone:
            batch.append(self.waiting.popleft())
        return batch

    def measured(self, seconds: float) -> None:
        """A partition took so long."""
        self.seconds = seconds if self.seconds is None else MEMORY * self.seconds + (1.0 - MEMORY) * seconds

    def again(self, partitions: Iterable[int]) -> None:
        """These have to be computed again, each by itself."""
        partitions = list(partitions)
        self.alone.update(partitions)
        self.waiting.extendleft(reversed(partitions))


@dataclass(frozen=True)
class Trial:
    """The runs of a partition that ends its workers, tried one by one to find the deadly ones.

    Attributes
    ----------
    partition : int
    runs : deque of int
        still to be tried
    """

    partition: int
    runs: deque[int]


@dataclass
class Tally:
    """What became of the workers.

    Attributes
    ----------
    seconds, cpu_seconds : float
        that all workers together worked, by the clock and of their processors
    kills : int
        workers that ended while they had work
    """

    seconds: float = 0.0
    cpu_seconds: float = 0.0
    kills: int = 0


def execute(
    order: Order,
    campaign: Campaign,
    partitions: Iterable[int],
    engine: Engine,
    keep: Callable[[Computed], None],
) -> Tally:
    """Compute partitions and keep each as it is done.

    Parameters
    ----------
    order, campaign
        what is computed
    partitions : iterable of int
        those that are missing
    engine : Engine
    keep : callable
        takes each partition, in any order

    Returns
    -------
    Tally

    Notes
    -----
    A worker that ends takes its batch with it; the batch is handed out again, one partition at a time. A partition that
    ended two workers is tried run by run: a run that ends two workers is recorded as failed. What is kept follows from
    the runs alone, so nobody can see from the files who computed what, and when.
    """
    batches = Batches(deque(partitions))
    trials: deque[Trial] = deque()
    under_way: dict[Future, list[int] | Trial] = {}
    partition_kills: Counter[int] = Counter()
    run_kills: Counter[int] = Counter()
    deadly: dict[int, set[int]] = {}
    tried: Counter[int] = Counter()
    tally = Tally()
    while batches.waiting or trials or under_way:
        if trials:
            # Alone, so that no other call's death is blamed on the run that is tried.
            if not under_way and engine.free(0):
                trial = trials.popleft()
                under_way[engine.submit(try_run, order, trial.runs[0])] = trial
        else:
            for _ in range(engine.free(len(under_way))):
                if not batches.waiting:
                    break
                batch = batches.next(engine.workers())
                fatal = frozenset(run for partition in batch for run in deadly.get(partition, ()))
                under_way[engine.submit(compute, order, batch, fatal)] = batch
        for future in first_done(list(under_way), WAIT_SECONDS):
            task = under_way.pop(future)
            try:
                found = engine.result(future)
            except Killed as killed:
                tally.kills += 1
                if isinstance(task, Trial):
                    run_kills[task.runs[0]] += killed.working
                    if run_kills[task.runs[0]] >= KILLS:
                        deadly.setdefault(task.partition, set()).add(task.runs.popleft())
                    _go_on(task, trials, batches)
                    continue
                if killed.working:
                    partition_kills.update(task)
                suspects = [p for p in task if len(task) == 1 and partition_kills[p] >= KILLS]
                for partition in suspects:
                    tried[partition] += 1
                    if tried[partition] > KILLS:
                        raise RuntimeError(
                            f"the runs {_span(campaign, partition)} end their worker each time, but no run does alone"
                        ) from None
                    partition_kills[partition] = 0
                    left = [run for run in runs_of(campaign, partition) if run not in deadly.get(partition, ())]
                    trials.append(Trial(partition, deque(left)))
                batches.again(p for p in task if p not in suspects)
                continue
            if isinstance(task, Trial):
                task.runs.popleft()
                _go_on(task, trials, batches)
                continue
            for computed in found:
                keep(computed)
                batches.measured(computed.seconds)
                tally.seconds += computed.seconds
                tally.cpu_seconds += computed.cpu_seconds
    return tally


def _go_on(trial: Trial, trials: deque[Trial], batches: Batches) -> None:
    """Try the next run, or, after the last one, compute the partition without the deadly ones."""
    if trial.runs:
        trials.append(trial)
    else:
        batches.again([trial.partition])


def _span(campaign: Campaign, partition: int) -> str:
    runs = runs_of(campaign, partition)
    return f"{runs[0]} to {runs[-1]}"


class Clock:
    """Time since it was made [s]."""

    def __init__(self) -> None:
        self._began = clocks.perf_counter()

    @property
    def seconds(self) -> float:
        """Since the beginning."""
        return clocks.perf_counter() - self._began
