"""A given bound of the true attitude's error: its consequences, its assumptions, and impossible values."""

import re
from dataclasses import replace
from html import unescape

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from generator.carried import camera_attitude, drawn_motion, slow_noise, strapdown_record
from trihedron.tools.diagnosis import Diagnosis, diagnose
from trihedron.tools.document import html
from trihedron.tools.errors import InputError
from trihedron.tools.evidence import Carried, Truth, carried_evidence
from trihedron.tools.records import StrapdownRecord
from trihedron.tools.reports import page_of

ARCMIN = np.pi / 180.0 / 60.0
PERIOD, ERROR = 0.02, 8.0
"""Time between the rows [s], and largest error of the cameras, only in motion [arcmin]."""
GAMMA = np.array([[8e-3, -6e-3, 4e-3], [5e-3, -9e-3, 7e-3], [-4e-3, 6e-3, 1e-2]])
"""Errors of scale and misalignment of the gyros."""


def filmed(*, in_motion: float = ERROR, cameras: float = 0.1, moves: int = 24, seed: int = 4) -> StrapdownRecord:
    """Return a record with errors of the gyros' scale, before cameras that err in motion, at most by this [arcmin].

    At rest, and in motion too, they have noise of `cameras` [arcmin].
    """
    rng = np.random.default_rng(seed)
    time, rate, n, attitude = drawn_motion(rng, moves=moves, rest=3.0, period=PERIOD)
    motion = (time, rate @ (np.eye(3) + GAMMA).T + slow_noise(rng, len(time), 2e-5), n)
    record = strapdown_record(motion, seed=seed, gyro_bias=rng.uniform(-0.01, 0.01, 3), rate_noise=7e-4)
    moving = np.minimum(1.0, np.linalg.norm(rate, axis=1, keepdims=True))
    direction = rng.standard_normal((len(time), 3))
    direction /= np.linalg.norm(direction, axis=1, keepdims=True)
    filmed_attitude = attitude * Rotation.from_rotvec(in_motion * ARCMIN * moving * direction)
    return replace(record, attitude=camera_attitude(rng, filmed_attitude, cameras * ARCMIN))


@pytest.fixture(scope="module")
def record() -> StrapdownRecord:
    return filmed()


@pytest.fixture(scope="module")
def without(record) -> Diagnosis:
    return diagnose(record, rerun=False)


@pytest.fixture(scope="module")
def least(without) -> float:
    """Return the bound that the helpful effects need [arcmin]."""
    return needed((without.not_named or ("",))[-1])


@pytest.fixture(scope="module")
def narrow(record, least) -> Diagnosis:
    return diagnose(record, rerun=False, reference_bound=least)


def too_large(result: Diagnosis) -> list[str]:
    """Return the texts on errors that all effects together leave."""
    return [text for text in result.not_named or () if "all effects of the catalogue together" in text]


def flowing(result: Diagnosis) -> str:
    """Return the terminal's text without its line ends."""
    return " ".join(str(result).split())


def needed(text: str) -> float:
    return float(re.findall(r"have to err by ([0-9.]+) arcmin or more at a row", text)[0])


@pytest.mark.acceptance
def test_without_it_the_objection_says_what_the_true_attitude_would_have_to_err_by(without):
    assert (without.verdict, without.causes) == ("unexplained", ())
    (objection,) = too_large(without)
    scatter = float(re.findall(r"at rest it scatters by ([0-9.]+)", objection)[0])
    # The cameras err by this at most: no more is needed.
    assert 0.1 < scatter < 0.25 * needed(objection) < 0.25 * (ERROR + 0.5)
    assert objection[:80] in flowing(without)
    page = page_of(without)
    assert page is not None
    assert objection in unescape(html(page))
    helps = (without.not_named or ("",))[-1]
    assert needed(objection) <= needed(helps) <= ERROR + 0.5
    assert without.reference_bound_arcmin is None


@pytest.mark.acceptance
def test_with_the_true_bound_the_effect_is_named_and_on_whose_word_is_said(record, least, narrow):
    result = diagnose(record, rerun=False, reference_bound=ERROR + 0.5)
    assert (result.verdict, [cause.effect for cause in result.causes]) == ("explained", ["gyro-scale-misalignment"])
    for (low, high), true in zip(result.causes[0].intervals, GAMMA.ravel(), strict=True):
        assert low <= true <= high
    assert result.calibration.sigma.basis == (
        "the noise of the gyros at rest, Earth's rate, and the true attitude's error at a row, as stated: 8.5 arcmin"
    )
    assert result.to_json()["reference_bound_arcmin"] == pytest.approx(8.5)
    proviso = "his holds if the true attitude errs by 8.5 arcmin at most at any row, as stated"
    # A smaller bound would be enough, but its intervals would miss the truth.
    assert least < 0.7 * ERROR
    assert f"less than {least:.2f} would not do" in flowing(result)
    ends = zip(narrow.causes[0].intervals, GAMMA.ravel(), strict=True)
    assert not all(low <= true <= high for (low, high), true in ends)
    assert proviso in flowing(result)


@pytest.mark.acceptance
def test_a_record_that_is_consistent_by_what_is_stated_says_so():
    # In radians it differs from the given number.
    result = diagnose(filmed(in_motion=0.0), rerun=False, reference_bound=303.447)
    assert result.verdict == "consistent"
    assert "as stated: 303.447 arcmin" in result.evidence.reader.bounds_from
    assert "as stated" in flowing(result)


@pytest.mark.acceptance
@pytest.mark.parametrize("part", [1.0, 0.9])
def test_what_is_needed_is_enough_and_less_is_not(record, without, part):
    (objection,) = too_large(without)
    stated = round(part * needed(objection), 6)
    result = diagnose(record, rerun=False, reference_bound=stated)
    if part == 1.0:
        assert too_large(result) == []
        return
    assert result.verdict == "unexplained"
    (again,) = too_large(result)
    assert needed(again) == needed(objection)
    assert f"{stated:g} is stated" in again
    assert "as stated explain" in again


@pytest.mark.acceptance
@pytest.mark.parametrize("effect", ["", "gyro-scale-misalignment"])
def test_the_bound_with_which_the_model_would_stand_is_the_least(record, without, effect):
    (offered,) = [
        entry.option for entry in without.stands_with or () if effect == " ".join(e.effect for e in entry.effects)
    ]
    stated = float(offered.removeprefix("--reference-bound "))
    verdicts = []
    for part in (1.0, 0.97):
        evidence = carried_evidence(record, reference_bound=part * stated)
        places = [place for place in evidence.rows.places if place.effect == effect]
        verdicts.append(evidence.model.refit(places).radius <= 1.0)
    assert verdicts == [True, False]


@pytest.mark.acceptance
def test_with_the_effects_that_help_what_they_need_is_enough(narrow):
    assert not any("were that all" in text for text in narrow.not_named or ())
    assert narrow.verdict == "explained"


@pytest.mark.acceptance
def test_it_enters_at_both_ends_of_each_window_and_takes_nothing_from_what_the_record_shows():
    record = filmed(moves=8)
    none, zero, five, nine = (
        np.concatenate([part.bound for part in carried_evidence(record, reference_bound=bound).rows.parts])
        for bound in (None, 0.0, 5.0, 9.0)
    )
    np.testing.assert_allclose(nine - five, 2.0 * 4.0 * ARCMIN, rtol=1e-9)
    assert (zero >= none).all()
    assert (five > zero).all()


@pytest.mark.acceptance
def test_what_it_scatters_by_at_rest_is_of_one_row():
    """Each of two rows errs by at least half of their difference."""
    exact = filmed(in_motion=0.0, cameras=0.0, moves=8)
    signs = np.random.default_rng(0).choice([-1.0, 1.0], len(exact.time_s))
    assert exact.attitude is not None
    turned = Rotation.from_quat(np.roll(exact.attitude, -1, axis=1)) * Rotation.from_rotvec(
        np.outer(signs, [1.5 * ARCMIN, 0.0, 0.0])
    )
    evidence = carried_evidence(replace(exact, attitude=np.roll(turned.as_quat(), 1, axis=1)))
    assert isinstance(evidence.model, Carried)
    assert isinstance(evidence.model.reference, Truth)
    assert evidence.model.reference.at_rest == pytest.approx(1.5 * ARCMIN, rel=1e-6)


@pytest.mark.parametrize("bound", [-1.0, float("nan"), float("inf")])
def test_a_bound_that_is_none_is_refused(record, bound):
    with pytest.raises(InputError, match=r"^--reference-bound .*: must be finite and not below 0, in arcminutes$"):
        diagnose(record, reference_bound=bound)


def test_a_record_without_true_attitude_has_no_error_of_it(record):
    with pytest.raises(InputError, match=r"^[^\n]*--reference-bound is of a record with true attitude[^\n]*$"):
        diagnose(replace(record, attitude=None), reference_bound=5.0)
