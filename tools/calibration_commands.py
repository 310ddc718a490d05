"""The commands that calibrate and correct; thin layers over `trihedron.tools.library`."""

from pathlib import Path
from typing import Annotated, Literal

from cyclopts import Parameter

from .answers import Answer, answer
from .options import (
    Baseline,
    Bounds,
    Gravity,
    JsonFile,
    Mounting,
    NoiseBound,
    Priors,
    Record,
    ReportFile,
    SsvFile,
)
from .outputs import distinct_files, ordinary_file


def calibrate(
    record: Record,
    /,
    *,
    noise_bound: NoiseBound = None,
    gravity: Gravity = 9.80665,
    convention: Literal["A1", "A2"] = "A1",
    baseline: Baseline = "asymmetric",
    bounds: Bounds = (3e-3, 1e-2),
    mounting: Mounting = "identity",
    target: Annotated[
        tuple[str, ...],
        Parameter(allow_leading_hyphen=True, help="Another combination, as X4-X5; may be repeated."),
    ] = (),
    prior: Priors = (),
    json: JsonFile = None,
    ssv: SsvFile = None,
    report: ReportFile = None,
) -> Answer:
    """Solve the guaranteed linear programme: estimates, guaranteed errors, exact intervals, verdict.

    Example: trihedron calibrate positions.csv --noise-bound 1e-5 --json calibration.json
    """
    distinct_files({"the record": record, "--json": json, "--ssv": ssv, "--report": report})
    from . import library
    from .records import PositionRecord, read_record
    from .summaries import calibration_summary

    run = read_record(record, PositionRecord)
    result = library.calibrate(
        run,
        noise_bound=noise_bound,
        gravity=gravity,
        convention=convention,
        baseline=baseline,
        bounds=bounds,
        mounting=mounting,
        targets=target,
        priors=prior,
    )
    said = answer(calibration_summary(result).split("\n"), json, result.json_text())
    if report is not None:
        from .printing import write_report
        from .report.calibration_page import calibration_page

        write_report(report, calibration_page(result, run))
    if ssv is not None:
        from .calibration.correction import write_parameter_set

        write_parameter_set(result, ssv)
    return said


def apply(
    calibration: Annotated[Path, Parameter(help="The result of `trihedron calibrate --json`.")],
    record: Annotated[Path, Parameter(help="Position, raw or strapdown record, CSV or Parquet.")],
    /,
    *,
    out: Annotated[Path | None, Parameter(help="Write the corrected record (CSV).", validator=ordinary_file)] = None,
    noise_bound: Annotated[
        float,
        Parameter(allow_leading_hyphen=True, help="Bound of the readings' own errors, a fraction of g, for the bound."),
    ] = 0.0,
    latitude_deg: Annotated[float, Parameter(allow_leading_hyphen=True, help="For the error of the azimuth.")] = 55.75,
    json: JsonFile = None,
) -> Answer:
    """Correct the readings of a record by a calibration; print the equation and what it is worth for levelling.

    Example: trihedron apply calibration.json positions.csv --out corrected.csv
    """
    distinct_files({"the calibration": calibration, "the record": record, "--out": out, "--json": json})
    from . import library
    from .records import write_record
    from .summaries import application_summary

    result = library.apply(calibration, record, noise_bound=noise_bound)
    text = application_summary(result, latitude_deg)
    if out is not None:
        write_record(result.record, out)
    return answer(text, json, result.to_json())
