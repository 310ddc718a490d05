"""The runs of a campaign: its order, which goes to whoever computes; which run is which; what a worker makes of them.

Of a run the parameters and the seed follow from the campaign and the run's number alone.

Run number = (combination × samples + sample) × repeats + repeat. With Saltelli's sampling the samples are the rows of
A, then of B, then of A with each column from B; a row has the same random errors in all of them, so that a parameter
that does nothing has indices of exactly nothing.
"""

import hashlib
import io
import os
import platform
import time as clocks
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cache, cached_property, lru_cache
from importlib import metadata
from multiprocessing.util import Finalize
from pathlib import Path, PurePosixPath
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
import polars as pl
import scipy
from numpy.typing import NDArray

from ... import fmus, models
from ..errors import InputError, nearest
from ..orchestrator.scenario import read_scenario
from .file import Campaign, Value, parse_campaign, read_campaign
from .kinds import RUNNERS, Output, Runner

_PACKAGES = ("trihedron", "numpy", "scipy", "highspy", "numba", "polars", "fmpy")
_CODE = (
    *("attitude", "bounded", "calibration", "campaign", "diagnosis", "evidence", "motion"),
    *("orchestrator", "papers", "records", "trials"),
)
"""Sub-packages that results follow from, beside models and fmus."""
_SAMPLES_STREAM, _ERRORS_STREAM = 0, 1
_CHUNK = 256
"""Rows of a Sobol sequence that are made at once."""
OWN_COLUMNS = ("run", "failed", "diagnosis")
COMPRESSION_LEVEL = 3
KILLED = "the run ended its worker process each time it was tried"
"""The message of a run that no process survives."""


@dataclass(frozen=True)
class Order:
    """Everything that a worker needs to know of a campaign, wherever it is.

    The campaign file and all that it reads, by their paths below the folder that they share, and the `code_hash` of
    whoever gives the order.
    """

    campaign_file: str
    files: tuple[tuple[str, bytes], ...]
    code: str

    @cached_property
    def sha256(self) -> str:
        """Of the names and contents of all files, and of the code."""
        digest = hashlib.sha256(f"{self.campaign_file}\0{self.code}".encode())
        for name, content in self.files:
            digest.update(f"\0{name} {len(content)}\0".encode() + content)
        return digest.hexdigest()

    def unpack(self, folder: Path) -> Campaign:
        """Write the files into a folder; returns the campaign as it is read there."""
        for name, content in self.files:
            path = folder / name
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_bytes(content)
        return read_campaign(folder / self.campaign_file)

    @property
    def hashes(self) -> dict[str, str]:
        """SHA-256 of each file that the campaign reads."""
        return {name: hashlib.sha256(content).hexdigest() for name, content in self.files}


def make_order(path: Path) -> tuple[Order, Campaign]:
    """Read a campaign file and all that it reads; an InputError for what cannot be read or is not what it should be."""

    def content(file: Path) -> bytes:
        try:
            return file.read_bytes()
        except OSError as error:
            before = "" if file == path else f"{path}: "
            raise InputError(f"{before}{file}: cannot be read ({error.strerror})") from error

    found = {path.resolve(): content(path)}
    campaign = parse_campaign(found[path.resolve()], path)
    simulated, calibrated = campaign.simulation, campaign.calibration
    if simulated is not None:
        file = (campaign.base_folder / simulated.scenario).resolve()
        found[file] = content(file)
        for name in _inputs_of_scenario(file):
            inner = (file.parent / name).resolve()
            found[inner] = content(inner)
    elif calibrated is not None and calibrated.positions is not None:
        file = (campaign.base_folder / calibrated.positions).resolve()
        found[file] = content(file)
    root = Path(os.path.commonpath([file.parent for file in found]))
    files = sorted((PurePosixPath(file.relative_to(root)).as_posix(), content) for file, content in found.items())
    name = PurePosixPath(path.resolve().relative_to(root)).as_posix()
    return Order(name, tuple(files), code_hash()), campaign


def _inputs_of_scenario(file: Path) -> Iterable[str]:
    if file.suffix.lower() != ".toml":
        raise InputError(f"{file}: simulation.scenario must be a scenario file (TOML)")
    scenario = read_scenario(file)
    for setting in scenario.fmus.values():
        yield from (name for name in (setting.fmu, setting.parameters_from) if name is not None)
    for stimulus in scenario.stimuli:
        yield from (name for name in (stimulus.csv, stimulus.programme) if name is not None)


@cache
def code_hash() -> str:
    """Hash of the code that results follow from, and of the versions of what it uses."""
    digest = hashlib.sha256(f"{platform.python_version()} {platform.machine()}".encode())
    for package in _PACKAGES:
        digest.update(f"\0{package} {metadata.version(package)}".encode())
    tools = Path(__file__).parents[1]
    folders = [Path(str(package.__file__)).parent for package in (models, fmus)]
    folders += [tools / name for name in _CODE]
    for folder in folders:
        for path in sorted(folder.rglob("*.py")):
            digest.update(f"\0{path.relative_to(folder).as_posix()}\0".encode() + path.read_bytes())
    return digest.hexdigest()


def versions() -> dict[str, str]:
    """Versions that the manifest names."""
    return {name: metadata.version(name) for name in _PACKAGES} | {"python": platform.python_version()}


class Design:
    """Which run of a campaign is which."""

    def __init__(self, campaign: Campaign) -> None:
        self.campaign = campaign
        self._chunk: tuple[int, NDArray] | None = None

    @cached_property
    def _lists(self) -> dict[str, list[Any]]:
        return {name: axis.listed() for name, axis in self.campaign.lists.items()}

    @cached_property
    def _hypercube(self) -> NDArray:
        """All points of a Latin hypercube: it has no shorter description."""
        sampler = scipy.stats.qmc.LatinHypercube(len(self.campaign.distributions), rng=self._generator())
        return sampler.random(self.campaign.sampling.points)

    def _generator(self, *key: int) -> np.random.Generator:
        return np.random.default_rng(np.random.SeedSequence(self.campaign.seed, spawn_key=(_SAMPLES_STREAM, *key)))

    def _sobol(self, columns: int, row: int) -> NDArray:
        """A row of a scrambled Sobol sequence of so many columns."""
        chunk, at = divmod(row, _CHUNK)
        if self._chunk is None or self._chunk[0] != chunk:
            sampler = scipy.stats.qmc.Sobol(columns, rng=self._generator())
            if chunk:
                sampler.fast_forward(chunk * _CHUNK)
            self._chunk = (chunk, sampler.random(_CHUNK))
        return self._chunk[1][at]

    def _cube(self, sample: int) -> NDArray:
        """The point of a sample in the unit cube of the distributions."""
        campaign, count = self.campaign, len(self.campaign.distributions)
        method = campaign.sampling.method
        if method == "latin-hypercube":
            return self._hypercube[sample]
        if method == "sobol":
            return self._sobol(count, sample)
        if method == "saltelli":
            block, row = divmod(sample, campaign.sampling.points)
            both = self._sobol(2 * count, row)
            point = both[count:] if block == 1 else both[:count].copy()
            if block > 1:
                point[block - 2] = both[count + block - 2]
            return point
        return self._generator(sample).random(count)

    def values(self, run: int) -> dict[str, Value]:
        """The parameters of a run, in the order of the file."""
        campaign = self.campaign
        combination, sample = divmod(run // campaign.repeats, campaign.samples)
        spread = campaign.distributions
        cube = self._cube(sample) if spread else np.zeros(0)
        drawn = {name: float(axis.quantile(u)) for (name, axis), u in zip(spread.items(), cube, strict=True)}
        listed: dict[str, Value] = {}
        for name, values in reversed(self._lists.items()):
            at = combination % len(values)
            listed[name] = values[at]
            if campaign.sampling.lists == "product":
                combination //= len(values)
        return {name: listed[name] if name in listed else drawn[name] for name in campaign.parameters}

    def seed(self, run: int) -> np.random.SeedSequence:
        """The seed of everything in a run that is random beside its parameters."""
        number = run
        if self.campaign.sampling.method == "saltelli":
            number = run % self.campaign.sampling.points
        return np.random.SeedSequence(self.campaign.seed, spawn_key=(_ERRORS_STREAM, number))


@dataclass(frozen=True)
class Columns:
    """Columns of a campaign's data set: parameters, the outputs that are kept, and whether diagnosis and record are."""

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
    """A file of the data set that was computed, by its number: its content, and that of the file of records beside it.

    It has so many runs, of which some failed, and took so long, by the clock and of the processor [s].
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
    return RUNNERS[campaign.kind](campaign, getattr(campaign, campaign.kind))


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

    An InputError where this process has other code than who gave the order: results would be mixed with other ones.
    """
    if order.code != code_hash():
        raise InputError("a worker has another version of Trihedron, or of what it uses, than this process")
    return _prepared(order.sha256, order)


def compute(order: Order, deadly: frozenset[int], partition: int) -> Computed:
    """Make the runs of a file of the data set; the deadly ones, which no process survives, are recorded as failed."""
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
