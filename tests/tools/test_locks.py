"""Locks hold, and stay; the next process removes the leftovers of a killed one, and nothing else."""

import errno
import os
import re
import signal
import subprocess
import sys
import tempfile
from collections.abc import Callable
from pathlib import Path

import pytest

from trihedron.tools.errors import InputError
from trihedron.tools.locks import LOCK, PREFIX, Taken, locked, own_folder

HOLDER = """
import sys, time
from pathlib import Path
from trihedron.tools.locks import locked, own_folder
with {what} as folder:
    print(folder, flush=True)
    time.sleep(600)
"""


@pytest.fixture
def base(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Return the folder of temporary files, of this process and of its children."""
    folder = tmp_path / "temporary"
    folder.mkdir()
    monkeypatch.setattr(tempfile, "tempdir", str(folder))
    monkeypatch.setenv("TMPDIR", str(folder))
    return folder


def holder(what: str) -> subprocess.Popen[str]:
    """Return another process within a block; its first line is the block's value."""
    return subprocess.Popen([sys.executable, "-c", HOLDER.format(what=what)], stdout=subprocess.PIPE, text=True)


def first_line(process: subprocess.Popen[str]) -> Path:
    assert process.stdout is not None
    return Path(process.stdout.readline().strip())


@pytest.mark.skipif(os.name == "nt", reason="signals of POSIX")
def test_a_lock_keeps_others_out_until_its_process_is_killed_and_its_file_stays(tmp_path: Path) -> None:
    path = tmp_path / "here.lock"
    with holder(f"locked(Path({str(path)!r}))") as second:
        first_line(second)
        file = path.stat().st_ino
        with pytest.raises(Taken), locked(path):
            pass
        second.send_signal(signal.SIGKILL)
    for _ in range(2):
        with locked(path):
            pass
    assert path.stat().st_ino == file


@pytest.mark.skipif(os.name == "nt", reason="signals of POSIX")
def test_the_folder_of_a_killed_process_is_taken_away_by_the_next(base: Path) -> None:
    with holder("own_folder()") as living, holder("own_folder()") as killed:
        retained, remaining = first_line(living), first_line(killed)
        (remaining / "file").write_text("large")
        killed.send_signal(signal.SIGKILL)
        killed.wait()
        assert remaining.exists()
        with own_folder() as group:
            assert sorted(base.iterdir()) == sorted([retained.parent, group.parent])
            (group / "file").write_text("mine")
        assert retained.exists()
        living.send_signal(signal.SIGKILL)
    with own_folder():
        pass
    assert list(base.iterdir()) == []


def test_what_is_not_left_by_such_a_process_is_let_alone(base: Path) -> None:
    """A user's own folder with that prefix has no lock and stays; an empty one of an unfinished process is removed."""
    group = base / f"{PREFIX}results"
    group.mkdir()
    (group / "result.json").write_text("{}")
    second = base / "trihedron-results"
    second.mkdir()
    (second / LOCK).write_text("")
    (base / f"{PREFIX}unborn").mkdir()
    with own_folder():
        pass
    assert sorted(path.name for path in base.iterdir()) == sorted([group.name, second.name])
    assert (group / "result.json").exists()


def test_a_folder_taken_away_before_it_is_locked_is_made_again(base: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Another process takes the new folder for an abandoned one."""
    make, written = tempfile.mkdtemp, []

    def robbed(**named: str) -> str:
        written.append(make(**named))
        if len(written) == 1:
            Path(written[0]).rmdir()
        return written[-1]

    monkeypatch.setattr(tempfile, "mkdtemp", robbed)
    with own_folder() as folder:
        assert str(folder.parent) == written[1]
    assert list(base.iterdir()) == []


@pytest.mark.parametrize("look", [1, 2])
def test_a_folder_that_ends_while_it_is_looked_at_stops_nobody(
    look: int, base: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Another process removes its folder just after this one has seen the lock in it."""
    second = base / f"{PREFIX}second"
    second.mkdir()
    (second / LOCK).write_text("")
    exists, looks = Path.exists, []

    def seen(path: Path) -> bool:
        is_there = exists(path)
        if path == second / LOCK:
            looks.append(path)
            if len(looks) == look:
                path.unlink()
        return is_there

    monkeypatch.setattr(Path, "exists", seen)
    with own_folder() as folder:
        assert folder.is_dir()


@pytest.mark.parametrize("number", [errno.ENOSPC, errno.EFBIG])
def test_a_disk_of_temporary_files_that_is_full_is_said(number: int, base: Path):
    with pytest.raises(InputError, match=re.escape(f"{base}: temporary files cannot be written")), own_folder():
        raise OSError(number, os.strerror(number))
    with pytest.raises(PermissionError), own_folder():
        raise PermissionError
    assert list(base.iterdir()) == []


@pytest.mark.skipif(os.name == "nt", reason="pipes of POSIX")
@pytest.mark.parametrize("make", [os.mkfifo, os.mkdir])
def test_what_is_no_file_is_no_lock_and_nobody_waits_for_it(make: Callable[[Path], None], tmp_path: Path) -> None:
    make(tmp_path / "lock")
    with pytest.raises(InputError, match="is not a regular file"), locked(tmp_path / "lock"):
        pass
