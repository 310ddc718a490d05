"""Records changed so that what is found in them must be the same: `diagnose`, `attitude`, `plan`, `import`.

The relations are those of `tests/relations.py`; the cheap ones are in `make test`.
"""

from pathlib import Path
from typing import Any

import numpy as np
import polars as pl
import pytest

from bench_cases import write_hidden_record
from command_table import SCENARIO
from relations import CYCLE, EXACT, SAME, differences, named
from strapdown_records import POSES, strapdown_record, true_motion
from trihedron.tools import library, measured
from trihedron.tools.records import write_record

pytestmark = pytest.mark.acceptance
SIGMA = 1e-5
EFFECTS = ("quadratic", "encoder-harmonic", "cross-product", "outlier", "scale-drift", "none")
IN_ORDER = ("outlier", "scale-drift")
"""What depends on order, time or single positions."""
SHOWN = ("band", "gain", "next_positions", "judgement", "laws", "power", "provenance", "warnings")
"""Beside what is stated: pictures, advice, and what says where the record came from."""


def hidden(folder: Path, effect: str) -> pl.DataFrame:
    write_hidden_record(folder / "r.csv", 11, None, effects=() if effect == "none" else [effect])
    return pl.read_csv(folder / "r.csv", comment_prefix="#")


def stated(table: pl.DataFrame, **options: Any) -> dict:
    """A diagnosis as plain values, without what is shown beside it."""
    result = measured.diagnose(table, noise_bound=SIGMA, **options).to_json()
    return {name: value for name, value in result.items() if name not in SHOWN}


@pytest.fixture(scope="module", params=EFFECTS)
def case(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> tuple[str, pl.DataFrame, dict]:
    table = hidden(tmp_path_factory.mktemp("case"), request.param)
    return request.param, table, stated(table)


def causes(found: dict) -> list[str]:
    """What is named, in order."""
    return [str(sorted((k, v) for k, v in cause.items() if isinstance(v, str))) for cause in found.get("causes", ())]


@pytest.mark.parametrize("name", EXACT)
def test_a_diagnosis_is_the_same(name, case):
    _, table, first = case
    changed = EXACT[name](table)
    assert differences(first, stated(changed.table, **changed.options), 1e-9) == []


@pytest.mark.parametrize("name", SAME)
def test_a_diagnosis_names_the_same(name, case):
    effect, table, first = case
    if effect in IN_ORDER and name in ("positions permuted", "a position doubled"):
        pytest.skip(f"{effect} is of an order in time, which the change undoes")
    changed = SAME[name](table)
    other = stated(changed.table, **changed.options)
    assert other["verdict"] == first["verdict"]
    assert other.get("level") == first.get("level")
    assert other.get("proven") == first.get("proven") or name == "positions permuted"
    assert causes(other) == causes(first)
    assert other["baseline"]["radius"] == pytest.approx(first["baseline"]["radius"], rel=1e-5)


def test_a_run_read_from_memory_and_from_its_files_is_one_record(tmp_path):
    run = library.simulate("scenarios/static-calibration.toml", out=tmp_path / "run")
    direct = measured.calibrate(run, noise_bound=SIGMA).to_json()
    read = measured.calibrate(tmp_path / "run" / "positions.csv", noise_bound=SIGMA).to_json()
    assert direct["verdict"] == read["verdict"] == "consistent"
    for one, other in zip(direct["parameters"], read["parameters"], strict=True):
        width = other["high"] - other["low"]
        assert [one["low"], one["high"]] == pytest.approx([other["low"], other["high"]], abs=1e-3 * width)


def test_a_run_split_in_time_is_the_first_rows_of_the_whole_run(tmp_path):
    path = tmp_path / "s.toml"
    path.write_text(SCENARIO, encoding="utf-8")
    whole = library.simulate(path).table
    path.write_text(SCENARIO.replace("stop_s = 2.0", "stop_s = 1.0"), encoding="utf-8")
    half = library.simulate(path).table
    assert half.equals(whole.head(half.height))


@pytest.fixture(scope="module")
def moved(tmp_path_factory: pytest.TempPathFactory) -> pl.DataFrame:
    path = tmp_path_factory.mktemp("moved") / "moved.csv"
    write_record(strapdown_record(true_motion(POSES[:6])), path)
    return pl.read_csv(path, comment_prefix="#")


def test_attitude_knows_no_zero_of_time(moved):
    first, later = (
        measured.attitude_of_record(table).to_polars()
        for table in (moved, moved.with_columns(pl.col("time_s") + 4096.0))
    )
    names = [name for name in first.columns if name != "time_s"]
    assert names
    for name in names:
        assert later[name].to_numpy() == pytest.approx(first[name].to_numpy(), abs=1e-9, nan_ok=True), name


def test_attitude_of_renamed_axes_turns_about_renamed_axes(moved):
    """Axes 1, 2, 3 are called 3, 1, 2: so is the vector of the quaternion."""
    rates, forces = ([f"{q}{k}_{unit}" for k in (1, 2, 3)] for q, unit in (("w", "radps"), ("f", "mps2")))
    new = [pl.col(group[(k + 1) % 3]).alias(group[k]) for group in (rates, forces) for k in range(3)]
    first = measured.attitude_of_record(moved).to_polars()
    other = measured.attitude_of_record(moved.with_columns(new)).to_polars()
    quaternion = [name for name in first.columns if name in ("q0", "q1", "q2", "q3")]
    assert len(quaternion) == 4
    before, after = first.select(quaternion).to_numpy(), other.select(quaternion).to_numpy()
    assert after[:, [0, 3, 1, 2]] == pytest.approx(before, abs=1e-9)


def test_a_plan_of_renamed_axes_has_the_same_costs():
    """Of one set for all targets: the worst ratio of cost to optimum; the targets are those of other accelerometers."""
    one = library.plan("X16", grid=15.0, baseline="symmetric")[0].optimum.cost
    other = library.plan("X17", grid=15.0, baseline="symmetric", mounting=named(CYCLE.T))[0].optimum.cost
    assert other == pytest.approx(one, rel=1e-6)


@pytest.mark.parametrize("unit", ["g", "mg", "m/s2"])
def test_an_imported_record_is_the_same_in_every_unit(unit, tmp_path):
    table = hidden(tmp_path, "none").select("position", "time_s", "alpha_deg", "beta_deg", "^f._mps2$")
    factor = {"g": 1.0 / 9.80665, "mg": 1000.0 / 9.80665, "m/s2": 1.0}[unit]
    names = {f"f{k}_mps2": f"f{k} [{unit}]" for k in (1, 2, 3)}
    scaled = table.with_columns(pl.col(list(names)) * factor).rename(names)
    scaled.write_csv(tmp_path / "foreign.csv")
    answers = {"units.force": unit, "decimal": "."}
    made = measured.import_record(tmp_path / "foreign.csv", out=tmp_path / "record.csv", answers=answers)
    assert made is not None
    back = pl.read_csv(tmp_path / "record.csv", comment_prefix="#")
    for name in names:
        assert back[name].to_numpy() == pytest.approx(table[name].to_numpy(), rel=1e-9)


def test_settings_of_whole_turns_more_are_the_same_settings(tmp_path):
    from command_table import make_inputs

    make_inputs(tmp_path)
    from trihedron.tools import planning

    planned, actual = planning.read_angles(tmp_path / "angles.csv")
    first = planning.check_settings(planning.task_of(planning.Request()), planned, actual, SIGMA).to_json()
    table = pl.read_csv(tmp_path / "angles.csv")
    order = np.random.default_rng(3).permutation(table.height)
    table.select(pl.all().gather(order.tolist())).write_csv(tmp_path / "other.csv")
    planned, actual = planning.read_angles(tmp_path / "other.csv")
    other = planning.check_settings(planning.task_of(planning.Request()), planned, actual, SIGMA).to_json()
    assert other["advice"] == first["advice"]
    assert other["lost_readings"] == first["lost_readings"]
    for one, same in zip(first["targets"], other["targets"], strict=True):
        assert same["planned"] == pytest.approx(one["planned"], rel=1e-6)
        assert same["solved"] == pytest.approx(one["solved"], rel=1e-6)
