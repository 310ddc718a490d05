"""FMUs of different steps: held, interpolated, summed, exact if possible; compared with one rate."""

import shutil
from itertools import product
from pathlib import Path

import numpy as np
import polars as pl
import pytest

from foreign_fmus import compile_foreign
from scenario_runs import ACCUMULATOR, CLOCK, FAILING, GAIN, SCENARIOS, refusal, run_of_guests, wires
from trihedron.tools.orchestrator import Scenario, read_scenario, run_scenario

BASE, SLOW = 0.125, 0.5
"""Steps whose times are exact."""
SECONDS = {"stop_s": 4.0, "step_s": BASE}
T = BASE * np.arange(33)
HELD = SLOW * np.floor(T / SLOW)


def slow(fmu: dict, step: float = SLOW, **options: object) -> dict:
    return {**fmu, "step_s": step, **options}


def between(way: str | None, *ends: str) -> list[dict]:
    return [{**wire, **({"between": way} if way else {})} for wire in wires(*ends)]


@pytest.mark.acceptance
@pytest.mark.parametrize("compiled", [True, False])
@pytest.mark.parametrize("options", [True, False])
def test_a_fast_one_hears_a_slow_one_held_or_interpolated(foreign: Path, compiled: bool, options: bool) -> None:
    fmus = {"fast": GAIN, "slow": slow(CLOCK)}
    setting = {**SECONDS, "in_process": options}
    for way, expected in (("hold", HELD), ("interpolate", T)):
        wired = between(way, "slow.ended -> fast.u[1]")
        table = run_of_guests(foreign, fmus, run=setting, connections=wired, compiled=compiled).table
        assert table["fast.y[1]"].to_list() == expected.tolist()
        # The record has its own times, ahead or not.
        assert table["slow.ended"].to_list() == HELD.tolist()
        assert table["slow.began"].to_list() == np.maximum(HELD - SLOW, 0.0).tolist()
        assert set(table["slow.step"][4:]) == {SLOW}
        assert table["slow.count"].to_list() == np.floor(T / SLOW).astype(int).tolist()


@pytest.mark.acceptance
@pytest.mark.parametrize("compiled", [True, False])
@pytest.mark.parametrize("coupling", [None, "delayed"])
def test_a_slow_one_hears_what_a_fast_one_put_out_last_or_the_sum(foreign, compiled, coupling) -> None:
    """Its inputs are those of the end of its step as at one rate; delayed, those of its beginning."""
    fmus = {"last": slow(GAIN), "all": slow(ACCUMULATOR), "fast": CLOCK}
    wired = between("hold", "fast.ended -> last.u[1]") + between("sum", "fast.step -> all.increment")
    setting = {**SECONDS, **({"coupling": coupling} if coupling else {})}
    table = run_of_guests(foreign, fmus, run=setting, connections=wired, compiled=compiled).table
    expected = HELD if coupling is None else np.maximum(HELD - SLOW, 0.0)
    assert table["last.y[1]"].to_list() == expected.tolist()
    assert table["all.total"].to_list() == expected.tolist()


@pytest.mark.acceptance
@pytest.mark.parametrize("coupling", [None, "delayed"])
def test_slow_through_slow_to_fast(foreign: Path, coupling: str | None) -> None:
    """FMUs that feed one which steps ahead step ahead, too: no value comes later for it."""
    fmus = {"fast": GAIN, "mid": slow(GAIN), "source": slow(CLOCK), "slowest": slow(CLOCK, 1.0)}
    wired = wires("source.ended -> mid.u[1]") + between("interpolate", "mid.y[1] -> fast.u[1]")
    wired += between("interpolate", "slowest.ended -> mid.u[2]") + between("hold", "slowest.ended -> fast.u[2]")
    setting = {**SECONDS, **({"coupling": coupling} if coupling else {})}
    columns = {name: name for name in ("fast.y[1]", "fast.y[2]", "mid.y[2]")}
    table = run_of_guests(foreign, fmus, run=setting, connections=wired, record={"columns": columns}).table
    if coupling is None:
        assert table["fast.y[1]"].to_list() == T.tolist()
        assert table["mid.y[2]"].to_list() == HELD.tolist()
        assert table["fast.y[2]"].to_list() == np.floor(T).tolist()
    else:
        # As at one rate, except that each is later by its reader's step.
        assert table["fast.y[1]"].to_list() == np.maximum(T - BASE - SLOW, 0.0).tolist()
        assert table["mid.y[2]"].to_list() == np.maximum(HELD - SLOW, 0.0).tolist()
        assert table["fast.y[2]"].to_list() == np.floor(np.maximum(T - BASE, 0.0)).tolist()


def wave(step: float, seconds: float) -> pl.DataFrame:
    times = step * np.arange(round(seconds / step) + 1)
    return pl.DataFrame({"time_s": times, "u": times - np.sin(times)})


def integral(foreign: Path, way: str, stride: int, coupling: str | None) -> float:
    """Compare the integral of t - sin t over two seconds, by a slow FMU summed by a fast one, with that at one rate."""
    base, sums = 2.0**-8, []
    setting = {"stop_s": 2.0, "step_s": base, "in_process": True, **({"coupling": coupling} if coupling else {})}
    for factor in (1, stride):
        rows = {"table": wave(factor * base, 2.0), "columns": {"source.u[1]": "u"}, "stamp": "end"}
        fmus = {"sum": ACCUMULATOR, "source": slow(GAIN, factor * base)}
        wired = between(way, "source.y[1] -> sum.increment")
        record = {"columns": {"total": "sum.total"}}
        table = run_of_guests(foreign, fmus, run=setting, connections=wired, stimuli=[rows], record=record).table
        sums.append(base * table["total"][-1])
    return abs(sums[1] - sums[0])


@pytest.mark.first(1)
@pytest.mark.parametrize("coupling", [None, "delayed"])
@pytest.mark.parametrize(("way", "order"), [("hold", 1.0), ("interpolate", 2.0)])
def test_the_order_in_the_slow_step_against_one_rate(foreign, way: str, order: float, coupling: str | None) -> None:
    errors = [integral(foreign, way, stride, coupling) for stride in (8, 16, 32)]
    orders = np.log2(np.divide(errors[1:], errors[:-1]))
    assert orders == pytest.approx(order, abs=0.25), errors


def servo(step: float, stride: int, way: str, **setting: object) -> np.ndarray:
    """Return the attitude error of a stabilised table after each half second; it turns with the short steps."""
    settings = read_scenario(SCENARIOS / "table-stabilised.toml").as_written()
    settings["run"] = {"stop_s": 5.0, "step_s": step, **setting}
    for name in ("computer", "controller"):
        settings["fmus"][name]["step_s"] = stride * step
    settings["fmus"]["computer"]["parameters"] = {"algorithm": 5, "sample_period": stride * step}
    for wire, between in zip(settings["connections"], ("sum", None, "hold", way), strict=True):
        wire |= {} if between is None else {"between": between}
    return run_scenario(Scenario.model_validate(settings)).table["q3"].to_numpy()[:: round(0.5 / step)]


@pytest.mark.acceptance
@pytest.mark.parametrize("way", ["hold", "interpolate"])
def test_a_cycle_of_two_rates_tends_to_what_it_is_at_one(way: str) -> None:
    """Run our own FMUs in the compiled loop, each connection of the cycle by its transfer; first order."""
    fine = servo(0.000625, 1, way, coupling="iterate")
    errors = [np.abs(servo(step, 4, way, coupling="jacobi") - fine).max() for step in (0.0125, 0.00625, 0.003125)]
    assert errors[0] < 0.3 * np.abs(fine).max()
    assert np.log2(np.divide(errors[:-1], errors[1:])) == pytest.approx(1.0, abs=0.3), errors


def test_increments_of_a_fast_table_are_summed_for_a_slow_computer() -> None:
    """The sum of its increments is its output in long steps."""
    simulation = []
    for step in (0.1, 0.005):
        settings = read_scenario(SCENARIOS / "table-stabilised.toml").as_written()
        settings["run"] = {"stop_s": 5.0, "step_s": step}
        del settings["fmus"]["controller"]
        settings["fmus"]["computer"] |= {"step_s": 0.1, "parameters": {"algorithm": 5, "sample_period": 0.1}}
        settings["connections"] = [{**settings["connections"][0], "between": "sum"}]
        settings["stimuli"] = [{"to": "table.command", "constant": [1.0, -0.5]}]
        settings["record"] = {"columns": {f"q{i}": f"computer.attitude[{i}]" for i in range(1, 5)}}
        simulation.append(
            run_scenario(Scenario.model_validate(settings)).table.drop("time_s").to_numpy()[:: round(0.1 / step)]
        )
    assert np.abs(simulation[0][-1, 1:]).max() > 0.1
    np.testing.assert_allclose(simulation[1], simulation[0], atol=1e-13)


@pytest.mark.acceptance
def test_rows_and_programmes_are_laid_on_the_steps_of_whom_they_drive(foreign: Path) -> None:
    """Increments occur once in each of its steps, not once in each of the run's."""
    times = SLOW * np.arange(1, 9)
    rows = {"table": {"time_s": times, "u_rad": 0.01 * times}, "columns": {"adder.increment": "u_rad"}, "stamp": "end"}
    table = run_of_guests(foreign, {"adder": slow({"fmu": "Adder.fmu"})}, run=SECONDS, stimuli=[rows]).table
    assert table["adder.total"][::4].to_list() == pytest.approx([0.0, *np.cumsum(0.01 * times)], rel=1e-15)
    message = refusal(foreign, {"adder": {"fmu": "Adder.fmu"}}, run=SECONDS, stimuli=[rows])
    assert "an increment would be applied again" in message
    begins = {"table": {"time_s": [0.0, 0.6, 1.0], "u": [1.0, 2.0, 3.0]}, "columns": {"gain.u[1]": "u"}}
    table = run_of_guests(foreign, {"gain": slow(GAIN)}, run={**SECONDS, "stop_s": 2.0}, stimuli=[begins]).table
    assert table["gain.y[1]"].to_list() == [1.0] * 12 + [3.0] * 5


def test_what_cannot_be_is_refused_in_one_line(foreign: Path) -> None:
    pair, end = {"fast": GAIN, "slow": slow(CLOCK)}, "slow.ended -> fast.u[1]"
    ends = "'slow.ended' -> 'fast.u[1]'"

    def says(fmus: dict, connections: list[dict], **options: object) -> str:
        return refusal(foreign, fmus, connections=connections, run={**SECONDS, **options})

    either = f'{ends}: \'slow\' steps less often; say between = "hold" or "interpolate"'
    assert says(pair, wires(end)) == says(pair, between("sum", end)) == either
    back = {"fast": CLOCK, "slow": slow(GAIN)}
    message = says(back, between("interpolate", "fast.ended -> slow.u[1]"))
    assert message.endswith('\'slow\' steps less often; say between = "hold" or "sum"')
    message = says(pair, between("interpolate", "slow.count -> fast.count"))
    assert message.endswith('between = "interpolate" is for numbers of kind Real, not Integer')
    odd = {"fast": slow(GAIN, 2 * BASE), "slow": slow(CLOCK, 3 * BASE)}
    message = says(odd, between("hold", end), stop_s=24 * BASE)
    assert message == f"{ends}: the longer of their steps must be a whole multiple of the shorter"
    for step in (0.3, 0.1, 1e300):
        message = says({"slow": slow(CLOCK, step)}, [])
        assert message == f"fmus.slow.step_s = {step} is not a whole multiple of run.step_s = 0.125"
    message = says({"slow": slow(CLOCK, 3 * BASE)}, [])
    assert message == "fmus.slow.step_s = 0.375 does not divide the run of 4 s"
    cycle = {"fast": GAIN, "slow": slow(GAIN)}
    around = between("hold", "fast.y[1] -> slow.u[1]", "slow.y[1] -> fast.u[1]")
    assert "is iterated, so its FMUs step together" in says(cycle, around, coupling="iterate")
    three = {"fast": CLOCK, "slow": slow(ACCUMULATOR), "reader": GAIN}
    members = between("sum", "fast.step -> slow.increment") + between("interpolate", "slow.total -> reader.u[1]")
    assert "outputs of 'slow' are interpolated, so it steps before there is a sum" in says(three, members)
    message = says({"fast": GAIN, "slow": slow(GAIN)}, between("interpolate", "slow.y[1] -> fast.u[1]"))
    assert message.startswith("'slow' is interpolated and has a String 'said'")


def test_a_slow_one_that_fails_or_ends_the_run_is_named_at_its_own_time(foreign: Path) -> None:
    for ahead in (False, True):
        fmus = {"reader": GAIN, "bad": slow(FAILING, parameters={"way": 1, "after": 1.0})}
        wired = between("interpolate" if ahead else "hold", "bad.y -> reader.u[1]")
        message = refusal(foreign, fmus, run=SECONDS, connections=wired)
        assert "FMU 'bad' (Failing.fmu): fmi2DoStep at 1 s ended with" in message
        fmus["bad"]["parameters"]["way"] = 3
        message = refusal(foreign, fmus, run=SECONDS, connections=wired)
        assert message == "FMU 'bad' (Failing.fmu): y is nan at 1.5 s; to run all the same: --allow-nan"


@pytest.mark.acceptance
def test_one_that_can_interpolate_is_told_the_derivative(foreign: Path, tmp_path: Path) -> None:
    """x' = t is exact at one rate and at two, for which the end of each step would give too much."""
    inside = {"u": 'causality="input"><Real start="0"/>', "x": 'causality="output"><Real/>'}
    compile_foreign("linear", tmp_path, inside, 'CoSimulation canInterpolateInputs="true"')
    shutil.copy(foreign / "Clock.fmu", tmp_path)
    columns = {"columns": {"x": "it.x"}}
    for compiled, options, step in product((True, False), (True, False), (BASE, SLOW)):
        fmus, setting = {"it": {"fmu": "Linear.fmu"}, "clock": slow(CLOCK, step)}, {**SECONDS, "in_process": options}
        for way, coupling, expected in (
            ("interpolate", None, 0.5 * T**2),
            ("interpolate", "delayed", 0.5 * np.maximum(T - BASE, 0.0) ** 2),
            ("hold", None, BASE * np.cumsum(T if step == BASE else HELD)),
        ):
            arguments = {"connections": between(way, "clock.ended -> it.u"), "record": columns}
            setting["coupling"] = coupling
            table = run_of_guests(tmp_path, fmus, run=setting, compiled=compiled, **arguments).table
            np.testing.assert_allclose(table["x"], expected, rtol=1e-14)
