"""Results of every kind with a page, each made once for all tests, and pages as their HTML."""

from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from generator.carried import POSES, strapdown_record, true_motion
from shown_bounds import Watched
from trihedron.tools import reports
from trihedron.tools.calibration import calibrate
from trihedron.tools.diagnosis import diagnose
from trihedron.tools.document import Page, html
from trihedron.tools.planning import optimal_plans
from trihedron.tools.records import PositionRecord
from trihedron.tools.result import Result
from trihedron.tools.trials import NOISE_BOUND, Options, draw_alone, draw_case

NEAR_THE_LEAST = Options(strapdown=True, effects=("quadratic",), size=(1.0, 2.0))
"""A quadratic term that a moved block cannot separate from an asymmetric scale factor."""
MATRIX = np.array([[0.0, 3e-3, 0.0], [0.0, 0.0, 0.0], [-2e-3, 0.0, 0.0]])


@cache
def clean() -> PositionRecord:
    """Return a bench without effects."""
    return draw_alone(5, effects=[]).measured()


def few(count: int) -> PositionRecord:
    """Return too few positions of it."""
    return clean().selected(np.arange(count))


@cache
def bent() -> PositionRecord:
    """Return a bench with a quadratic term."""
    return draw_alone(501, effects=["quadratic"]).measured()


def with_power(p: int, coefficient: float, power: int) -> PositionRecord:
    """Return the clean bench with a power of its input added to accelerometer p."""
    record = clean().selected(np.arange(len(clean())))
    n = calibrate(record, noise_bound=NOISE_BOUND).linearised.input
    record.specific_force[:, p] += 9.80665 * coefficient * n[:, p] ** power
    return record


def _calibrated(record: PositionRecord) -> tuple[Result, PositionRecord]:
    return calibrate(record, noise_bound=NOISE_BOUND), record


def _diagnosed(record: PositionRecord, **options: Any) -> tuple[Result, PositionRecord]:
    return diagnose(record, noise_bound=NOISE_BOUND, **options), record


MAKERS: dict[str, Callable[[], tuple[Result, Any]]] = {
    "calibration, consistent": lambda: _calibrated(clean()),
    "calibration, falsified": lambda: _calibrated(bent()),
    "calibration, insufficient": lambda: _calibrated(few(4)),
    "bench, consistent": lambda: _diagnosed(clean()),
    "bench, explained": lambda: _diagnosed(bent(), rerun=False),
    "bench, explained, with its gain": lambda: _diagnosed(with_power(2, 8e-4, 2)),
    "bench, ambiguous": lambda: _diagnosed(with_power(1, 1.5e-4, 3)),
    "bench, unexplained": lambda: _diagnosed(with_power(0, 5e-3, 5)),
    "bench, insufficient": lambda: _diagnosed(few(4)),
    "block, explained": lambda: (
        diagnose(strapdown_record(gyro_bias=np.array([0.01, -0.02, 0.005]), sensitivity=MATRIX, seed=3)),
        None,
    ),
    "block, ambiguous": lambda: (diagnose(draw_case(NEAR_THE_LEAST, 4, 4).measured()), None),
    "block, insufficient": lambda: (diagnose(strapdown_record(true_motion(POSES[:1]))), None),
    "plan": lambda: (optimal_plans(("X4",), grid=15.0), None),
    "plans": lambda: (optimal_plans(("X4", "X6+X8"), grid=15.0), None),
}


WATCHED: dict[str, Watched] = {name: Watched() for name in MAKERS}
"""Rounded numbers of each document."""


@cache
def shown(name: str) -> tuple[Any, Any]:
    """Return a result, and its record if it has one."""
    result, record = MAKERS[name]()
    assert getattr(result, "verdict", "") in name
    return result, record


@cache
def page_of(name: str) -> Page:
    """Return the text of its page, with all sections made."""
    with WATCHED[name]():
        page = reports.page_of(*shown(name))
        assert page is not None
        assert page.sections
        return page


@cache
def text_of(name: str) -> str:
    """Return the HTML of its page."""
    return html(page_of(name))


def html_of(make: Callable[..., Page], *arguments: Any, folder: Path | None = None, **options: Any) -> str:
    """Return the HTML of the page that `make` returns."""
    return html(make(*arguments, **options), folder)
