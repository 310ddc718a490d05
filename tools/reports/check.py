"""What is said of files: those that were checked, those that were exported."""

from ..check import Check
from ..exporting import Exported


def check_lines(result: Check) -> list[str]:
    """The verdict, then every problem as `file:line: what`."""
    said = [result.verdict]
    for problem in result.problems:
        place = "" if problem.line is None else f":{problem.line}"
        said.append(f"{result.file}{place}: {problem.text}")
    if result.not_listed:
        said.append(f"... and {result.not_listed} more")
    said += [f"  {line}" for line in result.summary]
    return said + [f"warning: {warning}" for warning in result.warnings]


def exported_lines(result: Exported) -> list[str]:
    """The FMUs that were written, a line each."""
    return [fmu.file for fmu in result.fmus]
