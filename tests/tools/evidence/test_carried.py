"""Evidence of carried blocks: the linear rows and the FMUs behind them, and verdicts on simulated records."""

from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from generator.carried import strapdown_record, true_motion
from generator.turns import turned_by
from page_text import MATRIX, shown
from trihedron.fmus import build
from trihedron.models.effects import CATALOGUE, EffectPlace
from trihedron.tools.diagnosis import EffectWitness, diagnose
from trihedron.tools.diagnosis.helps import order_of_effects
from trihedron.tools.diagnosis.search import search
from trihedron.tools.evidence import Gravity, linear_evidence
from trihedron.tools.evidence.evidence import trials_in_time
from trihedron.tools.evidence.references import turned
from trihedron.tools.motion import GyroModel, carried_attitude, inspect_record
from trihedron.tools.orchestrator import fmu as orchestrator_fmu
from trihedron.tools.orchestrator import usual_flavour
from trihedron.tools.trials import Options, draw_case, draw_clean_block

LATENCY = EffectPlace("latency", "gyro-block")
SCALE = EffectPlace("gyro-scale-misalignment", "gyro-block")
SENSITIVITY = EffectPlace("gyro-g-sensitivity", "gyro-block")
BIAS = EffectPlace("gyro-bias", "gyro-block")


@cache
def simulated():
    """Return evidence of a clean record of hand-like moves between rests."""
    return linear_evidence(inspect_record(strapdown_record(seed=8)), "calibrated")


@cache
def clean(index: int, reference=None):
    """Return a clean record of the suite."""
    return draw_clean_block(11, index, reference).measured()


@pytest.fixture(scope="module")
def sensitive():
    """Return Γ of gyros that depend on gravity, and the diagnosis of their record, which a page shows."""
    return MATRIX, shown("block, explained")[0]


@pytest.mark.acceptance
def test_a_clean_block_is_consistent_and_its_parameters_are_within_their_intervals():
    gamma = np.array([[0.004, 0.0, 0.0], [0.002, -0.003, 0.0], [0.001, 0.005, 0.002]])
    result = diagnose(strapdown_record(gamma=gamma, bias_g=np.array([0.01, -0.02, 0.03])), rerun=False)
    assert (result.verdict, result.causes) == ("consistent", ())
    assert result.radius is not None
    assert result.radius < 1.0
    ends = {p.symbol: (p.low, p.high) for p in result.stated.parameters}
    for name, truth in {"gamma_11": 0.004, "gamma_32": 0.005, "bias_3": 0.03}.items():
        low, high = ends[f"accelerometer {name}"]
        assert low is not None
        assert high is not None
        assert low <= truth <= high
    assert {entry["effect"] for entry in result.excluded or ()} >= {"gyro-g-sensitivity", "gyro-bias-drift"}
    # The lag of gyros turns nothing from rest to rest; a block without jitter has none.
    assert {"jitter", "gyro-quantisation", "lever-arm"} <= {place.effect for place in result.cannot_be_seen or ()}
    assert all(entry["above"] > 0.05 for entry in result.excluded or () if entry["effect"] == "latency")
    assert "no effect is named" in " ".join(str(result).split())


@pytest.mark.acceptance
def test_sensitivity_to_gravity_is_named_with_its_size_and_gains_on_moves_that_were_not_used(sensitive):
    matrix, result = sensitive
    assert result.verdict == "explained"
    (cause,) = result.causes
    assert cause.place == SENSITIVITY
    assert np.reshape(cause.values, (3, 3)) == pytest.approx(matrix, abs=5e-4)
    for (low, high), value in zip(cause.intervals, matrix.ravel(), strict=True):
        assert low <= value <= high
    assert result.gain.over == "1 move"
    assert result.gain.held_out_rms_after < 0.5 * result.gain.held_out_rms_before


@pytest.mark.acceptance
def test_the_object_is_that_of_the_contract(sensitive):
    content = sensitive[1].to_json()
    assert (content["schema"], content["unit"]) == ("trihedron.diagnosis/3", "arcmin")
    assert content["calibration"]["verdict"] == "falsified"
    assert content["explanations"][0]["radius"] <= 1.0 < content["calibration"]["radius"]
    assert content["noise_bound_arcmin"] > 0.0
    assert set(content["gain"]) >= {f"held_out_{kind}_{at}" for kind in ("rms", "max") for at in ("before", "after")}
    assert [length["over"] for length in content["lengths"]] == ["1 move", "2 moves", "3 moves"]


def with_truth(record, motion, latency: int = 0):
    """Return a simulated record with the attitude of its motion; its gyros read this number of rows late."""
    time, rate, _ = motion
    steps = np.vstack([np.zeros(3), 0.5 * (rate[1:] + rate[:-1]) * np.diff(time)[:, None]])
    quaternion = np.roll(turned_by(steps).as_quat(), 1, axis=1)
    late = np.vstack([np.repeat(record.rate[:1], latency, axis=0), record.rate[: len(time) - latency]])
    return replace(record, attitude=quaternion, rate=late)


@pytest.mark.acceptance
def test_latency_is_named_in_samples_beside_the_true_attitude_and_nothing_where_there_is_none():
    motion = true_motion(period=0.01)
    result = diagnose(with_truth(strapdown_record(motion, seed=5), motion, latency=3), rerun=False)
    assert (result.reference, result.verdict) == ("true attitude", "explained")
    (cause,) = result.causes
    assert cause.place == LATENCY
    # The trapezoid rule adds no delay: three rows are three rows.
    assert cause.values[0] == pytest.approx(0.03, rel=0.05)
    assert "samples" in str(result)
    assert "lag by" in str(result)
    assert result.order_stable is not None
    result = diagnose(with_truth(strapdown_record(motion, seed=6), motion), rerun=False)
    assert (result.verdict, result.causes) == ("consistent", ())


@pytest.mark.first(1)
@pytest.mark.parametrize("reference", ["gravity", "truth"])
def test_signatures_are_what_the_exported_components_do(reference):
    """An effect of a small size in the compensation turns the errors by its columns, to a few per cent."""
    result = inspect_record(clean(0 if reference == "gravity" else 1))
    evidence = linear_evidence(result, "nominal")
    part = next(p for p in evidence.rows.parts if p.scored)
    for place in (SENSITIVITY, SCALE):
        coefficients = 1e-4 * np.cos(np.arange(len(CATALOGUE[place.effect].parameters)))
        model = GyroModel(evidence.gyros.bias, evidence.gyros.scale_misalignment, {place: tuple(coefficients)})
        after = turned(part.pieces, carried_attitude(evidence.motion, model, result.gravity))
        change = Rotation.from_matrix(turned(part.pieces, evidence.attitude) @ after.transpose(0, 2, 1)).as_rotvec()
        numbers = evidence.rows.numbers_of([place])
        expected = part.columns[..., numbers] @ coefficients
        if isinstance(evidence.reference, Gravity):
            # Between rests only the turn across gravity counts: it moves the direction by change × up.
            up = evidence.reference.directions(evidence.rows.point[:9])
            change = np.cross(change, up[evidence.reference.ends[0][:, 0]])
            change = np.einsum("skp,sp->sk", evidence.reference.across(0, up), change)
        else:
            # The effect's part of the mean at rest is subtracted with it: its columns hold both.
            assert evidence.at_rest is not None
            expected = expected + part.columns[..., evidence.rows.numbers_of([BIAS])] @ (
                evidence.at_rest[:, numbers] @ coefficients
            )
        assert change == pytest.approx(expected, abs=0.05 * np.abs(expected).max())


def test_the_native_fmu_gives_the_same_bits_as_the_diagnosis(tmp_path, monkeypatch):
    """The extended compensation, exported and run by the orchestrator in this process, gives the same attitude."""
    if usual_flavour() != "native":
        pytest.skip("nothing compiles here")
    result = inspect_record(clean(1))
    evidence = linear_evidence(result, "nominal")
    model = GyroModel(
        evidence.gyros.bias, evidence.gyros.scale_misalignment, {LATENCY: (0.004,), SENSITIVITY: (1e-4,) * 9}
    )
    fmus = {
        "GyroCompensation": build("GyroCompensation", tmp_path, [LATENCY, SENSITIVITY], flavour="native"),
        "AttitudeComputer": build("AttitudeComputer", tmp_path, flavour="native"),
    }
    monkeypatch.setattr(orchestrator_fmu, "Guest", None)
    inside = carried_attitude(evidence.motion, model, result.gravity)
    assert np.array_equal(inside, carried_attitude(evidence.motion, model, result.gravity, fmus))


@pytest.mark.acceptance
def test_a_set_that_helps_shuffled_data_as_much_has_no_witness():
    """For a clean record an effect explains no more than its shuffles do, or does not help at all."""
    evidence = simulated()
    fit = evidence.refit([SENSITIVITY, EffectPlace("gyro-bias-drift", "gyro-block")])
    assert any(EffectWitness.of(trial).objections for trial in trials_in_time(evidence.rows, fit))


@pytest.mark.acceptance
def test_classes_are_effects_whose_signatures_are_parallel():
    evidence = simulated()
    drift, asymmetry = (EffectPlace(f"gyro-{name}", "gyro-block") for name in ("bias-drift", "scale-asymmetry"))
    numbers, of_asymmetry = evidence.rows.numbers_of([drift]), evidence.rows.numbers_of([asymmetry])
    parts = []
    for part in evidence.rows.parts:
        columns = part.columns.copy()
        columns[..., of_asymmetry] = 2.0 * columns[..., numbers]
        parts.append(replace(part, columns=columns))
    assert replace(evidence, rows=evidence.rows.with_parts(parts)).classes.equivalents(drift) == (asymmetry,)


def test_least_squares_and_the_search_agree_on_a_known_error():
    """Errors made by one effect are explained by it exactly, and by no smaller set."""
    evidence: Any = simulated()
    size = 4e-3 * np.sin(np.arange(9.0))
    numbers = evidence.rows.numbers_of([SENSITIVITY])
    errors = [part.columns[..., numbers] @ size for part in evidence.rows.parts]
    evidence = replace(evidence, rows=evidence.rows.with_errors(errors))
    assert evidence.falsified
    assert (SENSITIVITY,) in [fit.places for fit in search(evidence).fits]
    assert evidence.refit([SENSITIVITY]).radius == pytest.approx(0.0, abs=1e-6)
    assert evidence.rows.estimate([SENSITIVITY])[len(evidence.rows.names) :] == pytest.approx(size, abs=1e-9)
    for k in evidence.rows.scored:
        assert order_of_effects(evidence.rows.select(k), [SENSITIVITY, LATENCY]).steps[0].place == SENSITIVITY


@pytest.mark.acceptance
@pytest.mark.parametrize(
    ("factor", "doubt"),
    [(1.05, "5 % too long"), pytest.param(0.97, "3 % too short", marks=pytest.mark.acceptance), (1.0, None)],
)
def test_a_wrong_clock_looks_like_scale_factors_that_are_alike_and_is_said_to(factor, doubt):
    """Rates times wrong intervals turn the block too far about every axis alike."""
    record = clean(3, "truth")
    result = diagnose(replace(record, time_s=factor * record.time_s), rerun=False)
    assert [cause.place for cause in result.causes] == ([] if doubt is None else [SCALE])
    assert any(doubt in text for text in result.warnings) if doubt else result.warnings == ()


@pytest.mark.acceptance
@pytest.mark.parametrize("index", [0, pytest.param(8, marks=pytest.mark.acceptance)])
def test_a_fit_of_parameters_that_no_instrument_has_is_an_objection(index):
    """Accelerometers that lag by 200 rows belong to no block: the fit of one exceeds its parameters' limits."""
    record = clean(index)
    result = diagnose(replace(record, specific_force=np.roll(record.specific_force, 200, axis=0)), rerun=False)
    assert result.verdict == "unexplained"
    assert any("would be" in text and "check units" in text for text in result.not_named or ())


@pytest.mark.acceptance
def test_a_hidden_effect_is_named_and_its_gain_is_measured_by_exported_fmus():
    drawn = (draw_case(Options(strapdown=True), 1, index) for index in range(200))
    case = next(case for case in drawn if case.places == (LATENCY,))
    result = diagnose(case.measured())
    assert result.verdict == "explained"
    assert [cause.place for cause in result.causes] == [LATENCY]
    assert result.gain is not None
    for gain in (result.gain, *(result.gain.others or ())):
        assert np.isfinite(gain.before).all()
        assert np.isfinite(gain.after).all()
    assert result.gain.improves
