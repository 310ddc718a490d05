"""Sessions of a laboratory without a table: faces and known turns, cut sections, rests of a file, a true attitude."""

from itertools import pairwise
from pathlib import Path

import numpy as np
import polars as pl
import pytest
from scipy.spatial.transform import Rotation

import trihedron as th
from by_hand import GRAVITY, NAMES, Instrument, present
from hand_sessions import NOISE, PERIOD, attitudes, ferraris, hand_moved, strapdown, truth, turning, written
from trihedron.tools.by_hand.forces import FACE_ERROR
from trihedron.tools.by_hand.moves import TURN_BIAS, TURN_ERROR
from trihedron.tools.motion.determinacy import LEAST_SD


@pytest.mark.parametrize("seed", [49, 110, 167])
def test_a_turn_about_the_vertical_is_no_rest(seed: int) -> None:
    """Accelerometers are still in it: the rests are those whose gyros are still, too."""
    _, table = ferraris(seed, FACE_ERROR, of_prior=True, error=LEAST_SD, turn_error=TURN_ERROR, turn_bias=TURN_BIAS)
    assert present(th.calibrate(table, gravity=GRAVITY).by_hand).rests == 6


def test_six_faces_and_three_turns_by_their_parts() -> None:
    instrument, table = ferraris(3)
    result = th.calibrate(table, gravity=GRAVITY)
    assert (present(result.by_hand).rests, present(result.by_hand).turns) == (6, 3)
    assert present(result.by_hand).case is not None
    known = truth(instrument)
    for symbol in ("gamma_11", "gamma_22", "gamma_33", "bias_1", "bias_2", "bias_3"):
        # The open misalignments, times the tilt of a face, are in the standard error.
        assert present(result[symbol].standard_error) < 3e-3
        assert present(result[symbol].estimate) == pytest.approx(
            known[symbol], abs=3.0 * present(result[symbol].standard_error)
        )
    for symbol in ("M11", "M22", "M33"):
        # A hand's turn is good to 2°: 0.6 % of 360°.
        assert result[symbol].estimate == pytest.approx(known[symbol], abs=4e-3)
        # All turns may be wrong alike, by 3 degrees: nothing in these readings tells.
        assert result[symbol].standard_error == pytest.approx(np.hypot(2.0, 3.0) / 360.0, rel=0.05)
    assert not result["gamma_21"].determined


def test_a_turn_in_the_wrong_sense_is_refused_in_one_line() -> None:
    _, table = ferraris(4)
    wrong = table.with_columns(part=pl.col("part").replace({"2:360": "2:-360"}))
    with pytest.raises(ValueError, match=r"turn 2 about axis 2 is -360 degrees, and its gyro reads"):
        th.calibrate(wrong, gravity=GRAVITY)
    with pytest.raises(ValueError, match="row 1, column turn"):
        th.calibrate(table.drop("part").with_columns(turn=pl.lit("once round")), gravity=GRAVITY)


@pytest.mark.acceptance
@pytest.mark.parametrize(
    ("angle", "words"),
    [
        (270, "it is not used"),
        (330, "are these right"),
        (350, "nothing tests these"),
        (370, "nothing tests these"),
        (380, "are these right"),
    ],
)
def test_turns_that_are_all_given_wrong_are_left_out_or_doubted(angle: int, words: str) -> None:
    """Nothing but the usual size of scale factor errors contradicts them: the block has no moves between rests."""
    for seed in (3, 8):
        instrument, table = ferraris(seed)
        wrong = table.with_columns(part=pl.col("part").str.replace("360", str(angle)))
        result = th.calibrate(wrong, gravity=GRAVITY)
        assert sum(words in line for line in result.warnings) == (3 if angle == 270 else 1)
        assert result.verdict == "insufficient"
        assert any("turns by 90°" in entry.close_by for entry in result.open)
        for symbol in ("M11", "M22", "M33"):
            p = result[symbol]
            assert abs(present(p.estimate) - truth(instrument)[symbol]) < 3.0 * present(p.standard_error)
    for refused in ("-360", "720"):
        with pytest.raises(ValueError, match=f"turn . about axis . is {refused} degrees, and its gyro reads"):
            th.calibrate(table.with_columns(part=pl.col("part").str.replace("360", refused)), gravity=GRAVITY)


@pytest.mark.acceptance
@pytest.mark.parametrize("seed", [15, pytest.param(16, marks=pytest.mark.acceptance)])
def test_rows_that_are_lost_under_even_stamps_are_seen_in_the_moves(seed: int) -> None:
    """All turns are read 3 % too small, and no scale factor error of usual size contradicts that."""
    instrument, table = hand_moved(seed, 18)
    kept = np.random.default_rng(seed).random(len(table)) >= 0.03
    lost = table.filter(pl.Series(kept)).with_columns(time_s=table["time_s"][: int(kept.sum())])
    result = th.calibrate(lost, gravity=GRAVITY)
    assert result.verdict == "insufficient"
    assert any("of the rows seem lost" in line for line in result.warnings)
    for symbol in MATRIX:
        off = present(result[symbol].estimate) - truth(instrument)[symbol]
        assert abs(off) < 3.5 * present(result[symbol].standard_error), symbol
    # Gaps that the stamps show lose nothing, nor do readings that are repeated.
    held = table[np.arange(len(table)) * 5 // 6].with_columns(table["time_s"])
    for right in (table, table.filter(pl.Series(kept)), held):
        assert not any("lost" in line for line in th.calibrate(right, gravity=GRAVITY).warnings)


@pytest.mark.acceptance
def test_a_clock_that_is_fast_is_named_beside_the_scale_factors_it_shows_as() -> None:
    _, table = hand_moved(15, 18)
    fast = th.calibrate(table.with_columns(pl.col("time_s") * 1.05), gravity=GRAVITY)
    assert any("runs fast by" in line and "does not tell which" in line for line in fast.warnings)
    assert not any("clock" in line for line in th.calibrate(table, gravity=GRAVITY).warnings)


@pytest.mark.acceptance
def test_known_turns_are_found_among_the_moves_where_words_tell_them() -> None:
    rng = np.random.default_rng(6)
    instrument = Instrument(6)
    instrument.sensitivity = np.zeros((3, 3))
    level = Rotation.from_euler("x", 0.0)
    stops = [level]
    for axis in range(3):
        for angle in (120.0, 240.0, 359.9):
            turn = np.zeros(3)
            turn[axis] = np.radians(angle)
            stops.append(level * Rotation.from_rotvec(turn))
    pieces = []
    for axis in range(3):
        way = stops[3 * axis : 3 * axis + 4]
        way[0] = level
        for first, second in pairwise(way):
            pieces.append(turning([first, second], 1.0, 0.01)[1])
        pieces.append(turning([level, level], 0.5, 2.0)[1])
    attitude = Rotation.concatenate([turning([level, level], 0.5, 2.0)[1], *pieces])
    table = strapdown(instrument, PERIOD * np.arange(len(attitude)), attitude, rng, NOISE)
    stated = th.calibrate(table, gravity=GRAVITY, turns="1:360,2:360,3:360")
    assert present(stated.by_hand).turns == 3
    assert present(th.calibrate(table, gravity=GRAVITY, turns="360").by_hand).turns == 3
    assert stated["M33"].estimate == pytest.approx(truth(instrument)["M33"], abs=4e-3)
    with pytest.raises(ValueError, match="no turn 4"):
        th.calibrate(table, gravity=GRAVITY, turns="1:360,2:360,3:360,1:360")


def test_turns_and_moves_over_the_end_of_a_gyros_range_are_left_out() -> None:
    """In the turn about axis 2 its gyro is at its end."""
    instrument, table = ferraris(12)
    fastest = float(present(table["w2_radps"].max()))  # type: ignore[arg-type]
    clipped = table.with_columns(pl.col("w2_radps").clip(upper_bound=0.9 * fastest))
    result = th.calibrate(clipped, gravity=GRAVITY)
    assert present(result.by_hand).turns == 2
    assert any(line.startswith("w2: ") and "turns over them are left out" in line for line in result.warnings)
    assert abs(present(result["M22"].estimate) - truth(instrument)["M22"]) < 3.0 * present(result["M22"].standard_error)
    with pytest.raises(ValueError, match=r"no turn 1 .*; w2: .* rows are saturated"):
        th.calibrate(clipped.drop("part"), gravity=GRAVITY, turns="3:360,2:360")


@pytest.mark.acceptance
def test_a_turn_that_the_moves_contradict_is_not_used() -> None:
    """The block turned by 330° about axis 3, and moves know its gyro."""
    instrument, table = hand_moved(13)
    last = float(table["time_s"][-1])
    level = Rotation.identity()
    time, attitude = turning([level, level * Rotation.from_rotvec([0.0, 0.0, np.radians(165.0)])], 2.0, 0.02)
    second = turning([attitude[-1], attitude[-1] * Rotation.from_rotvec([0.0, 0.0, np.radians(165.0)])], 2.0, 0.02)
    attitude = Rotation.concatenate([attitude, second[1]])
    time = last + PERIOD + PERIOD * np.arange(len(attitude))
    turn = strapdown(instrument, time, attitude, np.random.default_rng(13), NOISE)
    table = pl.concat([table.with_columns(turn=pl.lit("")), turn.with_columns(turn=pl.lit("3:360"))])
    alone = th.calibrate(table.drop("turn"), gravity=GRAVITY)
    result = th.calibrate(table, gravity=GRAVITY)
    assert any("turn 1: by the moves it differs by -30" in line for line in result.warnings)
    assert result["M33"].estimate == pytest.approx(alone["M33"].estimate, abs=present(alone["M33"].standard_error))
    right = table.with_columns(turn=pl.col("turn").replace({"3:360": "3:330"}))
    assert not any("turn 1" in line for line in th.calibrate(right, gravity=GRAVITY).warnings)


@pytest.mark.acceptance
@pytest.mark.parametrize(("wrong", "used"), [({"+1": "-2"}, 5), ({"+1": "-2", "+2": "-3", "+3": "-1"}, 0)])
def test_faces_that_the_readings_contradict_are_not_used(wrong: dict[str, str], used: int) -> None:
    instrument, table = ferraris(14)
    result = th.calibrate(table.with_columns(part=pl.col("part").replace(wrong)), gravity=GRAVITY)
    (line,) = [line for line in result.warnings if "points up" in line]
    assert ("none is used" in line) == (used == 0)
    assert (present(result.by_hand).case is None) == (used == 0)
    right = th.calibrate(table, gravity=GRAVITY)
    for symbol in NAMES:
        error = present(right[symbol].standard_error)
        assert abs(present(result[symbol].estimate) - truth(instrument)[symbol]) < 3.0 * error, symbol


@pytest.mark.acceptance
def test_sections_that_are_cut_together_are_separate_rests(tmp_path: Path) -> None:
    instrument, table = ferraris(7)
    cut = table.drop("part")[: 6 * 450]
    result = th.calibrate(cut, gravity=GRAVITY)
    assert present(result.by_hand).rests == 6
    assert present(result.by_hand).moves == 0
    assert any("cut there" in line for line in result.warnings)
    assert result["bias_1"].estimate == pytest.approx(truth(instrument)["bias_1"], abs=1e-3)
    cut.write_csv(tmp_path / "cut.csv")
    assert not th.check(tmp_path / "cut.csv").problems
    assert not th.inspect(cut, gravity=GRAVITY).trust.faults


@pytest.mark.acceptance
def test_rests_of_a_file_and_a_wider_limit(tmp_path: Path) -> None:
    instrument, table = hand_moved(9)
    begins = [5.0 * number + 0.3 for number in range(14)]
    rests = pl.DataFrame({"from_s": begins, "to_s": [begin + 2.4 for begin in begins]})
    result = th.calibrate(table, gravity=GRAVITY, rests=str(written(rests, tmp_path / "rests.csv")))
    assert present(result.by_hand).rests == 14
    assert present(result.by_hand).scatter_limit is None
    for symbol in NAMES:
        p = result[symbol]
        assert abs(present(p.estimate) - truth(instrument)[symbol]) < 4.0 * present(p.standard_error)
    assert present(th.calibrate(table, gravity=GRAVITY, rest_scatter=4.0).by_hand).scatter_limit == 4.0
    late = written(rests.with_columns(from_s=pl.col("from_s") + 1e4, to_s=pl.col("to_s") + 1e4), tmp_path / "late.csv")
    with pytest.raises(ValueError, match=r"rest 1 .* holds no readings; the record is from 0 to"):
        th.calibrate(table, gravity=GRAVITY, rests=str(late))
    with pytest.raises(ValueError, match="from_s, to_s"):
        th.calibrate(table, gravity=GRAVITY, rests=str(written(table, tmp_path / "table.csv")))


def filmed(seed: int, run: int, frame: Rotation, resting_s: float = 2.0) -> pl.DataFrame:
    """Return a record with a true attitude of axes that a frame turns into those of the block."""
    rng = np.random.default_rng([seed, run])
    time, attitude = turning(attitudes(rng, 20 if resting_s > 1.0 else 40), 1.2, resting_s)
    instrument = Instrument(seed)
    instrument.sensitivity = np.zeros((3, 3))
    table = strapdown(instrument, time, attitude, rng, NOISE)
    true = (attitude * frame).as_quat(scalar_first=True)
    return table.with_columns([pl.Series(f"q{number}", true[:, number]) for number in range(4)])


@pytest.mark.acceptance
def test_a_true_attitude_of_other_axes_leaves_the_gyros_in_those_of_the_accelerometers() -> None:
    """Cameras see axes that are turned by 16 degrees; two runs, each with its own, are pooled."""
    frames = [Rotation.from_rotvec(turn) for turn in ([0.1, -0.2, 0.15], [-0.2, 0.1, 0.05])]
    tables = [filmed(18, run, frame) for run, frame in enumerate(frames)]
    known = truth(Instrument(18))
    for result in (th.calibrate(tables[0], gravity=GRAVITY), th.calibrate_together(*tables, gravity=GRAVITY)):
        for symbol in [*NAMES[:6], *(f"M{row}{axis}" for row in (1, 2, 3) for axis in (1, 2, 3))]:
            p = result[symbol]
            assert abs(present(p.estimate) - known[symbol]) < 4.0 * present(p.standard_error), symbol
            assert present(p.standard_error) < 0.01


MATRIX = [f"M{row}{axis}" for row in (1, 2, 3) for axis in (1, 2, 3)]


def of_true_axes(instrument: Instrument, frame: Rotation) -> dict[str, float]:
    """Return M of an instrument in the axes of a true attitude."""
    return dict(zip(MATRIX, (instrument.gyro_matrix @ frame.as_matrix() - np.eye(3)).ravel(), strict=True))


@pytest.mark.acceptance
@pytest.mark.parametrize("seed", [18, pytest.param(19, marks=pytest.mark.acceptance)])
def test_runs_of_a_true_attitude_without_rests_are_pooled(seed: int) -> None:
    """Each run has axes of its own: M is in those of the first, or in the accelerometers' where a run shows them."""
    frames = [Rotation.from_rotvec(turn) for turn in ([0.1, -0.2, 0.15], [-0.2, 1.1, 0.05])]
    moving = [filmed(seed, run, frame, 0.1) for run, frame in enumerate(frames)]
    instrument, resting = Instrument(seed), filmed(seed, 2, Rotation.identity())
    alone = th.calibrate(moving[0], gravity=GRAVITY)
    for tables, known in (
        (moving, of_true_axes(instrument, frames[0])),
        ([*moving, resting.drop([f"q{k}" for k in range(4)])], truth(instrument)),
    ):
        result = th.calibrate_together(*tables, gravity=GRAVITY)
        assert result.warnings == []
        for symbol in MATRIX:
            p = result[symbol]
            assert abs(present(p.estimate) - known[symbol]) < 4.0 * present(p.standard_error), symbol
            assert present(p.standard_error) < 1.05 * present(alone[symbol].standard_error) + 2e-3
        for record in list(result.of_record.values())[:2]:
            biases = {p.symbol: p for p in record.parameters}
            for symbol in ("B1", "B2", "B3"):
                off = present(biases[symbol].estimate) - truth(instrument)[symbol]
                assert abs(off) < 4.0 * present(biases[symbol].standard_error), symbol
            assert abs(present(biases["L"].estimate)) < 4.0 * present(biases["L"].standard_error)
        assert "axes of its true attitude are turned by" in str(result)
    bounded = th.calibrate_together(*tables, noise_bound=2e-3, gravity=GRAVITY)
    assert all(p.possible(truth(instrument)[p.symbol]) for p in bounded.parameters if p.bounded)


@pytest.mark.acceptance
def test_a_true_attitude_tells_gyros_and_their_lag() -> None:
    rng = np.random.default_rng(11)
    instrument = Instrument(11)
    instrument.sensitivity = np.zeros((3, 3))
    time, attitude = turning(attitudes(rng, 30), 1.0, 0.5)
    table = strapdown(instrument, time, attitude, rng, NOISE)
    quaternion = attitude.as_quat(scalar_first=True)
    late = 1
    shifted = table.with_columns(
        [pl.col(f"w{axis}_radps").shift(late).fill_null(strategy="backward") for axis in (1, 2, 3)]
    )
    shifted = shifted.with_columns([pl.Series(f"q{number}", quaternion[:, number]) for number in range(4)])
    result = th.calibrate(shifted, gravity=GRAVITY)
    assert result["L"].estimate == pytest.approx(late * PERIOD, abs=1.5e-3)
    assert present(present(present(result.by_hand).gain).move_after) < 0.3 * present(
        present(present(result.by_hand).gain).move_before
    )
    assert present(present(result.by_hand).largest_move) >= present(present(result.by_hand).residual_move)
