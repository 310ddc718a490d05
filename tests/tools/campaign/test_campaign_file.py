"""Campaign files: content, refusals, and the parameters of each run."""

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy import stats

from campaign_runs import CALIBRATION
from trihedron.tools.campaign import Axis, Campaign, parse_campaign
from trihedron.tools.campaign.kinds import short_seed
from trihedron.tools.campaign.runs import Design, columns_of, make_runner
from trihedron.tools.errors import InputError

HEAD = 'schema = "trihedron.campaign/1"\n'
ATTITUDE = HEAD + "[attitude]\nduration_s = 0.1\n"


def parsed(text: str) -> Campaign:
    return parse_campaign(text.encode(), Path("c.toml"))


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("[calibration]\n", "c.toml: schema is missing"),
        (HEAD, "give one section of calibration"),
        (HEAD + "[calibration]\n[attitude]\n", "calibration and attitude"),
        (HEAD + "[calibrations]\n", "calibrations: unknown key; did you mean 'calibration'?"),
        (HEAD + "[calibration]\nnoise_boud = 1\n", "calibration.noise_boud: unknown key"),
        (HEAD + "[calibration\n", "c.toml: is not TOML"),
        (HEAD + "repeats = 0\n[calibration]\n", "repeats"),
        (HEAD + "repeats = 1.5\n[calibration]\n", "repeats"),
        (HEAD + "base_folder = 'x'\n[calibration]\n", "base_folder: unknown key"),
        (ATTITUDE + "[sampling]\npoints = 4\n", "no parameter has a distribution"),
        (ATTITUDE + "[sampling]\nmethod = 'saltelli'\npoints = 6\n", "needs a power of two, as 4 or 8"),
        (ATTITUDE + "[parameters]\nquantum_rad = {}\n", "parameters.quantum_rad: give one of values"),
        (ATTITUDE + "[parameters]\nquantum_rad = { uniform = [2, 1] }\n", "must rise"),
        (ATTITUDE + "[parameters]\nquantum_rad = { log_uniform = [0, 1] }\n", "positive ends"),
        (ATTITUDE + "[parameters]\nquantum_rad = { normal = [0, -1] }\n", "standard deviation must be positive"),
        (ATTITUDE + "[parameters]\nquantum_rad = { values = [1, 'a'] }\n", "all numbers"),
        (ATTITUDE + "[parameters]\nquantum_rad = { values = [nan] }\n", "parameters.quantum_rad.values"),
        (
            ATTITUDE + "[sampling]\nlists = 'together'\n[parameters]\nquantum_rad = { values = [1] }\n"
            "rate_hz = { values = [1, 2] }\n",
            "equally long",
        ),
        (HEAD + "[hidden]\nsuite = 'single'\nmode = 'pairs'\n", "mode is what suite decides"),
        (HEAD + "[hidden]\n[parameters]\nx = { values = [1] }\n", "drawn by its number"),
        (ATTITUDE + "[[compute]]\nrate = 'verdict'\n", "compute[1]: rate needs is"),
        (ATTITUDE + "[[compute]]\nquantiles = ['a']\nof = 'b'\n", "of does not go with quantiles"),
        (ATTITUDE + "[[compute]]\n", "give one of quantiles"),
        (
            "repeats = 10000000000\n" + ATTITUDE + "[parameters]\nquantum_rad = { values = [1, 2] }\n",
            "runs are too many",
        ),
        ("partition = 1\nrepeats = 9999999\n" + ATTITUDE, "makes more than 1000000 files"),
        (ATTITUDE + "[[compute]]\nrate = 'a'\nis = ['b']\nagainst = 'c'\nedges = [2, 1]\n", "edges must rise"),
    ],
)
def test_what_a_campaign_file_cannot_say_is_refused_in_one_line(text, message):
    with pytest.raises(InputError) as caught:
        parsed(text)
    assert message in str(caught.value)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (ATTITUDE + "[parameters]\nbias_1 = { values = [1] }\n", "did you mean 'bias_1_radps'?"),
        (HEAD + "[attitude]\nalgorithm = 'two-sample'\n", "attitude.algorithm"),
        (HEAD + "[attitude]\nmotion = '9'\n", "motion 9"),
        (ATTITUDE + "[parameters]\nalgorithm = { values = ['panow'] }\n", "parameters.algorithm"),
        (ATTITUDE + "[keep]\ndiagnosis = true\n", "has no diagnosis"),
        (ATTITUDE + "[keep]\nscalars = ['last_error']\n", "did you mean 'last_error_rad'?"),
        (ATTITUDE + "[[compute]]\nquantiles = ['verdict']\n", "compute[1]: 'verdict' is not a column"),
        (ATTITUDE + "[[compute]]\nsensitivity = ['last_error_rad']\n", "needs parameters that are numbers"),
        (HEAD + "[calibration]\n[parameters]\ngamma_12 = { values = [1] }\n", "parameters.gamma_12: is not known"),
        (HEAD + "[calibration]\n[[compute]]\nquantiles = ['verdict']\n", "is a text"),
        (HEAD + "[hidden]\nsuite = 'doubles'\n", "hidden.suite: doubles"),
        (HEAD + "[hidden]\nsuite = 'triples'\n[keep]\nrecord = true\n", "keep.record: is of one record a run"),
        (HEAD + "[hidden]\neffects = ['quadratc']\n", "did you mean 'quadratic'?"),
    ],
)
def test_what_a_kind_of_run_cannot_do_is_refused_in_one_line(text, message):
    campaign = parsed(text)
    with pytest.raises(InputError) as caught:
        columns_of(campaign, make_runner(campaign))
    assert message in str(caught.value)


@pytest.mark.parametrize(
    ("field", "distribution"),
    [
        ({"uniform": [-1.0, 3.0]}, stats.uniform(-1.0, 4.0)),
        ({"log_uniform": [1e-3, 1e2]}, stats.loguniform(1e-3, 1e2)),
        ({"normal": [2.0, 0.5]}, stats.norm(2.0, 0.5)),
        ({"truncated_normal": [2.0, 0.5]}, stats.truncnorm(-3.0, 3.0, 2.0, 0.5)),
        ({"triangular": [0.0, 1.0, 4.0]}, stats.triang(0.25, 0.0, 4.0)),
        ({"triangular": [0.0, 0.0, 4.0]}, stats.triang(0.0, 0.0, 4.0)),
    ],
)
def test_distributions_are_those_of_scipy(field, distribution):
    u = np.linspace(1e-6, 1.0 - 1e-6, 41)
    assert Axis.model_validate(field).quantile(u) == pytest.approx(distribution.ppf(u), rel=1e-9, abs=1e-9)


@given(st.floats(0.0, 1.0, exclude_max=True))
def test_no_draw_is_infinite_or_outside(u):
    assert np.isfinite(Axis.model_validate({"normal": [0.0, 1.0]}).quantile(u))
    assert abs(Axis.model_validate({"truncated_normal": [0.0, 1.0]}).quantile(u)) <= 3.0 + 1e-9
    assert -1.0 <= Axis.model_validate({"uniform": [-1.0, 1.0]}).quantile(u) <= 1.0


def test_lists_are_combined_the_last_one_fastest_and_repeats_inside():
    text = (
        HEAD
        + "repeats = 2\n[attitude]\n[parameters]\nmotion = { values = ['1', '2'] }\nrate_hz = { grid = [1, 3, 3] }\n"
    )
    design = Design(parsed(text))
    assert design.campaign.runs == 12
    drawn = [(v["motion"], v["rate_hz"]) for v in map(design.values, range(12))]
    assert drawn[::2] == drawn[1::2]
    assert drawn[::2] == [(m, r) for m in ("1", "2") for r in (1.0, 2.0, 3.0)]
    together = text.replace("grid = [1, 3, 3]", "values = [5, 6]").replace(
        "[param", "[sampling]\nlists='together'\n[param"
    )
    design = Design(parsed(together))
    assert [(v["motion"], v["rate_hz"]) for v in map(design.values, range(4))] == [("1", 5.0)] * 2 + [("2", 6.0)] * 2


SAMPLED = ATTITUDE + (
    "[sampling]\nmethod = '{}'\npoints = {}\n[parameters]\n"
    "bias_1_radps = {{ uniform = [0, 1] }}\nbias_2_radps = {{ uniform = [0, 1] }}\n"
)


def points(design: Design) -> np.ndarray:
    return np.array([list(design.values(k).values()) for k in range(design.campaign.runs)])


def test_a_latin_hypercube_has_one_point_in_each_stratum():
    drawn = points(Design(parsed(SAMPLED.format("latin-hypercube", 50))))
    assert all(sorted(np.floor(50 * column).tolist()) == list(range(50)) for column in drawn.T)


def test_sobol_points_balance():
    drawn = points(Design(parsed(SAMPLED.format("sobol", 1024))))
    # A net: each of 32 x 32 boxes has exactly one point.
    assert len({(int(32 * a), int(32 * b)) for a, b in drawn}) == 1024


@pytest.mark.parametrize("method", ["random", "latin-hypercube", "sobol", "saltelli"])
def test_a_run_is_decided_by_its_number_alone(method):
    campaign = parsed(SAMPLED.format(method, 512))
    forwards, backwards = Design(campaign), Design(campaign)
    numbers = range(0, campaign.runs, 37)
    drawn = {k: backwards.values(k) for k in reversed(numbers)}
    assert [forwards.values(k) for k in numbers] == [drawn[k] for k in numbers]
    assert len({tuple(v.values()) for v in drawn.values()}) == len(drawn)


def test_saltelli_rows_differ_from_a_in_one_column_that_is_bs():
    design = Design(parsed(SAMPLED.format("saltelli", 8)))
    a, b, first, second = points(design).reshape(4, 8, 2)
    assert np.array_equal(first, np.column_stack((b[:, 0], a[:, 1])))
    assert np.array_equal(second, np.column_stack((a[:, 0], b[:, 1])))
    # The same random errors in the same row of each block.
    assert short_seed(design.seed(3)) == short_seed(design.seed(11)) == short_seed(design.seed(27))


def test_seeds_are_all_different_and_fit_the_components():
    design = Design(parsed(CALIBRATION))
    seeds = [short_seed(design.seed(k)) for k in range(2000)]
    assert len(set(seeds)) == 2000
    assert all(0 <= seed < 2**31 for seed in seeds)


@given(st.integers(1, 10**7), st.integers(10, 10**4))
def test_partitions_are_all_runs_in_order(runs, size):
    campaign = parsed(f"{HEAD}repeats = {runs}\npartition = {size}\n[calibration]\n")
    count = campaign.partitions
    assert campaign.runs_of(0)[0] == 0
    assert campaign.runs_of(count - 1)[-1] == runs - 1
    middle = count // 2
    assert middle == 0 or campaign.runs_of(middle - 1)[-1] + 1 == campaign.runs_of(middle)[0]
    assert parsed(f"{HEAD}repeats = {runs * 1000}\n[calibration]\n").partition_size <= 5000
    names = [campaign.file_name(k) for k in (0, middle, count - 1)]
    assert names == sorted(names)
