"""A fixed part of the suites of hidden effects, and the ways of their cases."""

import json
import subprocess
import sys
from collections import Counter

import numpy as np
import pytest

from trihedron.fmus.units import STANDARD_GRAVITY
from trihedron.models.effects import CATALOGUE
from trihedron.tools import cli
from trihedron.tools.errors import InputError
from trihedron.tools.hidden_cases import NOISE_BOUND
from trihedron.tools.hidden_suite.benches import draw_positions, expected, faultless_record
from trihedron.tools.hidden_suite.cases import SuiteCase, SuiteOptions, draw_case
from trihedron.tools.hidden_suite.measurement import drawn_errors, measure_case
from trihedron.tools.hidden_suite.outcomes import Outcome
from trihedron.tools.hidden_suite.suite import diagnosed, named_suite, run_suite
from unknown_effects import UNKNOWN, draw_unknown

ARCSEC = np.pi / 180.0 / 3600.0


def quick(name: str) -> tuple[Outcome, ...]:
    suite = named_suite(name)
    return run_suite(suite.options, suite.cases, suite.seed).outcomes


def counted(outcomes: tuple[Outcome, ...]) -> Counter[str]:
    return Counter(outcome.kind for outcome in outcomes)


def test_nothing_is_named_on_clean_records_of_every_noise():
    outcomes = quick("quick-clean")
    assert counted(outcomes) == {"right": len(outcomes)}
    assert {outcome.case.noise for outcome in outcomes} == {"uniform", "edge", "correlated"}
    assert {len(outcome.case.bench.mountings) for outcome in outcomes} == {1, 2}


def test_single_effects_of_the_second_size_are_named_and_their_sizes_are_inside():
    outcomes = quick("quick-single")
    assert counted(outcomes) == {"right": len(outcomes)}
    assert all(outcome.inside is not False for outcome in outcomes)


def test_between_the_two_sizes_the_truth_is_among_the_candidates():
    assert set(counted(quick("quick-between"))) <= {"right", "candidate"}


def test_pairs_are_named_both():
    outcomes = quick("quick-pairs")
    assert counted(outcomes) == {"right": len(outcomes)}


@pytest.mark.parametrize("index", [1, 5])
def test_what_the_catalogue_lacks_gets_no_name(index):
    unknown = draw_unknown(501, index, (20, 24))
    result = diagnosed(unknown.case, unknown.record)
    assert (result.verdict, result.causes) == ("unexplained", ())


def test_unknown_effects_are_ten():
    assert len(set(UNKNOWN)) == 10


def test_a_case_is_the_same_whatever_their_number():
    options = SuiteOptions("clean", positions=(12, 14))
    some, more = (run_suite(options, count, 3).outcomes for count in (1, 2))
    assert some[0].to_json() == more[0].to_json()
    assert np.array_equal(some[0].case.bench.alpha, more[0].case.bench.alpha)
    assert measure_case(some[0].case).specific_force.tobytes() == measure_case(more[0].case).specific_force.tobytes()
    assert not np.array_equal(more[0].case.bench.alpha, more[1].case.bench.alpha)


def clean_case(noise: str, index: int) -> SuiteCase:
    return draw_case(SuiteOptions("clean", positions=(24, 26), noise=noise), 8, index)


@pytest.mark.parametrize("noise", ["uniform", "edge", "correlated"])
@pytest.mark.parametrize("index", [0, 2])
def test_a_record_differs_from_its_faultless_bench_by_the_noise_and_no_more(noise, index):
    """The components in time against the closed formula, by another way: every error is within σ."""
    case = clean_case(noise, index)
    record, faultless = measure_case(case), faultless_record(case.bench)
    errors = (record.specific_force - faultless.specific_force) / STANDARD_GRAVITY / NOISE_BOUND
    # Nine decimals of m/s² are 5.1e-6 of σ.
    assert np.abs(errors).max() <= 1.0 + 5.2e-6
    assert np.abs(errors).max() > 0.3
    if noise == "edge":
        assert np.abs(errors).min() >= 1.0 - 5.2e-6
    assert np.abs(np.stack((record.alpha - faultless.alpha, record.beta - faultless.beta))).max() < 0.5 * ARCSEC
    assert record.approach_alpha is not None
    assert record.approach_beta is not None
    assert faultless.approach_alpha is not None
    assert faultless.approach_beta is not None
    assert np.array_equal(record.approach_alpha, faultless.approach_alpha)
    assert np.array_equal(record.approach_beta, faultless.approach_beta)
    assert record.mounting == faultless.mounting
    # The sizes are computed for the times at which the bench will really be read.
    assert np.abs(record.time_s - record.time_s[0] - faultless.time_s + faultless.time_s[0]).max() < 8.0


def test_more_positions_leave_the_first_errors_as_they_were():
    case = clean_case("correlated", 1)
    errors = drawn_errors(np.random.default_rng(1), case)
    assert np.abs(errors).max() <= 1.0
    following = np.corrcoef(errors[1:].ravel(), errors[:-1].ravel())[0, 1]
    assert following > 0.5


@pytest.mark.parametrize("seed", range(6))
def test_positions_are_so_many_and_all_different(seed):
    rng = np.random.default_rng(seed)
    count = int(rng.integers(12, 101))
    alpha, beta = draw_positions(rng, count)
    assert len({(a, b) for a, b in zip(alpha.tolist(), beta.tolist(), strict=True)}) == count == len(beta)


@pytest.mark.parametrize("seed", range(3))
def test_sizes_that_are_drawn_are_those_of_the_mode(seed):
    single = draw_case(SuiteOptions("single", positions=(20, 40)), seed, 0)
    hidden = single.hidden[0]
    if CATALOGUE[hidden.place.effect].variants is None:
        assert hidden.size == pytest.approx(1.5 * hidden.sizes.excluded)
    assert all(p.possible(v) for v, p in zip(hidden.values, CATALOGUE[hidden.place.effect].at(hidden.place).parameters,
                                             strict=True))  # fmt: skip
    between = draw_case(SuiteOptions("between", positions=(20, 40), effects=("cubic",)), seed, 0).hidden[0]
    assert between.sizes.detected <= between.size <= between.sizes.excluded
    relative = draw_case(SuiteOptions("single", positions=(20, 40), effects=("sag",), size=(0.5, 0.7)), seed, 0)
    assert 0.5 <= relative.hidden[0].relative_size <= 0.7
    first, second = draw_case(SuiteOptions("pairs", positions=(30, 40)), seed, 0).hidden
    assert first.place != second.place


def test_what_is_known_of_a_bench_is_its_truth():
    case = clean_case("edge", 0)
    here, circumstances = expected(case.bench)
    assert np.abs(here.residual).max() < 1e-12
    assert len(circumstances.hours) == len(case.bench.alpha)


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
        SuiteOptions(**options)


def test_a_suite_from_the_command_line(tmp_path, capsys):
    out = tmp_path / "suite"
    words = ["hidden", "--cases", "2", "--seed", "5", "--effects", "quadratic", "--positions", "20", "30"]
    assert cli.main([*words, "--noise", "uniform", "--out", str(out)]) == 0
    said = capsys.readouterr().out
    assert said.startswith("2 cases (single), seed 5: right 2")
    content = json.loads((out / "suite.json").read_text(encoding="utf-8"))
    assert content["schema"] == "trihedron.hidden-suite/1"
    assert content["confusion"] == {"quadratic": {"quadratic": 2}}
    assert content["size_errors"]["inside_intervals"] == 2
    assert len(content["results"]) == 2
    assert (out / "cases.csv").read_text(encoding="utf-8").count("\n") == 3
    assert "<svg" in (out / "index.html").read_text(encoding="utf-8")
    for index, result in enumerate(content["results"]):
        case = draw_case(SuiteOptions("single", ("quadratic",), (20, 30), "uniform"), 5, index)
        assert result["hidden"][0]["where"] == case.places[0].where
    assert len(list((out / "records").glob("case-*.csv"))) == 2


IN_PROCESSES = """
import sys
from pathlib import Path

import polars

from trihedron.tools.hidden_suite.cases import SuiteOptions
from trihedron.tools.hidden_suite.suite import run_suite

polars.DataFrame({"x": [1.0, 2.0]}).select(polars.col("x").sum())
for jobs in (1, 2):
    folder = Path(sys.argv[1]) / str(jobs)
    folder.mkdir()
    run_suite(SuiteOptions("clean", (), (12, 13), "uniform"), 2, 1, records=folder, jobs=jobs)
"""


def test_several_processes_give_the_same_records(tmp_path):
    """Also where the first process has threads of polars, for which a copy of it would wait for ever."""
    subprocess.run([sys.executable, "-c", IN_PROCESSES, str(tmp_path)], check=True, timeout=100)
    one, two = ({f.name: f.read_bytes() for f in (tmp_path / jobs).iterdir()} for jobs in ("1", "2"))
    assert len(one) == 2
    assert one == two


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["--mode", "single"], "--cases"),
        (["a.csv", "--cases", "2"], "the record"),
        (["--cases", "0"], "--cases 0"),
        (["--suite", "snigle"], "--suite snigle"),
        (["--suite", "single", "--mode", "pairs"], "--suite decides"),
        (["--cases", "2", "--clean", "--mode", "pairs"], "--clean and --mode"),
        (["--cases", "2", "--jobs", "0"], "--jobs 0"),
        (["--cases", "2", "--seed", "-3"], "--seed -3"),
    ],
)
def test_options_that_do_not_go_together_are_refused(words, message, capsys):
    assert cli.main(["hidden", *words]) == 2
    error = capsys.readouterr().err
    assert message in error
    assert error.count("\n") == 1
