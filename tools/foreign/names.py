"""What names of columns mean: the columns of a record that laboratories call otherwise.

A name that could mean two columns means none: the person who knows is asked.
"""

import re
import unicodedata
from collections.abc import Sequence
from dataclasses import dataclass, replace

from ..records.columns import ANGLES, APPROACH, INCREMENT, MOUNTING, QUATERNION
from ..records.columns import FORCE as FORCES
from ..records.columns import RATE as RATES
from ..records.columns import TEMPERATURE as TEMPERATURES
from ..records.columns import VELOCITY as VELOCITIES
from .units import ANGLE, FORCE, RATE, TEMPERATURE, TIME, VELOCITY, Unit, known_unit, written

POSITION, TIMES, DATE, SAMPLE = "position", "time_s", "date", "sample"
QUANTITY_OF = {
    TIMES: TIME,
    SAMPLE: TIME,
    TEMPERATURES: TEMPERATURE,
    **dict.fromkeys((*ANGLES, *INCREMENT), ANGLE),
    **dict.fromkeys(FORCES, FORCE),
    **dict.fromkeys(RATES, RATE),
    **dict.fromkeys(VELOCITIES, VELOCITY),
}
"""Column of a record -> what its unit is of; a record's other columns have none."""
OWN_UNIT = {
    TIMES: "s",
    TEMPERATURES: "degC",
    **dict.fromkeys(ANGLES, "deg"),
    **dict.fromkeys(INCREMENT, "rad"),
    **dict.fromkeys(FORCES, "m/s2"),
    **dict.fromkeys(RATES, "rad/s"),
    **dict.fromkeys(VELOCITIES, "m/s"),
}
"""Units that stand in the names of a record's columns."""

_FILLERS, _OUTER, _INNER, _FORCE, _RATE = (
    frozenset(words.split())
    for words in (
        "angle winkel axis achse encoder enc drehtisch table tisch reading readings actual ist istwert raw roh rohwert "
        "measured gemessen mean mittel mittelwert avg average sensor signal output ausgang imu value wert угол ось "
        "axe field",
        "alpha α outer aussen aussenachse aussenwinkel aussere ausserer exterieur externe внешнии внешняя альфа",
        "beta β inner innen innenachse innenwinkel innere innerer interieur interne внутреннии внутренняя бета",
        "f a acc accel accelerometer acceleration akzelerometer beschl beschleunigung sf ускорение акселерометр",
        "w ω omega gyr gyro gyroscope kreisel drehrate rate omg winkelgeschwindigkeit гироскоп",
    )
)
_STEMS = "accelerometer|acceleration|accel|acc|gyroscope|gyro|gyr|omega|omg|rate|dtheta|dθ|dvel|dv|f|a|w|ω"
_POSITION = re.compile(
    r"(pos|position|stellung|lage|messpunkt|punkt|point|rest|позиция|положение)( ?(no|nr|number|nummer|index|id|№))?"
    r"|no|nr|n°|lfd ?nr|number|nummer|номер"
)
_TIME = re.compile(
    r"(elapsed |rel |relative |mess)?(time|zeit)( stamp|stempel| rel| of day)?|t|timestamp|x value|elapsed|temps"
    r"|stamp|header stamp|(unix ?|utc ?)?epoch|unix( ?time)?|uhrzeit|clock|date ?time"
    r"|datum ?(/|und)? ?(uhr)?zeit|zeitpunkt|время"
)
_NAMED_BY_UNIT = {
    **dict.fromkeys(("ms", "msec", "millis", "milliseconds"), "ms"),
    **dict.fromkeys(("us", "μs", "usec", "micros", "microseconds"), "us"),
    "seconds": "s",
}
"""Names of times that are their units."""
_DATE = re.compile(r"date|datum|дата")
_SAMPLE = re.compile(
    r"samples?( ?(no|nr|number|index|count|counter))?|counter|packet ?(counter|no)|index|idx|frame|scan"
)
_TEMPERATURE = re.compile(
    r"(block |imu |sensor |chip )?(temp|temperature|temperatur|температура)( ?(block|imu|sensor|chip))?"
)
_READING = "r|rdg|reading|ablesung|lesung|messung|wdh|rep|repeat"
_NUMBERED = re.compile(
    rf"(?P<name>.*[^\d ]) ?(?<![^\W\d_])(?P<said>{_READING}) ?(?P<number>\d{{1,3}})"
    rf"|(?P<first>{_READING}) ?(?P<of>\d{{1,3}}) (?P<behind>.+)"
    r"|(?P<plain>.*[^\d ]) ?(?P<count>\d{1,3})"
    r"|(?P<before>[^\d ]+) ?(?P<inside>\d{1,3}) (?P<axis>[xyz])"
)
_BRACKET = re.compile(r"^(?P<name>.*?)\s*[\[({<](?P<unit>[^\[\](){}<>]*(?:\([^()]*\))?)[\])}>]\s*$", re.DOTALL)
_BESIDE = re.compile(r"^(?P<name>.*?)(?:\s+/\s*|\s+in\s+|\s*,\s*|\s*/\s*(?=\S+$))(?P<unit>\S+)$", re.DOTALL)


@dataclass(frozen=True)
class Heading:
    """A column's head as it is written, name and unit apart, and the record's column that it means ("" for none).

    Of several columns that mean one, with numbers, `numbered` is the record's column, `number` that of this one, and
    `reading` whether the name says that readings are counted, and not sensors.
    """

    text: str
    name: str
    unit: str = ""
    column: str = ""
    numbered: str = ""
    number: int = 0
    reading: bool = False


def heading(text: str) -> Heading:
    """What the head of a column says."""
    text = " ".join(text.split())
    if text in (POSITION, *APPROACH, MOUNTING, *QUATERNION, *OWN_UNIT):
        return Heading(text, text, OWN_UNIT.get(text, ""), text)
    if text.casefold() in _NAMED_BY_UNIT:
        return Heading(text, text, _NAMED_BY_UNIT[text.casefold()], TIMES)
    # gyro[0] is numbered, and has no unit 0
    plain = re.sub(r"\[(\d)\]", r" \1", text)
    for name, unit in _splits(plain):
        found = of_name(text, name, unit)
        if found.column or found.numbered or unit:
            return found
    return of_name(text, plain, "")


def from_one(headings: Sequence[Heading]) -> tuple[Heading, ...]:
    """Heads of channels that are counted from 0 (gyro0, gyro1, gyro2) as those of channels 1 to 3."""
    counted: dict[tuple[str, str], dict[int, int]] = {}
    for place, head in enumerate(headings):
        found = re.fullmatch(r"(.*?[^\d.,]) ?([0-9])", normal(head.name))
        if found:
            counted.setdefault((found[1], head.unit), {})[int(found[2])] = place
    result = list(headings)
    for (stem, _), places in counted.items():
        for number, place in places.items() if 0 in places else ():
            head = headings[place]
            # four and more that are counted from 0 are not three channels
            meant = f"{stem} {number + 1}" if places.keys() == {0, 1, 2} else ""
            result[place] = replace(of_name(head.text, meant, head.unit), name=head.name)
    return tuple(result)


def of_name(text: str, name: str, unit: str) -> Heading:
    """What a head says whose name and unit are known apart."""
    known = known_unit(unit) if unit else None
    column = column_of(name, known)
    if column:
        return Heading(text, name, unit, column)
    found = _NUMBERED.fullmatch(normal(name))
    if found is None:
        return Heading(text, name, unit)
    bare = found["name"] or found["behind"] or found["plain"] or f"{found['before']} {found['axis']}"
    column = column_of(bare, known)
    if column not in FORCES:
        return Heading(text, name, unit)
    number = found["number"] or found["of"] or found["count"] or found["inside"]
    return Heading(text, name, unit, "", column, int(number), bool(found["said"] or found["first"]))


def joined(above: str, below: str) -> str:
    """A head in two lines as one: "Acc [g]" above "x" is "Acc x [g]", "Time" above "s" is "Time [s]"."""
    above, below = above.strip(), below.strip()
    if not above or not below:
        return above or below
    if known_unit(below) is not None:
        return f"{above} [{written(below)}]"
    found = _BRACKET.match(above)
    if found and found["name"]:
        unit = "" if _BRACKET.match(below) else f" [{found['unit']}]"
        return f"{found['name']} {below}{unit}"
    return f"{above} {below}"


def _splits(text: str) -> list[tuple[str, str]]:
    """Name and unit of a head, in the order in which they are tried; in brackets stands a unit, known or not."""
    found = _BRACKET.match(text)
    if found and found["name"]:
        return [(found["name"], found["unit"])]
    parts = re.split(r"[_\s]+", text)
    splits = []
    for count in (1, 2, 3):
        # acc_x_mps2, gyro_x_deg_s, acc_x_m_s2
        name, unit = "_".join(parts[:-count]), "/".join(parts[len(parts) - count :])
        known = known_unit(unit) if name else None
        found = of_name(name, name, unit) if known else None
        column = found.column or found.numbered if found else ""
        quantity = QUANTITY_OF.get(column, "")
        if known and quantity and (known.quantity == quantity or (known.raw and quantity in (FORCE, RATE))):
            splits.append((name, unit))
    found = _BESIDE.match(text)
    if found and known_unit(found["unit"]):
        splits.append((found["name"], found["unit"]))
    return splits


def gyro_of(head: Heading) -> str:
    """The gyro that "gx" means beside accelerometers; "" where it means none."""
    found = re.fullmatch(r"g ?([xyz])", normal(head.name))
    unit = known_unit(head.unit)
    return RATES["xyz".index(found[1])] if found and (unit is None or unit.raw) else ""


def normal(text: str) -> str:
    """A name in small letters without accents, with blanks between its words."""
    text = unicodedata.normalize("NFKD", text.replace("°", "\0")).casefold().replace("ß", "ss").replace("\0", "°")
    text = "".join(c for c in text if not unicodedata.combining(c))
    return " ".join(re.sub(r"[_.\-/:\s#%]+", " ", text).split())


def column_of(name: str, unit: Unit | None) -> str:
    """The record's column that a name means, with its unit where that is known; "" where it is not clear."""
    quantity = "" if unit is None or unit.raw else unit.quantity
    words = normal(name)
    if not words and name.strip() in ("#", "№"):
        return POSITION
    if quantity in ("", TIME):
        if _SAMPLE.fullmatch(words):
            return SAMPLE
        if _TIME.fullmatch(words) and name.strip() != "T":
            return TIMES
    if _TEMPERATURE.fullmatch(words) or (words == "t" and quantity == TEMPERATURE):
        return TEMPERATURES
    if not quantity and _POSITION.fullmatch(words):
        return POSITION
    if not quantity and _DATE.fullmatch(words):
        return DATE
    turning = re.fullmatch(r"(?:q|quat|quaternion) ?([wxyz])", words)
    if turning and not quantity:
        return QUATERNION["wxyz".index(turning[1])]
    left = [word for word in words.split() if word not in _FILLERS]
    if quantity in ("", ANGLE) and len(left) == 1:
        for column, known in zip(ANGLES, (_OUTER, _INNER), strict=True):
            if left[0] in known:
                return column
    return _triad(left, quantity)


def _triad(words: list[str], quantity: str) -> str:
    """The channel of three that words name: "acc x", "ax", "gyro 2", "x" with a unit of specific force."""
    if len(words) == 1:
        found = re.fullmatch(rf"({_STEMS})?([xyz123])|g([xyz123])", words[0])
        if found is None:
            return ""
        stem, axis = found[1] or ("g" if found[3] else ""), found[2] or found[3]
    else:
        axes = [word for word in words if word in ("x", "y", "z", "1", "2", "3")]
        stems = [word for word in words if word not in axes]
        if len(axes) != 1 or len(words) > 4:
            return ""
        axis, stem = axes[0], " ".join(stems)
    place = "xyz123".index(axis) % 3
    kinds = {
        FORCE: stem in _FORCE or stem in ("specific force", "linear acceleration"),
        RATE: stem in _RATE or stem in ("angular rate", "angular velocity", "rate gyro"),
        ANGLE: stem in ("dtheta", "dθ", "delta theta") or (stem == "delta" and quantity == ANGLE),
        VELOCITY: stem in ("dv", "dvel", "delta v", "delta vel", "delta velocity", "velocity increment"),
    }
    columns = {FORCE: FORCES, RATE: RATES, ANGLE: INCREMENT, VELOCITY: VELOCITIES}
    if stem in ("", "g", "channel", "kanal", "ch"):
        # the unit alone says what such a name means
        return columns[quantity][place] if quantity in (FORCE, RATE) else ""
    kind = next((kind for kind, meant in kinds.items() if meant), "")
    return columns[kind][place] if kind and quantity in ("", kind) else ""


def is_unit_row(texts: list[str]) -> bool:
    """Whether a row holds the units of the columns."""
    given = [text for text in texts if text.strip() and text.strip() not in ("-", "--", "#")]
    known = [text for text in given if known_unit(text) is not None or written(text).lower() in ("1", "h:m:s", "grad")]
    return len(known) >= 3 and 2 * len(known) > len(given)
