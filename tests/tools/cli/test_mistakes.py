"""The answer to a mistake: one line that names it, exit status 2 or InputError, and no written file."""

from collections.abc import Callable
from pathlib import Path

import polars as pl
import pytest

import trihedron as th
from command_table import files
from trihedron.tools import cli

SCENARIOS = Path(__file__).resolve().parents[3] / "scenarios"


@pytest.fixture
def folder(tmp_path: Path, command_inputs: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Set the current folder: a record, a scenario that lacks a key, a strapdown record, a loop of links."""
    monkeypatch.chdir(tmp_path)
    for name in ("measured.csv", "strapdown.csv"):
        Path(name).write_bytes((command_inputs / name).read_bytes())
    Path("measured.toml").write_text('schema = "trihedron.scenario/1"\n[run]\nstep = 1.0\n', encoding="utf-8")
    return tmp_path


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["calibrate"], "requires an argument"),
        (["calibrate", "RECORD", "--noise-bound", "0"], "--noise-bound 0"),
        (["diagnose", "RECORD", "--noise-bound", "1e-5", "--json", "/dev/null/x.json"], "/dev/null"),
        (["simulate", "missing.toml"], "missing.toml"),
        (["hidden", "new.csv", "--seed", "-1"], "--seed -1"),
        (["hidden", "new.csv", "--clean", "--effect", "quadratic"], "--clean"),
        (["attitude", "RECORD"], "strapdown record"),
        (["diagnose", "RECORD", "--reference-bound", "5"], "--reference-bound 5: is of a strapdown record"),
        (
            ["diagnose", "strapdown.csv", "--reference-bound", "-1"],
            "--reference-bound -1: must be finite and not below 0",
        ),
        (["choose"], "attitude RECORD --compare"),
        (["plan", "positions", "12", "--lost", "1"], "--lost: plans with lost positions went: `plan check"),
        (["plan", "--positions", "12", "--minutes=30"], "--minutes: plans for minutes went: give a number"),
        (["plan", "imu", "--minutes", "1"], "--minutes 1: must be from 5 to 240"),
        (["plan", "positions", "12", "--goal", "force"], "--goal levelling and --goal gyrocompass stay"),
        (["measure", "plan", "--from", "COM3", "--baud", "9600"], "--baud: the serial port went"),
        (["calibrat"], 'Did you mean "calibrate"'),
        (["reproduce", "attitud"], 'Did you mean "attitude"'),
        (["calibrate", "r.csv", "--noise-bond", "1"], "Did you mean --noise-bound"),
        (["plan", "target", "--admissible", "tabels"], 'Did you mean "tables"'),
        (["plan", "target", "X44"], "the parameters are X1 to X18"),
        (["plan", "target", "--mounting", "tripot"], "did you mean 'tripod'"),
        (["plan", "positions", "8", "--detect", "quadratik"], "did you mean 'quadratic'"),
        (["hidden", "r.csv", "--effect", "quadratik"], "did you mean 'quadratic'"),
        (["hidden", "--suite", "quick-singel"], "did you mean 'quick-single'"),
        (["hidden", "--cases", "1", "--records", "3", "--mode", "single"], "of several there is --mode pairs or clean"),
        (["hidden", "--cases", "1", "--records", "11"], "--records 11: must be a whole number from 1 to 10"),
        (["hidden", "m.csv", "--records", "3"], "--records: is of a suite; give --cases too"),
        (
            ["hidden", "--cases", "1", "--strapdown", "--records", "3"],
            "--records: is of records of a table's positions",
        ),
        (["export", "AcelerometerBlock"], "did you mean 'AccelerometerBlock'"),
        (["export", "--effect", "quadratik accelerometer-3"], "did you mean 'quadratic accelerometer-3'"),
        (["export", "--flavour", "native", "--platform", "x86-linux"], "did you mean x86_64-linux"),
        (["new", "scenaro"], "did you mean 'scenario'"),
        (["check", "measurd.toml"], "did you mean 'measured.toml'"),
        (["calibrate", "measurd.toml", "--noise-bound", "1e-5"], "did you mean 'measured.toml'"),
        (["simulate", "measurd.toml"], "did you mean 'measured.toml'"),
        (["simulate", "measured.toml"], "run.step_s: is missing (is 'step' meant?)"),
        (["attitude", "strapdown.csv", "--algorithm", "adaptiv-degree"], "did you mean 'adaptive-degree'"),
        (["hidden", "new.parquet", "--answer", "answer.json"], "CSV"),
        (["demo", "--no-show", "--seed", "-1", "--out", "results"], "--seed -1"),
        (["demo", "--no-show", "--out", "measured.toml/results"], "measured.toml"),
        (["calibrate", "RECORD", "--json", "RECORD"], "is the record too"),
        (["diagnose", "RECORD", "--json", "../FOLDER/measured.csv"], "is the record too"),
        (["diagnose", "RECORD", "--report", "../FOLDER/measured.csv"], "a page is .html or .pdf"),
        (["diagnose", "RECORD", "--json", "x.html", "--report", "x.html"], "--report x.html: is --json too"),
        (["calibrate", "RECORD", "--about", "about.toml"], "is for a sheet; give --sheet, too"),
        (["calibrate", "RECORD", "--sheet", "x.txt"], "--sheet x.txt: a page is .html or .pdf"),
        (["hidden", "new.csv", "--answer", "new.csv"], "--answer new.csv: is the record too"),
        (["calibrate", "loop", "--json", "x.json"], "loop: no such file"),
        (["new", "scenario", "bench.csv"], "is a .toml file"),
        (["new", "record", "--positions", "3"], "there are plans of 6 to 30"),
        (["new", "record", "--positions", "-1"], "there are plans of 6 to 30"),
        (["new", "record", "missing/../r.txt"], "is a .csv file"),
    ],
    ids=lambda value: " ".join(value) if isinstance(value, list) else "",
)
def test_a_command_with_a_mistake(arguments: list[str], message: str, folder: Path, capsys):
    before = files(folder)
    Path("loop").symlink_to("loop")
    options = [a.replace("RECORD", "measured.csv").replace("FOLDER", folder.name) for a in arguments]
    assert cli.main(options) == 2
    out, err = capsys.readouterr()
    assert (out, err.count("\n")) == ("", 1)
    assert err.startswith("trihedron: ")
    assert message in err
    Path("loop").unlink()
    assert files(folder) == before


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: th.calibrate("missing.csv"), "missing.csv: no such file"),
        (lambda: th.calibrate(pl.DataFrame({"time_s": [1.0]})), "missing for a"),
        (lambda: th.plan("X44"), "X44"),
        (lambda: th.plan_positions(6, starts=0), "starts 0: must be from 1"),
        (lambda: th.inspect(th.hide(1).record.to_polars()), "a strapdown record"),
        (lambda: th.export("AccelerometerBlok"), "did you mean 'AccelerometerBlock'?"),
        (
            lambda: th.export("AccelerometerBlock", flavour="rust"),  # type: ignore[arg-type]
            "flavour should be 'python' or 'native', not 'rust'",
        ),
        (lambda: th.export("AccelerometerBlock", flavour="native", fmi=1), "fmi should be 2 or 3, not 1"),  # type: ignore[arg-type]
        (lambda: th.hide(1, baseline="symmetrc"), "baseline should be 'asymmetric' or 'symmetric'"),  # type: ignore[arg-type]
        (lambda: th.diagnose(th.hide(1).record, noise_bound=1e-5, rates="averaged"), "has no rates"),
        (lambda: th.plan("X4", bounds=(1e-3, 1e-3, 1e-3)), "bounds should be"),  # type: ignore[arg-type]
        (lambda: th.new("scenari"), "did you mean 'scenario'?"),
        (lambda: th.simulate({"run": {"step_s": 1.0}}), "fmus: is missing"),
        (lambda: th.calibrate(th.simulate(SCENARIOS / "table-attitude.toml")), "no position record"),
    ],
)
def test_a_call_with_a_mistake(call: Callable[[], object], message: str, tmp_path: Path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    with pytest.raises(th.InputError) as refused:
        call()
    assert message in str(refused.value)
    assert "\n" not in str(refused.value)
    assert list(tmp_path.iterdir()) == []
