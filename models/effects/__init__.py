"""The catalogue of effects, in families by place of action: accelerometer, gyro, table, last stage of a reading.

A family defines its `EFFECTS`; any other file of this package that defines an `EFFECT` adds that one.
"""

import importlib
import math
import pkgutil
from collections.abc import Mapping

from .columns import MotionRows, Rows
from .definition import CATALOGUE, Effect, EffectParameter, EffectPlace, name_of_law
from .variants import Variant

__all__ = [
    "CATALOGUE",
    "POSITION_EFFECTS",
    "STRAPDOWN_EFFECTS",
    "Effect",
    "EffectParameter",
    "EffectPlace",
    "MotionRows",
    "Rows",
    "Variant",
    "parameter_name",
    "place_from_mapping",
]


def effects_of_files() -> list[Effect]:
    """Return the effects of every file of this package, its `EFFECTS` or its one `EFFECT`, by their names."""
    effects: list[Effect] = []
    for file in pkgutil.iter_modules(__path__):
        module = importlib.import_module(f"{__name__}.{file.name}")
        if hasattr(module, "EFFECTS"):
            effects += module.EFFECTS
        elif hasattr(module, "EFFECT"):
            effects.append(module.EFFECT)
    return sorted(effects, key=lambda effect: effect.name)


CATALOGUE.update((effect.name, effect) for effect in effects_of_files())

POSITION_EFFECTS = {effect.name: effect for effect in CATALOGUE.values() if not (effect.in_motion or effect.of_law)}
"""The effects that a record of rests at positions of a table can show."""

STRAPDOWN_EFFECTS = {
    effect.name: effect
    for effect in CATALOGUE.values()
    if effect.in_motion and effect.component in ("GyroBlock", "AttitudeComputer")
}
"""The effects of gyros and attitude computer, which only a record in motion can show; signatures in rad/s."""


def parameter_name(place: EffectPlace, parameter: str) -> str:
    """Return the name of the FMU variable that holds a parameter of an effect at its place."""
    words = [place.effect, place.where]
    if place.order is not None:
        words.append(f"order_{place.order}")
    if place.axes:
        words.append("axes_" + "_".join(str(axis) for axis in place.axes))
    if place.law:
        words.append(name_of_law(place.law))
    return ".".join([*words, parameter]).replace("-", "_")


def place_from_mapping(mapping: Mapping[str, object]) -> tuple[EffectPlace, dict[str, float]]:
    """Split an entry of a scenario's `effects` into the place and the values of its parameters.

    Parameters
    ----------
    mapping : mapping
        ``effect``, ``where``, optional ``order``, ``axes`` and ``law``, and the parameters by name

    Returns
    -------
    tuple of EffectPlace and dict
        the place, and the values by name

    Raises
    ------
    ValueError
        one line: the unknown, missing or wrong entry, and the correct form
    """
    rest = dict(mapping)
    name = rest.pop("effect", None)
    effect = CATALOGUE.get(name) if isinstance(name, str) else None
    if effect is None or not (effect.kernel is not None or effect.of_law):
        names = ", ".join(entry.name for entry in CATALOGUE.values() if entry.kernel is not None or entry.of_law)
        raise ValueError(f"effect {name!r} is not one that extends a component; these do: {names}")
    where, order, axes = rest.pop("where", None), rest.pop("order", None), rest.pop("axes", [])
    # Products do not depend on the order of their factors.
    whole_axes = isinstance(axes, list | tuple) and all(type(axis) is int for axis in axes)
    factors = tuple(sorted(axes)) if whole_axes else None  # type: ignore[arg-type]
    given = tuple(axes) if whole_axes else None  # type: ignore[arg-type]
    at = [p for p in effect.places if (p.where, p.order) == (where, order) and p.axes in (given, factors)]
    place = next((p for p in at if p.axes == given), at[0] if at else None)
    if effect.of_law:
        law = rest.pop("law", None)
        if not (isinstance(law, str) and isinstance(where, str) and order is None and factors is not None):
            raise ValueError(f"effect {name!r} needs 'where' and 'law', both text, and no order")
        place = EffectPlace(effect.name, where, None, factors, law)
    elif place is None:
        names = "; ".join(p.title.removeprefix(effect.name).strip() for p in effect.places)
        with_axes = f" and axes {axes!r}" if axes else ""
        raise ValueError(f"effect {name!r} has no place {where!r} with order {order!r}{with_axes}; it has: {names}")
    effect = effect.at(place)
    values: dict[str, float] = {}
    for parameter in effect.parameters:
        value = rest.pop(parameter.name, None)
        if isinstance(value, bool) or not isinstance(value, int | float) or not math.isfinite(value):
            raise ValueError(f"effect {name!r}: parameter {parameter.name!r} needs a finite number [{parameter.unit}]")
        values[parameter.name] = float(value)
    if rest:
        names = ", ".join(parameter.name for parameter in effect.parameters)
        raise ValueError(f"effect {name!r} has no parameter {min(rest)!r}; it has: {names}")
    return place, values
