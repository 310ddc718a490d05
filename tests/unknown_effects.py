"""Ten effects outside the catalogue, on records of the suite's benches, and the distance of its best sets of three."""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from trihedron.fmus.units import STANDARD_GRAVITY
from trihedron.models.effects import Rows
from trihedron.tools.bounded import chebyshev_radius
from trihedron.tools.calibration import Asked, fit_record
from trihedron.tools.diagnosis import Diagnosis, diagnose
from trihedron.tools.evidence import Visits, circumstances_of, signature_columns
from trihedron.tools.records import PositionRecord
from trihedron.tools.trials import NOISE_BOUND, Case, Options, draw_case
from trihedron.tools.trials.hiding import classes_with

LEAST_RADIUS = 1.5
"""Least radius of the catalogue's best set of three, in units of σ."""
BEAM = 40
"""Number of best singles and pairs that are grown."""
EXACT = 12
"""Number of best triples, by least squares, that are judged exactly."""


def on(p: int, values: NDArray) -> NDArray:
    """Return values (N,) on one accelerometer (N, 3)."""
    return values[:, None] * (np.arange(3) == p)


def wrapped(angle: NDArray) -> NDArray:
    return np.remainder(angle + np.pi, 2.0 * np.pi) - np.pi


def product(p: int, rows: Rows) -> NDArray:
    return on(p, rows.n.prod(axis=1))


def fifth_power(p: int, rows: Rows) -> NDArray:
    return on(p, rows.n[:, p] ** 5)


def square_times_other(p: int, rows: Rows) -> NDArray:
    return on(p, rows.n[:, p] ** 2 * rows.n[:, (p + 1) % 3])


def bump(p: int, rows: Rows) -> NDArray:
    return on(p, np.exp(-((wrapped(rows.alpha - 1.1) / np.radians(12.0)) ** 2)))


def resonance(p: int, rows: Rows) -> NDArray:
    away, width = wrapped(rows.alpha - 2.3), np.radians(20.0)
    return on(p, away * width / (away**2 + width**2))


def pulse_in_time(p: int, rows: Rows) -> NDArray:
    """Return a bias that jumps, and jumps back."""
    return on(p, np.where(np.abs(rows.hours / rows.hours[-1] - 0.55) < 0.2, 1.0, -1.0))


def slow_oscillation(p: int, rows: Rows) -> NDArray:
    return on(p, np.sin(2.0 * np.pi * 2.7 * rows.hours / rows.hours[-1]))


def ninth_harmonic(p: int, rows: Rows) -> NDArray:
    return rows.by_alpha * np.sin(9.0 * rows.alpha + 0.4)[:, None]


def of_both_angles(p: int, rows: Rows) -> NDArray:
    return on(p, np.cos(2.0 * rows.alpha + 0.3) * np.sin(3.0 * rows.beta))


def every_other_row(p: int, rows: Rows) -> NDArray:
    return on(p, np.where(np.arange(len(rows.hours)) % 2 == 0, 1.0, -1.0))


UNKNOWN: tuple[Callable[[int, Rows], NDArray], ...] = (
    product,
    fifth_power,
    square_times_other,
    bump,
    resonance,
    pulse_in_time,
    slow_oscillation,
    ninth_harmonic,
    of_both_angles,
    every_other_row,
)
"""Accelerometer, rows -> change of the readings (N, 3) [g] for an amplitude of one."""
WANDERING = (pulse_in_time, slow_oscillation)
"""Of them those that the catalogue's wander of a bias describes, at their accelerometer."""


@dataclass(frozen=True)
class UnknownCase:
    """A record with an effect outside the catalogue, and the accelerometer whose bias it lets wander, if any."""

    case: Case
    record: PositionRecord
    name: str
    nearest: float
    wander: str | None

    def is_described(self, result: Diagnosis) -> bool:
        """Return True if a result names a wander of the bias of this accelerometer, and nothing else."""
        places = [(cause.effect, cause.where) for cause in result.causes]
        return self.wander is not None and places == [("bias-wander", self.wander)]


def draw_unknown(seed: int, index: int, positions: tuple[int, int]) -> UnknownCase:
    """Draw an unknown effect for which the catalogue's best set of three leaves at least 1.5 σ, but not many times
    that.

    An independent search and the diagnosis itself, with 1.5 σ for the noise bound, confirm it: if the two disagreed,
    one of them would have missed a set.
    """
    rng = np.random.default_rng([seed, index])
    effect = UNKNOWN[index % len(UNKNOWN)]
    for attempt in range(20):
        case = draw_case(Options("clean", positions=positions), seed, 1000 * index + attempt)
        clean = case.measured()
        p = int(rng.integers(3))
        bench = case.instrument
        fit = fit_record(clean, NOISE_BOUND, Asked(baseline=bench.baseline, mounting=bench.matrices))
        rows = Visits.of(fit, circumstances_of(clean)).rows(fit.point)
        change = effect(p, rows)
        far = nearest_triple(case, clean, change)
        if far < 1e-3:
            continue
        amplitude = rng.uniform(1.8, 4.0) * NOISE_BOUND / far
        for _ in range(6):
            record = replace(clean, specific_force=clean.specific_force + STANDARD_GRAVITY * amplitude * change)
            radius = nearest_triple(case, record) / NOISE_BOUND
            if amplitude < 1e-2 and radius >= LEAST_RADIUS and is_beyond_three(case, record):
                wander = f"accelerometer-{p + 1}" if effect in WANDERING else None
                return UnknownCase(case, record, effect.__name__, radius, wander)
            amplitude *= 1.25
    raise AssertionError(f"{effect.__name__}: no bench shows it")


def is_beyond_three(case: Case, record: PositionRecord) -> bool:
    """Return True if no set of three keeps every residual within 1.5 σ."""
    bench = case.instrument
    bound = LEAST_RADIUS * NOISE_BOUND
    wide = diagnose(record, noise_bound=bound, baseline=bench.baseline, mounting=bench.matrices, rerun=False)
    return wide.verdict == "unexplained"


def nearest_triple(case: Case, record: PositionRecord, change: NDArray | None = None) -> float:
    """Return the least distance [g] of a record's residual, or of a change, from the model with three effects.

    A beam search grows singles, pairs and triples, outliers among them, by least squares; the Chebyshev programme
    judges the best triples. Its result is an upper bound of the true least distance.
    """
    bench = case.instrument
    fit = fit_record(record, NOISE_BOUND, Asked(baseline=bench.baseline, mounting=bench.matrices))
    rows = Visits.of(fit, circumstances_of(record)).rows(fit.point)
    residual = fit.residual if change is None else change.ravel()
    effects = [signature_columns([p], rows) for p in classes_with(bench.mountings, symmetric=bench.symmetric).places]
    columns = effects + [np.eye(len(residual), 1, -k) for k in range(len(residual))]
    q = np.linalg.qr(fit.jacobian / np.abs(fit.jacobian).max(axis=0))[0]
    beam: list[tuple[int, ...]] = [()]
    for size in range(3):
        grown = {}
        for chosen in beam:
            with_chosen = np.hstack([q, *(columns[i] for i in chosen)])
            basis = np.linalg.svd(with_chosen / np.linalg.norm(with_chosen, axis=0), full_matrices=False)[0]
            remaining = residual - basis @ (basis.T @ residual)
            free = np.maximum(1.0 - np.sum(basis**2, axis=1), 1e-9)
            gains = [taken_by(c - basis @ (basis.T @ c), remaining) for c in effects] + list(remaining**2 / free)
            for i, off in enumerate(gains):
                many = sum(k >= len(effects) for k in (*chosen, i)) > 2
                if i not in chosen and not many:
                    grown[tuple(sorted((*chosen, i)))] = remaining @ remaining - off
        beam = sorted(grown, key=lambda key: grown[key])[: BEAM if size < 2 else EXACT]
    bound = np.full(len(residual), 1.0)
    return min(
        chebyshev_radius(np.hstack([fit.jacobian, *(columns[i] for i in chosen)]), residual, bound)[0]
        for chosen in beam
    )


def taken_by(columns: NDArray, left: NDArray) -> float:
    """Return the reduction of a sum of squares by columns."""
    u, values, _ = np.linalg.svd(columns, full_matrices=False)
    retained = u[:, values > 1e-6 * max(float(values.max(initial=0.0)), 1e-3)]
    return float(np.sum((retained.T @ left) ** 2))
