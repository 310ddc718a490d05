"""Heads of columns: name and unit apart, and the record's column that a name means.

A name with two possible meanings has none: the user is asked.
"""

import re
import unicodedata
from collections.abc import Sequence
from dataclasses import dataclass, replace

from ..records.columns import APPROACH, INCREMENT, QUATERNION, TEXTS, UP
from ..records.columns import FORCE as FORCES
from ..records.columns import RATE as RATES
from ..records.columns import TEMPERATURE as TEMPERATURES
from ..records.columns import VELOCITY as VELOCITIES
from .tables import TABLES
from .units import ANGLE, FORCE, RATE, TEMPERATURE, LaboratoryUnit, known_unit, spelled_unit, units_beside_factor

POSITION, TIMES, DATE, SAMPLE = "position", "time_s", "date", "sample"
QUANTITY_OF: dict[str, str] = {column: quantity for column, (quantity, _) in TABLES["columns"].items()}
"""Column of a record -> quantity of its unit, without columns that have no unit."""
OWN_UNIT: dict[str, str] = {column: unit for column, (_, unit) in TABLES["columns"].items()}
"""Column of a record -> unit in its name."""
NOTHING = ("-", "--", "#")
"""Texts in a row of units that are not units."""
_FILLERS = TABLES["meaning"]["fillers"].split()
"""Words of heads that carry no meaning for the column."""
_TRIADS = dict(zip((FORCES, RATES, INCREMENT, VELOCITIES), TABLES["triads"].values(), strict=True))
"""Columns of three channels -> their names without the axis."""
_TIMES_BY_UNIT = re.compile(r"([munμµ]|milli|micro|nano)?s(ecs?|econds?)?|millis|micros|nanos")
"""Names of times that are their units."""
_READING = "r|rdg|reading|ablesung|lesung|messung|wdh|rep|repeat"
_NUMBERED = re.compile(
    rf"(?P<name>.*[^\d ]) ?(?<![^\W\d_])(?P<word>{_READING}) ?(?P<number>\d{{1,3}})"
    rf"|(?P<first>{_READING}) ?(?P<of>\d{{1,3}}) (?P<behind>.+)"
    r"|(?P<plain>.*[^\d ]) ?(?P<count>\d{1,3})"
    r"|(?P<before>[^\d ]+) ?(?P<inside>\d{1,3}) (?P<axis>[xyz])"
)
_BRACKET = re.compile(r"^(?P<name>.*?)\s*[\[({<](?P<unit>[^\[\](){}<>]*(?:\([^()]*\))?)[\])}>]\s*$", re.DOTALL)
_BESIDE = re.compile(r"^(?P<name>.*?)(?:\s+/\s*|\s+in\s+|\s*,\s*|\s*/\s*(?=\S+$))(?P<unit>\S+)$", re.DOTALL)


@dataclass(frozen=True)
class Heading:
    """A column's head as written, name and unit apart, and the record's column that it means ("" for none).

    If several numbered columns mean one, `numbered` is the record's column and `number` is this column's number.
    `reading` is True if the name counts readings instead of sensors.
    """

    text: str
    name: str
    unit: str = ""
    column: str = ""
    numbered: str = ""
    number: int = 0
    reading: bool = False

    @property
    def means_column(self) -> bool:
        """True if the head means a column of a record, alone or as one of several."""
        return bool(self.column or self.numbered)


def heading(text: str) -> Heading:
    """Split the head of a column, and find the column of a record that it means."""
    text = " ".join(text.split())
    if text in (POSITION, *APPROACH, *QUATERNION, *UP, *OWN_UNIT):
        return Heading(text, text, OWN_UNIT.get(text, ""), text)
    if text.casefold() in TEXTS:
        return Heading(text, text, "", text.casefold())
    # millis() of an Arduino, seconds_elapsed
    word = text.casefold().removesuffix("()").removesuffix("_elapsed")
    if len(word) > 1 and _TIMES_BY_UNIT.fullmatch(word) and known_unit(word) is not None:
        return Heading(text, text, word, TIMES)
    # gyro[0] and acc (x) have an axis, not the unit 0; accel_m_s2[0] has its unit before the number
    plain = re.sub(r"[\[(](\d|[xyzXYZ])[\])]", r" \1", text)
    # Accelerometer [m/s2] (z), acc [g].x
    plain = re.sub(r"^(.+?) ([\[(][^\])]+[\])])[ .]+(\w)$", r"\1 \3 \2", plain)
    numbered = re.fullmatch(r"(.+)[ _](\d)", plain)
    if numbered:
        for name, unit in _splits(f"{numbered[1]}"):
            stated = known_unit(unit)
            if stated is not None and column_of(f"{name} 1", stated):
                return of_name(text, f"{name} {numbered[2]}", unit)
    for name, unit in _splits(plain):
        head = of_name(text, name, unit)
        if head.means_column or unit:
            return head
    return of_name(text, plain, "")


def from_one(headings: Sequence[Heading]) -> tuple[Heading, ...]:
    """Renumber channels that are counted from 0: gyro0, gyro1, gyro2 become channels 1 to 3."""
    counted: dict[tuple[str, str], dict[int, int]] = {}
    for place, head in enumerate(headings):
        stem = re.fullmatch(r"(.*?[^\d.,]) ?([0-9])", normal(head.name))
        if stem:
            counted.setdefault((stem[1], head.unit), {})[int(stem[2])] = place
    recounted = list(headings)
    for (stem, _), places in counted.items():
        if 0 not in places:
            continue
        for number, place in places.items():
            head = headings[place]
            # four or more that are counted from 0 are not three channels
            name = ""
            if places.keys() == {0, 1, 2}:
                name = f"{stem} {number + 1}"
            recounted[place] = replace(of_name(head.text, name, head.unit), name=head.name)
    return tuple(recounted)


def of_name(text: str, name: str, unit: str) -> Heading:
    """Return the head of a column whose name and unit are known apart."""
    stated = known_unit(unit) if unit else None
    column = column_of(name, stated)
    numbered = None if column else _NUMBERED.fullmatch(normal(name))
    if numbered is None:
        return Heading(text, name, unit, column)
    bare = numbered["name"] or numbered["behind"] or numbered["plain"] or f"{numbered['before']} {numbered['axis']}"
    column = column_of(bare, stated)
    if column not in FORCES:
        return Heading(text, name, unit)
    number = numbered["number"] or numbered["of"] or numbered["count"] or numbered["inside"]
    return Heading(text, name, unit, "", column, int(number), bool(numbered["word"] or numbered["first"]))


def joined_head(above: str, below: str) -> str:
    """Join a head of two lines: "Acc [g]" above "x" is "Acc x [g]", "Time" above "s" is "Time [s]"."""
    above, below = above.strip(), below.strip()
    if not above or not below:
        return above or below
    if known_unit(below) is not None:
        return f"{above} [{spelled_unit(below)}]"
    bracket = _BRACKET.match(above)
    if not bracket or not bracket["name"]:
        return f"{above} {below}"
    unit = "" if _BRACKET.match(below) else f" [{bracket['unit']}]"
    return f"{bracket['name']} {below}{unit}"


def _splits(text: str) -> list[tuple[str, str]]:
    """Return the ways to split a head into name and unit, in order of trial; brackets always hold a unit."""
    bracket = _BRACKET.match(text)
    if bracket and bracket["name"]:
        return [(bracket["name"], bracket["unit"])]
    parts = re.split(r"[_\s]+|(?<=[a-z])(?=(?:Millis|Micros|Nanos|Seconds|[MUN]S)$)", text)
    splits = []
    for count in (1, 2, 3, 4):
        # acc_x_mps2, gyro_x_deg_s, acc_x_m_s2
        name, unit = "_".join(parts[:-count]), "/".join(parts[len(parts) - count :])
        stated = known_unit(unit) if name else None
        if stated is None:
            continue
        head = of_name(name, name, unit)
        # accel_m_s2 of accel_m_s2[0]
        column = head.column or head.numbered or column_of(f"{name} 1", None)
        quantity = QUANTITY_OF.get(column, "")
        if quantity and (stated.quantity == quantity or (stated.raw and quantity in (FORCE, RATE))):
            splits.append((name, unit))
    slash = _BESIDE.match(text)
    if slash and known_unit(slash["unit"]):
        splits.append((slash["name"], slash["unit"]))
    return splits


def gyro_of(head: Heading) -> str:
    """Return the gyro that "gx" means beside accelerometers; "" if it means none."""
    axis = re.fullmatch(r"g ?([xyz])", " ".join(word for word in normal(head.name).split() if word not in _FILLERS))
    unit = known_unit(head.unit)
    if axis is None or (unit is not None and not unit.raw):
        return ""
    return RATES["xyz".index(axis[1])]


def normal(text: str) -> str:
    """Return a name in lower case without accents, with blanks between its words, also of gyroADC, GyrX and XAccel."""
    text = re.sub(r"(?<=[a-z])(?=[A-Z])|(?<=[A-Z])(?=[A-Z][a-z])", " ", text)
    text = unicodedata.normalize("NFKD", text.replace("°", "\0")).casefold().replace("ß", "ss").replace("\0", "°")
    text = "".join(c for c in text if not unicodedata.combining(c))
    return " ".join(re.sub(r"[_.\-/:\s#%]+", " ", text).split())


def column_of(name: str, unit: LaboratoryUnit | None) -> str:
    """Return the record's column that a name means, with its unit if that is known; "" if it is not clear."""
    quantity = "" if unit is None or unit.raw else unit.quantity
    words, name = normal(name), name.strip()
    if not words and name in ("#", "№"):
        return POSITION
    for column, pattern in TABLES["patterns"].items():
        is_named = quantity in pattern["quantities"] and re.fullmatch("|".join(pattern["names"]), words)
        if is_named and (column, name) != (TIMES, "T"):
            return column
    if words == "t" and quantity == TEMPERATURE:
        return TEMPERATURES
    turn = re.fullmatch(r"(roll|pitch|yaw) ?(?:rate|angular rate|gyro)|(?:rate|gyro) ?(roll|pitch|yaw)", words)
    if turn and quantity in ("", RATE):
        return RATES[("roll", "pitch", "yaw").index(turn[1] or turn[2])]
    quaternion = re.fullmatch(r"(?:q|quat|quaternion) ?([wxyz])", words)
    if quaternion and not quantity:
        return QUATERNION["wxyz".index(quaternion[1])]
    meaningful = [word for word in words.split() if word not in _FILLERS or (word == "angle" and "delta" in words)]
    if quantity in ("", ANGLE) and len(meaningful) == 1:
        for column, names in TABLES["axes"].items():
            if meaningful[0] in names.split():
                return column
    return _triad(meaningful, quantity)


def _triad(words: list[str], quantity: str) -> str:
    """Return the channel of three that words name: "acc x", "ax", "gyro 2", "x" with a unit of specific force."""
    if len(words) == 2 and words[0] == "g":
        # gFx: in units of gravity
        words = ["".join(words)]
    if len(words) == 1:
        channel = re.fullmatch(r"(?P<stem>[^\W\d]*)(?P<axis>[xyz123])", words[0])
        if channel is None:
            return ""
        stem, axis = channel["stem"], channel["axis"]
    else:
        axes = [word for word in words if word in ("x", "y", "z", "1", "2", "3")]
        if len(axes) != 1 or len(words) > 4:
            return ""
        axis = axes[0]
        words.remove(axis)
        stem = " ".join(words)
    place = "xyz123".index(axis) % 3
    if stem in ("", "g", "channel", "kanal", "ch"):
        # only the unit gives such a name a meaning
        columns = {FORCE: FORCES, RATE: RATES}.get(quantity)
        return columns[place] if columns else ""
    for columns, names in _TRIADS.items():
        if stem in names or (columns is INCREMENT and stem == "delta" and quantity == ANGLE):
            return columns[place] if quantity in ("", QUANTITY_OF[columns[0]]) else ""
    return ""


def is_unit(text: str) -> bool:
    """Return True if a text is a unit, also beside a factor."""
    return known_unit(text) is not None or bool(units_beside_factor(text))


def is_unit_row(texts: list[str]) -> bool:
    """Return True if a row holds the units of the columns."""
    filled = units = 0
    for text in texts:
        if text.strip() and text.strip() not in NOTHING:
            filled += 1
            units += is_unit(text) or spelled_unit(text).lower() in ("1", "h:m:s", "grad")
    return units >= 3 and 2 * units > filled
