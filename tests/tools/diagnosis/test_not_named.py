"""Nothing is named if nothing is wrong, if no name is correct, or if several are."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

import trihedron as th
from diagnoses import assert_named, diagnosed, sets_of
from generator import SIGMA, G
from generator.noise import known
from generator.positions import Session, drawn_record, hidden_record, record_with
from generator.stands import Stand, random_bench, simulated
from trihedron.models.effects import EffectPlace
from trihedron.tools.records import PositionRecord

HARMONIC = EffectPlace("encoder-harmonic", "outer-axis", 2)


@pytest.mark.acceptance
@pytest.mark.parametrize(
    "options",
    [
        pytest.param({"symmetric": True}, marks=pytest.mark.acceptance),
        {"at_bound": True},
        pytest.param({"temperature": True}, marks=pytest.mark.acceptance),
    ],
    ids=str,
)
def test_nothing_is_named_on_a_clean_record(options):
    """Readings may be off by exactly σ: the radius may reach one, which is not falsified."""
    baseline = "symmetric" if "symmetric" in options else "asymmetric"
    for seed in range(3):
        result = diagnosed(drawn_record(seed, count=40, **options), baseline=baseline)
        assert (result.verdict, result.causes) == ("consistent", ())
        assert result.radius <= 1.0 + 1e-7


@pytest.mark.first(1)
@pytest.mark.parametrize("swapped", [(0, 1), (1, 2)])
def test_swapped_accelerometers_are_named_nothing(swapped):
    """The message calls them swapped; if a person denies this, nothing is named."""
    rng = np.random.default_rng(5)
    record = simulated(random_bench(rng), noise=rng.uniform(-SIGMA, SIGMA, (24, 3)))
    record.specific_force[:, swapped] = record.specific_force[:, swapped[::-1]]
    with pytest.raises(th.InputError, match="--channels 2,1,3" if swapped == (0, 1) else "--channels 1,3,2"):
        diagnosed(record)
    if swapped == (1, 2):
        with pytest.raises(th.InputError, match="is its sign, or that of an angle, reversed"):
            th.diagnose(record, noise_bound=SIGMA, channels=("1,2,3",))
        return
    result = th.diagnose(record, noise_bound=SIGMA, channels=("1,2,3",))
    assert (result.verdict, result.findings) == ("unexplained", ())
    assert any("far from an aligned bench" in warning for warning in result.warnings)


def with_added(record: PositionRecord, added: np.ndarray, accelerometer: int = 1) -> PositionRecord:
    record.specific_force[:, accelerometer - 1] += G * added
    return record


def rolled(record: PositionRecord) -> PositionRecord:
    """Return the record with the readings of other positions."""
    return replace(record, specific_force=np.roll(record.specific_force, 1, axis=0))


def doubled(record: PositionRecord) -> PositionRecord:
    """Double four readings and two angles, as hands that copied them might: no fit is found."""
    rng = np.random.default_rng(22)
    rows = rng.choice(len(record), 6, replace=False)
    force, alpha = record.specific_force.copy(), record.alpha.copy()
    force[rows[:4], rng.integers(0, 3, 4)] *= 2.0
    alpha[rows[4:]] *= 2.0
    return replace(record, specific_force=force, alpha=alpha)


def with_product(record: PositionRecord) -> PositionRecord:
    """Return a record with a product of three inputs."""
    return with_added(record, 2e-3 * np.prod(record.specific_force / G, axis=1))


def with_fifth_power(record: PositionRecord) -> PositionRecord:
    return with_added(record, 5e-3 * (record.specific_force[:, 0] / G) ** 5)


@pytest.mark.first(1)
@pytest.mark.parametrize(
    "spoilt",
    [
        *(rolled, doubled, with_fifth_power),
        pytest.param(with_product, marks=pytest.mark.acceptance),
    ],
)
def test_what_the_catalogue_lacks_is_not_given_a_name(spoilt: Callable):
    result = diagnosed(spoilt(hidden_record(5)))
    assert (result.verdict, result.causes) == ("unexplained", ())
    assert str(result).startswith("The model without effects does not explain the record")
    structure = result.to_json()["residual_structure"]
    assert all(0.0 <= entry["explained"] <= 1.0 for entry in structure)
    if spoilt is with_fifth_power:
        assert (structure[0]["accelerometer"], structure[0]["on"]) == (1, "input")


@pytest.mark.acceptance
def test_impossible_sizes_are_no_cause():
    """No accelerometer has a cubic term of 0.015 per g², though it would explain every reading."""
    place = EffectPlace("cubic", "accelerometer-1")
    size = 1.5 * place.definition.parameters[0].largest
    result = diagnosed(hidden_record(5, place, (size,)))
    assert (result.verdict, result.causes) == ("unexplained", ())


@pytest.mark.acceptance
def test_a_step_beside_a_settling_bias_is_a_break_and_not_the_three_that_look_like_it():
    """Beside a step, a drift and the temperature imitate a settling bias; a break and the settling are simpler."""
    hidden = [(EffectPlace("warm-up", "accelerometer-1"), (2e-4, 0.03))]
    hidden += [(EffectPlace("bias-step", "accelerometer-2"), (1e-4, 0.07))]
    result = diagnosed(drawn_record(1, hidden, 40, temperature=True))
    assert result.verdict == "explained"
    assert [(cause.effect, cause.where) for cause in result.causes] == [("warm-up", "accelerometer-1")]
    for parameter, truth in zip(result.causes[0].parameters, hidden[0][1], strict=True):
        assert known(parameter.low) <= truth <= known(parameter.high)
    assert "Between rows 26 and 27 the bias of accelerometer 2 changed by +9.97e-05 g" in known(result.best).sentence


def test_too_few_positions_are_insufficient_and_more_are_proposed():
    result = diagnosed(hidden_record(3).selected(np.arange(5)))
    assert (result.verdict, result.causes) == ("insufficient", ())
    assert result.next_positions


@pytest.mark.first(1)
@pytest.mark.parametrize("row", [1, -1])
def test_what_a_single_row_at_an_end_shows_is_no_step(row):
    """Only the first or the last reading is off: an outlier explains it as well, and is its name."""
    record = drawn_record(300)
    record.specific_force[row:, 2] += 20.0 * SIGMA * G
    sets = sets_of(diagnosed(record))
    assert sets[0]
    assert "bias-step" not in {place.effect for places in sets for place in places}


def with_open_senses(seed: int, fault: Callable) -> PositionRecord:
    """Return sixteen positions, each approached from any side, and a fault of the first accelerometer."""
    record = record_with(seed, {"f1": fault}, 16)
    sides = np.random.default_rng(seed).choice([-1.0, 1.0], (2, 16))
    return replace(record, temperature=None, approach_alpha=sides[0], approach_beta=sides[1])


@pytest.mark.acceptance
@pytest.mark.parametrize(
    ("seed", "fault"),
    [
        (1, lambda v: 5.0 * SIGMA * (v.hours > 0.5 * v.hours[-1])),
        (4, lambda v: 1.5e-4 * v.n[:, 0] ** 5),
        (5, lambda v: 3e-4 * v.n[:, 0] ** 5),
    ],
)
def test_no_cause_may_be_zero_where_senses_are_open(seed, fault):
    """The size pays for the wider bounds of readings with an open sense: no cause may be zero."""
    result = diagnosed(with_open_senses(seed, fault))
    assert result.verdict != "consistent"
    assert all(cause.acts for causes in result.sets for cause in causes)


@pytest.mark.acceptance
@pytest.mark.parametrize("seed", [3, pytest.param(4, marks=pytest.mark.acceptance)])
def test_a_drift_is_named_alone_where_an_open_sense_would_have_absorbed_it(seed):
    result = diagnosed(with_open_senses(seed, lambda v: 3e-4 * v.hours))
    assert_named(result, {EffectPlace("bias-drift", "accelerometer-1"): (3e-4,)})


@pytest.mark.acceptance
def test_two_harmonics_that_these_positions_cannot_tell_apart_are_ambiguous():
    """At outer angles 20 + 45 k orders 2 and 6 are one up to a phase; the proposed positions leave the correct one."""
    stand = Stand.drawn(np.random.default_rng(6))
    angles = np.radians(np.stack((np.repeat(20.0 + 45.0 * np.arange(8), 3), np.tile([25.0, 145.0, 265.0], 8))))

    def result_at(angles: np.ndarray):
        noise = np.random.default_rng(6).uniform(-SIGMA, SIGMA, (angles.shape[1], 3))
        session = Session.planned(stand, *angles)
        return diagnosed(session.record([(HARMONIC, (3e-4, 0.4))], noise))

    result, sixth = result_at(angles), EffectPlace("encoder-harmonic", "outer-axis", 6)
    assert result.verdict == "ambiguous"
    assert {HARMONIC, sixth} <= set().union(*sets_of(result))
    assert result.to_json()["alternatives"]
    proposed = np.radians([[p["alpha_deg"], p["beta_deg"]] for p in result.next_positions]).T
    settled = result_at(np.hstack((angles, proposed)))
    assert HARMONIC in set().union(*sets_of(settled))
    assert sixth not in {cause.place for cause in settled.causes}


@pytest.mark.acceptance
@pytest.mark.parametrize(
    ("place", "sizes", "symmetric"),
    [
        pytest.param(HARMONIC, (2.5e-4, 0.7), False, marks=pytest.mark.acceptance),
        (EffectPlace("quadratic", "accelerometer-2"), (-1.5e-3,), False),
        pytest.param(EffectPlace("scale-asymmetry", "accelerometer-1"), (1.5e-3,), True, marks=pytest.mark.acceptance),
    ],
    ids=lambda value: getattr(value, "title", ""),
)
def test_the_loop_is_closed(place, sizes, symmetric):
    """The effect is named; the extended FMU predicts unused positions within the noise; the targets move to the
    truth."""
    record = hidden_record(17, place, sizes, symmetric=symmetric)
    result = diagnosed(record, baseline="symmetric" if symmetric else "asymmetric", rerun=True)
    assert_named(result, {place: sizes})
    content = result.to_json()
    gain = content["gain"]
    assert gain["held_out_max_after"] < 2.0 * SIGMA < gain["held_out_max_before"]
    assert gain["held_out_rms_after"] < SIGMA < gain["held_out_rms_before"]
    assert (content["schema"], content["calibration"]["verdict"]) == ("trihedron.diagnosis/3", "falsified")
    assert 1 <= len(content["calibration"]["witness"]) <= 19
    excluded = {(entry["effect"], entry["where"], entry.get("order")) for entry in content["excluded"]}
    assert (place.effect, place.where, place.order) not in excluded
    assert {"bias-drift", "cubic"} <= {effect for effect, *_ in excluded}
    assert all(entry["above"] > 0.0 for entry in content["excluded"])


@pytest.mark.acceptance
def test_a_quadratic_term_that_passed_for_asymmetry_moves_the_targets_back():
    size = 1.5e-3
    stand = Stand.drawn(np.random.default_rng(17))
    record = hidden_record(17, EffectPlace("quadratic", "accelerometer-2"), (size,))
    moved = {entry["symbol"]: entry for entry in diagnosed(record).to_json()["targets"]}
    assert abs(moved["X9"]["before"] - moved["X9"]["after"]) == pytest.approx(size, rel=0.3)
    for symbol, truth in stand.targets().items():
        assert moved[symbol]["low"] <= truth <= moved[symbol]["high"]
