"""An .ssp made here or elsewhere, as a scenario that the orchestrator runs."""

import json
import re
import tempfile
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from pydantic import ValidationError

from ..errors import InputError, one_line
from ..orchestrator.archive import unpack
from ..orchestrator.interface import Interface, Value, interface_of
from ..scenario import Scenario, first_problem
from .archive import unpack_ssp
from .bindings import value_for
from .description import Description, Node, Part, reached, read_description
from .exporting import COUPLING, COUPLING_SETTINGS, RECORD
from .self_contained import PROGRAMME


@dataclass(frozen=True)
class Imported:
    """An .ssp as a scenario.

    Attributes
    ----------
    scenario : Scenario
        its files lie in a folder that is there as long as the context
    ignored : tuple of str
        names of parameters that no variable of the system has; SSP has them ignored
    """

    scenario: Scenario
    ignored: tuple[str, ...]


@contextmanager
def scenario_of_ssp(path: Path, *, step: float | None = None, coupling: str | None = None) -> Iterator[Imported]:
    """Unpack an .ssp and read it as a scenario.

    Parameters
    ----------
    path : Path
        the file
    step : float, optional
        length of a step [s]; without it that of OMSimulator's annotation, or the smallest that an FMU asks for
    coupling : str, optional
        how cycles of connections are taken, "jacobi" or "iterate"; without it as the exported scenario says

    Raises
    ------
    InputError
        an archive that is damaged or unsafe, or what is not supported, by its name
    """
    with tempfile.TemporaryDirectory(prefix="trihedron-ssp-", ignore_cleanup_errors=True) as name:
        folder = Path(name) / "unpacked"
        folder.mkdir()
        unpack_ssp(path, folder)
        try:
            imported = _scenario(path, folder, Path(name), step, coupling)
        except RecursionError as error:
            raise InputError(f"{path}: is not a system that can be read (nested too deeply)") from error
        except InputError as error:
            raise InputError(one_line(str(error))) from error
        yield imported


def _scenario(path: Path, folder: Path, scratch: Path, step: float | None, coupling: str | None) -> Imported:
    label = str(path)
    description = read_description(folder, label)
    fmus = [part for part in description.system.walk() if part.source is not None]
    if not fmus:
        raise InputError(f"{label}: has no FMU")
    names = _names(fmus)
    interfaces: dict[tuple[str, ...], Interface] = {}
    steps: list[float] = []
    for part in fmus:
        target = scratch / f"fmu-{len(interfaces)}"
        where = f"{label}: {part.source}"
        unpacked = unpack(folder / str(part.source), where, lambda _, t=target: t)
        interfaces[part.path] = interface_of(names[part.path], where, unpacked.description)
        experiment = unpacked.description.defaultExperiment
        if experiment is not None and experiment.stepSize:
            steps.append(_positive(experiment.stepSize, where))
    parameters, ignored = _parameters(description.system, interfaces)
    for at, interface in interfaces.items():
        # How far ahead commands are put out is a matter of the master; ours passes them on at once.
        if interface.model == PROGRAMME and "lead_steps" in interface.variables:
            parameters[at]["lead_steps"] = 0
    data: dict[str, Any] = {
        "title": "",
        "run": _run(description, step, steps, label) | _coupling(folder, label, coupling),
        "fmus": {names[p.path]: {"fmu": p.source, "parameters": parameters[p.path]} for p in fmus},
        "connections": _connections(description.system, names),
        "base_folder": folder,
        "source": path,
    }
    recorded = _own(folder, label, RECORD)
    if recorded is not None:
        data["record"] = recorded
    try:
        return Imported(Scenario.model_validate(data), tuple(dict.fromkeys(ignored)))
    except ValidationError as error:
        raise InputError(f"{label}: {first_problem(error)}") from error


def _positive(text: object, label: str) -> float:
    try:
        value = float(str(text))
    except ValueError:
        value = float("nan")
    if not 0.0 < value < float("inf"):
        raise InputError(f"{label}: stepSize is {text!r}, not a positive number")
    return value


def _names(fmus: list[Part]) -> dict[tuple[str, ...], str]:
    """Names in the scenario: the element's own; those of nested systems before it where there are any."""
    names: dict[tuple[str, ...], str] = {}
    for part in fmus:
        name = re.sub(r"[^A-Za-z0-9_-]", "_", "_".join(part.path))
        name = name if re.match(r"[A-Za-z_]", name) else f"_{name}"
        candidates = [name, *(f"{name}_{i}" for i in range(2, len(fmus) + 2))]
        names[part.path] = next(n for n in candidates if n not in names.values())
    return names


def _run(description: Description, step: float | None, steps: list[float], label: str) -> dict[str, float]:
    if description.stop is None:
        raise InputError(f"{label}: DefaultExperiment has no stopTime, so nothing says when the run ends")
    known = [length for length in (step, description.step, min(steps, default=None)) if length is not None]
    if not known:
        raise InputError(f"{label}: neither it nor its FMUs say how long a step is; give --step")
    return {"start_s": description.start or 0.0, "stop_s": description.stop, "step_s": known[0]}


def _connections(system: Part, names: Mapping[tuple[str, ...], str]) -> list[dict[str, str]]:
    """The connections between FMUs, through connectors of systems."""
    return [
        {"from": f"{names[source[0]]}.{source[1]}", "to": f"{names[target[0]]}.{target[1]}"}
        for source, targets in reached(system).items()
        if source[0] in names
        for target in targets
    ]


def _own(folder: Path, label: str, name: str) -> Any:
    """What Trihedron's own export says beside the system, None where it says nothing."""
    file = folder / name
    if not file.is_file():
        return None
    try:
        return json.loads(file.read_text("utf-8"))
    except (ValueError, RecursionError, OSError) as error:
        raise InputError(f"{label}: {name}: is not JSON ({error})") from error


def _coupling(folder: Path, label: str, given: str | None) -> dict[str, Any]:
    """How cycles are taken: as asked for, else as the scenario that was exported says."""
    if given is not None:
        return {"coupling": given}
    own = _own(folder, label, COUPLING)
    if own is None:
        return {}
    if not isinstance(own, dict) or not set(own) <= set(COUPLING_SETTINGS):
        raise InputError(f"{label}: {COUPLING}: has other things than {', '.join(COUPLING_SETTINGS)}")
    return own


def _parameters(
    system: Part, interfaces: Mapping[tuple[str, ...], Interface]
) -> tuple[dict[tuple[str, ...], dict[str, Value]], list[str]]:
    """The values of all bindings by FMU; those of outer systems over those of inner ones."""
    feeds = reached(system)
    values: dict[tuple[str, ...], dict[str, Value]] = {at: {} for at in interfaces}
    ignored: list[str] = []
    for part in system.walk():
        for given in part.bindings:
            targets = _targets(part, given.name, interfaces, feeds)
            if not targets:
                ignored.append(given.name)
            for at, name in targets:
                interface = interfaces[at]
                values[at][name] = value_for(given, interface.variables[name], interface.scales)
    return values, ignored


def _targets(
    part: Part, name: str, interfaces: Mapping[tuple[str, ...], Interface], feeds: Mapping[Node, list[Node]]
) -> list[Node]:
    """The variables of FMUs that a parameter's hierarchical name means."""
    if part.source is not None:
        return [(part.path, name)] if name in interfaces[part.path].variables else []
    if name in part.connectors:
        fed = feeds.get((part.path, name), [])
        return [(at, variable) for at, variable in fed if variable in interfaces[at].variables]
    for inner, below in part.parts.items():
        if name.startswith(f"{inner}."):
            found = _targets(below, name[len(inner) + 1 :], interfaces, feeds)
            if found:
                return found
    return []
