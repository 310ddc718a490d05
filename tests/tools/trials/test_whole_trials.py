"""Whole benches with a secret: written files, refusals."""

import json

import pytest

from trihedron.tools.cli import main
from trihedron.tools.records import BenchRecord, read_record


def test_a_whole_bench_is_written_with_what_a_laboratory_knows(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    assert main(["hidden", "bench.csv", "--bench", "--clean", "--seed", "7", "--answer", "answer.json"]) == 0
    record = read_record(tmp_path / "bench.csv")
    assert isinstance(record, BenchRecord)
    assert {"latitude_deg", "azimuth_deg", "gyro_noise", "encoder_bound"} <= set(record.about)
    answer = json.loads((tmp_path / "answer.json").read_text(encoding="utf-8"))
    assert answer["hidden"] == {"effect": None}
    assert len(answer["truth"]["GyroBlock"]["scale_misalignment"]) == 9
    capsys.readouterr()


@pytest.mark.acceptance
@pytest.mark.parametrize(
    ("options", "message"),
    [
        (["--strapdown"], "--strapdown: is not of a whole bench"),
        (["--baseline", "symmetric"], "--baseline: is not of a whole bench"),
        (["--cases", "2", "--mode", "pairs"], "--mode pairs: of a whole bench there is clean and single"),
        (["--cases", "2", "--records", "3"], "--records: is not of a whole bench"),
    ],
)
def test_what_is_not_of_a_whole_bench_is_refused(options, message, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    file = [] if "--cases" in options else ["bench.csv"]
    assert main(["hidden", *file, "--bench", *options]) == 2
    assert message in capsys.readouterr().err
