"""A record as FMPy's input: FMPy alone gives the numbers of the orchestrator."""

import re
from pathlib import Path

import fmpy
import numpy as np
import polars as pl
import pytest
from fmpy.util import read_csv

import trihedron as th
from trihedron.tools import cli
from trihedron.tools.errors import InputError
from trihedron.tools.exporting import write_fmpy_input
from trihedron.tools.records import StrapdownRecord, read_record
from trihedron.tools.rounding import upwards

PERIOD = 0.01


@pytest.fixture
def strapdown(tmp_path: Path) -> Path:
    """A strapdown record whose attitude is known at its third row."""
    rng = np.random.default_rng(5)
    count = 200
    columns = {"time_s": 2.0 + PERIOD * np.arange(count)}
    columns |= {f"w{i}_radps": rng.uniform(-1.0, 1.0, count) for i in (1, 2, 3)}
    columns |= {"f1_mps2": np.zeros(count), "f2_mps2": np.zeros(count), "f3_mps2": np.full(count, 9.80665)}
    truth = [[None] * 2 + [value] + [None] * (count - 3) for value in (0.6, 0.0, 0.8, 0.0)]
    columns |= {f"q{i}": values for i, values in enumerate(truth)}
    path = tmp_path / "motion.csv"
    pl.DataFrame(columns).write_csv(path)
    return path


def test_fmpy_gives_the_attitude_of_the_orchestrator(strapdown: Path, tmp_path: Path, fmu_folder: Path) -> None:
    inputs = write_fmpy_input(strapdown, tmp_path / "input.csv")
    result = fmpy.simulate_fmu(
        str(fmu_folder / "AttitudeComputer.fmu"),
        stop_time=inputs.stop,
        output_interval=inputs.step,
        input=read_csv(tmp_path / "input.csv"),
        start_values=inputs.start_values,
    )
    record = read_record(strapdown)
    assert isinstance(record, StrapdownRecord)
    run = th.attitude_of_record(record)
    updated = result["updated"] != 0
    attitude = np.column_stack([result[f"attitude[{i}]"] for i in (1, 2, 3, 4)])[updated]
    assert len(attitude) == 99
    assert (attitude == run.attitude).all()


@pytest.mark.acceptance
def test_increments_of_velocity_are_inputs_of_the_velocity_computer(tmp_path: Path, fmu_folder: Path) -> None:
    """Test a Parquet file; `check` names its columns."""
    rng = np.random.default_rng(8)
    columns = {"time_s": PERIOD * np.arange(60)}
    columns |= {f"dtheta{i}_rad": rng.uniform(-0.01, 0.01, 60) for i in (1, 2, 3)}
    columns |= {f"dv{i}_mps": rng.uniform(-0.01, 0.01, 60) + 0.1 * (i == 3) for i in (1, 2, 3)}
    pl.DataFrame(columns).write_parquet(tmp_path / "motion.parquet")
    assert th.check(tmp_path / "motion.parquet").summary == (f"60 rows, columns {', '.join(columns)}",)
    inputs = write_fmpy_input(tmp_path / "motion.parquet", tmp_path / "input.csv")
    assert inputs.component == "VelocityComputer"
    result = fmpy.simulate_fmu(
        str(fmu_folder / "VelocityComputer.fmu"),
        stop_time=inputs.stop,
        output_interval=inputs.step,
        input=read_csv(tmp_path / "input.csv"),
        start_values=inputs.start_values,
    )
    record = read_record(tmp_path / "motion.parquet")
    assert isinstance(record, StrapdownRecord)
    run = th.attitude_of_record(record)
    velocity = np.column_stack([result[f"velocity[{i}]"] for i in (1, 2, 3)])[result["updated"] != 0]
    assert run.velocity is not None
    assert (velocity == run.velocity).all()


def test_fmpy_compensates_readings_as_the_orchestrator_does(tmp_path: Path, fmu_folder: Path) -> None:
    rng = np.random.default_rng(6)
    force = rng.uniform(-9.0, 9.0, (50, 3))
    force *= 9.80665 / np.linalg.norm(force, axis=1, keepdims=True)
    columns = {"time_s": 0.1 * np.arange(50), "alpha_deg": np.full(50, 10.0), "beta_deg": np.full(50, 20.0)}
    columns |= {f"f{i + 1}_mps2": force[:, i] for i in range(3)}
    pl.DataFrame(columns).write_csv(tmp_path / "raw.csv")
    inputs = write_fmpy_input(tmp_path / "raw.csv", tmp_path / "input.csv")
    parameters = {"bias[1]": 1e-3, "scale_error_plus[3]": 2e-3, "gamma_21": 5e-3}
    result = fmpy.simulate_fmu(
        str(fmu_folder / "AccelerometerCompensation.fmu"),
        stop_time=inputs.stop,
        output_interval=inputs.step,
        input=read_csv(tmp_path / "input.csv"),
        start_values=parameters,
    )
    run = th.simulate(
        {
            "base_folder": tmp_path,
            "run": {"stop_s": inputs.stop, "step_s": inputs.step},
            "fmus": {"c": {"component": "AccelerometerCompensation", "parameters": parameters}},
            "stimuli": [
                {"csv": "raw.csv", "columns": {f"c.reading[{i}]": f"f{i}_mps2" for i in (1, 2, 3)}},
            ],
        }
    )
    for i in (1, 2, 3):
        assert result[f"specific_force[{i}]"].tolist() == run[f"c.specific_force[{i}]_mps2"].to_list()


def test_the_command_says_how_fmpy_runs_it(strapdown: Path, tmp_path: Path, capsys) -> None:
    out = tmp_path / "in.csv"
    assert cli.main(["fmpy-input", "--help"]) == 0
    assert "\n  trihedron fmpy-input" in capsys.readouterr().out
    assert cli.main(["fmpy-input", str(strapdown), "--out", str(out)]) == 0
    message, complaint = capsys.readouterr()
    # 197 increments, two a step
    assert "the last row does not complete a step of two-sample-rodrigues" in complaint
    assert "ends at 1.96 s" in complaint
    assert message.startswith(
        f"fmpy simulate AttitudeComputer.fmu --input-file {out} --stop-time 1.97 --output-interval 0.01"
    )
    assert "initial_attitude[1]' 0.6" in message
    assert pl.read_csv(out).columns == ["time", "increment[1]", "increment[2]", "increment[3]"]


def test_a_gap_is_bridged_and_a_limit_is_said_as_by_attitude(strapdown: Path, tmp_path: Path, capsys) -> None:
    """The increments are the orchestrator's, with the same bound and the same moment in the run's own time."""
    table = pl.read_csv(strapdown)
    rate = np.clip(np.sin(0.05 * np.arange(200.0)), -0.8, 0.8)
    table = table.with_columns(w1_radps=pl.Series(rate), w2_radps=0.0 * pl.col("w2_radps") + 0.1, w3_radps=pl.lit(0.2))
    path, out = tmp_path / "gap.csv", tmp_path / "in.csv"
    pl.concat([table[:8], table[10:]]).write_csv(path)
    with pytest.raises(InputError, match="bridge it, with a bound of the error: --bridge-gaps 2"):
        write_fmpy_input(path, out)
    inputs = write_fmpy_input(path, out, bridge_gaps=2)
    record = read_record(path)
    assert isinstance(record, StrapdownRecord)
    run = th.attitude_of_record(record, algorithm="mean-rate", bridge_gaps=2)
    assert inputs.bridged_bound == run.bridged_bound > 0.0
    assert len(pl.read_csv(out)) == 197
    assert run.trusted_until is not None
    assert inputs.trusted_until == pytest.approx(run.trusted_until - run.time_s[0])
    assert inputs.warnings[:-1] == run.warnings != ()
    assert cli.main(["fmpy-input", str(path), "--bridge-gaps", "2", "--out", str(out)]) == 2
    message = capsys.readouterr()
    assert message.out.startswith("fmpy simulate AttitudeComputer.fmu")
    assert re.search(r"gap\.csv: attitudes after 0\.160* s of the run are not to be trusted; bridged gaps", message.err)
    assert f"at most {upwards(np.degrees(inputs.bridged_bound), 3)} deg; w1: " in message.err


def test_a_limit_of_a_table_s_readings_is_said(tmp_path: Path, capsys) -> None:
    time = 0.1 * np.arange(400)
    force = np.clip(9.8 * np.sin(0.2 * time[:, None] + [0.0, 1.0, 2.0]), -8.0, 20.0)
    columns = {"time_s": time, "alpha_deg": np.full(400, 10.0), "beta_deg": np.full(400, 20.0)}
    columns |= {f"f{i + 1}_mps2": force[:, i] for i in range(3)}
    pl.DataFrame(columns).write_csv(tmp_path / "raw.csv")
    inputs = write_fmpy_input(tmp_path / "raw.csv", tmp_path / "in.csv")
    assert [line[:3] for line in inputs.warnings] == ["f1:", "f2:", "f3:"]
    assert cli.main(["fmpy-input", str(tmp_path / "raw.csv"), "--out", str(tmp_path / "in.csv")]) == 0
    assert "raw.csv: f1: " in capsys.readouterr().err
    with pytest.raises(InputError, match="--bridge-gaps 1: is of a strapdown record"):
        write_fmpy_input(tmp_path / "raw.csv", tmp_path / "in.csv", bridge_gaps=1)


def test_records_that_have_no_steps_are_refused(tmp_path: Path) -> None:
    (tmp_path / "p.csv").write_text("position,time_s,alpha_deg,beta_deg,f1_mps2,f2_mps2,f3_mps2\n1,1,0,0,0,0,9.8\n")
    with pytest.raises(InputError, match=r"p\.csv: is a position record, which has no steps"):
        write_fmpy_input(tmp_path / "p.csv", tmp_path / "out.csv")
    rows = [f"{t},10,20,0,0,9.8" for t in (0.0, 0.1, 0.25, 0.3)]
    (tmp_path / "r.csv").write_text("\n".join(["time_s,alpha_deg,beta_deg,f1_mps2,f2_mps2,f3_mps2", *rows, ""]))
    with pytest.raises(InputError, match=r"r\.csv, row 4: is 0\.5 rows off a uniform sampling of 0\.1 s"):
        write_fmpy_input(tmp_path / "r.csv", tmp_path / "out.csv")
