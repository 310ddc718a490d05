"""Fixtures of the orchestrator's tests."""

from pathlib import Path

import pytest

from foreign_fmus import build_foreign, declaring


@pytest.fixture(scope="session")
def foreign(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a folder with the foreign FMUs Clock, Gain, Accumulator, Failing, and Adder: an accumulator of angles."""
    folder = tmp_path_factory.mktemp("foreign")
    for script in ("foreign_clock", "foreign_gain", "foreign_accumulator", "foreign_failing"):
        build_foreign(script, folder)
    declaring(folder / "Accumulator.fmu", folder / "Adder.fmu", {"increment": 'unit="rad"'})
    return folder
