"""The PythonFMU flavour: one generated, self-contained script in an FMI 2.0 co-simulation FMU."""

import hashlib
import inspect
import pprint
import re
import sys
import tempfile
import zipfile
from pathlib import Path

from pythonfmu.builder import FmuBuilder

from . import instance
from .archive import write_archive
from .component import Component
from .flat_source import flat_source
from .in_process import effect_count, instance_rows
from .model_description import model_description
from .pages import accompanying_files

SCRIPT = '''"""{name}: {description}

Made by Trihedron from the component's kernels and table; nothing outside this file and the embedded pythonfmu is run.
"""
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
        if not (current_time - current_time == 0.0 and 0.0 <= step_size < math.inf):
            text = f"{{self.instance_name}}: a step of {{step_size!r}} s from {{current_time!r}} s is not one in time"
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


def script_source(component: Component) -> str:
    """The script of the FMU."""
    return SCRIPT.format(
        name=component.name,
        description=component.description,
        instance=re.sub(r'^""".*?"""\n+', "", inspect.getsource(instance), flags=re.DOTALL),
        kernels=flat_source(component),
        variables=pprint.pformat(instance_rows(component), width=110, sort_dicts=False),
        arguments=pprint.pformat(component.arguments, width=110, sort_dicts=False),
        messages=pprint.pformat(component.messages, width=110),
        effects=effect_count(component),
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
        rewrite_archive(Path(built), path, component, model_description(component, source.encode()))
    return path


def rewrite_archive(built: Path, path: Path, component: Component, description: bytes) -> None:
    """Copy an FMU with our model description in place of the builder's, and what accompanies it."""
    with zipfile.ZipFile(built) as archive:
        members = {name: archive.read(name) for name in archive.namelist() if "__pycache__" not in name}
    members["modelDescription.xml"] = description
    write_archive(path, members | accompanying_files(component, 2))
