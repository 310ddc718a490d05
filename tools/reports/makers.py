"""A document for each kind of result; what a kind needs is imported when its document is made."""

from importlib import import_module
from pathlib import Path
from typing import Any

from ..document.blocks import Document
from ..document.page import write_page
from ..result import Result

MAKERS: dict[str, tuple[str, str, str | None]] = {
    "Application": ("calibration", "application_summary", None),
    "AttitudeComparison": ("inspection", "comparison_lines", None),
    "AttitudeRun": ("inspection", "attitude_lines", None),
    "BenchSuite": ("trials", "suite_text", "suite_page"),
    "BlockSuite": ("trials", "suite_text", "suite_page"),
    "Calibration": ("calibration", "calibration_summary", "calibration_page"),
    "CampaignResult": ("campaign", "campaign_lines", None),
    "Check": ("check", "check_lines", None),
    "Comparison": ("campaign", "change_lines", None),
    "Curve": ("plan", "curve_lines", None),
    "Diagnosis": ("diagnosis", "said", "page"),
    "Exported": ("check", "exported_lines", None),
    "Inspection": ("inspection", "inspection_lines", None),
    "Plans": ("plan", "plan_lines", "plan_page"),
    "PositionPlan": ("plan", "position_lines", None),
    "PublishedCalibration": ("papers", "published_lines", None),
    "Reproduction": ("papers", "reproduction_lines", None),
    "SettingCheck": ("plan", "setting_lines", None),
    "Simulation": ("run", "simulation_lines", None),
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
    said = getattr(makers, lines)(result)
    given = () if record is None else (record,)
    return Document(
        said.split("\n") if isinstance(said, str) else said,
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
