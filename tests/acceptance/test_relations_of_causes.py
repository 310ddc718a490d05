"""Changes of records that must not change the result of `diagnose`, `attitude`, `plan`, `import`.

The relations are those of `tests/relations.py`; the cheap ones are in `make test`.
"""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import polars as pl
import pytest

import trihedron as th
from command_table import SCENARIO
from generator.carried import POSES, strapdown_record, true_motion
from generator.positions import of_one_instrument, write_hidden_record
from relations import CYCLE, EXACT, QUARTER, SAME, axes_renamed, differences, named
from trihedron.models.effects import EffectPlace
from trihedron.tools import library, measured
from trihedron.tools.records import write_record

pytestmark = pytest.mark.acceptance
SIGMA = 1e-5
QUADRATIC = EffectPlace("quadratic", "accelerometer-2"), (6e-4,)
EFFECTS = {
    "quadratic": QUADRATIC,
    "encoder-harmonic": (EffectPlace("encoder-harmonic", "outer-axis", 2), (3e-4, 0.4)),
    "cross-product": (EffectPlace("cross-product", "accelerometer-3", axes=(1, 2)), (6e-4,)),
    "outlier": (EffectPlace("outlier", "position-7", axes=(1,)), (2e-4,)),
    "scale-drift": (EffectPlace("scale-drift", "accelerometer-1"), (2e-3,)),
    "none": (),
}
IN_ORDER = ("outlier", "scale-drift")
"""Effects that depend on order, time or single positions."""
SHOWN = ("band", "gain", "next_positions", "judgement", "laws", "power", "provenance", "warnings")
"""Keys beside the statements: pictures, advice, and the origin of the record."""


def hidden(folder: Path, effect: str) -> pl.DataFrame:
    write_hidden_record(folder / "r.csv", 11, *EFFECTS[effect])
    return pl.read_csv(folder / "r.csv", comment_prefix="#")


def stated(table: pl.DataFrame, **options: Any) -> dict:
    """Return a diagnosis as plain values, without the keys of `SHOWN`."""
    result = measured.diagnose(table, noise_bound=SIGMA, **options).to_json()
    return {name: without_origin(value) for name, value in result.items() if name not in SHOWN}


def without_origin(value: Any) -> Any:
    """Return plain values without the origin of a record, at any depth."""
    if isinstance(value, dict):
        return {name: without_origin(part) for name, part in value.items() if name not in ("provenance", "warnings")}
    if isinstance(value, list):
        return [without_origin(part) for part in value]
    return value


@pytest.fixture(scope="module", params=EFFECTS)
def case(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> tuple[str, pl.DataFrame, dict]:
    table = hidden(tmp_path_factory.mktemp("case"), request.param)
    return request.param, table, stated(table)


def causes(diagnosis: dict) -> list[str]:
    """Return the named causes in order."""
    return [
        str(sorted((k, v) for k, v in cause.items() if isinstance(v, str))) for cause in diagnosis.get("causes", ())
    ]


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
    second = stated(changed.table, **changed.options)
    assert second["verdict"] == first["verdict"]
    assert second.get("level") == first.get("level")
    assert second.get("proven") == first.get("proven") or name == "positions permuted"
    assert causes(second) == causes(first)
    assert second["calibration"]["radius"] == pytest.approx(first["calibration"]["radius"], rel=1e-5)


@pytest.mark.parametrize("effect", ["quadratic", "none"])
def test_axes_renamed_with_the_mounting_name_the_renamed_accelerometer(effect, tmp_path):
    """Use one scale factor for each accelerometer."""
    write_hidden_record(tmp_path / "s.csv", 11, *EFFECTS[effect], symmetric=True)
    table = pl.read_csv(tmp_path / "s.csv", comment_prefix="#")
    changed = axes_renamed(table)
    first = stated(table, baseline="symmetric")
    second = stated(changed.table, baseline="symmetric", **changed.options)
    assert second["verdict"] == first["verdict"] == ("consistent" if effect == "none" else "explained")
    renamed = {f"accelerometer-{k}": f"accelerometer-{new}" for k, new in enumerate(changed.accelerometers, 1)}
    titles = [(cause["effect"], renamed[cause["where"]]) for cause in first["causes"]]
    assert [(cause["effect"], cause["where"]) for cause in second["causes"]] == titles


def test_a_diagnosis_of_csv_and_of_parquet_names_the_same(case, tmp_path):
    _, table, first = case
    table.write_parquet(tmp_path / "r.parquet")
    table.write_csv(tmp_path / "r.csv")
    for form in ("csv", "parquet"):
        second = measured.diagnose(tmp_path / f"r.{form}", noise_bound=SIGMA).to_json()
        assert second["verdict"] == first["verdict"]
        assert causes(second) == causes(first)
        assert second["calibration"]["radius"] == pytest.approx(first["calibration"]["radius"], rel=1e-3)


def test_a_part_of_a_record_contradicts_no_more_than_the_whole(case):
    _, table, first = case
    part = stated(table.head(30))
    assert part["calibration"]["radius"] <= first["calibration"]["radius"] * (1.0 + 1e-9)


SEVERAL = [(EffectPlace("quadratic", "accelerometer-2"), (4e-4,))]


def together(tables: Sequence[Any], **options: Any) -> dict:
    """Return the joint result of several records: verdict, causes with their owners, state of the instrument,
    radius."""
    result = th.diagnose_together(*tables, noise_bound=SIGMA, **options)
    titles = sorted((cause.title, cause.is_of_instrument) for cause in result.causes)
    return {"verdict": result.verdict, "causes": titles, "instrument": result.instrument, "radius": result.radius}


@pytest.fixture(scope="module")
def several(tmp_path_factory: pytest.TempPathFactory) -> tuple[list[pl.DataFrame], dict]:
    folder, tables = tmp_path_factory.mktemp("several"), []
    for record in of_one_instrument(5, 2, shared=SEVERAL):
        write_record(record, folder / "r.csv")
        tables.append(pl.read_csv(folder / "r.csv", comment_prefix="#"))
    first = together(tables)
    assert first["verdict"] == "explained"
    return tables, first


def assert_together(second: dict, first: dict) -> None:
    assert {**second, "radius": None} == {**first, "radius": None}
    assert second["radius"] == pytest.approx(first["radius"], rel=1e-4)


@pytest.mark.parametrize("name", [*EXACT, *SAME])
def test_several_records_say_the_same(name, several):
    tables, first = several
    changed = [(EXACT | SAME)[name](table) for table in tables]
    assert_together(together([entry.table for entry in changed], **changed[0].options), first)


def test_several_records_of_renamed_axes_name_the_renamed_accelerometer(tmp_path):
    """Use one scale factor for each accelerometer, as for one record."""
    tables = []
    for seed in (11, 12):
        write_hidden_record(tmp_path / "s.csv", seed, *QUADRATIC, symmetric=True)
        tables.append(pl.read_csv(tmp_path / "s.csv", comment_prefix="#"))
    changed = [axes_renamed(table) for table in tables]
    first = together(tables, baseline="symmetric")
    second = together([entry.table for entry in changed], baseline="symmetric", **changed[0].options)
    assert second["verdict"] == first["verdict"]
    renamed = {f"accelerometer-{k}": f"accelerometer-{new}" for k, new in enumerate(changed[0].accelerometers, 1)}
    titles = [" ".join(renamed.get(word, word) for word in str(title).split()) for title, _ in first["causes"]]
    assert sorted(str(title) for title, _ in second["causes"]) == sorted(titles)


def test_several_records_have_no_order_and_no_kind_of_file(several, tmp_path):
    tables, first = several
    assert_together(together(tables[::-1]), first)
    paths = [tmp_path / "one.csv", tmp_path / "two.parquet"]
    tables[0].write_csv(paths[0])
    tables[1].write_parquet(paths[1])
    assert_together(together(paths), first)


def test_a_record_split_in_two_contradicts_no_more_than_the_whole(several):
    """Each half may have a mounting and a table of its own, so more is possible."""
    tables, first = several
    halves = [tables[0].head(12), tables[0].tail(12), tables[1]]
    assert together(halves)["radius"] <= first["radius"] * (1.0 + 1e-6)


def test_a_run_read_from_memory_and_from_its_files_is_one_record(tmp_path):
    run = library.simulate("scenarios/static-calibration.toml", out=tmp_path / "run")
    direct = measured.calibrate(run, noise_bound=SIGMA).to_json()
    loaded = measured.calibrate(tmp_path / "run" / "positions.csv", noise_bound=SIGMA).to_json()
    assert direct["verdict"] == loaded["verdict"] == "consistent"
    for entry, second in zip(direct["parameters"], loaded["parameters"], strict=True):
        width = second["high"] - second["low"]
        assert [entry["low"], entry["high"]] == pytest.approx([second["low"], second["high"]], abs=1e-3 * width)


def test_a_diagnosis_of_a_run_and_of_its_file_is_one(tmp_path):
    """Compare the diagnosis alone, and with another record."""
    run = library.simulate("scenarios/static-calibration.toml", out=tmp_path / "run")
    file = tmp_path / "run" / "positions.csv"
    assert run.positions is not None
    direct, loaded = (measured.diagnose(entry, noise_bound=SIGMA).to_json() for entry in (run.positions, file))
    assert direct["verdict"] == loaded["verdict"] == "consistent"
    assert causes(direct) == causes(loaded) == []
    assert direct["calibration"]["radius"] == pytest.approx(loaded["calibration"]["radius"], rel=1e-3)
    second = hidden(tmp_path, "none")
    assert_together(together([run.positions, second]), together([file, second]))


def test_a_run_split_in_time_is_the_first_rows_of_the_whole_run(tmp_path):
    path = tmp_path / "s.toml"
    path.write_text(SCENARIO, encoding="utf-8")
    complete = library.simulate(path).table
    path.write_text(SCENARIO.replace("stop_s = 2.0", "stop_s = 1.0"), encoding="utf-8")
    half = library.simulate(path).table
    assert half.equals(complete.head(half.height))


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
    """Axes 1, 2, 3 are renamed 3, 1, 2; the vector of the quaternion follows."""
    rates, forces = ([f"{q}{k}_{unit}" for k in (1, 2, 3)] for q, unit in (("w", "radps"), ("f", "mps2")))
    new = [pl.col(group[(k + 1) % 3]).alias(group[k]) for group in (rates, forces) for k in range(3)]
    first = measured.attitude_of_record(moved).to_polars()
    second = measured.attitude_of_record(moved.with_columns(new)).to_polars()
    quaternion = [name for name in first.columns if name in ("q0", "q1", "q2", "q3")]
    assert len(quaternion) == 4
    before, after = first.select(quaternion).to_numpy(), second.select(quaternion).to_numpy()
    assert after[:, [0, 3, 1, 2]] == pytest.approx(before, abs=1e-9)


def test_a_plan_of_renamed_axes_has_the_same_costs():
    """Compare the worst ratio of cost to optimum of one set for all targets; the targets are those of other
    accelerometers."""
    entry = th.plan("X16", grid=15.0, baseline="symmetric")[0].optimum.cost
    second = th.plan("X17", grid=15.0, baseline="symmetric", mounting=named(CYCLE.T))[0].optimum.cost
    assert second == pytest.approx(entry, rel=1e-6)


def test_a_plan_for_a_base_that_is_turned_has_the_same_cost():
    """The inner axis counts from another mark; the grid of positions is the same."""
    entry = th.plan("X4", grid=15.0)[0].optimum.cost
    second = th.plan("X4", grid=15.0, mounting=named(QUARTER))[0].optimum.cost
    assert second == pytest.approx(entry, rel=1e-6)


@pytest.mark.parametrize("unit", ["g", "mg", "m/s2"])
def test_an_imported_record_is_the_same_in_every_unit(unit, tmp_path):
    table = hidden(tmp_path, "none").select("position", "time_s", "alpha_deg", "beta_deg", "^f._mps2$")
    factor = {"g": 1.0 / 9.80665, "mg": 1000.0 / 9.80665, "m/s2": 1.0}[unit]
    names = {f"f{k}_mps2": f"f{k} [{unit}]" for k in (1, 2, 3)}
    scaled = table.with_columns(pl.col(list(names)) * factor).rename(names)
    scaled.write_csv(tmp_path / "foreign.csv")
    answers = {"units.force": unit, "decimal": "."}
    imported = measured.import_record(tmp_path / "foreign.csv", out=tmp_path / "record.csv", answers=answers)
    assert imported is not None
    back = pl.read_csv(tmp_path / "record.csv", comment_prefix="#")
    for name in names:
        assert back[name].to_numpy() == pytest.approx(table[name].to_numpy(), rel=1e-9)


def test_settings_in_another_order_and_of_whole_turns_more_are_the_same_settings(tmp_path):
    from command_table import make_inputs

    make_inputs(tmp_path)
    from trihedron.tools import planning

    planned, actual = planning.read_settings(tmp_path / "angles.csv")
    first = planning.check_settings(planning.task_of(planning.Request()), planned, actual, SIGMA).to_json()
    table = pl.read_csv(tmp_path / "angles.csv")
    order = np.random.default_rng(3).permutation(table.height)
    turned = table.with_columns(pl.col("alpha_deg", "planned_alpha_deg") + 360.0)
    turned.select(pl.all().gather(order.tolist())).write_csv(tmp_path / "other.csv")
    planned, actual = planning.read_settings(tmp_path / "other.csv")
    second = planning.check_settings(planning.task_of(planning.Request()), planned, actual, SIGMA).to_json()
    assert second["advice"] == first["advice"]
    assert second["lost_readings"] == first["lost_readings"]
    for entry, same in zip(first["targets"], second["targets"], strict=True):
        assert same["planned"] == pytest.approx(entry["planned"], rel=1e-6)
        assert same["solved"] == pytest.approx(entry["solved"], rel=1e-6)
