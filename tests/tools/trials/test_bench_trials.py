"""Hidden effects on benches: drawn, measured, judged, counted; a fixed part of the suites."""

import subprocess
import sys
from typing import Any

import numpy as np
import pytest

from trihedron.fmus.units import STANDARD_GRAVITY
from trihedron.models.effects import CATALOGUE, EffectPlace
from trihedron.tools import cli
from trihedron.tools.diagnosis import Cause, NamedEffect
from trihedron.tools.errors import InputError
from trihedron.tools.evidence import in_record, lagged
from trihedron.tools.trials import (
    NOISE_BOUND,
    Case,
    Options,
    Suite,
    diagnosed_case,
    draw_case,
    draw_positions,
    drawn_errors,
    faultless_record,
    judged_case,
    named_suite,
    run_suite,
)
from trihedron.tools.trials.bench import STEP_S
from trihedron.tools.trials.hiding import expected
from trihedron.tools.trials.outcome import outcome_kind
from unknown_effects import UNKNOWN, draw_unknown

ARCSEC = np.pi / 180.0 / 3600.0


def part_of(name: str, cases: int) -> Any:
    """Return the first cases of a suite; `make acceptance` runs the whole ones."""
    suite = named_suite(name)
    return run_suite(suite.options, min(cases, suite.cases), suite.seed)


def test_nothing_is_named_on_clean_records_of_every_noise():
    suite = part_of("quick-clean", 3)
    assert suite.outcomes == {"right": suite.cases}
    assert {outcome.noise for outcome in suite.results} == {"uniform", "edge", "correlated"}
    assert {len(outcome.mountings) for outcome in suite.results} == {1, 2}
    assert Suite.model_validate_json(suite.json_text()) == suite


@pytest.mark.acceptance
def test_single_effects_of_the_second_size_are_named_and_their_sizes_are_inside():
    suite = part_of("quick-single", 1)
    assert suite.outcomes == {"right": suite.cases}
    assert all(outcome.inside is not False for outcome in suite.results)


@pytest.mark.acceptance
def test_between_the_two_sizes_the_truth_is_among_the_candidates():
    assert set(part_of("quick-between", 2).outcomes) <= {"right", "candidate"}


@pytest.mark.acceptance
def test_a_step_is_drawn_between_two_rests_and_hidden_there():
    options = Options("single", effects=("bias-step",), positions=(14, 18), noise="uniform")
    case = draw_case(options, 11, 0)
    record = case.measured()
    hidden = case.hidden[0].since(record.time_s[0] / 3600.0)
    assert np.abs(faultless_record(case.instrument).time_s - record.time_s).max() <= STEP_S
    after = (record.time_s - record.time_s[0]) / 3600.0 > hidden.parameters["start"]
    change = record.specific_force - faultless_record(case.instrument).specific_force
    mean = change[after].mean(axis=0) - change[~after].mean(axis=0)
    assert mean[hidden.place.index] / STANDARD_GRAVITY == pytest.approx(hidden.parameters["size"], abs=NOISE_BOUND)
    of_axis = change[:, hidden.place.index] - STANDARD_GRAVITY * hidden.parameters["size"] * after
    assert np.abs(of_axis).max() <= 1.1 * NOISE_BOUND * STANDARD_GRAVITY


@pytest.mark.acceptance
def test_a_warm_up_is_held_against_the_clock_of_its_record():
    """A settling effect spoils the beginning of each rest, which moves the first row: by 3 % of this size in 1 s."""
    case = draw_case(Options("single", effects=("warm-up",), positions=(16, 20), noise="uniform"), 13, 0)
    record, (hidden,) = case.measured(), case.hidden
    began = float(record.time_s[0])
    assert began - faultless_record(case.instrument).time_s[0] > 2.0 * STEP_S
    size, time_constant = hidden.values
    settling = size * np.exp(-record.time_s / 3600.0 / time_constant)
    change = (record.specific_force - faultless_record(case.instrument).specific_force)[:, hidden.place.index]
    assert np.ptp(change / STANDARD_GRAVITY + settling) <= 2.2 * NOISE_BOUND
    outcome = judged_case(case, diagnosed_case(case, record))
    (secret,) = outcome.secrets
    assert secret.parameters["size"] == pytest.approx(settling[0], rel=1e-12)
    assert (outcome.outcome, outcome.inside) == ("right", True)


@pytest.mark.acceptance
def test_a_lag_begins_with_what_the_temperature_was_before_and_is_held_against_the_clock_of_its_record():
    """Readings are c (T_lag − 20) + s e^(−t/τ) from the first row on, the lag linear in time between the rows."""
    case = draw_case(Options("single", effects=("thermal-lag",), positions=(20, 24), noise="uniform"), 21, 6)
    record, (hidden,) = case.measured(), case.hidden
    assert record.temperature is not None
    outcome = judged_case(case, diagnosed_case(case, record))
    assert (outcome.outcome, outcome.inside) == ("right", True)
    (secret,) = outcome.secrets
    coefficient, settling, constant = secret.parameters.values()
    # It is far from settled, and the run begins before the record.
    assert settling / coefficient > 2.0
    assert settling != pytest.approx(hidden.parameters["settling"], rel=1e-3)
    hours = (record.time_s - record.time_s[0]) / 3600.0
    lag = lagged(hours, record.temperature - 20.0, np.array([constant]))[0][:, 0]
    change = (record.specific_force - faultless_record(case.instrument).specific_force) / STANDARD_GRAVITY
    expected = coefficient * lag + settling * np.exp(-hours / constant)
    of_axis = change[:, hidden.place.index]
    assert np.abs(of_axis - expected).max() <= 1.2 * NOISE_BOUND < 0.2 * np.abs(expected).max()


@pytest.mark.acceptance
def test_pairs_are_named_both():
    suite = part_of("quick-pairs", 1)
    assert suite.outcomes == {"right": suite.cases}


@pytest.mark.acceptance
def test_what_the_catalogue_lacks_gets_no_name():
    assert len(set(UNKNOWN)) == 10
    unknown = draw_unknown(501, 9, (20, 24))
    result: Any = diagnosed_case(unknown.case, unknown.record)
    assert (result.verdict, len(result.causes)) == ("unexplained", 0)


@pytest.mark.acceptance
def test_a_case_is_the_same_whatever_their_number():
    options = Options("clean", positions=(12, 14))
    some, longer = (run_suite(options, count, 3).results for count in (1, 2))
    assert some[0] == longer[0]
    first, again, second = (draw_case(options, 3, index) for index in (0, 0, 1))
    assert first.measured().specific_force.tobytes() == again.measured().specific_force.tobytes()
    assert not np.array_equal(first.instrument.alpha, second.instrument.alpha)


def clean_case(noise: str, index: int) -> Case:
    return draw_case(Options("clean", positions=(24, 26), noise=noise), 8, index)


@pytest.mark.parametrize("noise", ["uniform", "edge", "correlated"])
@pytest.mark.parametrize("index", [0, 2])
def test_a_record_differs_from_its_faultless_bench_by_the_noise_and_no_more(noise, index):
    """Compare the components in time with the closed formula: every error is within σ."""
    case = clean_case(noise, index)
    record, faultless = case.measured(), faultless_record(case.instrument)
    errors = (record.specific_force - faultless.specific_force) / STANDARD_GRAVITY / NOISE_BOUND
    # Nine decimals of m/s² are 5.1e-6 of σ.
    assert 0.3 < np.abs(errors).max() <= 1.0 + 5.2e-6
    if noise == "edge":
        assert np.abs(errors).min() >= 1.0 - 5.2e-6
    assert np.abs(np.stack((record.alpha - faultless.alpha, record.beta - faultless.beta))).max() < 0.5 * ARCSEC
    for name in ("approach_alpha", "approach_beta"):
        assert getattr(record, name) is not None
        assert np.array_equal(getattr(record, name), getattr(faultless, name))
    assert record.mounting == faultless.mounting
    # The sizes are computed for the times of the actual readings.
    assert np.abs(record.time_s - record.time_s[0] - faultless.time_s + faultless.time_s[0]).max() < 8.0


def test_errors_that_wander_follow_each_other_within_the_bound():
    errors = drawn_errors(np.random.default_rng(1), "correlated", 25)
    assert np.abs(errors).max() <= 1.0
    assert np.corrcoef(errors[1:].ravel(), errors[:-1].ravel())[0, 1] > 0.5


@pytest.mark.parametrize("seed", range(3))
def test_positions_are_so_many_and_all_different(seed):
    rng = np.random.default_rng(seed)
    count = int(rng.integers(12, 101))
    alpha, beta = draw_positions(rng, count)
    assert len({(a, b) for a, b in zip(alpha.tolist(), beta.tolist(), strict=True)}) == count == len(beta)


@pytest.mark.acceptance
@pytest.mark.parametrize("seed", range(2))
def test_sizes_that_are_drawn_are_those_of_the_mode(seed):
    def hidden(mode: str, positions: tuple[int, int] = (20, 40), **options: Any):
        return draw_case(Options(mode, positions=positions, **options), seed, 0).hidden

    (single,) = hidden("single")
    effect = CATALOGUE[single.place.effect]
    if effect.variants is None:
        assert single.size == pytest.approx(1.5 * single.sizes.excluded)
    parameters = zip(single.values, effect.at(single.place).parameters, strict=True)
    assert all(parameter.possible(value) for value, parameter in parameters)
    (between,) = hidden("between", effects=("cubic",))
    assert between.sizes.detected <= between.size <= between.sizes.excluded
    (relative,) = hidden("single", effects=("sag",), size=(0.5, 0.7))
    assert 0.5 <= relative.relative_size <= 0.7
    first, second = hidden("pairs", (30, 40))
    assert first.place != second.place


def test_what_is_known_of_a_bench_is_its_truth():
    case = clean_case("edge", 0)
    nominal = expected(case.instrument)
    model, circumstances = nominal.model, nominal.circumstances
    assert np.abs(model.residual).max() < 1e-12
    assert len(circumstances.hours) == len(case.instrument.alpha)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"mode": "sngle"}, "--mode sngle: did you mean 'single'"),
        ({"noise": "edgy"}, "--noise edgy"),
        ({"effects": ("quadratc",)}, "did you mean 'quadratic'"),
        ({"positions": (20, 12)}, "--positions 20 12"),
        ({"size": (2.0, 1.0)}, "--size 2 1"),
    ],
)
def test_wrong_options_are_refused_in_one_line(options, message):
    with pytest.raises(InputError, match=message):
        Options(**options)


def test_a_suite_from_the_command_line(tmp_path, capsys):
    out = tmp_path / "suite"
    words = ["hidden", "--cases", "2", "--seed", "5", "--effects", "quadratic", "--positions", "14", "18"]
    assert cli.main([*words, "--noise", "uniform", "--out", str(out)]) == 0
    assert capsys.readouterr().out.startswith("2 cases (single), seed 5: right 2")
    suite = Suite.model_validate_json((out / "suite.json").read_text(encoding="utf-8"))
    assert suite.confusion == {"quadratic": {"quadratic": 2}}
    assert suite.size_errors["inside_intervals"] == 2
    assert (out / "cases.csv").read_text(encoding="utf-8").count("\n") == 3
    assert "<svg" in (out / "index.html").read_text(encoding="utf-8")
    for index, result in enumerate(suite.results):
        case = draw_case(Options("single", ("quadratic",), (14, 18), "uniform"), 5, index)
        assert result.places == case.places
    assert len(list((out / "records").glob("case-*.csv"))) == 2


IN_PROCESSES = """
import sys
from pathlib import Path

import polars

from trihedron.tools.trials.case import Options
from trihedron.tools.trials.suite import run_suite

polars.DataFrame({"x": [1.0, 2.0]}).select(polars.col("x").sum())
for jobs in (1, 2):
    folder = Path(sys.argv[1]) / str(jobs)
    folder.mkdir()
    run_suite(Options("clean", (), (12, 13), "uniform"), 2, 1, records=folder, jobs=jobs)
"""


@pytest.mark.acceptance
def test_several_processes_give_the_same_records(tmp_path):
    """The first process may have threads of polars, for which a copy of it would wait for ever."""
    subprocess.run([sys.executable, "-c", IN_PROCESSES, str(tmp_path)], check=True, timeout=100)
    alone, two = ({f.name: f.read_bytes() for f in (tmp_path / jobs).iterdir()} for jobs in ("1", "2"))
    assert len(alone) == 2
    assert alone == two


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["--mode", "single"], "--cases"),
        (["a.csv", "--cases", "2"], "the record"),
        (["--cases", "0"], "--cases 0"),
        (["--suite", "single", "--mode", "pairs"], "--suite decides"),
        (["--cases", "2", "--clean", "--mode", "pairs"], "--clean and --mode"),
        (["--cases", "2", "--jobs", "0"], "--jobs 0"),
        (["a.csv", "--strapdown", "--seed", "-1"], "--seed -1"),
        (["a.csv", "--strapdown", "--effect", "encoder-harmonic"], "not one that can be hidden"),
    ],
)
def test_options_that_do_not_go_together_are_refused(words, message, capsys):
    assert cli.main(["hidden", *words]) == 2
    error = capsys.readouterr().err
    assert message in error
    assert error.count("\n") == 1


@pytest.mark.acceptance
def test_several_records_without_a_secret_are_a_suite_too(tmp_path):
    options = Options("clean", positions=(12, 12), records=2)
    suite = run_suite(options, 1, 3, records=tmp_path)
    assert suite.outcomes == {"right": 1}
    assert (suite.records, suite.results[0].records, suite.results[0].positions) == (2, 2, 12)
    assert Suite.model_validate_json(suite.json_text()) == suite
    assert sorted(file.name for file in tmp_path.iterdir()) == [f"case-00000-record-{k}.csv" for k in (1, 2)]


def test_an_effect_of_another_record_is_a_wrong_name_and_one_that_nothing_tells_apart_is_not():
    square, cube = (EffectPlace(name, "accelerometer-1") for name in ("quadratic", "cubic"))
    hidden = (square, in_record(cube, "record-2"))

    def named(*places: EffectPlace, same: tuple[EffectPlace, ...] = ()) -> list[list[Cause]]:
        return [[Cause.found(place, same if place == places[0] else (), (1.0,), ((0.9, 1.1),)) for place in places]]

    assert outcome_kind(hidden, "explained", named(in_record(cube, "record-2"), square)) == "right"
    assert outcome_kind(hidden, "explained", named(in_record(cube, "record-1"), square)) == "wrong"
    assert outcome_kind(hidden, "explained", named(cube, square)) == "wrong"
    alike = (in_record(cube, "record-2"),)
    assert outcome_kind(hidden, "explained", named(in_record(square, "record-2"), square, same=alike)) == "right"
    assert outcome_kind(hidden, "ambiguous", [*named(cube), *named(*hidden)]) == "candidate"
    assert NamedEffect.of(hidden[1]).to_json()["record"] == "record-2"
    assert "record" not in NamedEffect.of(square).to_json()
    assert [NamedEffect.of(place).place for place in hidden] == list(hidden)
