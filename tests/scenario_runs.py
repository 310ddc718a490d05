"""Scenarios as tests write them, of foreign FMUs mostly: run, or refused in one line."""

from pathlib import Path
from typing import Any

import pytest

from trihedron.tools.errors import InputError
from trihedron.tools.orchestrator import Simulation, simulate
from trihedron.tools.orchestrator.scenario import Scenario

SCENARIOS = Path(__file__).resolve().parents[1] / "scenarios"
CLOCK, GAIN, ACCUMULATOR, FAILING = ({"fmu": f"{name}.fmu"} for name in ("Clock", "Gain", "Accumulator", "Failing"))


def scenario(folder: Path, fmus: dict[str, dict], **sections: Any) -> Scenario:
    """A scenario of one second in ten steps, where its sections say nothing else."""
    data = {"run": {"stop_s": 1.0, "step_s": 0.1}, "fmus": fmus, **sections}
    return Scenario.model_validate({**data, "base_folder": folder})


def run(folder: Path, fmus: dict[str, dict], *, compiled: bool = True, **sections: Any) -> Simulation:
    """Its run."""
    return simulate(scenario(folder, fmus, **sections), compiled=compiled)


def refusal(folder: Path, fmus: dict[str, dict], **sections: Any) -> str:
    """The one line with which it is refused."""
    with pytest.raises(InputError) as refused:
        run(folder, fmus, **sections)
    assert "\n" not in str(refused.value)
    return str(refused.value)


def wires(*ends: str) -> list[dict[str, str]]:
    """Connections from `source -> target` each."""
    return [dict(zip(("from", "to"), text.split(" -> "), strict=True)) for text in ends]
