"""A native FMU, compiled here: nothing in the orchestrator rests on PythonFMU."""

import shutil
import subprocess
import zipfile
from pathlib import Path

import fmpy
import pytest

from trihedron.tools.errors import InputError
from trihedron.tools.orchestrator import simulate
from trihedron.tools.orchestrator.scenario import Scenario

DESCRIPTION = """<?xml version="1.0" encoding="UTF-8"?>
<fmiModelDescription fmiVersion="2.0" modelName="Native" guid="native">
<CoSimulation modelIdentifier="native"/>
<ModelVariables>
<ScalarVariable name="u" valueReference="0" causality="input"><Real start="0"/></ScalarVariable>
<ScalarVariable name="y" valueReference="1" causality="output"><Real/></ScalarVariable>
<ScalarVariable name="stops" valueReference="2" causality="parameter" variability="fixed">
<Integer start="0" max="3"/></ScalarVariable>
</ModelVariables>
<ModelStructure><Outputs><Unknown index="2"/></Outputs></ModelStructure>
</fmiModelDescription>
"""


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with Native.fmu."""
    compiler = shutil.which("cc")
    if compiler is None or fmpy.system == "windows":
        pytest.skip("needs a C compiler named cc")
    folder = tmp_path_factory.mktemp("native")
    source = Path(__file__).parent / "foreign_fmus" / "native.c"
    headers = Path(fmpy.__file__).parent / "c-code"
    library = folder / f"native{fmpy.sharedLibraryExtension}"
    subprocess.run([compiler, "-shared", "-fPIC", "-w", f"-I{headers}", source, "-o", library], check=True)
    arm_linux = fmpy.architecture == "aarch64" and fmpy.system == "linux"
    place = fmpy.platform_tuple if arm_linux else fmpy.platform
    with zipfile.ZipFile(folder / "Native.fmu", "w") as archive:
        archive.writestr("modelDescription.xml", DESCRIPTION)
        archive.write(library, f"binaries/{place}/native{fmpy.sharedLibraryExtension}")
    return folder


def chain(folder: Path, **stops: int) -> Scenario:
    names = [f"n{i}" for i in range(5)]
    data = {
        "run": {"stop_s": 1.0, "step_s": 0.125},
        "fmus": {name: {"fmu": "Native.fmu"} for name in names},
        "connections": [{"from": f"n{i}.y", "to": f"n{i + 1}.u"} for i in range(4)],
        "stimuli": [{"to": "n0.u", "constant": 1.5}],
        "base_folder": folder,
    }
    for name, value in stops.items():
        data["fmus"][name]["parameters"] = {"stops": value}
    return Scenario.model_validate(data)


def test_native_fmus_are_coupled(folder: Path) -> None:
    table = simulate(chain(folder)).table
    assert [table[f"n{i}.y"].to_list() for i in range(5)] == [[0.0] + [1.5 * 2 ** (i + 1)] * 8 for i in range(5)]


def test_what_a_native_fmu_logs_is_formatted(folder: Path) -> None:
    with pytest.raises(InputError) as refused:
        simulate(chain(folder, n3=1))
    assert str(refused.value) == "FMU 'n3' (Native.fmu): fmi2DoStep at 0.625 s ended with Error: fuse of 3 0.25"
    with pytest.raises(InputError, match=r"stops = 4 is outside its limits \[-inf, 3\.0\]"):
        simulate(chain(folder, n3=4))


def test_nobody_is_blamed_with_the_words_of_another(folder: Path) -> None:
    with pytest.raises(InputError, match=r"^FMU 'n3' .* ended with Error \(its log says nothing\)$"):
        simulate(chain(folder, n0=3, n3=2))
