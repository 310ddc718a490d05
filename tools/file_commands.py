"""The commands for files before they are used: templates to fill in, and what is wrong with a file."""

from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from .answers import Answer, answer
from .options import JsonFile
from .outputs import distinct_files, ordinary_file


def check(
    file: Annotated[
        Path, Parameter(help="Scenario, campaign, record, programme, calibration, diagnosis, plan, mounting, FMU, SSP.")
    ],
    /,
    *,
    json: JsonFile = None,
) -> Answer:
    """Say everything that is wrong with a file, with lines; nothing is run. Exit status 2 when something is.

    Example: trihedron check bench.toml
    """
    distinct_files({"the file": file, "--json": json})
    from .checking import check as look

    found = look(file)
    return answer(found.lines(), json, found.to_json(), complaint="" if found.good else found.verdict)


def new(
    kind: Annotated[str, Parameter(help="scenario, record, raw-record, strapdown-record or mounting.")],
    file: Annotated[
        Path | None, Parameter(help="The file; KIND.toml or KIND.csv without it.", validator=ordinary_file)
    ] = None,
    /,
    *,
    positions: Annotated[
        int, Parameter(allow_leading_hyphen=True, help="Positions of a scenario or record, 6 to 30.")
    ] = 12,
    json: JsonFile = None,
) -> Answer:
    """Write a file to fill in: a scenario that runs as it is, or a record with its columns explained.

    Example: trihedron new scenario bench.toml

    Example: trihedron new record measured.csv --positions 24
    """
    distinct_files({"the file": file, "--json": json})
    from .templates import new as write

    files = [str(path) for path in write(kind, file, positions=positions)]
    return answer(files, json, {"schema": "trihedron.new/1", "kind": kind, "files": files})
