"""Which channel of a file is which axis, with its sign, sense and unit; and which way of reading one fits far better.

Accelerometers and gyros may be exchanged and reversed in 48 ways, each angle of the table may turn the other way, and
angles and rates may be in the other unit. A record is tried against all of them. A way that fits far better is
reported, with the option `--channels` that reads it so, and is never applied by itself.
"""

import re
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import permutations, product
from typing import TypeAlias, cast

import numpy as np
from numpy.typing import NDArray

from ...models.arrays import Floats, Ints
from ..errors import InputError

Axes: TypeAlias = tuple[int, int, int]

FAR_BETTER = 200.0
"""A way of reading fits far better than another where its misfit is less by this difference. The misfit adds the
squares of the residuals over their usual size, and of parameters over `USUAL`. Right records came to 17 at most, and
once to 160."""
USUAL = 0.1
"""Scale factors, misalignments [1] and biases [g] of this size are usual; a channel that is reversed has one of 2."""
LEAST_MISFIT, LARGEST_MISFIT = 0.01, 0.1
"""What effects and offsets of the table may leave [g] is not taken for less; where the best way of reading leaves more,
none of them is right."""
MOST_LISTED = 8
"""Most equivalent ways of reading a record that are listed."""
RADIANS = np.pi / 180.0
SIGNED = re.compile(r"[+-]?[123]")
OPTIONS = "as 2,1,-3 (accelerometers), w=2,1,-3 (gyros), alpha=-1, beta=-1, angles=rad or w=deg"


def _matrix(order: Axes) -> Floats:
    matrix = np.zeros((3, 3))
    for axis, channel in enumerate(order):
        matrix[axis, abs(channel) - 1] = np.sign(channel)
    return matrix


PERMUTATIONS = tuple(
    _matrix(cast(Axes, tuple(sign * (channel + 1) for sign, channel in zip(signs, order, strict=True))))
    for order in permutations(range(3))
    for signs in product((1, -1), repeat=3)
)
"""The 48 signed permutations (3, 3); the first changes nothing."""
SENSES = ((1, 1), (-1, 1), (1, -1), (-1, -1))
"""Senses of the angles of the outer and the inner axis; the first changes nothing."""


@dataclass(frozen=True)
class Channels:
    """Assignment and signs of the channels of a file.

    `accelerometers`, `gyros`: of each axis the channel of the file, 1 to 3, with its sign. `alpha`, `beta`: -1 where an
    encoder turns the other way. `radians`: the angles of the table are in radians; `degrees`: the gyros give degrees.
    """

    accelerometers: Axes = (1, 2, 3)
    gyros: Axes = (1, 2, 3)
    alpha: int = 1
    beta: int = 1
    radians: bool = False
    degrees: bool = False

    @staticmethod
    def given(texts: Sequence[str]) -> "Channels":
        """Parse options `--channels`, several in one with blanks between; an InputError for any other text."""
        fields: dict[str, object] = {}
        for text in " ".join(texts).split():
            name, _, value = (part.strip() for part in (text if "=" in text else f"f={text}").partition("="))
            field, entry = _field(name, value)
            if entry is None:
                raise InputError(f"--channels {text}: is not known; {OPTIONS}")
            if field in fields:
                raise InputError(f"--channels {text}: {name} is said twice")
            fields[field] = entry
        return Channels(**fields)  # type: ignore[arg-type]

    @property
    def of_accelerometers(self) -> Floats:
        """The matrix (3, 3) by which their readings are multiplied."""
        return _matrix(self.accelerometers)

    @property
    def of_gyros(self) -> Floats:
        """The matrix (3, 3) by which their readings are multiplied."""
        size = 1.0
        if self.degrees:
            size = RADIANS
        return _matrix(self.gyros) * size

    @property
    def options(self) -> tuple[str, ...]:
        """Return the values of `--channels` that give these channels."""
        usual = Channels()
        options = {
            "angles=rad": self.radians,
            "alpha=-1": self.alpha < 0,
            "beta=-1": self.beta < 0,
            ",".join(map(str, self.accelerometers)): self.accelerometers != usual.accelerometers,
            "w=" + ",".join(map(str, self.gyros)): self.gyros != usual.gyros,
            "w=deg": self.degrees,
        }
        needed = []
        for option, is_needed in options.items():
            if is_needed:
                needed.append(option)
        return tuple(needed)

    def __str__(self) -> str:
        """As it is typed; nothing where nothing changes."""
        options = " ".join(self.options)
        quote = ""
        if " " in options:
            quote = '"'
        return options and f"--channels {quote}{options}{quote}"

    def after(self, before: "Channels") -> "Channels":
        """Return the channels of a file that result from these after those of `before`."""
        return Channels(
            tuple(_times(self.accelerometers, before.accelerometers)),  # type: ignore[arg-type]
            tuple(_times(self.gyros, before.gyros)),  # type: ignore[arg-type]
            self.alpha * before.alpha,
            self.beta * before.beta,
            self.radians or before.radians,
            # said once more it is taken back
            self.degrees != before.degrees,
        )


def reading_of(matrix: NDArray) -> Axes:
    """Return the channel of each axis, where the channels show a signed permutation (3, 3) of the axes."""
    channels = np.argmax(np.abs(matrix), axis=0)
    axes = []
    for axis, k in enumerate(channels):
        axes.append(int(np.sign(matrix[k, axis])) * (int(k) + 1))
    return cast(Axes, tuple(axes))


def _times(after: Axes, before: Axes) -> list[int]:
    return [int(np.sign(channel)) * before[abs(channel) - 1] for channel in after]


def _field(name: str, value: str) -> tuple[str, object]:
    """The field of `Channels` that an option means, and its value; None where it means nothing."""
    if name in ("f", "w") and (order := _order(value)) is not None:
        return ("accelerometers" if name == "f" else "gyros"), order
    fields: dict[tuple[str, str], tuple[str, object]] = {
        ("alpha", "-1"): ("alpha", -1),
        ("beta", "-1"): ("beta", -1),
        ("angles", "rad"): ("radians", True),
        ("w", "deg"): ("degrees", True),
    }
    return fields.get((name, value), ("", None))


def _order(value: str) -> Axes | None:
    texts = []
    for text in value.split(","):
        texts.append(text.strip())
    if not all(SIGNED.fullmatch(text) for text in texts) or len(texts) != 3:
        return None
    order = cast(Axes, tuple(map(int, texts)))
    if sorted(map(abs, order)) == [1, 2, 3]:
        return order
    return None


def far_better(costs: Floats) -> Ints:
    """Return the equally good ways of reading (n,) that fit far better than the first, the unchanged one.

    They are numbers of costs (W,), the best first (see `FAR_BETTER`); none where the best is not far better.
    """
    best = costs.min()
    if costs[0] - best > FAR_BETTER:
        same = np.flatnonzero(costs - best <= FAR_BETTER)
    else:
        same = np.zeros(0, dtype=int)
    return same[np.argsort(costs[same], kind="stable")]


def advice(ways: Sequence[tuple[Channels, str]], before: Channels | None) -> str:
    """Options that read a file in one of these ways: those of the one that changes least, and those of all others.

    Each is how it is read, and what else says the same, a mounting; `before` is how the file was read, None where as it
    stands.
    """
    # Among equal changes, a sense comes before an order.
    ways = sorted(ways, key=lambda way: (len(way[0].options), way[0].accelerometers != Channels().accelerometers))
    ways_in_words = []
    for channels, instead in ways[:MOST_LISTED]:
        ways_in_words.append(str(channels.after(before or Channels())) or "no --channels")
        if instead:
            ways_in_words.append(instead)
    if len(ways) > MOST_LISTED:
        ways_in_words.append(f"{len(ways) - MOST_LISTED} more")
    first, *alternatives = ways_in_words
    if not alternatives:
        return first
    return f"{first} (the record cannot tell that from: {'; or '.join(alternatives)})"
