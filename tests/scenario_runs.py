"""Scenarios of tests, mostly of foreign FMUs: run, or refused in one line."""

from pathlib import Path
from typing import Any

import pytest

from trihedron.tools.errors import InputError
from trihedron.tools.orchestrator import RunOptions, Scenario, Simulation, read_scenario, run_scenario, simulate_table

SCENARIOS = Path(__file__).resolve().parents[1] / "scenarios"
ONE_SECOND = {"stop_s": 1.0, "step_s": 0.1}
CLOCK, GAIN, ACCUMULATOR, FAILING = ({"fmu": f"{name}.fmu"} for name in ("Clock", "Gain", "Accumulator", "Failing"))


def scenario(folder: Path, fmus: dict[str, dict], **sections: Any) -> Scenario:
    """Return a scenario of one second in ten steps, unless its sections set other times."""
    settings = {"run": ONE_SECOND, "fmus": fmus, **sections}
    return Scenario.model_validate({**settings, "base_folder": folder})


def here(folder: Path, fmus: dict[str, dict], **sections: Any) -> Scenario:
    """Return the same scenario in this process: a process for each FMU is slow, and its place does not matter here."""
    settings = {"in_process": True, **sections.pop("run", ONE_SECOND)}
    return scenario(folder, fmus, run=settings, **sections)


def run(folder: Path, fmus: dict[str, dict], *, compiled: bool = True, **sections: Any) -> Simulation:
    """Run it in this process."""
    return run_scenario(here(folder, fmus, **sections), compiled=compiled)


def run_of_guests(folder: Path, fmus: dict[str, dict], *, compiled: bool = True, **sections: Any) -> Simulation:
    """Run it, each FMU from a file in a process of its own."""
    return run_scenario(scenario(folder, fmus, **sections), compiled=compiled)


def run_of_file(path: Path) -> Simulation:
    """Run a scenario's file in this process, with its averaged rests."""
    return simulate_table(RunOptions(in_process=True).over(read_scenario(path)))


def refusal(folder: Path, fmus: dict[str, dict], **sections: Any) -> str:
    """Return the one line of its refusal."""
    with pytest.raises(InputError) as refused:
        run(folder, fmus, **sections)
    assert "\n" not in str(refused.value)
    return str(refused.value)


def wires(*ends: str) -> list[dict[str, str]]:
    """Return connections from `source -> target` each."""
    return [dict(zip(("from", "to"), text.split(" -> "), strict=True)) for text in ends]
