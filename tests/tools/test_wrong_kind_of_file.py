"""A file of another kind than a command reads: the message names the kind, and the command that reads it."""

import json
from pathlib import Path

import numpy as np
import pytest

import trihedron as th
from generator.stands import random_bench, simulated
from trihedron.tools import cli
from trihedron.tools.records import write_record

SIGMA = 1e-5


@pytest.fixture(scope="module")
def files(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    """Return a file of each kind, by its kind."""
    folder = tmp_path_factory.mktemp("kinds")
    rng = np.random.default_rng(11)
    record = simulated(random_bench(rng), noise=rng.uniform(-SIGMA, SIGMA, (24, 3)))
    paths = {"record": folder / "record.csv"}
    write_record(record, paths["record"])
    for kind in ("scenario", "campaign"):
        paths[kind] = folder / f"{kind}.toml"
    assert cli.main(["new", "scenario", str(paths["scenario"]), "-q"]) == 0
    paths["campaign"].write_text('schema = "trihedron.campaign/1"\nrepeats = 2\n[calibration]\nnoise_bound = 1e-5\n')
    paths["mapping"] = folder / "mapping.toml"
    paths["mapping"].write_text('# what a file means\nschema = "trihedron.mapping/1"\n')
    calibration = th.calibrate(record, noise_bound=SIGMA)
    paths["calibration"] = folder / "calibration.json"
    paths["calibration"].write_text(calibration.json_text())
    paths["run"] = folder / "run.json"
    paths["run"].write_text(json.dumps({"schema": "trihedron.run/1", "scenario": {"schema": "trihedron.scenario/1"}}))
    paths["noise"] = folder / "noise.json"
    paths["noise"].write_text(json.dumps({"schema": "trihedron.noise/1", "version": "0"}))
    return paths


SAID = {
    "record": "this is a record: did you mean `trihedron calibrate {file}`",
    "scenario": "this is a scenario: did you mean `trihedron simulate {file}`?",
    "campaign": "this is a campaign: did you mean `trihedron campaign {file}`?",
    "mapping": "this is a mapping: did you mean `trihedron import FILE --mapping {file}`?",
    "calibration": "this is a calibration: did you mean `trihedron apply {file} RECORD`?",
    "run": "this is the account of a run",
    "noise": "this is a result of another command (noise): give the file that it was made from",
}
READERS = {
    "calibrate": (["calibrate", "{file}", "--noise-bound", "1e-5"], ("record",)),
    "diagnose": (["diagnose", "{file}", "--noise-bound", "1e-5"], ("record",)),
    "inspect": (["inspect", "{file}"], ("record",)),
    "attitude": (["attitude", "{file}"], ("record",)),
    "simulate": (["simulate", "{file}", "--out", "new"], ("scenario",)),
    "campaign": (["campaign", "{file}", "--out", "new"], ("campaign",)),
    "import": (["import", "{file}", "--out", "new.csv"], ("record",)),
    "mapping": (["import", "{table}", "--mapping", "{file}", "--out", "new.csv"], ("mapping",)),
    "compare": (["compare", "{record}", "{file}"], ("record",)),
    "mounting": (["plan", "positions", "8", "--mounting", "{file}"], ()),
    "effects": (["hidden", "new.csv", "--effects-from", "{file}"], ()),
    "plan": (["plan", "check", "{file}"], ("record",)),
}


@pytest.mark.parametrize("kind", SAID)
@pytest.mark.parametrize("reader", READERS)
def test_a_file_of_another_kind_is_named_with_its_command(
    reader: str, kind: str, files: dict[str, Path], tmp_path: Path, monkeypatch, capsys
) -> None:
    words, right = READERS[reader]
    if kind in right:
        pytest.skip("that is what it reads")
    monkeypatch.chdir(tmp_path)
    file = files[kind]
    assert cli.main([word.format(file=file, record=files["record"], table="table.csv") for word in words]) == 2
    message = capsys.readouterr().err
    assert message.startswith("trihedron: ")
    assert message.count("\n") == 1
    assert SAID[kind].format(file=file) in message
    assert list(tmp_path.iterdir()) == []


def test_a_record_in_place_of_a_result_is_named(files: dict[str, Path], tmp_path: Path, capsys) -> None:
    second = tmp_path / "second.csv"
    second.write_bytes(files["record"].read_bytes())
    assert cli.main(["apply", str(files["record"]), str(second), "--out", str(tmp_path / "new.csv")]) == 2
    assert "is not JSON text; this is a record" in capsys.readouterr().err


@pytest.mark.parametrize("kind", ["scenario", "calibration", "run"])
def test_another_file_in_place_of_a_noise_result_is_named(kind: str, files: dict[str, Path], capsys) -> None:
    assert cli.main(["calibrate", str(files["record"]), "--noise", str(files[kind])]) == 2
    message = capsys.readouterr().err
    assert message.count("\n") == 1
    words = "is not a result of `trihedron noise`" if files[kind].suffix == ".json" else SAID[kind]
    assert words.format(file=files[kind]) in message


def test_a_file_that_tells_no_kind_is_refused_as_before(tmp_path: Path, capsys) -> None:
    (tmp_path / "notes.toml").write_text("a = 1\n")
    assert cli.main(["simulate", str(tmp_path / "notes.toml")]) == 2
    message = capsys.readouterr().err
    assert "schema is missing" in message
    assert "this is" not in message
