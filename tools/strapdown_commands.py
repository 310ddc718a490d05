"""The commands for strapdown records; thin layers over `trihedron.strapdown`."""

from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from trihedron.errors import InputError
from trihedron.options import Gravity, JsonFile
from trihedron.outputs import distinct_files, ordinary_file


def inspect(
    record: Annotated[Path, Parameter(help="Strapdown record, CSV or Parquet.")],
    /,
    *,
    gravity: Gravity = 9.80665,
    json: JsonFile = None,
    allan: Annotated[
        Path | None,
        Parameter(help="Write the Allan deviation at rest as an SVG picture to this file.", validator=ordinary_file),
    ] = None,
) -> None:
    """Say what a strapdown record supports: sampling, rests, moves, and what its rests say of the instruments.

    Example: trihedron inspect mpu9150-0.strapdown.csv --allan allan.svg
    """
    distinct_files({"the record": record, "--json": json, "--allan": allan})
    from trihedron.records import StrapdownRecord, read_record
    from trihedron.strapdown.inspection import inspect_record, inspection_text
    from trihedron.writing import write_text

    if not 1.0 <= gravity <= 100.0:
        raise InputError(f"--gravity {gravity!r}: gravity in m/s2 is needed, 1 to 100")
    measured = read_record(record)
    if not isinstance(measured, StrapdownRecord):
        raise InputError(f"{record}: is a table record; `trihedron inspect` takes a strapdown record (w1_radps, ...)")
    found = inspect_record(measured, gravity=gravity)
    if json is not None:
        write_text(json, found.json_text())
    if allan is not None:
        from trihedron.strapdown.allan_picture import allan_picture

        write_text(allan, allan_picture(measured, found.rests, found.sampling.period))
    print(inspection_text(found))
