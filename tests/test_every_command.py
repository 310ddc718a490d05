"""Every command with everything that can be wrong: one clear line, the right exit status, nothing half-written."""

import inspect
import io
import json
import os
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any, Literal, get_args, get_origin

import pytest

from command_table import COMMANDS, Command, make_inputs
from trihedron import cli

QUICK = [command for command in COMMANDS if not command.slow]
READING = [command for command in QUICK if command.inputs]
WRONG_INPUTS = {
    "missing": None,
    "empty": b"",
    "binary": bytes(range(256)) * 8,
    "zeros": bytes(4096),
    "directory": "directory",
    "unreadable": "unreadable",
    "cut": "cut",
    "not-utf-8": b"schema = \xff\xfe\n",
}


@pytest.fixture(scope="module")
def inputs(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The files that the commands read; they are copied, never used."""
    folder = tmp_path_factory.mktemp("inputs")
    make_inputs(folder)
    return folder


@pytest.fixture
def here(inputs: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The current folder, with the inputs in it."""
    folder = tmp_path / "here"
    shutil.copytree(inputs, folder)
    scratch = tmp_path / "scratch"
    scratch.mkdir()
    monkeypatch.setattr(tempfile, "tempdir", str(scratch))
    monkeypatch.chdir(folder)
    return folder


def files(folder: Path) -> dict[str, bytes]:
    """What is in a folder and below it."""
    return {str(path.relative_to(folder)): path.read_bytes() for path in folder.rglob("*") if path.is_file()}


def check_refused(status: int, capsys: pytest.CaptureFixture[str], *names: str) -> str:
    said = capsys.readouterr()
    assert status == 2, said.err
    # Other lines are warnings, of what a record is like; the last one is the refusal.
    lines = said.err.splitlines()
    assert len(lines) == 1, said.err
    assert lines[0].startswith("trihedron: ")
    assert "Traceback" not in said.err
    assert len(lines[0]) < 600
    for name in names:
        assert name in lines[0]
    return lines[0]


def of_app(command: Command) -> tuple[Any, int]:
    """The command's application and how many words its name has."""
    app, words = cli.app[command.arguments[0]], 1
    if len(command.arguments) > 1 and command.arguments[0] == "reproduce":
        app, words = app[command.arguments[1]], 2
    return app, words


def names_of_commands() -> Iterator[str]:
    for name in cli.app:
        if not name.startswith("-"):
            inner = [n for n in cli.app[name] if not n.startswith("-")]
            yield from (f"{name} {n}" for n in inner) if inner else (name,)


def kinds(hint: Any) -> tuple[Any, ...]:
    """The types in an option's annotation, None left out; the choices of a literal as one tuple."""
    if get_origin(hint) is Literal:
        return (get_args(hint),)
    inner = [kind for part in get_args(hint) if part not in (type(None), Ellipsis) for kind in kinds(part)]
    return tuple(inner) if inner else (hint,)


def wrong_options(command: Command) -> Iterator[tuple[str, ...]]:
    """Arguments to add that are wrong whatever else is said."""
    yield ("--no-such-option",)
    yield ("--no-such-option", "1")
    app, _ = of_app(command)
    for argument in app.assemble_argument_collection():
        name = argument.names[0] if argument.names else ""
        if not name.startswith("--") or not argument.parse or argument.token_count()[0] == 0:
            continue
        found, count = kinds(argument.hint), argument.token_count()[0]
        yield (name,)
        if isinstance(found[0], tuple):
            yield (name, "no-such-choice")
        elif found[0] in (int, float):
            yield (name, *["abc"] * count)
            yield (name, *["1.5.2"] * count)
            yield (name, *["nan"] * count)
            yield (name, *["inf"] * count)
            if count > 1:
                yield (name, "1")
        elif found[0] is Path and name not in ("--check",):
            yield (name, "measured.csv/below-a-file/x.json")


def test_the_table_has_every_command():
    """A new command is tested like all others as soon as it is in the table; this says when it is not."""
    named = {" ".join(command.arguments[: of_app(command)[1]]) for command in COMMANDS}
    assert named == set(names_of_commands())


@pytest.mark.parametrize("name", sorted(names_of_commands()))
def test_help_has_a_sentence_and_an_example_and_every_command_has_json(name: str, capsys):
    assert cli.main([*name.split(), "--help"]) == 0
    said = capsys.readouterr()
    text = " ".join(said.out.replace("│", " ").split())
    assert f"Example: trihedron {name}" in text
    assert "--json" in text
    assert "--quiet" in text
    assert said.err == ""
    sentence = said.out.split("\n\n")[1]
    assert 0 < len(sentence) < 300


@pytest.mark.parametrize("command", COMMANDS, ids=lambda c: c.title)
def test_wrong_options(command: Command, here: Path, capsys):
    before = files(here)
    for added in wrong_options(command):
        # An option may be given once only: the right one makes room for the wrong one.
        kept = without(command.arguments, added[0])
        status = cli.main([*kept, *added])
        check_refused(status, capsys)
        left = {name: content for name, content in files(here).items() if name not in before}
        assert left == {}, added


def without(arguments: tuple[str, ...], option: str) -> list[str]:
    """The arguments without an option and its values."""
    if option not in arguments:
        return list(arguments)
    at = arguments.index(option)
    after = at + 1
    while after < len(arguments) and not arguments[after].startswith("--"):
        after += 1
    return [*arguments[:at], *arguments[after:]]


@pytest.mark.parametrize("kind", WRONG_INPUTS)
@pytest.mark.parametrize("command", READING, ids=lambda c: c.title)
def test_wrong_inputs(command: Command, kind: str, here: Path, monkeypatch, capsys):
    for name in command.inputs:
        path = here / name
        right = path.read_bytes()
        path.unlink()
        content = WRONG_INPUTS[kind]
        with monkeypatch.context() as patched:
            if content == "directory":
                path.mkdir()
            elif content == "unreadable":
                path.write_bytes(right)
                forbid(path, patched)
            elif content == "cut":
                path.write_bytes(right[: len(right) // 2].rstrip(b"0123456789.,-\n"))
            elif content is not None:
                path.write_bytes(content if isinstance(content, bytes) else content.encode())
            status = cli.main(list(command.arguments))
        written = {p.name for p in here.iterdir() if p.name.startswith("out")}
        if kind == "cut" and status == 0:
            # Half a file may be a whole one.
            capsys.readouterr()
        else:
            said = check_refused(status, capsys)
            assert name in said
            # `check` has done its work: its findings are a file.
            assert written <= ({"out.json"} if command.arguments[0] == "check" else set())
        for leftover in written:
            shutil.rmtree(here / leftover) if (here / leftover).is_dir() else (here / leftover).unlink()
        path.rmdir() if path.is_dir() else path.unlink(missing_ok=True)
        path.write_bytes(right)
    assert not list(Path(tempfile.gettempdir()).iterdir())


def forbid(path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Let a file be unreadable, for the superuser too, who could read it whatever its mode."""
    opened = io.open

    def refuse(file: Any, *arguments: Any, **named: Any) -> Any:
        if isinstance(file, str | os.PathLike) and os.path.realpath(file) == os.path.realpath(path):
            raise PermissionError(13, "Permission denied", str(file))
        return opened(file, *arguments, **named)

    monkeypatch.setattr(io, "open", refuse)
    monkeypatch.setattr("builtins.open", refuse)


def whole(folder: Path) -> bool:
    """Whether no file is one that a command has begun: those have names that begin with a dot, or say so."""
    return not list(folder.rglob(".*")) and not list(folder.rglob("*.incomplete"))


class Struck(Exception):
    """Stands for Ctrl-C in the count of calls."""


def calls_of(command: Command) -> int:
    """How many calls of our functions a command makes."""
    count = 0

    def counted(frame: Any, event: str, argument: Any) -> None:
        nonlocal count
        if event == "call" and is_ours(frame):
            count += 1

    sys.setprofile(counted)
    try:
        cli.main(list(command.arguments))
    finally:
        sys.setprofile(None)
    return count


def interrupted_at(command: Command, number: int) -> int:
    """The exit status of a command that Ctrl-C strikes in the n-th call of our functions."""
    count = 0

    def strike(frame: Any, event: str, argument: Any) -> None:
        nonlocal count
        if event == "call" and is_ours(frame):
            count += 1
            if count == number:
                sys.setprofile(None)
                raise KeyboardInterrupt

    sys.setprofile(strike)
    try:
        return cli.main(list(command.arguments))
    finally:
        sys.setprofile(None)


OURS = str(Path(cli.__file__).resolve().parent)


def is_ours(frame: Any) -> bool:
    name = frame.f_code.co_filename
    # A generator is also called to be closed, where Python lets no exception out.
    if frame.f_code.co_flags & inspect.CO_GENERATOR:
        return False
    return name.startswith(OURS) and not name.endswith(("exit_status.py", "cli.py", "answers.py"))


STRIKES = (0.02, 0.5, 0.97)
"""Parts of the way at which Ctrl-C comes."""
LONG = (
    *("calibrate clean.csv", "diagnose measured.csv", "plan --positions", "plan --check", "hidden --cases"),
    *("campaign campaign.toml", "reproduce calibration"),
)
"""Commands whose every call is not counted in each run of the tests."""
INTERRUPTIBLE = [c for c in QUICK if c.arguments[0] not in ("completion", "doctor")]


@pytest.mark.parametrize(
    "command",
    [pytest.param(c, marks=[pytest.mark.acceptance] if c.title in LONG else []) for c in INTERRUPTIBLE],
    ids=lambda c: c.title,
)
def test_ctrl_c_in_the_middle(command: Command, here: Path, capsys):
    """At several places of the way: what is there afterwards is whole, and the exit status says that it is not all."""
    before = files(here)
    calls = calls_of(command)
    capsys.readouterr()
    complete = {name: content for name, content in files(here).items() if name not in before}
    for part in STRIKES:
        for name in [*complete, *(p.name for p in here.iterdir() if p.name.startswith("out"))]:
            path = here / Path(name).parts[0]
            shutil.rmtree(path) if path.is_dir() else path.unlink(missing_ok=True)
        status = interrupted_at(command, max(1, int(part * calls)))
        said = capsys.readouterr()
        left = {name: content for name, content in files(here).items() if name not in before}
        assert {name: content for name, content in files(here).items() if name in before} == before
        assert "Traceback" not in said.err
        if status == 0:
            # A search that is stopped gives the best that it has found, and says so.
            assert "interrupted" in said.out or left == complete, (part, said)
            continue
        assert status == 130, said.err
        assert said.err.count("\n") == 1
        assert said.err.startswith("trihedron: interrupted")
        assert whole(here), (part, sorted(left))
        for name, content in left.items():
            if command.arguments[0] in ("simulate", "campaign"):
                continue
            assert content == complete[name], (part, name)
        if command.arguments[0] == "simulate" and left:
            said_complete = json.loads(left["out/run.json"]).get("complete", True)
            assert said_complete is False or left["out/run.csv"] == complete["out/run.csv"]
    assert not list(Path(tempfile.gettempdir()).iterdir())


def can_mount() -> bool:
    """Whether a small file system can be had without being the superuser."""
    if shutil.which("unshare") is None:
        return False
    with tempfile.TemporaryDirectory() as folder:
        tried = ["unshare", "-rm", "mount", "-t", "tmpfs", "-o", "size=4k", "tmpfs", folder]
        return subprocess.run(tried, capture_output=True, check=False, timeout=60).returncode == 0


SHORT = ("simulate run.toml", "calibrate clean.csv", "export AccelerometerBlock", "export-ssp run.toml", "new scenario")
"""Commands that a full disk is tried on in each run of the tests."""
WRITING = [c for c in QUICK if c.arguments[0] not in ("doctor",)]
FULL = """
set -e
mount -t tmpfs -o size=8k tmpfs "$1"
folder=$1 result=$2; shift 2
cat /dev/zero > "$folder/filler" 2>/dev/null || true
set +e
"$@" > "$result/out" 2> "$result/err"
echo $? > "$result/status"
cd "$folder" && find . -name filler -o -type f -print > "$result/left"
"""


@pytest.mark.skipif(not can_mount(), reason="no file system of our own can be mounted here (unshare, mount)")
@pytest.mark.parametrize(
    "command",
    [pytest.param(c, marks=[] if c.title in SHORT else [pytest.mark.acceptance]) for c in WRITING],
    ids=lambda c: c.title,
)
def test_a_full_disk(command: Command, here: Path, tmp_path: Path):
    """Everything that the command writes is on a disk that is full."""
    full, result = tmp_path / "full", tmp_path / "result"
    full.mkdir()
    result.mkdir()
    arguments = [str(full / a) if a.startswith("out") else a for a in command.arguments]
    environment = {**os.environ, "TRIHEDRON_CACHE": os.environ.get("TRIHEDRON_CACHE", str(tmp_path / "cache"))}
    shell = ["unshare", "-rm", "sh", "-c", FULL, "sh"]
    program = [sys.executable, "-m", "trihedron.cli"]
    subprocess.run([*shell, str(full), str(result), *program, *arguments], check=True, env=environment, timeout=120)
    error = (result / "err").read_text(encoding="utf-8")
    assert (result / "status").read_text(encoding="utf-8").strip() == "2", error
    assert error.splitlines()[-1].startswith("trihedron: ")
    assert "No space left" in error.splitlines()[-1]
    assert "Traceback" not in error
    assert (result / "left").read_text(encoding="utf-8") == ""


@pytest.mark.skipif(not Path("/dev/full").is_char_device(), reason="this system has no /dev/full")
@pytest.mark.parametrize("command", [c for c in QUICK if c.arguments[0] in ("check", "new")], ids=lambda c: c.title)
def test_a_full_disk_behind_standard_output(command: Command, here: Path):
    with Path("/dev/full").open("w") as stream:
        done = subprocess.run(
            [sys.executable, "-m", "trihedron.cli", *command.arguments],
            stdout=stream, stderr=subprocess.PIPE, text=True, check=False, timeout=120,
        )  # fmt: skip
    assert done.returncode == 2
    assert done.stderr == "trihedron: standard output: cannot be written (No space left on device)\n"
