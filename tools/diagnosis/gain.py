"""What an extension gains: positions that were not used to find it, simulated without and with it."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..calibration.model import Linearisation, Positions, linearise
from .circumstances import Circumstances
from .disturbance import added_bound, disturbed, rows_at
from .extended_fit import ExtendedFit, fit_nearest
from .extension import STEPS_PER_GAP, simulate_rows, smallest_gap

HELD_OUT_EVERY = 4
"""One position in so many is held out."""
FEWEST_SCORED = 3
MAX_LEVERAGE = 1.0
"""A held-out reading is scored when its prediction is at most so many times as uncertain (rms) as a reading."""
MAX_STEPS = 100_000
"""A record whose rows crowd together within a long time is not simulated again."""


@dataclass(frozen=True)
class Gain:
    """What the extension does to readings that were not used to find its size.

    Attributes
    ----------
    positions : (H,) array of int
        rows of the record that were held out
    scored : (H, 3) array of bool
        readings that the others predict well enough to be scored
    before, after : (H, 3) array
        measurement less simulation, fractions of g, without and with the effect
    """

    positions: NDArray
    scored: NDArray
    before: NDArray
    after: NDArray

    def summary(self) -> dict[str, float]:
        """Root mean square and maximum of the scored errors, before and after."""
        before, after = self.before[self.scored], self.after[self.scored]
        return {
            "held_out_rms_before": float(np.sqrt(np.mean(before**2))),
            "held_out_rms_after": float(np.sqrt(np.mean(after**2))),
            "held_out_max_before": float(np.abs(before).max()),
            "held_out_max_after": float(np.abs(after).max()),
        }

    @property
    def improves(self) -> bool:
        """Whether held-out readings are predicted better with the effects, on the whole."""
        summary = self.summary()
        return summary["held_out_rms_after"] < summary["held_out_rms_before"]


def subset(here: Linearisation, rows: NDArray) -> Linearisation:
    """The linearisation of some rows (n,) of int of the record, at the same point."""
    at = here.positions
    measured = (3 * rows[:, None] + np.arange(3)).ravel()
    return linearise(
        here.parametrisation,
        Positions(at.alpha[rows], at.beta[rows], at.mounting[rows]),
        here.reading[rows],
        here.point,
        here.bound[measured],
        here.sign[rows],
    )


def held_out_rows(here: Linearisation, fit: ExtendedFit) -> tuple[NDArray, NDArray] | None:
    """Rows to hold out and which of their readings (H, 3) can be scored; None where the others would not do.

    Of the ways to hold out every fourth position the one with most scored readings is taken: the others must keep the
    rank of the extended model.
    """
    count = len(here.reading)
    jacobian = fit.jacobian / np.abs(fit.jacobian).max(axis=0, initial=1e-300)
    rank = np.linalg.matrix_rank(jacobian, tol=1e-8 * np.linalg.norm(jacobian, 2))
    best: tuple[NDArray, NDArray] | None = None
    # The first position is never held out: the simulation begins there, and no move leads to it.
    for offset in range(1, HELD_OUT_EVERY + 1):
        out = np.arange(offset, count, HELD_OUT_EVERY)
        kept = np.setdiff1d(np.arange(count), out)
        used = jacobian.reshape(count, 3, -1)[kept].reshape(-1, jacobian.shape[1])
        if len(out) == 0 or len(used) <= rank:
            continue
        if np.linalg.matrix_rank(used, tol=1e-8 * np.linalg.norm(used, 2)) < rank:
            continue
        weights = jacobian.reshape(count, 3, -1)[out] @ np.linalg.pinv(used, rcond=1e-8)
        scored = np.linalg.norm(weights, axis=2) <= MAX_LEVERAGE
        if best is None or scored.sum() > best[1].sum():
            best = (out, scored)
    if best is None or best[1].sum() < FEWEST_SCORED:
        return None
    return best


def measure_gain(
    here: Linearisation, circumstances: Circumstances, fit: ExtendedFit, gravity: float, resolution: float
) -> Gain | None:
    """Fit without every fourth position, simulate those by the orchestrator without and with the effect, compare.

    Parameters
    ----------
    here : Linearisation
        the nominal model at its fit
    circumstances : Circumstances
        of the rows
    fit : ExtendedFit
        the model with an effect that has a kernel
    gravity : float
        the model's g [m/s²]
    resolution : float
        half a last digit of the readings, as a fraction of g

    Returns
    -------
    Gain or None
        None where too few positions remain to judge
    """
    chosen = held_out_rows(here, fit)
    hours = circumstances.hours
    if chosen is None or 3600.0 * hours[-1] * STEPS_PER_GAP > MAX_STEPS * smallest_gap(circumstances):
        return None
    out, scored = chosen
    kept = np.setdiff1d(np.arange(len(here.reading)), out)
    errors = []
    for places in ((), fit.places):
        trained = fit_nearest(subset(here, kept), circumstances.selected(kept), places, fit, resolution)
        if trained is None:
            return None
        simulated = simulate_rows(here, trained, circumstances, out, gravity)
        errors.append(here.reading[out] - simulated)
        scored = scored & ~undecided(here, circumstances, trained)[out]
    return Gain(out, scored, errors[0], errors[1]) if scored.sum() >= FEWEST_SCORED else None


def undecided(here: Linearisation, circumstances: Circumstances, fit: ExtendedFit) -> NDArray:
    """Readings (N, 3) of bool of which a fit leaves open what its effects do to them: no simulation can tell."""
    at = disturbed(here, fit.point, fit.places, fit.coefficients, fit.blocks, circumstances)
    rows = rows_at(here, fit.point, at, circumstances)
    found = added_bound(fit.places, rows).reshape(-1, 3) > 0.0
    for variant in fit.variants:
        if variant is not None:
            found |= variant.undecided(rows, float(here.bound.min()))
    return found
