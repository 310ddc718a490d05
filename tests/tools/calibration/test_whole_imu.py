"""The whole IMU from a bench record: independently generated records with known truth."""

import shutil
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import trihedron as th
from generator.tables import AZIMUTH, LATITUDE, PROGRAMME, Errors, Programme, Truth, attitudes_of, bench_record
from scenario_runs import SCENARIOS
from trihedron.models.bench import GYRO_PARAMETERS, TARGETS, earth_in_base, integrated_jacobian, integrated_readings
from trihedron.models.effects import EffectPlace
from trihedron.tools.bounded import Polytope
from trihedron.tools.calibrated import LATENCIES, Calibration, Gyros
from trihedron.tools.calibration import (
    BenchOnEarth,
    Turns,
    calibrate,
    calibrate_whole,
    strapdown_by_table,
    turns_of,
    with_turns,
)
from trihedron.tools.cli import main
from trihedron.tools.demo import inside_intervals, true_targets
from trihedron.tools.errors import InputError
from trihedron.tools.evidence import Carried, bench_evidence, carried_evidence
from trihedron.tools.exporting import write_fmpy_input
from trihedron.tools.measured import bench_at
from trihedron.tools.orchestrator import read_scenario
from trihedron.tools.records import (
    BenchRecord,
    PositionRecord,
    StrapdownRecord,
    position_record_of,
    read_record,
    write_record,
)
from trihedron.tools.reports import gyro_sections
from trihedron.tools.reports.calibration import verdict_sentence
from trihedron.tools.trials import Hidden, draw_whole

SIGMA = 1.2e-5
PLACE = BenchOnEarth(np.degrees(LATITUDE), np.degrees(AZIMUTH), encoder_bound=2e-6)
ERRORS = Errors(rate=5e-5, encoder=2e-6)


COMPENSATION = """
[fmus.compensation]
component = "GyroCompensation"
parameters_from = "imu.json"

[[connections]]
from = "gyros.increment_reading"
to = "compensation.increment_reading"

[[connections]]
from = "table.specific_force"
to = "compensation.specific_force"

[[stimuli]]
to = "compensation.temperature"
constant = 20.0

"""


def calibration_of(record: BenchRecord, bench: BenchOnEarth = PLACE) -> Calibration:
    return calibrate_whole(position_record_of(record), bench, noise_bound=SIGMA)


def gyros_of(result: Calibration) -> Gyros:
    assert result.gyros is not None
    return result.gyros


def outside(result: Calibration, truth: Truth) -> list[str]:
    """Return the symbols whose interval does not hold the truth."""
    pairs = zip(result.parameters, [*truth.targets, *truth.gyros, *truth.lags], strict=True)
    return [e.symbol for e, x in pairs if e.low is None or e.high is None or not e.low <= x <= e.high]


def turns(record: BenchRecord, bench: BenchOnEarth = PLACE) -> Turns:
    earth = earth_in_base(np.radians(bench.latitude_deg), np.radians(bench.azimuth_deg))
    return turns_of(position_record_of(record), mounting=np.eye(3), earth=earth, encoder_bound=2e-6, noise_bound=1e-5)


@pytest.fixture(scope="module")
def truth() -> Truth:
    return Truth.drawn(np.random.default_rng(5))


@pytest.fixture(scope="module")
def record(truth) -> BenchRecord:
    return bench_record(truth, errors=ERRORS)


@pytest.fixture(scope="module")
def result(record) -> Calibration:
    return calibration_of(record)


@pytest.mark.acceptance
def test_a_diagnosis_of_the_rests_says_that_the_gyros_are_left_out(record):
    warnings = bench_evidence(position_record_of(record), noise_bound=1e-5).reader.head()["warnings"]
    assert sum("the gyros of this bench record are left out" in text for text in warnings) == 1


@pytest.mark.acceptance
def test_the_model_gives_what_an_exact_bench_integrates(truth):
    """Without errors of readings, only the sampling of moves of both axes at once remains."""
    exact = bench_record(truth, replace(PROGRAMME, step=0.01), Errors(force=0.0, rate=0.0))
    residual = turns(exact).residual(np.array(truth.targets), np.array(truth.gyros))
    assert np.abs(residual).max() < 2e-6
    off = np.array(truth.gyros)
    off[3] += 1e-5
    assert np.abs(turns(exact).residual(np.array(truth.targets), off)).max() > 1e-4


def test_a_lag_is_exact_of_moves_of_both_axes_and_of_moves_that_are_never_steady(truth):
    """A short move is fastest only for a moment; in a fast one the block's rate turns with the inner axis."""
    late = replace(truth, lag=4e-3)
    short = tuple((angle * (k % 2), angle * (k % 2)) for k, angle in enumerate((30.0, 35.0, 40.0, 45.0, 50.0, 55.0)))
    places = ((0.0, 0.0), (360.0, 300.0), (0.0, 0.0), (-300.0, 360.0), (0.0, 0.0), *short)
    exact = bench_record(late, Programme(places, dwell=4.0, rate=2.0, step=0.01), Errors(force=0.0, rate=0.0))
    pieces = turns(exact)
    residual = pieces.residual(np.array(late.targets), np.array(late.gyros))
    assert np.abs(residual / pieces.bound(np.array(late.targets), np.array(late.gyros))).max() < 0.5
    assert len(pieces.first) > 2 * len(places)
    assert np.abs(residual).max() < 6e-6


@pytest.mark.first(1)
@pytest.mark.parametrize(("seed", "lag"), [(0, -2.9e-3), (5, 2.3e-3)])
def test_the_lag_of_a_gyro_block_is_in_its_interval(seed, lag):
    """The component reads late with scale factors of 1e-3 and more, and between rows of 20 ms it interpolates."""
    bench = draw_whole(np.random.default_rng([22, seed]))
    hidden = Hidden(EffectPlace("latency", "gyro-block"), (lag,))
    calibration = calibrate_whole(bench.measured(22, seed, (hidden,)), bench.place, noise_bound=1e-5)
    truth = dict.fromkeys(GYRO_PARAMETERS, 0.0) | {"L": lag, "A": 0.0, "L-A": lag}
    of_block = bench.truth["GyroBlock"]
    truth |= {f"M{k // 3 + 1}{k % 3 + 1}": value for k, value in enumerate(of_block["scale_misalignment"])}
    truth |= {f"B{k + 1}": value for k, value in enumerate(of_block["bias"])}
    for parameter in calibration.of_gyros:
        assert parameter.low is not None
        assert parameter.high is not None
        assert parameter.low <= truth[parameter.symbol] <= parameter.high, parameter.symbol


@pytest.mark.acceptance
def test_derivatives_are_those_of_the_model(record, truth):
    pieces = turns(record)
    x, g = np.array(truth.targets), np.array(truth.gyros)
    rest = pieces.moments, pieces.growth, pieces.mounting, pieces.earth
    jacobian = integrated_jacobian((x, g), rest)
    at = np.concatenate([x, g])
    for k in range(len(at)):
        moved = at + 1e-6 * np.eye(len(at))[k], at - 1e-6 * np.eye(len(at))[k]
        pair = [integrated_readings(m[: len(TARGETS)], m[len(TARGETS) :], *rest) for m in moved]
        assert np.allclose((pair[0] - pair[1]) / 2e-6, jacobian[..., k], atol=2e-6 * max(1.0, np.abs(jacobian).max()))


def test_every_interval_holds_the_truth(result, truth):
    assert result.verdict == "consistent"
    assert outside(result, truth) == []
    assert all(p.determined for p in result.of_gyros)


@pytest.mark.acceptance
def test_latencies_are_told_beside_places_that_nobody_knows(result, truth):
    """Accelerometers centimetres from the crossing of the axes and milliseconds late are known to microseconds."""
    for e, x in zip(result.of_gyros[-2:], truth.lags, strict=True):
        numbers = (e.a_priori, e.guaranteed_error, e.estimate, e.error_bound, e.low, e.high)
        assert None not in numbers
        a_priori, guaranteed, estimate, error, low, high = (float(v) for v in numbers if v is not None)
        assert abs(a_priori - x) <= guaranteed < 5e-5
        assert abs(estimate - x) <= error
        assert high - low <= 2.0 * guaranteed * (1.0 + 1e-9)
    assert np.abs(truth.arms).max() > 0.01
    assert np.abs(truth.lags).max() > 1e-3


@pytest.mark.acceptance
def test_accelerometers_of_different_lags_have_no_latency_and_all_else_stands(record, result):
    force = record.specific_force.copy()
    force[1:, 1] = force[:-1, 1]
    calibration = calibration_of(replace(record, specific_force=force))
    assert not {"A", "L-A"} & set(calibration)
    assert sum("no one lag of all accelerometers" in text for text in calibration.warnings) == 1
    assert calibration.verdict == "consistent"
    for e, before in zip(calibration.parameters, result.parameters[:-2], strict=True):
        assert abs(e.estimate - before.estimate) < before.error_bound


def test_what_both_determine_is_never_known_worse_and_the_leaning_of_the_axes_better(result, record):
    alone = calibrate(position_record_of(record), noise_bound=SIGMA)
    for together, before in zip(result.targets, alone.parameters, strict=True):
        assert together.low >= before.low
        assert together.high <= before.high
        assert together.guaranteed_error <= before.guaranteed_error
    lean = next(gain for gain in gyros_of(result).gains if gain.symbol == "X3")
    assert lean.with_gyros < 0.75 * lean.accelerometers_alone


@pytest.mark.acceptance
def test_a_truth_as_far_as_the_guaranteed_error_gives_records_within_the_bounds(record):
    """Each a-priori error is attained by two benches that far apart, whose readings differ by the bounds at most."""
    rests = position_record_of(record)
    system = with_turns(calibrate(rests, noise_bound=SIGMA).linearised, turns(record), "record")
    polytope = Polytope(system.jacobian, system.bound)
    polytope.confine(-system.bound, system.bound)
    for symbol in ("X3", "X14", "M11", "M32", "B2", "S23", "L"):
        weights = (np.array(system.symbols) == symbol).astype(float)
        error, away, duals = polytope.maximise(weights)
        assert weights @ away == pytest.approx(error, rel=1e-6)
        assert np.abs(duals) @ system.bound == pytest.approx(error, rel=1e-6)
        apart = np.abs(system.residual_at(system.point + away) - system.residual_at(system.point)) / system.bound
        # The model is linear except for products of these small steps.
        assert apart.max() == pytest.approx(1.0, abs=1e-4)


def test_scale_factors_that_differ_by_sense_falsify_and_the_turns_are_named(record, truth):
    """A gyro that reads a turn one way by 3e-4 more than the other way has no single scale factor."""
    factor = np.where(record.increment > 0.0, 1.0 + 3e-4, 1.0)
    calibration = calibration_of(replace(record, increment=record.increment * factor))
    assert calibration.verdict == "falsified"
    assert gyros_of(calibration).witness
    assert gyros_of(calibration).gains == []
    assert all(e.central is None for e in calibration.of_gyros)
    assert {t.gyro for t in gyros_of(calibration).witness} <= {1, 2, 3}
    sentence = verdict_sentence(calibration)
    assert sentence.startswith("Falsified by the gyros: the best parameters leave a turn ")
    assert "the accelerometers at rest alone stand, within 0.7" in sentence


def test_without_turns_about_the_inner_axis_what_they_would_tell_is_missing(truth):
    """At one inner angle gyros sense one axis only: M is undetermined, and the accelerometers' verdict holds."""
    still = replace(PROGRAMME, positions=tuple((45.0 * k, 25.0) for k in range(12)))
    calibration = calibration_of(bench_record(truth, still, ERRORS))
    assert not calibration["M11"].determined
    by_symbol = {e.symbol: e for e in calibration.of_gyros}
    assert by_symbol["M11"].low is None


@pytest.mark.acceptance
def test_rates_say_what_increments_say(record, result):
    period = float(np.median(np.diff(record.time_s)))
    rates = replace(record, rate=record.increment / period, increment=None)
    calibration = calibration_of(rates, replace(PLACE, rates="averaged"))
    for by_rates, by_increments in zip(calibration.of_gyros, result.of_gyros, strict=True):
        assert by_rates.guaranteed_error is not None
        assert by_rates.low == pytest.approx(by_increments.low, abs=0.02 * by_rates.guaranteed_error)
    # The rate between samples is unknown.
    sampled = calibration_of(rates, replace(PLACE, rates="instantaneous"))
    for by_rates, by_increments in zip(sampled.of_gyros, calibration.of_gyros, strict=True):
        assert by_rates.guaranteed_error is not None
        assert by_increments.guaranteed_error is not None
        assert by_rates.guaranteed_error > 1.02 * by_increments.guaranteed_error or by_rates.symbol[0] in "BSA"


@pytest.mark.acceptance
def test_the_scenario_of_the_whole_imu_holds_its_truth(tmp_path):
    """Run table, both blocks and attitude computer as FMUs, with shorter rests and a longer step than as shipped.

    At twenty rows a second the motion of both axes between rows, as they speed up, exceeds the noise: bounds hold it.
    """
    text = (SCENARIOS / "imu-calibration.toml").read_text(encoding="utf-8")
    short = text.replace("dwell_s = 62.0", "dwell_s = 3.0").replace("step_s = 0.005", "step_s = 0.05")
    (tmp_path / "short.toml").write_text(short, encoding="utf-8")
    shutil.copy(SCENARIOS / "imu-calibration-positions.csv", tmp_path)
    run = th.simulate(tmp_path / "short.toml", out=tmp_path / "run")
    scenario = read_scenario(tmp_path / "short.toml")
    table = scenario.fmus["table"].parameters
    place = np.degrees([table["latitude"], table["azimuth"]]).tolist()
    bench = BenchOnEarth(*place, encoder_bound=table["encoder_fluctuation_bound"])
    calibration = th.calibrate(run.files[0], noise_bound=1e-5, bench=bench)
    assert calibration.verdict == "consistent"
    assert inside_intervals(calibration, true_targets(scenario)) == 42
    (tmp_path / "imu.json").write_text(calibration.json_text(), encoding="utf-8")
    compensated = short.replace("[record]", COMPENSATION + "[record]").replace(
        "step_s = 0.05", "step_s = 0.05\nstop_s = 40.0"
    )
    columns = [f'{n}{k}_rad = "{n}.increment[{k}]"' for n in ("table", "compensation") for k in (1, 2, 3)]
    (tmp_path / "compensated.toml").write_text("\n".join([compensated, *columns]), encoding="utf-8")
    table = th.simulate(tmp_path / "compensated.toml").table
    sums = {n: np.array([table[f"{n}{k}_rad"].sum() for k in (1, 2, 3)]) for n in ("table", "compensation", "dtheta")}
    true, compensated_sum, read_sum = sums.values()
    assert np.abs(read_sum - true).max() > 5e-3
    assert np.abs(compensated_sum - true).max() < 2e-4


def test_exchanged_gyros_are_refused_with_the_option(record):
    with pytest.raises(InputError, match=r"gyro \d does not follow the table.*--channels"):
        calibration_of(replace(record, increment=record.increment[:, [1, 0, 2]]))


@pytest.mark.acceptance
def test_an_inspection_judges_the_accelerometers_by_the_table(record):
    """Their scale factors depend on the sign, for which the table's angles are needed: the norm of gravity is not
    enough."""
    calibration = th.inspect(record)
    assert calibration.accelerometers is None
    assert calibration.at_table is not None
    alone = calibrate(position_record_of(record))
    assert (calibration.at_table.verdict, calibration.at_table.radius) == ("consistent", alone.radius)
    strapdown = th.inspect(record.gyros)
    assert strapdown.at_table is None
    assert "at_table" not in strapdown.to_json()


@pytest.mark.acceptance
def test_a_bench_record_is_known_by_its_columns(record, tmp_path):
    first = slice(0, 3000)
    part = BenchRecord(
        *(values[first] for values in (record.time_s, record.alpha, record.beta, record.specific_force)),
        increment=record.increment[first],
    )
    write_record(part, tmp_path / "bench.csv")
    again = read_record(tmp_path / "bench.csv")
    assert isinstance(again, BenchRecord)
    assert again.word == "bench record"
    assert again.increment is not None
    assert np.array_equal(again.increment, record.increment[first])
    assert np.allclose(again.alpha, part.alpha, rtol=0.0, atol=1e-14)
    strapdown = read_record(tmp_path / "bench.csv", StrapdownRecord)
    assert strapdown.increment is not None
    assert np.array_equal(strapdown.increment, record.increment[first])
    exported = write_fmpy_input(tmp_path / "bench.csv", tmp_path / "input.csv", rates="instantaneous", bridge_gaps=0)
    assert exported.component == "AttitudeComputer"
    averaged = read_record(tmp_path / "bench.csv", PositionRecord)
    assert isinstance(averaged.raw, BenchRecord)
    table = again.to_polars().with_columns(w1_radps=0.0, w2_radps=0.0, w3_radps=0.0)
    with pytest.raises(InputError, match="keep one of them"):
        read_record(table)


@pytest.mark.acceptance
def test_at_a_terminal(record, tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    write_record(record, tmp_path / "bench.csv")
    alone = ["calibrate", "bench.csv", "--noise-bound", str(SIGMA)]
    assert main([*alone, "--gyro-noise", "1e-5"]) == 2
    assert "--gyro-noise: gyros are calibrated where --latitude-deg and" in capsys.readouterr().err
    place = ["--latitude-deg", str(PLACE.latitude_deg), "--azimuth-deg", str(PLACE.azimuth_deg)]
    assert main([*alone, *place, "--encoder-bound", "2e-6", "--json", "imu.json", "--ssv", "imu.ssv"]) == 0
    text = capsys.readouterr().out
    assert "The turns make X3 better known" in text
    assert "misalignment of gyro 1 towards axis 2" in text
    again = Calibration.model_validate_json((tmp_path / "imu.json").read_text(encoding="utf-8"))
    assert [e.symbol for e in again.of_gyros] == [*GYRO_PARAMETERS, *LATENCIES]
    units = {e.name: e.unit for e in again.of_gyros}
    assert (units["gyro-scale-factor-error-1"], units["gyro-misalignment-12"]) == ("1", "rad")
    written = (tmp_path / "imu-gyros.ssv").read_text(encoding="utf-8")
    assert f'value="{again.of_gyros[3].estimate!r}"' in written
    assert "bias" in (tmp_path / "imu.ssv").read_text(encoding="utf-8")
    (section,) = gyro_sections(again)
    assert section is not None
    assert section.table is not None
    assert "misalignment of gyro 1 towards axis 2" in {row[1] for row in section.table.rows}
    assert main(["apply", "imu.json", "bench.csv", "--out", "better.csv"]) == 0
    better = read_record(tmp_path / "better.csv")
    assert isinstance(better, BenchRecord)
    assert "gyros, too: w = (I + M)^-1 (reading - B - S n)" in capsys.readouterr().out
    # At rest the Earth alone turns the block, and over a move the table does.
    assert better.increment is not None
    assert record.increment is not None
    rate = [increments[100:200].sum(axis=0) / 2.0 for increments in (record.increment, better.increment)]
    assert np.linalg.norm(rate[0]) > 5e-4
    assert abs(np.linalg.norm(rate[1]) - 7.292e-5) < 4e-5


@pytest.mark.acceptance
def test_where_a_record_was_measured_its_comment_lines_say(record, tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    comments = {"latitude_deg": str(PLACE.latitude_deg), "azimuth_deg": str(PLACE.azimuth_deg - 360.0)}
    placed = position_record_of(replace(record, about=comments))
    assert bench_at(placed, encoder_bound=2e-6) == replace(PLACE, azimuth_deg=PLACE.azimuth_deg - 360.0)
    assert bench_at(placed, azimuth_deg=PLACE.azimuth_deg) is not None
    assert bench_at(position_record_of(record)) is None
    write_record(replace(record, about=comments), tmp_path / "bench.csv")
    for command in ("calibrate", "diagnose"):
        assert main([command, "bench.csv", "--noise-bound", str(SIGMA), "--latitude-deg", "10"]) == 2
        (line,) = capsys.readouterr().err.splitlines()
        assert "--latitude-deg 10" in line
        assert "leave the option out, or correct that line" in line
    with pytest.raises(InputError, match="a number must stand there"):
        bench_at(position_record_of(replace(record, about=comments | {"azimuth_deg": "north"})))


@pytest.mark.acceptance
def test_the_true_attitude_by_the_table_is_that_of_the_bench(record, result, truth, tmp_path):
    """The turn between any two rows agrees with the exact bench's, within the given bounds."""
    strapdown = strapdown_by_table(result, position_record_of(record), PLACE)
    exact = Rotation.from_matrix(np.swapaxes(attitudes_of(truth, record), 1, 2))
    stated = Rotation.from_quat(strapdown.attitude, scalar_first=True)
    rows = np.random.default_rng(2).integers(0, len(record), (2, 400))
    off = (stated[rows[0]].inv() * stated[rows[1]]) * (exact[rows[0]].inv() * exact[rows[1]]).inv()
    bound = np.radians(float(strapdown.about["attitude_bound_arcmin"]) / 60.0)
    assert off.magnitude().max() <= 2.0 * bound
    assert bound < 6e-5
    write_record(strapdown, tmp_path / "strapdown.csv")
    assert read_record(tmp_path / "strapdown.csv").about["attitude_reference"] == "inertial"
    with pytest.raises(InputError, match="no table tells a true attitude"):
        strapdown_by_table(result.model_copy(update={"verdict": "falsified"}), position_record_of(record), PLACE)


@pytest.mark.acceptance
def test_against_inertial_space_the_earth_is_no_error_of_the_gyros(truth):
    """The bounds of an attitude with Earth's rotation are those of noise and reference: far smaller."""
    places = tuple((90.0 * k, 90.0 * (k % 3)) for k in range(14))
    none = replace(truth, sensitivity=np.zeros((3, 3)), lag=0.0)
    short = bench_record(none, replace(PROGRAMME, positions=places, step=0.02, dwell=5.0), Errors(rate=5e-5))
    exact = Rotation.from_matrix(np.swapaxes(attitudes_of(none, short), 1, 2)).as_quat(scalar_first=True)
    within = {}
    for comments in ({}, {"attitude_reference": "inertial"}):
        strapdown = replace(short.gyros, attitude=exact, about=comments)
        evidence = carried_evidence(strapdown, baseline="calibrated", reference_bound=0.01)
        assert isinstance(evidence.model, Carried)
        assert evidence.model.radius < evidence.model.limit
        within[len(comments)] = evidence.reader.stated_bound
        reader: Any = evidence.reader
        assert ("Earth" in reader.bounds_from) == (not comments)
    assert within[1] < 0.2 * within[0]


@pytest.mark.first(1)
@pytest.mark.parametrize(("first", "stop"), [(168, 372), (100, 300), (60, 500)])
def test_accelerometers_stuck_over_moves_leave_too_few_rests_and_no_error(first, stop, tmp_path, capsys):
    """Rests that are lost leave mountings all but open: the programme's centre is then anywhere."""
    positions = ((0.0, 0.0), (90.0, 0.0), (180.0, 0.0), (0.0, 90.0), (0.0, 180.0), (90.0, 90.0), (360.0, 0.0))
    programme = Programme(positions, dwell=2.0, rate=2.0, step=0.05)
    right = bench_record(Truth.drawn(np.random.default_rng(5)), programme, Errors(rate=5e-5))
    force = right.specific_force.copy()
    force[first:stop, 1] = -32768.0
    write_record(replace(right, specific_force=force), tmp_path / "bench.csv")
    place = ["--latitude-deg", "55.75", "--azimuth-deg", "20"]
    assert main(["calibrate", str(tmp_path / "bench.csv"), "--noise-bound", "1e-4", *place, "--trust"]) in (0, 2)
    assert "fault of the program" not in capsys.readouterr().err
