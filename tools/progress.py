"""Progress of long work, on standard error if it is a terminal; elsewhere nothing is shown or loaded."""

import sys
from collections.abc import Callable, Iterable, Iterator
from contextlib import AbstractContextManager, contextmanager, nullcontext
from typing import TypeVar

Item = TypeVar("Item")


def tracked(items: Iterable[Item], title: str, *, show: bool, total: int | None = None) -> Iterable[Item]:
    """Yield the same items, with a bar of this title if wanted; `total`: their number, if unknown to them."""
    if not (show and sys.stderr.isatty()):
        return items
    from rich.console import Console
    from rich.progress import track

    return track(items, title, total=total, console=Console(stderr=True), transient=True)


@contextmanager
def progress_bar(title: str, total: float, *, show: bool) -> Iterator[Callable[..., None]]:
    """Yield a function that takes the progress made and, where it changes, the bar's title."""
    if not (show and sys.stderr.isatty()):
        yield lambda done, title=None: None
        return
    from rich.console import Console
    from rich.progress import Progress

    with Progress(console=Console(stderr=True), transient=True) as bar:
        task = bar.add_task(title, total=total)
        yield lambda done, title=None: bar.update(task, advance=done, description=title)


def shown_status(what: str, *, show: bool) -> AbstractContextManager[object]:
    """Show the current activity while the block runs."""
    if not (show and sys.stderr.isatty()):
        return nullcontext()
    from rich.console import Console

    return Console(stderr=True).status(what)
