"""A bias that wanders: any function of time, by its values at times between which it is straight.

It does not model a process: any bias with bounded increments is near to such a function. It contains a bias's drift,
step, warm-up and dependence on temperature.
"""

from collections.abc import Callable, Mapping
from functools import cache
from itertools import pairwise

from ..written import written_kernel
from .definition import ACCELEROMETERS, Effect, EffectParameter, EffectPlace, accelerometer_column, name_of_law
from .lookup import Table

LARGEST_OF_BIAS = 1e-1


@cache
def wander_at(place: EffectPlace) -> Effect:
    """Return the wander of an accelerometer's bias by the times of its place's law.

    Its parameters are the values at all knots except the first, where the bias is the nominal one. Raises ValueError
    with the correct form.
    """
    table = Table.of(place.law)
    if place.where not in ACCELEROMETERS or (table.quantity, table.kind, table.factor) != ("hours", "at", ""):
        raise ValueError(f"law {place.law!r} of {place.where}: a bias of an accelerometer wanders by 'hours at knots'")
    parameters = tuple(
        EffectParameter(f"value_{k}", "g", f"what the bias has changed by at {knot!r} h", LARGEST_OF_BIAS)
        for k, knot in enumerate(table.knots[1:], start=2)
    )
    return Effect(
        "bias-wander",
        (),
        parameters,
        wander_sentence,
        component="AccelerometerBlock",
        stage="reading_effects",
        kernel=_kernel(place, table),
        columns=lambda place, rows: accelerometer_column(place, table.columns(rows.hours)[:, 1:]),
        contains=CONTAINED,
    )


def _kernel(place: EffectPlace, table: Table) -> Callable[..., None]:
    """Return the kernel of the table of a place's law, zero at its first knot."""
    p, values = place.index, ""
    for k in range(2, len(table.knots) + 1):
        values += f"value_{k}: float, "
    name = name_of_law(f"{place.where} {place.law}")
    source = f"def wander_{name}(context: Vector, n: Vector, {values}added: Vector) -> None:\n"
    source += f'    """{place.law}"""\n    value_1 = 0.0\n'
    for line in table.source("context[HOURS]"):
        source += f"    {line}\n"
    return written_kernel(f"{source}    added[{p}] = added[{p}] + f\n")


def wander_sentence(place: EffectPlace, values: Mapping[str, float]) -> str:
    """Return the range of the bias, and its fastest change an hour, in a sentence."""
    changes = (0.0, *values.values())
    steps = zip(pairwise(Table.of(place.law).knots), pairwise(changes), strict=True)
    fastest = max(abs(high - low) / (after - before) for (before, after), (low, high) in steps)
    width = max(changes) - min(changes)
    where = ACCELEROMETERS.index(place.where) + 1
    return f"the bias of accelerometer {where} wanders over {width:.2e} g, by up to {fastest:.2e} g an hour"


CONTAINED = ("bias-drift", "bias-step", "warm-up", "temperature-bias", "thermal-lag")

EFFECT = Effect("bias-wander", (), (), wander_sentence, of_place=wander_at, contains=CONTAINED)
