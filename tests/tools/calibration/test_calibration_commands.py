"""`trihedron calibrate` and `trihedron apply` from the command line: files, pages, refusals."""

import json
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from fmpy.ssp.ssd import read_ssv

from generator.runs import ARCSEC, PROGRAMME, Bench
from generator.stands import random_bench, simulated
from page_text import html_of
from parameter_intervals import intervals_in
from trihedron.tools import cli
from trihedron.tools.calibration import calibrate
from trihedron.tools.orchestrator import Scenario, run_scenario
from trihedron.tools.records import PositionRecord, find_rests, read_record, write_record
from trihedron.tools.reports import calibration_page

SIGMA = 1e-5


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """Return a folder with the record of a bench, p.csv, and one of few positions, few.csv."""
    rng = np.random.default_rng(3)
    measured = simulated(random_bench(rng), noise=rng.uniform(-SIGMA, SIGMA, (24, 3)))
    write_record(measured, tmp_path / "p.csv")
    write_record(measured.selected(np.arange(5)), tmp_path / "few.csv")
    monkeypatch.chdir(tmp_path)
    return tmp_path


def run(capsys, *arguments: str) -> tuple[int, str, str]:
    status = cli.main(list(arguments))
    captured = capsys.readouterr()
    return status, captured.out, captured.err


@pytest.mark.acceptance
def test_a_calibration_is_written_applied_and_leaves_a_block_without_errors(folder, capsys):
    command = ["calibrate", "p.csv", "--noise-bound", "1e-5", "--json", "c.json", "--ssv", "c.ssv"]
    status, out, _ = run(capsys, *command)
    assert status == 0
    before = re.search(r"as read wrong by up to ([\d.]+) arcsec, corrected by at most ([\d.]+)", out)
    assert before is not None
    assert float(before[1]) > 100 * float(before[2])
    content = json.loads(Path("c.json").read_text())
    assert content["provenance"]["record"] == "p.csv"
    assert re.fullmatch("[0-9a-f]{64}", content["provenance"]["record_sha256"])
    parameters = {p.name: float(p.value) for p in read_ssv("c.ssv").parameters}
    of_targets = {p["symbol"]: (p["low"], p["high"]) for p in json.loads(Path("c.json").read_text())["parameters"]}
    ends = intervals_in(Path("c.ssv"))
    assert ends["bias[2]"] == of_targets["X17"]
    assert ends["gamma_31"] == of_targets["X7+X12"]
    assert ends["scale_error_minus[3]"] == of_targets["X15"]
    assert all(ends[name][0] <= parameters[name] <= ends[name][1] for name in ends)
    assert len(ends) == 12
    estimates = {entry["symbol"]: entry["estimate"] for entry in content["parameters"]}
    assert parameters["scale_error_minus[2]"] == estimates["X10"]
    assert parameters["gamma_31"] == estimates["X7+X12"]
    status, out, _ = run(capsys, "apply", "c.json", "p.csv", "--out", "q.csv")
    assert status == 0
    assert "n1 = (f1/g " in out
    assert "guaranteed" in out
    again = calibrate(read_record(folder / "q.csv"), noise_bound=SIGMA)  # type: ignore[arg-type]
    errors = [e.estimate for e in again.parameters if e.symbol in ("X4", "X10", "X15", "X6+X8", "X16", "X18")]
    assert np.abs(np.array(errors)).max() < SIGMA
    first = Path("c.json").read_bytes(), Path("c.ssv").read_bytes(), Path("q.csv").read_bytes()
    run(capsys, *command)
    run(capsys, "apply", "c.json", "p.csv", "--out", "q.csv")
    assert first == (Path("c.json").read_bytes(), Path("c.ssv").read_bytes(), Path("q.csv").read_bytes())


def test_what_is_open_is_named_in_words_and_priors_close_it(folder, capsys):
    _, out, _ = run(capsys, "calibrate", "few.csv", "--noise-bound", "1e-5")
    assert "do not determine: " in out
    assert "bias of accelerometer 1 (X16)" in out
    assert "scale-factor error of accelerometer 2 for positive input (X9)" in out
    assert "Where to measure next" in out
    status, out, _ = run(capsys, "calibrate", "few.csv", "--noise-bound", "1e-5", "--prior", "bounds")
    assert status == 0
    assert out.startswith("Consistent")


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (
            ["calibrate", "few.csv", "--noise-bound", "1e-5", "--ssv", "c.ssv"],
            "--ssv c.ssv: the calibration lacks 'X4'",
        ),
        (["calibrate", "p.csv", "--noise-bound", "1e-5", "--ssv", "p.csv"], "--ssv p.csv: is the record too"),
        (["apply", "p.csv", "few.csv"], "p.csv: is not JSON text"),
        (["apply", "none.json", "few.csv"], "none.json: no such file"),
        (["apply", "c.json", "p.csv"], "c.json: the schema is None"),
    ],
)
def test_refusals_are_one_line_and_write_nothing(folder, capsys, arguments, message):
    Path("c.json").write_text("{}")
    before = sorted(path.name for path in folder.iterdir())
    status, _, error = run(capsys, *arguments)
    assert status == 2
    assert message in error
    assert error.count("\n") == 1
    assert sorted(path.name for path in folder.iterdir()) == before


@pytest.mark.acceptance
def test_the_page_shows_what_is_possible_jointly_what_it_bought_and_refused_rests(tmp_path):
    raw, _ = Bench(white=5e-6).run(PROGRAMME)
    rests = find_rests(raw)
    force, alpha = raw.specific_force.copy(), raw.alpha.copy()
    drifting, creeping = (slice(rests[k].first, rests[k].last + 1) for k in (5, 8))
    force[drifting, 1] += 1e-3 * np.linspace(0, 1, drifting.stop - drifting.start)
    alpha[creeping] += np.linspace(0, 60 * ARCSEC, creeping.stop - creeping.start)
    write_record(replace(raw, specific_force=force, alpha=alpha), tmp_path / "raw.csv")
    run_ = read_record(tmp_path / "raw.csv", PositionRecord)
    page = html_of(calibration_page, calibrate(run_, noise_bound=SIGMA), run_)
    for text in ("Joint uncertainty: accelerometer 3", "Levelling", "Rests that were left out", "drifts linearly"):
        assert text in page
    # The measured directions, residuals, the joint set, rests.
    assert page.count("<svg xmlns") == 1 + 1 + 4 + 1
    assert "24 rests were found, 22 are used, 2 are not." in page


def test_block_and_compensation_with_one_calibration_undo_each_other_as_fmus(folder):
    run_file = calibrate(read_record(folder / "p.csv", PositionRecord), noise_bound=SIGMA).json_text()
    Path("c.json").write_text(run_file, encoding="utf-8")
    calibrated = {"parameters_from": "c.json"}
    scenario = {
        "run": {"stop_s": 12.0, "step_s": 0.1},
        "base_folder": folder,
        "fmus": {
            "table": {"component": "TurntableMotion"},
            "block": {"component": "AccelerometerBlock", **calibrated},
            "inverse": {"component": "AccelerometerCompensation", **calibrated},
        },
        "connections": [
            {"from": "table.specific_force", "to": "block.specific_force"},
            {"from": "block.reading", "to": "inverse.reading"},
        ],
        "stimuli": [{"to": "table.command", "constant": [2.5, -4.0]}],
    }
    table = run_scenario(Scenario.model_validate(scenario)).table
    reading, force, recovered = (
        np.stack([table[f"{name}[{p}]_mps2"].to_numpy() for p in (1, 2, 3)], axis=1)
        for name in ("block.reading", "table.specific_force", "inverse.specific_force")
    )
    assert np.ptp(force, axis=0).min() > 1.0
    assert np.abs(reading - force).max() > 0.01
    np.testing.assert_allclose(recovered, force, rtol=0, atol=1e-14)
