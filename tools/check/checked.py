"""Check a file of any kind: its first bytes and its ending decide what lists its problems."""

from collections.abc import Sequence
from pathlib import Path

from ..files import LARGEST, LARGEST_RESULT, LARGEST_TEXT, ZIP, bytes_of, is_workbook
from .findings import Check, Findings

MOST = 200
"""Largest number of a record's problems that are listed."""


def check(path: Path | str, channels: Sequence[str] = (), stamps: str | None = None, *, trust: bool = False) -> Check:
    """List all problems of a file that Trihedron reads, with lines; its content decides the kind.

    Kinds: a scenario, campaign or file of mountings (TOML); a record, position programme or angles of a plan (CSV,
    Parquet); a calibration, diagnosis or plan (JSON); an .fmu or .ssp. Channels of a record are those of `read_record`.
    With `trust`, evidence against its gyros becomes a warning. Raises InputError if the file cannot be read.
    """
    path = Path(path)
    ending = path.suffix.lower()
    content = bytes_of(path, most={".toml": LARGEST_TEXT, ".json": LARGEST_RESULT}.get(ending, LARGEST))
    findings = Findings(path)
    # Each kind of file needs many modules of its own.
    if content.startswith(ZIP) and not is_workbook(content):
        from .archives import check_fmu, check_ssp

        if ending == ".ssp":
            check_ssp(findings)
        else:
            check_fmu(findings)
    elif ending in (".fmu", ".ssp"):
        findings.kind = "SSP archive"
        if ending == ".fmu":
            findings.kind = "FMU"
        findings.add(f"is not a ZIP archive, which an {ending} is")
    elif ending in (".toml", ".json"):
        _check_text(findings, content, results=ending == ".json")
    else:
        from .tables import check_table

        check_table(findings, content, channels, stamps, trust=trust)
        return findings.check(MOST)
    return findings.check()


def _check_text(findings: Findings, content: bytes, *, results: bool) -> None:
    try:
        text = content.decode("utf-8-sig").replace("\r\n", "\n")
    except UnicodeDecodeError as error:
        line = content[: error.start].count(b"\n") + 1
        findings.add(f"byte {error.start + 1} is not UTF-8 text; save it as UTF-8", line=line)
        return
    if results:
        from .results import check_results

        check_results(findings, text)
    else:
        from .sections import check_sections

        check_sections(findings, text)
