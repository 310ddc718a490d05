"""Baselines, conventions and mountings of the calibration; its published object, and its uses."""

import json

import numpy as np
import pytest

from calibration_checks import interval, misses
from generator.stands import ALPHA, BETA, random_bench, record, simulated
from trihedron.fmus.parameters import bench_parameters
from trihedron.models.bench import ELEMENTARY, TARGETS, elementary_reading, target_values
from trihedron.tools.calibration import PRESETS, Calibration, calibrate

SIGMA = 1e-5
IDENTITY = np.eye(3)


def test_symmetric_baseline_reports_one_scale_factor_and_is_falsified_by_asymmetry():
    bench = random_bench(np.random.default_rng(6))
    for axis in (1, 2, 3):
        bench[ELEMENTARY.index(f"scale_error_minus_{axis}")] = bench[ELEMENTARY.index(f"scale_error_plus_{axis}")]
    truth = dict(zip(TARGETS, target_values(bench, IDENTITY), strict=True))
    noise = np.random.default_rng(7).uniform(-SIGMA, SIGMA, (24, 3))
    result = calibrate(simulated(bench, noise=noise), noise_bound=SIGMA, baseline="symmetric")
    symbols = [e.symbol for e in result.parameters]
    assert symbols == [t for t in TARGETS if t not in ("X5", "X10", "X15")]
    assert misses(result, [truth[s] for s in symbols]) == []
    bench[ELEMENTARY.index("scale_error_minus_2")] += 1e-3
    uneven = simulated(bench, noise=noise)
    assert calibrate(uneven, noise_bound=SIGMA, baseline="symmetric").verdict == "falsified"
    assert calibrate(uneven, noise_bound=SIGMA).verdict == "consistent"


def test_convention_a2_reports_the_papers_combinations_of_the_same_solution():
    noisy = simulated(random_bench(np.random.default_rng(8)), noise=SIGMA * np.sin(np.arange(72.0)).reshape(24, 3))
    a1 = {e.symbol: e.estimate for e in calibrate(noisy, noise_bound=SIGMA, targets=["X6", "X7", "X11"]).parameters}
    result = calibrate(noisy, noise_bound=SIGMA, convention="A2")
    a2 = {e.symbol: e for e in result.parameters}
    assert set(a2) - set(a1) == {
        *("(X6+X8)/2", "(X7+X12)/2", "(X11+X13)/2"),
        *("(X8-X6)/2", "(X7-X12)/2", "(X13-X11)/2"),
    }
    assert a1["X6+X8"] == pytest.approx(2 * np.float64(a2["(X6+X8)/2"].estimate), abs=1e-15)
    truth = target_values(random_bench(np.random.default_rng(8)), IDENTITY)
    x = dict(zip(TARGETS, truth, strict=True))
    for symbol, value in (
        ("(X8-X6)/2", x["X8"] - x["X6+X8"] / 2),
        ("(X7-X12)/2", x["X7+X12"] / 2 + x["-X12"]),
        ("(X13-X11)/2", x["X13"] - x["X11+X13"] / 2),
    ):
        low, high = interval(a2[symbol])
        assert low <= value <= high


def test_three_mountings_have_their_own_mounting_errors_and_share_the_rest():
    names = ["north", "south-2", "c"]
    matrices = dict(zip(names, (PRESETS["identity"], PRESETS["skew"], PRESETS["cyclic"]), strict=True))
    for seed in range(3):
        rng = np.random.default_rng(seed)
        bench = random_bench(rng)
        truth, readings, rows, column = {}, [], [], []
        for name, q in matrices.items():
            bench[6:9] = rng.uniform(-3e-3, 3e-3, 3)
            values = dict(zip(TARGETS, target_values(bench, q), strict=True))
            truth |= {t if t not in ("X8", "-X12", "X13") else f"{t}@{name}": x for t, x in values.items()}
            at = rng.permutation(24)[:10]
            readings.append(elementary_reading(bench, ALPHA[at], BETA[at], q))
            rows.extend(at)
            column += [name] * 10
        reading = np.concatenate(readings) + rng.uniform(-SIGMA, SIGMA, (30, 3))
        result = calibrate(
            record(reading, ALPHA[rows], BETA[rows], column),
            noise_bound=SIGMA,
            mounting=matrices,
            targets=["X8@north - X8@south-2"],
        )
        assert {e.symbol for e in result.parameters} == {*truth, "X8@north - X8@south-2"}
        truth["X8@north - X8@south-2"] = truth["X8@north"] - truth["X8@south-2"]
        assert misses(result, [truth[e.symbol] for e in result.parameters]) == []
        few = calibrate(
            record(reading[:21], ALPHA[rows[:21]], BETA[rows[:21]], column[:21]), noise_bound=SIGMA, mounting=matrices
        )
        assert few.verdict == "insufficient"
        assert all(gap.symbol.endswith("@c") for gap in few.missing)
        assert {p.get("mounting") for p in few.next_positions} == {"c"}


def test_json_is_the_published_object_and_the_same_every_time():
    noisy = simulated(random_bench(np.random.default_rng(1)), noise=SIGMA * np.cos(np.arange(72.0)).reshape(24, 3))
    first, second = (
        calibrate(noisy, noise_bound=SIGMA, targets=["X4-X5"], priors=["X4 - X5 = 1e-1"]).json_text() for _ in range(2)
    )
    assert first == second
    assert Calibration.model_validate_json(first).json_text() == first
    content = json.loads(first)
    assert content["schema"] == "trihedron.calibration/3"
    assert (content["verdict"], content["positions"], content["measurements"]) == ("consistent", 24, 72)
    assert (content["sigma"], content["gravity_mps2"]) == ({"value": 1e-5, "kind": "bound", "from": "given"}, 9.80665)
    assert content["witness"] == []
    assert content["priors"] == [{"expression": "X4 - X5 ", "limit": 0.1}]
    last = content["parameters"][-1]
    assert set(last) == {
        *("symbol", "name", "unit", "determined", "estimate", "low", "high"),
        *("a_priori", "guaranteed_error", "least_squares", "standard_error"),
    }
    assert (content["estimator"], content.get("no_estimate")) == ("analytic centre", None)
    assert (last["symbol"], last["name"], last["unit"]) == ("X4-X5", "scale-factor-asymmetry-1", "1")
    assert content["parameters"][3]["name"] == "scale-factor-error-plus-1"


@pytest.mark.parametrize("convention", ["A1", "A2"])
def test_bench_parameters_predict_what_was_calibrated(convention):
    bench, q = random_bench(np.random.default_rng(12)), PRESETS["skew"]
    result = calibrate(
        simulated(bench, mounting=q), noise_bound=SIGMA, mounting={"skew": q}, convention=convention
    ).to_json()
    components = bench_parameters(json.loads(json.dumps(result)))
    p = dict.fromkeys(ELEMENTARY, 0.0)
    mounting = components["TurntableMotion"].pop("mounting")
    for name, value in (components["TurntableMotion"] | components["AccelerometerBlock"]).items():
        if isinstance(value, list):
            p |= {f"{name}_{i}": number for i, number in enumerate(value, 1)}
        elif name != "gravity":
            p[name] = value
    assert len(p) == len(ELEMENTARY)
    predicted = elementary_reading([p[name] for name in ELEMENTARY], ALPHA, BETA, np.reshape(mounting, (3, 3)))
    np.testing.assert_allclose(predicted, elementary_reading(bench, ALPHA, BETA, q), rtol=0, atol=1e-14)


def test_parameters_of_the_bench_need_one_mounting_that_is_a_rotation():
    good = calibrate(simulated(np.zeros(24)), noise_bound=SIGMA).to_json()
    for mountings, message in (
        ({}, "one mounting"),
        ({"q": [[1, 0, 0]]}, "^mounting 'q': the matrix must be three rows"),
    ):
        with pytest.raises(ValueError, match=message):
            bench_parameters(good | {"mountings": mountings})


def test_noise_bound_is_taken_from_repeats_and_the_result_says_so():
    rng = np.random.default_rng(2)
    bench = random_bench(rng)
    alpha, beta = np.tile(ALPHA, 4), np.tile(BETA, 4)
    result = calibrate(simulated(bench, alpha, beta, rng.uniform(-SIGMA, SIGMA, (96, 3))))
    assert 0.8 * SIGMA < result.noise_bound < 3 * SIGMA
    assert result.sigma.kind == "estimated"
    assert "repeat" in result.to_json()["sigma"]["from"]


def test_other_mountings_are_calibrated_as_well():
    for name in ("cyclic", "tripod", "skew"):
        rng = np.random.default_rng(9)
        bench = random_bench(rng)
        noise = rng.uniform(-SIGMA, SIGMA, (24, 3))
        result = calibrate(simulated(bench, noise=noise, mounting=PRESETS[name]), noise_bound=SIGMA, mounting=name)
        assert misses(result, target_values(bench, PRESETS[name])) == []
