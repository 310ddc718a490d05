"""Algorithms side by side on one record, and a gyro that is sampled less often."""

import math
from pathlib import Path

import numpy as np
import polars as pl
import pytest
from scipy.spatial.transform import Rotation

from trihedron.models.attitude_algorithms import ALGORITHMS
from trihedron.tools.cli import main
from trihedron.tools.errors import InputError
from trihedron.tools.motion.attitude import attitude_of_record
from trihedron.tools.motion.compare import compare_algorithms, sample_motion
from trihedron.tools.papers.attitude import EXACT, paper_motion
from trihedron.tools.records import StrapdownRecord

BY_NAME = {a.name: a for a in ALGORITHMS}
CHOSEN = [BY_NAME[n] for n in ("mean-rate", "two-sample-rodrigues", "panov", "panov-cut-off", "adaptive-degree")]


def harmonic_record(count: int = 401, motion: str = "2") -> StrapdownRecord:
    """A motion of Table 1 at 100 Hz as a record of exact increments, with its true attitude."""
    period = 0.01
    taken = sample_motion(paper_motion(motion, EXACT), period, count - 1)
    angle = np.vstack((np.zeros(3), taken.angles))
    true = Rotation.from_euler("YZX", angle)
    return StrapdownRecord(
        period * np.arange(count),
        None,
        np.vstack((np.zeros(3), taken.increments)),
        true.inv().apply([0.0, 9.80665, 0.0]),
        np.roll(true.as_quat(), 1, axis=-1),
        path=Path("harmonic.csv"),
    )


def test_algorithms_stand_side_by_side_with_their_errors() -> None:
    rows = compare_algorithms(harmonic_record(motion="5"), algorithms=CHOSEN).algorithms
    by_name = {row.algorithm: row for row in rows}
    assert [row.updates for row in rows] == [400, 200, 100, 0, 50]
    # 60 degrees at 1 Hz turn by more than Panov's cut-off series takes.
    assert "panov-cut-off is valid to 0.07 rad" in by_name["panov-cut-off"].refused
    errors = [by_name[a.name].maximum for a in CHOSEN if a.name != "panov-cut-off"]
    apart = [by_name[a.name].apart for a in CHOSEN if a.name != "panov-cut-off"]
    assert all(error is not None for error in errors)
    assert errors[0] > errors[2] > errors[1] > 1e3 * errors[3]  # type: ignore[operator]
    assert errors[3] < 1e-9  # type: ignore[operator]
    # The distance from the best is the error, where the best errs by nothing.
    assert apart[0] == pytest.approx(errors[0], rel=0.2)
    assert apart[3] == 0.0


def test_a_slower_gyro_is_the_same_record_with_increments_added_up() -> None:
    record = harmonic_record()
    assert record.increment is not None
    slow = attitude_of_record(record, algorithm="panov", rate_divisor=5)
    assert slow.period == pytest.approx(0.05, rel=1e-12)
    assert slow.row.tolist() == [1 + 20 * k for k in range(21)]
    np.testing.assert_allclose(slow.time_s, 0.2 * np.arange(21), rtol=0, atol=1e-12)
    added = record.increment[1:].reshape(-1, 5, 3).sum(axis=1)
    assert record.attitude is not None
    rarer = StrapdownRecord(
        record.time_s[::5],
        None,
        np.vstack((np.zeros(3), added)),
        record.specific_force[::5],
        record.attitude[::5],
        path=record.path,
    )
    np.testing.assert_allclose(slow.attitude, attitude_of_record(rarer, algorithm="panov").attitude, rtol=0, atol=1e-14)
    fast = attitude_of_record(record, algorithm="panov")
    assert fast.maximum is not None
    assert slow.maximum is not None
    # Fourth order: five times the step, about 625 times the error.
    assert 300.0 < slow.maximum / fast.maximum < 1000.0


@pytest.mark.parametrize("divisor", [0, -1, 401])
def test_a_divisor_that_leaves_no_sample_is_refused(divisor: int) -> None:
    with pytest.raises(InputError, match="--rate-divisor"):
        attitude_of_record(harmonic_record(), rate_divisor=divisor)


def test_a_turn_beyond_the_range_is_refused_by_its_row() -> None:
    record = harmonic_record()
    assert record.increment is not None
    record.increment[37] = [0.0, 0.7, 0.0]
    with pytest.raises(InputError, match=r"row 38: a turn of 0\.7 rad in one sample; two-sample-rodrigues is valid"):
        attitude_of_record(record)


def test_the_comparison_is_written_and_shown() -> None:
    found = compare_algorithms(harmonic_record(motion="5"), algorithms=CHOSEN)
    text = str(found)
    assert [line.split()[0] for line in text.splitlines()[1:]] == [a.name for a in CHOSEN]
    table = found.to_polars()
    assert table["algorithm"].to_list() == [a.name for a in CHOSEN]
    assert table["error_max_deg"][0] == pytest.approx(math.degrees(found.algorithms[0].maximum or 0.0))
    assert table["error_max_deg"][3] is None


def test_the_command_takes_an_algorithm_a_divisor_and_compares(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    record = harmonic_record(41)
    assert record.increment is not None
    columns = {"time_s": record.time_s}
    columns |= {f"dtheta{i + 1}_rad": record.increment[:, i] for i in range(3)}
    columns |= {f"f{i + 1}_mps2": record.specific_force[:, i] for i in range(3)}
    path = tmp_path / "record.csv"
    pl.DataFrame(columns).write_csv(path)
    assert main(["attitude", str(path), "--algorithm", "panov", "--rate-divisor", "2"]) == 0
    assert "50.0 Hz, algorithm panov" in capsys.readouterr().out
    assert main(["attitude", str(path), "--compare", "--out", str(tmp_path / "out")]) == 0
    shown = capsys.readouterr().out.splitlines()
    assert [line.split()[0] for line in shown[1:]] == [a.name for a in ALGORITHMS]
    assert (tmp_path / "out" / "comparison.csv").is_file()
    assert main(["attitude", str(path), "--algorithm", "panof"]) == 2
    assert "did you mean 'panov'?" in capsys.readouterr().err
