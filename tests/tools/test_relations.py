"""Changes of records that leave the result the same, or change it in a known way: the cheap relations.

Those of `diagnose`, `attitude` and the search for positions are in `make acceptance`.
"""

import gzip
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import polars as pl
import pytest

from generator.carried import POSES, strapdown_record, true_motion
from generator.positions import write_hidden_record
from relations import (
    EXACT,
    READINGS,
    SAME,
    another_order,
    axes_renamed,
    differences,
    doubled,
    two_mountings,
    whole_turns,
)
from trihedron.tools import library, measured
from trihedron.tools.calibration import apply_calibration
from trihedron.tools.planning import read_settings
from trihedron.tools.records import write_record

SIGMA = 1e-5
FILE = ("provenance", "sha256", "record", "path", "files")


@pytest.fixture(scope="module")
def clean(tmp_path_factory: pytest.TempPathFactory) -> pl.DataFrame:
    path = tmp_path_factory.mktemp("clean") / "clean.csv"
    write_hidden_record(path, 5)
    return pl.read_csv(path, comment_prefix="#")


def relation(table: pl.DataFrame, **options: Any) -> dict:
    """Return a calibration as plain values, without the origin of the record."""
    result = measured.calibrate(table, noise_bound=SIGMA, convention="A2", **options).to_json()
    return {name: value for name, value in result.items() if name not in (*FILE, "warnings", "mountings")}


@pytest.fixture(scope="module")
def first(clean: pl.DataFrame) -> dict:
    return relation(clean)


@pytest.mark.parametrize("name", EXACT)
def test_a_calibration_is_the_same(name, clean, first):
    changed = EXACT[name](clean)
    assert relation(changed.table, **changed.options) == first


@pytest.mark.parametrize("name", SAME)
def test_a_calibration_is_the_same_but_for_names(name, clean, first):
    """Compare verdict, radius and every interval."""
    changed = SAME[name](clean)
    second = relation(changed.table, **changed.options)
    assert second["verdict"] == first["verdict"] == "consistent"
    assert second["radius"] == pytest.approx(first["radius"], rel=1e-6)
    for entry, same in zip(first["parameters"], second["parameters"], strict=True):
        ends = [entry["low"], entry["high"]]
        assert [same["low"], same["high"]] == pytest.approx(ends, rel=1e-5, abs=1e-9), entry["symbol"]


def test_a_block_taken_off_and_put_back_leaves_more_possible(clean, first):
    """The mounting's own errors are free twice."""
    changed = two_mountings(clean)
    second = relation(changed.table, **changed.options)
    assert second["radius"] <= first["radius"]
    ends = {p["symbol"]: (p["low"], p["high"]) for p in second["parameters"]}
    common = [p for p in first["parameters"] if p["symbol"] in ends]
    assert len(common) == 15
    for p in common:
        low, high = ends[p["symbol"]]
        assert low <= p["low"] + 1e-10
        assert high >= p["high"] - 1e-10


def test_axes_renamed_with_the_mounting_are_the_same_block(tmp_path):
    """Use one scale factor for each accelerometer; two go by the signs of inputs along the convention's own axes."""
    write_hidden_record(tmp_path / "s.csv", 5, symmetric=True)
    table = pl.read_csv(tmp_path / "s.csv", comment_prefix="#")
    changed = axes_renamed(table)
    first, second = (
        relation(table, baseline="symmetric"),
        relation(changed.table, baseline="symmetric", **changed.options),
    )
    assert second["verdict"] == first["verdict"] == "consistent"
    assert second["radius"] == pytest.approx(first["radius"], rel=1e-5)
    # The frame of corrected readings is the convention's own; their length is the block's.
    before = corrected(table, tmp_path, baseline="symmetric")
    after = corrected(changed.table, tmp_path, baseline="symmetric", **changed.options)
    assert np.linalg.norm(after, axis=1) == pytest.approx(np.linalg.norm(before, axis=1), abs=1e-5)


def corrected(table: pl.DataFrame, folder: Path, **options: Any) -> np.ndarray:
    """Return the readings of a record corrected by its own calibration, (N, 3)."""
    calibration = measured.calibrate(table, noise_bound=SIGMA, convention="A2", **options)
    path = folder / "record.csv"
    table.write_csv(path)
    channels = options.get("channels", ())
    return apply_calibration(calibration, path, channels=channels).record.specific_force  # type: ignore[arg-type]


@pytest.mark.parametrize("name", ["time shifted", "channels renamed", "base turned with the mounting"])
def test_corrected_readings_are_the_same(name, clean, tmp_path):
    changed = (EXACT | SAME)[name](clean)
    after = corrected(changed.table, tmp_path, **changed.options)
    assert after == pytest.approx(corrected(clean, tmp_path), abs=1e-6)


@pytest.fixture(scope="module")
def calibration(clean: pl.DataFrame) -> Any:
    return measured.calibrate(clean, noise_bound=SIGMA, convention="A2")


def applied(calibration: Any, table: pl.DataFrame, path: Path) -> np.ndarray:
    """Return the readings of a record corrected by a calibration, (N, 3)."""
    (table.write_csv if path.suffix == ".csv" else table.write_parquet)(path)
    return apply_calibration(calibration, path).record.specific_force


@pytest.mark.acceptance
def test_a_correction_is_of_each_row_alone(clean, calibration, tmp_path):
    """Test any order of rows and columns, any turn of the table, any number of files, of any kind."""
    complete = applied(calibration, clean, tmp_path / "r.csv")
    for table in (clean.select(clean.columns[::-1]), whole_turns(clean).table):
        assert applied(calibration, table, tmp_path / "o.csv") == pytest.approx(complete, rel=1e-12)
    assert np.array_equal(applied(calibration, clean, tmp_path / "r.parquet"), complete)
    parts = [clean.head(17), clean.tail(clean.height - 17)]
    joined = np.vstack([applied(calibration, part, tmp_path / "part.csv") for part in parts])
    assert np.array_equal(joined, complete)
    twice = applied(calibration, doubled(clean).table, tmp_path / "o.csv")
    assert np.array_equal(twice, np.vstack([complete, complete[-1:]]))
    mixed = applied(calibration, another_order(clean).table, tmp_path / "o.csv")
    assert not np.array_equal(mixed, complete)
    assert np.array_equal(mixed[np.argsort(mixed[:, 0])], complete[np.argsort(complete[:, 0])])


@pytest.mark.acceptance
def test_csv_and_parquet_are_the_same_record(clean, tmp_path):
    """Written digits may be off by half the last one, which the bounds include."""
    clean.write_csv(tmp_path / "r.csv")
    clean.write_parquet(tmp_path / "r.parquet")
    csv, parquet = (measured.calibrate(tmp_path / f"r.{form}", noise_bound=SIGMA) for form in ("csv", "parquet"))
    assert csv.verdict == parquet.verdict
    for entry, second in zip(csv.to_json()["parameters"], parquet.to_json()["parameters"], strict=True):
        width = second["high"] - second["low"]
        assert [entry["low"], entry["high"]] == pytest.approx([second["low"], second["high"]], abs=1e-4 * width)
        assert entry["low"] <= second["low"] + 1e-6 * width
        assert entry["high"] >= second["high"] - 1e-6 * width


def test_a_record_split_and_joined_is_the_record(clean, tmp_path, first):
    clean.head(17).write_csv(tmp_path / "a.csv")
    clean.tail(23).write_csv(tmp_path / "b.csv")
    joined = pl.concat([pl.read_csv(tmp_path / "a.csv"), pl.read_csv(tmp_path / "b.csv")])
    assert relation(joined) == first


def test_a_part_of_a_record_leaves_more_possible_and_no_less(clean, first):
    fewer = relation(clean.head(30))
    assert fewer["verdict"] == "consistent"
    assert fewer["radius"] <= first["radius"] * (1.0 + 1e-9)
    for complete, part in zip(first["parameters"], fewer["parameters"], strict=True):
        assert part["low"] <= complete["low"] + 1e-10
        assert part["high"] >= complete["high"] - 1e-10


@pytest.fixture(scope="module")
def moved(tmp_path_factory: pytest.TempPathFactory) -> pl.DataFrame:
    path = tmp_path_factory.mktemp("moved") / "moved.csv"
    write_record(strapdown_record(true_motion(POSES[:6])), path)
    return pl.read_csv(path, comment_prefix="#")


def inspected(table: pl.DataFrame, **options: Any) -> dict:
    result = measured.inspect(table, **options).to_json()
    return {name: value for name, value in result.items() if name not in FILE}


@pytest.mark.acceptance
def test_an_inspection_knows_no_zero_of_time_and_no_order_of_columns(moved):
    first = inspected(moved)
    later = inspected(moved.with_columns(pl.col("time_s") + 4096.0))
    assert [d for d in differences(first, later, 1e-6) if "_s" not in d.partition(":")[0]] == []
    assert inspected(moved.select(moved.columns[::-1])) == first


def test_rates_in_degrees_that_are_said_are_the_same_rates(moved):
    rates = [f"w{k}_radps" for k in (1, 2, 3)]
    degrees = moved.with_columns(pl.col(rates) * (180.0 / np.pi))
    first, second = inspected(moved), inspected(degrees, channels=("w=deg",))
    for name in first.keys() - {"warnings", "turning"}:
        assert differences(first[name], second[name], 1e-9) == [], name
    # The intervals are found step by step, until a step is small compared with the noise.
    matrix = np.array(first["turning"]["matrix"])
    assert np.array(second["turning"]["matrix"]) == pytest.approx(matrix, abs=1e-3)


@pytest.mark.acceptance
def test_an_inspection_of_csv_and_of_parquet_are_the_same(moved, tmp_path):
    moved.write_csv(tmp_path / "r.csv")
    moved.write_parquet(tmp_path / "r.parquet")
    csv, parquet = (measured.inspect(tmp_path / f"r.{form}").to_json() for form in ("csv", "parquet"))
    assert {k: v for k, v in csv.items() if k not in FILE} == {k: v for k, v in parquet.items() if k not in FILE}


def test_an_inspection_of_renamed_axes_says_the_same_of_renamed_axes(moved):
    """Axes 1, 2, 3 are renamed 3, 1, 2, for gyros and accelerometers alike."""
    groups = (["w1_radps", "w2_radps", "w3_radps"], READINGS)
    new = [pl.col(group[(k + 1) % 3]).alias(group[k]) for group in groups for k in range(3)]
    first, second = inspected(moved), inspected(moved.with_columns(new))
    order = [1, 2, 0]
    for name in ("count", "time_s", "length_s"):
        assert second["rests"][name] == first["rests"][name]
    before, after = (np.array(result["rests"]["force_bound_mps2"]) for result in (first, second))
    assert after == pytest.approx(before[:, order], rel=1e-9)
    assert second["rate_rms_radps"] == pytest.approx([first["rate_rms_radps"][k] for k in order], rel=1e-9)
    before, after = (np.array(result["turning"]["matrix"]) for result in (first, second))
    assert after == pytest.approx(before[np.ix_(order, order)], abs=1e-3)
    assert second["gyros_at_rest"]["verdict"] == first["gyros_at_rest"]["verdict"]


def attitude(table: pl.DataFrame | Path, **options: Any) -> np.ndarray:
    """Return the computer's attitude, (N, 4)."""
    return measured.attitude_of_record(table, **options).attitude


@pytest.mark.acceptance
def test_attitude_is_the_same_of_another_table_of_the_same_motion(moved, tmp_path):
    """Test columns in another order, another kind of file, channels renamed and rates in degrees, with their
    options."""
    first = attitude(moved)
    assert np.array_equal(attitude(moved.select(moved.columns[::-1])), first)
    moved.write_csv(tmp_path / "r.csv")
    moved.write_parquet(tmp_path / "r.parquet")
    assert np.array_equal(attitude(tmp_path / "r.csv"), first)
    assert np.array_equal(attitude(tmp_path / "r.parquet"), first)
    rates = [f"w{k}_radps" for k in (1, 2, 3)]
    degrees = moved.with_columns(pl.col(rates) * (180.0 / np.pi))
    assert attitude(degrees, channels=("w=deg",)) == pytest.approx(first, abs=1e-12)
    new = [
        pl.col("w3_radps").alias("w1_radps"),
        -pl.col("w1_radps").alias("w2_radps"),
        pl.col("w2_radps").alias("w3_radps"),
    ]
    assert np.array_equal(attitude(moved.with_columns(new), channels=("w=-2,3,1",)), first)


def test_attitude_of_a_record_that_ends_early_is_the_beginning_of_the_whole(moved):
    complete = attitude(moved)
    part = attitude(moved.head(moved.height // 2))
    assert 100 < len(part) < len(complete)
    assert np.array_equal(part, complete[: len(part)])


def imported(table: pl.DataFrame, path: Path, write: Callable[[pl.DataFrame, Path], object]) -> pl.DataFrame:
    """Return the record of an import of a laboratory's table."""
    write(table, path)
    out = path.parent / "record.csv"
    written = measured.import_record(path, out=out, answers={"units.force": "mg", "decimal": "."})
    assert written is not None
    return pl.read_csv(out, comment_prefix="#")


def semicolons(table: pl.DataFrame, path: Path) -> None:
    table.write_csv(path, separator=";")


def packed(table: pl.DataFrame, path: Path) -> None:
    path.write_bytes(gzip.compress(table.write_csv().encode(), mtime=0))


SYSTEM = """schema = "trihedron.scenario/1"
[run]
stop_s = 2.0
step_s = 0.1
{fmus}
{wires}
[record]
format = "{form}"
"""
FMUS = (
    '[fmus.table]\ncomponent = "HarmonicMotion"\n[fmus.table.parameters]\npsi_amplitude = [0.2, 0.1, 0.0, 0.0]\n',
    '[fmus.block]\ncomponent = "GyroBlock"\n[fmus.block.parameters]\nnoise_bound = 1e-5\n',
    '[fmus.computer]\ncomponent = "AttitudeComputer"\n',
)
WIRES = (
    '[[connections]]\nfrom = "table.increment"\nto = "block.increment"\n',
    '[[connections]]\nfrom = "block.increment_reading"\nto = "computer.increment"\n',
)


def simulated(folder: Path, fmus: str, wires: str, form: str) -> pl.DataFrame:
    """Return the record that a run has written."""
    (folder / "s.toml").write_text(SYSTEM.format(fmus=fmus, wires=wires, form=form), encoding="utf-8")
    library.simulate(folder / "s.toml", out=folder / form)
    return (pl.read_csv if form == "csv" else pl.read_parquet)(folder / form / f"run.{form}")


def test_a_run_knows_no_order_of_components_and_connections_and_no_kind_of_file(tmp_path):
    first = simulated(tmp_path, "".join(FMUS), "".join(WIRES), "parquet")
    assert first.height == 21
    second = simulated(tmp_path, "".join(FMUS[::-1]), "".join(WIRES[::-1]), "parquet")
    assert second.select(first.columns).equals(first)
    assert simulated(tmp_path, "".join(FMUS), "".join(WIRES), "csv").equals(first)


def test_settings_in_other_columns_are_the_same_settings(tmp_path):
    alpha, beta = np.array([10.0, 80.0, 200.0, 300.0, 120.0, 45.0]), np.array([20.0, 140.0, 260.0, 350.0, 75.0, 5.0])
    angles = {"planned_alpha_deg": alpha, "planned_beta_deg": beta, "alpha_deg": alpha + 0.01, "beta_deg": beta - 0.01}
    table = pl.DataFrame(angles)
    table.write_csv(tmp_path / "a.csv")
    table.select(table.columns[::-1]).write_csv(tmp_path / "b.csv")
    for entry, second in zip(read_settings(tmp_path / "a.csv"), read_settings(tmp_path / "b.csv"), strict=True):
        assert np.array_equal(entry.angle, second.angle)


@pytest.mark.acceptance
def test_an_imported_record_is_of_its_rows(clean, tmp_path):
    """Columns' order, separator, file and number do not matter; a later clock is later in the record."""
    names = {f"f{k}_mps2": f"f{k} [mg]" for k in (1, 2, 3)}
    force = pl.col(list(names)) * (1000.0 / 9.80665)
    table = clean.select("position", "time_s", "alpha_deg", "beta_deg", *names).with_columns(force).rename(names)
    csv = pl.DataFrame.write_csv
    complete = imported(table, tmp_path / "lab.csv", csv)
    assert imported(table.select(table.columns[::-1]), tmp_path / "lab.csv", csv).equals(complete)
    assert imported(table, tmp_path / "lab.csv", semicolons).equals(complete)
    assert imported(table, tmp_path / "lab.csv.gz", packed).equals(complete)
    parts = [imported(part, tmp_path / "lab.csv", csv) for part in (table.head(17), table.tail(table.height - 17))]
    assert pl.concat(parts, how="vertical_relaxed").equals(complete)
    later = imported(table.with_columns(pl.col("time_s") + 4096.0), tmp_path / "lab.csv", csv)
    assert later.drop("time_s").equals(complete.drop("time_s"))
    assert later["time_s"].to_numpy() == pytest.approx(complete["time_s"].to_numpy() + 4096.0, rel=1e-12)
    retained = [name for name in complete.columns if name not in ("position", "time_s")]
    mixed = imported(another_order(table).table, tmp_path / "lab.csv", csv)
    assert not mixed.equals(complete)
    assert mixed.select(retained).sort(retained).equals(complete.select(retained).sort(retained))
    twice = imported(doubled(table).table, tmp_path / "lab.csv", csv)
    assert twice.head(complete.height).equals(complete)
    assert twice.tail(1).select(retained).equals(complete.tail(1).select(retained))
