"""Programmes of rests and turns for the whole IMU: their records guarantee the promised errors."""

import numpy as np
import pytest

import trihedron as th
from scenario_runs import SCENARIOS
from trihedron.tools.calibrated import LATENCIES
from trihedron.tools.calibration import BenchOnEarth
from trihedron.tools.cli import main
from trihedron.tools.demo import inside_intervals, true_targets
from trihedron.tools.orchestrator import read_scenario
from trihedron.tools.planning import ImuPlan, ImuVisit, Planned, TableVisit
from trihedron.tools.planning.imu import programme_record, seconds_of
from trihedron.tools.reports import write_imu_plan
from trihedron.tools.reports.plan import way_of

EARTH = np.array([3e-5, -1e-5, 6e-5])


def test_the_planned_motion_is_that_of_the_table(tmp_path):
    """The FMU of the table moves like the planned record, at the same times."""
    visits = [TableVisit(7.5, 7.5, 3.0, 57.29577951308232), TableVisit(367.5, 7.5, 2.0, 57.29577951308232)]
    visits.append(TableVisit(37.5, 127.5, 2.0, 57.29577951308232))
    rows = "\n".join(f"{v.alpha_deg},{v.beta_deg},{v.dwell_s}" for v in visits)
    (tmp_path / "programme.csv").write_text(f"alpha_deg,beta_deg,dwell_s\n{rows}\n", encoding="utf-8")
    first, limits = np.radians([7.5, 7.5]).tolist(), {"max_rate": [1.0, 1.0], "max_acceleration": [1.0, 1.0]}
    still = {"initial_angle": first, "encoder_fluctuation_bound": 0.0}
    run = th.simulate(
        {
            "schema": "trihedron.scenario/1",
            "run": {"step_s": 0.01},
            "fmus": {"table": {"component": "TurntableMotion", "parameters": limits | still}},
            "stimuli": [
                {"to": "table.command", "programme": str(tmp_path / "programme.csv")},
                {"to": "table.temperature", "constant": 20.0},
            ],
            "record": {
                "columns": {f"{name}_rad": f"table.angle_reading[{k}]" for k, name in ((1, "alpha"), (2, "beta"))}
            },
        }
    )
    planned = programme_record(visits, EARTH)
    assert run.table.height == len(planned)
    assert len(planned) - 1 == round(seconds_of(visits) / 0.01)
    for name in ("alpha", "beta"):
        assert np.abs(run.table[f"{name}_rad"].to_numpy() - getattr(planned, name)).max() < 1e-9


@pytest.mark.acceptance
def test_more_is_never_known_worse_and_a_longer_rest_tells_the_bias_better():
    planned = Planned(BenchOnEarth(50.0, 10.0, gyro_noise=1e-5, encoder_bound=2e-6), 1e-5)
    places = list(zip(np.tile(20.0 + 45.0 * np.arange(8), 3), np.repeat([25.0, 145.0, 265.0], 8), strict=True))
    places += [(0.0, 0.0), (720.0, 0.0), (0.0, 0.0), (0.0, 90.0), (720.0, 90.0), (0.0, 450.0), (0.0, 90.0)]
    some = [TableVisit(*place, 5.0, 100.0) for place in places]
    errors = planned.errors(planned.linearised(some))
    assert np.isfinite(errors).all()
    better = planned.errors(
        planned.linearised([*some, TableVisit(90.0, 90.0, 5.0, 100.0), TableVisit(90.0, 810.0, 5.0, 100.0)])
    )
    assert (better <= errors * (1.0 + 1e-3)).all()
    symbols = [target.symbol for target in planned.targets]
    longer = planned.errors(planned.linearised([visit._replace(dwell_s=20.0) for visit in some]))
    # Noise over a rest four times as long is half; the encoders' part falls faster.
    assert longer[symbols.index("B1")] < 0.6 * errors[symbols.index("B1")]
    # Eight positions at one inner angle have no turn about the inner axis.
    still = planned.errors(planned.linearised(some[:8]))
    assert np.isinf(still[symbols.index("M33")])


@pytest.mark.first(1)
@pytest.mark.parametrize(
    ("options", "message"),
    [
        (["--minutes", "1"], "--minutes 1: must be from 5 to 240"),
        (["--rate-dps", "0"], "--rate-dps 0: must be from 1 to 360"),
        (["--gyro-noise", "0"], "--gyro-noise 0: must be above 0"),
        (["--dwell", "-1"], "--dwell -1: must be a positive number of seconds"),
        (["--minutes", "5", "--dwell", "250", "--exchanges", "0"], "--minutes 5: is too little for rests of 250 s"),
        (["--convention", "A2"], "Unknown option: --convention"),
    ],
)
def test_what_cannot_be_planned_is_refused(options, message, capsys):
    assert main(["plan", "imu", *options]) == 2
    assert message in capsys.readouterr().err


def test_a_plan_is_drawn_on_its_page_and_checked(tmp_path, capsys):
    visits = tuple(ImuVisit(alpha_deg=a, beta_deg=7.5, dwell_s=20.0) for a in (0.0, 360.0, 0.0))
    plan = ImuPlan(
        programme=visits,
        minutes=1.18,
        worst_ratio=1.5,
        worst="S31",
        targets=(),
        practices=(),
        noise_bound=1e-5,
        gyro_noise=1e-5,
        encoder_bound=1e-5,
        rate_dps=100.0,
        acceleration_radps2=1.0,
        latitude_deg=55.75,
        azimuth_deg=0.0,
        pool=528,
    )
    assert str(plan).startswith("3 rests in 1.18 minutes")
    _, page, written = write_imu_plan(plan, tmp_path / "imu")
    assert "<svg" in page.read_text(encoding="utf-8")
    # Three rests, and two moves that speed up to 100 deg/s and slow down.
    minutes, (alpha, _) = way_of(plan)
    assert minutes[-1] == pytest.approx((60.0 + 2.0 * (3.6 + np.radians(100.0))) / 60.0)
    assert alpha.tolist() == [0.0, 0.0, 360.0, 360.0, 0.0, 0.0]
    assert main(["check", str(written)]) == 0
    assert "3 rests in 1.18 minutes, worst ratio 1.5 (S31)" in capsys.readouterr().out
    written.write_text(written.read_text(encoding="utf-8").replace('"minutes"', '"minute"'), encoding="utf-8")
    assert main(["check", str(written)]) == 2
    assert "minutes: is missing" in capsys.readouterr().out


@pytest.mark.acceptance
def test_thirty_minutes_are_planned_far_better_than_usual_and_the_promise_holds(tmp_path):
    """Run the planned programme as FMUs; its record guarantees the promised errors, and its intervals hold the
    truth."""
    place = {
        "gyro_noise": 1e-5,
        "encoder_bound": 2.424e-6,
        "latitude_deg": float(np.degrees(0.973)),
        "azimuth_deg": 20.0,
    }
    options = []
    for name, number in place.items():
        options += [f"--{name.replace('_', '-')}", repr(float(number))]
    assert main(["plan", "imu", "--minutes", "30", *options, "--out", str(tmp_path / "imu")]) == 0
    plan = ImuPlan.model_validate_json((tmp_path / "imu" / "imu-plan.json").read_text(encoding="utf-8"))
    assert plan.minutes <= 30.0
    usual = [practice.worst_ratio for practice in plan.practices if practice.worst_ratio is not None]
    assert usual
    assert plan.worst_ratio - 1.0 <= 0.5 * (min(usual) - 1.0)
    assert all(target.promised >= target.bound * (1.0 - 1e-6) for target in plan.targets)
    text = (SCENARIOS / "imu-calibration.toml").read_text(encoding="utf-8")
    first, rate = (
        np.radians([plan.programme[0].alpha_deg, plan.programme[0].beta_deg]).tolist(),
        float(np.radians(100.0)),
    )
    for old, new in (
        ("imu-calibration-positions.csv", "imu/programme.csv"),
        ("\ndwell_s = 62.0", ""),
        ("max_rate = [1.0, 1.0]", f"max_rate = [{rate!r}, {rate!r}]"),
        ("initial_angle = [0.3490658503988659, 0.4363323129985824]", f"initial_angle = {first}"),
    ):
        assert old in text
        text = text.replace(old, new)
    (tmp_path / "planned.toml").write_text(text, encoding="utf-8")
    run = th.simulate(tmp_path / "planned.toml", out=tmp_path / "run")
    bench = BenchOnEarth(place["latitude_deg"], float(np.degrees(0.35)), gyro_noise=1e-5, encoder_bound=2.424e-6)
    calibration = th.calibrate(run.files[0], noise_bound=1e-5, bench=bench)
    assert calibration.verdict == "consistent"
    assert calibration.gyros is not None
    assert inside_intervals(calibration, true_targets(read_scenario(tmp_path / "planned.toml"))) == 42
    # The plan ignores latencies of accelerometers: readings in motion determine them besides.
    planned = [parameter for parameter in calibration.parameters if parameter.symbol not in LATENCIES]
    for parameter, promised in zip(planned, plan.targets, strict=True):
        assert parameter.symbol == promised.symbol
        assert parameter.guaranteed_error == pytest.approx(promised.promised, rel=plan.held_to), parameter.symbol
