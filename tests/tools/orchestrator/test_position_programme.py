"""The component PositionProgramme gives the commands that the orchestrator's position programme gives."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from trihedron.fmus import components
from trihedron.fmus.source import Instance, instantiate, references
from trihedron.tools.orchestrator import simulate
from trihedron.tools.orchestrator.scenario import Scenario

PROGRAMME = components()["PositionProgramme"]
AT = references(PROGRAMME)
SLOW = {"max_rate": [0.3, 0.5], "max_acceleration": [0.4, 0.2], "initial_angle": [0.2, -0.1]}


def started(values: dict[str, list[float]], start: float = 0.0) -> Instance:
    """The component after initialisation."""
    model = instantiate(PROGRAMME)
    for name, numbers in values.items():
        for i, number in enumerate(numbers):
            model.set(AT.get(name) or AT[f"{name}[{i + 1}]"], float(number))
    assert model.initialise(start) == 0
    return model


def commanded(model: Instance) -> tuple[float, float]:
    return model.get(AT["command[1]"]), model.get(AT["command[2]"])


def by_stimulus(rows: list[tuple[float, float, float]], step: float, start: float) -> np.ndarray:
    """The table's run under a programme of (alpha [deg], beta [deg], dwell [s])."""
    alpha, beta, dwell = (list(column) for column in zip(*rows, strict=True))
    stimulus = {"to": "table.command", "table": {"alpha_deg": alpha, "beta_deg": beta, "dwell_s": dwell}}
    scenario = Scenario.model_validate(
        {
            "run": {"start_s": start, "step_s": step},
            "fmus": {"table": {"component": "TurntableMotion", "parameters": SLOW}},
            "stimuli": [stimulus],
        }
    )
    return simulate(scenario).table.to_numpy()


def by_component(rows: list[tuple[float, float, float]], step: float, start: float, steps: int) -> np.ndarray:
    """The same table under the component's commands, coupled as a scenario couples them."""
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
    return simulate(scenario).table.select(r"^(time_s|table\..*)$").to_numpy()


@pytest.mark.parametrize(("step", "start"), [(0.1, 0.0), (0.03, 7.0)])
def test_the_table_moves_as_under_the_stimulus(step, start):
    rows = [(20.0, 25.0, 1.0), (20.0, 145.0, 0.37), (-80.0, 145.0, 0.5), (-80.0, 145.0, 0.01)]
    expected = by_stimulus(rows, step, start)
    found = by_component(rows, step, start, len(expected) - 1)
    assert len(np.unique(expected[:, 1])) > 20
    assert np.array_equal(found, expected)


angles = st.floats(-400.0, 400.0)
positions = st.lists(st.tuples(angles, angles, st.floats(0.01, 3.0)), min_size=1, max_size=6)


@settings(max_examples=40)
@given(positions, st.sampled_from([0.1, 0.013, 1.0]), st.sampled_from([0, 1]))
def test_commands_over_every_step(rows, step, lead):
    from trihedron.models.table_commands import move_duration

    alpha, beta, dwell = (list(column) for column in zip(*rows, strict=True))
    targets = np.radians(np.column_stack([alpha, beta])).tolist()
    model = started(
        {
            "positions": [len(rows)],
            "alpha": [a for a, _ in targets],
            "beta": [b for _, b in targets],
            "dwell_time": dwell,
            "lead_steps": [lead],
            **SLOW,
        }
    )
    # As contracts and docs/scenarios.md have it: a slot is the slower axis' move and the dwell, in whole steps.
    ends, before = [0], SLOW["initial_angle"]
    for target, rest in zip(targets, dwell, strict=True):
        durations = [
            move_duration(abs(target[i] - before[i]), SLOW["max_rate"][i], SLOW["max_acceleration"][i]) for i in (0, 1)
        ]
        ends.append(ends[-1] + math.ceil((max(durations) + rest) / step - 1e-9))
        before = target
    assert commanded(model) == tuple(targets[0])
    steps = min(ends[-1] + 3, 1500)
    for k in range(steps):
        assert model.do_step(k * step, step) == 0
        holding = sum(end <= k + lead for end in ends[1:-1])
        assert commanded(model) == tuple(targets[holding])
        assert model.get(AT["position"]) == holding + 1
        assert model.get(AT["finished"]) == float(k + 1 >= ends[-1])


def test_a_host_may_split_steps_and_add_up_rounded_times():
    values = {"positions": [2], "alpha": [0.0, 1.0], "beta": [0.0, 1.0], "dwell_time": [1.0, 1.0], "period": [0.1]}
    model = started(values)
    changed, time = [], 0.0
    for k in range(60):
        assert model.do_step(time, 0.05) == 0
        changed += [k] if commanded(model) == (1.0, 1.0) else []
        time += 0.05
    assert changed[0] == 20
    assert model.do_step(time, 1e-14) == 0
    assert commanded(model) == (1.0, 1.0)


def test_a_slot_that_no_run_can_hold_is_refused():
    model = started({"dwell_time": [1e9]})
    assert model.do_step(0.0, 0.1) == 1
    with pytest.raises(ValueError, match=r"positions = 129\.0 is outside \[1\.0, 128\.0\]"):
        started({"positions": [129]})
