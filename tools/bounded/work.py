"""The work of a diagnosis, counted where it is done: by the sizes of the solved problems, not by a clock.

The unit is about a microsecond of one processor. The same diagnosis ends at the same place everywhere.
"""

import math
from collections.abc import Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass, field

MANY_ROWS = 1000
"""Largest number of rows that are given to the solver at once."""
MOST_COLUMNS = 64
"""Largest number of columns for an exchange of rows: beyond it a step costs more than one of the solver."""


class CutOff(Exception):
    """A search or a stage has reached its limit of work."""


@dataclass(eq=False)
class Budget:
    """Work that all stages of a diagnosis may do together, and names of those that a limit ended.

    `stage` is the name of the stage that works now. Work outside every stage is counted, and never cut off.
    """

    limit: float
    done: float = 0.0
    cut_off: list[str] = field(default_factory=list)
    stage: str = ""

    @property
    def is_spent(self) -> bool:
        """True if no work may be done any more."""
        return self.done > self.limit

    def check(self) -> None:
        """Raise CutOff, and keep the name, if a stage works beyond the limit."""
        if self.stage and self.is_spent:
            self.name(self.stage)
            raise CutOff

    def name(self, stage: str) -> None:
        """Keep the name of a search or a stage that a limit ended."""
        if stage and stage not in self.cut_off:
            self.cut_off.append(stage)

    @contextmanager
    def of(self, stage: str) -> Iterator[None]:
        """Count the work in the block as that of a stage."""
        before, self.stage = self.stage, stage
        try:
            yield
        finally:
            self.stage = before


_BUDGET: ContextVar[Budget | None] = ContextVar("budget", default=None)


@contextmanager
def shared_budget(budget: Budget) -> Iterator[Budget]:
    """Count the work in the block together."""
    token = _BUDGET.set(budget)
    try:
        yield budget
    finally:
        _BUDGET.reset(token)


def charge(amount: float) -> None:
    """Count work in the shared budget, where there is one.

    Raises CutOff beyond its limit.
    """
    budget = _BUDGET.get()
    if budget is None:
        return
    budget.done += amount
    budget.check()


class Work:
    """Done and allowed work of a search. What the search does counts in the shared budget, too."""

    def __init__(self, limit: float = math.inf, search: str = "") -> None:
        self.limit, self.search, self.done, self._budget = limit, search, 0.0, _BUDGET.get()

    def add(self, amount: float) -> None:
        """Count further work.

        Raises CutOff beyond the limit.
        """
        if self._budget is not None:
            self._budget.done += amount
        self._count(amount)

    def _count(self, amount: float) -> None:
        self.done += amount
        if self.is_done:
            if self._budget is not None:
                self._budget.name(self.search)
            raise CutOff
        charge(0.0)

    @property
    def is_done(self) -> bool:
        """True if the limit is reached, or, for a limited search, that of the shared budget."""
        return self.done > self.limit or (
            math.isfinite(self.limit) and self._budget is not None and self._budget.is_spent
        )

    def programme(self, rows: int, columns: int) -> None:
        """Count a linear programme, with its model; the solver counts it in the shared budget."""
        exchanged = rows > MANY_ROWS and columns < MOST_COLUMNS
        self._count(1000.0 + (0.2 if exchanged else 1.2) * rows * columns)
