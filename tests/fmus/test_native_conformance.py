"""Native FMUs keep the state machine of FMI: every legal and illegal call, also watched by memory checkers."""

import json
import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from component_kinds import all_kinds, title
from native_checks import CHECKS, Subject
from native_driver import Library
from native_model import as_json, entries, open_fmu, unpack
from trihedron.fmus import build, host_compiler
from trihedron.fmus.component import Component

pytestmark = pytest.mark.skipif(host_compiler() is None, reason="skipped: no C compiler")


@pytest.mark.first(2)
@pytest.mark.parametrize("fmi", [2, 3])
@pytest.mark.parametrize("component", all_kinds(), ids=title)
def test_every_call_is_done_or_refused_as_the_standard_says(component, fmi, tmp_path):
    path = build(component.name, tmp_path, component.effects, flavour="native", fmi=fmi)
    library = open_fmu(path, tmp_path / "unpacked")
    for check in CHECKS.values():
        check(Subject(library, entries(component, fmi)))


def watched(component: Component, fmi: int, folder: Path, flags: list[str]) -> tuple[Path, Path]:
    """Return a library compiled with debugging flags from an FMU's own sources, and its description for the program."""
    path = build(component.name, folder, component.effects, flavour="native", fmi=fmi)
    _, _, token = unpack(path, folder / "unpacked")
    compiler = host_compiler()
    assert compiler is not None
    binary = folder / f"Watched{component.name}.so"
    sources = sorted((folder / "unpacked" / "sources").glob("*.c"))
    command = [compiler[0], "-std=c99", "-g", "-O1", "-fPIC", "-shared", *flags, "-o", binary, *sources, "-lm"]
    subprocess.run(command, check=True, capture_output=True)
    table = [as_json(entry) for entry in entries(component, fmi)]
    described = folder / "subject.json"
    described.write_text(json.dumps({"binary": str(binary), "fmi": fmi, "token": token, "table": table}))
    return binary, described


def blamed(message: str, binary: Path) -> list[str]:
    """Return the lines of a memory checker that name the FMU: its library, or one of its sources."""
    return re.findall(rf".*(?:{re.escape(binary.name)}|\b(?:model|component|values|state|fmi[23]\w*)\.c:).*", message)


PROGRAM = Path(__file__).parents[1] / "native_checks.py"


@pytest.mark.acceptance
@pytest.mark.parametrize("fmi", [2, 3])
@pytest.mark.parametrize("component", all_kinds(), ids=title)
def test_no_invalid_access_and_no_leak_under_address_sanitizer(component, fmi, tmp_path):
    compiler = host_compiler()
    assert compiler is not None
    report = subprocess.run([compiler[0], "-print-file-name=libasan.so"], capture_output=True, text=True).stdout.strip()
    if not Path(report).is_absolute():
        pytest.skip("skipped: no AddressSanitizer")
    flags = ["-fsanitize=address,undefined", "-fno-omit-frame-pointer"]
    binary, described = watched(component, fmi, tmp_path, flags)
    options = {
        "LD_PRELOAD": report,
        "PYTHONMALLOC": "malloc",
        "ASAN_OPTIONS": "detect_leaks=1:exitcode=0:fast_unwind_on_malloc=0",
        "UBSAN_OPTIONS": "print_stacktrace=1",
    }
    process = subprocess.run(
        [sys.executable, PROGRAM, described], capture_output=True, text=True, env={**os.environ, **options}, timeout=600
    )
    assert "checks, 0 failures" in process.stdout, process.stdout + process.stderr[-2000:]
    # The interpreter leaks; the FMU does not.
    assert blamed(process.stderr, binary) == []
    assert "runtime error" not in process.stderr, process.stderr[-4000:]


@pytest.mark.acceptance
@pytest.mark.parametrize("fmi", [2, 3])
@pytest.mark.parametrize("component", all_kinds(), ids=title)
def test_no_invalid_access_and_no_leak_under_valgrind(component, fmi, tmp_path):
    valgrind = shutil.which("valgrind")
    if valgrind is None:
        pytest.skip("skipped: no valgrind")
    binary, described = watched(component, fmi, tmp_path, [])
    command = [valgrind, "--leak-check=full", "--show-leak-kinds=definite,indirect,possible", sys.executable, PROGRAM]
    process = subprocess.run(
        [*command, described],
        capture_output=True,
        text=True,
        env={**os.environ, "PYTHONMALLOC": "malloc"},
        timeout=900,
    )
    assert "checks, 0 failures" in process.stdout, process.stdout + process.stderr[-2000:]
    assert blamed(process.stderr, binary) == []


def test_only_the_functions_of_fmi_are_visible(tmp_path):
    nm = shutil.which("nm")
    if nm is None:
        pytest.skip("skipped: no nm")
    for fmi in (2, 3):
        path = build("AttitudeComputer", tmp_path / str(fmi), flavour="native", fmi=fmi)
        binary, _, _ = unpack(path, tmp_path / f"unpacked-{fmi}")
        listed = subprocess.run([nm, "-D", "--defined-only", binary], capture_output=True, text=True, check=True).stdout
        names = [line.split()[-1] for line in listed.splitlines()]
        assert names
        assert all(name.startswith(f"fmi{fmi}") for name in names)


@pytest.mark.acceptance
def test_the_program_that_memory_checkers_watch_counts_failures(tmp_path):
    """A foreign library fails the checks, so the checks can fail."""
    component = all_kinds()[0]
    _, described = watched(component, 2, tmp_path, [])
    message = json.loads(described.read_text())
    assert isinstance(Library(Path(message["binary"]), 2, "another"), Library)
    described.write_text(json.dumps({**message, "token": "another"}))
    process = subprocess.run([sys.executable, PROGRAM, described], capture_output=True, text=True)
    assert process.returncode == 1
    assert "0 failures" not in process.stdout
