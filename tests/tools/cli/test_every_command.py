"""Every command with wrong options and inputs: one clear line, the correct exit status, no half-written file."""

import io
import os
import shutil
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any, Literal, get_args, get_origin

import pytest

from command_table import COMMANDS, QUICK, Command, files
from trihedron.tools import cli

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


def check_refused(status: int, capsys: pytest.CaptureFixture[str], *names: str) -> str:
    output = capsys.readouterr()
    assert status == 2, output.err
    lines = output.err.splitlines()
    assert len(lines) == 1, output.err
    assert lines[0].startswith("trihedron: ")
    assert "Traceback" not in output.err
    assert len(lines[0]) < 600
    for name in names:
        assert name in lines[0]
    return lines[0]


def of_app(command: Command) -> tuple[Any, int]:
    """Return the command's application and the number of words in its name."""
    app, words = cli.app[command.arguments[0]], 1
    if len(command.arguments) > 1 and command.arguments[0] in ("instrument", "plan", "reproduce"):
        app, words = app[command.arguments[1]], 2
    return app, words


def names_of_commands() -> Iterator[str]:
    for name in cli.app:
        if not name.startswith("-"):
            inner = [n for n in cli.app[name] if not n.startswith("-")]
            yield from (f"{name} {n}" for n in inner) if inner else (name,)


def kinds(hint: Any) -> tuple[Any, ...]:
    """Return the types in an option's annotation, without None; the choices of a literal as one tuple."""
    if get_origin(hint) is Literal:
        return (get_args(hint),)
    inner = [kind for part in get_args(hint) if part not in (type(None), Ellipsis) for kind in kinds(part)]
    return tuple(inner) if inner else (hint,)


def wrong_options(command: Command) -> Iterator[tuple[str, ...]]:
    """Yield additional arguments that are always wrong."""
    yield ("--no-such-option",)
    yield ("--no-such-option", "1")
    app, _ = of_app(command)
    for argument in app.assemble_argument_collection():
        name = argument.names[0] if argument.names else ""
        if not name.startswith("--") or not argument.parse or argument.token_count()[0] == 0:
            continue
        result, count = kinds(argument.hint), argument.token_count()[0]
        # `--realtime` alone is real time, a factor of one.
        if name != "--realtime":
            yield (name,)
        if isinstance(result[0], tuple):
            yield (name, "no-such-choice")
        elif result[0] in (int, float):
            yield (name, *["1.5.2"] * count)
            yield (name, *["nan"] * count)
            yield (name, *["inf"] * count)
            if count > 1:
                yield (name, "1")
        elif result[0] is Path:
            yield (name, "measured.csv/below-a-file/x.json")


def test_the_table_has_every_command():
    """This test fails for a new command that is not in the table."""
    titles = {" ".join(command.arguments[: of_app(command)[1]]) for command in COMMANDS}
    assert titles == set(names_of_commands())


@pytest.mark.parametrize("name", sorted(names_of_commands()))
def test_help_has_a_sentence_and_an_example_and_every_command_has_json(name: str, capsys):
    assert cli.main([*name.split(), "--help"]) == 0
    output = capsys.readouterr()
    text = output.out
    assert f"\n  trihedron {name}" in text
    assert "--json" in text
    assert "--quiet" in text
    assert output.err == ""
    sentence = output.out.split("\n\n")[2]
    assert 0 < len(sentence) < 300


@pytest.mark.first(1)
@pytest.mark.parametrize("command", COMMANDS, ids=lambda c: c.title)
def test_wrong_options(command: Command, here: Path, capsys):
    before = files(here)
    for added in wrong_options(command):
        # An option may be given only once: the wrong one replaces the correct one.
        retained = without(command.arguments, added[0])
        status = cli.main([*retained, *added])
        check_refused(status, capsys)
        remaining = {name: content for name, content in files(here).items() if name not in before}
        assert remaining == {}, added


def without(arguments: tuple[str, ...], option: str) -> list[str]:
    """Return the arguments without an option and its values."""
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
            # Half a file may be a valid one.
            capsys.readouterr()
        else:
            output = check_refused(status, capsys)
            assert name in output
            # `check` has done its work: its findings are a file.
            assert written <= ({"out.json"} if command.arguments[0] == "check" else set())
        for leftover in written:
            shutil.rmtree(here / leftover) if (here / leftover).is_dir() else (here / leftover).unlink()
        path.rmdir() if path.is_dir() else path.unlink(missing_ok=True)
        path.write_bytes(right)
    assert not list(Path(tempfile.gettempdir()).iterdir())


def forbid(path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Make a file unreadable, also for the superuser."""
    opened = io.open

    def refuse(file: Any, *arguments: Any, **named: Any) -> Any:
        if isinstance(file, str | os.PathLike) and os.path.realpath(file) == os.path.realpath(path):
            raise PermissionError(13, "Permission denied", str(file))
        return opened(file, *arguments, **named)

    monkeypatch.setattr(io, "open", refuse)
    monkeypatch.setattr("builtins.open", refuse)
