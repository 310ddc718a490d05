"""What is recorded, block by block, so that a long run needs no more memory than a short one."""

import ctypes
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np

from .bus import FmuBus
from .grid import Grid
from .value_types import VALUE_TYPES

BLOCK_BYTES = 16 << 20
Values = Mapping[tuple[str, str], Any]
Keep = Callable[[range, Values], None]
"""(ticks of the rows, (FMU, variable) -> its values): called for each block."""


class Blocks:
    """Rows of recorded values, handed on when a block is full.

    Attributes
    ----------
    records : (N, 3) int64
        target of row 0, source, bytes: what the loops copy for each row
    rows, row : int
        of a block, and the next one to be recorded
    """

    def __init__(self, order: Sequence[str], buses: Mapping[str, FmuBus], grid: Grid, every: int, keep: Keep) -> None:
        self._keep, self._every = keep, every
        self._tick = self.row = 0
        ports = [(n, a, c) for n in order for a, c in buses[n].recorded.items() if c and a != "String"]
        width = sum(c * np.dtype(VALUE_TYPES[a].dtype).itemsize for _, a, c in ports)
        self.rows = max(1, min(grid.steps // every + 1, BLOCK_BYTES // max(width, 8)))
        self._buses = buses
        self._tables = {(n, a): np.zeros((self.rows, c), dtype=VALUE_TYPES[a].dtype) for n, a, c in ports}
        self._texts: dict[tuple[str, str], list[str]] = {
            (n, v.name): []
            for n in order
            for v in (
                buses[n].outputs["String"].variables[: buses[n].recorded["String"]]
                if "String" in buses[n].recorded
                else ()
            )
        }
        self.records = np.array(
            [
                (table.ctypes.data, buses[n].outputs[a].address, table.shape[1] * table.itemsize)
                for (n, a), table in self._tables.items()
            ],
            dtype=np.int64,
        ).reshape(-1, 3)

    @property
    def has_text(self) -> bool:
        """Whether strings are recorded, which only Python can keep."""
        return bool(self._texts)

    def record(self) -> None:
        """Record a row now."""
        for target, source, size in self.records.tolist():
            ctypes.memmove(target + self.row * size, source, size)
        self.keep_texts()
        self.advance(self.row + 1)

    def keep_texts(self) -> None:
        """Keep the strings of a row."""
        for (name, variable), texts in self._texts.items():
            port = self._buses[name].outputs["String"]
            at = [v.name for v in port.variables].index(variable)
            address = int(port.values[at])
            texts.append(ctypes.string_at(address).decode("utf-8", "replace") if address else "")

    def advance(self, row: int) -> None:
        """So many rows of the block are recorded; a full block is handed on."""
        self.row = row
        if row == self.rows:
            self.flush()

    def flush(self) -> None:
        """Hand on what is recorded."""
        if not self.row:
            return
        values: dict[tuple[str, str], Any] = dict(self._texts)
        for (name, access), table in self._tables.items():
            for index, variable in enumerate(self._buses[name].outputs[access].variables[: table.shape[1]]):
                values[name, variable.name] = table[: self.row, index]
        end = self._tick + self.row * self._every
        self._keep(range(self._tick, end, self._every), values)
        self._tick, self.row = end, 0
        for texts in self._texts.values():
            texts.clear()
