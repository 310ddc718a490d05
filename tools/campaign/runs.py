"""What a run is, whatever its kind, and what a worker does: the runs of one file of the data set, and its bytes."""

import io
import time as clocks
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from multiprocessing.util import Finalize
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import polars as pl

from ..errors import InputError, nearest
from .design import Design, Order, code_hash
from .file import Campaign
from .kinds import AttitudeRuns, CalibrationRuns, HiddenRuns, Output, Runner, SimulationRuns

OWN_COLUMNS = ("run", "failed", "diagnosis")
COMPRESSION_LEVEL = 3
KILLED = "the run ended its worker process each time it was tried"
"""The message of a run that no process survives."""


@dataclass(frozen=True)
class Columns:
    """Columns of a campaign's data set.

    Attributes
    ----------
    parameters, outputs : dict
        name -> polars data type; name -> Output, those that are kept
    diagnosis, record : bool
        whether they are kept
    """

    parameters: dict[str, type[pl.DataType]]
    outputs: dict[str, Output]
    diagnosis: bool = False
    record: bool = False

    @property
    def schema(self) -> dict[str, type[pl.DataType]]:
        """Name -> data type, in order."""
        kept = {name: output.dtype for name, output in self.outputs.items()}
        last: dict[str, type[pl.DataType]] = {"diagnosis": pl.String} if self.diagnosis else {}
        return {"run": pl.Int64, **self.parameters, "failed": pl.String, **kept, **last}


@dataclass(frozen=True)
class Computed:
    """A file of the data set that was computed.

    Attributes
    ----------
    partition : int
        its number
    scalars : bytes
        its content
    records : bytes or None
        the file of records beside it, where they are kept
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
    seconds: float = 0.0
    cpu_seconds: float = 0.0


def make_runner(campaign: Campaign) -> Runner:
    """The runner of a campaign; InputError where what the file asks for cannot be done."""
    if campaign.calibration is not None:
        return CalibrationRuns(campaign, campaign.calibration)
    if campaign.attitude is not None:
        return AttitudeRuns(campaign, campaign.attitude)
    if campaign.simulation is not None:
        return SimulationRuns(campaign, campaign.simulation)
    assert campaign.hidden is not None
    return HiddenRuns(campaign, campaign.hidden)


def columns_of(campaign: Campaign, runner: Runner) -> Columns:
    """The columns of the data set; refuses names that are not there, or that mean two things."""
    parameters: dict[str, type[pl.DataType]] = {}
    for name, axis in campaign.parameters.items():
        sample = axis.listed()[0] if axis.discrete else 0.0
        parameters[name] = (
            pl.Boolean if isinstance(sample, bool) else pl.String if isinstance(sample, str) else pl.Float64
        )
    outputs = dict(runner.outputs)
    for name in parameters:
        if name in outputs or name in OWN_COLUMNS:
            raise InputError(f"parameters.{name}: a run gives a scalar of that name")
    wanted = campaign.keep.scalars
    for name in wanted or ():
        if name not in outputs:
            raise InputError(f"keep.scalars: '{name}' is not what a run gives; {nearest(name, list(outputs))}")
    kept = {name: output for name, output in outputs.items() if wanted is None or name in wanted}
    there = {**{name: output.dtype for name, output in kept.items()}, **parameters}
    for number, computation in enumerate(campaign.compute, start=1):
        for name in computation.names:
            if name not in there:
                raise InputError(
                    f"compute[{number}]: '{name}' is no column of the results; {nearest(name, list(there))}"
                )
        numeric = [*(computation.quantiles or []), *(computation.sensitivity or [])]
        numeric += [] if computation.against is None else [computation.against]
        for name in numeric:
            if there[name] not in (pl.Float64, pl.Int64, pl.Boolean):
                raise InputError(f"compute[{number}]: '{name}' is a text, where a number is wanted")
    if any(c.sensitivity for c in campaign.compute) and not any(t == pl.Float64 for t in parameters.values()):
        raise InputError("compute: sensitivity needs parameters that are numbers")
    return Columns(parameters, kept, campaign.keep.diagnosis, campaign.keep.record)


@dataclass(frozen=True)
class Prepared:
    """A campaign in a worker: read, its runner made, its files where the runner finds them."""

    campaign: Campaign
    design: Design
    runner: Runner
    columns: Columns
    folder: TemporaryDirectory[str]

    def run(self, number: int) -> tuple[dict[str, Any], pl.DataFrame | None]:
        """A run's row, and its record where one is kept; a run that fails has its message in the row."""
        values = self.design.values(number)
        row: dict[str, Any] = {"run": number, **values, "failed": None}
        try:
            given = self.runner.run(number, values, self.design.seed(number))
        except InputError as error:
            return {**row, "failed": _line(str(error))}, None
        except Exception as error:
            # Whatever one run meets, the rest goes on.
            return {**row, "failed": _line(f"{type(error).__name__}: {error}")}, None
        row |= {name: given.scalars.get(name) for name in self.columns.outputs}
        if self.columns.diagnosis:
            row["diagnosis"] = given.diagnosis
        return row, given.record


@lru_cache(maxsize=2)
def _prepared(sha256: str, order: Order) -> Prepared:
    folder = TemporaryDirectory(prefix="trihedron-campaign-", ignore_cleanup_errors=True)
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


def compute(order: Order, deadly: frozenset[int], partition: int) -> Computed:
    """Make the runs of a file of the data set.

    Parameters
    ----------
    order : Order
    deadly : frozenset of int
        runs that no process survives: recorded as failed, not made
    partition : int
        number of the file
    """
    here = prepared(order)
    began, cpu_began = clocks.perf_counter(), clocks.process_time()
    rows: list[dict[str, Any]] = []
    records: list[tuple[int, pl.DataFrame]] = []
    for number in here.campaign.runs_of(partition):
        if number in deadly:
            row, record = {"run": number, **here.design.values(number), "failed": KILLED}, None
        else:
            row, record = here.run(number)
        rows.append(row)
        if record is not None:
            records.append((number, record))
    return Computed(
        partition,
        scalars_file(here.columns, rows),
        records_file(records) if here.columns.record else None,
        len(rows),
        sum(row["failed"] is not None for row in rows),
        clocks.perf_counter() - began,
        clocks.process_time() - cpu_began,
    )


def try_run(order: Order, number: int) -> None:
    """Make one run and forget what it gave: does its process survive it?"""
    prepared(order).run(number)


def _line(text: str) -> str:
    return " ".join(text.split()) or "no message"


def scalars_file(columns: Columns, rows: Sequence[Mapping[str, Any]]) -> bytes:
    """The file of scalars: one row for each run, in order; what a run lacks is null."""
    fitting = {pl.Float64: float, pl.Int64: int, pl.Boolean: bool, pl.String: str}
    series = []
    for name, dtype in columns.schema.items():
        found = [row.get(name) for row in rows]
        series.append(pl.Series(name, [v if v is None else fitting[dtype](v) for v in found], dtype=dtype))
    return _parquet(pl.DataFrame(series))


def records_file(records: Sequence[tuple[int, pl.DataFrame]]) -> bytes:
    """The file of records: the rows of its runs one after the other, with the run's number."""
    tables = [table.select(pl.lit(run, pl.Int64).alias("run"), pl.all()) for run, table in records]
    return _parquet(pl.concat(tables) if tables else pl.DataFrame({"run": pl.Series([], dtype=pl.Int64)}))


def _parquet(table: pl.DataFrame) -> bytes:
    """A table as the bytes of a Parquet file, which depend on nothing but its rows."""
    stream = io.BytesIO()
    table.write_parquet(
        stream, compression="zstd", compression_level=COMPRESSION_LEVEL, row_group_size=max(1, table.height)
    )
    return stream.getvalue()
