"""Everything that is wrong with a scenario: its fields, then what they say of FMUs, connections, stimuli and record."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from pydantic import ValidationError

from ..errors import InputError
from ..field_problems import Location
from ..orchestrator.interface import Interface
from ..orchestrator.journal import resolve_columns
from ..orchestrator.load import Loaded, Sources, check_steps, load, resolve_parameters
from ..orchestrator.run import temporary_folder
from ..orchestrator.scenario import FmuSetting, RunSetting, Scenario, Stimulus, scenario_problems
from ..orchestrator.stimuli import resolve_stimuli
from ..orchestrator.wiring import (
    Wire,
    check_single_sources,
    check_states,
    resolve_connections,
    stepping_groups,
)
from .findings import Check, Findings, found_in
from .lines import toml_lines

LISTS = ("connections", "stimuli")


def check_scenario(path: Path, text: str, data: dict[str, Any]) -> Check:
    """Check a scenario that is TOML.

    Parameters
    ----------
    path : Path
    text : str
        of the file, lines ended by a line feed
    data : dict
        what the text says

    Returns
    -------
    Check
        the problems of the fields, and of what the fields say that are right by themselves. Nothing is run
    """
    findings = Findings(toml_lines(text))
    origin = {"base_folder": path.parent, "source": path}
    written = System(data, data, {part: list(range(1, len(data.get(part, ())) + 1)) for part in LISTS}, set())
    try:
        scenario = Scenario.model_validate({**data, **origin})
    except ValidationError as error:
        found = scenario_problems(error)
        for problem in found:
            findings.add(problem.text, problem.location)
        written = _without(written, [problem.location for problem in found])
        try:
            scenario = Scenario.model_validate({**written.data, **origin})
        except (ValidationError, TypeError):
            return found_in(path, "scenario", findings.problems())
    with temporary_folder() as folder:
        _check_system(scenario, written, findings, folder)
    problems = findings.problems()
    return found_in(path, "scenario", problems, summary=() if problems else _summary(scenario))


@dataclass(frozen=True)
class System:
    """What of a scenario's file is right by itself.

    Attributes
    ----------
    data : dict
    whole : dict
        everything
    numbers : dict
        of "connections" and "stimuli": the numbers that those which remain have in the file
    left_out : set of str
        names of FMUs that are wrong by themselves
    """

    data: dict[str, Any]
    whole: dict[str, Any]
    numbers: dict[str, list[int]]
    left_out: set[str]


def _without(written: System, wrong: Sequence[Location]) -> System:
    """What remains without the FMUs, connections, stimuli, columns and keys at these locations."""
    data, numbers = dict(written.data), dict(written.numbers)
    left_out = {str(where[1]) for where in wrong if where[0] == "fmus" and len(where) > 1}
    if left_out:
        data["fmus"] = {name: value for name, value in data["fmus"].items() if name not in left_out}
    for part in LISTS:
        indices = {where[1] for where in wrong if where[0] == part and len(where) > 1}
        if indices:
            data[part] = [item for k, item in enumerate(data[part]) if k not in indices]
            numbers[part] = [number for number in numbers[part] if number - 1 not in indices]
    for where in wrong:
        if where[0] == "record" or len(where) == 1:
            data.pop(str(where[0]), None)
    return System(data, written.whole, numbers, left_out)


def _check_system(scenario: Scenario, written: System, findings: Findings, folder: Path) -> None:
    sources = Sources(scenario.base_folder)
    loaded: dict[str, Loaded] = {}
    for number, (name, setting) in enumerate(scenario.fmus.items()):
        own = folder / str(number)
        own.mkdir()
        found = _load(scenario, name, setting, findings, _loader(scenario, name, sources, own))
        if found is not None:
            loaded[name] = found
    interfaces = {name: entry.interface for name, entry in loaded.items()}
    absent = written.left_out | set(scenario.fmus) - set(loaded)
    wires = _wires(scenario, written.numbers["connections"], interfaces, absent, findings)
    if not absent:
        coupling = scenario.run.coupling
        with findings.of(("connections",)):
            groups = stepping_groups(list(interfaces), wires, coupling)
            with findings.of():
                check_states(groups, loaded, coupling)
        with findings.of():
            check_steps(loaded, scenario.run.step_s)
    has_programme = any(isinstance(s, dict) and "programme" in s for s in written.whole.get("stimuli", ()))
    stimuli = list(zip(written.numbers["stimuli"], scenario.stimuli, strict=True))
    _check_stimuli(scenario, stimuli, sources, loaded, absent, wires, findings, has_programme)
    for name, text in (scenario.record.columns or {}).items():
        if text.partition(".")[0] not in absent:
            with findings.of(("record", "columns", name)):
                resolve_columns({name: text}, interfaces)


def _loader(scenario: Scenario, name: str, sources: Sources, folder: Path) -> Callable[[FmuSetting], Loaded]:
    """What loads the FMU with another setting; each time into a folder of its own."""
    count = 0

    def load_as(setting: FmuSetting) -> Loaded:
        nonlocal count
        count += 1
        target = folder / str(count)
        target.mkdir()
        return load(scenario.model_copy(update={"fmus": {name: setting}}), sources, target)[name]

    return load_as


def _load(
    scenario: Scenario, name: str, setting: FmuSetting, findings: Findings, load_as: Callable[[FmuSetting], Loaded]
) -> Loaded | None:
    """The FMU with all that is right of its setting; None where it cannot be had at all."""
    at = ("fmus", name)
    bare = setting.model_copy(update={"parameters": {}, "effects": [], "parameters_from": None})
    loaded = None
    with findings.of((*at, "component" if setting.component is not None else "fmu")):
        loaded = load_as(bare)
    if loaded is None:
        return None
    effects: list[dict[str, Any]] = []
    for number, entry in enumerate(setting.effects):
        before = list(effects)
        try:
            load_as(bare.model_copy(update={"effects": [entry]}))
            effects = [*before, entry]
        except InputError as error:
            text = str(error).replace(f"fmus.{name}.effects[1]", f"fmus.{name}.effects[{number + 1}]")
            findings.add(text, (*at, "effects", number))
    right: dict[str, Any] = {"effects": []}
    with findings.of((*at, "effects")):
        loaded = load_as(bare.model_copy(update={"effects": effects}))
        right["effects"] = effects
    if setting.parameters_from is not None:
        with findings.of((*at, "parameters_from")):
            load_as(bare.model_copy(update={**right, "parameters_from": setting.parameters_from}))
            right["parameters_from"] = setting.parameters_from
    parameters: dict[str, Any] = {}
    for key, value in setting.parameters.items():
        with findings.of((*at, "parameters", key)):
            resolve_parameters(loaded.interface, {key: value}, {}, {})
            parameters[key] = value
    with findings.of((*at, "parameters")):
        return load_as(bare.model_copy(update={**right, "parameters": parameters}))
    return loaded


def _wires(
    scenario: Scenario,
    numbers: list[int],
    interfaces: dict[str, Interface],
    absent: set[str],
    findings: Findings,
) -> list[Wire]:
    wires: list[Wire] = []
    for number, connection in zip(numbers, scenario.connections, strict=True):
        if not {end.partition(".")[0] for end in (connection.source, connection.target)} & absent:
            with findings.of(("connections", number - 1), number):
                wires += resolve_connections([connection], interfaces)
    return wires


def _check_stimuli(
    scenario: Scenario,
    numbered: list[tuple[int, Stimulus]],
    sources: Sources,
    loaded: dict[str, Loaded],
    absent: set[str],
    wires: list[Wire],
    findings: Findings,
    has_programme: bool,
) -> None:
    """The stimuli one by one, programmes first: they may say when the run ends."""
    programmes: list[Stimulus] = []
    written_programme = has_programme or any(stimulus.kind == "programme" for _, stimulus in numbered)
    drives: list[tuple[str, Any]] = []
    ended = scenario.run.stop_s is not None

    def resolve(stimulus: Stimulus, number: int, run: RunSetting = scenario.run) -> bool:
        before = len(programmes)
        copy = scenario.model_copy(update={"run": run, "stimuli": [*programmes, stimulus]})
        with findings.of(("stimuli", number - 1), number):
            _, found = resolve_stimuli(copy, sources, loaded)
            drives.extend((f"stimuli[{number}]", drive) for _, drive in found[before:])
            return True
        return False

    for number, stimulus in numbered:
        if stimulus.kind == "programme" and _named(stimulus).isdisjoint(absent) and resolve(stimulus, number):
            programmes.append(stimulus)
    # Without its programmes nothing says when such a run ends; what is wrong with them has been said.
    unknown_end = not ended and not programmes and written_programme
    step = scenario.run.model_copy(update={"stop_s": scenario.run.start_s + scenario.run.step_s})
    for number, stimulus in numbered:
        if stimulus.kind != "programme" and _named(stimulus).isdisjoint(absent):
            if not unknown_end:
                resolve(stimulus, number)
            elif stimulus.kind == "constant":
                resolve(stimulus, number, step)
    with findings.of(("stimuli",)):
        check_single_sources(wires, drives)
    if not written_programme and not scenario.stimuli:
        with findings.of(("run",)):
            resolve_stimuli(scenario, sources, loaded)


def _named(stimulus: Stimulus) -> set[str]:
    """The FMUs that a stimulus names."""
    named = list(stimulus.columns) if stimulus.columns is not None else [str(stimulus.to)]
    return {text.partition(".")[0] for text in named}


def _summary(scenario: Scenario) -> tuple[str, ...]:
    fmus = ", ".join(f"{name} ({setting.component or setting.fmu})" for name, setting in scenario.fmus.items())
    return (
        f"{scenario.title}" if scenario.title else "no title",
        f"FMUs: {fmus}",
        f"{len(scenario.connections)} connections, {len(scenario.stimuli)} stimuli, step {scenario.run.step_s:g} s",
    )
