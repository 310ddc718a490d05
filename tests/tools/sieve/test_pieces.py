"""A wrong rest or move of a series is named, with the change that makes it fit; a consistent series costs nothing."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import trihedron as th
from diagnoses import diagnosed, flowing
from generator.carried import camera_attitude, drawn_motion, strapdown_record
from generator.wrong_pieces import OF_MOVES, OF_RESTS, hand_record, with_wrong_piece
from trihedron.models.effects import EffectPlace
from trihedron.tools.records import write_record
from trihedron.tools.records.rests import position_record_of
from trihedron.tools.trials import Hidden, draw_whole

EVERY = [("rest", what) for what in OF_RESTS] + [("move", what) for what in OF_MOVES]


def assert_named(result, wrong):
    """Assert that only this piece is wrong, and that the model fits without it."""
    assert result.verdict == "explained", str(result)
    first = result.explanations[0]
    label = f"{wrong.kind}-{wrong.number}"
    assert (first.kind, first.where, result.causes) == ("rows", (label,), ())
    assert first.radius <= 1.0
    assert first.calibration.verdict == "consistent"
    assert all(parameter.low <= parameter.high for parameter in first.calibration.parameters)
    if wrong.key:
        assert wrong.key in first.change[label]


@pytest.mark.first(1)
@pytest.mark.parametrize(("kind", "what"), [("rest", "exchanged"), ("move", "sign"), ("move", "offset")])
def test_a_wrong_piece_of_a_block_moved_by_hand_is_named(kind, what):
    wrong = with_wrong_piece(1, kind, what)
    assert_named(diagnosed(wrong.record), wrong)


@pytest.mark.acceptance
@pytest.mark.parametrize(("kind", "what"), EVERY)
def test_pieces_of_drawn_records_are_named(kind, what):
    # A lag that changes within a move does what an offset over that move does: then both are listed.
    named, least = 0, 5 if what == "offset" else 6
    for seed in range(20, 28):
        wrong = with_wrong_piece(seed, kind, what, (14, 18, 24)[seed % 3])
        result = diagnosed(wrong.record)
        label = f"{wrong.kind}-{wrong.number}"
        if result.verdict == "explained":
            assert result.explanations[0].where == (label,)
            named += 1
        elif result.explanations:
            # A law with fewer numbers stands before it.
            assert (label,) in [explanation.where for explanation in result.explanations]
    assert named >= least


@pytest.mark.acceptance
@pytest.mark.parametrize("seed", [0, 5])
def test_a_move_in_degrees_is_named_though_trials_turn_the_block_too_far(seed):
    rng = np.random.default_rng(seed)
    record, rests = hand_record(rng, 18)
    assert record.rate is not None
    rate, number = record.rate.copy(), int(rng.integers(3, 16))
    rate[rests[number - 1][1] : rests[number][0]] *= 180.0 / np.pi
    result = diagnosed(replace(record, rate=rate))
    assert result.verdict == "explained"
    assert result.explanations[0].where == (f"move-{number}",)
    assert "It fits with w1 to w3 in degrees." in result.explanations[0].sentence


@pytest.mark.acceptance
def test_a_copied_move_is_named_with_its_original():
    rng = np.random.default_rng(4)
    record, rests = hand_record(rng, 18)
    assert record.rate is not None
    rate = record.rate.copy()
    begin, end = rests[6][1], rests[7][0]
    rate[begin:end] = rate[rests[2][1] : rests[2][1] + end - begin]
    first = diagnosed(replace(record, rate=rate)).explanations[0]
    assert first.where == ("move-7",)
    assert "Its readings are those from" in first.sentence


@pytest.mark.acceptance
def test_the_size_of_an_offset_is_stated():
    rng = np.random.default_rng(5)
    record, rests = hand_record(rng, 18)
    force = record.specific_force.copy()
    force[rests[9][0] : rests[9][1], 1] += 0.4
    first = diagnosed(replace(record, specific_force=force)).explanations[0]
    assert first.where == ("rest-10",)
    assert first.change["rest-10"]["f2_g"] == pytest.approx(0.4 / 9.80665, abs=3e-3)


@pytest.mark.acceptance
def test_a_person_reads_which_piece_is_wrong_and_when(tmp_path):
    wrong = with_wrong_piece(2, "rest", "knocked")
    path = tmp_path / "hand.csv"
    write_record(wrong.record, path, 7)
    result = th.diagnose(path)
    text = flowing(result)
    assert text.startswith(f"Rest {wrong.number} (")
    assert "All other rests and moves fit." in text
    assert "measure these pieces again" in text
    assert result.report(tmp_path / "page.html").stat().st_size > 1000


@pytest.mark.acceptance
def test_two_wrong_pieces_with_large_errors_are_named_together():
    rng = np.random.default_rng(8)
    record, rests = hand_record(rng, 20)
    assert record.rate is not None
    force, rate = record.specific_force.copy(), record.rate.copy()
    OF_RESTS["exchanged"](force, rests[11], rng)
    OF_MOVES["sign"](rate, (rests[4][1], rests[5][0]), rng)
    result = diagnosed(replace(record, specific_force=force, rate=rate))
    assert result.verdict == "explained"
    assert set(result.explanations[0].where) == {"rest-12", "move-5"}


@pytest.mark.acceptance
def test_a_gyro_that_errs_in_every_move_is_no_wrong_piece(monkeypatch):
    def run_again(source, record=None, **changed):
        raise AssertionError("an effect that acts on all moves needs no further run")

    monkeypatch.setattr("trihedron.tools.evidence.evidence.Source.again", run_again)
    rng = np.random.default_rng(6)
    record, _ = hand_record(rng, 18)
    assert record.rate is not None
    rate = record.rate + 4e-3 * np.abs(record.rate)
    result = diagnosed(replace(record, rate=rate))
    assert all(explanation.kind != "rows" for explanation in result.explanations)


def test_a_consistent_record_is_not_searched(monkeypatch):
    def searched(evidence):
        raise AssertionError("a consistent record has no wrong pieces")

    monkeypatch.setattr("trihedron.tools.sieve.faults.wrong_pieces", searched)
    record, _ = hand_record(np.random.default_rng(7), 14)
    assert diagnosed(record).verdict in ("consistent", "insufficient")


def bench_record() -> tuple[Any, Any, list[tuple[int, int]]]:
    """Return a short bench record with its place, and the rows of its rests."""
    drawn = draw_whole(np.random.default_rng([5, 5]))
    bench = replace(drawn, alpha=drawn.alpha[-28:], beta=drawn.beta[-28:])
    record = bench.measured(5, None, [])
    return record, bench.place, [(rest.first, rest.last) for rest in record.rests if rest.refused is None]


@pytest.mark.acceptance
@pytest.mark.parametrize(
    ("what", "label", "words"),
    [
        ("sign", "move-5", "It fits with the sign of w2 turned."),
        pytest.param("knock", "rest-7", "f3 alone does not fit", marks=pytest.mark.acceptance),
        pytest.param("angle", "rest-7", "It fits with α smaller by 0.10", marks=pytest.mark.acceptance),
    ],
)
def test_a_wrong_piece_of_a_bench_in_motion_is_named(what, label, words):
    record, place, rests = bench_record()
    raw = record.raw
    changed = {}
    if what == "sign":
        changed["increment"] = raw.increment.copy()
        changed["increment"][rests[4][1] + 1 : rests[5][0], 1] *= -1.0
    elif what == "knock":
        changed["specific_force"] = raw.specific_force.copy()
        changed["specific_force"][rests[6][0] : rests[6][1] + 1, 2] += 3e-3
    else:
        changed["alpha"] = raw.alpha.copy()
        changed["alpha"][rests[6][0] - 1 : rests[6][1] + 2] += np.radians(0.1)
    result = diagnosed(position_record_of(replace(raw, **changed)), bench=place)
    assert (result.verdict, result.explanations[0].where) == ("explained", (label,)), str(result)
    assert words in result.explanations[0].sentence
    assert result.explanations[0].calibration.verdict == "consistent"


@pytest.mark.acceptance
def test_an_effect_of_a_bench_in_motion_is_no_wrong_piece():
    drawn = draw_whole(np.random.default_rng([5, 5]))
    bench = replace(drawn, alpha=drawn.alpha[-28:], beta=drawn.beta[-28:])
    hidden = [Hidden(EffectPlace("quadratic", "accelerometer-1"), (1.5e-4,))]
    result = diagnosed(bench.measured(5, None, hidden), bench=bench.place)
    assert {cause.effect for cause in result.causes} == {"quadratic"}
    assert all(explanation.kind != "rows" for explanation in result.explanations)


@pytest.mark.acceptance
def test_a_wrong_rest_of_a_series_without_gyros_is_called_a_rest():
    record, _, rests = bench_record()
    force = record.raw.specific_force.copy()
    force[rests[6][0] : rests[6][1] + 1, 2] += 3e-3
    result = diagnosed(position_record_of(replace(record.raw, specific_force=force)))
    first = result.explanations[0]
    assert result.verdict == "explained"
    assert first.rows == (7,)
    assert first.sentence == "The reading f3 of rest 7 does not fit; all others do."


@pytest.mark.acceptance
@pytest.mark.parametrize("what", [pytest.param("jump", marks=pytest.mark.acceptance), "offset"])
def test_no_sign_is_named_where_it_hardly_turns_the_block(what):
    rng = np.random.default_rng(1)
    motion = drawn_motion(rng, moves=16, rest=2.5)
    attitude = camera_attitude(rng, motion[3], 1e-4)
    rate = np.zeros_like(motion[1])
    if what == "offset":
        rate[3000:3120, 1] = 0.05
    else:
        turned = Rotation.from_rotvec([0.01, 0.02, 0.0]) * Rotation.from_quat(np.roll(attitude[3000:], -1, axis=1))
        attitude[3000:] = np.roll(turned.as_quat(), 1, axis=1)
    record = strapdown_record((motion[0], motion[1] + rate, motion[2]), seed=3, gyro_bias=1e-3, attitude=attitude)
    first = diagnosed(record).explanations[0]
    assert (first.kind, first.time_s is not None) == ("rows", True)
    assert not any(words in first.sentence for words in ("sign of", "exchanged", "in degrees", "halved", "doubled"))
