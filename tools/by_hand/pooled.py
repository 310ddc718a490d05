"""Several runs of one instrument together: shared scale factors and misalignments, biases of each run.

Before runs are pooled, an F test asks whether they are one instrument: pooled they must not leave more than alone.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from fnmatch import fnmatchcase

import numpy as np
from numpy.typing import NDArray
from scipy.special import chdtrc, fdtrc

from ..calibrated import EACH_ITS_OWN, Calibration, OfRecord, Parameter, PooledTest
from ..errors import InputError
from ..motion.determinacy import PRIOR_SD
from ..motion.norm import norm_equations
from .calibration import HandFit, calibration_of, fit_of
from .forces import ROUNDS, SPARE, Forces
from .gyros import PRIOR as GYRO_PRIOR
from .gyros import GyroFit, fitted_gyros
from .moves import BIAS, MATRIX, SENSITIVITY
from .run import HandRecord, HandRequest, Run, run_of

CHANCE, GROWTH = 1e-3, 1.2
"""Runs are one instrument where chance explains the pooled residuals with a larger probability, and where these are
less than 1.2 times as large as alone."""
FEW = 30
"""Fewer rests beside the parameters grow by 1.2 by chance."""
SMALL = 1e-9
SHARED = slice(0, 6)
"""Parameters of the accelerometers that are the instrument's; the biases are each run's."""


@dataclass(frozen=True, eq=False)
class PooledFit:
    """Fit of several runs: of each run with the shared parameters, and the test of one instrument."""

    fits: tuple[HandFit, ...]
    test: PooledTest


def calibrate_runs_by_hand(
    records: Mapping[str, HandRecord], request: HandRequest, shared: Sequence[str] = (), own: Sequence[str] = ()
) -> Calibration:
    """Calibrate several records of one instrument without a table.

    Parameters
    ----------
    records : mapping
        label -> record, two at least
    request : HandRequest
    shared, own : sequence of str
        parameters that are shared, or each record's own, against the default: bias-* may be shared

    Raises
    ------
    InputError
        for a record that cannot be used, or parameters that cannot be shared
    """
    if own:
        raise InputError(f"--own {own[0]}: without a table only biases are each record's own")
    share_bias = _shares_biases(shared)
    if request.faces or request.turns or request.rests is not None:
        raise InputError("--faces, --turns, --rests: are of one record; say them in the columns face, turn and part")
    runs = {label: run_of(record, request) for label, record in records.items()}
    alone = [fit_of(run) for run in runs.values()]
    pooled = pooled_fit(list(runs.values()), alone, share_bias=share_bias)
    fits = pooled.fits if pooled.test.one_instrument else tuple(alone)
    of_record, calibrations = {}, []
    for (label, run), fit in zip(runs.items(), fits, strict=True):
        calibration = calibration_of(run, fit, request.gravity, with_gain=False)
        calibrations.append(calibration)
        of_record[label] = _of_record(calibration, run, everything=not pooled.test.one_instrument)
    worst = max(calibrations, key=lambda calibration: _pose_error(calibration))
    assert worst.by_hand is not None
    verdict = worst.verdict
    shared_parameters: list[Parameter] = []
    if pooled.test.one_instrument:
        shared_parameters = [p for p in worst.parameters if is_shared(p.symbol)]
        for calibration in calibrations:
            if calibration.verdict == "falsified":
                verdict = "falsified"
    else:
        verdict = "falsified"
    basis = worst.by_hand.model_copy(
        update={
            "rests": sum(len(run.rests) for run in runs.values()),
            "moves": sum(0 if run.moves is None else len(run.moves) for run in runs.values()),
            "turns": sum(0 if run.turns is None else len(run.turns) for run in runs.values()),
            "pooled": pooled.test,
        }
    )
    warnings = []
    for label, calibration in zip(runs, calibrations, strict=True):
        warnings += [f"{label}: {line}" for line in calibration.warnings]
    return Calibration(
        verdict=verdict,
        sigma=EACH_ITS_OWN if request.noise_bound is None else worst.sigma,
        radius=None,
        gravity_mps2=float(request.gravity),
        estimator=worst.estimator,
        parameters=shared_parameters,
        by_hand=basis,
        open=worst.open if pooled.test.one_instrument else [],
        of_record=of_record,
        warnings=warnings,
    )


def _pose_error(calibration: Calibration) -> float:
    assert calibration.by_hand is not None
    return calibration.by_hand.pose_error.worst


def _shares_biases(shared: Sequence[str]) -> bool:
    """Return whether biases of the accelerometers are shared; raise an InputError for other words."""
    for pattern in shared:
        if not all(fnmatchcase(f"bias-{axis}", pattern.replace("_", "-")) for axis in (1, 2, 3)):
            raise InputError(f"--shared {pattern}: without a table bias-* may be shared; all else but biases is anyway")
    return bool(shared)


def is_shared(symbol: str) -> bool:
    """Return whether a parameter is the instrument's."""
    return symbol.startswith(("gamma", "M", "S"))


def _of_record(calibration: Calibration, run: Run, *, everything: bool) -> OfRecord:
    """Return the parameters and figures that belong to one record."""
    parameters = [p for p in calibration.parameters if everything or not is_shared(p.symbol)]
    assert calibration.provenance is not None
    return OfRecord(
        sigma=calibration.sigma,
        parameters=parameters,
        by_hand=calibration.by_hand,
        provenance=calibration.provenance.model_copy(update={"record": run.record.path.name}),
    )


def pooled_fit(runs: Sequence[Run], alone: Sequence[HandFit], *, share_bias: bool = False) -> PooledFit:
    """Fit runs together and test whether they are one instrument.

    Parameters
    ----------
    runs : sequence of Run
    alone : sequence of HandFit
        of each run
    share_bias : bool
        whether the biases of the accelerometers are shared, too
    """
    deviations = [fit.deviation for fit in alone]
    x, covariance, columns = _pooled_forces(runs, deviations, share_bias)
    square, effective = 0.0, float(len(x)) - float((np.diag(covariance) / _prior(len(x)) ** 2).sum())
    square += float(np.square(x / _prior(len(x))).sum())
    square_alone = effective_alone = 0.0
    count = 0
    fits = []
    for run, fit, deviation, own in zip(runs, alone, deviations, columns, strict=True):
        forces = Forces(x[own], covariance[np.ix_(own, own)], fit.forces.case, fit.forces.case_error)
        square += _square(forces.x, run, deviation)
        square_alone += _square(fit.forces.x, run, deviation) + float(np.square(fit.forces.x / PRIOR_SD).sum())
        effective_alone += 9.0 - float((np.diag(fit.forces.covariance) / PRIOR_SD**2).sum())
        count += len(run.rests)
        gyros = None
        if run.moves is not None:
            gyros = fitted_gyros(run.rests, float(np.median(deviation)), forces, run.moves, run.turns)
        fits.append(replace(fit, forces=forces, gyros=gyros))
    between, freedom = max(effective_alone - effective, SMALL), count - effective_alone
    # With little freedom alone the readings' own errors are the measure.
    scale, rows = 1.0, np.inf
    if freedom >= SPARE:
        scale, rows = max(square_alone / freedom, SMALL), freedom
    f = max(square - square_alone, 0.0) / between / scale
    p = float(fdtrc(between, rows, f)) if np.isfinite(rows) else float(chdtrc(between, between * f))
    left = max(count - effective, 1.0)
    growth = float(np.sqrt((square / left) / max(scale, 1.0)))
    one_instrument = p > CHANCE and (growth < GROWTH or left < FEW)
    test = PooledTest(f=float(f), p=p, growth=growth, one_instrument=one_instrument)
    return PooledFit(tuple(_with_pooled_gyros(fits)), test)


def _prior(width: int) -> NDArray[np.float64]:
    """Return the prior of the shared parameters and each run's biases."""
    return np.concatenate([PRIOR_SD[SHARED], np.full(width - 6, PRIOR_SD[8])])


def _square(x: NDArray, run: Run, deviation: NDArray) -> float:
    residual, _, back = norm_equations(x, run.rests.force)
    return float(np.square(residual / (deviation * np.linalg.norm(back, axis=1))).sum())


def _pooled_forces(
    runs: Sequence[Run], deviations: Sequence[NDArray], share_bias: bool
) -> tuple[NDArray, NDArray, list[NDArray[np.int_]]]:
    """Return the shared and own parameters of accelerometers, their covariance, and each run's nine among them."""
    columns = []
    for number in range(len(runs)):
        first = 6 if share_bias else 6 + 3 * number
        columns.append(np.concatenate([np.arange(6), first + np.arange(3)]))
    width = int(columns[-1][-1]) + 1
    x, prior = np.zeros(width), _prior(width)
    matrix = np.zeros((0, width))
    for _ in range(ROUNDS):
        values, rows = [x / prior], [np.diag(1.0 / prior)]
        for run, deviation, own in zip(runs, deviations, columns, strict=True):
            residual, slopes, back = norm_equations(x[own], run.rests.force)
            weight = 1.0 / (deviation * np.linalg.norm(back, axis=1))
            block = np.zeros((len(residual), width))
            block[:, own] = slopes * weight[:, None]
            values.append(residual * weight)
            rows.append(block)
        matrix = np.vstack(rows)
        change = np.linalg.lstsq(matrix, -np.concatenate(values), rcond=None)[0]
        x = x + change
        if np.abs(change).max() < 1e-12:
            break
    return x, np.linalg.inv(matrix.T @ matrix), columns


def _with_pooled_gyros(fits: Sequence[HandFit]) -> list[HandFit]:
    """Return the fits with one M and S of the gyros: those of each run by their weights, the prior counted once."""
    gyros = [fit.gyros for fit in fits if fit.gyros is not None]
    if len(gyros) < 2:
        return list(fits)
    shared = np.arange(MATRIX.start, MATRIX.stop)
    if all(len(gyro.fitted) > MATRIX.stop for gyro in gyros):
        shared = np.arange(MATRIX.start, SENSITIVITY.stop)
    weight = np.diag(1.0 / GYRO_PRIOR[shared] ** 2)
    total, right = weight.copy(), np.zeros(len(shared))
    for gyro in gyros:
        of_run = np.linalg.inv(gyro.covariance[np.ix_(shared, shared)])
        right = right + of_run @ gyro.values[shared]
        total = total + of_run - weight
    covariance = np.linalg.inv(total)
    pooled = covariance @ right
    together = []
    for fit in fits:
        gyro = fit.gyros
        if gyro is not None:
            gyro = _conditioned(gyro, shared, pooled, covariance)
        together.append(replace(fit, gyros=gyro))
    return together


def _conditioned(gyro: GyroFit, shared: NDArray, pooled: NDArray, covariance: NDArray) -> GyroFit:
    """Return the gyros of a run with pooled parameters, and its biases as they follow from these."""
    own = np.arange(BIAS.start, BIAS.stop)
    gain = gyro.covariance[np.ix_(own, shared)] @ np.linalg.inv(gyro.covariance[np.ix_(shared, shared)])
    values = gyro.values.copy()
    values[own] += gain @ (pooled - gyro.values[shared])
    values[shared] = pooled
    spread = gyro.covariance.copy()
    of_own = gyro.covariance[np.ix_(own, own)] - gain @ gyro.covariance[np.ix_(shared, own)]
    spread[np.ix_(own, own)] = of_own + gain @ covariance @ gain.T
    spread[np.ix_(own, shared)] = gain @ covariance
    spread[np.ix_(shared, own)] = (gain @ covariance).T
    spread[np.ix_(shared, shared)] = covariance
    return replace(gyro, values=values, covariance=spread)
