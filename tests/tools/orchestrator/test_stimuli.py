"""Stimuli: the row of a table, and the position of a programme, that hold over each step."""

import math
from pathlib import Path

import numpy as np
import polars as pl
import pytest

from scenario_runs import GAIN, refusal, wires
from scenario_runs import run as run_scenario
from trihedron.tools.errors import InputError

GAINS, ADDER = {"g": GAIN}, {"s": {"fmu": "Adder.fmu"}}


def run(folder: Path, fmus: dict[str, dict], stimuli: list[dict], stop: float | None = 1.0, step: float = 0.1):
    """Run a scenario without connections; the files of its stimuli are beside its FMUs."""
    setting = {"step_s": step} if stop is None else {"stop_s": stop, "step_s": step}
    return run_scenario(folder, fmus, run=setting, stimuli=stimuli)


def rows(text: str, folder: Path) -> str:
    (folder / "rows.csv").write_text(text, encoding="utf-8")
    return "rows.csv"


def test_a_row_holds_from_its_time_on(foreign: Path) -> None:
    csv = rows("# made by hand\ntime_s,u,v\n-1,7,1\n0.2,8,1\n\n0.5,9,2\n5,10,2\n", foreign)
    stimulus = {"csv": csv, "columns": {"g.u[2]": "u", "g.count": "v"}}
    later = {"table": {"time_s": [0.0, 0.7], "u": [1.0, 2.0]}, "columns": {"g.u[1]": "u"}}
    table = run(foreign, GAINS, [stimulus, later]).table
    assert table["g.y[1]"].to_list() == [1.0] * 8 + [2.0] * 3
    # The output at t_k still shows the input that held over the step before.
    assert table["g.y[2]"].to_list() == [7.0] * 3 + [8.0] * 3 + [9.0] * 5
    assert table["g.counted"].to_list() == [1] * 6 + [2] * 5


def test_increments_stamped_at_their_end_all_arrive_in_their_own_step(foreign: Path) -> None:
    increments = [0.001 * (i + 1) for i in range(10)]
    lines = [f"{0.1 * (i + 1):.1f},{d!r}" for i, d in enumerate(increments)]
    csv = rows("time_s,d1_rad\n" + "\n".join(lines) + "\n", foreign)
    stimulus = {"csv": csv, "stamp": "end", "columns": {"s.increment": "d1_rad"}}
    table = run(foreign, ADDER, [stimulus]).table
    assert table["s.total"].to_list() == [0.0, *np.cumsum(increments)]
    # A first row at the run's start has its interval before the run: it is not used.
    csv = rows("time_s,d1_rad\n0,99\n" + "\n".join(lines) + "\n", foreign)
    assert run(foreign, ADDER, [stimulus]).table["s.total"].to_list() == table["s.total"].to_list()


def test_digits_that_a_file_leaves_off_do_not_shift_a_row(foreign: Path) -> None:
    step = 1.0 / 285.7142857
    times = [f"{(i + 1) * step:.7f}" for i in range(500)]
    csv = rows("time_s,d1_rad\n" + "".join(f"{t},1e-3\n" for t in times), foreign)
    stimulus = {"csv": csv, "stamp": "end", "columns": {"s.increment": "d1_rad"}}
    total = run(foreign, ADDER, [stimulus], stop=500 * step, step=step).table["s.total"]
    assert total[-1] == pytest.approx(0.5, rel=1e-12)


def test_a_column_is_converted_to_the_unit_of_its_variable(foreign: Path) -> None:
    table = {"time_s": [0.0], "d_deg": [90.0]}
    stimulus = {"table": table, "columns": {"s.increment": "d_deg"}}
    simulation = run(foreign, ADDER, [stimulus]).table["s.total"]
    assert simulation[1] == pytest.approx(math.pi / 2, rel=1e-15)


REFUSED = [
    ("time_s,u\n0.1,1\n", {}, r"rows\.csv, row 2: begins at 0\.1 s, after the run's start 0 s"),
    ("time_s,u\n0,1\n0,2\n", {}, r"row 3, column 'time_s': does not come after the row before"),
    ("time_s,w\n0,1\n", {}, r"rows\.csv: has no column 'u'"),
    ("time_s,u,u\n0,1,2\n", {}, r"column 'u' is there 2 times"),
    ("#\n\ntime_s,u\n0,1\n0.5,\n", {}, r"rows\.csv, row 5, column 'u': is empty"),
    ("time_s,u\n0,1\n0.5,x\n", {}, r"row 3, column 'u': 'x' is not a finite number"),
    ("time_s,u\n0,nan\n", {}, r"row 2, column 'u': 'nan' is not a finite number"),
    ("time_s,u\n0,1e400\n", {}, r"row 2, column 'u': '1e400' is not a finite number"),
    ("time_s,u\n0,1,2\n", {}, r"row 2: has 3 fields; the header has 2"),
    ("time_s,u\n0\n", {}, r"row 2: has 1 fields; the header has 2"),
    ("time_s,u\n", {}, r"rows\.csv: has no rows"),
    ("", {}, r"rows\.csv: is empty"),
    ("time_s,u\n0.1,1\n0.2,1\n", {"stamp": "end"}, r"row 3: ends at 0\.2 s, before the run's end 1 s"),
    ("time_s,u\n0.5,1\n0.6,1\n1,2\n", {"stamp": "end"}, r"row 2: its interval ends at 0\.5 s, and nothing covers"),
    (
        "time_s,u\n0.1,1\n0.2,1\n0.25,1\n0.3,1\n1,2\n",
        {"stamp": "end"},
        r"rows 4 and 5 both end within the step that ends at 0\.3 s",
    ),
]


@pytest.mark.parametrize(("text", "options", "says"), REFUSED)
def test_rows_that_cannot_drive_an_input(foreign: Path, text: str, options: dict, says: str) -> None:
    csv = rows(text, foreign)
    with pytest.raises(InputError, match=says) as refused:
        run(foreign, GAINS, [{"csv": csv, "columns": {"g.u[1]": "u"}, **options}])
    assert str(refused.value).startswith("stimuli[1]: ")


def test_an_increment_is_never_applied_twice(foreign: Path) -> None:
    csv = rows("time_s,d_rad\n0.2,1\n0.4,1\n0.6,1\n0.8,1\n1.0,1\n", foreign)
    stimulus = {"csv": csv, "stamp": "end", "columns": {"s.increment": "d_rad"}}
    with pytest.raises(InputError, match=r"row 2: an increment would be applied again .* ends at 0\.2 s"):
        run(foreign, ADDER, [stimulus])
    # A mean rate over an interval holds over each step in it.
    (foreign / "rows.csv").write_text((foreign / "rows.csv").read_text().replace("d_rad", "d"), encoding="utf-8")
    table = run(foreign, {"s": {"fmu": "Accumulator.fmu"}}, [{**stimulus, "columns": {"s.increment": "d"}}]).table
    assert table["s.total"][-1] == 10.0


def test_other_wrong_stimuli(foreign: Path) -> None:
    (foreign / "rows.csv").write_bytes(b"time_s,u\n0,\xff\n")
    cases = [
        ({"to": "g.uu", "constant": 1.0}, "'g' has no variable 'uu'; did you mean 'u'?"),
        ({"to": "g.y", "constant": [1.0, 2.0]}, "'g.y' is not an input (output); did you mean 'u[1]'?"),
        ({"to": "g.count", "constant": 1.5}, "count = 1.5 must be a whole number"),
        ({"to": "g.u", "constant": 1.5}, "g.u has 2 elements; one value is given"),
        ({"to": "g.u", "programme": "rows.csv", "dwell_s": 1.0}, "rows.csv, row 2: is not UTF-8 text"),
        ({"csv": "none.csv", "columns": {"g.u[1]": "u"}}, "none.csv: no such file"),
        ({"csv": "rows.csv", "columns": {"g.u": "u"}}, "is an array; name each element"),
        ({"table": {"time_s": [0.0], "u": [0.5]}, "columns": {"g.count": "u"}}, "count = 0.5 must be a whole number"),
        ({"table": {"time_s": [0.0], "u": [None]}, "columns": {"g.u[1]": "u"}}, "row 1, column 'u': is empty"),
        ({"table": {"alpha_deg": [0.0], "beta_deg": [0.0]}, "to": "g.u", "dwell_s": 1.0}, "needs max_rate[1..2]"),
    ]
    for stimulus, says in cases:
        with pytest.raises(InputError) as refused:
            run(foreign, GAINS, [stimulus])
        assert says in str(refused.value)


TABLE = {"table": {"component": "TurntableMotion", "parameters": {"earth_rotation": False}}}
POSITIONS = {"alpha_deg": [20.0, 65.0, 65.0, 110.0], "beta_deg": [25.0, 145.0, 145.0, -30.0]}


def test_a_programme_gives_each_position_its_move_and_its_dwell(foreign: Path) -> None:
    """The move's time from the textbook: d/v + v/a if the rate limit is reached, else 2 sqrt(d/a)."""
    rate, acceleration, dwell, step = [0.5, 0.3], [0.2, 0.4], 4.0, 0.05
    parameters = {"max_rate": rate, "max_acceleration": acceleration, "initial_angle": [0.1, -0.2]}
    fmus = {"table": {"component": "TurntableMotion", "parameters": parameters}}
    commands = run(foreign, fmus, [{"to": "table.command", "table": POSITIONS, "dwell_s": dwell}], stop=None, step=step)
    before, tick, ends = [0.1, -0.2], 0, []
    for target in zip(*POSITIONS.values(), strict=True):
        moves = []
        for axis in range(2):
            distance = abs(math.radians(target[axis]) - before[axis])
            v, a = rate[axis], acceleration[axis]
            moves.append(distance / v + v / a if distance >= v * v / a else 2.0 * math.sqrt(distance / a))
        tick += math.ceil((max(moves) + dwell) / step - 1e-9)
        ends.append(tick)
        before = [math.radians(angle) for angle in target]
    assert commands.provenance["steps"] == ends[-1]
    alpha = commands.table["table.angle[1]_rad"].to_numpy()
    beta = commands.table["table.angle[2]_rad"].to_numpy()
    for row, end in enumerate(ends):
        constant = slice(end - round(dwell / step) + 1, end + 1)
        assert set(np.degrees(alpha[constant]).round(12)) == {POSITIONS["alpha_deg"][row]}
        assert set(np.degrees(beta[constant]).round(12)) == {POSITIONS["beta_deg"][row]}
        if row in (0, 2):
            # The next move begins with the next step.
            assert alpha[end + 1] != alpha[end]


def test_each_row_may_have_its_own_dwell(foreign: Path) -> None:
    dwell = [1.0, 2.0, 30.0, 4.0]
    base = run(foreign, TABLE, [{"to": "table.command", "table": POSITIONS, "dwell_s": 1.0}], stop=None)
    dwells = run(foreign, TABLE, [{"to": "table.command", "table": {**POSITIONS, "dwell_s": dwell}}], stop=None)
    assert dwells.provenance["steps"] - base.provenance["steps"] == round((sum(dwell) - 4.0) / 0.1)


def test_a_programme_from_a_file_is_that_from_memory(foreign: Path) -> None:
    pl.DataFrame(POSITIONS).write_csv(foreign / "positions.csv")
    from_file = run(foreign, TABLE, [{"to": "table.command", "programme": "positions.csv", "dwell_s": 3.0}], stop=None)
    from_memory = run(foreign, TABLE, [{"to": "table.command", "table": POSITIONS, "dwell_s": 3.0}], stop=None)
    assert from_file.table.equals(from_memory.table)
    assert list(from_file.provenance["files"]) == ["positions.csv"]


@pytest.mark.parametrize(
    ("table", "options", "says"),
    [
        (POSITIONS, {}, "has no column dwell_s, so the stimulus must give dwell_s"),
        ({"alpha_deg": [1.0]}, {"dwell_s": 1.0}, "column 'beta_deg' is missing"),
        ({**POSITIONS, "dwel_s": [1.0] * 4}, {}, "unknown column 'dwel_s'; did you mean 'dwell_s'?"),
        ({**POSITIONS, "dwell_s": [1.0, 1.0, 0.0, 1.0]}, {}, "row 3, column 'dwell_s': 0.0 must be positive"),
        (POSITIONS, {"dwell_s": 1.0, "to": "table.temperature"}, "cannot take a position programme"),
        ({"alpha_deg": [5.0, 5.0], "beta_deg": [5.0, 5.0]}, {"dwell_s": 1e-12}, "of a step; take a shorter step_s"),
    ],
)
def test_a_wrong_programme(foreign: Path, table: dict, options: dict, says: str) -> None:
    with pytest.raises(InputError) as refused:
        run(foreign, TABLE, [{"to": "table.command", "table": table, **options}], stop=None)
    assert says in str(refused.value)


@pytest.mark.parametrize(
    ("run_", "says"),
    [
        ({"step_s": 0.1}, "run.stop_s is missing"),
        (
            {"stop_s": 1.0, "step_s": 0.3},
            "does not divide the run of 1.0 s (3.33333333 steps); 0.25 or 0.333333333 would",
        ),
        ({"stop_s": 1.0, "step_s": 2.0}, "run.step_s = 2.0 does not divide"),
        ({"stop_s": 1.0, "step_s": 0.1 + 1e-9}, "does not divide"),
        ({"stop_s": 1.0, "step_s": 2.0**-40}, "at most 1000000000"),
    ],
)
def test_steps_that_cannot_be_counted(foreign: Path, run_: dict, says: str) -> None:
    message = refusal(foreign, GAINS, run=run_)
    assert message.startswith("run.st")
    assert says in message


def test_an_effect_reaches_the_fmu(tmp_path: Path) -> None:
    """An effect changes the run by its definition, and only at its place."""
    table = {"component": "TurntableMotion", "parameters": {"initial_angle": [0.3, 0.4], "earth_rotation": False}}
    effect = {"effect": "quadratic", "where": "accelerometer-3", "coefficient": 1e-3}
    plain, extended = (
        run_scenario(
            tmp_path,
            {"table": table, "block": {"component": "AccelerometerBlock", "effects": effects}},
            connections=[{"from": "table.specific_force", "to": "block.specific_force"}],
        ).table
        for effects in ([], [effect])
    )
    assert extended["block.reading[1]_mps2"].to_list() == plain["block.reading[1]_mps2"].to_list()
    n3 = plain["table.specific_force[3]_mps2"].to_numpy() / 9.80665
    gain = (extended["block.reading[3]_mps2"] - plain["block.reading[3]_mps2"]).to_numpy() / 9.80665
    np.testing.assert_allclose(gain, 1e-3 * n3 * n3, rtol=1e-9)


SKEWED = {"component": "TurntableMotion", "parameters": {"initial_angle": [0.3, 0.4], "earth_rotation": False}}
TURNING = {"to": "table.command", "constant": [3.0, 0.4]}


def of_accelerometer_1(effect: str, **values: object) -> dict:
    return {"component": "AccelerometerBlock", "effects": [{"effect": effect, "where": "accelerometer-1", **values}]}


@pytest.mark.parametrize(
    ("block", "input_", "feeding"),
    [
        (of_accelerometer_1("lever-arm", r_1=0.05, r_2=0.0, r_3=0.0), "rate", " (from a table: its block_rate)"),
        (of_accelerometer_1("accelerometer-lag", time=1e-3), "rate", " (from a table: its block_rate)"),
        (of_accelerometer_1("formula", law="f1 += c*sin(3*alpha)", c=1e-3), "angle", " (from a table: its angle)"),
        (of_accelerometer_1("thermal-lag", coefficient=1e-5, settling=0.0, time_constant=0.1), "temperature", ""),
    ],
    ids=lambda value: value["effects"][0]["effect"] if isinstance(value, dict) else "",
)
def test_an_effect_of_which_nothing_feeds_the_input_is_refused(tmp_path: Path, block, input_, feeding) -> None:
    """It would silently do nothing."""
    fmus = {"table": SKEWED, "block": block}
    message = refusal(tmp_path, fmus, connections=wires("table.specific_force -> block.specific_force"))
    assert f"'block.{input_}', and nothing feeds it; connect it{feeding}, " in message


def test_a_size_effect_acts_while_the_table_turns(tmp_path: Path) -> None:
    arm = of_accelerometer_1("lever-arm", r_1=0.05, r_2=0.0, r_3=0.0)
    joined = wires("table.specific_force -> block.specific_force", "table.block_rate -> block.rate")
    plain, extended = (
        run_scenario(tmp_path, {"table": SKEWED, "block": block}, connections=joined, stimuli=[TURNING]).table
        for block in ({"component": "AccelerometerBlock"}, arm)
    )
    centripetal = -0.05 * (plain["table.block_rate[2]_radps"] ** 2 + plain["table.block_rate[3]_radps"] ** 2)
    gained = extended["block.reading[1]_mps2"] - plain["block.reading[1]_mps2"]
    assert np.abs(centripetal.to_numpy()).max() > 1e-3
    np.testing.assert_allclose(gained.to_numpy(), centripetal.to_numpy(), atol=1e-12)
