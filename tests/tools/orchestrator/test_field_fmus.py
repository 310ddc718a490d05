"""FMUs from the field that once ended this program: each is refused in one line."""

import math
import os
import subprocess
import sys
from pathlib import Path

import fmpy
import pytest

from trihedron.tools import library

DATA = Path(os.environ.get("TRIHEDRON_DATA", Path(__file__).parents[4] / "shared" / "data"))
FIELD = DATA / "field"
GRAVITY = 9.81


@pytest.mark.acceptance
@pytest.mark.skipif(fmpy.platform != "linux64", reason="their libraries are for Linux")
@pytest.mark.parametrize(
    ("name", "message"),
    [
        ("h4_3", "sent a reply that cannot be read"),
        ("h21_3", "crashed (SIGBUS)"),
        ("empty-member-name", "has a member without a name ('')"),
    ],
)
def test_an_fmu_of_the_field_ends_its_own_run_only(name: str, message: str, tmp_path: Path) -> None:
    path = FIELD / f"{name}.fmu"
    if not path.is_file():
        pytest.skip(f"{path}: the records of the field are not here")
    command = [sys.executable, "-m", "trihedron.tools.cli", "simulate", str(path), "--out", "out"]
    process = subprocess.run(command, capture_output=True, text=True, cwd=tmp_path, timeout=120)
    assert (process.returncode, process.stdout, process.stderr.count("\n")) == (2, "", 1), process.stderr
    assert message in process.stderr


def test_the_step_of_an_fmu_of_the_field_is_greater_than_zero(tmp_path: Path) -> None:
    path = FIELD / "BouncingBall_ME.fmu"
    if not path.is_file():
        pytest.skip(f"{path}: the records of the field are not here")
    command = [sys.executable, "-m", "trihedron.tools.cli", "simulate", str(path), "--step", "0", "--out", "out"]
    process = subprocess.run(command, capture_output=True, text=True, cwd=tmp_path, timeout=120)
    assert (process.returncode, process.stderr) == (2, "trihedron: --step 0: must be greater than 0 s\n")
    assert not (tmp_path / "out").exists()


def height(time: float) -> float:
    """Return the height of a ball that falls from 1 m and keeps 0.7 of its speed at each bounce, first moves only."""
    begin, duration, speed = math.sqrt(2.0 / GRAVITY), 0.0, GRAVITY * math.sqrt(2.0 / GRAVITY)
    if time <= begin:
        return 1.0 - 0.5 * GRAVITY * time * time
    while time > begin + duration:
        begin, speed = begin + duration, 0.7 * speed
        duration = 2.0 * speed / GRAVITY
    return speed * (time - begin) - 0.5 * GRAVITY * (time - begin) ** 2


@pytest.mark.acceptance
def test_the_error_of_model_exchange_does_not_grow_as_the_step_shrinks() -> None:
    path = FIELD / "BouncingBall_ME.fmu"
    if not path.is_file():
        pytest.skip(f"{path}: the records of the field are not here")
    errors = []
    for step in (0.1, 0.01, 0.001):
        table = library.simulate(path, stop=2.0, step=step, record=["h"]).table
        exact = [height(time) for time in table["time_s"]]
        errors.append(max(abs(a - b) for a, b in zip(table[:, 1], exact, strict=True)))
    assert errors[0] < 5e-6
    assert errors == sorted(errors, reverse=True)
