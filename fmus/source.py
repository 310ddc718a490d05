"""One self-contained source of a component and its effects: run in this process, or in a PythonFMU FMU."""

import ast
import hashlib
import inspect
import pprint
import re
import sys
import tempfile
import zipfile
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path
from types import ModuleType
from typing import Any

from .archive import accompanying_files, model_description, write_archive
from .component import Component

PERMITTED = frozenset({"range", "int", "float", "None", "Vector"})
"""Names of Python that a kernel may use beside numbers, kernels and `math`."""

SCRIPT = '''"""{name}: {description}

Made by Trihedron from the component's kernels and table; nothing outside this file and the embedded pythonfmu is run.
"""
from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence


{instance}

import json
import math

from pythonfmu.enums import Fmi2Status
from pythonfmu.fmi2slave import Fmi2Slave

{kernels}

VARIABLES = {variables}
ARGUMENTS = {arguments}
MESSAGES = {messages}
EFFECTS = {effects}


class {name}(Fmi2Slave):
    """The FMI side of the component: value references, states of the interface, messages."""

    def __init__(self, **kwargs):
        super().__init__(**kwargs)
        kernels = {{name: globals()[name] for name in ARGUMENTS}}
        self.model = Instance(VARIABLES, kernels, ARGUMENTS, EFFECTS)
        self.start_time = 0.0

    def setup_experiment(self, start_time, stop_time=None, tolerance=None):
        self.start_time = self.model.time = start_time

    def exit_initialization_mode(self):
        self.check(self.model.initialise(self.start_time))

    def do_step(self, current_time, step_size):
        if not (current_time - current_time == 0.0 and 0.0 < step_size < math.inf):
            text = f"{{self.instance_name}}: a step of {{step_size!r}} s from {{current_time!r}} s is not positive"
            self.log(text, Fmi2Status.error, "logStatusError")
            return False
        return self.report(self.model.do_step(current_time, step_size))

    def report(self, message):
        if message:
            self.log(f"{{self.instance_name}}: {{MESSAGES[message - 1]}}", Fmi2Status.error, "logStatusError")
        return message == 0

    def check(self, message):
        if not self.report(message):
            raise ValueError(MESSAGES[message - 1])

    def get_real(self, references):
        return [self.model.get(reference) for reference in references]

    def get_integer(self, references):
        return [int(self.model.get(reference)) for reference in references]

    def get_boolean(self, references):
        return [self.model.get(reference) != 0.0 for reference in references]

    def set_real(self, references, values):
        for reference, value in zip(references, values):
            try:
                self.model.set(reference, value)
            except ValueError as error:
                self.log(f"{{self.instance_name}}: {{error}}", Fmi2Status.error, "logStatusError")
                raise

    set_integer = set_real
    set_boolean = set_real

    def _get_fmu_state(self):
        return self.model.get_state()

    def _set_fmu_state(self, state):
        self.model.set_state(state)
'''


class Instance:
    """The memory of a component and the order in which its kernels may be called.

    Parameters
    ----------
    variables : sequence of tuple
        (name, causality, size, start values, variability, message's lower and upper limit or None) of each variable
    kernels : dict
        "initialise", "step" and, where outputs follow inputs at once, "respond"
    arguments : dict
        kernel's name -> names of its arguments
    effect_count : int
        how many of the last variables are parameters of effects
    """

    def __init__(
        self,
        variables: Sequence[tuple],
        kernels: dict[str, Callable[..., int | None]],
        arguments: Mapping[str, Sequence[str]],
        effect_count: int,
    ) -> None:
        self.kernels = kernels
        self.arguments = arguments
        own_rows = variables[: len(variables) - effect_count]
        self.memory: dict[str, list[float]] = {name: list(starts) for name, _, _, starts, _, _, _ in own_rows}
        self.memory["effect"] = [row[3][0] for row in variables[len(own_rows) :]]
        self.scalars = {row[0] for row in own_rows if row[2] == 0 and row[1] in ("parameter", "input")}
        # Of each scalar that the world sees, in the order of the value references from 1 on.
        self.cells: list[tuple[list[float], int]] = []
        self.rules: list[tuple[str, str, str, float | None, float | None]] = []
        for name, causality, _, starts, variability, lower, upper in own_rows:
            if causality in ("parameter", "input", "output"):
                for i in range(len(starts)):
                    self.cells.append((self.memory[name], i))
                    self.rules.append((name, causality, variability, lower, upper))
        for i, row in enumerate(variables[len(own_rows) :]):
            self.cells.append((self.memory["effect"], i))
            self.rules.append((row[0], row[1], row[4], row[5], row[6]))
        self.time = 0.0
        self.phase = "instantiated"
        self.stale = False

    def call(self, kernel: str, step: float) -> int:
        """Run a kernel on the memory; returns 0 or the number of its message."""
        values: list[object] = []
        for name in self.arguments[kernel]:
            if name == "time":
                values.append(self.time)
            elif name == "step":
                values.append(step)
            elif name in self.scalars:
                values.append(self.memory[name][0])
            else:
                values.append(self.memory[name])
        return self.kernels[kernel](*values) or 0

    def get(self, reference: int) -> float:
        """Value of a scalar by its value reference (0 is the time)."""
        if reference == 0:
            return self.time
        if self.phase == "instantiated" and self.rules[reference - 1][1] == "output":
            return self.preview(reference)
        if self.stale:
            self.respond()
        values, i = self.cells[reference - 1]
        return values[i]

    def preview(self, reference: int) -> float:
        """Return an output as if the initialisation ended now; raise ValueError if it cannot."""
        state = self.get_state()
        try:
            if self.initialise(self.time):
                raise ValueError("the parameters are not ones to begin with: there are no outputs yet")
            return float(self.get(reference))
        finally:
            self.set_state(state)

    def set(self, reference: int, value: float) -> None:
        """Set a parameter or an input; ValueError says why it is refused."""
        name, causality, variability, lower, upper = self.rules[reference - 1] if reference else ("time", "", "", 0, 0)
        if causality not in ("parameter", "input"):
            raise ValueError(f"{name} cannot be set: it is neither a parameter nor an input")
        if causality == "parameter" and variability == "fixed" and self.phase == "stepping":
            raise ValueError(f"{name} is fixed: it cannot be set after initialisation")
        if causality == "parameter":
            if not value - value == 0.0:
                raise ValueError(f"{name} = {value!r} is not a finite number")
            if (lower is not None and value < lower) or (upper is not None and value > upper):
                raise ValueError(f"{name} = {value!r} is outside [{lower}, {upper}]")
        values, i = self.cells[reference - 1]
        values[i] = float(value)
        self.stale = "respond" in self.kernels and self.phase == "stepping"

    def respond(self) -> None:
        """Bring the outputs that follow the inputs at once up to date."""
        self.stale = False
        if "respond" in self.kernels:
            self.call("respond", 0.0)

    def initialise(self, time: float) -> int:
        """End the initialisation at `time`; returns 0 or the number of a message."""
        self.time = time
        message = self.call("initialise", 0.0)
        if message == 0:
            self.phase = "stepping"
            self.respond()
        return message

    def do_step(self, time: float, step: float) -> int:
        """Step over (time, time + step]; returns 0 or the number of a message."""
        self.time = time
        message = self.call("step", step)
        self.time = time + step
        self.respond()
        return message

    def get_state(self) -> dict:
        """Everything that decides what comes next."""
        return {
            "memory": {name: list(values) for name, values in self.memory.items()},
            "time": self.time,
            "phase": self.phase,
            "stale": self.stale,
        }

    def set_state(self, state: dict) -> None:
        """Go back to a state of `get_state`; ValueError when it is not one of this component."""
        memory = state.get("memory", {})
        if {n: len(v) for n, v in memory.items()} != {n: len(v) for n, v in self.memory.items()}:
            raise ValueError("the state is not one of this component")
        for name, values in memory.items():
            self.memory[name][:] = values
        self.time, self.phase, self.stale = state["time"], state["phase"], state["stale"]


@dataclass(frozen=True)
class SourcePart:
    """A constant or a kernel of a flat source.

    Attributes
    ----------
    text : str
        its source
    origin : str
        name of the file that it comes from
    first_line : int
        line of that file on which it begins
    """

    text: str
    origin: str
    first_line: int


@cache
def kernel_source(function: Callable[..., Any]) -> SourcePart:
    """The source of a kernel, as it stands in its file."""
    lines, first = inspect.getsourcelines(function)
    return SourcePart("".join(lines).rstrip(), Path(inspect.getsourcefile(function) or "").name, first)


@cache
def called_names(function: Callable[..., Any]) -> list[str]:
    """Names that a kernel reads and does not bind itself, in order of appearance."""
    tree = ast.parse(kernel_source(function).text)
    bound = set(inspect.signature(function).parameters)
    names: list[str] = []
    for node in ast.walk(tree):
        if isinstance(node, ast.Name):
            if isinstance(node.ctx, ast.Store):
                bound.add(node.id)
            elif node.id not in names:
                names.append(node.id)
    return [name for name in names if name not in bound]


def hook_source(hook: Callable[..., Any], component: Component) -> str:
    """Return the source of a stage's hook, which calls the nominal kernel and then those of the effects.

    Where the nominal hook zeroes its last argument, each effect is evaluated on the un-extended values of the stage.
    The sum does not depend on their order. Where the hook does nothing, they change the last argument in turn. A hook
    that returns whether there are effects returns 1.0.
    """
    function = ast.parse(kernel_source(hook).text).body[0]
    assert isinstance(function, ast.FunctionDef)
    returns = isinstance(function.body[-1], ast.Return)
    if returns:
        function.body.pop()
    names = [argument.arg for argument in function.args.args]
    lines = [ast.unparse(function)]
    at = 0
    for place in component.effects:
        effect = place.definition
        count = len(effect.parameters)
        kernel = effect.kernel_at(hook.__name__)
        if kernel is not None:
            arguments = names[:2]
            arguments += map(str, effect.place_numbers(place))
            for i in range(count):
                arguments.append(f"effect[{at + i}]")
            arguments += names[-1:]
            lines.append(f"    {kernel.__name__}({', '.join(arguments)})")
        at += count
    if returns:
        lines.append("    return 1.0")
    return "\n".join(lines)


def flat_source(component: Component) -> str:
    """All kernels of a component, every function before its use, as one text that imports nothing but `math`.

    Parameters
    ----------
    component : Component
        with the effects that extend it

    Raises
    ------
    TypeError
        a kernel uses something that is not a kernel, a number or `math`, or a name that means something else in
        another kernel
    """
    return "\n\n\n".join(part.text for part in flat_parts(component)) + "\n"


def flat_parts(component: Component) -> tuple[SourcePart, ...]:
    """The parts of a component's flat source, in order; raises as `flat_source` does."""
    parts: dict[str, SourcePart] = {}
    values: dict[str, Any] = {}

    def include(function: Callable[..., Any]) -> None:
        kernels_of_effects = [place.definition.kernel_at(function.__name__) for place in component.effects]
        if kernels := [kernel for kernel in kernels_of_effects if kernel is not None]:
            for kernel in kernels:
                include_names(kernel)
                parts.setdefault(kernel.__name__, kernel_source(kernel))
            parts[function.__name__] = replace(kernel_source(function), text=hook_source(function, component))
            return
        include_names(function)
        parts[function.__name__] = kernel_source(function)

    def include_names(function: Callable[..., Any]) -> None:
        for name in called_names(function):
            value = function.__globals__.get(name)
            if name not in PERMITTED and values.setdefault(name, value) != value:
                raise TypeError(
                    f"kernel {function.__name__} uses {name}, which another kernel of {component.name} has "
                    "with another value; rename it"
                )
            if name in parts:
                continue
            if isinstance(value, int | float) and not isinstance(value, bool):
                parts[name] = SourcePart(f"{name} = {value!r}", kernel_source(function).origin, 1)
            elif inspect.isfunction(value):
                include(value)
            elif not (isinstance(value, ModuleType) and value.__name__ == "math") and name not in PERMITTED:
                raise TypeError(f"kernel {function.__name__} uses {name}, which is not restricted Python")

    for name, kernel in component.kernels.items():
        include_names(kernel)
        part = kernel_source(kernel)
        parts[name] = replace(part, text=part.text.replace(f"def {kernel.__name__}(", f"def {name}(", 1))
    return tuple(parts.values())


def instance_rows(component: Component) -> tuple[tuple, ...]:
    """The component's table as `Instance` takes it."""
    return tuple((v.name, v.causality, v.size, v.starts, v.variability, *v.limits) for v in component.variables)


@cache
def kernel_functions(component: Component) -> dict[str, Callable[..., Any]]:
    """The kernels of a component, with its effects, made from its flat source."""
    namespace: dict[str, Any] = {}
    source = "from __future__ import annotations\nimport math\n\n\n" + flat_source(component)
    exec(compile(source, f"<kernels of {component.name}>", "exec"), namespace)
    return {name: namespace[name] for name in component.kernels}


def instantiate(component: Component) -> Instance:
    """An instance of the component in plain Python."""
    return Instance(instance_rows(component), kernel_functions(component), component.arguments, component.effect_count)


@cache
def references(component: Component) -> dict[str, int]:
    """Value reference of each scalar, by its name."""
    numbers: dict[str, int] = {}
    for variable in component.interface:
        for element in variable.elements:
            numbers[element] = len(numbers) + 1
    return numbers


def script_source(component: Component) -> str:
    """The script of the FMU."""
    return SCRIPT.format(
        name=component.name,
        description=component.description,
        instance=inspect.getsource(Instance),
        kernels=flat_source(component),
        variables=pprint.pformat(instance_rows(component), width=110, sort_dicts=False),
        arguments=pprint.pformat(component.arguments, width=110, sort_dicts=False),
        messages=pprint.pformat(component.messages, width=110),
        effects=component.effect_count,
    )


def module_name(component: Component, source: str) -> str:
    """Name of the script's module: two FMUs that differ never share a module of their host."""
    words = re.sub(r"(?<!^)(?=[A-Z])", "_", component.name).lower()
    return f"{words}_{hashlib.sha256(source.encode()).hexdigest()[:16]}"


def build_python_fmu(component: Component, folder: Path) -> Path:
    """Build the FMU into `folder`; the same component gives the same bytes.

    Parameters
    ----------
    component : Component
    folder : Path
        made when it is missing

    Returns
    -------
    Path
        ``<folder>/<component's name>.fmu``
    """
    # what only wants the kernels does not wait for it
    from pythonfmu.builder import FmuBuilder

    folder.mkdir(parents=True, exist_ok=True)
    source = script_source(component)
    path = folder / f"{component.name}.fmu"
    with tempfile.TemporaryDirectory(prefix="trihedron-") as scratch:
        script = Path(scratch) / f"{module_name(component, source)}.py"
        script.write_text(source, encoding="utf-8")
        before = list(sys.path)
        try:
            built = FmuBuilder.build_FMU(script, dest=scratch, needsExecutionTool=False)
        finally:
            sys.path[:] = before
            sys.modules.pop(script.stem, None)
        with zipfile.ZipFile(built) as archive:
            members = {name: archive.read(name) for name in archive.namelist() if "__pycache__" not in name}
        members["modelDescription.xml"] = model_description(component, source.encode())
        write_archive(path, members | accompanying_files(component, 2))
    return path
