"""The commands that compute published tables again."""

from pathlib import Path
from typing import Annotated

from cyclopts import App, Parameter

from .answers import Answer, answer
from .options import JsonFile
from .outputs import distinct_files, ordinary_folder

reproduce = App(name="reproduce", help="Compute published tables again, and say where they are wrong.")


@reproduce.command
def calibration(*, json: JsonFile = None) -> Answer:
    """Compute the published calibration tables again, and say where they are wrong.

    Example: trihedron reproduce calibration
    """
    from .planning.published import check_published_calibration, published_summary

    rows = check_published_calibration()
    content = [{**vars(row), "remarks": list(row.remarks)} for row in rows]
    return answer(published_summary(rows), json, {"schema": "trihedron.published-calibration/1", "rows": content})


@reproduce.command
def attitude(
    *,
    out: Annotated[
        Path | None, Parameter(validator=ordinary_folder, help="Folder for attitude.csv and attitude.svg.")
    ] = None,
    json: JsonFile = None,
) -> Answer:
    """Run every published row of the attitude algorithms again: published, reproduced, ratio, true method error.

    Example: trihedron reproduce attitude --out reproduced
    """
    written = {f"--out (attitude.{form})": out and out / f"attitude.{form}" for form in ("csv", "svg")}
    distinct_files({**written, "--json": json})
    from .attitude.reproduction import reproduce_attitude
    from .attitude.reproduction_output import reproduction_json, reproduction_summary, write_reproduction

    result = reproduce_attitude(progress=True)
    files = write_reproduction(result, out)
    return answer([*reproduction_summary(result), *map(str, files)], json, reproduction_json(result))


@reproduce.command
def word_length(*, json: JsonFile = None) -> Answer:
    """Show what 32-bit arithmetic and 32-bit increments cost the update (22), and what mends it.

    Example: trihedron reproduce word-length
    """
    from .attitude.word_length import word_length_errors, word_length_summary

    errors = word_length_errors(progress=True)
    content = [{**vars(e), "error": float(e.error)} for e in errors]
    return answer(word_length_summary(errors), json, {"schema": "trihedron.word-length/1", "errors_rad": content})
