"""Everything that is wrong with an FMU or an SSP archive."""

from pathlib import Path

from ..errors import InputError
from .result import Check, Problem


def check_fmu(path: Path) -> Check:
    """What FMPy's validation and the orchestrator's own say of an FMU; nothing of it is run."""
    import tempfile

    from fmpy.validation import validate_fmu

    from ..orchestrator.archive import unpack
    from ..orchestrator.interface import interface_of

    with tempfile.TemporaryDirectory(prefix="trihedron-check-") as folder:
        try:
            # Before anything else opens the archive: this refuses what is not safe to unpack.
            unpacked = unpack(path, str(path), lambda _: Path(folder) / "fmu")
            interface = interface_of("fmu", str(path), unpacked.description)
        except InputError as error:
            return Check(path, "FMU", (Problem(str(error).removeprefix(f"{path}: ")),))
        problems = tuple(Problem(" ".join(text.split())) for text in validate_fmu(str(path)))
        described = unpacked.description
        counts = {c: sum(v.causality == c for v in interface.variables.values()) for c in ("input", "output")}
    summary = (
        f"{described.modelName}, FMI {described.fmiVersion}, by {described.generationTool or 'an unnamed tool'}",
        f"{len(interface.variables)} variables, {counts['input']} inputs, {counts['output']} outputs",
    )
    return Check(path, "FMU", problems, summary=() if problems else summary)


def check_ssp(path: Path) -> Check:
    """Whether an .ssp can be read as a scenario; nothing of it is run."""
    from ..ssp.importing import scenario_of_ssp

    try:
        with scenario_of_ssp(path) as imported:
            scenario = imported.scenario
            warnings = tuple(f"parameter {name} names nothing in the system" for name in imported.ignored)
            summary = (
                f"FMUs: {', '.join(scenario.fmus)}",
                f"{len(scenario.connections)} connections, step {scenario.run.step_s:g} s",
            )
    except InputError as error:
        return Check(path, "SSP archive", (Problem(str(error).removeprefix(f"{path}: ")),))
    return Check(path, "SSP archive", warnings=warnings, summary=summary)
