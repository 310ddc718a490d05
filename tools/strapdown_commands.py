"""The commands for strapdown records; thin layers over `trihedron.tools.strapdown`."""

from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from .answers import Answer, answer
from .options import Gravity, JsonFile
from .outputs import distinct_files, ordinary_file


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
) -> Answer:
    """Say what a strapdown record supports: sampling, rests, moves, and what its rests say of the instruments.

    Example: trihedron inspect mpu9150-0.strapdown.csv --allan allan.svg
    """
    distinct_files({"the record": record, "--json": json, "--allan": allan})
    from . import library

    found = library.inspect(record, gravity=gravity)
    if allan is not None:
        from .report.allan_pictures import allan_picture
        from .writing import write_text

        write_text(allan, allan_picture(found.record, found.rests, found.sampling.period))
    return answer(found.lines(), json, found.json_text())
