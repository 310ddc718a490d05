"""The .ssv of a component: valid to the schema of SSP 1.0, read by FMPy, exact."""

import pytest
from fmpy.ssp.ssd import read_ssv

from component_kinds import elements_of
from trihedron.fmus import components
from trihedron.fmus.parameters import parameter_set

BLOCK = components()["AccelerometerBlock"]


def test_every_value_comes_back_exactly_with_its_unit(tmp_path):
    values = {"bias": [1e-3 / 3, -2e-17, 0.1 + 0.2], "gravity": 9.81, "gamma_21": 1 / 7}
    path = tmp_path / "block.ssv"
    path.write_bytes(parameter_set(BLOCK, values, "of a test <&>"))
    described = {p.name: p for p in read_ssv(str(path)).parameters}
    assert list(described) == ["gravity", "gamma_21", "bias[1]", "bias[2]", "bias[3]"]
    assert [float(described[f"bias[{p}]"].value) for p in (1, 2, 3)] == values["bias"]
    assert (float(described["gravity"].value), described["gravity"].unit, described["bias[1]"].unit) == (
        9.81,
        "m/s2",
        "g",
    )
    assert all(p.type == "Real" for p in described.values())


def test_names_and_units_are_those_of_the_model_description(tmp_path):
    starts = BLOCK.parameter_starts
    real = {v.name: starts[v.name] for v in BLOCK.interface if v.causality == "parameter" and v.type == "real"}
    path = tmp_path / "block.ssv"
    path.write_bytes(parameter_set(BLOCK, real, "starts"))
    units = {name: v.unit for name, v in elements_of(BLOCK).items() if v.name in real}
    assert {p.name: p.unit for p in read_ssv(str(path)).parameters} == units


@pytest.mark.parametrize("values", [{"bias": [1.0]}, {"bios": [1.0]}, {"seed": 2.0}, {"specific_force": [0.0] * 3}])
def test_what_is_no_such_parameter_is_refused(values):
    with pytest.raises(ValueError, match=r"bias has 3 elements|no real parameter"):
        parameter_set(BLOCK, values, "")
