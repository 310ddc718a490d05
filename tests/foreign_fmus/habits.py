"""FMUs with the habits of real exporters, compiled from `strict.c`: both versions of FMI, both interfaces."""

import shutil
import subprocess
import zipfile
from dataclasses import dataclass
from pathlib import Path

import fmpy
import pytest

HERE = Path(__file__).parent
VARIABLES = {
    "u": ("input", "continuous", "start='0'"),
    "x": ("output", "continuous", ""),
    "der(x)": ("local", "continuous", "derivative='X'"),
    "k": ("parameter", "fixed", "start='1'"),
    "d": ("input", "discrete", "start='0'"),
    "y": ("output", "discrete", ""),
    "m": ("output", "discrete", ""),
    "steps": ("output", "discrete", ""),
    "ticks": ("output", "discrete", ""),
}


@dataclass(frozen=True)
class Habit:
    """A habit: macros of the C source, attributes of the interface, deviations of the description or the archive.

    `without_outputs` makes every output local; the library may have another `library` name than the description says.
    `changes` replace texts of the description, which is written in an `encoding`; `files` are further members.
    """

    name: str
    macros: tuple[str, ...] = ()
    attributes: str = ""
    experiment: str = ""
    without_outputs: bool = False
    library: str = "strict"
    platform: str = ""
    clock: str = ""
    changes: tuple[tuple[str, str], ...] = ()
    encoding: str = "utf-8"
    files: tuple[tuple[str, str], ...] = ()
    versions: tuple[int, ...] = (2, 3)
    interfaces: tuple[str, ...] = ("ModelExchange", "CoSimulation")


def build_habit(habit: Habit, version: int, interface: str, folder: Path) -> Path:
    """Compile the FMU (skipped without cc) and return it."""
    compiler = shutil.which("cc")
    if compiler is None:
        pytest.skip("needs a C compiler named cc")
    name = f"{habit.name}{version}{interface[:1]}"
    library = folder / f"{name}{fmpy.sharedLibraryExtension}"
    macros = [f"-DVERSION={version}", *(f"-D{macro}" for macro in habit.macros)]
    if interface == "ModelExchange":
        macros.append("-DEXCHANGE")
    include = f"-I{Path(fmpy.__file__).parent / 'c-code'}"
    command = [compiler, "-shared", "-fPIC", "-w", include, *macros, str(HERE / "strict.c"), "-lm", "-o", str(library)]
    subprocess.run(command, check=True)
    platform = fmpy.platform
    if version == 3:
        platform = fmpy.platform_tuple
    fmu = folder / f"{name}.fmu"
    with zipfile.ZipFile(fmu, "w") as archive:
        text = _description(habit, version, interface)
        for old, new in habit.changes:
            text = text.replace(old, new)
        archive.writestr("modelDescription.xml", text.encode(habit.encoding))
        for member, content in habit.files:
            archive.writestr(member, content)
        archive.write(library, f"binaries/{habit.platform or platform}/{habit.library}{fmpy.sharedLibraryExtension}")
    return fmu


def _description(habit: Habit, version: int, interface: str) -> str:
    variables = []
    for reference, (name, (causality, variability, attributes)) in enumerate(VARIABLES.items()):
        causality = "local" if habit.without_outputs and causality == "output" else causality
        common = f"name='{name}' valueReference='{reference}' causality='{causality}' variability='{variability}'"
        if version == 2:
            value = attributes.replace("X", "2")
            variables.append(f"<ScalarVariable {common}><Real {value}/></ScalarVariable>")
        else:
            variables.append(f"<Float64 {common} {attributes.replace('X', '1')}/>")
    if habit.clock:
        variables.append(f"<Clock name='clock' valueReference='10' causality='input' {habit.clock}/>")
    structure = "<Derivatives><Unknown index='3'/></Derivatives>"
    if version == 3:
        structure = "<ContinuousStateDerivative valueReference='2'/>"
    identity = {2: "guid='g'", 3: "instantiationToken='g'"}[version]
    return (
        f"<fmiModelDescription fmiVersion='{version}.0' modelName='Strict' {identity}>"
        f"<{interface} modelIdentifier='strict' {habit.attributes}/>{habit.experiment}"
        f"<ModelVariables>{''.join(variables)}</ModelVariables><ModelStructure>{structure}</ModelStructure>"
        "</fmiModelDescription>"
    )
