"""What a person declares, or a good bench has, belongs to one nominal model: `calibrate` and `diagnose` agree on it."""

from dataclasses import replace

import numpy as np
import pytest

import trihedron as th
from generator import G
from generator.tables import AZIMUTH, INNER_TURNS, LATITUDE, OUTER_TURNS, STILL_POSITIONS, Errors, Programme, Truth
from generator.tables import bench_record as made_record
from trihedron.tools.calibration import PRESETS
from trihedron.tools.calibration.gyros import Bench
from trihedron.tools.diagnosis.kinds import evidence_of, evidence_options
from trihedron.tools.evidence.bench_in_motion import BenchInMotion
from trihedron.tools.records import BenchRecord
from trihedron.tools.records.rests import position_record_of

SIGMA = 1.2e-5
PLACE = Bench(np.degrees(LATITUDE), np.degrees(AZIMUTH), encoder_bound=2e-6)
SHORT = Programme(STILL_POSITIONS[::2] + OUTER_TURNS + INNER_TURNS, dwell=4.0)
FEW_MILLIMETRES = 1e-4
HERE = 9.7805
DECLARED = {"gravity": HERE, "mounting": "cyclic", "bench": PLACE}


def drawn(seed: int = 3) -> Truth:
    """Return a bench whose accelerometers are up to 3 cm off centre and 4 ms late, with gyros that sense gravity."""
    return Truth.drawn(np.random.default_rng(seed))


def nothing_declared(seed: int) -> Truth:
    """Return a bench with neither lags, places nor gyros that sense gravity."""
    none = np.zeros((3, 3))
    return replace(drawn(seed), arms=none, sensitivity=none, lag=0.0, force_lag=0.0)


def record_of(truth: Truth, gravity: float = G, mounting: str = "identity") -> BenchRecord:
    """Return the record of a bench where gravity [m/s²] and mounting are these."""
    record = made_record(truth, SHORT, Errors(rate=5e-5, encoder=2e-6), PRESETS[mounting])
    return replace(record, specific_force=record.specific_force * gravity / G)


def radii(record: BenchRecord, **declared: object) -> tuple[float, float]:
    """Return the radius of the nominal model that `calibrate` and that `diagnose` has, largest of its witnesses."""
    options = {"gravity": G, "mounting": "identity", "bench": PLACE, **declared}
    calibration = th.calibrate(record, noise_bound=SIGMA, **options)
    rests = position_record_of(record)
    model = evidence_of(rests, **evidence_options(rests, noise_bound=SIGMA, **options)).model
    assert isinstance(model, BenchInMotion)
    late = "no one lag" in " ".join(calibration.warnings)
    assert model.falsified == (calibration.verdict == "falsified" or late)
    assert calibration.radius is not None
    return calibration.radius, model.radius


@pytest.fixture(scope="module")
def with_all() -> BenchRecord:
    return record_of(drawn(), HERE, "cyclic")


def test_a_good_bench_with_all_that_can_be_declared_stands_in_both(with_all):
    by_calibrate, by_diagnose = radii(with_all, **DECLARED)
    assert by_calibrate < 1.0
    assert by_diagnose == pytest.approx(by_calibrate, abs=0.03)


def test_the_model_of_a_diagnosis_holds_lag_and_places(with_all):
    """Places are known to a tenth of a millimetre, the lag to microseconds."""
    rests, truth = position_record_of(with_all), drawn()
    model = evidence_of(rests, **evidence_options(rests, noise_bound=SIGMA, **DECLARED)).model
    lag, *places = model.baseline.estimate[-10:]
    assert np.abs(np.ravel(places) - truth.arms.ravel()).max() < FEW_MILLIMETRES
    assert lag == pytest.approx(truth.force_lag, abs=5e-6)
    assert [name for name, _ in model.names[-10:]][:2] == ["accelerometer-lag", "r11"]


def test_a_noise_of_gyros_that_is_declared_too_small_falsifies_both(with_all):
    quiet = replace(PLACE, gyro_noise=1e-7)
    assert min(radii(with_all, **DECLARED | {"bench": quiet})) > 1.0


ALONE = {
    "places": lambda truth: replace(truth, arms=drawn().arms),
    "lag": lambda truth: replace(truth, force_lag=3e-3),
    "lag of gyros": lambda truth: replace(truth, lag=-3e-3),
    "sensitivity": lambda truth: replace(truth, sensitivity=drawn().sensitivity),
    "nothing": lambda truth: truth,
}


@pytest.mark.acceptance
@pytest.mark.parametrize("seed", [1, 2, 4])
@pytest.mark.parametrize("name", ALONE)
def test_each_alone_stands_in_both(name, seed):
    by_calibrate, by_diagnose = radii(record_of(ALONE[name](nothing_declared(seed))))
    assert by_calibrate < 1.0
    assert by_diagnose == pytest.approx(by_calibrate, abs=0.03)


@pytest.mark.acceptance
@pytest.mark.parametrize("mounting", ["rz45", "tripod", "skew"])
def test_each_mounting_and_gravity_stands_in_both(mounting):
    gravity = 9.8322
    by_calibrate, by_diagnose = radii(record_of(drawn(8), gravity, mounting), gravity=gravity, mounting=mounting)
    assert by_calibrate < 1.0
    assert by_diagnose == pytest.approx(by_calibrate, abs=0.03)
