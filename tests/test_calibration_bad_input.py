"""Records from which little or nothing follows: one position, equal ones, duplicates that contradict one another."""

import numpy as np
import pytest

from simulated_bench import ALPHA, BETA, random_bench, record, simulated
from trihedron.models.bench import elementary_reading
from trihedron.tools import cli
from trihedron.tools.calibration import calibrate
from trihedron.tools.calibration.mountings import PRESETS
from trihedron.tools.errors import InputError
from trihedron.tools.records import write_record

SIGMA = 1e-5
READING = elementary_reading(random_bench(np.random.default_rng(1)), ALPHA, BETA, np.eye(3))


def test_one_position_determines_nothing_and_says_what_would():
    result = calibrate(record(READING[:1], ALPHA[:1], BETA[:1]), noise_bound=SIGMA)
    assert result.verdict == "insufficient"
    assert {gap.symbol for gap in result.missing} == {e.symbol for e in result.parameters}
    assert len(result.next_positions) >= 5


def test_equal_positions_are_one():
    rows = np.full(9, 5)
    noise = np.random.default_rng(2).uniform(-SIGMA, SIGMA, (9, 3))
    result = calibrate(record(READING[rows] + noise, ALPHA[rows], BETA[rows]), noise_bound=SIGMA)
    assert result.verdict == "insufficient"
    assert len(result.missing) == 18
    assert result.radius <= 1.0


def test_equal_positions_that_differ_by_more_than_noise_are_proven_to_contradict():
    rows = np.full(4, 5)
    reading = READING[rows].copy()
    reading[2, 1] += 5 * SIGMA
    result = calibrate(record(reading, ALPHA[rows], BETA[rows]), noise_bound=SIGMA)
    assert result.verdict == "insufficient"
    assert "positions 1 and 3 are the same, but accelerometer 2 reads 5e-05 g differently" in result.warnings[-1]
    reading[2, 1] -= 3.1 * SIGMA
    assert calibrate(record(reading, ALPHA[rows], BETA[rows]), noise_bound=SIGMA).warnings == []


def test_contradictory_duplicates_are_the_witness():
    rows = [*range(24), 7]
    reading = READING[rows].copy()
    reading[24, 2] += 20 * SIGMA
    result = calibrate(record(reading, ALPHA[rows], BETA[rows]), noise_bound=SIGMA)
    assert result.verdict == "falsified"
    assert result.radius >= 10 * (1 - 1e-6)
    assert {(8, 3), (25, 3)} <= {(reading.position, reading.accelerometer) for reading in result.witness}


@pytest.mark.parametrize("sigma", ["0", "-1e-5", "nan", "inf"])
def test_a_noise_bound_that_is_none_is_one_line(sigma, tmp_path, capsys):
    path = tmp_path / "p.csv"
    write_record(record(READING, ALPHA, BETA), path)
    assert cli.main(["calibrate", str(path), "--noise-bound", sigma]) == 2
    message = capsys.readouterr().err
    assert "--noise-bound" in message
    assert message.count("\n") == 1


def test_two_mountings_without_names_are_refused(tmp_path):
    path = tmp_path / "q.toml"
    path.write_text("[up]\nmatrix = [[1,0,0],[0,1,0],[0,0,1]]\n[down]\nmatrix = [[1,0,0],[0,-1,0],[0,0,-1]]\n")
    with pytest.raises(InputError, match="no column mounting"):
        calibrate(record(READING, ALPHA, BETA), noise_bound=SIGMA, mounting=str(path))
    both = {"a": np.eye(3), "b": PRESETS["cyclic"]}
    with pytest.raises(InputError, match="no column mounting"):
        calibrate(record(READING, ALPHA, BETA), noise_bound=SIGMA, mounting=both)


def test_a_mounting_that_is_no_rotation_is_refused():
    ragged = [[1.0, 0.0, 0.0], [0.0]]
    reflection = np.diag([1.0, 1.0, -1.0])
    for matrix, said in ((1.001 * np.eye(3), "not orthogonal"), (reflection, "reflection"), (ragged, "three rows")):
        with pytest.raises(InputError, match=said):
            calibrate(record(READING, ALPHA, BETA), noise_bound=SIGMA, mounting={"q": matrix})


def test_readings_written_too_coarsely_for_the_noise_bound_are_said_to_be():
    force = np.round(READING * 9.80665, 2)
    result = calibrate(record(force / 9.80665, ALPHA, BETA, resolution=0.005), noise_bound=SIGMA)
    assert result.verdict == "consistent"
    assert result.radius > 1.0
    assert "half a last digit is 0.00051 g" in result.warnings[-1]


@pytest.mark.parametrize(
    ("factor", "said"), [(0.0, "0.000 times what the table gives.*dead"), (-1.0, "-1.00.*its sign"), (2.0, "the unit")]
)
@pytest.mark.parametrize("baseline", ["asymmetric", "symmetric"])
def test_a_dead_or_reversed_accelerometer_is_refused(factor, said, baseline):
    reading = READING * [1.0, factor, 1.0] + np.random.default_rng(3).uniform(-SIGMA, SIGMA, READING.shape)
    with pytest.raises(InputError, match=f"column f2_mps2: reads {said}" if factor < 1.0 else f"f2_mps2.*{said}"):
        calibrate(
            record(reading, ALPHA, BETA), noise_bound=1e-2 if baseline == "symmetric" else SIGMA, baseline=baseline
        )


def test_gross_errors_and_readings_near_zero_input_are_unbiased():
    """Scale factors wrong by 5 %, inputs at and near zero: without noise the estimates are the truth."""
    from trihedron.models.bench import ELEMENTARY, target_values

    alpha = np.concatenate([ALPHA, np.radians([0.0, 90.0, 180.0, 270.0, 90.0, 0.2])])
    beta = np.concatenate([BETA, np.radians([0.0, 0.0, 90.0, 90.0, 180.0, 30.0])])
    for seed in range(4):
        rng = np.random.default_rng(seed)
        bench = random_bench(rng)
        for p in (1, 2, 3):
            for way in ("plus", "minus"):
                bench[ELEMENTARY.index(f"scale_error_{way}_{p}")] = rng.uniform(-0.05, 0.05)
        result = calibrate(simulated(bench, alpha, beta), noise_bound=SIGMA, bounds=(3e-3, 6e-2))
        estimates = np.array([e.estimate for e in result.parameters])
        np.testing.assert_allclose(estimates, target_values(bench, np.eye(3)), rtol=0, atol=1e-9 * SIGMA)
