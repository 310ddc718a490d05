"""The promises of every component: a complete state, enforced limits, a message to a host that errs."""

import math
import random
from itertools import product

import numpy as np
import pytest
from fmpy.fmi1 import FMICallException

from component_kinds import EXTENDED, all_kinds, draw_inputs, draw_parameters, outputs_of, setter_of, title
from named import Named
from trihedron.fmus import build, components
from trihedron.fmus.component import Component, extend
from trihedron.fmus.source import references
from trihedron.models.effects import CATALOGUE, EffectPlace
from trihedron.tools.errors import InputError
from trihedron.tools.orchestrator import Scenario, run_scenario

DISCARD = 2


def start(slave, component: Component, parameters: dict[str, float]) -> None:
    slave.setupExperiment(startTime=0.0)
    slave.enterInitializationMode()
    setter_of(slave, component)(parameters)
    slave.exitInitializationMode()


@pytest.mark.first(4)
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
        outputs = []
        for k in range(first, last):
            set_values(plan[k])
            fmu.doStep(k * 0.05, 0.05)
            outputs.append(outputs_of(fmu, component))
        return outputs

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
    assert outputs_of(a, block)[:3] == pytest.approx([0.1 * g, 0.0, g], rel=1e-14)
    assert outputs_of(b, block)[:3] == pytest.approx([0.2 * g, 0.0, g], rel=1e-14)
    assert outputs_of(c, extended)[:3] == pytest.approx([0.3 * g, 0.0, 1.01 * g], rel=1e-14)


@pytest.mark.parametrize("component", all_kinds(), ids=title)
def test_composing_only_appends_parameters(component):
    numbers, base = references(component), references(components()[component.name])
    assert {name: numbers[name] for name in base} == base
    added = sorted(set(numbers) - set(base), key=lambda name: numbers[name])
    count = sum(len(CATALOGUE[place.effect].at(place).parameters) for place in component.effects)
    assert [numbers[name] for name in added] == list(range(len(base) + 1, len(base) + 1 + count))


def test_effects_do_not_depend_on_their_order():
    effects = {EffectPlace("quadratic", "accelerometer-1"): [3e-4]}
    effects[EffectPlace("scale-asymmetry", "accelerometer-1")] = [-2e-4]
    force = [-6.0, 0.0, 0.0]
    orders = (effects, dict(reversed(effects.items())))
    first, second = (
        Named("AccelerometerBlock", order).begin().put(specific_force=force)["reading"][0] for order in orders
    )
    n = -6.0 / 9.80665
    assert first == second
    assert first == pytest.approx(9.80665 * (n + 3e-4 * n * n - 2e-4 * abs(n)), rel=1e-14)


def test_an_effect_of_another_component_is_refused():
    with pytest.raises(ValueError, match="extends AccelerometerBlock, not TurntableMotion"):
        extend(components()["TurntableMotion"], EXTENDED["AccelerometerBlock"])


def test_what_may_not_be_set_is_refused():
    model = Named("AccelerometerBlock")
    for name, value, message in (
        ("held_fraction", 1.5, "outside"),
        ("bias[2]", math.nan, "not a finite number"),
        ("reading[1]", 0.0, "neither a parameter nor an input"),
    ):
        with pytest.raises(ValueError, match=message):
            model.put(**{name: value})
    model.begin()
    with pytest.raises(ValueError, match="fixed"):
        model.put(noise_bound=1e-5)
    assert model.put(**{"bias[2]": 1e-3})["reading[2]"] == pytest.approx(1e-3 * 9.80665)


def test_errors_of_the_block_stay_within_their_bound_and_are_held_over_a_rest():
    model = Named("AccelerometerBlock", noise_bound=1e-5, held_fraction=0.75, seed=5, dwell=1).begin()
    errors = np.zeros((4, 500))
    for dwell in range(4):
        model.put(dwell=dwell + 1.0)
        for k in range(500):
            errors[dwell, k] = model.step(dwell * 50.0 + k * 0.1, 0.1)["reading[1]"] / 9.80665
    assert np.abs(errors).max() <= 1e-5
    # Within a rest the error has only its white part; from rest to rest the middle moves by the held part.
    assert np.all(np.ptp(errors, axis=1) <= 2 * 0.25e-5)
    assert np.all(np.ptp(errors, axis=1) > 1.9 * 0.25e-5)
    assert np.ptp(errors.mean(axis=1)) > 1e-6


@pytest.mark.parametrize(
    ("name", "inputs"),
    [
        ("TurntableMotion", {"command[1]": 0.5}),
        ("AttitudeComputer", {"increment[1]": 0.01}),
        ("GyroBlock", {"increment[1]": 0.01, "noise_bound": 1e-3}),
        ("GyroCompensation", {"increment_reading[1]": 0.01}),
        ("HarmonicMotion", {}),
    ],
)
def test_a_last_step_of_nothing_does_no_harm(name, inputs):
    model = Named(name, **inputs).begin()
    for k in range(10):
        model.step(k * 0.1, 0.1)
    before = model.outputs()
    assert model.step(1.0, 1e-14).outputs() == before


@pytest.mark.parametrize(
    ("name", "inputs", "step", "message"),
    [
        ("TurntableMotion", {"command[1]": math.nan}, 0.1, "command is not a finite angle"),
        ("AccelerometerBlock", {"specific_force[2]": math.inf}, 0.1, "not finite"),
        ("AttitudeComputer", {}, 0.15, "not the sample period"),
    ],
)
def test_bad_inputs_stop_the_step_with_a_message(name, inputs, step, message):
    model = Named(name).begin().step(0.0, 0.1).put(**inputs)
    assert message in model.refuses_step(0.1, step)


def test_a_mounting_that_is_no_rotation_stops_the_initialisation_with_a_message():
    message = Named("TurntableMotion", **{"mounting[1]": 0.9}).refuses_to_begin()
    assert "mounting is not a proper orthogonal matrix" in message


def test_an_enumeration_takes_its_items_only():
    model = Named("AttitudeComputer")
    items = next(v for v in model.component.variables if v.name == "algorithm").items
    model.put(algorithm=len(items))
    for wrong in (0, -1, len(items) + 1):
        with pytest.raises(ValueError, match="algorithm"):
            model.put(algorithm=wrong)


@pytest.mark.acceptance
@pytest.mark.parametrize("name", ["TurntableMotion", "AccelerometerBlock", "AttitudeComputer"])
def test_a_step_that_is_none_is_discarded_and_the_next_one_works(name, fmu_folder, slaves):
    component, slave = components()[name], slaves(fmu_folder / f"{name}.fmu")
    start(slave, component, {})
    wrong = product((0.0, math.inf, math.nan), (0.0, -0.01, math.inf, math.nan))
    for k, (time, step) in enumerate(wrong):
        with pytest.raises(FMICallException) as refused:
            slave.doStep(currentCommunicationPoint=time, communicationStepSize=step)
        assert refused.value.status == DISCARD
        slave.doStep(currentCommunicationPoint=0.01 * k, communicationStepSize=0.01)
        assert all(math.isfinite(value) for value in outputs_of(slave, component))


@pytest.mark.parametrize(
    ("parameters", "message"),
    [
        ({"algorithm": 99}, "algorithm = 99 is none of its values: 1 (two-sample-rodrigues)"),
        ({"initial_attitude": [0.0, 0.0, 0.0, 0.0]}, "initial_attitude is not a unit quaternion"),
    ],
)
def test_a_wrong_parameter_of_a_component_is_named_by_the_scenario(parameters, message, tmp_path):
    scenario = Scenario.model_validate(
        {
            "base_folder": tmp_path,
            "run": {"stop_s": 1.0, "step_s": 0.1},
            "fmus": {"computer": {"component": "AttitudeComputer", "parameters": parameters}},
        }
    )
    with pytest.raises(InputError) as refused:
        run_scenario(scenario)
    assert message in str(refused.value)
    assert "py exception" not in str(refused.value)


@pytest.mark.parametrize(
    ("name", "settings", "message"),
    [
        ("TurntableMotion", {"mounting[1]": 0.9}, "mounting is not a proper orthogonal matrix"),
        ("AttitudeComputer", {"initial_attitude[1]": 0.5}, "not a unit quaternion"),
    ],
)
def test_bad_parameters_stop_the_initialisation_with_a_message(name, settings, message):
    assert message in Named(name, **settings).refuses_to_begin()
