"""`trihedron plan --positions`, `--curve`, `--check`: files that can be used, wrong options in one line."""

import csv
import json
from itertools import permutations
from pathlib import Path

import numpy as np
import pytest

import trihedron as th
from trihedron.tools.calibration import calibrate
from trihedron.tools.calibration.model import parametrise
from trihedron.tools.calibration.targets import convention_targets
from trihedron.tools.cli import main
from trihedron.tools.demo import inside_intervals, true_targets
from trihedron.tools.errors import InputError
from trihedron.tools.orchestrator.scenario import read_scenario
from trihedron.tools.planning.detection import detecting, distance, named_effects
from trihedron.tools.planning.measuring_order import move_times, repeated, shortest_tour, tour_duration, unwound
from trihedron.tools.planning.places import Task, allowed, freedom, task_of
from trihedron.tools.planning.request import parsed_keep_out, stored_positions
from trihedron.tools.records import PositionRecord, read_record

SCENARIOS = Path(__file__).resolve().parents[1] / "scenarios"


def task_without_optima(**options: object) -> Task:
    p = parametrise({"identity": np.eye(3)})
    known = {"bounds": (3e-3, 1e-2), "rule": "tables", "best": np.ones(18)}
    return task_of(p, convention_targets(p, "A1"), **{**known, **options})  # pyright: ignore[reportArgumentType]


@pytest.fixture(scope="module")
def plan_folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("plan") / "plan"
    options = ["plan", "--positions", "9", "--admissible", "tables", "--starts", "1", "--cuts", "2", "--repeat", "2"]
    options += ["--resolution", "0.05", "--keep-out", "alpha:30:40", "--dwell", "12", "--json", f"{folder}.json"]
    assert main([*options, "--out", str(folder), "--report", f"{folder}.html"]) == 0
    return folder


def test_the_plan_that_is_written(plan_folder: Path) -> None:
    plan = json.loads((plan_folder / "plan.json").read_text(encoding="utf-8"))
    assert json.loads(Path(f"{plan_folder}.json").read_text(encoding="utf-8")) == plan
    assert Path(f"{plan_folder}.html").read_bytes() == (plan_folder / "operator.html").read_bytes()
    assert plan["schema"] == "trihedron.plan/1"
    assert len(plan["positions"]) == 9
    assert sorted(set(plan["programme"])) == list(range(1, 10))
    assert len(plan["programme"]) == 11
    assert 1.0 <= plan["lower_bound"] <= plan["worst_ratio"] < 1.2
    assert plan["lower_bound_on"].startswith("pool of ")
    ratios = [plan["costs"][name] / plan["optima"][name] for name in plan["costs"]]
    assert max(ratios) == pytest.approx(plan["worst_ratio"], rel=1e-12)
    for one in plan["positions"]:
        for name in ("alpha_deg", "beta_deg"):
            assert one[name] / 0.05 == pytest.approx(round(one[name] / 0.05), abs=1e-6)
        assert not 30 < one["alpha_deg"] % 360 < 40
    page = (plan_folder / "operator.html").read_text(encoding="utf-8")
    assert "again no." in page
    rows = list(csv.DictReader((plan_folder / "table.csv").read_text(encoding="utf-8").splitlines()))
    assert [row["order"] for row in rows] == [str(k) for k in range(1, 12)]
    assert {row["dwell_s"] for row in rows} == {"12"}


def test_the_programme_runs_and_the_truth_is_inside(plan_folder: Path, tmp_path: Path) -> None:
    text = (SCENARIOS / "static-calibration.toml").read_text(encoding="utf-8")
    (tmp_path / "programme.csv").write_text((plan_folder / "programme.csv").read_text(encoding="utf-8"))
    scenario = tmp_path / "scenario.toml"
    scenario.write_text(text.replace("static-calibration-positions.csv", "programme.csv"), encoding="utf-8")
    files = th.simulate(scenario, out=tmp_path / "run").files
    record = read_record(files[-1], PositionRecord)
    assert len(record.position) == 11
    result = calibrate(record, noise_bound=1e-5)
    assert result.verdict == "consistent"
    assert inside_intervals(result, true_targets(read_scenario(scenario))) == 18


def test_check_of_actual_angles(plan_folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["plan", "--check", str(plan_folder / "angles.csv"), "--admissible", "tables"]) == 0
    assert "over all targets: tolerable" in capsys.readouterr().out
    lines = (plan_folder / "angles.csv").read_text(encoding="utf-8").splitlines()
    moved = [lines[0]]
    for k, line in enumerate(lines[1:]):
        a, b, *_ = map(float, line.split(","))
        moved.append(f"{a},{b},{a + 0.05 * (-1) ** k},{b - 0.05}")
    actual = tmp_path / "angles.csv"
    actual.write_text("\n".join(moved) + "\n", encoding="utf-8")
    assert main(["plan", "--check", str(actual), "--admissible", "tables", "--noise-bound", "1e-6"]) == 0
    out = capsys.readouterr().out
    assert "largest error of setting 0.05°" in out
    assert "over all targets: tolerable" not in out
    assert "over all targets:" in out


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (["--positions", "12", "--target", "X4"], "--target: does not go with --positions"),
        (["--positions", "12", "--grid", "1"], "--grid"),
        (["--positions", "12", "--curve", "6", "8"], "--positions and --curve"),
        (["--reserve", "1"], "--reserve: goes with --positions"),
        (["--positions", "12", "--noise-bound", "1e-5"], "--noise-bound: does not go with --positions"),
        (["--curve", "6", "8", "--order", "tour"], "--order: does not go with --curve"),
        (["--curve", "9", "8"], "--curve 9 8"),
        (["--positions", "12", "--reserve", "-1"], "--reserve -1"),
        (["--positions", "12", "--reserve", "nan"], "--reserve nan"),
        (["--positions", "12", "--resolution", "0"], "--resolution 0"),
        (["--positions", "12", "--keep-out", "gamma:1:2"], "alpha:LOW:HIGH"),
        (["--positions", "12", "--keep-out", "alpha:9:2"], "HIGH must be above LOW"),
        (["--positions", "12", "--keep-out", "alpha:a:b"], "numbers of degrees"),
        (["--positions", "12", "--keep-out", "alpha:0:200", "--keep-out", "alpha:190:365"], "nothing of alpha is left"),
        (
            [
                "--positions",
                "6",
                "--starts",
                "1",
                "--cuts",
                "0",
                "--keep-out",
                "alpha:0:359",
                "--keep-out",
                "beta:0:359",
            ],
            "leave more angles by --keep-out",
        ),
        (["--positions", "12", "--starts", "0"], "--starts 0"),
        (["--positions", "12", "--starts", "9" * 23], "must be from 1 to 100000"),
        (["--positions", "12", "--extra", "1001"], "--extra 1001"),
        (["--positions", "12", "--extra", "-1"], "--extra -1"),
        (["--positions", "12", "--seed", "-1"], "--seed -1"),
        (["--positions", "12", "--dwell", "0"], "--dwell 0"),
        (["--positions", "12", "--detect", "quadratik"], "did you mean 'quadratic'"),
        (["--positions", "12", "--detect", "outlier"], "one reading"),
        (["--positions", "12", "--repeat", "13"], "--repeat 13"),
        (["--positions", "4"], "--positions 4: must be between 5"),
        (["--positions", "61"], "--positions 61"),
        (["--positions", "12", "--criterion", "best"], "criterion"),
        (["--positions", "12", "--mountings", "identity", "identity"], "given twice"),
        (["--positions", "12", "--mountings", "identity", "--mounting", "tripod"], "--mounting and --mountings"),
        (["--check", "missing.csv"], "missing.csv"),
        (["--check", "missing.csv", "--report", "r.html"], "--report: does not go with --check"),
    ],
)
def test_wrong_options_are_said_in_one_line(
    options: list[str], said: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    assert main(["plan", *options]) == 2
    captured = capsys.readouterr()
    assert captured.out == ""
    assert said in captured.err
    assert len(captured.err.strip().splitlines()) == 1
    assert list(tmp_path.iterdir()) == []


def test_a_check_file_without_its_columns(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "angles.csv"
    path.write_text("alpha_deg,beta_deg\n1,2\n", encoding="utf-8")
    assert main(["plan", "--check", str(path)]) == 2
    assert "planned_alpha_deg" in capsys.readouterr().err


def test_a_check_file_with_angles_that_no_table_has(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "angles.csv"
    path.write_text("planned_alpha_deg,planned_beta_deg,alpha_deg,beta_deg\n1,2,1,2\n3,4,3,1e17\n", encoding="utf-8")
    assert main(["plan", "--check", str(path)]) == 2
    assert "row 3, column 'beta_deg': 1e+17 is outside -1e+06 to 1e+06" in capsys.readouterr().err


def test_positions_keep_out_of_wide_keep_outs(tmp_path: Path) -> None:
    options = ["--positions", "8", "--starts", "1", "--cuts", "0", "--json", str(tmp_path / "plan.json")]
    assert main(["plan", *options, "--keep-out", "alpha:40:250", "--keep-out", "beta:100:450"]) == 0
    for position in json.loads((tmp_path / "plan.json").read_text())["positions"]:
        assert not 40.0 < position["alpha_deg"] % 360.0 < 250.0
        assert 90.0 <= position["beta_deg"] % 360.0 <= 100.0


def test_keep_outs_bound_every_move() -> None:
    axis, low, high = parsed_keep_out("beta:350:370")
    assert (axis, np.degrees(low), np.degrees(high)) == (1, pytest.approx(350), pytest.approx(370))
    task = task_without_optima(keep_out={1: [(low, high)]})
    angle = np.radians([[0.0, 349.0], [0.0, 355.0], [0.0, 5.0], [0.0, 10.0], [0.0, 11.0]])
    assert allowed(task, angle).tolist() == [True, False, False, True, True]
    down, up = freedom(task, angle[[0, 3, 4]], np.radians(5.0))
    assert np.degrees(up[:, 1]) == pytest.approx([1.0, 5.0, 5.0])
    assert np.degrees(down[:, 1]) == pytest.approx([5.0, 0.0, 1.0], abs=1e-6)
    commands = unwound(angle[[0, 3, 4]], task.keep_out)
    travel = np.sort(np.degrees(commands[:, 1]))
    # No move crosses the keep-out: all commands lie on one side of every copy of it.
    assert not any(travel[0] < 350 + 360 * k + 5 < travel[-1] for k in range(-3, 3))


@pytest.mark.parametrize("count", [5, 7])
def test_the_tour_is_the_shortest_of_all_orders(count: int) -> None:
    commands = unwound(np.random.default_rng(count).uniform(0, 2 * np.pi, (count, 2)))
    times = move_times(commands, 1.0, 1.0)
    best = min(tour_duration(times, np.array(order)) for order in permutations(range(count)))
    assert tour_duration(times, shortest_tour(times)) == pytest.approx(best, abs=1e-9)


def test_a_longer_tour_is_an_order_and_better_than_chance() -> None:
    rng = np.random.default_rng(0)
    times = move_times(unwound(rng.uniform(0, 2 * np.pi, (14, 2))), 1.0, 1.0)
    order = shortest_tour(times)
    assert sorted(order) == list(range(14))
    assert tour_duration(times, order) < min(tour_duration(times, rng.permutation(14)) for _ in range(200))


def test_repeats_are_half_a_programme_apart() -> None:
    programme = repeated(np.arange(12), 4).tolist()
    assert len(programme) == 16
    twice = [row for row in range(12) if programme.count(row) == 2]
    assert len(twice) == 4
    for row in twice:
        first, second = (k for k, x in enumerate(programme) if x == row)
        assert 5 <= second - first <= 11


def test_extra_positions_show_what_the_plan_hides() -> None:
    """Near the optimal positions the quadratic term is nearly a scale asymmetry; 0.119 is the most that is possible."""
    task = task_without_optima()
    places = stored_positions(12)
    assert places is not None
    effects = named_effects(["quadratic accelerometer-3"])
    more, found = detecting(task, places, effects, 3)
    assert len(more) == 15
    assert found.before[0] < 0.05
    assert found.after[0] > 0.1
    assert found.after[0] == pytest.approx(distance(task, effects[0], more))
    assert found.most[0] == pytest.approx(0.119, abs=1e-3)
    assert len(named_effects(["quadratic"])) == 3


@pytest.mark.parametrize(
    ("name", "said"),
    [
        ("bias-drift accelerometer-1", "shows in time"),
        ("dead-zone accelerometer-1", "not linear"),
        ("axis-wobble outer-axis order 1", "imitated by the parameters"),
    ],
)
def test_effects_that_positions_cannot_show(name: str, said: str) -> None:
    places = stored_positions(12)
    assert places is not None
    with pytest.raises(InputError, match=said):
        detecting(task_without_optima(), places, named_effects([name]), 1)


@pytest.mark.acceptance
def test_random_order_repeats_with_its_seed(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Two mountings, positions split over them, the random order that the seed gives; the same bytes twice."""
    options = ["plan", "--positions", "14", "--mountings", "identity", "ry45", "--baseline", "symmetric"]
    options += ["--order", "random", "--seed", "5", "--starts", "1", "--cuts", "0"]
    texts = []
    for name in ("one", "two"):
        assert main([*options, "--out", str(tmp_path / name)]) == 0
        texts.append({path.name: path.read_bytes() for path in sorted((tmp_path / name).iterdir())})
    assert texts[0] == texts[1]
    assert {"programme-identity.csv", "programme-ry45.csv"} <= set(texts[0])
    assert "mountings identity, ry45" in capsys.readouterr().out
