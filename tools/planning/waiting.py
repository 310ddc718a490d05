"""A sign on a terminal that something is being worked at."""

from contextlib import AbstractContextManager, nullcontext

from rich.console import Console


def shown_status(what: str, progress: bool) -> AbstractContextManager[object]:
    """Show what is being done while the block runs, where progress is asked for and standard error is a terminal."""
    console = Console(stderr=True)
    return console.status(what) if progress and console.is_terminal else nullcontext()
