"""The scenarios of Trihedron give their reference results."""

import json
import math

import numpy as np
import polars as pl
import pytest
from scipy.spatial.transform import Rotation

import trihedron as th
from scenario_runs import SCENARIOS
from trihedron.tools.calibration import BenchOnEarth, calibrate
from trihedron.tools.demo import inside_intervals, true_targets
from trihedron.tools.errors import InputError
from trihedron.tools.orchestrator import read_scenario, run_scenario
from trihedron.tools.records import PositionRecord, read_record

REFERENCE = json.loads((SCENARIOS / "reference-results.json").read_text(encoding="utf-8"))
# The platforms' sin and cos may differ in the last bit; everything else is the same everywhere.
ROUNDING = 1e-11


@pytest.fixture(scope="module")
def static_run(tmp_path_factory):
    out = tmp_path_factory.mktemp("static")
    return th.simulate(SCENARIOS / "static-calibration.toml", out=out / "run").files


def test_static_calibration_gives_its_reference_results(static_run):
    record = read_record(static_run[-1], PositionRecord)
    result = calibrate(record, noise_bound=1e-5)
    reference = REFERENCE["static-calibration"]
    assert len(record.position) == reference["positions"]
    outputs = record.specific_force[[0, 11, 23]].ravel().tolist()
    assert outputs == pytest.approx(reference["readings_mps2"], abs=ROUNDING)
    assert result.radius == pytest.approx(reference["radius"], abs=1e-6)
    for estimate, expected in zip(result.parameters, reference["parameters"], strict=True):
        assert estimate.symbol == expected["symbol"]
        assert estimate.low == pytest.approx(expected["low"], abs=1e-9)
        assert estimate.high == pytest.approx(expected["high"], abs=1e-9)
        assert estimate.guaranteed_error == pytest.approx(expected["guaranteed_error"], abs=1e-9)


def test_static_calibration_holds_the_truth(static_run):
    result = calibrate(read_record(static_run[-1], PositionRecord), noise_bound=1e-5)
    truth = true_targets(read_scenario(SCENARIOS / "static-calibration.toml"))
    assert inside_intervals(result, truth) == 18
    # The truth is at the paper's bounds, not well within.
    assert max(abs(truth[s]) for s in ("X1", "X2", "X3")) == pytest.approx(3e-3)
    assert max(abs(v) for v in truth.values()) == pytest.approx(1e-2, rel=1e-3)


def test_static_calibration_gives_the_same_bytes_twice(static_run, tmp_path):
    again = th.simulate(SCENARIOS / "static-calibration.toml", out=tmp_path / "run").files
    assert [p.name for p in again] == ["run.parquet", "run.json", "positions.csv"]
    for first, second in zip(static_run, again, strict=True):
        assert first.read_bytes() == second.read_bytes()


def test_a_position_record_that_cannot_be_written_is_an_error(tmp_path, monkeypatch):
    """A run without its averages must not look like one without rests."""

    def full(_record, path):
        raise InputError(f"{path}: cannot be written (No space left on device)")

    monkeypatch.setattr("trihedron.tools.orchestrator.run.write_record", full)
    with pytest.raises(InputError, match=r"positions\.csv: cannot be written"):
        th.simulate(SCENARIOS / "static-calibration.toml", out=tmp_path / "run")


def test_table_and_attitude_computer_give_their_reference_results(tmp_path):
    files = th.simulate(SCENARIOS / "table-attitude.toml", out=tmp_path / "run").files
    run = pl.read_csv(files[0])
    names = ["q0", "q1", "q2", "q3"]
    reference = REFERENCE["table-attitude"]
    rows = run.filter(pl.col("time_s").is_in(reference["time_s"])).select(names).to_numpy()
    assert rows.ravel().tolist() == pytest.approx(np.ravel(reference["attitude"]).tolist(), abs=ROUNDING)
    computed = Rotation.from_quat(run.select(names).to_numpy(), scalar_first=True)
    true = Rotation.from_quat(run.select([f"true_{name}" for name in names]).to_numpy(), scalar_first=True)
    error = (computed.inv() * true).magnitude()
    assert run["updated"].to_list()[1:] == [True] * (run.height - 1)
    assert error.max() == pytest.approx(reference["largest_error_rad"], rel=1e-3)
    # Two samples of 10 ms through moves of 1.4 rad/s and kinks of 2.5 rad/s²: fractions of an arcsecond a move.
    assert error.max() < 1e-6


def test_the_stabilised_table_gives_its_reference_results() -> None:
    reference = REFERENCE["table-stabilised"]
    run = run_scenario(read_scenario(SCENARIOS / "table-stabilised.toml"))
    names = ["alpha_deg", "beta_deg", "q1", "q2", "q3"]
    for time, expected in zip(reference["time_s"], reference["values"], strict=True):
        row = run.table.row(round(time / 0.1), named=True)
        assert [row[name] for name in names] == pytest.approx(expected, abs=ROUNDING)
    # The Earth has turned by 0.5 degrees; the block has kept its attitude about both axes to ten arcseconds.
    last = run.table.row(-1, named=True)
    assert 2.0 * max(abs(last["q1"]), abs(last["q3"])) < math.radians(10.0 / 3600.0)
    assert abs(last["beta_deg"]) > 0.3


@pytest.mark.acceptance
def test_the_hour_of_the_whole_imu_gives_its_reference_results(tmp_path):
    """Run an hour at 200 Hz: table, both blocks and attitude computer; then its calibration."""
    run = th.simulate(SCENARIOS / "imu-calibration.toml", out=tmp_path / "run")
    reference = REFERENCE["imu-calibration"]
    assert run.table.height == reference["rows"]
    for row, expected in zip(reference["at"], reference["readings"], strict=True):
        outputs = [run.table[name][row] for name in reference["columns"]]
        assert outputs == pytest.approx(expected, abs=ROUNDING)
    bench = BenchOnEarth(math.degrees(0.973), math.degrees(0.35), encoder_bound=2.424e-6)
    result = th.calibrate(run.files[0], noise_bound=1e-5, bench=bench)
    assert result.gyros is not None
    assert result.positions == reference["positions"]
    assert result.radius == pytest.approx(reference["radius"], abs=1e-6)
    for estimate, expected in zip(result.parameters, reference["parameters"], strict=True):
        assert estimate.symbol == expected["symbol"]
        assert estimate.low == pytest.approx(expected["low"], abs=1e-9)
        assert estimate.high == pytest.approx(expected["high"], abs=1e-9)
        assert estimate.guaranteed_error == pytest.approx(expected["guaranteed_error"], abs=1e-9)
