"""The estimate of a calibration is possible: one point, within every interval, near the truth; other estimates."""

import json
from collections.abc import Sequence
from decimal import Decimal
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from calibration_checks import tilt_left
from generator import G as GRAVITY
from generator.stands import ALPHA, BETA, random_bench, record, simulated
from trihedron import check
from trihedron.fmus.parameters import bench_parameters, calibrated_block
from trihedron.models.bench import target_reading, target_values
from trihedron.tools.calibration import Calibration, apply_calibration, calibrate, correction_of, write_parameter_set
from trihedron.tools.document import Section
from trihedron.tools.errors import InputError
from trihedron.tools.records import PositionRecord, write_record
from trihedron.tools.reports import page_of
from trihedron.tools.reports.calibration import ESTIMATORS

SIGMA = 1e-5
IDENTITY = np.eye(3)
ARCSEC = np.radians(1.0 / 3600.0)


def random_record(seed: int, count: int, noise: str = "uniform"):
    """Return a bench's targets and its record at random positions, with errors within σ."""
    rng = np.random.default_rng(seed)
    bench = random_bench(rng)
    alpha, beta = rng.uniform(0.0, 2.0 * np.pi, (2, count))
    errors = rng.uniform(-SIGMA, SIGMA, (count, 3))
    errors = {"uniform": errors, "edge": SIGMA * np.sign(errors)}.get(noise, errors)
    if noise == "Gaussian":
        errors = np.clip(rng.normal(0.0, SIGMA / 2.5, (count, 3)), -SIGMA, SIGMA)
    return target_values(bench, IDENTITY), simulated(bench, alpha, beta, errors)


@cache
def calibrated(seed: int, count: int, noise: str = "uniform") -> tuple[np.ndarray, Calibration]:
    truth, measured = random_record(seed, count, noise)
    return truth, calibrate(measured, noise_bound=SIGMA)


def column(result: Calibration, key: str) -> np.ndarray:
    return np.array([getattr(e, key) for e in result.parameters], dtype=float)


def rms(error: np.ndarray) -> float:
    """Return the root mean square in units of σ."""
    return float(np.sqrt(np.mean(error**2))) / SIGMA


@pytest.mark.parametrize(
    ("count", "noise", "part_of_a_priori", "estimator"),
    [
        (24, "uniform", 1.0, "analytic centre"),
        (100, "uniform", 0.5, "analytic centre"),
        (1000, "uniform", 0.05, "analytic centre"),
        (100, "Gaussian", 0.6, "analytic centre"),
        (200, "edge", 1e-3, "central programme"),
    ],
)
def test_the_estimate_is_possible_and_near_the_truth(count, noise, part_of_a_priori, estimator):
    """The exact model agrees with all readings at once: every reading is within σ of the estimated bench's."""
    truth, measured = random_record(3, count, noise)
    result = calibrated(3, count, noise)[1]
    assert (result.verdict, result.estimator, result.no_estimate) == ("consistent", estimator, "")
    estimate, low, high = (column(result, key) for key in ("estimate", "low", "high"))
    assert np.all((low <= estimate) & (estimate <= high))
    assert np.all((low <= truth) & (truth <= high))
    predicted = target_reading(estimate, measured.alpha, measured.beta, IDENTITY)
    assert np.abs(measured.specific_force / GRAVITY - predicted).max() <= SIGMA * (1.0 + 1e-8)
    assert np.all(np.abs(truth - estimate) <= column(result, "error_bound"))
    np.testing.assert_allclose(column(result, "error_bound"), np.maximum(high - estimate, estimate - low), rtol=1e-9)
    a_priori = column(result, "a_priori")
    assert np.all(np.abs(truth - a_priori) <= column(result, "guaranteed_error"))
    assert rms(estimate - truth) < part_of_a_priori * rms(a_priori - truth)
    # not the middle for each target, but near it
    assert np.all(np.abs(estimate - (low + high) / 2.0) < 0.45 * (high - low) + 1e-12 * SIGMA)


def sections_of(result: Calibration, record: PositionRecord | None = None) -> Sequence[Section]:
    """Return the sections of a calibration's page."""
    page = page_of(result, record)
    assert page is not None
    return page.sections


@pytest.mark.acceptance
def test_more_readings_prove_a_priori_estimates_impossible_and_it_is_said():
    outside = {}
    for count in (100, 1000):
        result = calibrated(3, count)[1]
        outside[count] = sum(not e.possible(e.a_priori) for e in result.parameters)
        assert ESTIMATORS["analytic centre"] in str(result)
        (section,) = [section for section in sections_of(result) if section.title == "Other estimates"]
        assert f"The readings exclude the a-priori estimate of {outside[count]}" in (" ".join(section.paragraphs))
        assert section.table is not None
        assert sum("a priori" in str(row[-1]) for row in section.table.rows) == outside[count]
    assert outside[100] < outside[1000]
    assert outside[1000] >= 14


@pytest.mark.parametrize(("count", "worst", "gain"), [(100, 1.0, 2.0), (1000, 0.15, 20.0)])
def test_readings_corrected_by_it_are_better_than_by_the_a_priori_estimates(count, worst, gain):
    """Compare the tilt with the truth [arcsec], over many attitudes, root mean square."""
    truth, result = calibrated(3, count)
    tilt, a_priori = (
        tilt_left(correction_of(content, "here"), truth) / ARCSEC
        for content in (result.to_json(), of_first_schema(result))
    )
    assert tilt < worst
    assert a_priori > gain * tilt


@pytest.mark.acceptance
def test_least_squares_and_its_standard_error_are_what_practitioners_know():
    """In Gaussian noise errors agree with the standard errors; the fit is that of ordinary least squares."""
    ratios = []
    for seed in range(12):
        truth, result = calibrated(seed, 60, "Gaussian")
        ratios.append((column(result, "least_squares") - truth) / column(result, "standard_error"))
        linearised = result.linearised
        # a reading whose sign is open weighs less
        weight = SIGMA / linearised.bound
        step = np.linalg.lstsq(
            linearised.jacobian * weight[:, None], linearised.residual_at(truth) * weight, rcond=None
        )[0]
        assert np.abs(truth + step - column(result, "least_squares")).max() < 1e-5 * SIGMA
    assert np.sqrt(np.mean(np.square(ratios))) == pytest.approx(1.0, abs=0.12)


def test_readings_that_leave_no_freedom_give_no_standard_error():
    """With one axis of the table at rest, the value from one reading has no scatter."""
    measured = record(np.array([[1.0, 0.0, 0.0]]), np.radians([90.0]), np.radians([90.0]))
    by_symbol = {e.symbol: e for e in calibrate(measured, noise_bound=SIGMA, targets=["X4+X16"]).parameters}
    assert by_symbol["X4+X16"].least_squares == pytest.approx(0.0, abs=1e-12)
    assert by_symbol["X4+X16"].standard_error is None
    assert by_symbol["X4"].least_squares is None


def test_a_position_that_is_listed_twice_moves_the_centre_a_little():
    truth, measured = random_record(5, 40)
    once = column(calibrate(measured, noise_bound=SIGMA), "estimate")
    rows = np.append(np.arange(40), [7, 7])
    again = record(measured.specific_force[rows] / GRAVITY, measured.alpha[rows], measured.beta[rows])
    result = calibrate(again, noise_bound=SIGMA)
    moved = column(result, "estimate") - once
    assert 1e-4 * SIGMA < np.abs(moved).max() < 0.5 * SIGMA
    assert np.all((column(result, "low") <= column(result, "estimate")) & (truth <= column(result, "high")))
    # the possible set is the same
    width = column(calibrate(measured, noise_bound=SIGMA), "high") - column(
        calibrate(measured, noise_bound=SIGMA), "low"
    )
    np.testing.assert_allclose(column(result, "high") - column(result, "low"), width, rtol=1e-5)


def test_without_a_possible_point_there_is_no_estimate_and_it_is_said(tmp_path: Path):
    bench = random_bench(np.random.default_rng(3))
    noise = np.zeros((24, 3))
    noise[7, 1] = 1e-3
    falsified = calibrate(simulated(bench, noise=noise), noise_bound=SIGMA)
    assert falsified.verdict == "falsified"
    assert np.isnan(column(falsified, "low")).all()
    np.testing.assert_array_equal(column(falsified, "estimate"), column(falsified, "least_squares"))
    assert falsified.estimator == "least squares"
    text = str(falsified)
    assert "Estimates are those of least squares: no parameters of the model keep every reading" in text
    # The estimates are of use all the same, without a guarantee.
    values = {e.symbol: e.estimate for e in falsified.parameters}
    assert bench_parameters(falsified.to_json())["TurntableMotion"]["kappa"] == values["X1"]
    assert calibrated_block(falsified.to_json())["bias"] == [values[s] for s in ("X16", "X17", "X18")]
    correction = correction_of(falsified.to_json(), "here")
    assert correction.low is None
    assert correction.verdict == "falsified"
    assert np.all(correction.standard_errors(GRAVITY * np.eye(3)) > 0.0)
    write_parameter_set(falsified, tmp_path / "c.ssv")
    written = (tmp_path / "c.ssv").read_text(encoding="utf-8")
    assert str(values["X16"]) in written
    assert "verdict falsified" in written
    few = calibrate(simulated(bench, ALPHA[:4], BETA[:4], np.zeros((4, 3))), noise_bound=SIGMA)
    assert few.verdict == "insufficient"
    assert few.no_estimate.startswith("the readings leave X")
    assert all(e.estimate is None for e in few.parameters if e.symbol in {gap.symbol for gap in few.missing})
    with pytest.raises(ValueError, match="measure at its next_positions"):
        bench_parameters(few.to_json())
    with pytest.raises(InputError, match=r"lacks 'X.*measure at its next_positions"):
        correction_of(few.to_json(), "here")


def of_second_schema(result: Calibration) -> dict:
    """Return the same calibration in the second schema."""
    content = json.loads(result.json_text())
    sigma = content.pop("sigma")
    content |= {"schema": "trihedron.calibration/2", "noise_bound": sigma["value"], "noise_bound_basis": sigma["from"]}
    for entry, parameter in zip(content["parameters"], result.parameters, strict=True):
        del entry["determined"]
        entry |= {"error_bound": parameter.error_bound, "estimate": parameter.central}
    if content["estimator"] == "least squares":
        content["estimator"] = None
    if content.pop("open", None):
        content["missing"] = [{"symbol": gap.symbol, "name": gap.name} for gap in result.missing]
    content.pop("stands_with_sigma")
    return content


def of_first_schema(result: Calibration) -> dict:
    """Return the same calibration in the first schema."""
    content = of_second_schema(result)
    keys = ("symbol", "name", "unit", "guaranteed_error", "low", "high")
    content["schema"] = "trihedron.calibration/1"
    content["parameters"] = [{key: e[key] for key in keys} | {"estimate": e["a_priori"]} for e in content["parameters"]]
    return {key: value for key, value in content.items() if key not in ("estimator", "no_estimate")}


@pytest.mark.parametrize("verdict", ["consistent", "falsified", "insufficient"])
def test_a_file_of_the_second_schema_says_the_same_as_one_of_the_third(verdict):
    bench, noise = random_bench(np.random.default_rng(3)), np.zeros((24, 3))
    noise[7, 1] = 1e-3 if verdict == "falsified" else 0.0
    rows = slice(4 if verdict == "insufficient" else 24)
    result = calibrate(simulated(bench, ALPHA[rows], BETA[rows], noise[rows]), noise_bound=SIGMA)
    assert result.verdict == verdict
    again = Calibration.model_validate_json(json.dumps(of_second_schema(result)))
    assert [p.to_json() for p in again.parameters] == [p.to_json() for p in result.parameters]
    assert (again.sigma, again.radius, again.estimator) == (result.sigma, result.radius, result.estimator)
    # Directions were not written: each open parameter is separate.
    assert [direction.parameters for direction in again.open] == [[gap.symbol] for gap in result.missing]
    moved = {symbol for direction in result.open for symbol in direction.parameters}
    assert moved == {gap.symbol for gap in result.missing}
    assert again.reading_errors == result.reading_errors


def test_a_file_of_the_first_schema_is_still_read(tmp_path: Path):
    """Its estimates are the a-priori ones, in every use."""
    _, result = calibrated(3, 100)
    old = of_first_schema(result)
    values = {e.symbol: e for e in result.parameters}
    block = calibrated_block(old)
    assert block["bias"] == [values[s].a_priori for s in ("X16", "X17", "X18")]
    assert block["bias"] != calibrated_block(result.to_json())["bias"]
    assert bench_parameters(old)["TurntableMotion"]["kappa"] == values["X1"].a_priori
    path = tmp_path / "old.json"
    path.write_text(json.dumps(old, indent=1), encoding="utf-8")
    checked = check(path)
    assert (checked.good, checked.kind) == (True, "calibration"), checked.problems
    measured = tmp_path / "p.csv"
    write_record(random_record(3, 100)[1], measured)
    assert apply_calibration(path, measured).bias_g == block["bias"]
    again = Calibration.model_validate_json(path.read_text(encoding="utf-8"))
    assert again.estimator == "a priori"
    assert [e.estimate for e in again.parameters] == [e.a_priori for e in result.parameters]
    write_parameter_set(again, tmp_path / "old.ssv")
    bias = values["X16"].a_priori
    assert str(bias) in (tmp_path / "old.ssv").read_text(encoding="utf-8")


def test_an_estimate_that_was_edited_out_of_its_interval_is_refused():
    content = json.loads(calibrated(3, 100)[1].json_text())
    entry = content["parameters"][3]
    entry["estimate"] = entry["high"] + 0.01 * (entry["high"] - entry["low"])
    with pytest.raises(ValueError, match="X4: its estimate, low and high exclude one another; was it edited"):
        calibrated_block(content)


@pytest.mark.acceptance
@pytest.mark.usefixtures("no_pictures")
def test_a_page_shows_the_three_estimates_of_a_target_and_which_the_readings_exclude():
    _, measured = random_record(3, 100)
    result = calibrated(3, 100)[1]
    shown = {section.title: section for section in sections_of(result, measured)}
    stated, beside = shown["Targets"].table, shown["Other estimates"].table
    assert stated is not None
    assert beside is not None
    assert stated.header == ["target", "meaning", "estimate", "to within", "interval", "low", "high", "unit"]
    for e, row, other in zip(result.parameters, stated.rows, beside.rows, strict=True):
        stated_row, more = (dict(zip(t.header, r, strict=True)) for t, r in ((stated, row), (beside, other)))
        assert stated_row["estimate"] == more["estimate"]
        assert (
            Decimal(str(stated_row["low"])) <= Decimal(str(stated_row["estimate"])) <= Decimal(str(stated_row["high"]))
        )
        assert float(str(stated_row["to within"])) >= (e.error_bound or np.inf)
        assert float(str(more["guaranteed error"])) >= (e.guaranteed_error or np.inf)
        wrong = [name for name in ("a priori", "least squares") if name in str(more["outside the interval"] or "")]
        values = (e.a_priori, e.least_squares)
        assert wrong == [
            name for name, x in zip(("a priori", "least squares"), values, strict=True) if not e.possible(x)
        ]
    truth, bad = random_record(3, 100)
    assert len(truth) == 18
    bad.specific_force[5, 0] += 1e-2
    falsified = calibrate(bad, noise_bound=SIGMA)
    assert falsified.verdict == "falsified"
    shown = {section.title: section for section in sections_of(falsified, bad)}
    table = shown["Targets"].table
    assert table is not None
    assert table.header == ["target", "meaning", "a priori", "least squares", "standard error", "unit"]
    assert "Estimates are those of least squares" in shown["Targets"].paragraphs[0]
