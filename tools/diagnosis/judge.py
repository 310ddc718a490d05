"""What is stated of effects and what is excluded, and what an unexplained residual depends on."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...models.effects import CATALOGUE
from ..bounded.possible import Possible, largest_length
from ..evidence.evidence import Channel, Evidence, Fit
from .result import Cause

LENGTHS = (0.15, 0.35, 0.8, 2.0)
"""Lengths over which the functions that are tried vary: of the spread of a quantity, radians of an angle."""
NOISE_PARTS = (0.03, 0.3)
"""Parts of the residual's variance that are put down to noise in the fit of such a function."""
MOST_ROWS = 400
"""Of a longer record rows spread over it are taken."""


def causes_of(evidence: Evidence, fit: Fit) -> tuple[Cause, ...]:
    """A set of effects as causes: what is stated of each, inside what the record leaves possible."""
    causes = []
    intervals = fit.intervals(evidence.room(fit), evidence.most_rows)
    for place, values, possible in zip(fit.places, fit.values(), intervals, strict=True):
        parameters, ends = CATALOGUE[place.effect].at(place).parameters, evidence.told(place, possible)
        stated = [
            value if parameter.name.endswith("phase") else min(max(value, low), high)
            for parameter, value, (low, high) in zip(parameters, values, ends, strict=True)
        ]
        causes.append(Cause.found(evidence.named(place), evidence.classes.equivalents(place), stated, ends))
    return tuple(causes)


def excluded_sizes(evidence: Evidence, fit: Fit) -> tuple[dict[str, Any], ...]:
    """Upper bounds of the effects that were not found, each added to the model that explains the record.

    Returns
    -------
    tuple of dict
        effect, where, order, axes, parameter, unit and ``above``: sizes above it are excluded; effects that the record
        does not bound below their largest possible size are left out
    """
    found, room, count = [], evidence.room(fit), len(fit.at)
    for place, columns in evidence.beside(fit):
        possible = fit.possible(room, columns, evidence.most_rows)
        parameters = CATALOGUE[place.effect].at(place).parameters
        sizes = [largest_size(possible, count + k, parameter.name) for k, parameter in enumerate(parameters)]
        ends = evidence.told(place, [(0.0, size) for size in sizes])
        for parameter, (_, above) in zip(parameters, ends, strict=True):
            if above < parameter.largest and not parameter.name.endswith("phase"):
                found.append(
                    {**place.entry, "parameter": parameter.name, "unit": parameter.unit, "above": float(above)}
                )
    return tuple(found)


def largest_size(possible: Possible, column: int, name: str) -> float:
    """Largest absolute value of a coefficient, or largest length of the pair of an amplitude and its phase."""
    if name.endswith("phase"):
        return np.inf
    if name.endswith("amplitude"):
        return largest_length(possible.among(np.array([column, column + 1])))
    low, high = possible.ends(column)
    return max(high, -low)


def residual_structure(channels: Sequence[Channel]) -> tuple[dict[str, Any], ...]:
    """How much of the residual a smooth function of one quantity predicts at readings that it was not fitted to.

    Returns
    -------
    tuple of dict
        the label of the component, ``on``: the quantity, ``explained``: the part of the residual's sum of squares that
        is predicted when each reading is left out in turn; ``explainable``: the part that is more than noise within
        the bound, uniform, would be on average. The most telling quantity first, then those of several variables
    """
    found, joint = [], []
    for channel in channels:
        rows = np.unique(np.linspace(0, len(channel.error) - 1, MOST_ROWS).round().astype(int))
        error, bound = channel.error[rows], channel.bound[rows]
        circles = {name: circle(angle[rows]) for name, angle in channel.angles.items()}
        single = circles | {name: spread(values[rows]) for name, values in channel.quantities.items()}
        several = {" and ".join(circles): np.hstack(list(circles.values()))} if circles else {}
        several |= {name: spread(values[rows]) for name, values in channel.joint.items()}
        total = float((error**2).sum())
        explainable = max(0.0, 1.0 - float((bound**2).sum()) / 3.0 / total) if total > 0.0 else 0.0
        for names, entries in ((single, found), (several, joint)):
            for on, coordinates in names.items():
                share = predicted_share(coordinates, error)
                entries.append({**channel.label, "on": on, "explained": share, "explainable": explainable})

    def telling(entry: dict[str, Any]) -> float:
        return -round(float(entry["explained"]), 9)

    return (*sorted(found, key=telling), *sorted(joint, key=telling))


def circle(angle: NDArray) -> NDArray:
    """An angle (N,) as a point (N, 2) of the unit circle."""
    return np.stack((np.cos(angle), np.sin(angle)), axis=1)


def spread(values: NDArray) -> NDArray:
    """Quantities (N, k) in units of their standard deviation; zeros where they do not vary."""
    deviation = values.std(axis=0)
    return (values - values.mean(axis=0)) / np.where(
        deviation > 1e-12 * np.abs(values).max(initial=0.0), deviation, np.inf
    )


def predicted_share(coordinates: NDArray, residual: NDArray) -> float:
    """Part of the sum of squares that a smooth function of coordinates (N, k) predicts of readings left out in turn.

    Kernel regression with Gaussian functions of several lengths; the length and the noise that predict best are taken.
    The errors of readings left out follow from one decomposition: e_i = [K⁻¹ r]_i / [K⁻¹]_ii.
    """
    total = float((residual**2).sum())
    if total == 0.0 or not np.ptp(coordinates, axis=0).any():
        return 0.0
    square = ((coordinates[:, None, :] - coordinates[None, :, :]) ** 2).sum(axis=2)
    least = total
    for length in LENGTHS:
        values, vectors = np.linalg.eigh(np.exp(-0.5 * square / length**2))
        weights = vectors.T @ residual
        for noise in NOISE_PARTS:
            inverse = 1.0 / (np.maximum(values, 0.0) + noise)
            errors = (vectors @ (inverse * weights)) / ((vectors**2) @ inverse)
            least = min(least, float((errors**2).sum()))
    return max(0.0, 1.0 - least / total)
