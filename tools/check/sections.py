"""List all problems of a scenario, a campaign or a file of mountings; nothing is run.

Each field of a scenario is checked, then the references between correct fields.
"""

import tomllib
from collections.abc import Sequence
from itertools import count
from pathlib import Path
from typing import Any

from pydantic import BaseModel, ValidationError

from ..calibration.model import checked_mounting
from ..campaign.file import SCHEMA as CAMPAIGN
from ..campaign.file import Campaign
from ..errors import nearest
from ..orchestrator.archive import temporary_folder
from ..orchestrator.load import Loaded, Sources, load_fmus, resolve_parameters
from ..orchestrator.recorded import resolve_columns
from ..orchestrator.scenario import SCHEMA as SCENARIO
from ..orchestrator.scenario import RunSetting, Scenario, Stimulus
from ..orchestrator.stimuli import check_sources, resolve_stimuli
from ..orchestrator.wiring import Wire, check_states, paces_of, resolve_connections, stepping_groups
from ..result import Location, field_problems, not_for_files
from ..rounding import exactly
from .findings import Findings, toml_lines

LISTS = ("connections", "stimuli")
"""Lists of a scenario's file whose items are checked one by one."""


def check_scenario(content: dict[str, Any], findings: Findings) -> None:
    """Note the problems of a scenario's fields, and of references between correct fields; nothing is run."""
    origin = {"base_folder": findings.path.parent, "source": findings.path}
    system = _System(findings, content)
    try:
        scenario = Scenario.model_validate({**content, **origin})
    except ValidationError as error:
        wrong = field_problems(error, Scenario)
        for where, text in wrong:
            findings.add(text, where)
        try:
            right = system.without([where for where, _ in wrong])
            scenario = Scenario.model_validate({**right, **origin})
        except (ValidationError, TypeError):
            return
    with temporary_folder() as folder:
        system.check(scenario, folder)
    if not findings.problems:
        fmus = ", ".join(f"{name} ({setting.component or setting.fmu})" for name, setting in scenario.fmus.items())
        counts = f"{len(scenario.connections)} connections, {len(scenario.stimuli)} stimuli"
        findings.summary = (
            scenario.title or "no title",
            f"FMUs: {fmus}",
            f"{counts}, step {exactly(scenario.run.step_s)} s",
        )


def _members(locations: Sequence[Location], section: str) -> set[int | str]:
    """Return names or indices of the members of a section that contain the locations."""
    members = set()
    for location in locations:
        if location[0] == section and len(location) > 1:
            members.add(location[1])
    return members


class _System:
    """The correct parts of a scenario's file, and their content.

    `numbers` are those of the remaining connections and stimuli in the file. FMUs that are wrong or missing are
    `absent`, the others are `loaded`; `wires` are the correct connections.
    """

    def __init__(self, findings: Findings, content: dict[str, Any]):
        self.found, self.data = findings, content
        self.numbers = {part: list(range(1, len(content.get(part, ())) + 1)) for part in LISTS}
        self.absent: set[str] = set()
        self.loaded: dict[str, Loaded] = {}
        self.wires: list[Wire] = []

    def without(self, wrong: Sequence[Location]) -> dict[str, Any]:
        """Return the data without the FMUs, connections, stimuli, columns and keys at these locations."""
        right = dict(self.data)
        self.absent = {str(name) for name in _members(wrong, "fmus")}
        if self.absent:
            right["fmus"] = dict(right["fmus"])
            for name in self.absent:
                right["fmus"].pop(name, None)
        for part in LISTS:
            indices = _members(wrong, part)
            if indices:
                items, numbers = [], []
                for number, item in zip(self.numbers[part], right[part], strict=True):
                    if number - 1 not in indices:
                        items.append(item)
                        numbers.append(number)
                right[part], self.numbers[part] = items, numbers
        for where in wrong:
            if where[0] == "record" or len(where) == 1:
                right.pop(str(where[0]), None)
        return right

    def check(self, scenario: Scenario, folder: Path) -> None:
        """Load the FMUs one by one, then resolve connections, stimuli and columns one by one."""
        findings, sources, coupling = self.found, Sources(scenario.base_folder), scenario.run.coupling
        scenario = self.right_steps(scenario)
        for number, name in enumerate(scenario.fmus):
            loaded = self.load(scenario, name, sources, folder / str(number))
            if loaded is None:
                self.absent.add(name)
            else:
                self.loaded[name] = loaded
        interfaces = {name: entry.interface for name, entry in self.loaded.items()}
        for number, connection in zip(self.numbers["connections"], scenario.connections, strict=True):
            if self.present(connection.source, connection.target):
                with findings.of(("connections", number - 1), number):
                    self.wires += resolve_connections([connection], interfaces)
        if not self.absent:
            with findings.of(("connections",)):
                groups = stepping_groups(list(interfaces), self.wires, coupling)
                with findings.of():
                    paces_of(scenario, self.loaded, self.wires, groups)
                with findings.of():
                    check_states(groups, self.loaded, coupling)
        self.check_stimuli(scenario, sources)
        for name, text in (scenario.record.columns or {}).items():
            if self.present(text):
                with findings.of(("record", "columns", name)):
                    resolve_columns({name: text}, interfaces)

    def right_steps(self, scenario: Scenario) -> Scenario:
        """Return the scenario without steps of FMUs that are not multiples of its own."""
        right = {}
        for name, setting in scenario.fmus.items():
            right[name] = setting.model_copy(update={"step_s": None})
            with self.found.of(("fmus", name, "step_s")):
                scenario.stride(name)
                right[name] = setting
        return scenario.model_copy(update={"fmus": right})

    def present(self, *variables: str) -> bool:
        """Return True if the FMUs of all these variables (`fmu.name`) are there."""
        return self.absent.isdisjoint(text.partition(".")[0] for text in variables)

    def load(self, scenario: Scenario, name: str, sources: Sources, folder: Path) -> Loaded | None:
        """Return the FMU with the correct part of its setting; None if the FMU itself is missing."""
        at, setting, numbers = ("fmus", name), scenario.fmus[name], count()
        right: dict[str, Any] = {"parameters": {}, "effects": [], "parameters_from": None}

        def load_as(*where: str | int, number: int | None = None, **changed: Any) -> Loaded | None:
            """Load the FMU with further settings, and keep them if nothing is refused."""
            with self.found.of((*at, *where), number):
                target = folder / str(next(numbers))
                target.mkdir(parents=True)
                changed_setting = setting.model_copy(update={**right, **changed})
                loaded = load_fmus(scenario.model_copy(update={"fmus": {name: changed_setting}}), sources, target)[name]
                right.update(changed)
                return loaded
            return None

        key = "fmu"
        if setting.component is not None:
            key = "component"
        loaded = load_as(key)
        if loaded is None:
            return None
        if setting.effects:
            effects = []
            for k, entry in enumerate(setting.effects):
                if load_as("effects", k, number=k + 1, effects=[entry]):
                    effects.append(entry)
            right["effects"] = []
            loaded = load_as("effects", effects=effects) or loaded
        if setting.parameters_from is not None:
            load_as("parameters_from", parameters_from=setting.parameters_from)
        parameters: dict[str, Any] = {}
        for key, value in setting.parameters.items():
            with self.found.of((*at, "parameters", key)):
                resolve_parameters(loaded.interface, {key: value})
                parameters[key] = value
        return load_as("parameters", parameters=parameters) or loaded

    def check_stimuli(self, scenario: Scenario, sources: Sources) -> None:
        """Check the stimuli one by one, programmes first: they may set the end of the run."""
        programmes: list[Stimulus] = []
        drives: list[tuple[str, Any]] = []

        def resolve(stimulus: Stimulus, number: int, run: RunSetting = scenario.run) -> bool:
            copy = scenario.model_copy(update={"run": run, "stimuli": [*programmes, stimulus]})
            with self.found.of(("stimuli", number - 1), number):
                _, resolved = resolve_stimuli(copy, sources, self.loaded)
                for _, drive in resolved[len(programmes) :]:
                    drives.append((f"stimuli[{number}]", drive))
                return True
            return False

        present = []
        for number, stimulus in zip(self.numbers["stimuli"], scenario.stimuli, strict=True):
            targets = [str(stimulus.to)]
            if stimulus.columns is not None:
                targets = list(stimulus.columns)
            if self.present(*targets):
                present.append((number, stimulus))
        for number, stimulus in present:
            if stimulus.kind == "programme" and resolve(stimulus, number):
                programmes.append(stimulus)
        # Without its programmes the end of such a run is unknown; their problems are noted already.
        written = any(isinstance(s, dict) and "programme" in s for s in self.data.get("stimuli", ()))
        written |= any(stimulus.kind == "programme" for stimulus in scenario.stimuli)
        unknown_end = scenario.run.stop_s is None and not programmes and written
        longest = max(setting.step_s or scenario.run.step_s for setting in scenario.fmus.values())
        step = scenario.run.model_copy(update={"stop_s": scenario.run.start_s + longest})
        for number, stimulus in present:
            if stimulus.kind != "programme" and not unknown_end:
                resolve(stimulus, number)
            elif stimulus.kind == "constant":
                resolve(stimulus, number, step)
        loaded = self.loaded
        if self.found.problems:
            # A wrong part elsewhere may feed this input.
            loaded = {}
        with self.found.of(("stimuli",)):
            check_sources(self.wires, drives, loaded)
        if not written and not scenario.stimuli:
            with self.found.of(("run",)):
                resolve_stimuli(scenario, sources, self.loaded)


def check_sections(findings: Findings, text: str) -> None:
    """Check a scenario, a campaign or a file of mountings."""
    try:
        content = tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        problem, _, place = str(error).partition(" (at line ")
        number = place.partition(",")[0]
        line = None
        if number.isdigit():
            line = int(number)
        findings.add(f"is not TOML: {problem}", line=line)
        return
    except (ValueError, RecursionError) as error:
        findings.add(f"is not TOML: {error}")
        return
    findings.lines = toml_lines(text)
    schema = content.get("schema")
    sections: type[BaseModel] = Scenario
    if schema == CAMPAIGN:
        sections = Campaign
    for name, problem in not_for_files(content, sections).items():
        findings.add(problem, (name,))
        del content[name]
    if schema == CAMPAIGN:
        findings.kind = "campaign"
        try:
            Campaign.model_validate(content)
        except ValidationError as error:
            for where, text in field_problems(error, Campaign):
                findings.add(text, where)
    elif schema == SCENARIO or "fmus" in content or "run" in content:
        findings.kind = "scenario"
        if "schema" not in content:
            findings.add(f'schema is missing; write schema = "{SCENARIO}"')
        check_scenario(content, findings)
    elif schema is None and content and all(isinstance(v, dict) and "matrix" in v for v in content.values()):
        findings.kind, findings.summary = "file of mountings", (f"mountings {', '.join(content)}",)
        for name, table in content.items():
            for key in table:
                if key != "matrix":
                    findings.add(f"{name}.{key}: unknown key; write matrix = [[...], [...], [...]]", (name, key))
            with findings.of((name, "matrix")):
                checked_mounting(table["matrix"], f"[{name}]")
    elif schema is None:
        findings.add(f'schema is missing; as "{SCENARIO}"')
    else:
        findings.add(f"schema: {schema!r} is not known; {nearest(str(schema), [SCENARIO, CAMPAIGN])}", ("schema",))
