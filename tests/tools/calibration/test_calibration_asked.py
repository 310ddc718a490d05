"""The options of a calibration: expressions of targets, mountings; and refusals."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from generator import G as GRAVITY
from generator.stands import ALPHA, BETA, random_bench, record, simulated
from trihedron.tools.calibration import (
    IN_TARGETS,
    PRESETS,
    asked_targets,
    calibrate,
    convention_targets,
    expression_weights,
    mountings_for,
    parametrise,
)
from trihedron.tools.errors import InputError

ONE = parametrise({"identity": np.eye(3)})
TWO_MATRICES = {"a": np.eye(3), "a-b": PRESETS["cyclic"]}
TWO = parametrise(TWO_MATRICES)
X = {f"X{i}": expression_weights(f"X{i}", ONE) for i in range(1, 19)}


def test_the_eighteen_x_are_independent_and_combine_to_the_targets():
    assert np.linalg.matrix_rank(np.array(list(X.values()))) == 18
    for symbol, w in zip(ONE.symbols, np.eye(18), strict=True):
        np.testing.assert_array_equal(expression_weights(symbol, ONE), w)
    assert set(IN_TARGETS) | set(ONE.symbols) >= {"X6", "X7", "X8", "X11", "X12", "X13"}


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("X4-X5", X["X4"] - X["X5"]),
        ("2*X4 + X6/3 - 0.5*X12", 2 * X["X4"] + X["X6"] / 3 - 0.5 * X["X12"]),
        ("(X7-X12)/2", (X["X7"] - X["X12"]) / 2),
        ("-(X1 - 2*(X2 + X3))*1e-1", -0.1 * (X["X1"] - 2 * (X["X2"] + X["X3"]))),
        ("  +X18*(1+1)/.5 ", 4 * X["X18"]),
        ("X4/2e0", X["X4"] / 2),
    ],
)
def test_expressions_are_read(text, expected):
    np.testing.assert_allclose(expression_weights(text, ONE), expected, rtol=1e-15)


@pytest.mark.parametrize(
    "text",
    [
        *("", " ", "X", "X0", "X19", "X04", "x4", "4", "X4+1", "X4*X5", "1/X4", "X4/0", "X4-X4", "X4 X5", "X4+", "(X4"),
        *(
            "X4)",
            "X4;X5",
            "__import__('os')",
            "X4**2",
            "X4@b",
            "X4@identity",
            "1e400*X4",
            "1e300*1e300*X4",
            "1e10*X4",
            "X" * 600,
        ),
        *("(" * 80 + "X4" + ")" * 80, "-" * 400 + "X4", "X111", "nan*X4", "X4,X5", "X٤", "2X4"),
    ],
)
def test_rubbish_is_refused_in_one_line(text):
    with pytest.raises(InputError) as refusal:
        expression_weights(text, ONE)
    assert "\n" not in str(refusal.value)
    assert str(refusal.value).startswith("--target ")


@given(st.text(alphabet="X0123456789+-*/(). @ae\t\n", max_size=30))
def test_any_text_gives_weights_or_one_line(text):
    for p in (ONE, TWO):
        try:
            weights = expression_weights(text, p)
        except InputError as refusal:
            message = str(refusal)
        else:
            message = ""
            assert np.isfinite(weights).all()
        assert "\n" not in message


def test_with_several_mountings_what_differs_needs_a_name():
    for text in ("X8", "X6", "X12-X8", "X8@c", "X4@a"):
        with pytest.raises(InputError):
            expression_weights(text, TWO)
    for text, symbol in (("X8@a-b", "X8@a-b"), ("X8@a", "X8@a"), ("0-X12@a", "-X12@a"), ("X6+X8", "X6+X8")):
        np.testing.assert_array_equal(expression_weights(text, TWO), np.eye(21)[TWO.symbols.index(symbol)])
    np.testing.assert_array_equal(expression_weights("X6@a + X8@a", TWO), expression_weights("X6+X8", TWO))
    assert [t.symbol for t in convention_targets(TWO, "A2")][12:15] == [
        "(X8@a-X6@a)/2",
        "(X7@a-X12@a)/2",
        "(X13@a-X11@a)/2",
    ]


def test_the_symmetric_baseline_has_no_targets_of_negative_input():
    symmetric = parametrise({"identity": np.eye(3)}, symmetric=True)
    assert len(symmetric.symbols) == 15
    with pytest.raises(InputError, match="X4 stands for both signs"):
        expression_weights("X4-X5", symmetric)


def test_names_and_units_of_what_is_asked():
    targets = asked_targets(["X9 - X10", "X6", "X16-X17", "X1+X16", "-X12"], ONE)
    assert [(t.symbol, t.name, t.unit) for t in targets] == [
        ("X9 - X10", "scale-factor-asymmetry-2", "1"),
        ("X6", "linear-combination", "rad"),
        ("X16-X17", "linear-combination", "g"),
        ("X1+X16", "linear-combination", "mixed"),
        ("-X12", "mounting-error-2", "rad"),
    ]


def block(mounting=None):
    return record(np.ones((2, 3)) / 3**0.5, [0.0, 1.0], [0.0, 1.0], mounting)


def test_presets_are_rotations():
    for q in PRESETS.values():
        np.testing.assert_allclose(q @ q.T, np.eye(3), atol=1e-15)
        assert np.linalg.det(q) == pytest.approx(1.0)
    tripod = PRESETS["tripod"] @ np.array([1.0, 0.0, 0.0])
    assert abs(tripod[0]) == pytest.approx(np.sqrt(2 / 3))


def test_a_file_gives_the_mountings_that_the_record_names(tmp_path):
    path = tmp_path / "q.toml"
    path.write_text("[up]\nmatrix = [[1,0,0],[0,1,0],[0,0,1]]\n[down]\nmatrix = [[1,0,0],[0,-1,0],[0,0,-1]]\n")
    mountings = mountings_for(block(["down", "up"]), str(path))
    assert list(mountings) == ["down", "up"]
    np.testing.assert_array_equal(mountings["down"], np.diag([1.0, -1.0, -1.0]))
    with pytest.raises(InputError, match=r"row 2, column mounting.*'upp'.*did you mean 'up'"):
        mountings_for(block(["up", "upp"]), str(path))
    with pytest.raises(InputError, match="no column mounting"):
        mountings_for(block(), str(path))


def test_presets_and_the_column_mounting():
    assert list(mountings_for(block(), "identity")) == ["identity"]
    assert list(mountings_for(block(["cyclic", "identity"]), "identity")) == ["cyclic", "identity"]
    np.testing.assert_array_equal(mountings_for(block(["rig", "rig"]), "tripod")["rig"], PRESETS["tripod"])
    for option, column in (("identity", ["a", "b"]), ("cyclic", ["identity", "identity"]), ("cyclic", ["a", "b"])):
        with pytest.raises(InputError, match="TOML"):
            mountings_for(block(column), option)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("[a]\nmatrix = [[1,0,0],[0,1,0]]", "three rows"),
        ("[a]\nmatrix = [[1,0],[0,1],[0,0]]", "three rows"),
        ("[a]\nmatrix = 3", "three rows"),
        ('[a]\nmatrix = [[1,0,0],[0,"1",0],[0,0,1]]', "numbers"),
        ("[a]\nmatrix = [[1,0,0],[0,nan,0],[0,0,1]]", "between"),
        (f"[a]\nmatrix = [[1{'0' * 400},0,0],[0,1,0],[0,0,1]]", "between"),
        ("[a]\nmatrix = [[1,0,0],[0,1,0],[0,0,1.00001]]", "row 3 has length 1.00001"),
        ("[a]\nmatrix = [[1,0,0],[0,1,0],[0.00001,0,1]]", "not perpendicular"),
        ("[a]\nmatrix = [[0,1,0],[1,0,0],[0,0,1]]", "reflection"),
        ("[a]\nmatrix = [[1,0,0],[0,1,0],[0,0,1]]\nextra = 1", "'extra'"),
        ("[a]\n", "has no matrix"),
        ("a = 1", "outside"),
        ("", "no mounting"),
        ("[a]\n[a]\n", "line 2"),
        (f"[a]\nmatrix = [[1{'0' * 5000},0,0],[0,1,0],[0,0,1]]", "not TOML"),
    ],
)
def test_bad_files_are_refused_in_one_line(tmp_path, text, message):
    path = tmp_path / "q.toml"
    path.write_text(text)
    with pytest.raises(InputError, match=message) as refusal:
        mountings_for(block(["a", "a"]), str(path))
    assert "\n" not in str(refusal.value)
    assert str(path) in str(refusal.value)


def test_unreadable_files_are_refused(tmp_path):
    (tmp_path / "latin.toml").write_bytes(b"[\xe4]\n")
    for path in (tmp_path, tmp_path / "none.toml", tmp_path / "latin.toml"):
        with pytest.raises(InputError, match="--mounting"):
            mountings_for(block(), str(path))


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"noise_bound": 0.0}, "--noise-bound 0: must be"),
        ({"noise_bound": -1e-5}, "--noise-bound"),
        ({"noise_bound": float("nan")}, "--noise-bound"),
        ({"noise_bound": 1.0}, "--noise-bound 1: must be"),
        ({"gravity": 0.0}, "--gravity"),
        ({"gravity": float("inf")}, "--gravity"),
        ({"gravity": 1e-300}, "--gravity 1e-300: must be from 4.9 to 14.7"),
        ({"gravity": float("nan")}, "--gravity"),
        ({"convention": "A3"}, "--convention A3: must be A1 or A2"),
        ({"baseline": "linear"}, "--baseline linear"),
        ({"bounds": (0.1, float("nan"))}, "--bounds"),
        ({"bounds": (-1e-3, 1e-2)}, "--bounds"),
        ({"mounting": "cyclik"}, "did you mean 'cyclic'"),
        ({"noise_bound": None}, "give --noise-sd"),
        ({"priors": ["X4"]}, "write a combination and its greatest size"),
        ({"priors": ["X4="]}, "is not a positive number"),
        ({"priors": ["X4=0"]}, "is not a positive number"),
        ({"priors": ["X4=nan"]}, "is not a positive number"),
        ({"priors": ["X4=1e-300"]}, "1e-300 is below 1e-12"),
        ({"priors": ["X4=-1e-3"]}, "is not a positive number"),
        ({"priors": ["X19=1"]}, "--prior 'X19': there is no X19"),
        ({"priors": ["=1"]}, "--prior ''"),
        ({"mounting": TWO_MATRICES}, "no column mounting"),
        ({"mounting": {"q": 1.001 * np.eye(3)}}, "not orthogonal"),
        ({"mounting": {"q": np.diag([1.0, 1.0, -1.0])}}, "reflection"),
        ({"mounting": {"q": [[1.0, 0.0, 0.0], [0.0]]}}, "three rows"),
    ],
)
def test_options_out_of_range_are_refused_in_one_line(options, message):
    with pytest.raises(InputError, match="(?s)" + message.replace("(", r"\(")) as refusal:
        calibrate(simulated(np.zeros(24)), **{"noise_bound": 1e-5, **options})
    assert "\n" not in str(refusal.value)


@pytest.mark.parametrize(
    ("factor", "message"),
    [
        (0.0, "column f2_mps2: reads 0 times what the table gives.*dead"),
        (-1.0, "read with --channels 1,-2,3"),
        (2.0, "f2_mps2.*the unit"),
    ],
)
@pytest.mark.parametrize("baseline", ["asymmetric", "symmetric"])
def test_a_dead_or_reversed_accelerometer_is_refused(factor, message, baseline):
    sound = simulated(random_bench(np.random.default_rng(1))).specific_force / GRAVITY
    reading = sound * [1.0, factor, 1.0] + np.random.default_rng(3).uniform(-1e-5, 1e-5, sound.shape)
    with pytest.raises(InputError, match=message):
        calibrate(
            record(reading, ALPHA, BETA), noise_bound=1e-2 if baseline == "symmetric" else 1e-5, baseline=baseline
        )


@pytest.mark.parametrize("baseline", ["asymmetric", "symmetric"])
def test_an_accelerometer_that_stands_still_is_said_to_be_dead_whatever_the_noise_bound(baseline):
    """With one scale factor for each, the fit went where its misfit is infinite, and the noise bound was blamed."""
    reading = simulated(random_bench(np.random.default_rng(1))).specific_force / GRAVITY * [1.0, 0.0, 1.0]
    with pytest.raises(InputError, match=r"column f2_mps2: reads 0 times what the table gives.*dead"):
        calibrate(record(reading, ALPHA, BETA), noise_bound=1e-5, baseline=baseline)


@pytest.mark.first(1)
@pytest.mark.parametrize("seed", [28, 45, 81])
def test_a_step_so_long_that_its_misfit_is_infinite_is_halved_without_a_warning(seed):
    """With random readings the fit reaches a point at which a square overflows."""
    reading = np.random.default_rng(seed).uniform(-1.0, 1.0, (len(ALPHA), 3))
    with pytest.raises(InputError, match=r"does not converge|noise-bound"):
        calibrate(record(reading, ALPHA, BETA), noise_bound=1e-5, baseline="symmetric")
