"""Units of connected variables: converted as both FMUs declare them, or refused with both names."""

import math
from pathlib import Path

import pytest

from foreign_fmus import build_foreign, declaring, rewritten
from trihedron.tools.errors import InputError
from trihedron.tools.orchestrator import simulate
from trihedron.tools.orchestrator.interface import between, scale_of
from trihedron.tools.orchestrator.scenario import Scenario


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with Clock.fmu and Gain.fmu."""
    folder = tmp_path_factory.mktemp("foreign")
    for script in ("foreign_clock", "foreign_gain"):
        build_foreign(script, folder)
    return folder


def passed_on(folder: Path, tmp_path: Path, output: str, input_: str, definitions: str = "", compiled: bool = True):
    """What a gain of 1 makes of a clock's time when both declare a unit; `definitions` are of the gain."""
    declaring(folder / "Clock.fmu", tmp_path / "Clock.fmu", {"ended": output})
    declaring(folder / "Gain.fmu", tmp_path / "Half.fmu", {"u[1]": input_})

    def define(name: str, content: bytes) -> tuple[str, bytes]:
        if name == "modelDescription.xml" and definitions:
            content = content.replace(b"<ModelVariables>", definitions.encode() + b"<ModelVariables>")
        return name, content

    rewritten(tmp_path / "Half.fmu", tmp_path / "Gain.fmu", define)
    scenario = {
        "base_folder": tmp_path,
        "run": {"stop_s": 1.0, "step_s": 0.25},
        "fmus": {"clock": {"fmu": "Clock.fmu"}, "gain": {"fmu": "Gain.fmu"}},
        "connections": [{"from": "clock.ended", "to": "gain.u[1]"}],
    }
    return simulate(Scenario.model_validate(scenario), compiled=compiled).table["gain.y[1]"].to_list()


@pytest.mark.parametrize("compiled", [True, False])
@pytest.mark.parametrize(
    ("output", "input_", "factor", "offset"),
    [
        ("rad", "deg", 180.0 / math.pi, 0.0),
        ("deg", "rad", math.pi / 180.0, 0.0),
        ("m/s2", "g", 1.0 / 9.80665, 0.0),
        ("g", "m/s2", 9.80665, 0.0),
        ("rad/s", "deg/s", 180.0 / math.pi, 0.0),
        ("rad/h", "rad/s", 1.0 / 3600.0, 0.0),
        ("arcsec", "arcsec", 1.0, 0.0),
        ("furlong", "furlong", 1.0, 0.0),
    ],
)
def test_units_of_one_dimension_are_converted(folder, tmp_path, output, input_, factor, offset, compiled) -> None:
    found = passed_on(folder, tmp_path, f'unit="{output}"', f'unit="{input_}"', compiled=compiled)
    assert found[1:] == pytest.approx([factor * 0.25 * k + offset for k in range(1, 5)], rel=1e-15)


def test_what_an_fmu_defines_comes_before_what_we_know(folder: Path, tmp_path: Path) -> None:
    """A gram is no gravity; a unit of its own is converted by its factor."""
    gram = '<UnitDefinitions><Unit name="g"><BaseUnit kg="1" factor="1e-3"/></Unit></UnitDefinitions>'
    with pytest.raises(InputError, match=r"units differ, m/s2 and g$"):
        passed_on(folder, tmp_path, 'unit="m/s2"', 'unit="g"', gram)
    with pytest.raises(InputError, match=r"units differ, g and g$"):
        passed_on(folder, tmp_path, 'unit="g"', 'unit="g"', gram)
    turn = '<UnitDefinitions><Unit name="rev"><BaseUnit rad="1" factor="6.283185307179586"/></Unit></UnitDefinitions>'
    found = passed_on(folder, tmp_path, 'unit="rad"', 'unit="rev"', turn)
    assert found[-1] == pytest.approx(1.0 / (2.0 * math.pi), rel=1e-15)


@pytest.mark.parametrize(("output", "input_"), [("rad", "1"), ("rad", "m/s2"), ("s", "furlong"), ("deg", "deg/s")])
def test_other_dimensions_are_refused_by_both_names(folder: Path, tmp_path: Path, output: str, input_: str) -> None:
    with pytest.raises(InputError, match=rf"'clock\.ended' -> 'gain\.u\[1\]': units differ, {output} and {input_}$"):
        passed_on(folder, tmp_path, f'unit="{output}"', f'unit="{input_}"')


def test_a_difference_of_temperatures_has_no_offset() -> None:
    kelvin = {"K": scale_of({"K": 1})}
    assert between("degC", "K", {}, kelvin, relative=False) == (1.0, 273.15)
    assert between("degC", "K", {}, kelvin, relative=True) == (1.0, 0.0)
    assert between("K", "degC", kelvin, {}, relative=False) == (1.0, -273.15)


def test_digits_that_a_description_leaves_off_make_no_other_unit() -> None:
    short = {"deg": scale_of({"rad": 1}, 0.01745329)}
    assert between("deg", "deg", short, {}, relative=False) == (1.0, 0.0)
