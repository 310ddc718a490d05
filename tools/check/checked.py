"""Check a file of any kind; archives are checked here, other files in `files`."""

from collections.abc import Sequence
from pathlib import Path

from fmpy.validation import validate_fmu

from ..files import LARGEST, LARGEST_RESULT, LARGEST_TEXT, ZIP, bytes_of, is_workbook
from ..locks import own_folder
from ..orchestrator.archive import unpack
from ..orchestrator.interface import Interface, interface_of
from ..rounding import exactly
from ..ssp.read import scenario_of_ssp
from .findings import Check, Findings

MOST_NAMES = 50
"""Most names of one kind of variable that the summary of an FMU lists."""


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
    if content.startswith(ZIP) and not is_workbook(content):
        if ending == ".ssp":
            _check_ssp(findings)
        else:
            _check_fmu(findings)
    elif ending in (".fmu", ".ssp"):
        findings.kind = "SSP archive"
        if ending == ".fmu":
            findings.kind = "FMU"
        findings.add(f"is not a ZIP archive, which an {ending} is")
    else:
        # Refuse a foreign archive before importing the many modules that read records.
        from .files import check_content

        return findings.check(check_content(findings, content, channels, stamps, trust=trust))
    return findings.check()


def _check_fmu(findings: Findings) -> None:
    """Check an FMU with FMPy's validation and the orchestrator's own, without running it."""
    findings.kind = "FMU"
    with own_folder() as folder, findings.of():
        # First of all, this refuses an archive that is unsafe to unpack.
        described = unpack(findings.path, str(findings.path), lambda _: folder / "fmu").description
        interface = interface_of("fmu", str(findings.path), described)
        for text in validate_fmu(str(findings.path)):
            findings.add(" ".join(text.split()))
        if not findings.problems:
            tool = described.generationTool or "an unnamed tool"
            findings.summary = (
                f"{described.modelName}, FMI {described.fmiVersion}, by {tool}",
                *(_listed(interface, causality) for causality in ("input", "parameter", "output")),
            )


def _listed(interface: Interface, causality: str) -> str:
    """Return a line with the names of the variables of a causality; an array is one name."""
    names = []
    for name in interface.named(causality):
        base = name.partition("[")[0]
        elements = interface.arrays.get(base, ())
        names.append(f"{base}[1..{len(elements)}]" if elements else name)
    distinct = list(dict.fromkeys(names))
    more = f", and {len(distinct) - MOST_NAMES} more" if len(distinct) > MOST_NAMES else ""
    return f"{causality}s: {', '.join(distinct[:MOST_NAMES]) or 'none'}{more}"


def _check_ssp(findings: Findings) -> None:
    """Check that an .ssp can be read as a scenario, without running it."""
    findings.kind = "SSP archive"
    with findings.of(), scenario_of_ssp(findings.path) as (scenario, ignored):
        findings.warnings = tuple(f"parameter {name} names nothing in the system" for name in ignored)
        findings.summary = (
            f"FMUs: {', '.join(scenario.fmus)}",
            f"{len(scenario.connections)} connections, step {exactly(scenario.run.step_s)} s",
        )
