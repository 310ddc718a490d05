"""The page of each kind of result: source of terminal, notebook, HTML, PDF and figures."""

import textwrap
from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from importlib import import_module
from io import BytesIO
from pathlib import Path
from typing import TYPE_CHECKING, Any, cast

from ..document.blocks import Page, Section, Table, Tone
from ..document.page import notebook, text, write_page
from ..errors import InputError
from ..result import Result
from ..rounding import digits, exactly

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from ..calibration import ExportedCalibration
    from ..check import Check
    from ..exporting import Exported
    from ..foreign import Imported
    from ..installation import Installation
    from ..orchestrator.run import Simulation

PAGES = {
    "Applied": ("calibration", "applied_page"),
    "AttitudeComparison": ("inspection", "attitude_comparison_page"),
    "AttitudeRun": ("inspection", "attitude_page"),
    "Calibration": ("calibration", "calibration_page"),
    "CampaignResult": ("campaign", "result_page"),
    "Check": ("pages", "check_page"),
    "Compared": ("lines", "compared_page"),
    "Comparison": ("campaign", "comparison_page"),
    "Curve": ("plan", "curve_page"),
    "Diagnosis": ("diagnosis", "diagnosis_page"),
    "Entries": ("several", "entries_page"),
    "Entry": ("several", "entry_page"),
    "Exported": ("pages", "exported_page"),
    "ExportedCalibration": ("pages", "exported_calibration_page"),
    "HandPlan": ("plan", "hand_page"),
    "ImuPlan": ("plan", "imu_page"),
    "Imported": ("pages", "import_page"),
    "Inspection": ("inspection", "inspection_page"),
    "Installation": ("pages", "installation_page"),
    "Lot": ("lot", "lot_page"),
    "Measured": ("measure", "measured_page"),
    "Noise": ("noise", "noise_page"),
    "Plans": ("plan", "plans_page"),
    "PositionPlan": ("plan", "positions_page"),
    "PublishedCalibration": ("papers", "published_page"),
    "Reproduction": ("papers", "reproduction_page"),
    "SettingCheck": ("plan", "setting_page"),
    "Simulation": ("pages", "simulation_page"),
    "Suite": ("campaign", "suite_page"),
    "WordLength": ("papers", "word_length_page"),
}
"""Kind of result -> module here, and its function that makes the page."""
BY_FIELD = {
    "Calibration": {
        "changes": ("several", "trend_page"),
        "by_hand": ("by_hand", "by_hand_page"),
        "of_record": ("several", "joint_calibration_page"),
        "positions": ("calibration", "calibration_page"),
        "explained_by": ("calibration", "calibration_page"),
        "parameters": ("inspection", "norm_page"),
    },
    "Diagnosis": {"records": ("several", "several_page")},
}
"""Page of a result of one kind by the first of its fields that is not empty."""
OF_RECORDS = ("calibration_page", "diagnosis_page")
"""Pages that also show the result's record."""


def page_of(result: Result, record: Any = None) -> Page | None:
    """Return the page of a result; None for a part of a result, which has none.

    Parameters
    ----------
    result : Result
        the result
    record : PositionRecord, StrapdownRecord, optional
        the result's record, if the result does not know it

    Returns
    -------
    Page or None
        the page
    """
    maker_of_kind = _maker(result)
    if maker_of_kind is None:
        return None
    module, maker = maker_of_kind
    make: Callable[..., Page] = getattr(import_module(f"{__package__}.{module}"), maker)
    if maker in OF_RECORDS:
        return make(result, getattr(result, "made_of", None) if record is None else record)
    return make(result)


def _maker(result: Result) -> tuple[str, str] | None:
    """Return the module and the function that make the page of a result; None if it has none."""
    kind = type(result).__name__
    for field, maker in BY_FIELD.get(kind, {}).items():
        if getattr(result, field):
            return maker
    return PAGES.get(kind)


def shown(result: Result, medium: str, *options: Any) -> Any:
    """Show a result to a person.

    Parameters
    ----------
    result : Result
        the result
    medium : str
        "text" and "notebook" return a text; "page" writes a file; "figures" returns the pictures; "sheet" writes the
        sheet of a calibration
    options
        for a page its path and the record, for figures the record, for a sheet path, record and known facts

    Raises
    ------
    TypeError
        for a part of a result, which has no page
    """
    if medium == "sheet":
        from .sheet import write_sheet

        path, *known = options
        return write_sheet(path, cast(Any, result), *known)
    if medium == "page":
        return write_report(options[0], result, options[1])
    if medium == "figures":
        return figures(result, *options)
    page = page_of(result)
    if page is None:
        return None
    if medium == "text":
        return text(page)
    table: Callable[[], Any] = getattr(result, "to_polars", lambda: None)
    return notebook(page, table())


def write_report(path: Path, result: Result, record: Any = None) -> None:
    """Write the page of a result as HTML, or as PDF if the name ends so.

    Raises
    ------
    InputError
        if the file cannot be written, or the page cannot be printed
    TypeError
        for a part of a result, which has no page
    """
    write_page(path, _page_with_record(result, record))


def figures(result: Result, record: Any = None) -> "dict[str, Figure]":
    """Return the pictures on the page of a result, as figures, by the titles of their sections in lower case."""
    drawn = {}
    for section in _page_with_record(result, record).sections:
        if section.picture is not None:
            figure: Any = section.picture.figure()
            figure._repr_png_ = partial(_png, figure)
            drawn[section.title.lower()] = figure
    return drawn


def _png(figure: "Figure") -> bytes:
    """Return a figure as PNG: a notebook shows it without a backend of matplotlib."""
    content = BytesIO()
    figure.savefig(content, format="png", dpi=100)
    return content.getvalue()


def _page_with_record(result: Result, record: Any) -> Page:
    """Return the page of a result.

    Raises InputError if it needs a record that is not known.
    """
    has_record = record is not None or getattr(result, "made_of", None) is not None
    if not has_record and _maker(result) == PAGES["Calibration"]:
        raise InputError("the page of a calibration from a file needs the record that it was made from")
    page = page_of(result, record)
    if page is None:
        raise TypeError(f"a {type(result).__name__} has no page")
    return page


def plain_page(title: str, verdict: str, lines: Sequence[str] = (), warnings: Sequence[str] = ()) -> Page:
    """Return a page of a verdict and a few lines."""
    return Page(title, verdict, [Section(title, lines)], warnings=warnings)


def _tone(*, good: bool) -> Tone:
    return "good" if good else "attention"


# Results that need few words


def check_page(result: "Check") -> Page:
    """Return the verdict, and every problem as `file:line: what`."""
    lines = []
    for problem in result.problems:
        place = "" if problem.line is None else f":{problem.line}"
        lines.append(f"{result.file}{place}: {problem.text}")
    if result.not_listed:
        lines.append(f"... and {result.not_listed} more")
    for line in result.summary:
        lines += textwrap.wrap(line, 80, initial_indent="  ", subsequent_indent="    ", break_on_hyphens=False)
    page = plain_page(f"Check of {result.file}", result.verdict, lines, result.warnings)
    return replace(page, tone=_tone(good=result.good))


def exported_page(result: "Exported") -> Page:
    """Return the written FMUs, a line each."""
    first, *further = [fmu.file for fmu in result.fmus]
    return plain_page("FMUs", first, further)


def exported_calibration_page(result: "ExportedCalibration") -> Page:
    """Return the files of a calibration, the equation, the losses of the format, and the undetermined parameters."""
    lines = [*result.equation, f"g = {exactly(result.gravity)} m/s2; verdict of the calibration: {result.verdict}"]
    lines += [f"lost: {part}" for part in result.lost]
    lines += [f"not determined: {direction}" for direction in result.open]
    return plain_page("Exported calibration", ", ".join(result.files), lines)


def installation_page(result: "Installation") -> Page:
    """Return the verdict, and a row for each finding."""
    wrong = [finding.subject for finding in result.findings if finding.good is False]
    verdict = f"does not work: {', '.join(wrong)}" if wrong else "everything works"
    marks = {True: "yes", False: "NO", None: "-"}
    rows = [[marks[one.good], one.subject, one.state] for one in result.findings]
    section = Section("Installation", table=Table(["good", "what", "state"], rows))
    return Page("Installation", verdict, [section], tone=_tone(good=not wrong))


def import_page(result: "Imported") -> Page:
    """Return the result of an import: format, columns, left-out parts, the first rows as understood."""
    rows = f"{result.rows} rows"
    if result.readings != result.rows:
        rows += f" of {result.readings} readings"
    lines = [f"read as {result.written_as}"]
    width = max(len(column.column) for column in result.columns)
    origin = max(len(f"{column.source!r} in {column.unit}") for column in result.columns)
    for column in result.columns:
        sign = "-" if column.sign < 0 else ""
        unit = f" in {column.unit}" if column.unit else ""
        values = ", ".join(_cell_text(row[column.column]) for row in result.first_rows if column.column in row)
        lines.append(f"  {column.column:<{width}}  {f'{sign}{column.source!r}{unit}':<{origin}}  {values}".rstrip())
    for reason in result.left_out:
        lines.append(f"left out: {reason}")
    lines += result.notes
    for key, value in result.about.items():
        lines.append(f"kept: {key}: {value}")
    for file in (result.record_file, result.mapping_file):
        if file is not None:
            lines.append(file)
    return plain_page(f"Import of {result.file}", f"{result.file}: {result.kind} of {rows}", lines)


def _cell_text(value: float | str) -> str:
    return value if isinstance(value, str) else digits(value, 6)


def simulation_page(result: "Simulation") -> Page:
    """Return the run, its recorded columns, and its files."""
    title = result.title or "a scenario without a title"
    lines = []
    if result.rests is not None:
        lines.append(f"{result.rests} rests averaged")
    elif result.no_positions:
        lines.append(f"no position record: {result.no_positions}")
    for file in result.files:
        lines.append(str(file))
    return plain_page("Simulation", f"{title}: {result.rows} rows of {', '.join(result.columns)}", lines)
