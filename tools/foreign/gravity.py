"""Ask for the sum of acceleration without gravity and gravity, as phones write them: accelerometers read both."""

from collections.abc import Sequence

from ..records.columns import FORCE
from .names import normal
from .ranking import MOST_TRIADS, force_units, is_estimate_of_gravity, median_size, named_triads, unnamed_triads
from .understanding import Field, UnderstoodTable
from .units import FORCE as FORCE_QUANTITY


def ask_of_sum(table: UnderstoodTable, without: Sequence[Field]) -> bool:
    """Ask which columns without gravity and with gravity are added; return False if the table has no gravity."""
    sums = _sums_with_gravity(table, without)
    if sums is None:
        return False
    gravity, answers = sums
    table.proposed[FORCE_QUANTITY] = gravity
    table.ask(f"columns.{FORCE_QUANTITY}", answers, "acceleration without gravity, and gravity: their sum is read")
    ask_of_sign(table, gravity)
    return True


def ask_of_sign(table: UnderstoodTable, fields: Sequence[Field]) -> None:
    """Ask for the sign of accelerometers of a phone: Core Motion, in g, counts against what accelerometers read."""
    if "sign" not in table.mapping.of(FORCE[0]).model_fields_set:
        signs = ("-1", "1") if force_units(median_size(table, fields))[:1] == ["g"] else ("1", "-1")
        table.ask(
            f"columns.{FORCE_QUANTITY}.sign",
            signs,
            "-1 where gravity points down in them, as from an iPhone, 1 from Android",
        )


def _sums_with_gravity(table: UnderstoodTable, without: Sequence[Field]) -> tuple[tuple[Field, ...], list[str]] | None:
    """Return the columns of gravity, and answers that add them to acceleration without gravity; None if none has it."""
    triads = named_triads(table.filled)
    named = [triad for triad in triads if not {"grav", "gravity"}.isdisjoint(normal(triad.fields[0].head.name).split())]
    # beside gravity there are gyros, too
    has_more = not triads and len(table.filled) >= 9
    unnamed = unnamed_triads(table, table.filled) if has_more else []
    gravity = next((triad.fields for triad in named or unnamed if is_estimate_of_gravity(table, triad)), None)
    if gravity is None or (named and len(without) != 3):
        return None
    accelerations = [tuple(without)]
    if not named:
        # the next three columns first
        places = [field.place for field in gravity]
        others = [triad.fields for triad in unnamed if {field.place for field in triad.fields}.isdisjoint(places)]
        accelerations = sorted(others, key=lambda fields: (fields[0].place - places[2] - 1) % len(table.fields))
    answers = []
    for fields in accelerations[:MOST_TRIADS]:
        answers.append(",".join(f"{one.label}+{other.label}" for one, other in zip(fields, gravity, strict=True)))
    return gravity, answers
