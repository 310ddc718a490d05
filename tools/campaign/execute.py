"""A campaign carried out: from its file to its folder, by workers that may be killed, in any order."""

import time as clocks
from collections.abc import Iterator
from contextlib import ExitStack
from functools import partial
from pathlib import Path

from ..errors import InputError
from ..progress import progress_bar
from ..workers import Killed, LostCluster, Workers, by_itself, completed, started
from .file import Campaign
from .runs import Computed, Order, columns_of, compute, make_order, make_runner, try_run
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
            with ExitStack() as stack:
                shown = stack.enter_context(progress_bar("runs", campaign.runs, show=progress))
                shown(done)
                workers = stack.enter_context(started(engine, jobs, scheduler)) if missing else None
                for computed in _computed(order, campaign, missing, workers) if workers else ():
                    store.write(computed)
                    done, failed = done + computed.runs, failed + computed.failures
                    seconds, cpu_seconds = seconds + computed.seconds, cpu_seconds + computed.cpu_seconds
                    rate = (done - before) / max(clocks.perf_counter() - began, 1e-9)
                    words = f", {failed} failed" if failed else ""
                    shown(computed.runs, f"{done} of {campaign.runs} runs, {rate:.3g}/s{words}")
                kills = workers.kills if workers else 0
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
