"""Every command and a full disk: one line, and no half-written file."""

import os
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path

import pytest

from command_table import QUICK, Command, files
from forked_commands import ForkedCommands, with_temporary_folder
from trihedron.tools import cli
from trihedron.tools.errors import InputError


def can_mount() -> bool:
    """Return True if a small file system can be mounted without the superuser."""
    if shutil.which("unshare") is None:
        return False
    with tempfile.TemporaryDirectory() as folder:
        candidates = ["unshare", "-rm", "mount", "-t", "tmpfs", "-o", "size=4k", "tmpfs", folder]
        return subprocess.run(candidates, capture_output=True, check=False, timeout=300).returncode == 0


LOCK = "campaign.lock"
"""The lock stays: another process may wait for it."""
SHORT = ("simulate run.toml", "export AccelerometerBlock", "export-ssp run.toml", "new scenario")
"""Commands that meet a full disk in each run of the tests."""
KEPT = ("campaign campaign.toml", "instrument show")
"""Commands that keep files as they come, and commands that write their object to `--out`."""
ONCE = ("new", "instrument", "completion", "export-notebook")
"""Commands that cannot run twice in one place."""
WRITING = [c for c in QUICK if c.arguments[0] not in ("doctor",)]
TOGETHER = [c for c in WRITING if c.arguments[0] != "measure"]
"""Commands whose files appear together or not at all; a measurement's kept files stay."""
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


@pytest.mark.first(1)
@pytest.mark.skipif(not can_mount(), reason="no file system of our own can be mounted here (unshare, mount)")
@pytest.mark.parametrize(
    "command",
    [pytest.param(c, marks=[] if c.title in SHORT else [pytest.mark.acceptance]) for c in WRITING],
    ids=lambda c: c.title,
)
def test_a_full_disk(command: Command, here: Path, tmp_path: Path):
    """All outputs of the command are on a full disk."""
    full, result = tmp_path / "full", tmp_path / "result"
    full.mkdir()
    result.mkdir()
    arguments = [str(full / a) if a.startswith("out") else a for a in command.arguments]
    environment = {**os.environ, "TRIHEDRON_CACHE": os.environ.get("TRIHEDRON_CACHE", str(tmp_path / "cache"))}
    shell = ["unshare", "-rm", "sh", "-c", FULL, "sh"]
    program = [sys.executable, "-m", "trihedron.tools.cli"]
    subprocess.run([*shell, str(full), str(result), *program, *arguments], check=True, env=environment, timeout=120)
    error = (result / "err").read_text(encoding="utf-8")
    assert (result / "status").read_text(encoding="utf-8").strip() == "2", error
    assert error.splitlines()[-1].startswith("trihedron: ")
    assert "No space left" in error.splitlines()[-1]
    assert "Traceback" not in error
    assert set((result / "left").read_text(encoding="utf-8").split()) <= {f"./out/{LOCK}"}


@pytest.mark.first(1)
@pytest.mark.parametrize(
    "command",
    [
        pytest.param(c, marks=[] if c.title in SHORT else [pytest.mark.acceptance])
        for c in TOGETHER
        if "out.json" in c.arguments and c.title not in KEPT
    ],
    ids=lambda c: c.title,
)
def test_an_object_that_cannot_be_written_leaves_nothing_else(
    command: Command, here: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
):
    """Only the output of `--json` is on a full disk; earlier files stay."""

    def full(path: Path, text: str) -> None:
        raise InputError(f"{path}: cannot be written (No space left on device)")

    for earlier in (False, True):
        before = files(here)
        with monkeypatch.context() as patch:
            patch.setattr("trihedron.tools.cli.answer.write_text", full)
            assert cli.main([*command.arguments, "--quiet"]) == 2
        assert capsys.readouterr().err == "trihedron: out.json: cannot be written (No space left on device)\n"
        assert files(here) == before
        if not earlier and command.arguments[0] not in ONCE:
            assert cli.main([*command.arguments, "--quiet"]) == 0
        else:
            return


@pytest.fixture(scope="module")
def commands(tmp_path_factory: pytest.TempPathFactory) -> Iterator[ForkedCommands]:
    with with_temporary_folder(tmp_path_factory.mktemp("commands")) as started:
        yield started


@pytest.mark.acceptance
@pytest.mark.skipif(os.name == "nt", reason="limits of processes")
@pytest.mark.parametrize("command", TOGETHER, ids=lambda c: c.title)
def test_a_disk_that_ends_in_the_middle(command: Command, here: Path, tmp_path: Path, commands: ForkedCommands):
    """No file may reach the size of one of the command's outputs, each of them in turn, except the smallest."""
    folder = tmp_path / "folder"
    shutil.copytree(here, folder)
    before = files(folder)
    arguments = [*command.arguments]
    assert commands.run(arguments, folder).status == 0
    written = {name: payload for name, payload in files(folder).items() if before.get(name) != payload}
    assert written
    for size in sorted({len(payload) for payload in written.values() if len(payload) > 500}):
        shutil.rmtree(folder)
        shutil.copytree(here, folder)
        process = commands.run(arguments, folder, most_bytes=size - 1)
        assert process.status == 2, process.err
        assert process.err.splitlines()[-1].startswith("trihedron: ")
        assert "File too large" in process.err.splitlines()[-1]
        assert "Traceback" not in process.err
        remaining = {
            name: payload for name, payload in files(folder).items() if name in before or not name.endswith(LOCK)
        }
        if command.arguments[0] == "campaign" and remaining != before:
            # The kept files are whole, and the rest is made.
            assert commands.run([*arguments, "--resume"], folder).status == 0
            remaining = {name: payload for name, payload in files(folder).items() if name in written}
            assert remaining.keys() == written.keys()
            continue
        assert remaining == before
