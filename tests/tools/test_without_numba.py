"""Without numba, which is an extra, plain Python computes everything: the same bytes."""

import subprocess
import sys
from dataclasses import replace

import numpy as np
import pytest

from generator.stands import random_bench, simulated
from trihedron.models.rotation import multiply
from trihedron.tools import compiled, installation
from trihedron.tools.cli import main
from trihedron.tools.records import write_record

WITHOUT = """
import sys
sys.modules["numba"] = sys.modules["llvmlite"] = None
from trihedron.tools.cli import main
sys.exit(main(sys.argv[1:]))
"""
G = 9.80665


@pytest.mark.acceptance
def test_a_search_and_a_record_that_moves_are_the_same_bytes(tmp_path, monkeypatch):
    """The search after a falsification calls the bounds, the drawn motion the kernels: both are numba's loops."""
    rng = np.random.default_rng(3)
    clean = simulated(random_bench(rng), noise=rng.uniform(-1e-5, 1e-5, (24, 3)))
    force = clean.specific_force + 4e-4 * G * np.array([1.0, 0.0, 0.0]) * (clean.specific_force / G) ** 2
    folders = (tmp_path / "with", tmp_path / "without")
    for folder in folders:
        folder.mkdir()
        write_record(replace(clean, specific_force=force), folder / "measured.csv")
    for written, *command in (
        ("moved.csv", "hidden", "moved.csv", "--strapdown", "--seed", "2", "--quiet"),
        ("found.json", "diagnose", "measured.csv", "--noise-bound", "1e-5", "--json", "found.json", "--quiet"),
    ):
        run = [sys.executable, "-c", WITHOUT, *command]
        process = subprocess.run(run, cwd=folders[1], capture_output=True, text=True, check=False)
        assert (process.returncode, process.stderr) == (0, "")
        monkeypatch.chdir(folders[0])
        assert main(command) == 0
        assert (folders[0] / written).read_bytes() == (folders[1] / written).read_bytes()


def test_what_is_not_compiled_is_the_function_itself(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(compiled, "COMPILES", False)
    compiled.compiled.cache_clear()
    assert compiled.compiled(multiply) is multiply
    assert compiled.loop_compiled(multiply) is compiled.compile_callee(multiply) is multiply
    compiled.compiled.cache_clear()


def test_the_doctor_says_what_to_install(monkeypatch: pytest.MonkeyPatch):
    version = installation._version
    monkeypatch.setattr(installation, "_version", lambda name: None if name == "numba" else version(name))
    output = {finding.subject: finding for finding in installation._packages()}
    assert output["libraries"].good
    assert output["extra fast"].state.endswith('; pip install "trihedron[fast]"')
    assert output["extra fast"].good is None
