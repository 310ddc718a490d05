"""A document for each kind of result, its maker imported when it is made; versions and sources that pages name."""

import sys
from collections.abc import Sequence
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ...fmus import version
from ..calibrated import Calibration
from ..document.blocks import Document, Page
from ..document.notation import minus
from ..document.page import write_page
from ..errors import InputError
from ..result import Result
from ..rounding import digits
from .pictures import keeping

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from ..check import Check
    from ..exporting import Exported
    from ..foreign import Imported
    from ..installation import Installation
    from ..orchestrator.run import Simulation

MAKERS: dict[str, tuple[str, str, str | None]] = {
    "Application": ("calibration", "application_lines", None),
    "Applied": ("several", "applied_lines", None),
    "AttitudeComparison": ("inspection", "comparison_lines", None),
    "AttitudeRun": ("inspection", "attitude_lines", None),
    "Calibration": ("calibration", "lines", "page"),
    "CampaignResult": ("campaign", "campaign_lines", None),
    "Check": ("makers", "check_lines", None),
    "Compared": ("lines", "compared_lines", "compared_page"),
    "Comparison": ("campaign", "change_lines", None),
    "Curve": ("plan", "curve_lines", None),
    "Diagnosis": ("diagnosis", "lines", "page"),
    "Entries": ("several", "entries_lines", None),
    "Entry": ("several", "entry_lines", None),
    "Exported": ("makers", "exported_lines", None),
    "ImuPlan": ("imu_plan", "lines", "operator_page"),
    "Imported": ("makers", "import_lines", None),
    "Inspection": ("inspection", "inspection_lines", None),
    "Installation": ("makers", "installation_lines", None),
    "Plans": ("plan", "plan_lines", "plan_page"),
    "Measured": ("measure", "measured_lines", None),
    "PositionPlan": ("plan", "position_lines", None),
    "PublishedCalibration": ("papers", "published_lines", None),
    "Reproduction": ("papers", "reproduction_lines", None),
    "Several": ("several", "lines", "page"),
    "SettingCheck": ("plan", "setting_lines", None),
    "Simulation": ("makers", "simulation_lines", None),
    "Suite": ("campaign", "suite_lines", "suite_page"),
    "Trend": ("several", "trend_lines", "trend_page"),
    "WordLength": ("papers", "word_length_lines", None),
}
"""Kind of result -> module here, what makes its lines for a terminal, what makes its page."""


def document_of(result: Result, record: Any = None) -> Document:
    """What a result has to say; the record that it was made from, its own if none is given, stands on its page."""
    module, lines, page = MAKERS[type(result).__name__]
    if isinstance(result, Calibration) and (result.of_record or result.convention is None):
        module, lines, page = OF_SEVERAL if result.of_record else BY_NORM
    makers = import_module(f"{__package__}.{module}")
    made_of = getattr(result, "made_of", None) if record is None else record

    def its_page() -> Page:
        given = (made_of,) if type(result).__name__ in OF_RECORDS and module != "several" else ()
        if given == (None,) and type(result).__name__ == "Calibration":
            raise InputError("the page of a calibration from a file needs the record that it was made from")
        return getattr(makers, str(page))(result, *given)

    return Document(
        getattr(makers, lines)(result),
        getattr(result, "to_polars", lambda: None),
        None if page is None else its_page,
    )


OF_SEVERAL = ("several", "joint_calibration_lines", "joint_calibration_page")
"""What makes the documents of a calibration of several records."""
BY_NORM = ("inspection", "accelerometer_lines", None)
"""What makes the lines of a calibration by the norm of gravity."""
OF_RECORDS = ("Calibration", "Diagnosis")
"""Results whose pages show the record, too."""


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


def figures(result: Result, record: Any = None) -> "dict[str, Figure]":
    """The pictures on the page of a result, as figures, by the titles of their sections in lower case."""
    page = document_of(result, record).page
    assert page is not None
    with keeping() as kept:
        sections = [section for section in page().sections if section.svg in kept]
    return {section.title.lower(): kept[str(section.svg)] for section in sections}


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


def import_lines(result: "Imported") -> list[str]:
    """What became of the file: how it was read, column by column, what was left out, the first rows as understood."""
    rows = f"{result.rows} rows" + (f" of {result.readings} readings" if result.readings != result.rows else "")
    lines = [f"{result.file}: {result.kind} of {rows}", f"read as {result.written_as}"]
    width = max(len(column.column) for column in result.columns)
    for column in result.columns:
        unit = f" in {column.unit}" if column.unit else ""
        lines.append(f"  {column.column:<{width}}  {'-' if column.sign < 0 else ''}{column.source!r}{unit}")
    lines += [f"left out: {text}" for text in result.left_out] + [*result.notes]
    lines += [f"kept: {key}: {text}" for key, text in result.about.items()]
    lines.append("its first rows:")
    lines += ["  " + ", ".join(f"{name} {_shown(value)}" for name, value in row.items()) for row in result.first_rows]
    return lines + [file for file in (result.record_file, result.mapping_file) if file is not None]


def _shown(value: float | str) -> str:
    return value if isinstance(value, str) else digits(value, 9)


def simulation_lines(result: "Simulation") -> list[str]:
    """What was run, what it recorded, and where that is."""
    lines = [f"{result.title or 'a scenario without a title'}: {result.rows} rows of {', '.join(result.columns)}"]
    if result.rests is not None:
        lines.append(f"{result.rests} rests averaged")
    elif result.no_positions:
        lines.append(f"no position record: {result.no_positions}")
    return lines + [str(file) for file in result.files]


# What pages rest on

LIBRARIES = ("numpy", "scipy", "highspy", "fmpy")


def matrix_text(matrix: Sequence[Sequence[float]]) -> str:
    """A matrix in a line."""
    return minus("; ".join(" ".join(digits(value, 6) for value in row) for row in matrix))


def versions() -> dict[str, object]:
    """Of the program and of what it computes with."""
    python = ".".join(str(part) for part in sys.version_info[:3])
    libraries = ", ".join(f"{name} {version(name)}" for name in LIBRARIES)
    return {"trihedron": version(), "computed with": f"Python {python}, {libraries}"}


SOURCES = {
    "guaranteed": (
        "Model of bench and block, targets, guaranteed estimates: A. A. Golovan, A. I. Matasov, I. E. Tarygin. "
        "Calibration of an accelerometer block with asymmetric models of its sensors. Izvestiya RAN, Teoriya i sistemy "
        "upravleniya, 2022, no. 2, pp. 107–119 (in Russian)."
    ),
    "simplex": (
        "Linear programmes, by HiGHS: Q. Huangfu, J. A. J. Hall. Parallelizing the dual revised simplex method. "
        "Mathematical Programming Computation 10 (2018), pp. 119–142. doi 10.1007/s12532-017-0130-5."
    ),
    "chebyshev": (
        "Least largest residual, and the few readings that decide it: E. W. Cheney. Introduction to Approximation "
        "Theory. McGraw-Hill, 1966, chapter 2."
    ),
    "lawson": (
        "Sets of effects refused by weighted least squares: C. L. Lawson. Contributions to the theory of linear least "
        "maximum approximation. Thesis, University of California, Los Angeles, 1961."
    ),
    "allan": (
        "Noise from the scatter within rests: D. W. Allan. Statistics of atomic frequency standards. Proceedings "
        "of the IEEE 54 (1966), pp. 221–230. doi 10.1109/PROC.1966.4634."
    ),
    "left-out": (
        "Parts of the record left out and predicted: M. Stone. Cross-validatory choice and assessment of statistical "
        "predictions. Journal of the Royal Statistical Society B 36 (1974), pp. 111–147."
    ),
    "angles": (
        "What could be taken for what, by angles between subspaces: Å. Björck, G. H. Golub. Numerical methods for "
        "computing angles between linear subspaces. Mathematics of Computation 27 (1973), pp. 579–594."
    ),
    "gyros": (
        "Model of the gyro block: P. Groves. Principles of GNSS, inertial, and multisensor integrated navigation "
        "systems. 2nd edition, Artech House, 2013, section 4.4."
    ),
    "attitude": (
        "Attitude from increments: Yu. N. Chelnokov, S. E. Perelyaev, L. A. Chelnokova. Investigation of algorithms "
        "for the inertial orientation of a moving object. Izvestiya of Saratov University, Mathematics. Mechanics. "
        "Informatics 16 (2016), no. 1, pp. 80–95 (in Russian). doi 10.18500/1816-9791-2016-16-1-80-95."
    ),
    "norm": (
        "Accelerometers by the size of gravity at rest: J. C. Lötters, J. Schipper, P. H. Veltink, W. Olthuis, "
        "P. Bergveld. Procedure for in-use calibration of triaxial accelerometers in medical applications. Sensors and "
        "Actuators A 68 (1998), pp. 221–228."
    ),
    "shuffles": "Shuffled effects as a control: R. A. Fisher. The Design of Experiments. Oliver and Boyd, 1935.",
    "fmi": (
        "Simulation by FMUs: Modelica Association. Functional Mock-up Interface for Model Exchange and "
        "Co-Simulation, version 2.0. 2014."
    ),
    "columns": (
        "Optimal plans by generated columns: P. C. Gilmore, R. E. Gomory. A linear programming approach to the "
        "cutting-stock problem. Operations Research 9 (1961), pp. 849–859. doi 10.1287/opre.9.6.849."
    ),
    "branches": (
        "Proof that no plan is better: A. H. Land, A. G. Doig. An automatic method of solving discrete programming "
        "problems. Econometrica 28 (1960), pp. 497–520. doi 10.2307/1910129."
    ),
}
"""Methods, each with what it does here and where it is from."""


def cited(*names: str | Any) -> list[str]:
    """The sources of some methods; what is false is passed over."""
    return [SOURCES[name] for name in names if name]
