"""A campaign carried out: from its file to its folder, by workers that may be killed, in any order."""

import sys
import time as clocks
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import partial
from pathlib import Path

from ..errors import InputError
from ..workers import Killed, LostCluster, Workers, by_itself, completed, started
from .design import Order, make_order
from .file import Campaign
from .runs import Computed, columns_of, compute, make_runner, try_run
from .store import Store, opened
from .summary import CampaignResult, Cost, summarise


def default_folder(path: Path) -> Path:
    """Where a campaign is kept when nothing else is asked for: `<campaign>-campaign` in the current folder."""
    return Path(f"{path.stem}-campaign")


def run_campaign(
    path: Path,
    out: Path | None = None,
    *,
    jobs: int | None = None,
    engine: str = "local",
    scheduler: str | None = None,
    resume: bool = False,
    progress: bool = False,
) -> CampaignResult:
    """Carry out a campaign; arguments and errors as for `trihedron.run_campaign`, which writes the page too."""
    began = clocks.perf_counter()
    order, campaign = make_order(path)
    # What the file asks for and cannot be done is said before anything is written.
    columns = columns_of(campaign, make_runner(campaign))
    folder = default_folder(path) if out is None else out
    with opened(folder, order, campaign, columns, path.read_bytes(), resume=resume) as store:
        missing, before, failed = store.missing()
        done, seconds, cpu_seconds, kills = before, 0.0, 0.0, 0
        try:
            with _progress(campaign.runs, before, show=progress) as shown:
                shown(done, failed)
                if missing:
                    with started(engine, jobs, scheduler) as workers:
                        for computed in _computed(order, campaign, missing, workers):
                            store.write(computed)
                            done, failed = done + computed.runs, failed + computed.failures
                            seconds, cpu_seconds = seconds + computed.seconds, cpu_seconds + computed.cpu_seconds
                            shown(done, failed)
                        kills = workers.kills
        except KeyboardInterrupt:
            raise KeyboardInterrupt(f"interrupted; {_so_far(store, done)}") from None
        except LostCluster as error:
            raise InputError(f"--scheduler: {error}; {_so_far(store, done)}") from error
        except InputError as error:
            raise InputError(f"{error}; {_so_far(store, done)}") from error
        cost = Cost(campaign.runs - before, clocks.perf_counter() - began, seconds, cpu_seconds, kills)
        result = summarise(store).model_copy(update={"folder": folder, "cost": cost})
        store.write_summary(result.to_json())
    return result


def _so_far(store: Store, done: int) -> str:
    return f"{done} of {store.campaign.runs} runs are in {store.folder}; --resume goes on"


def _computed(order: Order, campaign: Campaign, missing: list[int], workers: Workers) -> Iterator[Computed]:
    """The files that are missing, as they are done.

    A file that no process survives is tried run by run: a run that none survives either is recorded as failed. What is
    kept follows from the runs alone, so nobody can see from the files who computed what, and when.
    """

    def without_deadly_runs(partition: int) -> Computed:
        deadly = set[int]()
        for number in campaign.runs_of(partition):
            try:
                by_itself(workers, partial(try_run, order), number)
            except Killed:
                deadly.add(number)
        try:
            return by_itself(workers, partial(compute, order, frozenset(deadly)), partition)
        except Killed:
            runs = campaign.runs_of(partition)
            raise RuntimeError(
                f"the runs {runs[0]} to {runs[-1]} end their worker each time, but no run does alone"
            ) from None

    make = partial(compute, order, frozenset[int]())
    for _, computed in completed(workers, make, missing, instead=without_deadly_runs):
        yield computed


@contextmanager
def _progress(total: int, before: int, *, show: bool) -> Iterator[Callable[[int, int], None]]:
    """What is told how many runs are done and how many of them failed: a bar with rate and time left, or nobody."""
    if not show or not sys.stderr.isatty():
        yield lambda _done, _failed: None
        return
    from rich.console import Console
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

    began = clocks.perf_counter()
    columns = (
        TextColumn("runs"),
        BarColumn(),
        MofNCompleteColumn(),
        TextColumn("{task.fields[rate]}"),
        TimeRemainingColumn(compact=True),
        TextColumn("{task.fields[failed]}"),
    )
    with Progress(*columns, console=Console(stderr=True), transient=True, speed_estimate_period=600.0) as bar:
        task = bar.add_task("runs", total=total, completed=before, rate="", failed="")

        def shown(done: int, failed: int) -> None:
            rate = (done - before) / max(clocks.perf_counter() - began, 1e-9)
            words = f"{failed} failed" if failed else ""
            bar.update(task, completed=done, rate=f"{rate:.3g}/s" if done > before else "", failed=words)

        yield shown
