"""Effects that change once, at a time that a diagnosis searches.

bias_step, scale_step
    the bias, the scale factor of an accelerometer changes at a time
mounting_slip
    the block turns on the table, so that its mounting error changes at a time
"""

from ..restricted import HOURS, Vector
from .columns import ONSET
from .definition import EffectParameter, EffectPlace, accelerometer_effect, table_effect
from .last_stage import LAST_HOUR

LARGEST_OF_BIAS = LARGEST_OF_SCALE = 1e-1
LARGEST_SLIP = 1e-2


def bias_step(context: Vector, n: Vector, p: int, size: float, start: float, added: Vector) -> None:
    """Add the size to the reading of accelerometer p after `start` hours."""
    if context[HOURS] > start:
        added[p] = added[p] + size


def scale_step(context: Vector, n: Vector, p: int, size: float, start: float, added: Vector) -> None:
    """Add size n_p to the reading of accelerometer p after `start` hours."""
    if context[HOURS] > start:
        added[p] = added[p] + size * n[p]


def mounting_slip(
    context: Vector, angles: Vector, theta_1: float, theta_2: float, theta_3: float, start: float, turns: Vector
) -> None:
    """Turn the block further on the table, by a rotation vector in its axes, after `start` hours."""
    if context[HOURS] > start:
        turns[4] = turns[4] + theta_1
        turns[5] = turns[5] + theta_2
        turns[6] = turns[6] + theta_3


BIAS_STEP = accelerometer_effect(
    bias_step,
    (
        EffectParameter("size", "g", "by how much the bias changes", LARGEST_OF_BIAS),
        EffectParameter("start", "h", "time of the change", LAST_HOUR, smallest=0.0),
    ),
    "the bias of accelerometer {p} changes by {size:+.2e} g at {start:.4g} h",
    searched=ONSET,
    formula="Δf_{p}/g = {size} 'from' t = {start} 'on'",
)

SCALE_STEP = accelerometer_effect(
    scale_step,
    (
        EffectParameter("size", "1", "by how much the scale factor changes", LARGEST_OF_SCALE),
        EffectParameter("start", "h", "time of the change", LAST_HOUR, smallest=0.0),
    ),
    "the scale factor of accelerometer {p} changes by {size:+.2e} at {start:.4g} h",
    searched=ONSET,
    degree=1,
    formula="Δf_{p}/g = {size} n_{p} 'from' t = {start} 'on'",
)

MOUNTING_SLIP = table_effect(
    mounting_slip,
    (
        *(EffectParameter(f"theta_{k}", "rad", f"turn about axis {k} of the block", LARGEST_SLIP) for k in (1, 2, 3)),
        EffectParameter("start", "h", "time after which the block stands so", LAST_HOUR, smallest=0.0),
    ),
    "the block slips on the table at {start:.4g} h: it turns by {theta_1_arcsec:+.4g}, {theta_2_arcsec:+.4g} and "
    "{theta_3_arcsec:+.4g} arcsec about its axes",
    stage="geometry_effects",
    places=(EffectPlace("mounting-slip", "mounting"),),
    searched=ONSET,
    formula="Δθ = ({theta_1}, {theta_2}, {theta_3}) 'rad from' t = {start} 'on'",
)

EFFECTS = (BIAS_STEP, SCALE_STEP, MOUNTING_SLIP)
