"""The memory that a calculation may take, estimated from the size of its record before anything large is allocated.

Estimates are of the whole process on Linux, measured; tests hold them. The budget is one number for all machines, so no
answer depends on the machine.
"""

import math
import os
from dataclasses import dataclass

from .errors import InputError
from .rounding import digits

BUDGET_GB = 4.0
"""Memory of a calculation [GB], where the user states no other."""
VARIABLE = "TRIHEDRON_MEMORY_GB"
FEWER_POSITIONS = "give fewer positions, or average repeated ones"


@dataclass(frozen=True)
class Room:
    """Memory [bytes] of a task: a constant, a part for each row, and one for each pair of rows.

    `task` and `rows` are in words; `advice` says how the record becomes smaller. Each of more than `long` rows takes
    `of_long` in place of the parts for rows and pairs.
    """

    task: str
    rows: str
    advice: str
    constant: float
    a_row: float
    a_pair: float = 0.0
    long: float = math.inf
    of_long: float = 0.0

    def needed(self, rows: int) -> float:
        """Return the estimate for a number of rows [bytes]."""
        if rows > self.long:
            return self.constant + self.of_long * rows
        return self.constant + self.a_row * rows + self.a_pair * rows**2

    def check(self, rows: int, path: object) -> None:
        """Raise an InputError if a record of this number of rows needs more than the budget."""
        needed, budget = self.needed(rows) / 1e9, budget_gb()
        if needed > budget:
            raise InputError(
                f"{path}: {self.task} of {rows} {self.rows} needs about {digits(needed, 2)} GB of memory, and the "
                f"budget is {digits(budget, 2)} GB; {self.advice}, or set {VARIABLE}={math.ceil(needed)}"
            )


def budget_gb() -> float:
    """Return the budget [GB]: the user's where the environment states one; an InputError for one that is none."""
    text = os.environ.get(VARIABLE)
    if text is None:
        return BUDGET_GB
    try:
        budget = float(text)
    except ValueError:
        budget = math.nan
    if not 0.0 < budget < math.inf:
        raise InputError(f"{VARIABLE}={text}: a number of gigabytes above 0 is needed, as {BUDGET_GB:g}")
    return budget
