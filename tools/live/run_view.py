"""A simulation during its run: its rows on standard output, or its newest values on a page for this machine alone."""

import sys
from collections.abc import Callable, Iterator
from contextlib import closing, contextmanager
from typing import Any

import numpy as np
import polars as pl
from numpy.typing import NDArray

from ..errors import InputError
from ..options import PLACES
from ..rounding import digits
from .loopback import LoopbackServer, ShownHandler, template_of

ROWS_OUT = "-"
"""In place of a port: rows on standard output."""
POINTS = 400
"""Rows of a picture: at twice this number every second one is left out."""
WIDTH, HEIGHT = 300.0, 36.0
"""Size of a picture."""
SIGNIFICANT = 6
"""Digits of a shown value."""
Show = Callable[[pl.DataFrame], None]
"""Takes the rows since its last call."""


class RunPage(LoopbackServer):
    """Server of the newest values of a run, with a picture of each column over time."""

    template = "run.html"

    def __init__(self, port: int) -> None:
        self._rows = pl.DataFrame({"time_s": [0.0]}).clear()
        super().__init__(port, ShownHandler, "--live")

    def show(self, rows: pl.DataFrame) -> None:
        """Take further rows; the last one is always kept."""
        drawn = pl.concat([self._rows, rows], how="diagonal")
        while drawn.height > 2 * POINTS:
            drawn = drawn.reverse().gather_every(2).reverse()
        self._rows = drawn

    @property
    def page(self) -> bytes:
        """The changing part of the page."""
        rows, lines = self._rows, []
        for column in rows.columns if rows.height else ():
            lines.append((column, _text(rows[column][-1]), _points(rows["time_s"], rows[column])))
        return template_of("live", self.template).render(shell=False, lines=lines, size=(WIDTH, HEIGHT)).encode()


def _text(value: Any) -> str:
    """Return a value as the page shows it."""
    if isinstance(value, float) and np.isfinite(value):
        return str(digits(value, SIGNIFICANT))
    return str(value)


def _points(times: pl.Series, values: pl.Series) -> str:
    """Return the points of a picture; none of text or of the times themselves."""
    if values.dtype == pl.String or values.name == times.name:
        return ""
    numbers = values.cast(pl.Float64).to_numpy()
    finite = np.isfinite(numbers)
    if not finite.any():
        return ""
    across, up = _share(times.to_numpy()[finite]) * WIDTH, (1.0 - _share(numbers[finite])) * HEIGHT
    return " ".join(f"{x:.1f},{y:.1f}" for x, y in zip(across, up, strict=True))


def _share(numbers: NDArray) -> NDArray:
    """Return where numbers lie between their least (0) and their greatest (1)."""
    # Halved: the difference of two large numbers would overflow.
    halves = numbers / 2 - numbers.min() / 2
    return halves / (halves.max() or 1.0)


class _PrintedRows:
    """Rows as CSV on standard output, with one header."""

    def __init__(self) -> None:
        self._out = getattr(sys.stdout, "beneath", sys.stdout)
        self._is_first = True

    def show(self, rows: pl.DataFrame) -> None:
        """Print further rows; a reader that is gone ends the printing, not the run."""
        if self._out is None:
            return
        try:
            self._out.write(rows.write_csv(include_header=self._is_first))
            self._out.flush()
        except (OSError, ValueError):
            self._out = None
        self._is_first = False


@contextmanager
def shown_run(place: int | str | None) -> Iterator[Show | None]:
    """Yield the function that shows the rows of a run: on a page at this port (0: any), or `-`: on standard output.

    None shows nothing. Raises InputError for anything else, and for a port that cannot be used.
    """
    if place is None:
        yield None
        return
    if place == ROWS_OUT:
        yield _PrintedRows().show
        return
    text = str(place)
    if not text.isdecimal():
        raise InputError(f"--live {text}: {PLACES}")
    with closing(RunPage(int(text))) as page:
        print(f"the page of this run, for this machine alone: {page.address}", file=sys.stderr, flush=True)
        yield page.show
