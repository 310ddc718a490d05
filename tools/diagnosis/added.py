"""What an explanation adds to the errors of a record, and what remains of them."""

from dataclasses import dataclass

import numpy as np

from ...models.arrays import Floats
from ..evidence.evidence import Evidence
from ..evidence.fit import Fit, estimated, least_radius
from ..sieve.simple import Simple
from .dependence import Standing
from .result import Explanation


@dataclass(frozen=True, eq=False)
class Added:
    """Errors of the rows (M,) of a record over their bounds, at the parameters that belong to an explanation.

    Attributes
    ----------
    without : array
        errors of the model without the explanation
    added : array
        the part of them that the explanation adds to the readings; of readings that it sets aside the whole error
    remaining : array
        errors with it, over the bounds that it states; NaN of readings that it sets aside
    left_out : (array, array) or None
        errors of left-out readings, without it and with it; None where none can be predicted
    """

    without: Floats
    added: Floats
    remaining: Floats
    left_out: tuple[Floats, Floats] | None = None


def added_by(evidence: Evidence, explanation: Explanation) -> Added | None:
    """Return what an explanation adds to a record; None where its model has other parameters than the record's."""
    basis = explanation.basis
    if isinstance(basis, Standing):
        return _by_function(evidence, basis)
    within, fit = evidence, basis
    if isinstance(basis, Simple):
        within, fit = basis.evidence, basis.fit or basis.evidence.model.baseline
    elif basis is None and explanation.causes:
        fit = evidence.model.refit([cause.place for cause in explanation.causes])
    count = len(evidence.rows.names)
    if not isinstance(fit, Fit) or within.rows.names != evidence.rows.names:
        return None
    point, sizes = fit.central[:count], fit.central[count:]
    nominal = evidence.model.about((), point, np.zeros(0))
    without = nominal.residual / nominal.bound
    if len(fit.left) == len(without):
        added = without - fit.left / nominal.bound
        return Added(without, added, fit.left / fit.allowed, _left_out(evidence, fit))
    # Some rows are set aside: the model without them is held against all.
    with_effects = evidence.model.about(fit.places, point, sizes)
    remaining = with_effects.residual / with_effects.bound
    aside = np.abs(remaining) > within.model.limit
    return Added(without, np.where(aside, without, without - remaining), np.where(aside, np.nan, remaining))


def _by_function(evidence: Evidence, standing: Standing) -> Added:
    """Return what the simplest function of one quantity adds."""
    rows = evidence.rows
    nominal, columns = (part / rows.bound[:, None] for part in (rows.nominal, standing.pair.columns(standing.form)))
    matrix, residual = np.hstack((nominal, columns)), rows.residual / rows.bound
    free = np.full(matrix.shape[1], np.inf)
    _, step = least_radius(matrix, residual, (-free, free), estimated(matrix, residual))
    added = columns @ step[nominal.shape[1] :]
    remaining = residual - matrix @ step
    return Added(remaining + added, added, remaining)


def _left_out(evidence: Evidence, fit: Fit) -> tuple[Floats, Floats] | None:
    """Return the errors of left-out readings over the bound, without the effects of a fit and with them."""
    if not fit.places:
        return None
    trial = next(iter(evidence.including(fit.places).reader.trials(fit)), None)
    if trial is None or trial.folds is None:
        return None
    bound = float(np.median(fit.bound))
    return trial.folds[0] / bound, trial.folds[1] / bound
