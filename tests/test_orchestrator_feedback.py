"""Feedback: a cycle of connections is refused, taken a step late, or solved; a table servo shows what that means."""

import json
import math
from pathlib import Path

import numpy as np
import pytest

from foreign_fmus import build_foreign
from trihedron.tools.errors import InputError
from trihedron.tools.orchestrator import simulate
from trihedron.tools.orchestrator.scenario import Scenario, read_scenario

SCENARIOS = Path(__file__).resolve().parents[1] / "scenarios"
EARTH_RATE = 7.292115e-5


def servo(steps: int = 100, gain: float = 2.0, compiled: bool = True, **run: object) -> np.ndarray:
    """Error of the attitude about the inner axis [rad] after each step, with the one-sample algorithm."""
    data = read_scenario(SCENARIOS / "table-stabilised.toml").as_written()
    data["run"] = {"stop_s": 0.1 * steps, "step_s": 0.1, **run}
    data["fmus"]["computer"]["parameters"]["algorithm"] = 5
    data["fmus"]["controller"]["parameters"]["gain"] = gain
    return 2.0 * simulate(Scenario.model_validate(data), compiled=compiled).table["q3"].to_numpy()


def drift() -> float:
    """What the Earth adds about the inner axis in a step [rad]."""
    latitude = read_scenario(SCENARIOS / "table-stabilised.toml").fmus["table"].parameters["latitude"]
    return 0.1 * EARTH_RATE * math.sin(latitude)


def test_a_cycle_is_refused_where_the_scenario_does_not_say_how_to_take_it() -> None:
    data = read_scenario(SCENARIOS / "table-stabilised.toml").as_written()
    del data["run"]["coupling"]
    with pytest.raises(InputError, match=r"cycle: table -> .*coupling = \"jacobi\" or \"iterate\""):
        simulate(Scenario.model_validate(data))
    data["run"]["tolerance"] = 1e-6
    with pytest.raises(ValueError, match='tolerance goes with coupling = "iterate"'):
        Scenario.model_validate(data)


@pytest.mark.parametrize("compiled", [True, False])
def test_an_iterated_loop_is_the_implicit_solution(compiled: bool) -> None:
    """The command of a step follows from the attitude at the end of that very step."""
    share, error, expected = 0.2, 0.0, [0.0]
    for _ in range(100):
        error = (error + drift()) / (1.0 + share)
        expected.append(error)
    found = servo(coupling="iterate", compiled=compiled)
    np.testing.assert_allclose(found, expected, rtol=2e-4, atol=1e-11)
    assert found[-1] == pytest.approx(drift() / share, rel=1e-3)


@pytest.mark.parametrize("compiled", [True, False])
def test_a_loop_taken_a_step_late_is_a_delayed_recursion(compiled: bool) -> None:
    """Table, computer and controller each see the step before: the command acts three steps late."""
    share = 0.2
    expected = [0.0, 0.0]
    motion = [0.0, drift()]
    commands = [0.0, 0.0]
    for k in range(1, 100):
        # After step k: the computer has the increments to k, the controller the attitude to k - 1.
        expected.append(expected[-1] + motion[k])
        commands.append(commands[-1] - share * expected[k])
        motion.append(drift() + commands[k] - commands[k - 1])
    found = servo(coupling="jacobi", compiled=compiled)
    np.testing.assert_allclose(found, expected[: len(found)], rtol=2e-3, atol=1e-11)


def test_iteration_holds_where_delay_swings_up() -> None:
    """At nine tenths of a step's gain the delayed loop is unstable; the solved one is not."""
    delayed = servo(steps=60, gain=9.0, coupling="jacobi")
    solved = servo(steps=60, gain=9.0, coupling="iterate", iterations=1000)
    assert np.abs(delayed).max() > 100.0 * np.abs(solved).max()
    assert solved[-1] == pytest.approx(drift() / 0.9, rel=1e-3)


@pytest.mark.parametrize("compiled", [True, False])
def test_a_loop_that_does_not_settle_is_named(compiled: bool) -> None:
    says = (
        r"the cycle table -> computer -> controller -> table does not settle in 30 iterations at 0(\.\d)? s: '.*' still"
    )
    with pytest.raises(InputError, match=says):
        servo(gain=12.0, coupling="iterate", iterations=30, compiled=compiled)


def test_the_scenario_gives_its_reference_results(tmp_path: Path) -> None:
    reference = json.loads((SCENARIOS / "reference-results.json").read_text(encoding="utf-8"))["table-stabilised"]
    run = simulate(read_scenario(SCENARIOS / "table-stabilised.toml"), tmp_path / "run")
    names = ["alpha_deg", "beta_deg", "q1", "q2", "q3"]
    for time, expected in zip(reference["time_s"], reference["values"], strict=True):
        row = run.table.row(round(time / 0.1), named=True)
        assert [row[name] for name in names] == pytest.approx(expected, abs=1e-11)
    # The Earth has turned by 0.5 degrees; the block has kept its attitude about both axes to ten arcseconds.
    last = run.table.row(-1, named=True)
    assert 2.0 * max(abs(last["q1"]), abs(last["q3"])) < math.radians(10.0 / 3600.0)
    assert abs(last["beta_deg"]) > 0.3


def test_what_feeds_a_cycle_and_what_a_cycle_feeds_are_not_delayed(tmp_path: Path) -> None:
    """Only the connections of the cycle itself are taken late."""
    for script in ("foreign_clock", "foreign_gain", "foreign_accumulator"):
        build_foreign(script, tmp_path)
    scenario = {
        "base_folder": tmp_path,
        "run": {"stop_s": 1.0, "step_s": 0.1, "coupling": "jacobi"},
        "fmus": {
            "sum": {"fmu": "Accumulator.fmu"},
            "one": {"fmu": "Gain.fmu", "parameters": {"gain": 0.5}},
            "other": {"fmu": "Gain.fmu"},
            "clock": {"fmu": "Clock.fmu"},
        },
        "connections": [
            {"from": "clock.ended", "to": "one.u[1]"},
            {"from": "one.y[2]", "to": "other.u[2]"},
            {"from": "other.y[2]", "to": "one.u[2]"},
            {"from": "one.y[1]", "to": "sum.increment"},
        ],
    }
    run = simulate(Scenario.model_validate(scenario))
    assert run.provenance["order"] == ["clock", "one", "other", "sum"]
    ended = run.table["clock.ended"].to_numpy()
    np.testing.assert_allclose(run.table["sum.total"].to_numpy(), np.cumsum(0.5 * ended), rtol=1e-14)
    # Without a state that can be set back nothing can be iterated.
    scenario["run"]["coupling"] = "iterate"
    with pytest.raises(InputError, match=r"'one' \(Gain\.fmu\) cannot get and set its state"):
        simulate(Scenario.model_validate(scenario))
