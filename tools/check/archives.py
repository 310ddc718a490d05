"""List all problems of an FMU or an SSP, without running it."""

from fmpy.validation import validate_fmu

from ..locks import own_folder
from ..orchestrator.archive import unpack
from ..orchestrator.interface import Interface, interface_of
from ..rounding import exactly
from ..ssp.read import scenario_of_ssp
from .findings import Findings

MOST_NAMES = 50
"""Most names of one kind of variable that the summary of an FMU lists."""


def check_fmu(findings: Findings) -> None:
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


def check_ssp(findings: Findings) -> None:
    """Check that an .ssp can be read as a scenario, without running it."""
    findings.kind = "SSP archive"
    with findings.of(), scenario_of_ssp(findings.path) as (scenario, ignored):
        findings.warnings = tuple(f"parameter {name} names nothing in the system" for name in ignored)
        findings.summary = (
            f"FMUs: {', '.join(scenario.fmus)}",
            f"{len(scenario.connections)} connections, step {exactly(scenario.run.step_s)} s",
        )
