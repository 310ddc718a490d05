"""The command that computes the attitude of a record, a thin layer over `library.attitude_of_record`."""

from pathlib import Path
from typing import Annotated, Literal

from cyclopts import Parameter

from .answers import Answer, answer
from .options import JsonFile, OutFolder
from .outputs import distinct_files


def attitude(
    record: Annotated[Path, Parameter(help="Strapdown record, CSV or Parquet.")],
    /,
    *,
    algorithm: str = "two-sample-rodrigues",
    rates: Annotated[
        Literal["instantaneous", "averaged"], Parameter(help="What a rate in the record means.")
    ] = "instantaneous",
    rate_divisor: Annotated[int, Parameter(help="Add up so many increments to one: a slower gyro.")] = 1,
    compare: Annotated[bool, Parameter(help="Run every algorithm and show them side by side.")] = False,
    out: OutFolder | None = None,
    json: JsonFile = None,
) -> Answer:
    """Run a strapdown record through the attitude computer's FMU; compare with the true attitude where it is known.

    Example: trihedron attitude broad-03.strapdown.csv --algorithm adaptive-degree --out attitude

    Parameters
    ----------
    algorithm
        Name of the attitude algorithm; with --compare every one is run.
    out
        Folder for the computed attitude, or for the comparison.
    """
    distinct_files({"the record": record, "--json": json})
    from . import library
    from .attitude.comparison import compare_algorithms, comparison_json, comparison_text, write_comparison
    from .records import StrapdownRecord, read_record

    measured = read_record(record, StrapdownRecord)
    if compare:
        rows = compare_algorithms(measured, rates=rates, rate_divisor=rate_divisor, progress=True)
        if out is not None:
            write_comparison(rows, out / "comparison.csv")
        return answer(comparison_text(rows), json, comparison_json(rows))
    result = library.attitude_of_record(
        measured, algorithm=algorithm, rates=rates, rate_divisor=rate_divisor, out=out, progress=True
    )
    return answer(result.lines(), json, result.to_json())
