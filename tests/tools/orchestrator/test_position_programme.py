"""The component PositionProgramme gives the commands of the orchestrator's position programme."""

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from named import Named
from trihedron.tools.orchestrator import Scenario, run_scenario

SLOW = {"max_rate": [0.3, 0.5], "max_acceleration": [0.4, 0.2], "initial_angle": [0.2, -0.1]}


def programme(alpha: Sequence[float], beta: Sequence[float], dwell: Sequence[float], **values: Any) -> Named:
    """Return the component after initialisation, with these positions."""
    rows = {"alpha": alpha, "beta": beta, "dwell_time": dwell}
    elements = {f"{name}[{i}]": x for name, numbers in rows.items() for i, x in enumerate(numbers, 1)}
    return Named("PositionProgramme", positions=len(alpha), **elements, **values).begin()


def by_stimulus(rows: list[tuple[float, float, float]], step: float, start: float) -> np.ndarray:
    """Return the table's run under a programme of (alpha [deg], beta [deg], dwell [s])."""
    alpha, beta, dwell = (list(column) for column in zip(*rows, strict=True))
    stimulus = {"to": "table.command", "table": {"alpha_deg": alpha, "beta_deg": beta, "dwell_s": dwell}}
    scenario = Scenario.model_validate(
        {
            "run": {"start_s": start, "step_s": step},
            "fmus": {"table": {"component": "TurntableMotion", "parameters": SLOW}},
            "stimuli": [stimulus],
        }
    )
    return run_scenario(scenario).table.to_numpy()


def by_component(rows: list[tuple[float, float, float]], step: float, start: float, steps: int) -> np.ndarray:
    """Return the same table under the component's commands, coupled by a scenario."""
    alpha, beta, dwell = (np.array(column) for column in zip(*rows, strict=True))
    values = {"alpha": np.radians(alpha), "beta": np.radians(beta), "dwell_time": dwell}
    elements = {f"{name}[{i + 1}]": float(x) for name, numbers in values.items() for i, x in enumerate(numbers)}
    parameters = {"positions": len(rows), **SLOW, **elements}
    scenario = Scenario.model_validate(
        {
            "run": {"start_s": start, "stop_s": start + steps * step, "step_s": step},
            "fmus": {
                "table": {"component": "TurntableMotion", "parameters": SLOW},
                "programme": {"component": "PositionProgramme", "parameters": parameters},
            },
            "connections": [{"from": "programme.command", "to": "table.command"}],
        }
    )
    return run_scenario(scenario).table.select(r"^(time_s|table\..*)$").to_numpy()


@pytest.mark.parametrize(("step", "start"), [(0.1, 0.0), (0.03, 7.0)])
def test_the_table_moves_as_under_the_stimulus(step, start):
    rows = [(20.0, 25.0, 1.0), (20.0, 145.0, 0.37), (-80.0, 145.0, 0.5), (-80.0, 145.0, 0.01)]
    expected = by_stimulus(rows, step, start)
    simulation = by_component(rows, step, start, len(expected) - 1)
    assert len(np.unique(expected[:, 1])) > 20
    assert np.array_equal(simulation, expected)


angles = st.floats(-400.0, 400.0)
positions = st.lists(st.tuples(angles, angles, st.floats(0.01, 3.0)), min_size=1, max_size=6)


@pytest.mark.acceptance
@settings(max_examples=40)
@given(positions, st.sampled_from([0.1, 0.013, 1.0]), st.sampled_from([0, 1]))
def test_commands_over_every_step(rows, step, lead):
    from trihedron.models.table_commands import move_duration

    alpha, beta, dwell = (list(column) for column in zip(*rows, strict=True))
    outer, inner = np.radians([alpha, beta]).tolist()
    targets = [[a, b] for a, b in zip(outer, inner, strict=True)]
    model = programme(outer, inner, dwell, lead_steps=lead, **SLOW)
    # By the contracts and docs/scenarios.md, a slot is the slower axis' move and the dwell, in whole steps.
    ends, before = [0], SLOW["initial_angle"]
    for target, rest in zip(targets, dwell, strict=True):
        durations = [
            move_duration(abs(target[i] - before[i]), SLOW["max_rate"][i], SLOW["max_acceleration"][i]) for i in (0, 1)
        ]
        ends.append(ends[-1] + math.ceil((max(durations) + rest) / step - 1e-9))
        before = target
    assert model["command"].tolist() == targets[0]
    steps = min(ends[-1] + 3, 1500)
    for k in range(steps):
        model.step(k * step, step)
        holding = sum(end <= k + lead for end in ends[1:-1])
        assert model["command"].tolist() == targets[holding]
        assert model["position"] == holding + 1
        assert model["finished"] == float(k + 1 >= ends[-1])


def test_a_host_may_split_steps_and_add_up_rounded_times():
    model = programme((0.0, 1.0), (0.0, 1.0), (1.0, 1.0), period=0.1)
    changed, time = [], 0.0
    for k in range(60):
        changed += [k] if model.step(time, 0.05)["command"].tolist() == [1.0, 1.0] else []
        time += 0.05
    assert changed[0] == 20
    assert model.step(time, 1e-14)["command"].tolist() == [1.0, 1.0]


def test_a_slot_that_no_run_can_hold_is_refused():
    assert Named("PositionProgramme", **{"dwell_time[1]": 1e9}).begin().refuses_step(0.0, 0.1)
    with pytest.raises(ValueError, match=r"positions = 129\.0 is outside \[1\.0, 128\.0\]"):
        Named("PositionProgramme", positions=129)
