"""A function of one quantity at one place, by a table: what no catalogue lists, as an effect like any other.

Its law is written as ``[factor times] quantity at knots``, ``... around knots`` of an angle that goes round, or ``...
jumps at knot``: "n1 at -1 0 1", "n2 times hours at 0 0.5 1", "sin alpha times beta around 0 2 4", "tilt times alpha
around 0 2 4", "hours jumps at 0.3". At a knot in parentheses the function is zero: "n1 at (-1) -0.5 0 0.5 (1)".
"""

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..written import written
from .accelerometer import NOMINAL_TEMPERATURE
from .columns import MotionRows
from .definition import ACCELEROMETERS, AXES, GYRO_BLOCK, Effect, EffectParameter, EffectPlace, at_port, name_of_law

TURN = 2.0 * math.pi
KINDS = ("at", "around", "jumps at")
ANGLES = ("alpha", "beta")
OF_ANGLES = {f"{wave} {angle}": (wave, angle) for wave in ("sin", "cos") for angle in ANGLES}
"""Factors that are functions of an angle."""
BASE = "base"
TILT, OUTER_TILT = "tilt", "outer tilt"
TILTS = (TILT, OUTER_TILT)
"""In place of a factor: the table does not turn about the axis itself. It tilts by κ or the inner axis by ε; or the
inner axis tilts about the outer one."""
FROM = {"temperature": NOMINAL_TEMPERATURE}
"""From where factors count that do not count from zero."""
MOST_KNOTS = 128
LARGEST = 0.5
"""The largest value of a table that is called possible, in its unit."""

AT_REST = {
    "n1": ("context[INPUT]", "g"),
    "n2": ("context[INPUT + 1]", "g"),
    "n3": ("context[INPUT + 2]", "g"),
    "n1*n2": ("context[INPUT] * context[INPUT + 1]", "g2"),
    "n1*n3": ("context[INPUT] * context[INPUT + 2]", "g2"),
    "n2*n3": ("context[INPUT + 1] * context[INPUT + 2]", "g2"),
    "hours": ("context[HOURS]", "h"),
    "temperature": ("context[TEMPERATURE]", "degC"),
    "alpha": ("context[ALPHA]", "rad"),
    "beta": ("context[BETA]", "rad"),
}
"""Of each quantity of a record of rests how a kernel of the block reads it, and its unit."""
IN_MOTION = {
    "w1": ("rate[0]", "rad/s"),
    "w2": ("rate[1]", "rad/s"),
    "w3": ("rate[2]", "rad/s"),
    **{
        f"dw{p}": (f"((rate[{p - 1}] - context[PREVIOUS_RATE + {p - 1}]) / context[STEP_LENGTH])", "rad/s2")
        for p in (1, 2, 3)
    },
    **{f"w{i}*w{j}": (f"rate[{i - 1}] * rate[{j - 1}]", "rad2/s2") for i, j in ((1, 2), (1, 3), (2, 3))},
    **{name: AT_REST[name] for name in AT_REST if name not in ANGLES},
}
"""The same of a record in motion."""
OF_TABLE = {
    **{angle: (f"angles[{axis}]", "rad") for axis, angle in enumerate(ANGLES)},
    **{name: AT_REST[name] for name in ("hours", "temperature")},
}
"""The same of what the table does."""
PLACES = {
    **dict.fromkeys(ACCELEROMETERS, ("g", AT_REST)),
    **dict.fromkeys((*AXES, BASE), ("rad", OF_TABLE)),
    GYRO_BLOCK: ("rad/s", IN_MOTION),
}
"""Of each place the unit of what a table adds there, and the quantities that are known."""
FACTORS = ("n1", "n2", "n3", "hours", "temperature", "w1", "w2", "w3", "dw1", "dw2", "dw3", *OF_ANGLES, *TILTS)


@dataclass(frozen=True)
class Table:
    """What a law says: a function of a quantity by its values at knots, straight between them, times a known factor.

    `kind`: "at": as at the ends beyond these; "around": round a circle; "jumps at": zero before its one knot, then one.
    `zero` are the numbers of the knots where the function is zero.
    """

    quantity: str
    kind: str
    knots: tuple[float, ...]
    factor: str = ""
    zero: tuple[int, ...] = ()

    @staticmethod
    def of(law: str) -> "Table":
        """A table from its law; a ValueError says what would be right."""
        factor, _, function = " ".join(law.split()).rpartition(" times ")
        quantity, *rest = function.split() or [""]
        kind = next((kind for kind in KINDS if " ".join(rest).startswith(kind + " ")), None)
        written = rest[len(kind.split()) if kind else 0 :]
        zero = tuple(k for k, word in enumerate(written) if word.startswith("(") and word.endswith(")"))
        try:
            knots = tuple(float(word[1:-1] if k in zero else word) for k, word in enumerate(written))
        except ValueError:
            knots = ()
        table = Table(quantity, kind or "", knots, factor, zero)
        if not table.is_one:
            raise ValueError(f"law {law!r} must be '[factor times] quantity at|around|jumps at knots', knots growing")
        return table

    @property
    def is_one(self) -> bool:
        """Whether knots and names are those of a table."""
        known = {*AT_REST, *IN_MOTION}
        count = len(self.knots)
        fits = {"at": count >= 2, "around": count >= 2, "jumps at": count == 1}.get(self.kind, False)
        fits = fits and (self.kind != "around" or self.quantity in ("alpha", "beta"))
        growing = all(a < b for a, b in zip(self.knots, self.knots[1:], strict=False))
        within = self.kind != "around" or self.knots[-1:] < (self.knots[0] + TURN,) if self.knots else False
        finite = all(math.isfinite(knot) for knot in self.knots)
        names = self.quantity in known and (not self.factor or self.factor in FACTORS)
        told = len(self.zero) < count and not (self.zero and self.kind == "jumps at")
        return fits and growing and within and finite and names and told and count <= MOST_KNOTS

    @property
    def entries(self) -> tuple[int, ...]:
        """Numbers of the knots whose values are the parameters."""
        return tuple(k for k in range(len(self.knots)) if k not in self.zero)

    @property
    def law(self) -> str:
        """As it is written."""
        factor = f"{self.factor} times " if self.factor else ""
        words = (f"({knot!r})" if k in self.zero else repr(knot) for k, knot in enumerate(self.knots))
        return f"{factor}{self.quantity} {self.kind} {' '.join(words)}"

    def columns(self, values: NDArray[np.float64]) -> NDArray[np.float64]:
        """What each entry is multiplied by at values (N,) of the quantity: (N, K), without the factor."""
        if self.kind == "jumps at":
            return (values > self.knots[0]).astype(float)[:, None]
        knots = np.array(self.knots)
        unit = np.eye(len(knots))
        if self.kind == "around":
            knots, unit = np.append(knots, knots[0] + TURN), np.vstack((unit, unit[:1]))
            values = knots[0] + (values - knots[0]) % TURN
        return np.stack([np.interp(values, knots, unit[:, k]) for k in self.entries], axis=1)

    def source(self, quantity: str) -> list[str]:
        """Lines of a kernel that leave the function's value in ``f``, by an expression for the quantity."""
        if self.kind == "jumps at":
            return ["f = 0.0", f"if {quantity} > {self.knots[0]!r}:", "    f = value_1"]
        knots, names = list(self.knots), ["0.0" if k in self.zero else f"value_{k + 1}" for k in range(len(self.knots))]
        lines = [f"q = {quantity}"]
        if self.kind == "around":
            lines.append(f"q = q - {TURN!r} * math.floor((q - {knots[0]!r}) / {TURN!r})")
            knots, names = [*knots, knots[0] + TURN], [*names, names[0]]
        lines.append(f"f = {names[-1]}")
        for k in range(len(knots) - 2, -1, -1):
            slope = f"({names[k + 1]} - {names[k]}) * ((q - {knots[k]!r}) / {knots[k + 1] - knots[k]!r})"
            lines += [f"if q < {knots[k + 1]!r}:", f"    f = {names[k]} + {slope}"]
        return [*lines, f"if q < {knots[0]!r}:", f"    f = {names[0]}"]


def values_of(name: str, rows: Any) -> NDArray[np.float64]:
    """A quantity (N,) of rows at rest or in motion; a ValueError where they have none."""
    if "*" in name:
        return np.prod([values_of(factor, rows) for factor in name.split("*")], axis=0)
    if name in OF_ANGLES:
        wave, angle = OF_ANGLES[name]
        return np.asarray(getattr(np, wave)(values_of(angle, rows)))
    if name[0] in ("n", "w", "d"):
        axis = int(name[-1]) - 1
        if isinstance(rows, MotionRows):
            return {"n": rows.specific_force, "w": rows.rate, "d": rows.acceleration}[name[0]][:, axis]
        return rows.n[:, axis]
    values = getattr(rows, name)
    if values is None:
        raise ValueError(f"a function of the {name} needs the {name} of the rows")
    return values


@cache
def lookup_at(place: EffectPlace) -> Effect:
    """The table of a place's law as an effect; a ValueError says what would be right."""
    table = Table.of(place.law)
    if place.where not in PLACES:
        raise ValueError(f"law {place.law!r} has no place {place.where!r}; places: {', '.join(PLACES)}")
    _, known = PLACES[place.where]
    for name in (table.quantity, table.factor):
        if name and name not in TILTS and not _read(name, known):
            raise ValueError(f"law {place.law!r}: {place.where} has no {name}; it has: {', '.join(known)}")
    home = _home_of_turn(place, table) if known is OF_TABLE else _home_of_reading(place, table)
    jump, unit = table.kind == "jumps at", _unit(place, table)
    parameters = tuple(
        EffectParameter(f"value_{k + 1}", unit, "size of the jump" if jump else f"value at {table.knots[k]!r}", LARGEST)
        for k in table.entries
    )
    return Effect("lookup", (), parameters, _said, **home)


def _read(name: str, known: dict[str, tuple[str, str]]) -> str:
    """How a kernel reads a quantity or a factor; empty where it is none that is known."""
    wave, quantity = OF_ANGLES.get(name, ("", name))
    text = known.get(quantity, ("", ""))[0]
    text = f"({text} - {FROM[name]!r})" if text and name in FROM else text
    return f"math.{wave}({text})" if wave and text else text


def _values_added(table: Table, rows: Any) -> NDArray[np.float64]:
    """What each entry adds (N, K), with the factor."""
    own = table.columns(values_of(table.quantity, rows))
    if not table.factor or table.factor in TILTS:
        return own
    return own * (values_of(table.factor, rows) - FROM.get(table.factor, 0.0))[:, None]


def _home_of_turn(place: EffectPlace, table: Table) -> dict[str, Any]:
    """Where a turn of the table, or the error of an encoder, joins the components, and its signature."""
    tilted, axis = table.factor in TILTS, 0 if place.where == BASE else place.index
    if table.factor == OUTER_TILT and place.where != AXES[1]:
        raise ValueError(f"law {place.law!r}: only the {AXES[1]} has an {OUTER_TILT}")
    if place.where == BASE and not tilted:
        raise ValueError(f"law {place.law!r}: of the {BASE} only a {TILT} is a function")
    at = 1 if table.factor == OUTER_TILT else 2 * axis if tilted else 2 * axis + 1

    stage, size, port = ("geometry_effects", 7, at) if tilted else ("encoder_effects", 2, axis)
    target = f"{'turns' if tilted else 'added'}[{port}]"
    own = {"columns": lambda place, rows: at_port(size, port, _values_added(table, rows))}
    kernel = _kernel(place, table, ("context: Vector", "angles: Vector"), OF_TABLE, target)
    return own | {"component": "TurntableMotion", "stage": stage, "kernel": kernel}


def _home_of_reading(place: EffectPlace, table: Table) -> dict[str, Any]:
    """Where the error of an accelerometer or a gyro joins the components, and its signature."""
    if table.factor in TILTS:
        raise ValueError(f"law {place.law!r}: only an axis has a {table.factor}")
    in_motion = place.where == GYRO_BLOCK
    if in_motion and len(place.axes) != 1:
        raise ValueError(f"law {place.law!r}: needs the gyro as its one axis")
    p = place.axes[0] - 1 if in_motion else place.index

    seen = ("context: Vector", "rate: Vector" if in_motion else "n: Vector")
    kernel = _kernel(place, table, seen, IN_MOTION if in_motion else AT_REST, f"added[{p}]")
    component = "GyroBlock" if in_motion else "AccelerometerBlock"
    own = {"columns": lambda place, rows: at_port(3, p, _values_added(table, rows)), "kernel": kernel}
    return own | {"component": component, "stage": "reading_effects"}


def _kernel(
    place: EffectPlace, table: Table, seen: tuple[str, str], known: dict[str, tuple[str, str]], target: str
) -> Callable[..., None]:
    """The kernel of a table."""
    values = ", ".join(f"value_{k + 1}: float" for k in table.entries)
    last, factor = target.split("[")[0], _read(table.factor, known)
    name = f"lookup_{name_of_law(f'{place.where} {place.axes} {place.law}')}"
    # A quantity counts as it is, a factor from where it does nothing.
    body = table.source(known[table.quantity][0])
    body.append(f"{target} = {target} + f" + (f" * {factor}" if factor else ""))
    head = f"def {name}({', '.join(seen)}, {values}, {last}: Vector) -> None:"
    return written("\n".join([head, f'    """{place.law}"""', *(f"    {line}" for line in body)]) + "\n")


def _unit(place: EffectPlace, table: Table) -> str:
    """Unit of the values of a table."""
    own, known = PLACES[place.where]
    if table.factor not in known:
        return own
    by = known[table.factor][1]
    if by == "rad/s2":
        return "s"
    return "1" if by == own else f"{own}/{by}".replace("degC", "K")


def _said(place: EffectPlace, values: Any) -> str:
    table = Table.of(place.law)
    of = f"{table.factor} times a function" if table.factor else "a function"
    largest = max(abs(value) for value in values.values())
    return f"{place.where.replace('-', ' ')}: {of} of {table.quantity}, up to {largest:.2e}"


EFFECT = Effect("lookup", (), (), _said, of_place=lookup_at)
