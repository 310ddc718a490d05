"""An instrument's folder: stored records come back, the nearest is found, and parameters that change are proven."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import trihedron as th
from generator.positions import of_one_instrument
from generator.stands import random_bench, simulated
from trihedron.tools.calibrated import Calibration, first_falsified
from trihedron.tools.calibration import calibrate
from trihedron.tools.cli import main
from trihedron.tools.diagnosis import Cause
from trihedron.tools.errors import InputError
from trihedron.tools.instrument import (
    add_to_instrument,
    entries_of,
    nearest_of_instrument,
    trend_of_instrument,
)
from trihedron.tools.records import PositionRecord, read_record, write_record

SIGMA = 1e-5
DATES, DEGREES = ("2026-03-02", "2026-06-01T14:00", "2026-09-07"), (15.0, 31.0, 22.0)
SCALE_FACTORS_OF_1 = [9, 12]


@pytest.fixture(scope="module")
def root(tmp_path_factory) -> Path:
    """Write three calibrations of one bench; the scale factors of the first accelerometer change before the third."""
    root, rng = tmp_path_factory.mktemp("instrument"), np.random.default_rng(4)
    bench = random_bench(rng)
    for k in range(3):
        edited = bench + 0.0
        edited[SCALE_FACTORS_OF_1] += 3e-4 * (k == 2)
        record = simulated(edited, noise=rng.uniform(-SIGMA, SIGMA, (24, 3)))
        write_record(record, root / f"{k}.csv")
        comments = f"# date: {DATES[k]}\n# serial number: U-17\n# temperature: {DEGREES[k]}\n"
        (root / f"{k}.csv").write_text(comments + (root / f"{k}.csv").read_text(encoding="utf-8"), encoding="utf-8")
        measured = read_record(root / f"{k}.csv", PositionRecord)
        (root / f"{k}.json").write_text(calibrate(measured, noise_bound=SIGMA).json_text(), encoding="utf-8")
    for k in (2, 0, 1):
        add_to_instrument(root / "unit", root / f"{k}.json", records=[root / f"{k}.csv"])
    return root


def ends_over_time(trend: Calibration) -> dict[str, list[tuple[float | None, float | None]]]:
    """Return the ends of each parameter in each record; None twice without information."""
    ends = {}
    for change in trend.changes:
        alone = trend.each(change.symbol)
        ends[change.symbol] = []
        for label in trend.of_record:
            p = alone.get(label)
            ends[change.symbol].append((None, None) if p is None else (p.low, p.high))
    return ends


def test_what_the_records_comment_lines_say_stands_in_the_folder_in_order_of_the_dates(root):
    content = entries_of(root / "unit")
    assert content.serial == "U-17"
    assert [entry.temperature for entry in content.entries] == list(DEGREES)
    for k, entry in enumerate(content.entries):
        assert entry.date.startswith(DATES[k])
        assert entry.result == json.loads((root / f"{k}.json").read_text(encoding="utf-8"))


@pytest.mark.parametrize(
    ("options", "which"),
    [
        ({}, 2),
        ({"date": "2026-04-16"}, 0),
        ({"date": "2026-04-18"}, 1),
        ({"date": "2030-01-01"}, 2),
        ({"temperature": 18.4}, 0),
        ({"temperature": 40.0}, 1),
        ({"temperature": 24.0, "kind": "calibration"}, 2),
    ],
)
def test_the_nearest_in_date_or_temperature(root, options, which):
    assert nearest_of_instrument(root / "unit", **options).date.startswith(DATES[which])


def test_a_scale_factor_that_changed_is_no_constant_since_that_date_and_nothing_else_is_said_to_change(root):
    trend = trend_of_instrument(root / "unit")
    assert trend.verdict == "falsified"
    by_name = {change.symbol: change for change in trend.changes}
    for symbol in ("X4", "X5"):
        assert (by_name[symbol].since, by_name[symbol].beside) == ("2026-09-07", "2026-03-02")
        assert 1e-4 < by_name[symbol].at_least < 3e-4
    assert {change.since for name, change in by_name.items() if name not in ("X4", "X5")} == {None}


@pytest.mark.acceptance
def test_of_several_records_calibrated_together_each_has_its_date_and_what_they_share_stands_once(root, tmp_path):
    """Biases belong to each record, at its own date; the scale factors of the first two days are at the second's."""
    shared, files = tmp_path / "shared.json", [root / "0.csv", root / "1.csv"]
    together = th.calibrate_together(*files, noise_bound=SIGMA)
    shared.write_text(together.json_text(), encoding="utf-8")
    entry = add_to_instrument(tmp_path / "unit", shared, records=files)
    assert (entry.date, entry.temperature, entry.serial) == (DATES[1], DEGREES[1], "U-17")
    assert [(item.record, item.date.removesuffix("T00:00")) for item in entry.dates] == list(
        zip("01", DATES, strict=False)
    )
    add_to_instrument(tmp_path / "unit", root / "2.json", records=[root / "2.csv"])
    trend = trend_of_instrument(tmp_path / "unit")
    assert tuple(trend.of_record) == DATES
    by_name = {change.symbol: change for change in trend.changes}
    ends_of: dict[tuple[str, str | None], tuple[float | None, float | None]] = {}
    for p in together.parameters:
        ends_of[p.symbol, None] = (p.low, p.high)
    for label, record in together.of_record.items():
        ends_of |= {(p.symbol, label): (p.low, p.high) for p in record.parameters}
    ends = ends_over_time(trend)
    assert ends["X16"][:2] == [ends_of["X16", "0"], ends_of["X16", "1"]]
    assert ends["X4"][:2] == [(None, None), ends_of["X4", None]]
    assert (by_name["X4"].since, by_name["X4"].beside) == ("2026-09-07", DATES[1])
    with pytest.raises(InputError, match="is there already"):
        add_to_instrument(tmp_path / "unit", shared, records=files)
    with pytest.raises(InputError, match="is not the record of"):
        add_to_instrument(tmp_path / "other", shared, records=[root / "2.csv"])
    assert nearest_of_instrument(tmp_path / "unit", date="2026-06-01").result == json.loads(shared.read_text("utf-8"))


@pytest.mark.acceptance
def test_of_several_records_diagnosed_together_what_is_a_runs_stands_at_its_own_date(tmp_path):
    """Use two days without a secret; then a changed scale factor in the second: that day alone shows it."""
    files = [tmp_path / f"{k}.csv" for k in range(2)]
    for path, date, record in zip(files, DATES, of_one_instrument(21, 2, positions=20), strict=False):
        write_record(record, path)
        path.write_text(f"# date: {date}\n{path.read_text('utf-8')}", "utf-8")
    diagnosis = th.diagnose_together(*files, noise_bound=SIGMA)
    changed = Cause(effect="parameter", where="X4", record="1", equivalents=(), parameters=())
    assert diagnosis.repeatability is not None
    alone = ends_over_time(diagnosis.repeatability)
    together = {p.symbol: (p.low, p.high) for p in diagnosis.stated.parameters}
    nothing = (None, None)
    in_both = (changed, changed.model_copy(update={"record": "0"}))
    of_none = changed.model_copy(update={"record": "of another folder"})
    for name, causes, x4 in (
        ("same", (), [nothing, together["X4"]]),
        ("changed", (changed,), [together["X4"], alone["X4"][1]]),
        ("in-both", in_both, alone["X4"]),
        ("edited", (of_none,), [nothing, together["X4"]]),
    ):
        result = diagnosis.model_copy(update={"verdict": "explained" if causes else "consistent", "causes": causes})
        (tmp_path / f"{name}.json").write_text(result.json_text(), encoding="utf-8")
        entry = add_to_instrument(tmp_path / name, tmp_path / f"{name}.json", records=files)
        assert (entry.kind, entry.date, len(entry.dates)) == ("diagnosis", DATES[1], 2)
        ends = ends_over_time(trend_of_instrument(tmp_path / name))
        assert ends["X16"] == alone["X16"]
        assert ends["X4"] == x4
        assert ends["X9"] == [nothing, together["X9"]]
        with pytest.raises(InputError, match="is there already"):
            add_to_instrument(tmp_path / name, tmp_path / f"{name}.json", records=files)


@pytest.mark.acceptance
def test_several_records_of_other_instruments_are_no_entry(root, tmp_path):
    files = [tmp_path / "0.csv", root / "1.csv"]
    files[0].write_text((root / "0.csv").read_text("utf-8").replace("U-17", "U-16"), encoding="utf-8")
    (tmp_path / "shared.json").write_text(th.calibrate_together(*files, noise_bound=SIGMA).json_text(), "utf-8")
    with pytest.raises(InputError, match="its records are of several instruments: U-16, U-17"):
        add_to_instrument(tmp_path / "unit", tmp_path / "shared.json", records=files)


Ends = st.tuples(st.integers(-9, 9), st.integers(0, 6)).map(lambda pair: (pair[0], pair[0] + pair[1]))


@given(st.lists(Ends, min_size=1, max_size=8))
def test_the_first_date_is_that_at_which_no_number_lies_in_all_intervals_so_far(ends):
    """Compare with every possible number: ends of intervals are whole numbers here."""
    common = [
        any(all(low <= number <= high for low, high in ends[: k + 1]) for number in range(-9, 16))
        for k in range(len(ends))
    ]
    falsified, against = first_falsified({str(k): (float(low), float(high)) for k, (low, high) in enumerate(ends)})
    assert falsified == (str(common.index(False)) if False in common else None)
    if falsified is not None and against is not None:
        (low, high), (least, most) = ends[int(falsified)], ends[int(against)]
        assert high < least or most < low


@pytest.mark.acceptance
def test_the_commands_list_show_and_page_it(root, capsys):
    unit, page, nearest = str(root / "unit"), root / "trend.html", root / "nearest.json"
    assert main(["instrument", "list", unit]) == 0
    assert capsys.readouterr().out.count("calibration, consistent, of U-17") == 3
    assert main(["instrument", "show", unit, "--temperature", "30", "--out", str(nearest)]) == 0
    assert json.loads(nearest.read_text(encoding="utf-8")) == json.loads((root / "1.json").read_text(encoding="utf-8"))
    out = root / "trend.json"
    assert main(["instrument", "trend", unit, "--report", str(page), "--json", str(out)]) == 0
    assert "changed by 2026-09-07 (against 2026-03-02)" in capsys.readouterr().out
    assert "<svg " in page.read_text(encoding="utf-8")
    again = Calibration.model_validate_json(out.read_text(encoding="utf-8"))
    assert again.to_json() == json.loads(out.read_text(encoding="utf-8"))


def test_what_is_there_or_of_another_instrument_or_no_result_is_refused_in_one_line(root, tmp_path):
    unit, first = root / "unit", root / "0.json"
    before = sorted(path.name for path in unit.iterdir())
    (tmp_path / "again.json").write_text(first.read_text(encoding="utf-8") + "\n", encoding="utf-8")
    wrong: tuple[tuple[Path, dict[str, Any], str], ...] = (
        (first, {"date": "2026-10-01"}, "0.json: is there already"),
        (tmp_path / "again.json", {"date": "2026-10-01"}, "a calibration of this record is there already"),
        (first, {}, "no date: give --date"),
        (first, {"date": "1.2.2026"}, "--date 1.2.2026: write a date as"),
        (first, {"date": "2026-10-01", "temperature": 4e3}, "--temperature 4000"),
        (first, {"records": [root / "1.csv"]}, "is not the record of"),
        (first, {"records": [root / "1.csv", root / "0.csv"]}, "1.csv: is not the record of"),
        (root / "0.csv", {"date": "2026-10-01"}, "0.csv: is not JSON text"),
        (unit / before[0], {"date": "2026-10-01"}, "a calibration or a diagnosis is needed"),
    )
    for result, options, why in wrong:
        with pytest.raises(InputError, match=why) as refused:
            add_to_instrument(unit, result, **options)
        assert "\n" not in str(refused.value)
    edited = json.loads(first.read_text(encoding="utf-8")) | {"provenance": None}
    (tmp_path / "other.json").write_text(json.dumps(edited), encoding="utf-8")
    with pytest.raises(InputError, match="is of the instrument U-17, not of U-18"):
        add_to_instrument(unit, tmp_path / "other.json", date="2026-10-01", serial="U-18")
    assert sorted(path.name for path in unit.iterdir()) == before
    (tmp_path / "unit").mkdir()
    (tmp_path / "unit" / "x.json").write_text((unit / before[0]).read_text().replace('"verdict"', '"verdikt"', 1))
    for content in (None, "{", "[]", '{"schema": "trihedron.instrument/2"}'):
        if content is not None:
            (tmp_path / "unit" / "x.json").write_text(content, encoding="utf-8")
        with pytest.raises(InputError, match=r"x\.json: "):
            entries_of(tmp_path / "unit")
    with pytest.raises(InputError, match="is not a folder"):
        entries_of(tmp_path / "none")


@pytest.mark.parametrize("command", ["trend --json", "trend --report", "list --json", "show --out", "second name"])
def test_no_output_replaces_an_archived_calibration(command, root, tmp_path, capsys):
    folder = tmp_path / "unit"
    for k in range(2):
        assert main(["instrument", "add", str(folder), str(root / f"{k}.json"), "--date", DATES[k], "-q"]) == 0
    entries = {path: path.read_bytes() for path in folder.glob("*.json")}
    target = max(entries)
    if command == "second name":
        command, target = "show --out", tmp_path / "other.json"
        target.hardlink_to(max(entries))
    word, option = command.split()
    assert main(["instrument", word, str(folder), option, str(target)]) == 2
    assert "trihedron: " in capsys.readouterr().err
    assert {path: path.read_bytes() for path in folder.glob("*.json")} == entries
