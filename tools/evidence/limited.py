"""Accelerometers at their limit in rests: saturation that the readings show by themselves.

A reading at a limit tells nothing of gravity but that it is beyond; such rests are left out of everything that is
fitted. Held against the model all the same they say whether it can do without the limit.
"""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from ...models.effects import EffectPlace
from ..motion.inspect import Inspection
from ..motion.norm import NAMES, norm_equations
from ..records.limits import resolution_of
from ..rounding import exactly
from .carried import Carried
from .evidence import Part, Pieces, ReadOff
from .references import Gravity, factor_for


def with_limits(made: Carried) -> Carried:
    """The evidence with the limits of its accelerometers that the model cannot do without.

    One on one side alone, which the catalogue's saturation is not, has an objection.
    """
    if not isinstance(made.reference, Gravity):
        return made
    found = []
    for axis in range(3):
        rests = rests_at_limit(made.found, axis)
        radius = radius_with(made, rests) if rests else 0.0
        if radius <= made.limit:
            continue
        level, half, one_sided = level_of(made.found, axis)
        place, objection = EffectPlace("saturation", f"accelerometer-{axis + 1}"), ""
        if one_sided:
            said = f"accelerometer {axis + 1} is at a limit of {exactly(level)} g on one side alone"
            objection = f"{said}; the catalogue's saturation is on both"
        found.append(ReadOff(place, (level,), ((level - half, level + half),), radius, objection))
    return replace(made, limits=tuple(found))


def rests_at_limit(found: Inspection, axis: int) -> list[slice]:
    """Rows of the rests that were left out because this accelerometer is at its limit there."""
    mask = found.sampling.limits.rows.get(f"f{axis + 1}")
    return [] if mask is None else [rows for rows in found.rests.clipped_rows if mask[rows].any()]


def level_of(found: Inspection, axis: int) -> tuple[float, float, bool]:
    """The limit of an accelerometer and half a step of its readings [g], and whether it is none on the other side.

    A limit whose one side was never reached counts as two-sided.
    """
    limits, name = found.sampling.limits, f"f{axis + 1}"
    values = limits.channels[name] / found.gravity
    levels = np.abs(values[limits.rows[name]])
    half = 0.5 * resolution_of(np.unique(values))
    beyond = max(np.abs(values).max() - levels.min(), np.ptp(levels))
    return float(levels.min()), half, bool(beyond > 2.0 * half)


def radius_with(made: Carried, rests: list[slice]) -> float:
    """Radius of the model without effects where these rests count as well, by the size of gravity."""
    reference = made.reference
    assert isinstance(reference, Gravity)
    force = made.found.record.specific_force
    reading = np.array([force[rows].mean(axis=0) for rows in rests]) / made.found.gravity
    x = made.point[: len(NAMES)]
    error, slopes, by_reading = norm_equations(x, reading)
    noise: NDArray = reference.deviation.max(axis=0)
    bound = factor_for(len(rests)) * np.sqrt((by_reading**2 * noise**2).sum(axis=1))
    by_own = np.zeros((len(rests), 1, len(made.names) - len(NAMES)))
    ends = [np.array([end(rows) for rows in rests]) for end in (lambda r: r.start, lambda r: r.stop - 1)]
    part = Part(
        Pieces("norms", "norms at a limit", *ends),
        error[:, None],
        bound[:, None],
        np.concatenate([-slopes[:, None, :], by_own], axis=2),
        np.zeros((len(rests), 1, made.columns.shape[1])),
        scored=False,
    )
    return replace(made, parts=(*made.parts, part)).refit(()).radius
