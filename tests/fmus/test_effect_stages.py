"""Effects inside the components: stages, their order, senses, increments, and effects that are not linear."""

import math

import numpy as np
import pytest

from effect_readings import ALPHA, BETA, ROWS, WOBBLES, G, extended_instance, readings, true_bench
from named import Named
from trihedron.models.bench import TARGETS
from trihedron.models.effects import EffectPlace
from trihedron.tools.calibration import Positions, parametrise, predicted_reading
from trihedron.tools.evidence import Circumstances, Visits, circumstances_of
from trihedron.tools.records import PositionRecord


def block(effects: dict[EffectPlace, tuple[float, ...]], **settings):
    """Return a block, and a function that reads it at a specific force [g]."""
    model = Named("AccelerometerBlock", effects, **settings)
    return model, lambda *n: (model.put(specific_force=G * np.array(n))["reading"] / G).tolist()


def at_accelerometer_1(name: str) -> EffectPlace:
    return EffectPlace(name, "accelerometer-1")


@pytest.mark.acceptance
def test_the_order_of_effects_on_the_table_does_not_matter():
    """Each effect is evaluated on the angles without the others: the same bits except for the order of the sum."""
    harmonic, backlash = EffectPlace("encoder-harmonic", "outer-axis", 2), EffectPlace("backlash", "inner-axis")
    effects = {**WOBBLES, harmonic: (1e-3, 0.2), backlash: (5e-4,)}
    assert readings(dict(reversed(effects.items()))) == pytest.approx(readings(effects), abs=1e-15)


def test_the_last_stage_works_in_declared_order():
    saturation, quantisation = at_accelerometer_1("saturation"), at_accelerometer_1("quantisation")
    clipped_first, read_block = block({saturation: (0.96,), quantisation: (0.1,)})
    clipped_first.begin()
    assert read_block(0.99, 0.0, 0.0)[0] == pytest.approx(1.0)
    assert read_block(-0.99, 0.0, 0.0)[0] == pytest.approx(-1.0)
    rounded_first, read_block = block({quantisation: (0.1,), saturation: (0.96,)})
    rounded_first.begin()
    assert read_block(0.99, 0.0, 0.0)[0] == pytest.approx(0.96)
    assert read_block(-0.99, 0.0, 0.0)[0] == pytest.approx(-0.96)
    assert read_block(0.32, 0.0, 0.0)[0] == pytest.approx(0.3)


def test_noise_is_clipped_and_rounded_with_the_rest():
    effects = {at_accelerometer_1("quantisation"): (2e-4,), EffectPlace("saturation", "accelerometer-2"): (0.95,)}
    model, read_block = block(effects, noise_bound=1e-3, held_fraction=0.0)
    model.begin()
    recorded = []
    for k in range(200):
        read_block(0.3, 0.9499, 0.3)
        model.step(0.1 * k, 0.1)
        recorded.append(read_block(0.3, 0.9499, 0.3))
    rounded, clipped, free = np.transpose(recorded)
    assert np.abs(rounded / 2e-4 - np.round(rounded / 2e-4)).max() < 1e-9
    assert len(set(np.round(rounded / 2e-4))) > 4
    assert clipped.max() == pytest.approx(0.95, abs=1e-15)
    assert 0.3 < np.mean(clipped > 0.95 - 1e-12) < 0.7
    assert len(set(free)) == 200


def test_a_dead_zone_loses_the_accelerometers_own_input_alone():
    errors = {"bias": [2e-3, 0.0, 0.0], "gamma_21": 0.01, "gamma_12": 0.02, "scale_error_plus": [0.1, 0.0, 0.0]}
    model, read_block = block({at_accelerometer_1("dead-zone"): (0.01,)}, **errors)
    model.begin()
    inside = read_block(0.009, 0.5, 0.8)
    assert inside == pytest.approx([2e-3 + 0.02 * 0.5, 0.5 + 0.01 * 0.009, 0.8], abs=1e-15)
    assert read_block(0.011, 0.5, 0.8)[0] == pytest.approx(1.1 * 0.011 + 2e-3 + 0.01, abs=1e-15)


@pytest.mark.parametrize("name", ["dead-zone", "saturation", "quantisation"])
def test_without_its_parameter_an_effect_of_the_last_stage_does_nothing(name):
    model, read_block = block({at_accelerometer_1(name): (0.0,)})
    model.begin()
    assert read_block(-0.003, 0.5, 0.8) == pytest.approx([-0.003, 0.5, 0.8], abs=1e-15)


def test_senses_of_inputs_are_those_of_their_last_changes():
    model, read_block = block({at_accelerometer_1("hysteresis"): (2e-3,)})
    read_block(-0.5, 0.0, 0.0)
    model.begin()
    recorded = []
    # The first change has no previous input; a change by rounding does not count.
    for k, n in enumerate((-0.5, -0.3, -0.3, -0.3 - 1e-16, -0.31, -0.31 + 1e-15, 0.2)):
        read_block(n, 0.0, 0.0)
        model.step(float(k), 1.0)
        recorded.append(round(1e3 * (read_block(n, 0.0, 0.0)[0] - n)))
    assert recorded == [1, -1, -1, -1, 1, 1, -1]


@pytest.mark.parametrize(
    ("name", "place", "values", "output", "per_hour"),
    [
        ("AccelerometerBlock", EffectPlace("bias-drift", "accelerometer-1"), (36.0,), "reading", 36.0 * G),
        ("GyroBlock", EffectPlace("gyro-bias-drift", "gyro-block"), (36.0, 0.0, 0.0), "rate_reading", 36.0),
    ],
)
def test_hours_count_from_the_beginning_to_the_end_of_the_step(name, place, values, output, per_hour):
    model = Named(name, {place: values}).begin(50.0)
    at_rest = model[f"{output}[1]"]
    for k in range(3):
        model.step(50.0 + 2.0 * k, 2.0)
        drifted = model[f"{output}[1]"] - at_rest
        assert drifted == pytest.approx(per_hour * 2.0 * (k + 1) / 3600.0, rel=1e-9)


def table(effects: dict[EffectPlace, tuple[float, ...]], **settings) -> Named:
    """Return the table of the true bench, at rest."""
    return extended_instance("TurntableMotion", effects, **settings).begin()


@pytest.mark.parametrize("step", [0.1, 100.0])
def test_senses_of_axes_are_those_of_their_last_moves(step):
    """Test moves that take many steps, and moves that begin, reverse or end within one."""
    effects = {EffectPlace("backlash", axis): (2e-3,) for axis in ("outer-axis", "inner-axis")}
    model = table(effects, encoder_fluctuation_bound=0.0)
    time, recorded = 0.0, [model["angle_reading"]]
    for commands in ((1.0, -1.0), (0.5, -1.0), (0.5, 0.2)):
        model.put(command=commands)
        for _ in range(math.ceil(20.0 / step)):
            model.step(time, step)
            time += step
        recorded.append(model["angle_reading"] - commands)
    assert np.round(1e3 * np.array(recorded)).tolist() == [[0, 0], [-1, 1], [1, 1], [1, -1]]


def test_a_move_that_is_turned_round_within_a_step_ends_in_its_last_sense():
    model = table({EffectPlace("backlash", "outer-axis"): (2e-3,)}, encoder_fluctuation_bound=0.0)
    model.put(**{"command[1]": 3.0})
    model.step(0.0, 1.0)
    model.put(**{"command[1]": 0.1})
    model.step(1.0, 60.0)
    assert model["angle_reading[1]"] == pytest.approx(0.1 + 1e-3, abs=1e-12)


def test_a_record_without_approach_columns_gives_senses_from_the_row_before():
    """The first input has no predecessor; a change of mounting is a new beginning."""
    model, _ = true_bench()
    record = PositionRecord(
        position=np.arange(1, ROWS + 1),
        time_s=60.0 * np.arange(ROWS),
        alpha=ALPHA,
        beta=BETA,
        specific_force=np.full((ROWS, 3), 5.0),
    )
    rows = Visits.of(model, circumstances_of(record)).rows(model.point)
    assert rows.input_sense[0].tolist() == np.sign(rows.n[0]).tolist()
    assert rows.input_sense[1:].tolist() == np.sign(np.diff(rows.n, axis=0)).tolist()
    turns = np.remainder(np.diff(ALPHA) + np.pi, 2.0 * np.pi) - np.pi
    assert rows.sense_alpha.tolist() == [0.0, *np.sign(turns)]
    # Any order of rows keeps each row's predecessor.
    chosen = np.array([2, 5])
    some = circumstances_of(record).selected(chosen)
    at = Positions(ALPHA[chosen], BETA[chosen], np.zeros(2, dtype=int))
    assert (
        Visits(model.parametrisation, at, some).rows(model.point).input_sense.tolist()
        == rows.input_sense[chosen].tolist()
    )


def test_the_sense_of_an_input_is_told_where_it_does_not_matter_which_axis_came_last():
    """At (60°, 30°) both axes raise the first input as they turn forwards; the second input falls as β grows."""
    p = parametrise({"identity": np.eye(3)})
    angles = np.radians([[60.0, 30.0]] * 4)
    at = Positions(angles[:, 0], angles[:, 1], np.zeros(4, dtype=int))
    senses = np.array([[1.0, 1.0], [1.0, -1.0], [-1.0, -1.0], [1.0, 1.0]])
    before = angles - 0.3 * senses
    before[3, 1] = angles[3, 1]
    circumstances = Circumstances(np.zeros(4), None, senses[:, 0], senses[:, 1], True, before)
    rows = Visits(p, at, circumstances).rows(np.zeros(len(p.symbols)))
    sense, known_senses = rows.input_sense, rows.sense_told
    assert sense[:, 0].tolist() == [1.0, 0.0, -1.0, 1.0]
    assert known_senses[:, 0].tolist() == [True, False, True, True]
    assert sense[:, 1].tolist() == [0.0, 1.0, 0.0, 1.0]
    assert known_senses[:, 1].tolist() == [False, True, False, True]
    assert sense[:, 2].tolist() == [-1.0, -1.0, 1.0, -1.0]
    assert known_senses[:, 2].all()


def test_rows_carry_the_nominal_prediction_and_the_own_response():
    model, rows = true_bench()
    assert np.array_equal(rows.prediction, predicted_reading(model.parametrisation, model.point, model.positions))
    x = dict(zip(TARGETS, model.parametrisation.selection[0] @ model.point, strict=True))
    positive = rows.n[:, 1] >= 0.0
    assert rows.own[:, 1] == pytest.approx(rows.n[:, 1] * (1.0 + np.where(positive, x["X9"], x["X10"])), abs=1e-15)
