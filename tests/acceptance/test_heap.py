"""FMUs of every flavour in the compiled master, watched by valgrind: no wrong write to memory."""

import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from trihedron.fmus import host_compiler

RUN = """
import sys
from pathlib import Path
from trihedron.fmus import build
from trihedron.tools.orchestrator import run_scenario
from trihedron.tools.orchestrator.scenario import Scenario

flavours = {"TurntableMotion": ("native", 3), "AccelerometerBlock": ("python", 2), "AttitudeComputer": ("native", 2)}
for name, (flavour, fmi) in flavours.items():
    build(name, Path(sys.argv[1]), flavour=flavour, fmi=fmi)
for turn in range(2):
    run_scenario(Scenario.model_validate({
        "run": {"stop_s": 1.0, "step_s": 0.01},
        "fmus": {name: {"fmu": f"{name}.fmu"} for name in flavours},
        "connections": [
            {"from": "TurntableMotion.specific_force", "to": "AccelerometerBlock.specific_force"},
            {"from": "TurntableMotion.increment", "to": "AttitudeComputer.increment"},
        ],
        "stimuli": [{"to": "TurntableMotion.command", "constant": [0.4, -0.3]}],
        "base_folder": Path(sys.argv[1]),
    }), Path(sys.argv[1]) / "out")
print("done")
"""
FAULT = re.compile(r"(?:Invalid (?:read|write|free)|Mismatched free|Source and destination overlap)")


@pytest.mark.acceptance
@pytest.mark.skipif(shutil.which("valgrind") is None, reason="skipped: no valgrind")
@pytest.mark.skipif(host_compiler() is None, reason="skipped: no C compiler")
def test_no_fault_in_the_master_nor_when_the_process_ends(tmp_path: Path) -> None:
    """PythonFMU's library used to release Python in freed memory, after the process had ended."""
    log = tmp_path / "valgrind.log"
    quiet = {"PYTHONMALLOC": "malloc", "POLARS_MAX_THREADS": "1"}
    command = ["valgrind", "--error-limit=no", "--num-callers=40", f"--log-file={log}", sys.executable, "-c", RUN]
    process = subprocess.run(
        [*command, tmp_path], capture_output=True, text=True, env={**os.environ, **quiet}, timeout=900
    )
    assert process.returncode == 0, process.stderr[-3000:]
    assert "done" in process.stdout
    blocks = re.split(r"\n==\d+== \n", log.read_text())
    # glibc's strncmp, reading a library's path, reads whole words.
    faults = [block for block in blocks if FAULT.search(block) and "expand_dynamic_string_token" not in block]
    faults = [block for block in faults if "fillin_rpath" not in block]
    assert faults == []
