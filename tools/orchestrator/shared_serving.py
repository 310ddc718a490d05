"""The process for all foreign FMUs of a long run, from inside; `shared_process` starts it and reads its answers."""

import json
import os
import pickle
import time
from typing import Any, BinaryIO

import numpy as np
import polars as pl

from ..errors import InputError
from .guest_process import HEAD, limit_memory, own_streams
from .loops import run_fmus
from .run import PreparedScenario
from .shared_process import dtype_of

FLUSH_SECONDS = 0.5
"""Time after which recorded rows are sent [s]."""


def serve(most_memory: int) -> None:
    """Run the scenario that standard input holds; answer on standard output, which is hidden from the FMUs."""
    requests, replies = own_streams()
    scenario = pickle.load(requests)
    limit_memory(most_memory)
    _answer(scenario, replies)
    os._exit(0)


def _answer(scenario: Any, replies: BinaryIO) -> None:
    def send(content: bytes) -> None:
        replies.write(HEAD.pack(len(content)) + content)

    def say(**message: Any) -> None:
        send(json.dumps(message).encode())
        replies.flush()

    def keep(rows: pl.DataFrame, tick: int) -> None:
        say(rows=rows.height, tick=tick)
        for series in rows:
            send(np.ascontiguousarray(series.to_numpy()).astype(dtype_of(series), copy=False).tobytes())
        replies.flush()

    flushed = time.monotonic()

    def is_due() -> bool:
        nonlocal flushed
        due = time.monotonic() - flushed > FLUSH_SECONDS
        if due:
            flushed = time.monotonic()
        return due

    run = scenario.run.model_copy(update={"in_process": True})
    try:
        prepared = PreparedScenario(scenario.model_copy(update={"run": run}))
        assembly = prepared.assemble({})
        ended = run_fmus(assembly, keep, progress=lambda count: say(progress=count), flush=is_due)
    except InputError as error:
        say(refused=str(error))
        return
    say(ended=ended, notes=assembly.notes)
