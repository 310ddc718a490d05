"""The command that diagnoses a record; a thin layer over `trihedron.tools.library.diagnose`."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal, cast

from cyclopts import Parameter

from .answers import Answer, answer
from .options import Bounds, DiagnosisBaseline, Gravity, JsonFile, Mounting, NoiseBound, ReportFile
from .outputs import distinct_files, ordinary_folder

if TYPE_CHECKING:
    from .diagnosis import Diagnosis
    from .records import PositionRecord, StrapdownRecord
    from .strapdown.result import StrapdownDiagnosis


def diagnose(
    record: Annotated[Path, Parameter(help="Position record, raw record or strapdown record, CSV or Parquet.")],
    /,
    *,
    noise_bound: NoiseBound = None,
    gravity: Gravity = 9.80665,
    baseline: DiagnosisBaseline = None,
    bounds: Bounds = (3e-3, 1e-2),
    mounting: Mounting = "identity",
    rates: Annotated[
        Literal["instantaneous", "averaged"], Parameter(help="What a rate in a strapdown record means.")
    ] = "instantaneous",
    json: JsonFile = None,
    report: ReportFile = None,
    export: Annotated[
        Path | None, Parameter(validator=ordinary_folder, help="Write the extended FMUs into this folder.")
    ] = None,
) -> Answer:
    """Say whether the simulation can be true of a record; if not, name the effect that it lacks.

    Example: trihedron diagnose positions.csv --noise-bound 1e-5 --json diagnosis.json --export extended
    """
    distinct_files({"the record": record, "--json": json, "--report": report})
    from . import library
    from .records import PositionRecord, StrapdownRecord, read_record

    run = read_record(record, PositionRecord, StrapdownRecord)
    result = library.diagnose(
        run,
        noise_bound=noise_bound,
        gravity=gravity,
        baseline=baseline,
        bounds=bounds,
        mounting=mounting,
        rates=rates,
        progress=True,
    )
    lines = list(result.lines())
    if report is not None:
        from .printing import write_report

        write_report(report, page_of(result, run))
    if export is not None and result.verdict == "explained":
        from .diagnosis.extension import export_extended
        from .strapdown.gain import export_gyros

        places = [cause.place for cause in result.causes]
        write = export_gyros if isinstance(run, StrapdownRecord) else export_extended
        lines += map(str, write(places, export))
    return answer(lines, json, result.json_text())


def page_of(result: "Diagnosis | StrapdownDiagnosis", run: "PositionRecord | StrapdownRecord") -> str:
    """The page of a diagnosis."""
    from .records import StrapdownRecord

    if isinstance(run, StrapdownRecord):
        from .report.strapdown_page import strapdown_page

        return strapdown_page(cast("StrapdownDiagnosis", result))
    from .report.diagnosis_sections import diagnosis_page

    return diagnosis_page(cast("Diagnosis", result), run)
