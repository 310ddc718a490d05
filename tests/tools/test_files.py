"""One reader reads every file named to a command or in another file: no devices, no giants."""

import errno
import os
import re
from pathlib import Path
from typing import Any

import numpy as np
import polars as pl
import pytest

import trihedron
from trihedron.tools import cli
from trihedron.tools.errors import InputError
from trihedron.tools.files import (
    LARGEST,
    LARGEST_TEXT,
    MOST_NUMBERS,
    bytes_of,
    fault_of_parquet,
    together,
    whole_folder,
    write_text,
)
from trihedron.tools.records import POSITION

SCENARIO = """schema = "trihedron.scenario/1"
[run]
step_s = 0.1
stop_s = 1.0
[fmus.block]
component = "AccelerometerBlock"
{block}
{stimulus}
"""
CAMPAIGN = """schema = "trihedron.campaign/1"
repeats = 2
[{kind}]
{setting}
"""
NAMED: dict[str, tuple[str, str]] = {
    "a stimulus": ("scenario", '[[stimuli]]\ncsv = "{file}"\ncolumns = {{"block.specific_force[1]" = "a_mps2"}}'),
    "a programme": ("scenario", '[[stimuli]]\nto = "block.specific_force"\nprogramme = "{file}"\ndwell_s = 1.0'),
    "parameters of a calibration": ("scenario", 'block parameters_from = "{file}"'),
    "an FMU": ("scenario", 'foreign fmu = "{file}"'),
    "the scenario of a campaign": ("campaign simulation", 'scenario = "{file}"'),
    "the positions of a campaign": ("campaign calibration", 'noise_bound = 1e-5\npositions = "{file}"'),
}
GIVEN: dict[str, list[str]] = {
    "calibrate": ["calibrate", "{file}"],
    "diagnose": ["diagnose", "{file}"],
    "inspect": ["inspect", "{file}"],
    "attitude": ["attitude", "{file}"],
    "check": ["check", "{file}"],
    "fmpy-input": ["fmpy-input", "{file}", "--out", "x.csv"],
    "apply": ["apply", "{file}", "few.csv"],
    "simulate": ["simulate", "{file}"],
    "campaign": ["campaign", "{file}"],
    "--effects-from": ["hidden", "new.csv", "--effects-from", "{file}"],
    "--mounting": ["plan", "positions", "8", "--mounting", "{file}"],
}


def as_written(where: str, text: str, file: str, folder: Path) -> list[str]:
    """Return the command that reads a file which names `file`."""
    text = text.format(file=file)
    if where == "scenario":
        if text.startswith("foreign "):
            written = SCENARIO.format(block="[fmus.other]\n" + text.removeprefix("foreign "), stimulus="")
        elif text.startswith("block "):
            written = SCENARIO.format(block=text.removeprefix("block "), stimulus="")
        else:
            written = SCENARIO.format(block="", stimulus=text)
        (folder / "s.toml").write_text(written)
        return ["simulate", str(folder / "s.toml"), "--out", str(folder / "out")]
    kind = where.split()[1]
    (folder / "c.toml").write_text(CAMPAIGN.format(kind=kind, setting=text))
    return ["campaign", str(folder / "c.toml"), "--out", str(folder / "out")]


def command(name: str, file: Path, folder: Path) -> list[str]:
    """Return the command that is given the file, or a file that names it."""
    if name in NAMED:
        return as_written(*NAMED[name], str(file), folder)
    return [part.format(file=file) for part in GIVEN[name]]


def refusal(name: str, file: Path, folder: Path, capsys: pytest.CaptureFixture[str]) -> str:
    """Return the one line of its refusal; assert that nothing is written."""
    before = {path.name for path in folder.iterdir()}
    assert cli.main(command(name, file, folder)) == 2
    output = capsys.readouterr().err
    assert output.count("\n") == 1, output
    assert {path.name for path in folder.iterdir()} <= before | {"s.toml", "c.toml"}
    return output


@pytest.fixture
def giant(tmp_path: Path) -> Path:
    """Make a sparse file larger than any that is read."""
    path = tmp_path / "giant"
    with path.open("wb") as file:
        file.truncate(LARGEST + 1)
    return path


@pytest.mark.parametrize("name", [*NAMED, *GIVEN])
def test_what_has_no_end_is_refused_wherever_it_is_named(
    name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """Use a link to a device, and a pipe into which nobody writes."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "zero").symlink_to("/dev/zero")
    os.mkfifo(tmp_path / "pipe")
    for kind in ("zero", "pipe"):
        assert f"{kind}: is not a regular file; " in refusal(name, tmp_path / kind, tmp_path, capsys)


@pytest.mark.parametrize("name", [*NAMED, *GIVEN])
def test_what_is_too_large_is_refused_before_it_is_read(
    name: str, giant: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(giant.parent)
    output = refusal(name, giant, giant.parent, capsys)
    assert re.search(r"giant: is larger than (2 GiB|(1|16|256) MiB); not read", output), output


def test_the_limit_is_the_largest_that_is_read(tmp_path: Path) -> None:
    path = tmp_path / "file"
    path.write_bytes(bytes(100))
    assert bytes_of(path, most=100) == bytes(100)
    with pytest.raises(InputError, match="is larger than"):
        bytes_of(path, most=99)
    assert LARGEST_TEXT < LARGEST


@pytest.mark.acceptance
def test_a_small_file_of_too_many_rows_is_refused_before_they_are_unpacked(tmp_path: Path, capsys) -> None:
    """Parquet packs similar rows into next to nothing."""
    path = tmp_path / "packed.parquet"
    pl.DataFrame({"alpha_deg": pl.repeat(True, MOST_NUMBERS + 1, eager=True)}).write_parquet(path)
    assert path.stat().st_size < 1 << 20
    output = f"has {MOST_NUMBERS + 1} rows of 1 columns; at most {MOST_NUMBERS} numbers are read"
    assert fault_of_parquet(path.read_bytes()) == output
    assert cli.main(["calibrate", str(path)]) == 2
    assert output in capsys.readouterr().err


@pytest.mark.acceptance
@pytest.mark.parametrize("ending", ["csv", "parquet"])
def test_more_positions_than_a_bench_measures_are_refused_before_they_are_read(
    ending: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    few = ["position", "time_s", "alpha_deg", "beta_deg", "f1_mps2", "f2_mps2", "f3_mps2"]
    table = pl.DataFrame({name: pl.repeat(1.0, POSITION.most_rows + 1, eager=True) for name in few})
    path = tmp_path / f"many.{ending}"
    table.write_csv(path) if ending == "csv" else table.write_parquet(path)
    assert cli.main(["calibrate", str(path), "--noise-bound", "1e-5"]) == 2
    output = f"has {POSITION.most_rows + 1} rows; at most {POSITION.most_rows} are read of a position record"
    assert capsys.readouterr().err == f"trihedron: {path}: {output}\n"
    # With one row less it is read, and refused for its content.
    table = table.head(POSITION.most_rows)
    table.write_csv(path) if ending == "csv" else table.write_parquet(path)
    assert cli.main(["calibrate", str(path), "--noise-bound", "1e-5"]) == 2
    assert "at most" not in capsys.readouterr().err


@pytest.mark.acceptance
def test_a_sound_parquet_file_has_no_fault(tmp_path: Path) -> None:
    path = tmp_path / "sound.parquet"
    pl.DataFrame({"a": np.arange(10.0)}).write_parquet(path)
    assert fault_of_parquet(path.read_bytes()) is None
    assert "is not a readable Parquet file" in str(fault_of_parquet(path.read_bytes()[:-9] + b"PAR1"))


def test_files_of_a_block_appear_together_or_not_at_all(tmp_path: Path) -> None:
    (tmp_path / "b").write_text("before")

    def write() -> None:
        write_text(tmp_path / "a", "new")
        write_text(tmp_path / "b", "new")
        with whole_folder(tmp_path / "c") as folder:
            write_text(folder / "inside", "new")
            assert (folder / "inside").read_text() == "new"

    def fail() -> None:
        with together():
            write()
            raise RuntimeError

    with pytest.raises(RuntimeError):
        fail()
    assert sorted(path.name for path in tmp_path.iterdir()) == ["b"]
    assert (tmp_path / "b").read_text() == "before"
    with together():
        write()
        assert sorted(path.name for path in tmp_path.iterdir() if path.name[0] != ".") == ["b"]
    assert sorted(path.name for path in tmp_path.rglob("*")) == ["a", "b", "c", "inside"]
    assert (tmp_path / "b").read_text() == "new"


@pytest.mark.parametrize("links", [True, False])
@pytest.mark.parametrize("last", ["a", "b", "c/x", "c/y", "d/new", "e"])
def test_where_one_file_cannot_be_moved_into_its_place_all_are_as_before(
    last: str, links: bool, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """All are written, and one of them cannot get its name."""
    before = {"a": "old a", "b": "old b", "c/x": "old x", "c/kept": "kept"}
    (tmp_path / "c").mkdir()
    for name, text in before.items():
        (tmp_path / name).write_text(text)

    def write() -> None:
        with together():
            for name in ("a", "b"):
                write_text(tmp_path / name, "new")
            for folder, names in (("c", ("x", "y")), ("d", ("new",))):
                with whole_folder(tmp_path / folder) as neighbour:
                    for name in names:
                        write_text(neighbour / name, "new")
            write_text(tmp_path / "e", "new")

    replace, link = Path.replace, Path.hardlink_to

    def refused(self: Path, target: Path) -> Path:
        if target == tmp_path / last and not self.name.endswith(".before"):
            raise PermissionError(errno.EACCES, os.strerror(errno.EACCES), str(self))
        return replace(self, target)

    def no_links(self: Path, target: Path) -> None:
        raise OSError(errno.EOPNOTSUPP, os.strerror(errno.EOPNOTSUPP), str(self))

    monkeypatch.setattr(Path, "hardlink_to", link if links else no_links)
    with monkeypatch.context() as patched:
        patched.setattr(Path, "replace", refused)
        with pytest.raises(InputError, match="cannot be written"):
            write()
    present = {p.relative_to(tmp_path).as_posix(): p.read_text() for p in tmp_path.rglob("*") if p.is_file()}
    assert present == before
    assert not (tmp_path / "d").exists()
    write()
    present = {p.relative_to(tmp_path).as_posix(): p.read_text() for p in tmp_path.rglob("*") if p.is_file()}
    assert present == {**dict.fromkeys(["a", "b", "c/x", "c/y", "d/new", "e"], "new"), "c/kept": "kept"}


def test_where_one_output_fails_none_stays(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """The disk is full when one of three files has been written."""
    monkeypatch.chdir(tmp_path)
    complete = Path.chmod
    command = ["plan", "target", "X4", "--grid", "15", "--json", "p.json", "--picture", "p.svg", "--report", "p.html"]
    for ending in (".json", ".svg", ".html"):

        def full(self: Path, *rest: Any, ending: str = ending, **more: Any) -> None:
            if self.suffix == ending:
                raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC), str(self))
            complete(self, *rest, **more)

        monkeypatch.setattr(Path, "chmod", full)
        assert cli.main(command) == 2
        output = capsys.readouterr().err
        assert "No space left on device" in output
        assert output.count("\n") == 1
        assert list(tmp_path.iterdir()) == []
    monkeypatch.setattr(Path, "chmod", complete)
    assert cli.main(command) == 0
    assert sorted(path.name for path in tmp_path.iterdir()) == ["p.html", "p.json", "p.svg"]


@pytest.mark.parametrize(
    ("options", "says"),
    [
        (["--json", "."], ".: is a directory; give the name of a file"),
        (["--ssv", "."], ".: is a directory; give the name of a file"),
        (["--report", "x.doc"], "--report x.doc: a page is .html or .pdf"),
        (["--report", "folder.html"], "folder.html: is a directory"),
    ],
)
def test_outputs_are_looked_at_before_the_work(
    options: list[str], says: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """The record does not even exist."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "folder.html").mkdir()
    assert cli.main(["calibrate", "none.csv", *options]) == 2
    assert says in capsys.readouterr().err


@pytest.mark.parametrize("depth", [100, 700])
def test_folders_may_be_as_deep_as_the_system_lets_them(
    depth: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    deep = Path(*["d"] * depth)
    assert cli.main(["new", "scenario", str(deep / "s.toml")]) == 0
    assert (deep / "s.toml").is_file()
    capsys.readouterr()
    assert cli.main(["new", "scenario", str(Path(*["d"] * 4000) / "s.toml")]) == 2
    assert capsys.readouterr().err.count("\n") == 1


def tree(folder: Path) -> dict[str, bytes]:
    """Return the files of a folder and their content."""
    return {path.relative_to(folder).as_posix(): path.read_bytes() for path in folder.rglob("*") if path.is_file()}


PROGRAMME = "alpha_deg,beta_deg\n20,25\n110,35\n"


@pytest.fixture
def bench(tmp_path: Path) -> Path:
    """Return the scenario of a bench, with its programme beside it."""
    assert cli.main(["new", "scenario", str(tmp_path / "bench.toml"), "-q"]) == 0
    scenario = tmp_path / "bench.toml"
    text = re.sub(r'programme = "[^"]*"', 'programme = "positions.csv"', scenario.read_text())
    scenario.write_text(text.replace("dwell_s = 20.0", "dwell_s = 2.0"))
    (tmp_path / "positions.csv").write_text(PROGRAMME)
    return scenario


@pytest.mark.first(2)
@pytest.mark.parametrize("way", ["folder", "linked folder", "linked programme", "second name", "json", "plot"])
def test_a_run_never_replaces_the_programme_that_its_scenario_reads(way: str, bench: Path, capsys) -> None:
    folder, out = bench.parent, bench.parent
    further: list[str] = []
    if way == "linked folder":
        out = folder / "link"
        out.symlink_to(folder, target_is_directory=True)
    elif way in ("linked programme", "second name"):
        out = folder / "out"
        out.mkdir()
        if way == "linked programme":
            (out / "positions.csv").symlink_to(folder / "positions.csv")
        else:
            (out / "positions.csv").hardlink_to(folder / "positions.csv")
    elif way == "json":
        out, further = folder / "out", ["--json", str(folder / "positions.csv")]
    elif way == "plot":
        out, further = folder / "out", ["--plot", str(folder / "positions.html")]
        (folder / "positions.csv").rename(folder / "positions.html")
        bench.write_text(bench.read_text().replace("positions.csv", "positions.html"))
    before = tree(folder)
    assert cli.main(["simulate", str(bench), "--out", str(out), *further]) == 2
    message = capsys.readouterr().err
    assert "positions." in message
    assert "give another" in message
    assert tree(folder) == before


def test_a_run_goes_where_nothing_of_it_was_read_and_again_to_the_same_place(bench: Path) -> None:
    out = bench.parent / "out"
    for _ in range(2):
        assert cli.main(["simulate", str(bench), "--out", str(out), "-q"]) == 0
    assert (bench.parent / "positions.csv").read_text() == PROGRAMME
    assert (out / "positions.csv").exists()


def test_in_python_a_run_never_replaces_what_it_reads(bench: Path) -> None:
    before = tree(bench.parent)
    with pytest.raises(InputError, match="give another"):
        trihedron.simulate(bench, out=bench.parent)
    assert tree(bench.parent) == before


@pytest.mark.parametrize("option", ["--json", "--report", "--picture"])
def test_a_plan_never_replaces_the_mounting_that_it_reads(option: str, tmp_path: Path, capsys) -> None:
    mounting = tmp_path / "mounting.html"
    mounting.write_text("0 1 0\n0 0 1\n1 0 0\n")
    words = ["plan", "positions", "8", "--mounting", str(mounting), option, str(mounting)]
    assert cli.main(words) == 2
    assert "trihedron: " in capsys.readouterr().err
    assert mounting.read_text() == "0 1 0\n0 0 1\n1 0 0\n"


@pytest.mark.parametrize("linked", [True, False])
def test_files_of_a_user_beside_a_folder_are_left_alone(linked: bool, tmp_path: Path) -> None:
    """Use names that look like our working files: `.NAME.before`, a file, or a link to one elsewhere."""
    out, treasure = tmp_path / "out", tmp_path / "treasure"
    out.mkdir()
    treasure.write_text("mine")
    for name in ("a", "b"):
        (out / name).write_text("old")
        if linked:
            (out / f".{name}.before").symlink_to(treasure)
        else:
            (out / f".{name}.before").write_text("mine")
    with whole_folder(out) as folder:
        for name in ("a", "b"):
            write_text(folder / name, "new")
    assert treasure.read_text() == "mine"
    for name in ("a", "b"):
        assert (out / name).read_text() == "new"
        assert (out / f".{name}.before").read_text() == "mine"
    assert len(list(out.iterdir())) == 4
