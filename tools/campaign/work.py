"""What a worker does: the runs of whole partitions, and the bytes of their files."""

import os
import tempfile
import time as clocks
from collections.abc import Iterable
from dataclasses import dataclass
from functools import lru_cache
from multiprocessing.util import Finalize
from pathlib import Path
from typing import Any

import polars as pl

from ..errors import InputError
from .design import Design
from .file import Campaign
from .kinds import Columns, Runner
from .order import Order, code_hash
from .partitions import records_file, runs_of, scalars_file
from .runners import columns_of, make_runner

KILLED = "the run ended its worker process each time it was tried"
"""The message of a run that no process survives."""


@dataclass(frozen=True)
class Computed:
    """A partition that was computed.

    Attributes
    ----------
    partition : int
    scalars : bytes
        its file of scalars
    records : bytes or None
        its file of records, where they are kept
    runs, failures : int
        how many runs it has, how many of them failed
    seconds, cpu_seconds : float
        that it took, by the clock and of the processor
    """

    partition: int
    scalars: bytes
    records: bytes | None
    runs: int
    failures: int
    seconds: float
    cpu_seconds: float


@dataclass(frozen=True)
class Prepared:
    """A campaign in a worker: read, its runner made, its files where the runner finds them."""

    campaign: Campaign
    design: Design
    runner: Runner
    columns: Columns
    folder: tempfile.TemporaryDirectory[str]


@lru_cache(maxsize=2)
def _prepared(sha256: str, order: Order) -> Prepared:
    folder = tempfile.TemporaryDirectory(prefix="trihedron-campaign-", ignore_cleanup_errors=True)
    # A process of multiprocessing forgets at its end what atexit was told.
    Finalize(folder, folder.cleanup, exitpriority=10)
    campaign = order.unpack(Path(folder.name))
    runner = make_runner(campaign)
    return Prepared(campaign, Design(campaign), runner, columns_of(campaign, runner), folder)


def prepared(order: Order) -> Prepared:
    """The campaign of an order, made ready once in each process.

    Raises
    ------
    InputError
        this process has other code than the one that gave the order: its results would be mixed with other ones
    """
    if order.code != code_hash():
        raise InputError("a worker has another version of Trihedron, or of what it uses, than this process")
    return _prepared(order.sha256, order)


def compute(order: Order, partitions: Iterable[int], deadly: frozenset[int] = frozenset()) -> list[Computed]:
    """Make the runs of partitions.

    Parameters
    ----------
    order : Order
    partitions : iterable of int
    deadly : frozenset of int
        runs that no process survives: recorded as failed, not made
    """
    here = prepared(order)
    found = []
    for partition in partitions:
        began, cpu_began = clocks.perf_counter(), clocks.process_time()
        rows: list[dict[str, Any]] = []
        records: list[tuple[int, pl.DataFrame]] = []
        for number in runs_of(here.campaign, partition):
            row, record = run_once(here, number, deadly=number in deadly)
            rows.append(row)
            if record is not None:
                records.append((number, record))
        found.append(
            Computed(
                partition,
                scalars_file(here.columns, rows),
                records_file(records) if here.columns.record else None,
                len(rows),
                sum(row["failed"] is not None for row in rows),
                clocks.perf_counter() - began,
                clocks.process_time() - cpu_began,
            )
        )
    return found


def run_once(here: Prepared, number: int, *, deadly: bool = False) -> tuple[dict[str, Any], pl.DataFrame | None]:
    """A run's row, and its record where one is kept; a run that fails has its message in the row."""
    values = here.design.values(number)
    row: dict[str, Any] = {"run": number, **values, "failed": None}
    if deadly:
        return {**row, "failed": KILLED}, None
    try:
        result = here.runner.run(number, values, here.design.seed(number))
    except InputError as error:
        return {**row, "failed": _line(str(error))}, None
    except Exception as error:
        # Whatever one run meets, the rest goes on.
        return {**row, "failed": _line(f"{type(error).__name__}: {error}")}, None
    row |= {name: result.scalars.get(name) for name in here.columns.outputs}
    if here.columns.diagnosis:
        row["diagnosis"] = result.diagnosis
    return row, result.record


def _line(text: str) -> str:
    return " ".join(text.split()) or "no message"


def try_run(order: Order, number: int) -> int:
    """Make one run and forget what it gave: does its process survive it?"""
    run_once(prepared(order), number)
    return number


def alive() -> int:
    """What a worker that works can say: the number of its process."""
    return os.getpid()
