"""A function of one quantity at one place, by a table: an unlisted fault as an effect like any other.

Its law is written as ``[factor times] quantity at knots``, ``... around knots`` for an angle of whole turns, or ``...
jumps at knot``: "n1 at -1 0 1", "n2 times hours at 0 0.5 1", "sin alpha times beta around 0 2 4", "tilt times alpha
around 0 2 4", "hours jumps at 0.3". At a knot in parentheses the function is zero: "n1 at (-1) -0.5 0 0.5 (1)".
"""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cache
from itertools import product
from typing import Any

import numpy as np

from ..arrays import Floats
from ..written import written_kernel
from .accelerometer import NOMINAL_TEMPERATURE
from .columns import PORTS, values_read
from .definition import ACCELEROMETERS, AXES, GYRO_BLOCK, Effect, EffectParameter, EffectPlace, at_port, name_of_law
from .mounting import MOUNTING

TURN = 2.0 * math.pi
KINDS = ("at", "around", "jumps at")
ANGLES = ("alpha", "beta")
OF_ANGLES = {f"{wave} {angle}": (wave, angle) for wave, angle in product(("sin", "cos"), ANGLES)}
"""Factors that are functions of an angle."""
BASE = "base"
TILT, OUTER_TILT = "tilt", "outer tilt"
TILTS = (TILT, OUTER_TILT)
"""Words in place of a factor for a tilt of the table: by κ, or the inner axis by ε; or of the inner axis about the
outer one."""
TURNS = ("turn 1", "turn 2", "turn 3")
"""Words in place of a factor: the block turns about one of its axes."""
ALL_ACCELEROMETERS, SCALE = "accelerometers", "scale"
"""Place of all accelerometers together, and the word in place of its factor: the scale factor of all alike."""
WAYS = (*TILTS, *TURNS, SCALE)
FROM = {"temperature": NOMINAL_TEMPERATURE}
"""Origins of factors that do not count from zero."""
MOST_KNOTS = 128
LARGEST = 0.5
"""Largest possible value of a table, in its unit."""

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
"""Expression in a kernel of the block, and unit, of each quantity of a record of rests."""


def _in_motion() -> dict[str, tuple[str, str]]:
    """Return the same for a record in motion."""
    texts = {f"w{k + 1}": (f"rate[{k}]", "rad/s") for k in range(3)}
    for k in range(3):
        texts[f"dw{k + 1}"] = f"((rate[{k}] - context[PREVIOUS_RATE + {k}]) / context[STEP_LENGTH])", "rad/s2"
    for i, j in ((0, 1), (0, 2), (1, 2)):
        texts[f"w{i + 1}*w{j + 1}"] = f"rate[{i}] * rate[{j}]", "rad2/s2"
    for name, reading in AT_REST.items():
        if name not in ANGLES:
            texts[name] = reading
    return texts


IN_MOTION = _in_motion()
OF_TABLE = {
    "alpha": ("angles[0]", "rad"),
    "beta": ("angles[1]", "rad"),
    "hours": AT_REST["hours"],
    "temperature": AT_REST["temperature"],
}
"""The same for motions of the table."""
OF_MOUNTING = OF_TABLE | {name: AT_REST[name] for name in ("n1", "n2", "n3")}
"""The same for turns of the block on the table."""
PLACES = {
    **dict.fromkeys((*ACCELEROMETERS, ALL_ACCELEROMETERS), ("g", AT_REST)),
    **dict.fromkeys((*AXES, BASE), ("rad", OF_TABLE)),
    MOUNTING: ("rad", OF_MOUNTING),
    GYRO_BLOCK: ("rad/s", IN_MOTION),
}
"""Unit of a table's values at each place, and the quantities that are known there."""
FACTORS = ("n1", "n2", "n3", "hours", "temperature", "w1", "w2", "w3", "dw1", "dw2", "dw3", *OF_ANGLES, *WAYS)


@dataclass(frozen=True)
class Table:
    """Content of a law: a function of a quantity by its values at knots, straight between them, times a known factor.

    `kind`: "at", constant beyond the ends; "around", round a circle; "jumps at", zero before its one knot, then one.
    `zero` are the numbers of the knots at which the function is zero.
    """

    quantity: str
    kind: str
    knots: tuple[float, ...]
    factor: str = ""
    zero: tuple[int, ...] = ()

    @staticmethod
    def of(law: str) -> "Table":
        """Return a table from its law.

        Raises ValueError with the correct form.
        """
        factor, _, function = " ".join(law.split()).rpartition(" times ")
        quantity, _, rest = function.partition(" ")
        kind = next((kind for kind in KINDS if rest.startswith(kind + " ")), "")
        knots, zero = [], []
        for k, word in enumerate(rest[len(kind) :].split()):
            if word.startswith("(") and word.endswith(")"):
                zero.append(k)
                word = word[1:-1]
            try:
                knots.append(float(word))
            except ValueError:
                knots.append(math.nan)
        table = Table(quantity, kind, tuple(knots), factor, tuple(zero))
        if not table.is_one:
            raise ValueError(f"law {law!r} must be '[factor times] quantity at|around|jumps at knots', knots growing")
        return table

    @property
    def is_one(self) -> bool:
        """True if knots and names are those of a table."""
        knots, count = np.array(self.knots), len(self.knots)
        if self.quantity not in AT_REST | IN_MOTION or (self.factor and self.factor not in FACTORS):
            return False
        if not np.isfinite(knots).all() or (np.diff(knots) <= 0.0).any() or count > MOST_KNOTS:
            return False
        if self.kind == "jumps at":
            return count == 1 and not self.zero
        if self.kind == "around" and (self.quantity not in ANGLES or (count and knots[-1] - knots[0] >= TURN)):
            return False
        return self.kind != "" and count >= 2 and len(self.zero) < count

    @property
    def entries(self) -> tuple[int, ...]:
        """Numbers of the knots whose values are the parameters."""
        return tuple(k for k in range(len(self.knots)) if k not in self.zero)

    @property
    def law(self) -> str:
        """Canonical text of the table."""
        law = f"{self.quantity} {self.kind}"
        if self.factor:
            law = f"{self.factor} times {law}"
        for k, knot in enumerate(self.knots):
            word = repr(knot)
            if k in self.zero:
                word = f"({word})"
            law += f" {word}"
        return law

    def columns(self, values: Floats) -> Floats:
        """Return the factor of each entry at values (N,) of the quantity: (N, K), without the table's factor."""
        if self.kind == "jumps at":
            return (values > self.knots[0]).astype(float)[:, None]
        knots = np.array(self.knots)
        unit = np.eye(len(knots))
        if self.kind == "around":
            knots, unit = np.append(knots, knots[0] + TURN), np.vstack((unit, unit[:1]))
            values = knots[0] + (values - knots[0]) % TURN
        return np.stack([np.interp(values, knots, unit[:, k]) for k in self.entries], axis=1)

    @property
    def bends(self) -> Floats:
        """Changes of slope (B, K) at the inner knots by the values of the entries, times the mean distance of knots."""
        knots, unit = np.array(self.knots), np.eye(len(self.knots))
        if self.kind == "around":
            knots = np.concatenate((knots, knots[:2] + TURN))
            unit = np.vstack((unit, unit[:2]))
        distances = np.diff(knots)
        slopes = np.diff(unit, axis=0) / distances[:, None]
        return np.diff(slopes, axis=0)[:, list(self.entries)] * distances.sum() / max(len(distances), 1)

    def source(self, quantity: str) -> list[str]:
        """Return lines of a kernel that leave the function's value in ``f``, from an expression for the quantity."""
        if self.kind == "jumps at":
            return ["f = 0.0", f"if {quantity} > {self.knots[0]!r}:", "    f = value_1"]
        knots, names = list(self.knots), [f"value_{k + 1}" for k in range(len(self.knots))]
        for k in self.zero:
            names[k] = "0.0"
        lines = [f"q = {quantity}"]
        if self.kind == "around":
            lines.append(f"q = q - {TURN!r} * math.floor((q - {knots[0]!r}) / {TURN!r})")
            knots.append(knots[0] + TURN)
            names.append(names[0])
        lines.append(f"f = {names[-1]}")
        for k in range(len(knots) - 2, -1, -1):
            slope = f"({names[k + 1]} - {names[k]}) * ((q - {knots[k]!r}) / {knots[k + 1] - knots[k]!r})"
            lines += [f"if q < {knots[k + 1]!r}:", f"    f = {names[k]} + {slope}"]
        lines += [f"if q < {knots[0]!r}:", f"    f = {names[0]}"]
        return lines


@dataclass(frozen=True)
class Home:
    """Place of a table in the components: the stage, the port to which it adds, expressions of quantities there.

    `values` is the name of the values that a kernel of the stage takes, `added` that of its output.
    """

    component: str
    stage: str
    port: int
    values: str
    added: str
    texts: dict[str, tuple[str, str]]

    @staticmethod
    def of(place: EffectPlace, table: Table) -> "Home":
        """Return the home of a table at its place.

        Raises ValueError with the correct form.
        """
        _, texts = PLACES[place.where]
        for name in (table.quantity, table.factor):
            if name and name not in WAYS and not text_of(name, texts):
                raise ValueError(f"law {place.law!r}: {place.where} has no {name}; it has: {', '.join(texts)}")
        if (place.where == ALL_ACCELEROMETERS) != (table.factor == SCALE):
            raise ValueError(
                f"law {place.law!r}: {SCALE} is the factor of {ALL_ACCELEROMETERS} alone, and its only one"
            )
        if table.factor == SCALE:
            return Home("AccelerometerBlock", "reading_effects", 0, "n", "added", texts)
        if place.where == MOUNTING:
            if table.factor not in TURNS:
                raise ValueError(f"law {place.law!r}: of the {MOUNTING} only these are functions: {', '.join(TURNS)}")
            port = 4 + TURNS.index(table.factor)
            return Home("TurntableMotion", "geometry_effects", port, "angles", "turns", texts)
        if table.factor in TURNS:
            raise ValueError(f"law {place.law!r}: only the {MOUNTING} has a {table.factor}")
        if texts is OF_TABLE:
            return Home._of_turn(place, table)
        if table.factor in TILTS:
            raise ValueError(f"law {place.law!r}: only an axis has a {table.factor}")
        if place.where != GYRO_BLOCK:
            return Home("AccelerometerBlock", "reading_effects", place.index, "n", "added", texts)
        if len(place.axes) != 1:
            raise ValueError(f"law {place.law!r}: needs the gyro as its one axis")
        return Home("GyroBlock", "reading_effects", place.axes[0] - 1, "rate", "added", texts)

    @staticmethod
    def _of_turn(place: EffectPlace, table: Table) -> "Home":
        """Return the home of a turn of the table, or of the error of an encoder."""
        axis = 0 if place.where == BASE else place.index
        if table.factor == OUTER_TILT and place.where != AXES[1]:
            raise ValueError(f"law {place.law!r}: only the {AXES[1]} has an {OUTER_TILT}")
        if place.where == BASE and table.factor not in TILTS:
            raise ValueError(f"law {place.law!r}: of the {BASE} only a {TILT} is a function")
        if table.factor not in TILTS:
            return Home("TurntableMotion", "encoder_effects", axis, "angles", "added", OF_TABLE)
        port = 1 if table.factor == OUTER_TILT else 2 * axis
        return Home("TurntableMotion", "geometry_effects", port, "angles", "turns", OF_TABLE)

    def read(self, name: str, rows: Any) -> Floats:
        """Return a quantity or a factor (N,) of rows.

        Raises ValueError if they have none.
        """
        if name == "temperature" and rows.temperature is None:
            raise ValueError("a function of the temperature needs the temperature of the rows")
        return values_read(text_of(name, self.texts), self.values, self.component, rows)


def text_of(name: str, texts: dict[str, tuple[str, str]]) -> str:
    """Return the expression of a quantity in a kernel, or of a wave of an angle; empty for an unknown one."""
    wave, quantity = OF_ANGLES.get(name, ("", name))
    text, _ = texts.get(quantity, ("", ""))
    return f"math.{wave}({text})" if wave and text else text


@cache
def lookup_at(place: EffectPlace) -> Effect:
    """Return the table of a place's law as an effect.

    Raises ValueError with the correct form.
    """
    table = Table.of(place.law)
    if place.where not in PLACES:
        raise ValueError(f"law {place.law!r} has no place {place.where!r}; places: {', '.join(PLACES)}")
    home, unit = Home.of(place, table), _unit(place, table)
    parameters = []
    for k in table.entries:
        description = "size of the jump" if table.kind == "jumps at" else f"value at {table.knots[k]!r}"
        parameters.append(EffectParameter(f"value_{k + 1}", unit, description, LARGEST))

    def columns(place: EffectPlace, rows: Any) -> Floats:
        """Return the change by each entry, with the factor."""
        entries = table.columns(home.read(table.quantity, rows))
        if table.factor and table.factor not in WAYS:
            factor = home.read(table.factor, rows) - FROM.get(table.factor, 0.0)
            entries = entries * factor[:, None]
        if table.factor == SCALE:
            alike = [at_port(PORTS[home.stage], p, entries * rows.n[:, p, None]) for p in range(len(ACCELEROMETERS))]
            return np.sum(alike, axis=0)
        return at_port(PORTS[home.stage], home.port, entries)

    kernel = _kernel(place, table, home)
    fields = {"component": home.component, "stage": home.stage, "kernel": kernel, "columns": columns}
    return Effect("lookup", (), tuple(parameters), sentence, **fields)


def _kernel(place: EffectPlace, table: Table, home: Home) -> Callable[..., None]:
    """Return the kernel of a table."""
    arguments = ["context: Vector", f"{home.values}: Vector"]
    for k in table.entries:
        arguments.append(f"value_{k + 1}: float")
    name = f"lookup_{name_of_law(f'{place.where} {place.axes} {place.law}')}"
    lines = [f"def {name}({', '.join(arguments)}, {home.added}: Vector) -> None:", f'    """{place.law}"""']
    text, _ = home.texts[table.quantity]
    lines += [f"    {line}" for line in table.source(text)]
    if table.factor == SCALE:
        lines += [f"    added[{p}] = added[{p}] + f * n[{p}]" for p in range(len(ACCELEROMETERS))]
        return written_kernel("\n".join(lines) + "\n")
    target = f"{home.added}[{home.port}]"
    addition = f"    {target} = {target} + f"
    if factor := text_of(table.factor, home.texts):
        # A quantity counts as it is, a factor from its origin.
        if table.factor in FROM:
            factor = f"({factor} - {FROM[table.factor]!r})"
        addition += f" * {factor}"
    lines.append(addition)
    return written_kernel("\n".join(lines) + "\n")


def _unit(place: EffectPlace, table: Table) -> str:
    """Return the unit of the values of a table."""
    unit, texts = PLACES[place.where]
    if table.factor == SCALE:
        return "1"
    if table.factor not in texts:
        return unit
    _, of_factor = texts[table.factor]
    if of_factor == "rad/s2":
        return "s"
    return "1" if of_factor == unit else f"{unit}/{of_factor}".replace("degC", "K")


def sentence(place: EffectPlace, values: Mapping[str, float]) -> str:
    """Return a table's function of its place, and its largest value, in a sentence."""
    table = Table.of(place.law)
    function = "a function"
    if table.factor:
        function = f"{table.factor} times a function"
    largest = max(abs(value) for value in values.values())
    return f"{place.where.replace('-', ' ')}: {function} of {table.quantity}, up to {largest:.2e}"


EFFECT = Effect("lookup", (), (), sentence, of_place=lookup_at)
