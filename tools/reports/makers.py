"""A document for each kind of result; what a kind needs is imported when its document is made."""

from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ..document.blocks import Document
from ..document.page import write_page
from ..result import Result

if TYPE_CHECKING:
    from ..check import Check
    from ..exporting import Exported
    from ..installation import Installation
    from ..orchestrator.run import Simulation

MAKERS: dict[str, tuple[str, str, str | None]] = {
    "Application": ("calibration", "application_lines", None),
    "AttitudeComparison": ("inspection", "comparison_lines", None),
    "AttitudeRun": ("inspection", "attitude_lines", None),
    "Calibration": ("calibration", "lines", "page"),
    "CampaignResult": ("campaign", "campaign_lines", None),
    "Check": ("makers", "check_lines", None),
    "Comparison": ("campaign", "change_lines", None),
    "Curve": ("plan", "curve_lines", None),
    "Diagnosis": ("diagnosis", "lines", "page"),
    "Exported": ("makers", "exported_lines", None),
    "Inspection": ("inspection", "inspection_lines", None),
    "Installation": ("makers", "installation_lines", None),
    "Plans": ("plan", "plan_lines", "plan_page"),
    "PositionPlan": ("plan", "position_lines", None),
    "PublishedCalibration": ("papers", "published_lines", None),
    "Reproduction": ("papers", "reproduction_lines", None),
    "SettingCheck": ("plan", "setting_lines", None),
    "Simulation": ("makers", "simulation_lines", None),
    "Suite": ("campaign", "suite_lines", "suite_page"),
    "WordLength": ("papers", "word_length_lines", None),
}
"""Kind of result -> module here, what makes its lines for a terminal, what makes its page."""


def document_of(result: Result, record: Any = None) -> Document:
    """What a result has to say.

    Parameters
    ----------
    result : Result
    record : record, optional
        that it was made from: its page shows it
    """
    module, lines, page = MAKERS[type(result).__name__]
    makers = import_module(f"{__package__}.{module}")
    given = () if record is None else (record,)
    return Document(
        getattr(makers, lines)(result),
        getattr(result, "to_polars", lambda: None),
        None if page is None else lambda: getattr(makers, page)(result, *given),
    )


def write_report(path: Path, result: Result, record: Any = None) -> None:
    """Write the page of a result as HTML, or as PDF where the name ends so.

    Raises
    ------
    InputError
        where the file cannot be written, or the page not be printed
    """
    page = document_of(result, record).page
    assert page is not None
    write_page(path, page())


def check_lines(result: "Check") -> list[str]:
    """The verdict, then every problem as `file:line: what`."""
    said = [result.verdict]
    for problem in result.problems:
        place = "" if problem.line is None else f":{problem.line}"
        said.append(f"{result.file}{place}: {problem.text}")
    if result.not_listed:
        said.append(f"... and {result.not_listed} more")
    said += [f"  {line}" for line in result.summary]
    return said + [f"warning: {warning}" for warning in result.warnings]


def exported_lines(result: "Exported") -> list[str]:
    """The FMUs that were written, a line each."""
    return [fmu.file for fmu in result.fmus]


def installation_lines(result: "Installation") -> list[str]:
    """The verdict, then a line for each finding."""
    wrong = [finding.subject for finding in result.findings if finding.good is False]
    verdict = "everything works" if not wrong else f"does not work: {', '.join(wrong)}"
    width = max(len(finding.subject) for finding in result.findings)
    mark = {True: "yes", False: "NO", None: "-"}
    return [verdict, *(f"{mark[f.good]:>4}  {f.subject:<{width}}  {f.state}" for f in result.findings)]


def simulation_lines(result: "Simulation") -> list[str]:
    """What was run, what it recorded, and where that is."""
    lines = [f"{result.title or 'a scenario without a title'}: {result.rows} rows of {', '.join(result.columns)}"]
    if result.rests is not None:
        lines.append(f"{result.rests} rests averaged")
    elif result.no_positions:
        lines.append(f"no position record: {result.no_positions}")
    return lines + [str(file) for file in result.files]
