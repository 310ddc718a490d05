"""Several records calibrated in one programme: parameters of the instrument are determined better, or at all."""

import json
import math
import re
from typing import Any

import numpy as np
import pytest

import trihedron as th
from generator.positions import of_one_instrument
from generator.stands import random_bench, simulated
from trihedron import calibrate_together
from trihedron.tools.calibrated import Calibration, Parameter
from trihedron.tools.calibration import Applied, correction_of, read_correction
from trihedron.tools.check import check
from trihedron.tools.cli import main
from trihedron.tools.records import write_record

SIGMA = 1e-5
OF_INSTRUMENT = ("X4", "X5", "X9", "X10", "X14", "X15", "X6+X8", "X7+X12", "X11+X13")
SCALE_FACTORS_OF_1 = [9, 12]


def every_parameter(calibration: Calibration) -> list[tuple[str | None, Parameter]]:
    """Return each parameter with its record, None if it is the instrument's."""
    pairs: list[tuple[str | None, Parameter]] = [(None, p) for p in calibration.parameters]
    for label, record in calibration.of_record.items():
        pairs += [(label, p) for p in record.parameters]
    return pairs


def ends(calibration: Calibration) -> dict[tuple[str, str | None], tuple[float, float]]:
    return {
        (p.symbol, record): (-math.inf if p.low is None else p.low, math.inf if p.high is None else p.high)
        for record, p in every_parameter(calibration)
    }


@pytest.mark.acceptance
def test_together_each_interval_lies_in_that_of_every_record():
    """All of them hold the truth, so none may be outside; the instrument's are narrower than any record's own."""
    records = of_one_instrument(21, positions=20)
    together = ends(calibrate_together(*records, noise_bound=SIGMA))
    alone = [{p.symbol: p for p in th.calibrate(record, noise_bound=SIGMA).parameters} for record in records]
    assert {name for name, record in together if record is None} == set(OF_INSTRUMENT)
    for (name, record), (low, high) in together.items():
        of_these = alone if record is None else [alone[int(record.removeprefix("record-")) - 1]]
        for parameters in of_these:
            estimate = parameters[name]
            assert estimate.low is not None
            assert estimate.high is not None
            assert estimate.low - 1e-9 <= low < high <= estimate.high + 1e-9


@pytest.mark.acceptance
def test_three_of_six_positions_which_alone_prove_nothing_are_calibrated_together(tmp_path, capsys):
    for name, record in zip("abc", of_one_instrument(17, positions=6), strict=True):
        write_record(record, tmp_path / f"{name}.csv")
    out, files = tmp_path / "together.json", [str(tmp_path / f"{name}.csv") for name in "abc"]
    page = tmp_path / "together.html"
    assert main(["calibrate", *files, "--noise-bound", "1e-5", "--json", str(out), "--report", str(page)]) == 0
    text = capsys.readouterr().out
    assert text.startswith("Consistent: one value of each instrument parameter fits all records")
    assert "X16 bias of accelerometer 1" in text.partition("c alone")[2]
    again = Calibration.model_validate_json(out.read_text(encoding="utf-8"))
    assert again.to_json() == json.loads(out.read_text(encoding="utf-8"))
    assert check(out).summary == ("3 records, consistent",)
    text = page.read_text(encoding="utf-8")
    assert all(f"<h2>{head}</h2>" in text for head in ("The instrument", "a alone", "b alone", "c alone"))
    assert len(re.findall('<td class="words">−?X', text)) == len(every_parameter(again))
    assert main(["calibrate", *files[:1], "--noise-bound", "1e-5", "--own", "X4"]) == 2
    for wrong, why in (
        (["--target", "X4-X5"], "--target: is of one record; give one"),
        (["--convention", "A2"], "--convention A2: is of one record"),
        (["--strapdown", str(tmp_path / "d.csv")], "--strapdown: is of one record"),
        (["--own", "X99"], "--own X99: no parameter of these records"),
    ):
        capsys.readouterr()
        assert main(["calibrate", *files, "--noise-bound", "1e-5", *wrong]) == 2
        assert why in capsys.readouterr().err


@pytest.mark.acceptance
def test_a_calibration_of_several_records_is_applied_like_one_of_one(tmp_path, capsys):
    """A record among them has its own biases, another one those of the last; its promise is tighter."""
    *records, another = of_one_instrument(21, 3, positions=20)
    together = calibrate_together(*records, noise_bound=SIGMA)
    for number, record in enumerate(records, start=1):
        alone = th.calibrate(record, noise_bound=SIGMA).reading_errors
        for by_itself, in_all in zip(alone, together.of_record[f"record-{number}"].reading_errors, strict=True):
            assert (by_itself.accelerometer, by_itself.input) == (in_all.accelerometer, in_all.input)
            low, least, most, high = np.array([by_itself.low, in_all.low, in_all.high, by_itself.high], dtype=float)
            assert low - 1e-9 <= least < most <= high + 1e-9
    names = [tmp_path / f"{name}.csv" for name in ("a", "b", "other")]
    for name, record in zip(names, (*records, another), strict=True):
        write_record(record, name)
    out, ssv = tmp_path / "together.json", tmp_path / "block.ssv"
    first, second, third = map(str, names)
    assert main(["calibrate", first, second, "--noise-bound", "1e-5", "--json", str(out), "--ssv", str(ssv)]) == 0
    bias = {record: p.estimate for record, p in every_parameter(together) if p.symbol == "X16"}
    written = re.search(r'name="bias\[1\]">\s*<ssv:Real value="([^"]+)"', ssv.read_text(encoding="utf-8"))
    assert written is not None
    assert float(written[1]) == pytest.approx(bias["record-2"], abs=1e-9)
    for file, of in ((first, "record-1"), (second, "record-2"), (third, "record-2")):
        applied = th.apply(out, file)
        assert isinstance(applied, Applied)
        assert applied.bias_g is not None
        assert applied.bias_g[0] == pytest.approx(bias[of], abs=1e-9)
        assert any("of its own is that of b, the last" in text for text in applied.warnings) == (file == third)
    content = json.loads(out.read_text(encoding="utf-8"))
    del content["of_record"]["b"]["provenance"]
    out.write_text(json.dumps(content), encoding="utf-8")
    capsys.readouterr()
    assert main(["apply", str(out), first]) == 2
    assert "provenance: is missing; calibrate again" in capsys.readouterr().err


def test_what_the_records_leave_open_has_no_estimate():
    records = of_one_instrument(17, positions=3)
    together = calibrate_together(*records[:2], noise_bound=SIGMA)
    assert together.verdict == "insufficient"
    parameters = [p for _, p in every_parameter(together)]
    still_open = [p for p in parameters if p.estimate is None]
    assert [p.bounded for p in parameters] == [p.estimate is not None for p in parameters]
    assert 0 < len(together.open) <= len(still_open)
    in_directions = {name.partition(" in ")[0] for direction in together.open for name in direction.parameters}
    assert in_directions == {p.symbol for p in still_open}
    rows = [line for line in str(together).splitlines() if line.startswith(("X", "-X"))]
    assert len(rows) == len(parameters)
    assert sum("." in row for row in rows) == len(parameters) - len(still_open)


@pytest.mark.acceptance
@pytest.mark.parametrize("own_symbols", [(), ("X4", "X5")])
def test_a_scale_factor_that_changed_falsifies_that_it_is_shared_and_not_that_it_is_each_records_own(own_symbols):
    rng = np.random.default_rng(4)
    benches = np.stack([random_bench(rng)] * 2)
    benches[1, SCALE_FACTORS_OF_1] += 3e-4
    records = [simulated(bench, noise=rng.uniform(-SIGMA, SIGMA, (24, 3))) for bench in benches]
    together = calibrate_together(*records, noise_bound=SIGMA, own=own_symbols)
    assert together.verdict == ("consistent" if own_symbols else "falsified")
    if own_symbols:
        changed = np.array([ends(together)["X4", f"record-{k}"] for k in (2, 1)])
        assert changed[0, 0] - changed[1, 1] < 3e-4 < changed[0, 1] - changed[1, 0]


def of_joint_schema(together: Calibration) -> dict[str, Any]:
    """Return the same calibration in the schema of several records."""
    content = together.to_json()
    parameters, of_records = [], {}
    for record, p in every_parameter(together):
        numbers = {"estimate": p.estimate, "low": p.low, "high": p.high}
        parameters.append({"name": p.symbol, "unit": p.unit, "record": record} | numbers)
    for label, record in content["of_record"].items():
        of_records[label] = {key: record[key] for key in ("mountings", "reading_errors")}
        of_records[label]["noise_bound"] = record["sigma"]["value"]
    former = {key: content[key] for key in ("verdict", "radius", "gravity_mps2", "convention", "baseline")}
    digests = [record["provenance"]["record_sha256"] for record in content["of_record"].values()]
    former |= {"schema": "trihedron.joint-calibration/1", "records": list(of_records), "sha256": digests}
    return former | {"of_records": of_records, "parameters": parameters}


@pytest.mark.acceptance
def test_a_file_of_the_former_schema_of_several_records_is_still_read(tmp_path):
    together = calibrate_together(*of_one_instrument(21, positions=20), noise_bound=SIGMA)
    path = tmp_path / "former.json"
    path.write_text(json.dumps(of_joint_schema(together)), encoding="utf-8")
    again = Calibration.model_validate_json(path.read_text(encoding="utf-8"))
    assert ends(again) == ends(together)
    former, present = read_correction(path), correction_of(together.to_json(), "here")
    for name in ("plus", "minus", "gamma", "bias", "low", "high"):
        np.testing.assert_array_equal(getattr(former, name), getattr(present, name))
    checked = check(path)
    assert (checked.good, checked.summary) == (True, (f"{len(together.of_record)} records, consistent",))
