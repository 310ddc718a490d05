"""Connections: directions, types, units, order; a feedback refused, taken a step late, or solved."""

import math
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from foreign_fmus import declaring, rewritten
from scenario_runs import ACCUMULATOR, CLOCK, GAIN, SCENARIOS, refusal, run, wires
from trihedron.tools.errors import InputError
from trihedron.tools.orchestrator import (
    FmuVariable,
    Scenario,
    Wire,
    read_scenario,
    run_scenario,
    scale_of,
    stepping_groups,
)
from trihedron.tools.orchestrator.interface import between

PAIR = {"clock": CLOCK, "gain": GAIN}
EARTH_RATE = 7.292115e-5


@pytest.mark.parametrize(
    ("connection", "says"),
    [
        ("clok.ended -> gain.u[1]", "there is no FMU 'clok'; did you mean 'clock'?"),
        ("clock.endet -> gain.u[1]", "'clock' has no variable 'endet'; did you mean 'ended'?"),
        ("clock.ended -> gain.u[3]", "'gain' has no variable 'u[3]'; u has elements 1 to 2"),
        ("clock.ended -> gain.u", "1 and 2 elements"),
        ("clock.ended -> gain.count", "types differ, Real and Integer"),
        ("clock.count -> gain.mark", "types differ, Integer and Boolean"),
        ("clock.ended -> gain.y[1]", "'gain.y[1]' is not an input (output); did you mean 'u[1]'?"),
        ("gain.u[1] -> gain.u[2]", "'gain.u[1]' is not an output (input)"),
        ("clock -> gain.u[1]", "'clock' must name an FMU and a variable"),
    ],
)
def test_a_wrong_connection(foreign: Path, connection: str, says: str) -> None:
    message = refusal(foreign, PAIR, connections=wires(connection))
    assert message.startswith("connections[1]: ")
    assert says in message


@pytest.mark.parametrize("compiled", [True, False])
def test_a_real_input_takes_whole_numbers(foreign: Path, compiled: bool) -> None:
    sections = {"run": {"stop_s": 1.0, "step_s": 0.25}, "connections": wires("clock.count -> gain.u[1]")}
    table = run(foreign, PAIR, compiled=compiled, **sections).table
    assert table["gain.y[1]"].to_list() == table["clock.count"].to_list()
    assert table["clock.count"][-1] == 4


def test_an_input_has_one_source(foreign: Path) -> None:
    pair = wires("clock.ended -> gain.u[1]", "clock.began -> gain.u[1]")
    message = refusal(foreign, PAIR, connections=pair)
    assert message == "'gain.u[1]' has two sources, 'clock.ended' and 'clock.began'; one is possible"
    message = refusal(foreign, PAIR, connections=pair[:1], stimuli=[{"to": "gain.u", "constant": [1.0, 2.0]}])
    assert message == "'gain.u[1]' has two sources, 'clock.ended' and stimuli[1]; one is possible"


def passed_on(folder: Path, tmp_path: Path, units: tuple[str, str], definitions: str = "", compiled: bool = True):
    """Return a clock's time after a gain of 1 when both declare a unit; `definitions` are those of the gain."""
    declaring(folder / "Clock.fmu", tmp_path / "Clock.fmu", {"ended": f'unit="{units[0]}"'})
    declaring(folder / "Gain.fmu", tmp_path / "Half.fmu", {"u[1]": f'unit="{units[1]}"'})

    def define(name: str, content: bytes) -> tuple[str, bytes]:
        if name == "modelDescription.xml" and definitions:
            content = content.replace(b"<ModelVariables>", definitions.encode() + b"<ModelVariables>")
        return name, content

    rewritten(tmp_path / "Half.fmu", tmp_path / "Gain.fmu", define)
    sections = {"run": {"stop_s": 1.0, "step_s": 0.25}, "connections": wires("clock.ended -> gain.u[1]")}
    return run(tmp_path, PAIR, compiled=compiled, **sections).table["gain.y[1]"].to_list()


@pytest.mark.parametrize("compiled", [True, False])
@pytest.mark.parametrize(
    ("output", "input_", "factor"),
    [
        ("rad", "deg", 180.0 / math.pi),
        ("deg", "rad", math.pi / 180.0),
        ("m/s2", "g", 1.0 / 9.80665),
        ("g", "m/s2", 9.80665),
        ("rad/s", "deg/s", 180.0 / math.pi),
        ("rad/h", "rad/s", 1.0 / 3600.0),
        ("arcsec", "arcsec", 1.0),
        ("furlong", "furlong", 1.0),
    ],
)
def test_units_of_one_dimension_are_converted(foreign, tmp_path, output, input_, factor, compiled) -> None:
    passed = passed_on(foreign, tmp_path, (output, input_), compiled=compiled)
    assert passed[1:] == pytest.approx([factor * 0.25 * k for k in range(1, 5)], rel=1e-15)


@pytest.mark.parametrize(("output", "input_"), [("rad", "1"), ("rad", "m/s2"), ("s", "furlong"), ("deg", "deg/s")])
def test_other_dimensions_are_refused_by_both_names(foreign: Path, tmp_path: Path, output: str, input_: str) -> None:
    with pytest.raises(InputError, match=rf"'clock\.ended' -> 'gain\.u\[1\]': units differ, {output} and {input_}$"):
        passed_on(foreign, tmp_path, (output, input_))


def test_what_an_fmu_defines_comes_before_what_we_know(foreign: Path, tmp_path: Path) -> None:
    """A gram is not gravity; a unit of its own is converted by its factor."""
    gram = '<UnitDefinitions><Unit name="g"><BaseUnit kg="1" factor="1e-3"/></Unit></UnitDefinitions>'
    for output in ("m/s2", "g"):
        with pytest.raises(InputError, match=rf"units differ, {output} and g$"):
            passed_on(foreign, tmp_path, (output, "g"), gram)
    turn = '<UnitDefinitions><Unit name="rev"><BaseUnit rad="1" factor="6.283185307179586"/></Unit></UnitDefinitions>'
    assert passed_on(foreign, tmp_path, ("rad", "rev"), turn)[-1] == pytest.approx(1.0 / (2.0 * math.pi), rel=1e-15)


def test_offsets_of_temperatures_and_digits_that_a_description_leaves_off() -> None:
    kelvin, short = {"K": scale_of({"K": 1})}, {"deg": scale_of({"rad": 1}, 0.01745329)}
    assert between("degC", "K", {}, kelvin, relative=False) == (1.0, 273.15)
    assert between("degC", "K", {}, kelvin, relative=True) == (1.0, 0.0)
    assert between("K", "degC", kelvin, {}, relative=False) == (1.0, -273.15)
    assert between("deg", "deg", short, {}, relative=False) == (1.0, 0.0)


def order_of(names: list[str], edges: list[tuple[int, int]]) -> list[str]:
    """Return the stepping order of FMUs that feed each other."""
    port = FmuVariable("x", "Real", "Real", 0, "output", "continuous")
    laid = [Wire(f"f{source}", port, f"f{target}", port) for source, target in edges]
    return [name for group in stepping_groups(names, laid, None) for name in group.members]


@pytest.mark.acceptance
@given(st.integers(1, 7), st.data())
def test_fmus_step_after_those_that_feed_them_and_else_as_in_the_file(count: int, draws: st.DataObject) -> None:
    names = [f"f{i}" for i in range(count)]
    rank = draws.draw(st.permutations(range(count)))
    pairs = [(a, b) for a in range(count) for b in range(count) if rank[a] < rank[b]]
    edges = draws.draw(st.lists(st.sampled_from(pairs), max_size=10)) if pairs else []
    order = order_of(names, edges)
    assert sorted(order) == names
    place = {name: i for i, name in enumerate(order)}
    assert all(place[f"f{a}"] < place[f"f{b}"] for a, b in edges)
    for i, name in enumerate(order):
        # An FMU that steps earlier although it is later in the file waited for none while the other still waited.
        for later in order[i + 1 :]:
            if names.index(later) < names.index(name):
                assert any(f"f{b}" == later and place[f"f{a}"] >= i for a, b in edges)


@given(st.lists(st.integers(0, 5), min_size=1, max_size=5, unique=True))
def test_a_cycle_is_named_whole(members: list[int]) -> None:
    around = list(pairwise([*members, members[0]]))
    with pytest.raises(InputError, match='coupling = "jacobi", "iterate" or "delayed"') as refused:
        order_of([f"f{i}" for i in range(6)], around)
    named_cycle = str(refused.value).split(": ")[1].split(";")[0].split(" -> ")
    assert named_cycle[0] == named_cycle[-1] == f"f{min(members)}"
    assert set(pairwise(named_cycle)) == {(f"f{a}", f"f{b}") for a, b in around}


def servo(steps: int = 100, gain: float = 2.0, compiled: bool = True, **settings: object) -> np.ndarray:
    """Return the error of the attitude about the inner axis [rad] after each step, with the one-sample algorithm."""
    document = read_scenario(SCENARIOS / "table-stabilised.toml").as_written()
    document["run"] = {"stop_s": 0.1 * steps, "step_s": 0.1, **settings}
    document["fmus"]["computer"]["parameters"]["algorithm"] = 5
    document["fmus"]["controller"]["parameters"]["gain"] = gain
    return 2.0 * run_scenario(Scenario.model_validate(document), compiled=compiled).table["q3"].to_numpy()


def drift() -> float:
    """Return the Earth's turn about the inner axis in a step [rad]."""
    latitude = read_scenario(SCENARIOS / "table-stabilised.toml").fmus["table"].parameters["latitude"]
    return 0.1 * EARTH_RATE * math.sin(latitude)


@pytest.mark.parametrize("compiled", [True, False])
def test_an_iterated_loop_is_the_implicit_solution(compiled: bool) -> None:
    """The command of a step follows from the attitude at the end of that very step."""
    share, error, expected = 0.2, 0.0, [0.0]
    for _ in range(100):
        error = (error + drift()) / (1.0 + share)
        expected.append(error)
    errors = servo(coupling="iterate", compiled=compiled)
    np.testing.assert_allclose(errors, expected, rtol=2e-4, atol=1e-11)
    assert errors[-1] == pytest.approx(drift() / share, rel=1e-3)


@pytest.mark.parametrize("compiled", [True, False])
def test_a_loop_taken_a_step_late_is_a_delayed_recursion(compiled: bool) -> None:
    """Table, computer and controller each use the previous step: the command acts three steps late."""
    share, expected, motion, commands = 0.2, [0.0, 0.0], [0.0, drift()], [0.0, 0.0]
    for k in range(1, 100):
        # After step k: the computer has the increments to k, the controller the attitude to k - 1.
        expected.append(expected[-1] + motion[k])
        commands.append(commands[-1] - share * expected[k])
        motion.append(drift() + commands[k] - commands[k - 1])
    errors = servo(coupling="jacobi", compiled=compiled)
    np.testing.assert_allclose(errors, expected[: len(errors)], rtol=2e-3, atol=1e-11)


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


def test_what_feeds_a_cycle_and_what_a_cycle_feeds_are_not_delayed(foreign: Path) -> None:
    """Only the connections of the cycle itself are taken late."""
    fmus = {"sum": ACCUMULATOR, "one": {**GAIN, "parameters": {"gain": 0.5}}, "other": GAIN, "clock": CLOCK}
    sections = {
        "run": {"stop_s": 1.0, "step_s": 0.1, "coupling": "jacobi"},
        "connections": wires(
            "clock.ended -> one.u[1]",
            "one.y[2] -> other.u[2]",
            "other.y[2] -> one.u[2]",
            "one.y[1] -> sum.increment",
        ),
    }
    simulation = run(foreign, fmus, **sections)
    assert simulation.provenance["order"] == ["clock", "one", "other", "sum"]
    ended = simulation.table["clock.ended"].to_numpy()
    np.testing.assert_allclose(simulation.table["sum.total"].to_numpy(), np.cumsum(0.5 * ended), rtol=1e-14)
    # Without a restorable state nothing can be iterated.
    sections["run"]["coupling"] = "iterate"
    assert "'one' (Gain.fmu) cannot get and set its state" in refusal(foreign, fmus, **sections)
