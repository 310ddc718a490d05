"""Which columns each kind of record has, and how the kind is recognised by them."""

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from difflib import get_close_matches
from pathlib import Path

import numpy as np

from ..errors import InputError

FORCE = ("f1_mps2", "f2_mps2", "f3_mps2")
RATE = ("w1_radps", "w2_radps", "w3_radps")
INCREMENT = ("dtheta1_rad", "dtheta2_rad", "dtheta3_rad")
QUATERNION = ("q0", "q1", "q2", "q3")
ANGLES = ("alpha_deg", "beta_deg")
TEMPERATURE = "temperature_degC"
MOUNTING = "mounting"
APPROACH = ("approach_alpha", "approach_beta")


@dataclass(frozen=True)
class Kind:
    """A kind of record: its name and the columns that it must and may have."""

    name: str
    required: tuple[str, ...]
    optional: tuple[str, ...]

    @property
    def known(self) -> tuple[str, ...]:
        """All columns that it may have."""
        return self.required + self.optional


POSITION = Kind("position record", ("position", "time_s", *ANGLES, *FORCE), (TEMPERATURE, *APPROACH, MOUNTING))
RAW = Kind("raw record", ("time_s", *ANGLES, *FORCE), (TEMPERATURE,))
STRAPDOWN_RATES = Kind("strapdown record", ("time_s", *RATE, *FORCE), (*QUATERNION, TEMPERATURE))
STRAPDOWN_INCREMENTS = Kind("strapdown record", ("time_s", *INCREMENT, *FORCE), (*QUATERNION, TEMPERATURE))
KINDS = (POSITION, STRAPDOWN_RATES, STRAPDOWN_INCREMENTS, RAW)
"""Every kind, the most special first: the first whose required columns are all there is the record's."""

TABLE_KINDS = (POSITION, RAW, STRAPDOWN_RATES, STRAPDOWN_INCREMENTS)
"""The same for a reader that wants a table's angles where they are given."""


@dataclass(frozen=True)
class Layout:
    """What is to be read from a file: the kind, its columns that are there, and the others."""

    kind: Kind
    present: tuple[str, ...]
    extra: tuple[str, ...]

    @property
    def numbers(self) -> tuple[str, ...]:
        """The columns of numbers that are there."""
        return tuple(name for name in self.present if name != MOUNTING)

    @property
    def texts(self) -> tuple[str, ...]:
        """The columns of names that are there."""
        return tuple(name for name in self.present if name == MOUNTING)


@dataclass(frozen=True, eq=False)
class Columns:
    """The columns of a file as they were read; NaN stands where an empty field is allowed (`q0..q3`).

    `resolution` is half a last digit of the specific forces [m/s²], `angle_resolution` of the angles [deg],
    `temperature_resolution` of the temperature [K].
    """

    path: Path
    layout: Layout
    numbers: dict[str, np.ndarray]
    texts: dict[str, tuple[str, ...]]
    row: np.ndarray
    resolution: float
    angle_resolution: float = 0.0
    temperature_resolution: float = 0.0

    def group(self, names: Sequence[str]) -> np.ndarray:
        """The named columns side by side, shape (N, len(names))."""
        return np.stack([self.numbers[name] for name in names], axis=1)

    def optional(self, name: str) -> np.ndarray | None:
        """A column of numbers (N,), None where the file has none."""
        return self.numbers.get(name)


def shown(text: str) -> str:
    """A field or a name as it can stand in a one-line message: quoted, escaped, cut."""
    return repr(text if len(text) <= 40 else text[:37] + "...")


class RecordError(InputError):
    """A record cannot be used; `row` and `column` say where, as far as that is known, `what` the rest."""

    def __init__(self, path: Path, row: int | None, column: str | None, what: str) -> None:
        place = [f"row {row}"] if row is not None else []
        place += [f"column {column}"] if column is not None else []
        super().__init__(f"{path}: {', '.join(place)}: {what}" if place else f"{path}: {what}")
        self.row, self.column, self.what = row, column, what


def refusal(path: Path, row: int | None, column: str | None, what: str) -> RecordError:
    """The error that names file, row and column, and says what is wrong and what would be right."""
    return RecordError(path, row, column, what)


def recognise(path: Path, names: Sequence[str], row: int | None, kinds: Sequence[Kind] = KINDS) -> Layout:
    """Find the kind of a record by its columns.

    Parameters
    ----------
    path : Path
        the file, for messages
    names : sequence of str
        the columns in the order of the file
    row : int or None
        the header's row, for messages
    kinds : sequence of Kind
        in the order of preference

    Raises
    ------
    InputError
        when a name is empty or repeated, or the columns are those of no kind
    """
    if len(names) == 1:
        for mark, called in ((";", "semicolons"), ("\t", "tabs")):
            if mark in names[0]:
                raise refusal(path, row, None, f"the fields are separated by {called}; use commas")
    for place, name in enumerate(names, 1):
        if not name:
            raise refusal(path, row, None, f"field {place} of the header is empty; each column needs a name")
    repeated = [name for name, count in Counter(names).items() if count > 1]
    if repeated:
        raise refusal(path, row, None, f"column {shown(repeated[0])} is there more than once; keep one")

    kind = next((kind for kind in kinds if set(kind.required) <= set(names)), None)
    if kind is RAW and _meant_position(names):
        raise _incomplete(path, names, row, POSITION)
    if kind is None:
        raise _incomplete(path, names, row, _nearest_kind(names, kinds))
    if {*RATE, *INCREMENT} <= set(names) and kind in (STRAPDOWN_RATES, STRAPDOWN_INCREMENTS):
        what = "rates (w1_radps..) and increments (dtheta1_rad..) are both there; keep one of them"
        raise refusal(path, row, None, what)
    quaternion = [name for name in QUATERNION if name in names]
    if QUATERNION[0] in kind.optional and 0 < len(quaternion) < 4:
        missing = next(name for name in QUATERNION if name not in names)
        raise refusal(path, row, None, f"column '{missing}' is missing: the attitude needs q0, q1, q2, q3")
    present = tuple(name for name in kind.known if name in names)
    return Layout(kind, present, tuple(name for name in names if name not in present))


def extra_warning(path: Path, layout: Layout) -> tuple[str, ...]:
    """One line that names the columns left out, with the optional column that each may have meant."""
    if not layout.extra:
        return ()
    absent = [name for name in layout.kind.optional if name not in layout.present]
    said = []
    for name in layout.extra[:8]:
        close = get_close_matches(name, absent, n=1, cutoff=0.75)
        said.append(f"{shown(name)} (did you mean '{close[0]}'?)" if close else shown(name))
    rest = len(layout.extra) - len(said)
    more = f" and {rest} more" if rest else ""
    return (f"{path}: not columns of a {layout.kind.name}, left out: {', '.join(said)}{more}",)


def _meant_position(names: Sequence[str]) -> bool:
    """Whether the columns of a raw record come with what only a position record has."""
    own = {*APPROACH, MOUNTING} & set(names)
    return bool(own) or bool(get_close_matches("position", names, n=1, cutoff=0.8))


def _nearest_kind(names: Sequence[str], kinds: Sequence[Kind]) -> Kind:
    def distance(kind: Kind) -> tuple[int, int]:
        own = (set(kind.known) - {"time_s", *FORCE}) & set(names)
        return len(set(kind.required) - set(names)), -len(own)

    return min(kinds, key=distance)


def _incomplete(path: Path, names: Sequence[str], row: int | None, kind: Kind) -> InputError:
    missing = [name for name in kind.required if name not in names]
    strange = [name for name in names if name not in kind.known]
    close = get_close_matches(missing[0], strange, n=1, cutoff=0.6)
    hint = f" (is {shown(close[0])} meant?)" if close else ""
    verb = "columns" if len(missing) > 1 else "column"
    listed = ", ".join(f"'{name}'" for name in missing)
    asked = ",".join(kind.required)
    what = f"{verb} {listed} missing for a {kind.name}{hint}; it needs {asked}"
    return refusal(path, row, None, what)
