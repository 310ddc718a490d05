"""`trihedron plan`: usable files, wrong options in one line."""

import json
import xml.etree.ElementTree as ElementTree
from pathlib import Path

import numpy as np
import polars as pl
import pytest

import trihedron as th
from planning_tasks import known_optima
from trihedron.models.bench import regressors
from trihedron.tools.calibration import calibrate, parametrise
from trihedron.tools.cli import main
from trihedron.tools.demo import inside_intervals, true_targets
from trihedron.tools.orchestrator import read_scenario
from trihedron.tools.records import PositionRecord, read_record

SCENARIOS = Path(__file__).resolve().parents[3] / "scenarios"


@pytest.mark.acceptance
def test_one_target_with_its_files(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    result, picture, page = tmp_path / "x4.json", tmp_path / "x4.svg", tmp_path / "x4.html"
    options = ["plan", "target", "X4", "--admissible", "tables", "--json", str(result)]
    options += ["--picture", str(picture), "--report", str(page)]
    assert main(options) == 0
    assert "2.054937871" in capsys.readouterr().out
    plan = json.loads(result.read_text(encoding="utf-8"))
    assert (plan["schema"], plan["target"], plan["grid_deg"]) == ("trihedron.plan/1", "X4", 1)
    assert plan["cost"] == pytest.approx(2.0549378711, abs=1e-9)
    assert 0 <= plan["gap"] < 1e-9
    table = pl.DataFrame(plan["weights"])
    weights = table["weight"].to_numpy()
    assert np.abs(weights).sum() == pytest.approx(plan["cost"], rel=1e-12)
    alpha, beta = np.radians(table["alpha_deg"].to_numpy()), np.radians(table["beta_deg"].to_numpy())
    f = regressors(alpha, beta, np.eye(3))[np.arange(len(table)), table["accelerometer"].to_numpy() - 1]
    np.testing.assert_allclose(weights @ f, np.eye(18)[3], atol=1e-12)
    assert ElementTree.fromstring(picture.read_text(encoding="utf-8")).tag.endswith("svg")
    assert "2.0549378712" in page.read_text(encoding="utf-8")
    before = result.read_bytes(), picture.read_bytes(), page.read_bytes()
    assert main(options) == 0
    assert (result.read_bytes(), picture.read_bytes(), page.read_bytes()) == before


@pytest.mark.acceptance
def test_all_targets_of_a_convention(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = tmp_path / "all.json"
    assert (
        main(["plan", "target", "--grid", "6", "--convention", "A2", "--mounting", "tripod", "--json", str(out)]) == 0
    )
    plans = json.loads(out.read_text(encoding="utf-8"))["plans"]
    assert len(plans) == 18
    assert plans[9]["target"] == "(X6+X8)/2"
    assert set(plans[0]["dual"]) == set(parametrise({"tripod": np.eye(3)}).symbols)
    assert "18 optimal plans" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ("target --grid 1 --continuum", "--grid and --continuum"),
        *((f"target --grid {step}", f"--grid {step}") for step in ("-1", "0", "0.001", "270")),
        ("target X4+1", "constant term"),
        ("target --grid 90", "cannot determine"),
        ("target --bounds -1 0.01", "--bounds -1"),
        ("target --bounds 0.1 0.6 --admissible tables", "no position"),
        ("target --picture plan.svg", "--picture"),
        ("target X5 --baseline symmetric", "symmetric baseline has no X5"),
        ("target --json same --report same", "same"),
        ("target --starts 3", "Unknown option"),
        ("check missing.csv --target X4", "Unknown option"),
        ("check missing.csv", "missing.csv"),
        ("imu --grid 1", "Unknown option"),
        ("positions 12 --grid 1", "Unknown option"),
        ("positions 12 --curve 6 8", "12 positions and --curve"),
        ("positions 12 --accuracy 7arcsec --goal levelling", "a number of positions and --accuracy"),
        ("positions", "a number of positions and --accuracy"),
        ("positions 12 --noise-bound 1e-5", "--noise-bound: goes with --goal or --accuracy"),
        ("positions 8 --latitude-deg 40", "--latitude-deg: goes with --goal gyrocompass"),
        ("positions --curve 6 8 --order tour", "--order: does not go with --curve"),
        ("positions --curve 6 8 --report r.html", "--report: does not go with --curve"),
        ("positions --curve 9 8", "--curve 9 8"),
        ("positions 12 --reserve -1", "--reserve -1"),
        ("positions 12 --resolution 0", "--resolution 0"),
        ("positions 12 --keep-out gamma:1:2", "alpha:LOW:HIGH"),
        ("positions 12 --keep-out alpha:9:2", "HIGH must be above LOW"),
        ("positions 12 --keep-out alpha:a:b", "numbers of degrees"),
        ("positions 12 --keep-out alpha:0:200 --keep-out alpha:190:365", "nothing of alpha is left"),
        (
            "positions 6 --admissible tables --starts 1 --cuts 0 --keep-out alpha:0:359 --keep-out beta:0:359",
            "leave more angles by --keep-out",
        ),
        ("positions 12 --starts 0", "--starts 0"),
        ("positions 12 --starts 99999999999999999999999", "must be from 1 to 100000"),
        ("positions 12 --extra 1001", "--extra 1001"),
        ("positions 12 --extra -1", "--extra -1"),
        ("positions 12 --seed -1", "--seed -1"),
        ("positions 12 --dwell 0", "--dwell 0"),
        ("positions 12 --detect outlier", "one reading"),
        ("positions 12 --repeat 13", "--repeat 13"),
        ("positions 4", "4 positions: must be between 5"),
        ("positions 12 --mountings identity identity", "given twice"),
        ("positions 12 --lost 1", "Unknown option: --lost"),
        ("positions 12 --against-unlisted", "Unknown option: --against-unlisted"),
        ("positions --minutes 10", "Unknown option: --minutes"),
        ("positions --accuracy 7arcsec --goal levelling --fewest minutes", "Unknown option: --fewest"),
        ("positions 8 --goal force", "--goal"),
        ("positons 8", "did you mean 'positions'"),
        ("", "write trihedron plan target"),
        ("--target X4 --target=X17 --grid 5", "write trihedron plan target X4 X17 --grid 5"),
        ("--target=-X4 --continuum", "write trihedron plan target --continuum -- -X4"),
        ("--positions 12 --reserve 0.1 --out plan12", "write trihedron plan positions 12 --reserve 0.1 --out plan12"),
        ("--curve 6 8 --starts 2", "write trihedron plan positions --curve 6 8 --starts 2"),
        ("--goal levelling --accuracy 7arcsec", "write trihedron plan positions --goal levelling --accuracy 7arcsec"),
        ("--check angles.csv --noise-bound 1e-5", "write trihedron plan check angles.csv --noise-bound 1e-5"),
        ("--imu --minutes 30 --gyro-noise 1e-5", "write trihedron plan imu --minutes 30 --gyro-noise 1e-5"),
        ("--positions 12 --lost 1", "Unknown option: --lost"),
        ("--minutes 10 --goal levelling", "Unknown option: --minutes"),
    ],
)
def test_wrong_options_are_said_in_one_line(
    options: str, message: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    with known_optima():
        assert main(["plan", *options.split()]) == 2
    captured = capsys.readouterr()
    assert captured.out == ""
    assert message in captured.err
    assert len(captured.err.strip().splitlines()) == 1
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("option", "text", "message"),
    [
        (
            "target --mounting",
            "[a]\nmatrix = [[1,0,0],[0,1,0],[0,0,1]]\n[b]\nmatrix = [[0,1,0],[0,0,1],[1,0,0]]\n",
            "2 mountings",
        ),
        ("check", "alpha_deg,beta_deg\n1,2\n", "planned_alpha_deg"),
        (
            "check",
            "planned_alpha_deg,planned_beta_deg,alpha_deg,beta_deg\n1,2,1,2\n3,4,3,1e17\n",
            "row 3, column 'beta_deg': 1e+17 is outside -1e+06 to 1e+06",
        ),
    ],
)
def test_files_that_cannot_be_used(
    option: str, text: str, message: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "given"
    path.write_text(text, encoding="utf-8")
    assert main(["plan", *option.split(), str(path)]) == 2
    assert message in capsys.readouterr().err


@pytest.fixture(scope="module")
def plan_folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("plan") / "plan"
    options = ["plan", "positions", "8", "--admissible", "tables", "--starts", "1", "--cuts", "1", "--repeat", "2"]
    options += ["--resolution", "0.05", "--keep-out", "alpha:30:40", "--dwell", "12", "--json", f"{folder}.json"]
    with known_optima():
        assert main([*options, "--out", str(folder), "--report", f"{folder}.html"]) == 0
    return folder


@pytest.mark.acceptance
def test_the_plan_that_is_written(plan_folder: Path) -> None:
    plan = json.loads((plan_folder / "plan.json").read_text(encoding="utf-8"))
    assert json.loads(Path(f"{plan_folder}.json").read_text(encoding="utf-8")) == plan
    assert Path(f"{plan_folder}.html").read_bytes() == (plan_folder / "operator.html").read_bytes()
    assert plan["schema"] == "trihedron.plan/1"
    assert len(plan["positions"]) == 8
    assert sorted(set(plan["programme"])) == list(range(1, 9))
    assert len(plan["programme"]) == 10
    assert 1.0 <= plan["lower_bound"] <= plan["worst_ratio"] < 1.3
    assert plan["lower_bound_on"].startswith("pool of ")
    ratios = [plan["costs"][name] / plan["optima"][name] for name in plan["costs"]]
    assert max(ratios) == pytest.approx(plan["worst_ratio"], rel=1e-12)
    for position in plan["positions"]:
        for name in ("alpha_deg", "beta_deg"):
            assert position[name] / 0.05 == pytest.approx(round(position[name] / 0.05), abs=1e-6)
        assert not 30 < position["alpha_deg"] % 360 < 40
    page = (plan_folder / "operator.html").read_text(encoding="utf-8")
    for column in ("α read [deg]", "β read [deg]", "remarks"):
        assert f">{column}</th>" in page
    assert page.count("_" * 10 + "</td>") >= 2 * 6, "room for both encoder readings at each position"
    assert "again no." in page
    assert "Not to be used: α between 30° and 40°" in page
    table = pl.read_csv(plan_folder / "table.csv")
    assert table["order"].to_list() == list(range(1, 11))
    assert table["dwell_s"].unique().to_list() == [12]


@pytest.mark.acceptance
def test_the_programme_runs_and_the_truth_is_inside(plan_folder: Path, tmp_path: Path) -> None:
    text = (SCENARIOS / "static-calibration.toml").read_text(encoding="utf-8")
    (tmp_path / "programme.csv").write_text((plan_folder / "programme.csv").read_text(encoding="utf-8"))
    scenario = tmp_path / "scenario.toml"
    scenario.write_text(text.replace("static-calibration-positions.csv", "programme.csv"), encoding="utf-8")
    files = th.simulate(scenario, out=tmp_path / "run").files
    record = read_record(files[-1], PositionRecord)
    assert len(record.position) == 10
    result = calibrate(record, noise_bound=1e-5)
    assert result.verdict == "consistent"
    assert inside_intervals(result, true_targets(read_scenario(scenario))) == 18


@pytest.mark.acceptance
def test_check_of_actual_angles(plan_folder: Path, tmp_path: Path) -> None:
    table = np.loadtxt(plan_folder / "angles.csv", delimiter=",", skiprows=1)
    table[:, 2] += 0.05 * (-1.0) ** np.arange(len(table))
    table[:, 3] -= 0.05
    header = "planned_alpha_deg,planned_beta_deg,alpha_deg,beta_deg"
    np.savetxt(tmp_path / "moved.csv", table, fmt="%.12g", delimiter=",", header=header, comments="")
    checks = []
    for file, noise in ((plan_folder / "angles.csv", "1e-5"), (tmp_path / "moved.csv", "1e-6")):
        options = ["--admissible", "tables", "--noise-bound", noise, "--json", str(tmp_path / "check.json")]
        with known_optima():
            assert main(["plan", "check", str(file), *options]) == 0
        checks.append(json.loads((tmp_path / "check.json").read_text(encoding="utf-8")))
    exact, moved = checks
    assert (exact["advice"], exact["largest_error_deg"]) == ("tolerable", 0.0)
    assert moved["largest_error_deg"] == pytest.approx(0.05)
    assert moved["advice"] in ("compensate", "re-solve")


@pytest.mark.acceptance
def test_positions_keep_out_of_wide_keep_outs(tmp_path: Path) -> None:
    options = ["8", "--starts", "1", "--cuts", "0", "--json", str(tmp_path / "plan.json")]
    assert main(["plan", "positions", *options, "--keep-out", "alpha:40:250", "--keep-out", "beta:100:450"]) == 0
    for position in json.loads((tmp_path / "plan.json").read_text())["positions"]:
        assert not 40.0 < position["alpha_deg"] % 360.0 < 250.0
        assert 90.0 <= position["beta_deg"] % 360.0 <= 100.0


@pytest.mark.acceptance
def test_random_order_repeats_with_its_seed(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Use two mountings, positions split over them, the random order of the seed; the same bytes twice."""
    options = ["plan", "positions", "14", "--mountings", "identity", "ry45", "--baseline", "symmetric"]
    options += ["--order", "random", "--seed", "5", "--starts", "1", "--cuts", "0"]
    texts = []
    for name in ("one", "two"):
        assert main([*options, "--out", str(tmp_path / name)]) == 0
        texts.append({path.name: path.read_bytes() for path in sorted((tmp_path / name).iterdir())})
    assert texts[0] == texts[1]
    assert {"programme-identity.csv", "programme-ry45.csv"} <= set(texts[0])
    assert "mountings identity, ry45" in capsys.readouterr().out
