"""One process for all foreign FMUs of a long run: it runs the compiled loop over the steps with all FMUs in it.

A crash ends that process, not ours. The run then continues with each FMU in a process of its own, which names the FMU
that fails. Messages are a head of lengths, JSON, and the numbers of recorded rows. FMUs can write to the pipe, so every
length is checked and nothing else than numbers and texts is read.
"""

import json
import os
import pickle
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np
import polars as pl

from ..errors import InputError, one_line
from ..locks import own_folder
from .guest import LONGEST_REPLY, memory_limit
from .guest_process import HEAD
from .loops import Assembly, held_interrupt, run_fmus
from .recorded import Keep, RecordColumn

WORTH_EXCHANGES = 40_000
"""Number of exchanges with guests, one a step and FMU, from which the start of this process is worth its time."""
_CALL = "import json, sys; sys.path[:] = json.loads(sys.argv[1]); from {module} import serve; serve(int(sys.argv[2]))"


class BrokenError(Exception):
    """The process has ended, or its messages cannot be read."""


def is_worth_it(assembly: Assembly) -> bool:
    """Return True if a run has many exchanges with foreign FMUs, and all of them can run in one process."""
    run = assembly.scenario.run
    if run.call_limit_s is not None or run.in_process is not None or run.realtime is not None:
        return False
    guests = [entry.fmu for entry in assembly.loaded.values() if entry.fmu.guest]
    single = ("canBeInstantiatedOnlyOncePerProcess", "canBeInstantiatedOnlyOnce")
    if any(fmu.solver or fmu.event_mode or fmu.first_edition or fmu.says(*single) for fmu in guests):
        return False
    if any(column.variable.value_type.by_address for column in assembly.columns):
        return False
    if any(setting.effects for setting in assembly.scenario.fmus.values()):
        # Effects of the user's own file are known in this process only.
        return False
    return len(guests) * assembly.grid.steps >= WORTH_EXCHANGES


def run_in_one_process(
    assembly: Assembly,
    keep_rows: Keep,
    *,
    progress: Callable[[int], None] = lambda _: None,
    flush: Callable[[], bool] = lambda: False,
    compiled: bool = True,
) -> str:
    """Run FMUs as `run_fmus` does, with all of them in one process of their own if that is worth its time."""
    if not compiled or not is_worth_it(assembly):
        return run_fmus(assembly, keep_rows, progress=progress, flush=flush, compiled=compiled)
    kept = -1

    def keep(rows: pl.DataFrame, tick: int) -> None:
        nonlocal kept
        kept = tick
        keep_rows(rows, tick)

    def keep_further(rows: pl.DataFrame, tick: int) -> None:
        """Keep the rows behind those that are kept already."""
        fresh = -(-(tick - kept) // assembly.scenario.record.every) if tick > kept else 0
        if fresh:
            keep_rows(rows.tail(fresh), tick)

    with own_folder() as folder:
        try:
            with held_interrupt() as pressed:
                return _Process(assembly, folder).run(keep, progress, pressed)
        except BrokenError:
            return run_fmus(assembly, keep_further, flush=flush)


class _Process:
    """The process, seen from ours."""

    def __init__(self, assembly: Assembly, folder: Path) -> None:
        self._assembly = assembly
        module = f"{__package__}.shared_serving"
        program = [sys.executable, "-P", "-c", _CALL.format(module=module), json.dumps(sys.path), str(memory_limit())]
        pipe = subprocess.PIPE
        self._process = subprocess.Popen(
            program, stdin=pipe, stdout=pipe, stderr=subprocess.DEVNULL, cwd=folder, start_new_session=True
        )
        time_column = pl.Series("time_s", np.zeros(0))
        self._empty = [time_column, *map(_empty, assembly.columns)]

    def run(self, keep: Keep, progress: Callable[[int], None], pressed: Callable[[], bool]) -> str:
        """Run the scenario; pass rows on; return the FMU that asked for the end, if one did."""
        assert self._process.stdin is not None
        assert self._process.stdout is not None
        watch = threading.Thread(target=self._end_when, args=(pressed,), daemon=True)
        is_ready = False
        try:
            with suppress(OSError):
                pickle.dump(self._assembly.scenario, self._process.stdin)
                self._process.stdin.close()
            watch.start()
            while True:
                message = self._message(self._process.stdout)
                if "progress" in message:
                    is_ready = True
                    progress(_count(message["progress"], self._assembly.grid.steps))
                elif "rows" in message:
                    rows = self._rows(self._process.stdout, message)
                    keep(rows, _count(message["tick"], self._assembly.grid.steps))
                elif "refused" in message and is_ready:
                    raise InputError(one_line(str(message["refused"])))
                elif "ended" in message:
                    for note in message["notes"]:
                        if str(note) not in self._assembly.notes:
                            self._assembly.notes.append(one_line(str(note)))
                    return one_line(str(message["ended"]))
                else:
                    raise BrokenError
        except BrokenError:
            if pressed():
                return ""
            raise
        finally:
            self._end()
            if watch.is_alive():
                watch.join()
            self._process.stdout.close()

    def _end_when(self, pressed: Callable[[], bool]) -> None:
        """End the process after Ctrl-C."""
        while self._process.poll() is None:
            if pressed():
                self._end()
            time.sleep(0.1)

    def _end(self) -> None:
        """End the process and those that it has started."""
        if hasattr(os, "killpg"):
            with suppress(ProcessLookupError, PermissionError):
                os.killpg(self._process.pid, signal.SIGKILL)
        self._process.kill()
        self._process.wait()

    def _message(self, stream: Any) -> dict[str, Any]:
        content = self._content(stream)
        try:
            message = json.loads(content)
        except (ValueError, RecursionError) as error:
            raise BrokenError from error
        if not isinstance(message, dict):
            raise BrokenError
        return message

    def _content(self, stream: Any) -> bytes:
        head = stream.read(HEAD.size)
        if len(head) != HEAD.size:
            raise BrokenError
        (length,) = HEAD.unpack(head)
        if length > LONGEST_REPLY:
            raise BrokenError
        content = stream.read(length)
        if len(content) != length:
            raise BrokenError
        return content

    def _rows(self, stream: Any, message: dict[str, Any]) -> pl.DataFrame:
        """Return recorded rows, whose number and size are checked."""
        count = _count(message["rows"], self._assembly.grid.steps + 1)
        series = []
        for empty in self._empty:
            numbers = np.frombuffer(self._content(stream), dtype=dtype_of(empty))
            if len(numbers) != count:
                raise BrokenError
            series.append(pl.Series(empty.name, numbers).cast(empty.dtype))
        return pl.DataFrame(series)


def _count(number: Any, most: int) -> int:
    if not isinstance(number, int) or not 0 <= number <= most:
        raise BrokenError
    return number


def _empty(column: RecordColumn) -> pl.Series:
    """Return a column without rows, which has its name and type."""
    return column.series(np.zeros(0, dtype=column.variable.value_type.dtype))


def dtype_of(series: pl.Series) -> np.dtype[Any]:
    """Return the type of a column's numbers in a message."""
    if series.dtype == pl.Boolean:
        return np.dtype(np.uint8)
    return series.to_numpy().dtype
