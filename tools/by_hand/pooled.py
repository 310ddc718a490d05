"""Several runs of one instrument together: shared scale factors and misalignments, biases of each run.

Runs are pooled where they are one instrument. With a bound of their readings' errors, some parameters must keep every
reading of all runs within it; else an F test asks whether they leave more together than each alone.
"""

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from fnmatch import fnmatchcase

import numpy as np
from scipy.special import chdtrc, fdtrc

from ...models.arrays import Ints
from ..calibrated import EACH_ITS_OWN, Calibration, OfRecord, PooledTest, Verdict
from ..errors import InputError
from ..records.noise import noise_bound_of
from .calibration import Bounds, HandFit, calibration_of, checked_fit, with_gyros
from .forces import SPARE, Forces, Norms, fitted_forces, scatter_of
from .moves import Windows
from .pooled_gyros import share_gyros
from .run import HandRecord, HandRequest, Run, run_of

CHANCE, GROWTH = 1e-3, 1.2
"""Runs are one instrument where chance explains the pooled residuals with a larger probability, and where these are
less than 1.2 times as large as alone."""
FEW = 30
"""Fewer rests beside the parameters grow by 1.2 by chance."""
SMALL = 1e-9


@dataclass(frozen=True, eq=False)
class PooledFit:
    """Fit of several runs.

    Attributes
    ----------
    fits : tuple of HandFit
        of each run with the shared parameters
    test : PooledTest
        whether they are one instrument
    bounds : Bounds
        of all runs together
    columns : tuple of (9,) arrays
        parameters of each run among all
    warnings : list of str
        where the gyros of the runs differ
    """

    fits: tuple[HandFit, ...]
    test: PooledTest
    bounds: Bounds
    columns: tuple[Ints, ...]
    warnings: list[str]

    def bounds_of(self, number: int) -> Bounds:
        """Return the bounds of all runs together, with the parameters of one run."""
        return self.bounds.those(self.columns[number])


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
    if request.noise_sd is not None:
        # The largest error of all their rests counts for runs that are solved together.
        noise = noise_bound_of(request.noise_sd, sum(len(run.rests) for run in runs.values()))
        runs = {label: replace(run, bound=noise.value, basis=noise.basis) for label, run in runs.items()}
    alone = []
    for label, run in runs.items():
        runs[label], fit = checked_fit(run)
        alone.append(fit)
    pooled = pooled_fit(list(runs.values()), alone, share_bias=share_bias)
    one_instrument = pooled.test.one_instrument
    of_record, calibrations = {}, []
    for number, (label, run) in enumerate(runs.items()):
        if one_instrument:
            fit, bounds = pooled.fits[number], pooled.bounds_of(number)
        else:
            fit, bounds = alone[number], _bounds_alone(run, alone[number])
        calibration = calibration_of(run, fit, bounds, request.gravity, None)
        calibrations.append(calibration)
        of_record[label] = _of_record(calibration, run, everything=not one_instrument)
    worst, of_gyros = max(calibrations, key=_pose_error), max(calibrations, key=_turn_error)
    assert worst.by_hand is not None
    assert of_gyros.by_hand is not None
    verdict: Verdict = worst.verdict
    if of_gyros.verdict == "insufficient":
        verdict = "insufficient"
    if not one_instrument or any(calibration.verdict == "falsified" for calibration in calibrations):
        verdict = "falsified"
    basis = worst.by_hand.model_copy(
        update={
            "pooled": pooled.test,
            "axes": _axes_of(runs.values()),
            "case": None,
            "turn_error": of_gyros.by_hand.turn_error,
            "turn_covariance": of_gyros.by_hand.turn_covariance,
            "sensitivity": of_gyros.by_hand.sensitivity,
            **_residuals(calibrations),
        }
    )
    bound = next(iter(runs.values())).bound
    parameters = [p for p in worst.parameters if p.symbol.startswith("gamma")]
    parameters += [p for p in of_gyros.parameters if p.symbol.startswith(("M", "S"))]
    directions = [entry for entry in worst.open if not entry.parameters[0].startswith("M")]
    directions += [entry for entry in of_gyros.open if entry.parameters[0].startswith("M")]
    warnings = list(pooled.warnings) if one_instrument else []
    for label, calibration in zip(runs, calibrations, strict=True):
        warnings += [f"{label}: {line}" for line in calibration.warnings]
    return Calibration(
        verdict=verdict,
        sigma=EACH_ITS_OWN if bound is None else worst.sigma,
        stands_with_sigma=pooled.bounds.least,
        radius=None if bound is None else pooled.bounds.least / bound,
        gravity_mps2=float(request.gravity),
        estimator=worst.estimator,
        parameters=parameters if one_instrument else [],
        priors=worst.priors,
        by_hand=basis,
        open=directions if one_instrument else [],
        of_record=of_record,
        warnings=warnings,
    )


def _axes_of(runs: Iterable[Run]) -> str:
    """Return the axes of M of all runs: those of the accelerometers where a run shows them."""
    moves = [run.moves for run in runs if run.moves is not None]
    known = [not isinstance(pieces, Windows) or pieces.case_error is not None for pieces in moves]
    return "accelerometers" if any(known) or not known else "true attitude"


def _residuals(calibrations: Sequence[Calibration]) -> Mapping[str, float | None]:
    """Return the rests, moves and turns of all runs, and their residuals: rms at rest, rms and largest of the moves."""
    bases = [calibration.by_hand for calibration in calibrations if calibration.by_hand is not None]
    moved = [basis for basis in bases if basis.residual_move is not None]
    counts = {name: sum(getattr(basis, name) for basis in bases) for name in ("rests", "moves", "turns")}
    return counts | {
        "residual_norm": _rms_of([(basis.rests, basis.residual_norm) for basis in bases]),
        "residual_move": _rms_of([(basis.moves, basis.residual_move or 0.0) for basis in moved]) if moved else None,
        "largest_move": max((basis.largest_move or 0.0 for basis in moved), default=None),
    }


def _rms_of(parts: Sequence[tuple[int, float]]) -> float:
    """Return the rms of all values by the number and the rms of those of each part."""
    counts, sizes = np.array(parts).T
    return math.sqrt(counts @ np.square(sizes) / max(counts.sum(), 1.0))


def _pose_error(calibration: Calibration) -> float:
    assert calibration.by_hand is not None
    return calibration.by_hand.pose_error.worst


def _turn_error(calibration: Calibration) -> float:
    assert calibration.by_hand is not None
    return -1.0 if calibration.by_hand.turn_error is None else calibration.by_hand.turn_error.worst


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
    bias_sets = np.zeros(len(runs), dtype=int) if share_bias else np.arange(len(runs))
    norms = _joined([fit.norms for fit in alone], bias_sets)
    forces = fitted_forces(norms)
    measured = all(run.tells_noise for run in runs)
    test = _test_of(forces, norms, alone, np.inf if measured else SPARE)
    if test.one_instrument and not runs[0].basis and any(fit.spare < SPARE for fit in alone):
        alone, forces = _with_common_scatter(runs, alone, bias_sets)
        norms = _joined([fit.norms for fit in alone], bias_sets)
    columns = [np.append(np.arange(6), 6 + 3 * number + np.arange(3)) for number in bias_sets]
    fits = []
    for run, fit, of_run in zip(runs, alone, columns, strict=True):
        covariance = forces.covariance[np.ix_(of_run, of_run)]
        pooled = Forces(forces.x[of_run], covariance, fit.forces.case, fit.forces.case_error)
        fits.append(with_gyros(run, replace(fit, forces=pooled, spare=norms.spare(forces))))
    bounds = Bounds.of(forces, norms, runs[0].bound)
    if bounds.possible is not None and runs[0].basis == "given":
        most = 1.0
        if bounds.possible.radius > 1.0:
            most = _most_alone(runs, alone)
        test = test.model_copy(update={"one_instrument": bounds.possible.radius <= most})
    fits, warnings = share_gyros(runs, fits)
    return PooledFit(tuple(fits), test, bounds, tuple(columns), warnings)


def _with_common_scatter(
    runs: Sequence[Run], alone: Sequence[HandFit], bias_sets: Ints
) -> tuple[list[HandFit], Forces]:
    """Return the fits with the scatter of all norms together, which tell more of it than each run, and their forces."""
    each = [replace(fit.norms, deviation=run.deviation) for run, fit in zip(runs, alone, strict=True)]
    norms = _joined(each, bias_sets)
    forces = fitted_forces(norms)
    measured = all(run.tells_noise for run in runs)
    scatter, chance = scatter_of(forces, norms, known=False, measured=measured)
    if scatter > 1.0:
        each = [replace(one, deviation=one.deviation * scatter) for one in each]
        forces = fitted_forces(_joined(each, bias_sets))
    fits = [replace(fit, norms=one, scatter=scatter, chance=chance) for fit, one in zip(alone, each, strict=True)]
    return fits, forces


def _bounds_alone(run: Run, fit: HandFit) -> Bounds:
    return Bounds.of(fit.forces, fit.norms, run.bound)


def _most_alone(runs: Sequence[Run], alone: Sequence[HandFit]) -> float:
    """Return the largest radius of runs together that are one instrument: 1, or more where a run alone breaks σ."""
    possible = [_bounds_alone(run, fit).possible for run, fit in zip(runs, alone, strict=True)]
    return max([1.0, *(GROWTH * one.radius for one in possible if one is not None and one.radius > 1.0)])


def _joined(norms: Sequence[Norms], bias_sets: Ints) -> Norms:
    """Return the norms of runs with the numbers of their sets of biases."""
    reading = np.vstack([of_run.reading for of_run in norms])
    deviation = np.concatenate([of_run.deviation for of_run in norms])
    return Norms(
        reading, deviation, np.repeat(bias_sets, [len(of_run.reading) for of_run in norms]), int(bias_sets.max()) + 1
    )


def _test_of(forces: Forces, norms: Norms, alone: Sequence[HandFit], rows: float) -> PooledTest:
    """Return the F test whether pooled runs leave no more than each alone.

    `rows` is the number of readings that the readings' own errors are worth, where little freedom is left alone.
    """
    square, effective = _square(forces, norms), norms.effective(forces)
    square_alone = sum(_square(fit.forces, fit.norms) for fit in alone)
    effective_alone = sum(fit.norms.effective(fit.forces) for fit in alone)
    # Less than one parameter that runs determine twice tests nothing.
    between, freedom = max(effective_alone - effective, 1.0), len(norms.reading) - effective_alone
    # With little freedom alone the readings' own errors are the measure.
    scale = 1.0
    if freedom >= SPARE:
        scale, rows = max(square_alone / freedom, SMALL), freedom
    f = max(square - square_alone, 0.0) / between / scale
    p = float(fdtrc(between, rows, f)) if np.isfinite(rows) else float(chdtrc(between, between * f))
    spare = max(len(norms.reading) - effective, 1.0)
    growth = float(np.sqrt((square / spare) / max(scale, 1.0)))
    return PooledTest(f=float(f), p=p, growth=growth, one_instrument=p > CHANCE and (growth < GROWTH or spare < FEW))


def _square(forces: Forces, norms: Norms) -> float:
    """Return the sum of squares of norms and parameters over their standard deviations."""
    return norms.square(forces.x) + float(np.square(forces.x / norms.prior).sum())
