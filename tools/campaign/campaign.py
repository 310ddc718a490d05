"""A campaign from its file to its folder of results: `trihedron campaign`."""

import json
import sys
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ..errors import InputError
from ..files import write_text
from ..shown import Shown
from .computing import summarise
from .engines import LostCluster, engine_of
from .execution import Clock, Tally, execute
from .order import make_order
from .runners import columns_of, make_runner
from .store import RUNS, Store, opened, read_manifest
from .texts import summary_text
from .work import Computed

if TYPE_CHECKING:
    from polars import DataFrame

SUMMARY, PAGE = "summary.json", "index.html"


@dataclass(frozen=True, repr=False)
class Done(Shown):
    """A campaign that was carried out.

    Attributes
    ----------
    store : Store
    runs, failures : int
        how many runs there are, how many of them failed
    computed : int
        runs that this execution made; the others were there
    seconds : float
        that it took
    tally : Tally
    summary : mapping
        of schema trihedron.campaign-summary/1
    """

    store: Store
    runs: int
    failures: int
    computed: int
    seconds: float
    tally: Tally
    summary: Mapping[str, Any]

    def lines(self) -> list[str]:
        """What was computed over all runs, and what it took."""
        return [*summary_text(self.summary).split("\n"), "", self.cost]

    def to_polars(self) -> "DataFrame":
        """A row for each run."""
        import polars as pl

        return pl.read_parquet(self.store.folder / RUNS / "*.parquet")

    @property
    def cost(self) -> str:
        """What it took, in words."""
        said = f"{self.computed} runs in {self.seconds:.1f} s"
        if self.computed:
            said += f"; the workers worked {self.tally.seconds:.1f} s, {self.tally.cpu_seconds:.1f} s of processor time"
        return said + (f"; {self.tally.kills} of them ended early" if self.tally.kills else "")

    @property
    def files(self) -> list[Path]:
        """What a person looks at first."""
        folder = self.store.folder
        return [folder / RUNS, folder / SUMMARY, folder / PAGE]


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
) -> Done:
    """Carry out a campaign.

    Parameters
    ----------
    path : Path
        the campaign file
    out : Path or None
        folder of the results
    jobs : int or None
        worker processes of this machine; None: as many as there are cores
    engine : "local" or "dask"
    scheduler : str or None
        address of a Dask scheduler; None: a cluster of local processes
    resume : bool
        go on with what the folder holds
    progress : bool
        show how far it is on standard error, where that is a terminal

    Returns
    -------
    Done

    Raises
    ------
    InputError
        whatever cannot be done, in one line; what was computed until then is kept
    KeyboardInterrupt
        Ctrl-C; the folder is whole, and `resume` goes on
    """
    from ..report.campaign_page import campaign_page

    clock = Clock()
    order, campaign = make_order(path)
    # What the file asks for and cannot be done is said before anything is written.
    columns = columns_of(campaign, make_runner(campaign))
    folder = default_folder(path) if out is None else out
    with opened(folder, order, campaign, columns, path.read_bytes(), resume=resume) as store:
        missing, done, failed = store.missing()
        before = done
        total = campaign.runs

        def keep(computed: Computed) -> None:
            nonlocal done, failed
            store.write(computed)
            done, failed = done + computed.runs, failed + computed.failures
            shown(done, failed)

        tally = Tally()
        try:
            with _progress(total, before, show=progress) as shown:
                shown(done, failed)
                if missing:
                    with engine_of(engine, jobs, scheduler) as workers:
                        tally = execute(order, campaign, missing, workers, keep)
        except KeyboardInterrupt:
            raise KeyboardInterrupt(f"interrupted; {_so_far(store, done, total)}") from None
        except LostCluster as error:
            raise InputError(f"--scheduler: {error}; {_so_far(store, done, total)}") from error
        except InputError as error:
            raise InputError(f"{error}; {_so_far(store, done, total)}") from error
        summary = summarise(store)
        write_text(folder / SUMMARY, json.dumps(summary, indent=1, ensure_ascii=False, allow_nan=False) + "\n")
        write_text(folder / PAGE, campaign_page(store, read_manifest(folder)))
    return Done(store, total, failed, total - before, clock.seconds, tally, summary)


def _so_far(store: Store, done: int, total: int) -> str:
    return f"{done} of {total} runs are in {store.folder}; --resume goes on"


@contextmanager
def _progress(total: int, before: int, *, show: bool) -> Iterator[Callable[[int, int], None]]:
    """What is told how many runs are done and how many of them failed: a bar with rate and time left, or nobody."""
    if not show or not sys.stderr.isatty():
        yield lambda _done, _failed: None
        return
    from rich.console import Console
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

    clock = Clock()
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
            rate = (done - before) / max(clock.seconds, 1e-9)
            words = f"{failed} failed" if failed else ""
            bar.update(task, completed=done, rate=f"{rate:.3g}/s" if done > before else "", failed=words)

        yield shown
