"""The diagnosis of strapdown records: verdicts on simulated records, and the linear system behind them."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from strapdown_records import strapdown_record, true_motion
from trihedron.fmus import build
from trihedron.models.effects import CATALOGUE, EffectPlace
from trihedron.tools.evidence.carried import carried_evidence
from trihedron.tools.evidence.references import Gravity, turned
from trihedron.tools.motion.carry import GyroModel, carried_attitude
from trihedron.tools.motion.inspect import inspect_record
from trihedron.tools.orchestrator.load import usual_flavour
from trihedron.tools.strapdown.diagnosis import diagnose_strapdown
from trihedron.tools.strapdown.judging import order_of_effects, witnesses
from trihedron.tools.strapdown.search import classes_of, seen_places, smallest_sets
from trihedron.tools.trials.draw import BlockOptions, draw_block_case, draw_clean_block
from trihedron.tools.trials.measure import measure_block

LATENCY = EffectPlace("latency", "gyro-block")
SCALE = EffectPlace("gyro-scale-misalignment", "gyro-block")
SENSITIVITY = EffectPlace("gyro-g-sensitivity", "gyro-block")


@pytest.fixture(scope="module")
def sensitive():
    """A record of hand-like moves whose gyros depend on gravity, and its diagnosis."""
    matrix = np.array([[0.0, 3e-3, 0.0], [0.0, 0.0, 0.0], [-2e-3, 0.0, 0.0]])
    record = strapdown_record(gyro_bias=np.array([0.01, -0.02, 0.005]), sensitivity=matrix, seed=3)
    return record, matrix, diagnose_strapdown(record)


def test_a_clean_block_is_consistent_and_its_parameters_are_within_their_intervals():
    gamma = np.array([[0.004, 0.0, 0.0], [0.002, -0.003, 0.0], [0.001, 0.005, 0.002]])
    found = diagnose_strapdown(strapdown_record(gamma=gamma, bias_g=np.array([0.01, -0.02, 0.03])), rerun=False)
    assert found.verdict == "consistent"
    assert found.causes == ()
    assert found.radius is not None
    assert found.radius < 1.0
    truth = {"accelerometer gamma_11": 0.004, "accelerometer gamma_32": 0.005, "accelerometer bias_3": 0.03}
    for parameter in found.parameters:
        if parameter.name in truth:
            assert parameter.low is not None
            assert parameter.high is not None
            assert parameter.low <= truth[parameter.name] <= parameter.high
    assert {entry["effect"] for entry in found.excluded} >= {"gyro-g-sensitivity", "gyro-bias-drift"}
    assert any("no effect is named" in line for line in found.lines())


def test_sensitivity_to_gravity_is_named_with_its_size_and_gains_on_moves_that_were_not_used(sensitive):
    _, matrix, found = sensitive
    assert found.verdict == "explained"
    (cause,) = found.causes
    assert cause.place == SENSITIVITY
    assert np.reshape(cause.values, (3, 3)) == pytest.approx(matrix, abs=5e-4)
    for (low, high), value in zip(cause.intervals, matrix.ravel(), strict=True):
        assert low <= value <= high
    gain = found.gain.to_json()
    assert gain["over"] == "1 move"
    assert gain["held_out_rms_after"] < 0.5 * gain["held_out_rms_before"]


def test_the_object_is_that_of_the_contract(sensitive):
    content = sensitive[2].to_json()
    assert content["schema"] == "trihedron.diagnosis/1"
    assert content["unit"] == "arcmin"
    assert content["baseline"]["falsified"] is True
    assert content["extended"]["radius"] <= 1.0 < content["baseline"]["radius"]
    assert content["noise_bound_arcmin"] > 0.0
    assert {"held_out_rms_before", "held_out_rms_after", "held_out_max_before", "held_out_max_after"} <= set(
        content["gain"]
    )
    assert [length["over"] for length in content["lengths"]] == ["1 move", "2 moves", "3 moves"]
    assert sensitive[2].json_text() == sensitive[2].json_text()


def with_truth(record, motion, latency: int = 0):
    """A simulated record with the attitude of its motion; its gyros read so many rows late."""
    time, rate, _ = motion
    steps = Rotation.from_rotvec(0.5 * (rate[1:] + rate[:-1]) * np.diff(time)[:, None])
    attitude = [Rotation.identity()]
    for step in steps:
        attitude.append(attitude[-1] * step)
    quaternion = np.roll(Rotation.concatenate(attitude).as_quat(), 1, axis=1)
    late = np.vstack([np.repeat(record.rate[:1], latency, axis=0), record.rate[: len(time) - latency]])
    return replace(record, attitude=quaternion, rate=late)


def test_latency_is_named_in_samples_beside_the_true_attitude():
    motion = true_motion(period=0.01)
    found = diagnose_strapdown(with_truth(strapdown_record(motion, seed=5), motion, latency=3), rerun=False)
    assert found.reference == "true attitude"
    assert found.verdict == "explained"
    (cause,) = found.causes
    assert cause.place == LATENCY
    # The trapezoid rule delays nothing: three rows are three rows.
    assert cause.values[0] == pytest.approx(0.03, rel=0.05)
    assert any("samples" in line and "lag by" in line for line in found.lines())
    assert found.order_stable is not None


def test_the_truth_at_its_noise_names_nothing():
    motion = true_motion(period=0.01)
    found = diagnose_strapdown(with_truth(strapdown_record(motion, seed=6), motion), rerun=False)
    assert found.verdict == "consistent"
    assert found.causes == ()


@pytest.mark.parametrize("reference", ["gravity", "truth"])
def test_signatures_are_what_the_exported_components_do(reference):
    """An effect of a small size in the compensation turns the errors as its columns say, to a few per cent."""
    case = draw_clean_block(11, 0 if reference == "gravity" else 1)
    found = inspect_record(measure_block(case))
    built = carried_evidence(found, "nominal")
    part = next(p for p in built.parts if p.scored)
    for place, value in ((SENSITIVITY, 1e-4), (SCALE, 1e-4)):
        size = len(CATALOGUE[place.effect].parameters)
        coefficients = value * np.cos(np.arange(size))
        model = GyroModel(built.model.bias, built.model.scale_misalignment, {place: tuple(coefficients)})
        after = carried_attitude(built.motion, model, found.gravity)
        change = Rotation.from_matrix(
            turned(part.pieces, built.attitude) @ turned(part.pieces, after).transpose(0, 2, 1)
        ).as_rotvec()
        block = built.blocks[built.places.index(place)]
        expected = part.columns[..., block] @ coefficients
        if reference == "truth":
            # What an effect adds to the mean at rest is taken out with it: its columns hold both.
            assert built.at_rest is not None
            bias = built.blocks[built.places.index(EffectPlace("gyro-bias", "gyro-block"))]
            expected = expected + part.columns[..., bias] @ (built.at_rest[:, block] @ coefficients)
        else:
            # Only the turn across gravity counts between rests: it moves the direction by change × up.
            assert isinstance(built.reference, Gravity)
            up = built.reference.directions(built.point[:9])
            sideways = built.reference.across(0, up)
            change = np.einsum("skp,sp->sk", sideways, np.cross(change, up[built.reference.ends[0][:, 0]]))
        assert change == pytest.approx(expected, abs=0.05 * np.abs(expected).max())


def test_the_native_fmu_gives_the_same_bits_as_the_diagnosis(tmp_path):
    """The extended compensation, exported and run by the orchestrator: the attitude of the simulation inside."""
    if usual_flavour() != "native":
        pytest.skip("nothing compiles here")
    case = draw_clean_block(11, 1)
    found = inspect_record(measure_block(case))
    built = carried_evidence(found, "nominal")
    model = GyroModel(built.model.bias, built.model.scale_misalignment, {LATENCY: (0.004,), SENSITIVITY: (1e-4,) * 9})
    inside = carried_attitude(built.motion, model, found.gravity)
    places = [LATENCY, SENSITIVITY]
    fmus = {
        "GyroCompensation": build("GyroCompensation", tmp_path, places, flavour="native"),
        "AttitudeComputer": build("AttitudeComputer", tmp_path, flavour="native"),
    }
    assert np.array_equal(inside, carried_attitude(built.motion, model, found.gravity, fmus))


def test_a_set_that_helps_shuffled_data_as_much_has_no_witness():
    """Of a clean system an effect explains no more than its shuffles do, or does not help at all."""
    found = inspect_record(strapdown_record(seed=8))
    system = carried_evidence(found, "calibrated")
    assert not all(w.supports for w in witnesses(system, [SENSITIVITY, EffectPlace("gyro-bias-drift", "gyro-block")]))


def test_effects_that_a_record_cannot_show_are_not_searched():
    """The lag of gyros turns nothing from rest to rest; a block without jitter has none."""
    found = diagnose_strapdown(strapdown_record(seed=9), rerun=False)
    hidden = {place.effect for place in found.not_seen}
    assert {"jitter", "gyro-quantisation", "lever-arm"} <= hidden
    latency = [entry for entry in found.excluded if entry["effect"] == "latency"]
    assert all(entry["above"] > 0.05 for entry in latency)


def test_classes_are_effects_whose_signatures_are_parallel():
    """A system with the same columns under two names puts them into one class."""
    found = inspect_record(strapdown_record(seed=9))
    system = carried_evidence(found, "calibrated")
    drift = EffectPlace("gyro-bias-drift", "gyro-block")
    asymmetry = EffectPlace("gyro-scale-asymmetry", "gyro-block")
    own, other = (system.blocks[system.places.index(p)] for p in (drift, asymmetry))
    parts = []
    for part in system.parts:
        columns = part.columns.copy()
        columns[..., other] = 2.0 * columns[..., own]
        parts.append(replace(part, columns=columns))
    classes = classes_of(replace(system, parts=tuple(parts)), [drift, asymmetry])
    assert classes == {drift: (asymmetry,)}


def test_least_squares_and_the_search_agree_on_a_known_error():
    """Errors made by one effect are explained by it exactly, and by no smaller set."""
    found = inspect_record(strapdown_record(seed=10))
    system = carried_evidence(found, "calibrated")
    size = 4e-3 * np.sin(np.arange(9.0))
    block = system.blocks[system.places.index(SENSITIVITY)]
    made = system.with_errors([part.columns[..., block] @ size for part in system.parts])
    assert made.refit(()).radius > 1.0
    places = seen_places(made)
    fits = smallest_sets(made, places, largest=1).fits
    assert SENSITIVITY in {place for fit in fits for place in fit.places}
    assert made.refit([SENSITIVITY]).radius == pytest.approx(0.0, abs=1e-6)
    step = made.estimate([SENSITIVITY])
    assert step[len(made.names) :] == pytest.approx(size, abs=1e-9)
    assert all(order.effects[:1] == (SENSITIVITY,) for order in order_of_effects(made, [SENSITIVITY, LATENCY]))


def test_a_hidden_effect_is_named_and_its_gain_is_measured_by_exported_fmus():
    case = draw_block_case(BlockOptions(), 1, 17)
    assert case.places == (LATENCY,)
    found = diagnose_strapdown(measure_block(case))
    assert found.verdict == "explained"
    assert [cause.place for cause in found.causes] == [LATENCY]
    assert found.gain is not None
    for gain in (found.gain, *found.gain.others):
        assert np.isfinite(gain.before).all()
        assert np.isfinite(gain.after).all()
    assert found.gain.improves


@pytest.mark.parametrize(("factor", "said"), [(1.05, "5 % too long"), (0.97, "3 % too short"), (1.0, None)])
def test_a_wrong_clock_looks_like_scale_factors_that_are_alike_and_is_said_to(factor, said):
    """Rates times wrong intervals turn the block too far about every axis alike."""
    record = measure_block(draw_clean_block(11, 3, "truth"))
    assert record.rate is not None
    found = diagnose_strapdown(replace(record, time_s=factor * record.time_s), rerun=False)
    assert [cause.place.effect for cause in found.causes] == ([] if said is None else ["gyro-scale-misalignment"])
    assert any(said in text for text in found.warnings) if said else found.warnings == ()


@pytest.mark.parametrize("index", [0, 2, 8])
def test_a_fit_of_parameters_that_no_instrument_has_is_an_objection(index):
    """Accelerometers that lag by 200 rows belong to no block: the fit of one goes beyond its parameters' limits."""
    record = measure_block(draw_clean_block(11, index))
    moved = replace(record, specific_force=np.roll(record.specific_force, 200, axis=0))
    found = diagnose_strapdown(moved, rerun=False)
    assert found.verdict == "unexplained"
    assert any("would be" in text and "check units" in text for text in found.objections)
