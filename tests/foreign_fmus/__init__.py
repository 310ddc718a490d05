"""Foreign FMUs: PythonFMU scripts, which the tests build."""

import re
import shutil
import subprocess
import sys
import warnings
import zipfile
from collections.abc import Callable, Mapping
from pathlib import Path

import fmpy
import pytest

HERE = Path(__file__).parent


def build_foreign(script: str, folder: Path) -> Path:
    """Build a script of this folder as an FMU; the process forgets its import."""
    from pythonfmu.builder import FmuBuilder

    path, modules = list(sys.path), set(sys.modules)
    sys.path.insert(0, str(HERE))
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", DeprecationWarning)
            return FmuBuilder.build_FMU(HERE / f"{script}.py", dest=folder, needsExecutionTool=False)
    finally:
        sys.path[:] = path
        for name in set(sys.modules) - modules:
            if name.startswith("foreign_"):
                del sys.modules[name]


def rewritten(fmu: Path, target: Path, change: Callable[[str, bytes], tuple[str, bytes] | None]) -> Path:
    """Return a copy of an FMU in which each member is changed, or left out if `change` gives None."""
    with zipfile.ZipFile(fmu) as old, zipfile.ZipFile(target, "w") as new:
        for member in old.infolist():
            changed = change(member.filename, old.read(member))
            if changed is not None:
                new.writestr(*changed)
    return target


def compile_foreign(
    source: str, folder: Path, variables: Mapping[str, str], kind: str, options: str = "", end: str = ""
):
    """Compile a C file of this folder as an FMU of FMI 2.0 (skipped without cc), as `Name.fmu`.

    `variables` are attributes and type of each, by the order of their value references. `kind` is the element of its
    use, `more` are further attributes of the description, `end` is the content of its structure.
    """
    compiler = shutil.which("cc")
    if compiler is None:
        pytest.skip("needs a C compiler named cc")
    library = folder / f"{source}{fmpy.sharedLibraryExtension}"
    headers = Path(fmpy.__file__).parent / "c-code"
    subprocess.run(
        [compiler, "-shared", "-fPIC", "-w", f"-I{headers}", HERE / f"{source}.c", "-o", library], check=True
    )
    process = enumerate(variables.items())
    lines = [f'<ScalarVariable name="{n}" valueReference="{k}" {v}</ScalarVariable>' for k, (n, v) in process]
    name = source.capitalize()
    described = [
        f'<fmiModelDescription fmiVersion="2.0" modelName="{name}" guid="g" {options}>',
        f'<{kind} modelIdentifier="{source}"/><ModelVariables>{"".join(lines)}</ModelVariables>',
        f"<ModelStructure>{end}</ModelStructure></fmiModelDescription>",
    ]
    with zipfile.ZipFile(folder / f"{name}.fmu", "w") as archive:
        archive.writestr("modelDescription.xml", "".join(described))
        archive.write(library, f"binaries/{fmpy.platform}/{library.name}")


def declaring(fmu: Path, target: Path, attributes: dict[str, str]) -> Path:
    """Return a copy of an FMU whose description declares more of some Real variables: name to `unit="rad" min="0"`."""

    def change(name: str, content: bytes) -> tuple[str, bytes]:
        if name != "modelDescription.xml":
            return name, content
        text = content.decode()
        for variable, attribute in attributes.items():
            pattern = rf'(<ScalarVariable[^>]*name="{re.escape(variable)}"[^>]*>\s*<Real)'
            text, count = re.subn(pattern, rf"\1 {attribute}", text)
            assert count == 1, variable
        return name, text.encode()

    return rewritten(fmu, target, change)
