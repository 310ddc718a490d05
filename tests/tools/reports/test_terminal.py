"""The answer of a diagnosis fits a screen of 25 lines of 80 columns, whatever the verdict."""

import pytest

from generator import SIGMA
from generator.wrong_rows import with_wrong_rows, with_wrong_stretch
from page_text import shown
from trihedron.tools.diagnosis import Diagnosis, diagnose

SHOWN = ("bench, explained", "bench, explained, with its gain", "bench, unexplained", "block, explained",
         "block, ambiguous", "block, insufficient")  # fmt: skip


def fits(diagnosis: Diagnosis) -> bool:
    """Whether a diagnosis fits the screen."""
    lines = str(diagnosis).splitlines()
    return len(lines) <= 25 and max(len(line) for line in lines) <= 80


@pytest.mark.parametrize("name", SHOWN)
def test_every_verdict_fits_the_screen(name):
    diagnosis = shown(name)[0]
    assert fits(diagnosis)
    assert str(diagnosis).splitlines()[-1] == "All figures: add --report page.html, or --json FILE."
    if diagnosis.gain is not None:
        assert "\nGain: " in str(diagnosis)


@pytest.mark.parametrize("what", ["disturbed", "angle"])
def test_wrong_rows_fit_the_screen_and_say_what_to_do(what):
    diagnosis = diagnose(with_wrong_rows(4, what, 24, 3).record, noise_bound=SIGMA, rerun=False)
    assert fits(diagnosis)
    assert "Next:        Check rows " in str(diagnosis)


def test_a_stretch_fits_the_screen():
    diagnosis = diagnose(with_wrong_stretch(4, "channels exchanged", 36, 7).record, noise_bound=SIGMA, rerun=False)
    assert fits(diagnosis)
    assert "exchanged" in str(diagnosis).partition("Evidence:")[0]
