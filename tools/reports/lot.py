"""Page of a lot of instruments."""

from collections.abc import Sequence

from ..document.blocks import Page, Section, Table, table_of
from ..document.notation import Cell, unit_text
from ..lot import Lot, Member
from ..rounding import digits

MOST_ROWS = 20
"""Largest number of rows of a table on a terminal; the page has all."""
DISTRIBUTION = ("symbol", "unit", "instruments", "median", "spread", "half_width", "least", "greatest")


def lot_page(result: Lot) -> Page:
    """Return shared causes, odd instruments, dependences, tolerances, distributions, and the records."""
    sections = _findings(result)
    failures = [member for member in result.members if member.failed is not None]
    if failures:
        sections.append(_listed("Records without a result", ("record", "reason"), _reasons(failures)))
    by_tolerance = [member for member in result.members if member.status not in (None, "pass")]
    if by_tolerance:
        rows = [[one.serial, one.record, one.status, one.reason] for one in by_tolerance]
        sections.append(_listed("Out of tolerance", ("serial", "record", "status", "reason"), rows))
    if result.distributions:
        sections.append(
            Section("Distributions", [WIDTHS], table=table_of(result.distributions, DISTRIBUTION, {"unit": unit_text}))
        )
    tone = "good"
    clear = set(result.verdicts) <= {"consistent"}
    if failures or by_tolerance or result.odd or result.shared or result.dependences or not clear:
        tone = "attention"
    return Page(
        "Lot of instruments",
        _verdict(result),
        sections,
        lambda: [_members(result.members)],
        warnings=result.warnings,
        tone=tone,
    )


WIDTHS = (
    "Each instrument counts once, with its last record. Spread: 1.4826 times the median distance from the median. Half "
    "width: median half width of the guaranteed intervals."
)


def _verdict(result: Lot) -> str:
    """Return the number of instruments, verdicts and failures, and the pass and fail counts."""
    counts = [f"{count} {verdict}" for verdict, count in result.verdicts.items()]
    if result.failed:
        counts.append(f"{result.failed} without a result")
    verdict = f"{len(result.members)} records of {result.instruments} instruments: {', '.join(counts) or result.do}."
    statuses = [member.status for member in result.members]
    if any(statuses):
        shown = [f"{statuses.count(status)} {status}" for status in ("pass", "fail", "undecided")]
        verdict += f" Tolerance: {', '.join(shown)}."
    if result.first_out is not None:
        verdict += f" First out of tolerance: serial {result.first_out}."
    return verdict


def _findings(result: Lot) -> list[Section]:
    """Return the shared causes, the odd instruments and the changes over the lot."""
    sections = []
    shared = [cause.sentence for cause in result.shared]
    if result.do == "diagnose":
        sections.append(Section("Shared causes", shared or ["No cause is shared by more instruments than by chance."]))
    changes = [dependence.sentence for dependence in result.dependences]
    if changes:
        sections.append(Section("Changes over the lot", changes))
    if result.odd:
        rows = [[odd.serial, odd.record, odd.sentence] for odd in result.odd]
        sections.append(_listed("Instruments unlike their lot", ("serial", "record", "what"), rows))
    return sections


def _listed(title: str, header: Sequence[str], rows: Sequence[Sequence[Cell]]) -> Section:
    """Return a section with the first rows of a table; the table of all records is on the page."""
    notes = []
    if len(rows) > MOST_ROWS:
        notes.append(f"The first {MOST_ROWS} of {len(rows)}; lot.json and records.parquet have all.")
    return Section(title, notes, table=Table(header, rows[:MOST_ROWS]))


def _reasons(members: Sequence[Member]) -> list[list[Cell]]:
    return [[member.record, member.failed] for member in members]


def _members(members: Sequence[Member]) -> Section:
    """Return a row for each record."""
    rows = []
    for member in members:
        causes = "; ".join(cause.title for cause in member.causes)
        temperature = None if member.temperature is None else digits(member.temperature, 3)
        reason = member.failed or member.reason
        cells = [member.record, member.serial, member.date, temperature, member.verdict, causes, member.status, reason]
        rows.append(cells)
    header = ("record", "serial", "date", "temperature [degC]", "verdict", "causes", "status", "reason")
    return Section("Records", table=Table(header, rows))
