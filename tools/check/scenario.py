"""Everything that is wrong with a scenario: its fields, then what they say of FMUs, connections, stimuli and record."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from pydantic import ValidationError

from ..errors import InputError
from ..field_problems import Location, field_problems
from ..orchestrator.journal import resolve_columns
from ..orchestrator.load import Loaded, Sources, check_steps, load, resolve_parameters
from ..orchestrator.run import temporary_folder
from ..orchestrator.scenario import FmuSetting, RunSetting, Scenario, Stimulus
from ..orchestrator.stimuli import resolve_stimuli
from ..orchestrator.wiring import (
    Wire,
    check_single_sources,
    check_states,
    resolve_connections,
    stepping_groups,
)
from .findings import Findings

LISTS = ("connections", "stimuli")


def check_scenario(data: dict[str, Any], found: Findings) -> None:
    """Note the problems of a scenario's fields, and of what the fields say that are right by themselves.

    Nothing is run.

    Parameters
    ----------
    data : dict
        what the text of the file says
    found : Findings
        with the file's path and lines
    """
    origin = {"base_folder": found.path.parent, "source": found.path}
    system = _System(found, data)
    try:
        scenario = Scenario.model_validate({**data, **origin})
    except ValidationError as error:
        wrong = field_problems(error, Scenario)
        for problem in wrong:
            found.add(problem.text, problem.location)
        try:
            right = system.without([problem.location for problem in wrong])
            scenario = Scenario.model_validate({**right, **origin})
        except (ValidationError, TypeError):
            return
    with temporary_folder() as folder:
        system.check(scenario, folder)
    if not found.problems:
        fmus = ", ".join(f"{name} ({setting.component or setting.fmu})" for name, setting in scenario.fmus.items())
        counts = f"{len(scenario.connections)} connections, {len(scenario.stimuli)} stimuli"
        found.summary = (
            scenario.title or "no title",
            f"FMUs: {fmus}",
            f"{counts}, step {scenario.run.step_s:g} s",
        )


class _System:
    """What of a scenario's file is right by itself, and what that says.

    Attributes
    ----------
    numbers : dict
        of "connections" and "stimuli": the numbers that those which remain have in the file
    absent : set of str
        names of FMUs that are wrong by themselves or cannot be had
    loaded : dict
        the others by name
    wires : list of Wire
        the connections that are right
    """

    def __init__(self, found: Findings, data: dict[str, Any]):
        self.found, self.data = found, data
        self.numbers = {part: list(range(1, len(data.get(part, ())) + 1)) for part in LISTS}
        self.absent: set[str] = set()
        self.loaded: dict[str, Loaded] = {}
        self.wires: list[Wire] = []

    def without(self, wrong: Sequence[Location]) -> dict[str, Any]:
        """What remains without the FMUs, connections, stimuli, columns and keys at these locations."""
        data = dict(self.data)
        self.absent = {str(where[1]) for where in wrong if where[0] == "fmus" and len(where) > 1}
        if self.absent:
            data["fmus"] = {name: value for name, value in data["fmus"].items() if name not in self.absent}
        for part in LISTS:
            indices = {where[1] for where in wrong if where[0] == part and len(where) > 1}
            if indices:
                data[part] = [item for k, item in enumerate(data[part]) if k not in indices]
                self.numbers[part] = [number for number in self.numbers[part] if number - 1 not in indices]
        for where in wrong:
            if where[0] == "record" or len(where) == 1:
                data.pop(str(where[0]), None)
        return data

    def check(self, scenario: Scenario, folder: Path) -> None:
        """Load the FMUs one by one, then resolve connections, stimuli and columns one by one."""
        found, sources, coupling = self.found, Sources(scenario.base_folder), scenario.run.coupling
        for number, name in enumerate(scenario.fmus):
            loaded = self.load(scenario, name, sources, folder / str(number))
            if loaded is None:
                self.absent.add(name)
            else:
                self.loaded[name] = loaded
        interfaces = {name: entry.interface for name, entry in self.loaded.items()}
        for number, connection in zip(self.numbers["connections"], scenario.connections, strict=True):
            if self.present(connection.source, connection.target):
                with found.of(("connections", number - 1), number):
                    self.wires += resolve_connections([connection], interfaces)
        if not self.absent:
            with found.of(("connections",)):
                groups = stepping_groups(list(interfaces), self.wires, coupling)
                with found.of():
                    check_states(groups, self.loaded, coupling)
            with found.of():
                check_steps(self.loaded, scenario.run.step_s)
        self.check_stimuli(scenario, sources)
        for name, text in (scenario.record.columns or {}).items():
            if self.present(text):
                with found.of(("record", "columns", name)):
                    resolve_columns({name: text}, interfaces)

    def present(self, *named: str) -> bool:
        """Whether the FMUs of all these variables (`fmu.name`) are there."""
        return self.absent.isdisjoint(text.partition(".")[0] for text in named)

    def load(self, scenario: Scenario, name: str, sources: Sources, folder: Path) -> Loaded | None:
        """The FMU with all that is right of its setting; None where it cannot be had at all."""
        at, setting, found = ("fmus", name), scenario.fmus[name], self.found
        bare = setting.model_copy(update={"parameters": {}, "effects": [], "parameters_from": None})
        right: dict[str, Any] = {"effects": []}

        def load_as(**changed: Any) -> Loaded:
            """With other settings; each time into a folder of its own."""
            target = folder / str(len(list(folder.iterdir())) if folder.exists() else 0)
            target.mkdir(parents=True)
            one: FmuSetting = bare.model_copy(update={**right, **changed})
            return load(scenario.model_copy(update={"fmus": {name: one}}), sources, target)[name]

        loaded = None
        with found.of((*at, "component" if setting.component is not None else "fmu")):
            loaded = load_as()
        if loaded is None:
            return None
        effects: list[dict[str, Any]] = []
        for number, entry in enumerate(setting.effects):
            try:
                load_as(effects=[entry])
                effects.append(entry)
            except InputError as error:
                text = str(error).replace(f"fmus.{name}.effects[1]", f"fmus.{name}.effects[{number + 1}]")
                found.add(text, (*at, "effects", number))
        with found.of((*at, "effects")):
            loaded = load_as(effects=effects)
            right["effects"] = effects
        if setting.parameters_from is not None:
            with found.of((*at, "parameters_from")):
                load_as(parameters_from=setting.parameters_from)
                right["parameters_from"] = setting.parameters_from
        parameters: dict[str, Any] = {}
        for key, value in setting.parameters.items():
            with found.of((*at, "parameters", key)):
                resolve_parameters(loaded.interface, {key: value})
                parameters[key] = value
        with found.of((*at, "parameters")):
            return load_as(parameters=parameters)
        return loaded

    def check_stimuli(self, scenario: Scenario, sources: Sources) -> None:
        """The stimuli one by one, programmes first: they may say when the run ends."""
        programmes: list[Stimulus] = []
        drives: list[tuple[str, Any]] = []

        def resolve(stimulus: Stimulus, number: int, run: RunSetting = scenario.run) -> bool:
            copy = scenario.model_copy(update={"run": run, "stimuli": [*programmes, stimulus]})
            with self.found.of(("stimuli", number - 1), number):
                _, resolved = resolve_stimuli(copy, sources, self.loaded)
                drives.extend((f"stimuli[{number}]", drive) for _, drive in resolved[len(programmes) :])
                return True
            return False

        numbered = zip(self.numbers["stimuli"], scenario.stimuli, strict=True)
        own = [(k, s) for k, s in numbered if self.present(*(s.columns if s.columns is not None else [str(s.to)]))]
        for number, stimulus in own:
            if stimulus.kind == "programme" and resolve(stimulus, number):
                programmes.append(stimulus)
        # Without its programmes nothing says when such a run ends; what is wrong with them has been said.
        written = any(isinstance(s, dict) and "programme" in s for s in self.data.get("stimuli", ()))
        written |= any(stimulus.kind == "programme" for stimulus in scenario.stimuli)
        unknown_end = scenario.run.stop_s is None and not programmes and written
        step = scenario.run.model_copy(update={"stop_s": scenario.run.start_s + scenario.run.step_s})
        for number, stimulus in own:
            if stimulus.kind != "programme" and not unknown_end:
                resolve(stimulus, number)
            elif stimulus.kind == "constant":
                resolve(stimulus, number, step)
        with self.found.of(("stimuli",)):
            check_single_sources(self.wires, drives)
        if not written and not scenario.stimuli:
            with self.found.of(("run",)):
                resolve_stimuli(scenario, sources, self.loaded)
