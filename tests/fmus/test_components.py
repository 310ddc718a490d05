"""What every component promises: valid FMUs, the same bits everywhere, a complete state, limits that are enforced."""

import math
import random

import numpy as np
import pytest
from fmpy.validation import validate_fmu

from component_kinds import EXTENDED, all_kinds, draw_inputs, draw_parameters, outputs_of, setter_of, title
from trihedron.fmus import build, components
from trihedron.fmus.component import Component, extend
from trihedron.fmus.source import instantiate, references
from trihedron.models.effects import CATALOGUE, EffectPlace


def start(slave, component: Component, parameters: dict[str, float]) -> None:
    slave.setupExperiment(startTime=0.0)
    slave.enterInitializationMode()
    setter_of(slave, component)(parameters)
    slave.exitInitializationMode()


@pytest.mark.parametrize("component", all_kinds(), ids=title)
def test_valid_to_fmpy_and_the_same_bytes_on_every_build(component, tmp_path):
    first = build(component.name, tmp_path / "a", component.effects)
    second = build(component.name, tmp_path / "b", component.effects)
    assert validate_fmu(str(first)) == []
    assert first.read_bytes() == second.read_bytes()


@pytest.mark.parametrize("component", all_kinds(), ids=title)
def test_the_fmu_gives_the_bits_of_plain_python(component, tmp_path, slaves):
    rng = random.Random(7)
    parameters = draw_parameters(component, rng)
    model = instantiate(component)
    numbers = references(component)
    for name, value in parameters.items():
        model.set(numbers[name], value)
    assert model.initialise(0.0) == 0
    slave = slaves(build(component.name, tmp_path, component.effects))
    start(slave, component, parameters)
    set_values = setter_of(slave, component)
    shown = [numbers[e] for v in component.interface if v.causality == "output" for e in v.elements]
    inputs = draw_inputs(component, rng)
    for k in range(600):
        if k % 40 == 0 or component.name == "AttitudeComputer":
            inputs = draw_inputs(component, rng)
            set_values(inputs)
            for name, value in inputs.items():
                model.set(numbers[name], value)
        slave.doStep(k * 0.02, 0.02)
        assert model.do_step(k * 0.02, 0.02) == 0
        assert outputs_of(slave, component) == [model.get(i) for i in shown]


@pytest.mark.parametrize("component", all_kinds(), ids=title)
def test_state_is_complete_across_get_set_serialise_and_reset(component, tmp_path, slaves):
    rng = random.Random(11)
    parameters = draw_parameters(component, rng)
    slave = slaves(build(component.name, tmp_path, component.effects))
    twin = slaves(build(component.name, tmp_path / "twin", component.effects), "twin")
    start(slave, component, parameters)
    start(twin, component, {})
    plan = [draw_inputs(component, rng) for _ in range(60)]

    def run(fmu, first: int, last: int) -> list[list[float]]:
        set_values = setter_of(fmu, component)
        shown = []
        for k in range(first, last):
            set_values(plan[k])
            fmu.doStep(k * 0.05, 0.05)
            shown.append(outputs_of(fmu, component))
        return shown

    run(slave, 0, 31)
    state = slave.getFMUstate()
    text = slave.serializeFMUstate(state)
    rest = run(slave, 31, 60)
    slave.setFMUstate(state)
    assert run(slave, 31, 60) == rest
    slave.freeFMUstate(state)
    carried = twin.deSerializeFMUstate(text)
    twin.setFMUstate(carried)
    assert run(twin, 31, 60) == rest
    twin.freeFMUstate(carried)
    slave.reset()
    start(slave, component, parameters)
    again = run(slave, 0, 60)
    assert again[31:] == rest


def test_two_instances_and_different_fmus_share_a_process(fmu_folder, tmp_path, slaves):
    """Instances do not share memory, and FMUs whose scripts differ do not share code."""
    block = components()["AccelerometerBlock"]
    extended = extend(block, EXTENDED["AccelerometerBlock"])
    a, b = (
        slaves(fmu_folder / "AccelerometerBlock.fmu", "a"),
        slaves(fmu_folder / "AccelerometerBlock.fmu", "b"),
    )
    c = slaves(build(block.name, tmp_path, extended.effects), "c")
    start(a, block, {"bias[1]": 0.1})
    start(b, block, {"bias[1]": 0.2})
    start(c, extended, {"bias[1]": 0.3, "quadratic.accelerometer_3.coefficient": 0.01})
    force = {"specific_force[1]": 0.0, "specific_force[2]": 0.0, "specific_force[3]": 9.80665}
    for slave, component in ((a, block), (b, block), (c, extended)):
        setter_of(slave, component)(force)
    g = 9.80665
    assert outputs_of(a, block) == pytest.approx([0.1 * g, 0.0, g], rel=1e-14)
    assert outputs_of(b, block) == pytest.approx([0.2 * g, 0.0, g], rel=1e-14)
    assert outputs_of(c, extended) == pytest.approx([0.3 * g, 0.0, 1.01 * g], rel=1e-14)


@pytest.mark.parametrize("component", all_kinds(), ids=title)
def test_composing_only_appends_parameters(component):
    numbers, base = references(component), references(components()[component.name])
    assert {name: numbers[name] for name in base} == base
    added = sorted(set(numbers) - set(base), key=lambda name: numbers[name])
    parameters = [p for place in component.effects for p in CATALOGUE[place.effect].at(place).parameters]
    assert [numbers[name] for name in added] == list(range(len(base) + 1, len(base) + 1 + len(parameters)))


def test_effects_do_not_depend_on_their_order():
    block = components()["AccelerometerBlock"]
    places = [EffectPlace("quadratic", "accelerometer-1"), EffectPlace("scale-asymmetry", "accelerometer-1")]
    readings = []
    for order in (places, places[::-1]):
        component = extend(block, order)
        numbers = references(component)
        model = instantiate(component)
        model.set(numbers["quadratic.accelerometer_1.coefficient"], 3e-4)
        model.set(numbers["scale_asymmetry.accelerometer_1.coefficient"], -2e-4)
        model.initialise(0.0)
        model.set(numbers["specific_force[1]"], -6.0)
        readings.append(model.get(numbers["reading[1]"]))
    n = -6.0 / 9.80665
    assert readings[0] == readings[1]
    assert readings[0] == pytest.approx(9.80665 * (n + 3e-4 * n * n - 2e-4 * abs(n)), rel=1e-14)


def test_an_effect_of_another_component_is_refused():
    with pytest.raises(ValueError, match="extends AccelerometerBlock, not TurntableMotion"):
        extend(components()["TurntableMotion"], EXTENDED["AccelerometerBlock"])


def test_what_may_not_be_set_is_refused():
    block = components()["AccelerometerBlock"]
    numbers = references(block)
    model = instantiate(block)
    with pytest.raises(ValueError, match="outside"):
        model.set(numbers["held_fraction"], 1.5)
    with pytest.raises(ValueError, match="not a finite number"):
        model.set(numbers["bias[2]"], math.nan)
    with pytest.raises(ValueError, match="neither a parameter nor an input"):
        model.set(numbers["reading[1]"], 0.0)
    model.initialise(0.0)
    with pytest.raises(ValueError, match="fixed"):
        model.set(numbers["noise_bound"], 1e-5)
    model.set(numbers["bias[2]"], 1e-3)
    assert model.get(numbers["reading[2]"]) == pytest.approx(1e-3 * 9.80665)


def test_errors_of_the_block_stay_within_their_bound_and_are_held_over_a_rest():
    block = components()["AccelerometerBlock"]
    numbers = references(block)
    model = instantiate(block)
    for name, value in {"noise_bound": 1e-5, "held_fraction": 0.75, "seed": 5.0}.items():
        model.set(numbers[name], value)
    model.set(numbers["dwell"], 1.0)
    model.initialise(0.0)
    errors = np.zeros((4, 500))
    for dwell in range(4):
        model.set(numbers["dwell"], dwell + 1.0)
        for k in range(500):
            assert model.do_step(dwell * 50.0 + k * 0.1, 0.1) == 0
            errors[dwell, k] = model.get(numbers["reading[1]"]) / 9.80665
    assert np.abs(errors).max() <= 1e-5
    # Within a rest the error spans the white part alone; from rest to rest the middle moves by the held part.
    assert np.all(np.ptp(errors, axis=1) <= 2 * 0.25e-5)
    assert np.all(np.ptp(errors, axis=1) > 1.9 * 0.25e-5)
    assert np.ptp(errors.mean(axis=1)) > 1e-6


def test_a_last_step_of_nothing_does_no_harm():
    for name, inputs in (
        ("TurntableMotion", {"command[1]": 0.5}),
        ("AttitudeComputer", {"increment[1]": 0.01}),
    ):
        component = components()[name]
        numbers = references(component)
        model = instantiate(component)
        model.initialise(0.0)
        for element, value in inputs.items():
            model.set(numbers[element], value)
        for k in range(10):
            assert model.do_step(k * 0.1, 0.1) == 0
        shown = [numbers[e] for v in component.interface if v.causality == "output" for e in v.elements]
        before = [model.get(i) for i in shown]
        assert model.do_step(1.0, 1e-14) == 0
        assert [model.get(i) for i in shown] == before


@pytest.mark.parametrize(
    ("name", "settings", "said"),
    [
        ("TurntableMotion", {"mounting[1]": 0.9}, "mounting is not a proper orthogonal matrix"),
        ("AttitudeComputer", {"initial_attitude[1]": 0.5}, "not a unit quaternion"),
    ],
)
def test_bad_parameters_stop_the_initialisation_with_a_message(name, settings, said):
    component = components()[name]
    numbers = references(component)
    model = instantiate(component)
    for element, value in settings.items():
        model.set(numbers[element], value)
    message = model.initialise(0.0)
    assert said in component.messages[message - 1]


@pytest.mark.parametrize(
    ("name", "inputs", "step", "said"),
    [
        ("TurntableMotion", {"command[1]": math.nan}, 0.1, "command is not a finite angle"),
        ("AccelerometerBlock", {"specific_force[2]": math.inf}, 0.1, "not finite"),
        ("AttitudeComputer", {"increment[1]": 3.2}, 0.1, "half a turn"),
        ("AttitudeComputer", {"increment[1]": math.nan}, 0.1, "half a turn"),
        ("AttitudeComputer", {}, 0.15, "not the sample period"),
    ],
)
def test_bad_inputs_stop_the_step_with_a_message(name, inputs, step, said):
    component = components()[name]
    numbers = references(component)
    model = instantiate(component)
    model.initialise(0.0)
    assert model.do_step(0.0, 0.1) == 0
    for element, value in inputs.items():
        model.set(numbers[element], value)
    message = model.do_step(0.1, step)
    assert message > 0
    assert said in component.messages[message - 1]
