"""The command that prepares a record for FMPy."""

from pathlib import Path
from typing import Annotated, Literal

from cyclopts import Parameter

from .answers import Answer, answer
from .options import JsonFile
from .outputs import distinct_files, ordinary_file


def fmpy_input(
    record: Annotated[Path, Parameter(help="Strapdown record or raw record, CSV or Parquet.")],
    /,
    *,
    rates: Annotated[
        Literal["instantaneous", "averaged"], Parameter(help="What a rate in the record means.")
    ] = "instantaneous",
    out: Annotated[Path, Parameter(help="The table of inputs (CSV).", validator=ordinary_file)] = Path("input.csv"),
    json: JsonFile = None,
) -> Answer:
    """Write a record as the table of inputs that FMPy's simulate_fmu takes; print FMPy's command for it.

    Example: trihedron fmpy-input motion.csv --out input.csv
    """
    distinct_files({"the record": record, "--out": out, "--json": json})
    from .fmpy_input import write_fmpy_input

    made = write_fmpy_input(record, out, rates=rates)
    return answer(made.command(out), json, made.to_json(out))
