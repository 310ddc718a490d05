"""Every command and a full disk: one line, and nothing half-written."""

import os
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

import pytest

from command_table import QUICK, Command


def can_mount() -> bool:
    """Whether a small file system can be had without being the superuser."""
    if shutil.which("unshare") is None:
        return False
    with tempfile.TemporaryDirectory() as folder:
        tried = ["unshare", "-rm", "mount", "-t", "tmpfs", "-o", "size=4k", "tmpfs", folder]
        return subprocess.run(tried, capture_output=True, check=False, timeout=300).returncode == 0


SHORT = ("simulate run.toml", "export AccelerometerBlock", "export-ssp run.toml", "new scenario")
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
    program = [sys.executable, "-m", "trihedron.tools.cli"]
    subprocess.run([*shell, str(full), str(result), *program, *arguments], check=True, env=environment, timeout=120)
    error = (result / "err").read_text(encoding="utf-8")
    assert (result / "status").read_text(encoding="utf-8").strip() == "2", error
    assert error.splitlines()[-1].startswith("trihedron: ")
    assert "No space left" in error.splitlines()[-1]
    assert "Traceback" not in error
    assert (result / "left").read_text(encoding="utf-8") == ""
