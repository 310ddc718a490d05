"""What a person declares, or a good bench has, belongs to one nominal model: `calibrate` and `diagnose` agree on it."""

import shutil
from dataclasses import replace

import numpy as np
import pytest

import trihedron as th
from generator import G
from generator.tables import AZIMUTH, INNER_TURNS, LATITUDE, OUTER_TURNS, STILL_POSITIONS, Errors, Programme, Truth
from generator.tables import bench_record as made_record
from scenario_runs import SCENARIOS
from trihedron.tools.calibration import PRESETS
from trihedron.tools.calibration.gyros import BenchOnEarth
from trihedron.tools.diagnosis.kinds import evidence_of, evidence_options
from trihedron.tools.evidence.bench_in_motion import BenchInMotion
from trihedron.tools.records import BenchRecord
from trihedron.tools.records.rests import position_record_of

SIGMA = 1.2e-5
PLACE = BenchOnEarth(np.degrees(LATITUDE), np.degrees(AZIMUTH), encoder_bound=2e-6)
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


ARMS = np.array([[0.03, -0.009, 0.006], [0.003, 0.03, -0.012], [-0.006, 0.015, 0.03]])
OF_OWN_FMUS = {
    "places": [("lever-arm", dict(zip(("r_1", "r_2", "r_3"), arm, strict=True))) for arm in ARMS.tolist()],
    "lags": [("accelerometer-lag", {"time": 0.004})] * 3,
}


@pytest.mark.acceptance
@pytest.mark.parametrize("name", [pytest.param("places"), pytest.param("lags", marks=pytest.mark.acceptance)])
def test_a_bench_of_our_own_fmus_stands_at_20_ms(name, tmp_path):
    """Its accelerometers are up to 3 cm off centre, or late by 4 ms; scale factors and misalignments are 1e-2."""
    text = (SCENARIOS / "imu-calibration.toml").read_text(encoding="utf-8")
    effects = []
    for number, (effect, values) in enumerate(OF_OWN_FMUS[name], start=1):
        sizes = ", ".join(f"{key} = {value}" for key, value in values.items())
        effects.append(f'{{ effect = "{effect}", where = "accelerometer-{number}", {sizes} }}')
    component = 'component = "AccelerometerBlock"\n'
    for old, new in (
        ("step_s = 0.005", "step_s = 0.02"),
        ("dwell_s = 62.0", "dwell_s = 10.0"),
        (component, f"{component}effects = [{', '.join(effects)}]\n"),
    ):
        assert text.count(old) == 1
        text = text.replace(old, new)
    (tmp_path / "bench.toml").write_text(text, encoding="utf-8")
    shutil.copy(SCENARIOS / "imu-calibration-positions.csv", tmp_path)
    th.simulate(tmp_path / "bench.toml", out=tmp_path / "run")
    place = BenchOnEarth(np.degrees(0.973), np.degrees(0.35), encoder_bound=2.424e-6)
    options = {"noise_bound": 1e-5, "gravity": G, "mounting": "identity", "bench": place}
    record = th.read_record(tmp_path / "run" / "run.parquet")
    assert isinstance(record, BenchRecord)
    by_calibrate = th.calibrate(record, **options)
    assert by_calibrate.verdict == "consistent"
    assert "no one lag" not in " ".join(by_calibrate.warnings)
    rests = position_record_of(record)
    model = evidence_of(rests, **evidence_options(rests, **options)).model
    assert model.radius < 1.0
    lag, *places = model.baseline.estimate[-10:]
    assert lag == pytest.approx(0.004 if name == "lags" else 0.0, abs=2e-5)
    assert np.ravel(places) == pytest.approx(ARMS.ravel() if name == "places" else 0.0, abs=FEW_MILLIMETRES)


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


@pytest.mark.acceptance
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
    assert [name for name, _ in model.names[-10:]][:2] == ["A", "r11"]


@pytest.mark.acceptance
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
