"""A limit of the machine ends a command with one line and status 2; its words move no terminal's cursor."""

import errno
import os
import socket
import struct
import subprocess
import sys
import time
import zipfile
from collections.abc import Callable
from pathlib import Path

import pytest

from trihedron.tools import workers
from trihedron.tools.cli import main
from trihedron.tools.cli.answer import exit_status
from trihedron.tools.errors import InputError
from trihedron.tools.workbench import Desk, DeskServer

posix = pytest.mark.skipif(os.name == "nt", reason="limits and folders of POSIX")


def refused(capsys: pytest.CaptureFixture[str], *words: str) -> str:
    """Return the refusal of a command: one line of printable characters."""
    assert main(list(words)) == 2
    return one_printable_line(capsys)


def one_printable_line(capsys: pytest.CaptureFixture[str]) -> str:
    out, err = capsys.readouterr()
    assert out == ""
    assert err.startswith("trihedron: ")
    assert err.endswith("\n")
    assert err[:-1].isprintable(), err
    return err


@posix
@pytest.mark.parametrize("words", [("calibrate", "p.csv"), ("simulate", "s.toml"), ("demo",), ("doctor",)])
def test_a_deleted_working_folder(
    words: tuple[str, ...], tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    folder = tmp_path / "gone"
    folder.mkdir()
    monkeypatch.chdir(folder)
    folder.rmdir()
    assert "the working folder cannot be used" in refused(capsys, *words)
    assert main(["--version"]) == 0


@pytest.mark.parametrize("words", [("check",), ("simulate",), ("apply", "x.json"), ("plan", "check")])
def test_a_name_that_is_too_long(words: tuple[str, ...], capsys: pytest.CaptureFixture[str]) -> None:
    assert len(refused(capsys, *words, "a" * 5000)) < 900


@posix
@pytest.mark.parametrize("name", [f"{'c' * 250}.toml", f"{'ü' * 120}.toml"])
def test_a_name_as_long_as_it_may_be_is_written(name: str, tmp_path: Path) -> None:
    assert main(["new", "mounting", str(tmp_path / name)]) == 0
    assert [path.name for path in tmp_path.iterdir()] == [name]


@posix
def test_a_folder_with_a_name_as_long_as_it_may_be(tmp_path: Path) -> None:
    folder = tmp_path / ("d" * 255)
    assert main(["export", "HarmonicMotion", "--out", str(folder)]) == 0
    assert list(tmp_path.iterdir()) == [folder]


@pytest.mark.parametrize(
    ("error", "printed"),
    [
        (MemoryError(), "not enough memory"),
        (OSError(errno.ENOMEM, "Cannot allocate memory"), "not enough memory"),
        (ImportError("libx.so: failed to map segment from shared object"), "not enough memory"),
        (RuntimeError("std::bad_alloc"), "not enough memory"),
        (OSError(errno.EMFILE, "Too many open files", "x"), "too many files are open"),
        (OSError(errno.ENFILE, "Too many open files in system"), "too many files are open"),
        (ImportError("x.so: cannot open shared object file: Too many open files"), "too many files are open"),
        (RuntimeError("can't start new thread"), "no more processes or threads"),
        (BlockingIOError(errno.EAGAIN, "Resource temporarily unavailable"), "no more processes or threads"),
    ],
)
def test_what_the_machine_is_short_of(error: Exception, printed: str, capsys: pytest.CaptureFixture[str]) -> None:
    def failing() -> int:
        raise error

    assert exit_status(failing) == 2
    assert printed in one_printable_line(capsys)


@pytest.mark.acceptance
@posix
@pytest.mark.parametrize(
    ("limit", "least", "words", "printed"),
    [
        ("RLIMIT_AS", 400 << 20, ("calibrate", "x.csv"), "the limit of memory is 400 MiB"),
        ("RLIMIT_NOFILE", 6, ("campaign", "c.toml", "--jobs", "2", "--out", "out"), "too many files are open"),
    ],
)
def test_limits_of_a_process(limit: str, least: int, words: tuple[str, ...], printed: str, tmp_path: Path) -> None:
    campaign = 'schema = "trihedron.campaign/1"\ntitle = "few"\nseed = 1\n[attitude]\nmotion = "small"\n'
    campaign += "duration_s = 1.0\n[sampling]\npoints = 2\n[parameters]\nbias_1_radps = { uniform = [0, 1e-5] }\n"
    (tmp_path / "c.toml").write_text(campaign)
    program = (
        f"import resource, sys; resource.setrlimit(resource.{limit}, ({least}, {least})); "
        "from trihedron.tools.cli import program; sys.exit(program())"
    )
    command = [sys.executable, "-c", program, *words]
    process = subprocess.run(command, capture_output=True, text=True, cwd=tmp_path, timeout=120)
    assert (process.returncode, process.stderr.count("\n")) == (2, 1), process.stderr
    assert printed in process.stderr


@posix
@pytest.mark.parametrize("number", [errno.EROFS, errno.ENOSYS, errno.EACCES])
def test_shared_memory_that_cannot_be_written(number: int, monkeypatch: pytest.MonkeyPatch) -> None:
    def semaphore(*_: object) -> None:
        raise OSError(number, os.strerror(number))

    monkeypatch.setattr("_multiprocessing.SemLock", semaphore)
    with pytest.raises(InputError, match=r"^--jobs 2: .*; give --jobs 1$"):
        list(workers.made(abs, [-1, -2], jobs=2))
    assert list(workers.made(abs, [-1, -2], jobs=1)) == [1, 2]


@pytest.mark.parametrize(
    "words",
    [
        ("check", "a\x1b[2Jb.csv"),
        ("calibrate", "x.csv", "--noise-bound", "\x1b]0;owned\x07"),
        ("x\x1b[2J",),
        ("simulate", "a\u202eb.toml"),
        ("plan", "target", "X1\x9b31m"),
        ("check", "a\nb\rc.csv"),
        ("check", "a\udcffb.csv"),
    ],
)
def test_refusals_print_no_control_characters(words: tuple[str, ...], capsys: pytest.CaptureFixture[str]) -> None:
    refused(capsys, *words)


@pytest.mark.parametrize("name", ["", ".", "./.", "\x1b[2J/../x"])
def test_an_archive_with_a_member_without_a_name(name: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    with zipfile.ZipFile(tmp_path / "x.fmu", "w") as archive:
        archive.writestr("modelDescription.xml", "<fmiModelDescription/>")
        archive.writestr(zipfile.ZipInfo("renamed"), "content")
        archive.infolist()[1].filename = name
    message = refused(capsys, "simulate", str(tmp_path / "x.fmu"))
    assert "without a name" in message or "would leave" in message


def half_a_request(client: socket.socket, server: DeskServer) -> None:
    client.sendall(f"POST /{server.token}/word HTTP/1.1\r\nHost: 127.0.0.1:{server.port}\r\n".encode())


def an_answer_not_read(client: socket.socket, server: DeskServer) -> None:
    client.sendall(f"GET /{server.token}/ HTTP/1.1\r\nHost: 127.0.0.1:{server.port}\r\n\r\n".encode() * 50)


def nothing_sent(client: socket.socket, server: DeskServer) -> None:
    pass


def no_request(client: socket.socket, server: DeskServer) -> None:
    client.sendall(b"\x16\x03\x01\x00\xff" * 100)


@pytest.mark.parametrize("way", [half_a_request, an_answer_not_read, nothing_sent, no_request])
def test_a_client_that_resets_prints_nothing(
    way: Callable[[socket.socket, DeskServer], None], capfd: pytest.CaptureFixture[str]
) -> None:
    server = DeskServer(Desk())
    for _ in range(5):
        with socket.create_connection(("127.0.0.1", server.port)) as client:
            way(client, server)
            client.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 1, 0))
    time.sleep(0.3)
    server.close()
    assert capfd.readouterr() == ("", "")
