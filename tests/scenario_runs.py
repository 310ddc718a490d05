"""Scenarios as tests write them, of foreign FMUs mostly: run, or refused in one line."""

from pathlib import Path
from typing import Any

import pytest

from trihedron.tools.errors import InputError
from trihedron.tools.orchestrator import RunOptions, Scenario, Simulation, read_scenario, run_scenario, simulate_table

SCENARIOS = Path(__file__).resolve().parents[1] / "scenarios"
ONE_SECOND = {"stop_s": 1.0, "step_s": 0.1}
CLOCK, GAIN, ACCUMULATOR, FAILING = ({"fmu": f"{name}.fmu"} for name in ("Clock", "Gain", "Accumulator", "Failing"))


def scenario(folder: Path, fmus: dict[str, dict], **sections: Any) -> Scenario:
    """A scenario of one second in ten steps, where its sections say nothing else."""
    settings = {"run": ONE_SECOND, "fmus": fmus, **sections}
    return Scenario.model_validate({**settings, "base_folder": folder})


def here(folder: Path, fmus: dict[str, dict], **sections: Any) -> Scenario:
    """Return the same scenario in this process: a process for each FMU is slow, and its place does not matter here."""
    settings = {"in_process": True, **sections.pop("run", ONE_SECOND)}
    return scenario(folder, fmus, run=settings, **sections)


def run(folder: Path, fmus: dict[str, dict], *, compiled: bool = True, **sections: Any) -> Simulation:
    """Its run in this process."""
    return run_scenario(here(folder, fmus, **sections), compiled=compiled)


def run_of_guests(folder: Path, fmus: dict[str, dict], *, compiled: bool = True, **sections: Any) -> Simulation:
    """Its run, each FMU from a file in a process of its own."""
    return run_scenario(scenario(folder, fmus, **sections), compiled=compiled)


def run_of_file(path: Path) -> Simulation:
    """The run of a scenario's file in this process, with its averaged rests."""
    return simulate_table(RunOptions(in_process=True).over(read_scenario(path)))


def refusal(folder: Path, fmus: dict[str, dict], **sections: Any) -> str:
    """The one line with which it is refused."""
    with pytest.raises(InputError) as refused:
        run(folder, fmus, **sections)
    assert "\n" not in str(refused.value)
    return str(refused.value)


def wires(*ends: str) -> list[dict[str, str]]:
    """Connections from `source -> target` each."""
    return [dict(zip(("from", "to"), text.split(" -> "), strict=True)) for text in ends]
