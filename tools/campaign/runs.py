"""Run a campaign: the parameters of each run, and the work of a process on the runs of a file.

The parameters and the seed of a run follow from the campaign and the run's number alone.

Run number = (combination × samples + sample) × repeats + repeat. With Saltelli's sampling the samples are the rows of
A, then of B, then of A with each column from B. A row has the same random errors in all of them, so the indices of a
parameter without effect are exactly zero.
"""

import io
import time as clocks
from collections.abc import Mapping, Sequence
from contextlib import ExitStack, closing
from functools import cached_property, lru_cache, partial
from multiprocessing.util import Finalize
from pathlib import Path
from typing import Any

import numpy as np
import polars as pl
import scipy
from numpy.typing import NDArray

from ..errors import InputError, nearest
from ..locks import own_folder
from ..progress import progress_bar
from ..rounding import digits
from ..workers import made
from .code import code_hash
from .file import Campaign, Computation, Value
from .kinds import RUNNERS, AttitudeRuns, RunInput, Runner
from .store import Computed, Order, ResultColumns, make_order, opened_store
from .summary import CampaignResult, Cost, summarise

_SAMPLES_STREAM, _ERRORS_STREAM = 0, 1
_CHUNK = 256
"""Rows of a Sobol sequence that are made at once."""
OWN_COLUMNS = ("run", "failed", "diagnosis")
COMPRESSION_LEVEL = 3
DTYPES: dict[type, type[pl.DataType]] = {bool: pl.Boolean, str: pl.String}
"""Data types of listed values that are not numbers."""


class Design:
    """Parameters and seed of each run of a campaign."""

    def __init__(self, campaign: Campaign) -> None:
        self.campaign = campaign
        self._chunk: tuple[int, NDArray] | None = None

    @cached_property
    def _lists(self) -> dict[str, list[Any]]:
        return {name: axis.listed() for name, axis in self.campaign.lists.items()}

    @cached_property
    def _hypercube(self) -> NDArray:
        """Return all points of a Latin hypercube, which cannot be computed one by one."""
        sampler = scipy.stats.qmc.LatinHypercube(len(self.campaign.distributions), rng=self._generator())
        return sampler.random(self.campaign.sampling.points)

    def _generator(self, *key: int) -> np.random.Generator:
        return np.random.default_rng(np.random.SeedSequence(self.campaign.seed, spawn_key=(_SAMPLES_STREAM, *key)))

    def _sobol(self, columns: int, row: int) -> NDArray:
        """Return a row of a scrambled Sobol sequence of this number of columns."""
        chunk, at = divmod(row, _CHUNK)
        if self._chunk is None or self._chunk[0] != chunk:
            sampler = scipy.stats.qmc.Sobol(columns, rng=self._generator())
            if chunk:
                sampler.fast_forward(chunk * _CHUNK)
            self._chunk = (chunk, sampler.random(_CHUNK))
        return self._chunk[1][at]

    def _cube(self, sample: int) -> NDArray:
        """Return the point of a sample in the unit cube of the distributions."""
        campaign, count = self.campaign, len(self.campaign.distributions)
        method = campaign.sampling.method
        if method == "latin-hypercube":
            return self._hypercube[sample]
        if method == "sobol":
            return self._sobol(count, sample)
        if method == "saltelli":
            block, row = divmod(sample, campaign.sampling.points)
            pair = self._sobol(2 * count, row)
            point = pair[:count].copy()
            if block == 1:
                point = pair[count:]
            if block > 1:
                point[block - 2] = pair[count + block - 2]
            return point
        return self._generator(sample).random(count)

    def values(self, run: int) -> dict[str, Value]:
        """Return the parameters of a run, in the order of the file."""
        campaign = self.campaign
        combination, sample = divmod(run // campaign.repeats, campaign.samples)
        spread = campaign.distributions
        drawn: dict[str, Value] = {}
        if spread:
            for (name, axis), u in zip(spread.items(), self._cube(sample), strict=True):
                drawn[name] = float(axis.quantile(u))
        listed: dict[str, Value] = {}
        for name, values in reversed(self._lists.items()):
            at = combination % len(values)
            listed[name] = values[at]
            if campaign.sampling.lists == "product":
                combination //= len(values)
        values = drawn | listed
        return {name: values[name] for name in campaign.parameters}

    def seed(self, run: int) -> np.random.SeedSequence:
        """Return the seed of everything random in a run beside its parameters."""
        number = run
        if self.campaign.sampling.method == "saltelli":
            number = run % self.campaign.sampling.points
        return np.random.SeedSequence(self.campaign.seed, spawn_key=(_ERRORS_STREAM, number))


def make_runner(campaign: Campaign) -> Runner:
    """Return the runner of a campaign.

    Raises InputError if the file asks for something impossible.
    """
    return RUNNERS[campaign.kind](campaign, getattr(campaign, campaign.kind))


def columns_of(campaign: Campaign, runner: Runner) -> ResultColumns:
    """Return the columns of the data set; refuse unknown and ambiguous names."""
    parameters: dict[str, type[pl.DataType]] = {}
    for name, axis in campaign.parameters.items():
        if name in runner.outputs or name in OWN_COLUMNS:
            raise InputError(f"parameters.{name}: a run gives a scalar of that name")
        parameters[name] = pl.Float64
        if axis.discrete:
            parameters[name] = DTYPES.get(type(axis.listed()[0]), pl.Float64)
    outputs = dict(runner.outputs)
    if campaign.keep.scalars is not None:
        for name in campaign.keep.scalars:
            if name not in outputs:
                raise InputError(f"keep.scalars: '{name}' is not what a run gives; {nearest(name, list(outputs))}")
        for name in runner.outputs:
            if name not in campaign.keep.scalars:
                del outputs[name]
    dtypes = {name: output.dtype for name, output in outputs.items()} | parameters
    for number, computation in enumerate(campaign.compute, start=1):
        _refuse_other_columns(f"compute[{number}]", computation, dtypes)
        if computation.sensitivity and pl.Float64 not in parameters.values():
            raise InputError("compute: sensitivity needs parameters that are numbers")
    return ResultColumns(parameters, outputs, campaign.keep.diagnosis, campaign.keep.record)


def _refuse_other_columns(where: str, computation: Computation, dtypes: Mapping[str, type[pl.DataType]]) -> None:
    """Refuse a computation of unknown columns, or of texts if it takes numbers."""
    for name in computation.names:
        if name not in dtypes:
            raise InputError(f"{where}: '{name}' is not a column of the results; {nearest(name, list(dtypes))}")
    numbers = (computation.quantiles or []) + (computation.sensitivity or [])
    if computation.against is not None:
        numbers.append(computation.against)
    for name in numbers:
        if dtypes[name] == pl.String:
            raise InputError(f"{where}: '{name}' is a text, where a number is wanted")


class Prepared:
    """A campaign in a worker: read, with its runner, and with its files in a folder for the runner.

    Raises InputError if this process has other code than the process that gave the order: results would be mixed.
    """

    def __init__(self, order: Order) -> None:
        if order.code != code_hash():
            raise InputError("a worker has another version of Trihedron, or of what it uses, than this process")
        stack = ExitStack()
        # A process of multiprocessing does not run atexit functions.
        Finalize(self, stack.close, exitpriority=10)
        self.campaign = order.unpack(stack.enter_context(own_folder()))
        self.design, self.runner = Design(self.campaign), make_runner(self.campaign)
        self.columns = columns_of(self.campaign, self.runner)

    def runs(self, partition: int) -> list[RunInput]:
        """Return number, parameters and seed of each run of a file; make those at once that the runner can."""
        runs: list[RunInput] = []
        for number in self.campaign.runs_of(partition):
            runs.append((number, self.design.values(number), self.design.seed(number)))
        if isinstance(self.runner, AttitudeRuns):
            self.runner.make_ahead(runs)
        return runs

    def run(self, run: RunInput) -> tuple[dict[str, Any], pl.DataFrame | None]:
        """Return a run's row, and its record if it is kept; a failed run has its message in the row."""
        number, values, seed = run
        row: dict[str, Any] = {"run": number, **values, "failed": None}
        try:
            outcome = self.runner.run(number, values, seed)
        except InputError as error:
            return {**row, "failed": _line(str(error))}, None
        except Exception as error:
            # One failed run must not stop the others.
            return {**row, "failed": _line(f"{type(error).__name__}: {error}")}, None
        row |= {name: outcome.scalars.get(name) for name in self.columns.outputs}
        if self.columns.diagnosis:
            row["diagnosis"] = outcome.diagnosis
        return row, outcome.record


prepared = lru_cache(maxsize=2)(Prepared)
"""Return the campaign of an order, prepared once in each process."""


def compute(order: Order, partition: int) -> Computed:
    """Make the runs of a file of the data set."""
    campaign = prepared(order)
    began, cpu_began = clocks.perf_counter(), clocks.process_time()
    rows: list[dict[str, Any]] = []
    records: list[tuple[int, pl.DataFrame]] = []
    for run in campaign.runs(partition):
        row, record = campaign.run(run)
        rows.append(row)
        if record is not None:
            records.append((run[0], record))
    return Computed(
        partition,
        scalars_file(campaign.columns, rows),
        records_file(records) if campaign.columns.record else None,
        len(rows),
        sum(row["failed"] is not None for row in rows),
        clocks.perf_counter() - began,
        clocks.process_time() - cpu_began,
    )


def _line(text: str) -> str:
    return " ".join(text.split()) or "no message"


def scalars_file(columns: ResultColumns, rows: Sequence[Mapping[str, Any]]) -> bytes:
    """Return the file of scalars: one row for each run, in order; missing values are null."""
    fitting = {pl.Float64: float, pl.Int64: int, pl.Boolean: bool, pl.String: str}
    series = []
    for name, dtype in columns.schema.items():
        values = []
        for row in rows:
            value = row.get(name)
            if value is not None:
                value = fitting[dtype](value)
            values.append(value)
        series.append(pl.Series(name, values, dtype=dtype))
    return _parquet(pl.DataFrame(series))


def records_file(records: Sequence[tuple[int, pl.DataFrame]]) -> bytes:
    """Return the file of records: the rows of its runs one after the other, with the run's number."""
    tables = [table.select(pl.lit(run, pl.Int64).alias("run"), pl.all()) for run, table in records]
    if not tables:
        tables = [pl.DataFrame({"run": pl.Series([], dtype=pl.Int64)})]
    return _parquet(pl.concat(tables))


def _parquet(table: pl.DataFrame) -> bytes:
    """Return a table as the bytes of a Parquet file, which depend only on its rows."""
    stream = io.BytesIO()
    table.write_parquet(
        stream, compression="zstd", compression_level=COMPRESSION_LEVEL, row_group_size=max(1, table.height)
    )
    return stream.getvalue()


def campaign_folder(path: Path) -> Path:
    """Return the default folder of a campaign: `<campaign>-campaign` in the current folder."""
    return Path(f"{path.stem}-campaign")


def carry_out_campaign(
    path: Path, out: Path | None = None, *, resume: bool = False, progress: bool = False, **workers: Any
) -> CampaignResult:
    """Run a campaign; arguments and errors are those of `trihedron.run_campaign`, which also writes the page.

    `workers` are the engine, jobs and scheduler of the processes.
    """
    began = clocks.perf_counter()
    order, campaign = make_order(path)
    # Refuse impossible requests before anything is written.
    columns = columns_of(campaign, make_runner(campaign))
    folder = campaign_folder(path) if out is None else out
    with opened_store(folder, order, campaign, columns, path.read_bytes(), resume=resume) as store:
        missing, before, failed = store.missing()
        finished, seconds, cpu_seconds = before, 0.0, 0.0
        try:
            files = made(partial(compute, order), missing, **workers)
            # Ctrl-C ends the processes at once.
            with progress_bar("runs", campaign.runs, show=progress) as advance, closing(files):
                advance(before)
                for computed in files:
                    store.write(computed)
                    finished, failed = finished + computed.runs, failed + computed.failures
                    seconds, cpu_seconds = seconds + computed.seconds, cpu_seconds + computed.cpu_seconds
                    rate = (finished - before) / max(clocks.perf_counter() - began, 1e-9)
                    words = f", {failed} failed" if failed else ""
                    advance(computed.runs, f"{finished} of {campaign.runs} runs, {digits(rate)}/s{words}")
        except (KeyboardInterrupt, InputError) as error:
            progress_text = f"{finished} of {campaign.runs} runs are in {folder}; continue with --resume"
            if isinstance(error, InputError):
                raise InputError(f"{error}; {progress_text}") from error
            raise KeyboardInterrupt(f"interrupted; {progress_text}") from None
        cost = Cost(campaign.runs - before, clocks.perf_counter() - began, seconds, cpu_seconds)
        result = summarise(store).model_copy(update={"folder": folder, "cost": cost})
        store.write_summary(result.to_json())
    return result
