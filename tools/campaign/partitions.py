"""Files of the data set: fixed ranges of runs, each a Parquet file whose bytes depend on nothing but its runs."""

import io
from collections.abc import Mapping, Sequence
from typing import Any

import polars as pl

from .file import Campaign
from .kinds import Columns

COMPRESSION_LEVEL = 3


def partition_count(campaign: Campaign) -> int:
    """How many files the data set has."""
    return -(-campaign.runs // campaign.partition_size)


def runs_of(campaign: Campaign, partition: int) -> range:
    """The runs of a partition."""
    first = partition * campaign.partition_size
    return range(first, min(first + campaign.partition_size, campaign.runs))


def partition_name(campaign: Campaign, partition: int) -> str:
    """The name of its file; names in order are runs in order."""
    digits = max(5, len(str(partition_count(campaign) - 1)))
    return f"part-{partition:0{digits}d}.parquet"


def scalars_file(columns: Columns, rows: Sequence[Mapping[str, Any]]) -> bytes:
    """The file of a partition's scalars: one row for each run, in order; what a run lacks is null."""
    schema = columns.schema
    series = [
        pl.Series(name, [_fitting(row.get(name), dtype) for row in rows], dtype=dtype) for name, dtype in schema.items()
    ]
    return parquet(pl.DataFrame(series))


def _fitting(value: Any, dtype: type[pl.DataType]) -> Any:
    if value is None:
        return None
    if dtype == pl.Float64:
        return float(value)
    if dtype == pl.Int64:
        return int(value)
    return bool(value) if dtype == pl.Boolean else str(value)


def records_file(records: Sequence[tuple[int, pl.DataFrame]]) -> bytes:
    """The file of a partition's records: the rows of its runs one after the other, with the run's number."""
    tables = [table.select(pl.lit(run, pl.Int64).alias("run"), pl.all()) for run, table in records]
    return parquet(pl.concat(tables) if tables else pl.DataFrame({"run": pl.Series([], dtype=pl.Int64)}))


def parquet(table: pl.DataFrame) -> bytes:
    """A table as the bytes of a Parquet file."""
    stream = io.BytesIO()
    table.write_parquet(
        stream, compression="zstd", compression_level=COMPRESSION_LEVEL, row_group_size=max(1, table.height)
    )
    return stream.getvalue()
