"""Whether an effect of a user's own is what it says: names, places, units, limits, kernel, signature.

Each thing is tried on a few rows that are drawn once for all; the first that is wrong is said in one line.
"""

import inspect
import math
import re
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...fmus.catalogue import COMPONENTS
from ...fmus.component import extend
from ...fmus.native.translate import RestrictionError, translate
from ...fmus.source import flat_parts
from ...fmus.units import UNITS, unit_named
from ...models.effects import Effect, EffectParameter, EffectPlace, MotionRows, Rows, Variant
from ...models.effects.definition import ACCELEROMETERS, AXES, GYRO_BLOCK, turned, whole_numbers
from ...models.restricted import (
    ALPHA,
    ANGULAR_ACCELERATION,
    BETA,
    CONTEXT_SIZE,
    GRAVITY,
    GYRO_CONTEXT_SIZE,
    HOURS,
    INPUT,
    INTERVAL,
    PREVIOUS_RATE,
    RATE,
    RESPONSE,
    SENSE_ALPHA,
    SENSE_BETA,
    SENSE_INPUT,
    STEP_LENGTH,
    TEMPERATURE,
)
from ..errors import InputError, nearest, one_line

STAGES = {
    ("AccelerometerBlock", "reading_effects"): (ACCELEROMETERS, 3),
    ("AccelerometerBlock", "final_effects"): (ACCELEROMETERS, 3),
    ("TurntableMotion", "encoder_effects"): ((*AXES, "base"), 2),
    ("TurntableMotion", "geometry_effects"): ((*AXES, "base", "mounting"), 7),
    ("GyroBlock", "reading_effects"): ((GYRO_BLOCK,), 3),
    ("GyroBlock", "final_effects"): ((GYRO_BLOCK,), 3),
    ("AttitudeComputer", "increment_effects"): (("attitude-computer",), 3),
}
"""Components and stages that effects extend: where they sit, and to how many values they add."""
ROWS = 7
AT_REST, IN_MOTION = (0.1, 0.5), (1e-5, 2e-5)
"""Parts of the largest coefficients of the differences that a signature is held against; in motion to first order."""
AGREE, FIRST_ORDER = 1e-6, 1e-3
"""Relative differences by which signature and kernel may miss each other, at rest and in motion."""
Refusal = Callable[[str, str], InputError]
"""A field and what is wrong with it -> what is raised."""
NAME = re.compile(r"[a-z][a-z0-9]*(-[a-z0-9]+)*")
PARAMETER = re.compile(r"[a-z][a-z0-9]*(_[a-z0-9]+)*")


def check_effect(path: str, effect: Effect) -> Effect:
    """The effect; an InputError says which of its fields is wrong, and what would be right."""

    def refuse(field: str, why: str) -> InputError:
        line = ""
        if field == "kernel" and inspect.isfunction(effect.kernel):
            line = f", line {effect.kernel.__code__.co_firstlineno}"
        return InputError(f"{path}{line}: effect {one_line(effect.name)}: {field} {why}")

    if not NAME.fullmatch(effect.name):
        raise refuse("name", "is not in small letters and hyphens, as half-scale")
    stage = (str(effect.component), str(effect.stage))
    if stage not in STAGES:
        known = "; ".join(f"{component} with {name}" for component, name in STAGES)
        raise refuse("component and stage", f"are {effect.component} and {effect.stage}; there are {known}")
    if not (isinstance(effect.places, tuple) and effect.places):
        raise refuse("places", "are not a tuple of at least one EffectPlace")
    for place in effect.places:
        if not isinstance(place, EffectPlace):
            raise refuse("places", f"have a {type(place).__name__} in them, not an EffectPlace")
        if place.effect != effect.name:
            raise refuse("places", f"have one of effect {place.effect!r}; it is {effect.name!r} there, too")
        if place.where not in STAGES[stage][0]:
            raise refuse("places", f"have {place.where!r}; at {stage[1]} there are {', '.join(STAGES[stage][0])}")
        if any(axis not in (1, 2, 3) for axis in place.axes) or not (
            place.order is None or place.order in range(1, 100)
        ):
            raise refuse("places", f"have {place.title}; axes are from 1 to 3, an order is a whole number from 1")
    if len(set(effect.places)) < len(effect.places):
        raise refuse("places", "have one twice")
    either = stage[0] in ("AccelerometerBlock", "TurntableMotion")
    if effect.in_motion != (stage[0] in ("GyroBlock", "AttitudeComputer")) and not either:
        raise refuse("in_motion", f"is {effect.in_motion}; that of {stage[0]} is {not effect.in_motion}")
    for place in effect.places:
        with said_of_field(refuse, "of_place"):
            there = effect.at(place)
        _check_at(place, there, refuse)
    return effect


@contextmanager
def said_of_field(refuse: Refusal, field: str) -> Iterator[None]:
    """Say whatever a function of a user's raises of the field that it is."""
    try:
        yield
    except InputError:
        raise
    except Exception as error:
        said = one_line(" ".join(str(error).split()))
        raise refuse(field, f"raises {type(error).__name__}: {said}") from error


def _check_at(place: EffectPlace, effect: Effect, refuse: Refusal) -> None:
    """The effect as it is at one of its places."""
    _check_parameters(effect, refuse)
    kernel = effect.kernel
    if not inspect.isfunction(kernel):
        raise refuse("kernel", f"is {kernel!r}; it is a function in restricted Python, by which it is exported")
    with said_of_field(refuse, "kernel"):
        kinds = [str(p.annotation) for p in inspect.signature(kernel).parameters.values()]
        whole = len(whole_numbers(kernel))
    wanted = 2 + whole + len(effect.parameters) + 1
    if len(kinds) != wanted:
        numbers = f", {whole} whole number{'s' * (whole != 1)}" if whole else ""
        values = ", ".join(p.name for p in effect.parameters)
        raise refuse(
            "kernel",
            f"takes {len(kinds)} arguments; it takes {wanted}: context, values{numbers}, {values}, and what it adds to",
        )
    with said_of_field(refuse, "kernel"):
        try:
            translate(flat_parts(extend(COMPONENTS[str(effect.component)], [place])))
        except RestrictionError as error:
            raise refuse("kernel", f"is not in restricted Python: {error}") from error
        except (TypeError, OSError, ValueError) as error:
            raise refuse("kernel", f"cannot be carried to an FMU: {one_line(str(error))}") from error
    with said_of_field(refuse, "sentence"):
        middle = {p.name: 0.5 * (p.largest + (p.smallest or 0.0)) for p in effect.parameters}
        said = effect.sentence(place, middle)
    if not isinstance(said, str) or not said.strip() or not said.isprintable():
        raise refuse("sentence", "gives no line of text")
    if effect.formula:
        with said_of_field(refuse, "formula"):
            names = {p.name: "1" for p in effect.parameters}
            effect.formula.format(p="1", i="1", j="2", angle="α", order="1", **names)
    if effect.variants is not None:
        _check_variants(place, effect, refuse)
    else:
        _check_signature(place, effect, refuse)


def _check_parameters(effect: Effect, refuse: Refusal) -> None:
    parameters = effect.parameters
    if not (isinstance(parameters, tuple) and parameters):
        raise refuse("parameters", "are not a tuple of at least one EffectParameter")
    for k, p in enumerate(parameters):
        if not isinstance(p, EffectParameter):
            raise refuse("parameters", f"have a {type(p).__name__} in them, not an EffectParameter")
        if not PARAMETER.fullmatch(str(p.name)):
            raise refuse("parameters", f"have the name {p.name!r}; small letters, digits and _ are right")
        try:
            unit_named(str(p.unit))
        except KeyError:
            raise refuse(
                f"parameter {p.name}", f"has the unit {p.unit!r}; {nearest(str(p.unit), list(UNITS))}"
            ) from None
        if not _is_number(p.largest) or not p.largest > 0.0:
            raise refuse(f"parameter {p.name}", f"has largest = {p.largest!r}; a finite number above 0 is right")
        if p.smallest is not None and not (_is_number(p.smallest) and p.smallest < p.largest):
            raise refuse(f"parameter {p.name}", f"has smallest = {p.smallest!r}; a number below {p.largest:g} is right")
        if p.name.endswith("phase") and not (k and parameters[k - 1].name.endswith("amplitude")):
            raise refuse(f"parameter {p.name}", "is a phase without an amplitude before it")
    if len({p.name for p in parameters}) < len(parameters):
        raise refuse("parameters", "have a name twice")


def _is_number(value: object) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool) and math.isfinite(value)


# Rows on which effects are tried


def rows_at_rest() -> Rows:
    """A few rows of a table's record."""
    rng = np.random.default_rng(17)
    n = rng.normal(size=(ROWS, 3))
    n /= np.linalg.norm(n, axis=1)[:, None]
    by_alpha, by_beta, by_kappa, by_epsilon = rng.uniform(-1.0, 1.0, (4, ROWS, 3))
    return Rows(
        hours=np.linspace(0.0, 2.0, ROWS),
        alpha=rng.uniform(-3.0, 3.0, ROWS),
        beta=rng.uniform(-3.0, 3.0, ROWS),
        n=n,
        temperature=rng.uniform(15.0, 30.0, ROWS),
        input_sense=rng.choice([-1.0, 1.0], (ROWS, 3)),
        by_alpha=by_alpha,
        by_beta=by_beta,
        by_kappa=by_kappa,
        by_epsilon=by_epsilon,
        sense_alpha=rng.choice([-1.0, 1.0], ROWS),
        sense_beta=rng.choice([-1.0, 1.0], ROWS),
        axis_rates=rng.uniform(-1.0, 1.0, (ROWS, 2)),
    )


def rows_in_motion() -> MotionRows:
    """A few steps of a block that is carried."""
    rng = np.random.default_rng(17)
    step = np.full(ROWS, 0.01)
    rate, before = rng.uniform(-2.0, 2.0, (2, ROWS, 3))
    force = rng.uniform(-1.0, 1.0, (ROWS, 3))
    warm = rng.uniform(15.0, 30.0, ROWS)
    return MotionRows(rate, before, force, np.linspace(0.0, 0.02, ROWS), step, warm, period=0.01)


def added_by(place: EffectPlace, effect: Effect, values: Sequence[float], rows: Any) -> NDArray[np.float64]:
    """What the kernel makes of rows (N, 3), or of turns (N, 4) for an effect on the table, (N, 7) of its mounting."""
    assert effect.kernel is not None
    size = STAGES[(str(effect.component), str(effect.stage))][1]
    shown = np.zeros((ROWS, size))
    for row in range(ROWS):
        context, given = _context(effect, rows, row)
        last = [0.0] * size
        effect.kernel(context, given, *effect.place_numbers(place), *map(float, values), last)
        shown[row] = last
    if effect.stage == "encoder_effects":
        turns = np.zeros((ROWS, 4))
        turns[:, 1::2] = -shown
        return turns
    if effect.stage == "geometry_effects" and place.where != "mounting":
        # The last three are of the mounting.
        return shown[:, :4]
    if effect.component == "AttitudeComputer":
        # The computer adds what the readings lack.
        return -shown / rows.step[:, None]
    return shown


def _context(effect: Effect, rows: Any, row: int) -> tuple[list[float], list[float]]:
    """The circumstances of a row, and the values of the stage there."""
    context = [0.0] * (GYRO_CONTEXT_SIZE if effect.component == "GyroBlock" else CONTEXT_SIZE)
    context[HOURS], context[TEMPERATURE] = float(rows.hours[row]), float(rows.temperature[row])
    if isinstance(rows, MotionRows):
        rate, force = rows.rate[row].tolist(), rows.specific_force[row].tolist()
        context[INPUT : INPUT + 3] = force
        if effect.component == "AttitudeComputer":
            return (rows.rate_before[row] * rows.step[row]).tolist(), (rows.rate[row] * rows.step[row]).tolist()
        if effect.component == "GyroBlock":
            context[STEP_LENGTH] = context[INTERVAL] = float(rows.step[row])
            context[PREVIOUS_RATE : PREVIOUS_RATE + 3] = rows.rate_before[row].tolist()
            context[RESPONSE : RESPONSE + 9] = rows.response.ravel().tolist()
            return context, rate
        context[RATE : RATE + 3] = rate
        change = (rows.rate[row] - rows.rate_before[row]) / rows.step[row]
        context[ANGULAR_ACCELERATION : ANGULAR_ACCELERATION + 3] = change.tolist()
        context[GRAVITY] = rows.gravity
        return context, force
    angles = [float(rows.alpha[row]), float(rows.beta[row])]
    context[ALPHA], context[BETA] = angles
    if effect.component == "TurntableMotion":
        context[SENSE_ALPHA], context[SENSE_BETA] = float(rows.sense_alpha[row]), float(rows.sense_beta[row])
        if effect.in_motion:
            context[RATE : RATE + 2] = rows.axis_rates[row].tolist()
        return context, angles
    context[SENSE_INPUT : SENSE_INPUT + 3] = rows.input_sense[row].tolist()
    context[INPUT : INPUT + 3] = rows.n[row].tolist()
    context[GRAVITY] = 9.80665
    return context, rows.n[row].tolist()


# The signature against the kernel


def _check_signature(place: EffectPlace, effect: Effect, refuse: Refusal) -> None:
    """The signature is what the kernel adds for one unit of each coefficient, in its sum."""
    count = len(effect.linear_parameters)
    of_table = effect.component == "TurntableMotion"
    rows: Any = rows_in_motion() if effect.in_motion and not of_table else rows_at_rest()
    with said_of_field(refuse, "signature"):
        columns = np.asarray(effect.signature(place, rows), dtype=float)
    if columns.shape != (ROWS, 3, count):
        raise refuse("signature", f"gives an array {columns.shape} for {ROWS} rows; ({ROWS}, 3, {count}) is right")
    if not np.isfinite(columns).all():
        raise refuse("signature", "is not a finite number on some rows")
    with said_of_field(refuse, "needs"):
        if "temperature" not in effect.needs:
            without = replace(rows, temperature=None)
            effect.signature(place, without)
    if effect.component == "TurntableMotion" and effect.turns is None:
        raise refuse("turns", "are missing: an effect on the table is made by table_effect, from its small turns")

    def reads(coefficients: NDArray[np.float64]) -> NDArray[np.float64]:
        with said_of_field(refuse, "from_coefficients"):
            values = effect.from_coefficients(coefficients)
        if len(values) != count:
            raise refuse("from_coefficients", f"gives {len(values)} values for {count} parameters")
        with said_of_field(refuse, "kernel"):
            # What sets in at a time acts on all of these rows, and what fades has hardly begun to.
            shape = (*[-1.0] * effect.sets_in, *[math.inf] * effect.fades)
            seen = added_by(place, effect, (*values, *shape), rows)
        if not np.isfinite(seen).all():
            raise refuse("kernel", "does not give a finite number on some rows")
        return seen

    nothing = reads(np.zeros(count))
    if np.abs(nothing).max() > 1e-12:
        raise refuse("kernel", "adds something where its parameters are zero")
    slopes, agree = [], FIRST_ORDER if effect.in_motion else AGREE
    largest = float(min(p.largest for p in effect.linear_parameters if not p.name.endswith("phase")))
    for size in (part * largest for part in (IN_MOTION if effect.in_motion else AT_REST)):
        slopes.append(np.stack([reads(size * unit) / size for unit in np.eye(count)], axis=2))
        # What only grows has no other side.
        if all(p.smallest is None for p in effect.linear_parameters):
            slopes.append(np.stack([reads(-size * unit) / -size for unit in np.eye(count)], axis=2))
    scale = max(1.0, float(np.abs(slopes[0]).max()))
    if max(float(np.abs(slopes[0] - other).max()) for other in slopes[1:]) > agree * scale:
        raise refuse(
            "kernel", "is not linear in its parameters; an effect that is not has variants in place of a signature"
        )
    size = largest * (IN_MOTION if effect.in_motion else AT_REST)[0]
    if np.abs(reads(size * np.ones(count)) / size - slopes[0].sum(axis=2)).max() > agree * scale * count:
        raise refuse("kernel", "does not add its parameters' parts: together they do something else than each alone")
    expected = slopes[0]
    if effect.turns is not None:
        with said_of_field(refuse, "turns"):
            small = np.asarray(effect.turns(place, rows), dtype=float)
        if small.shape != (ROWS, 4, count):
            raise refuse("turns", f"give an array {small.shape} for {ROWS} rows; ({ROWS}, 4, {count}) is right")
        _agree("turns", small, expected, effect, refuse)
        expected = turned(rows, expected)
    _agree("signature", columns, expected, effect, refuse)
    if np.abs(columns).max() == 0.0 and not effect.in_motion:
        raise refuse("signature", "is zero on every row: it adds nothing")


def _agree(
    field: str,
    said: NDArray[np.float64],
    done: NDArray[np.float64],
    effect: Effect,
    refuse: Refusal,
) -> None:
    miss = np.abs(said - done)
    if miss.max() > (FIRST_ORDER if effect.in_motion else AGREE) * max(1.0, float(np.abs(done).max())):
        row, part, k = np.unravel_index(int(miss.argmax()), miss.shape)
        raise refuse(
            field,
            f"says {said[row, part, k]:.6g} of component {part + 1} by {effect.parameters[k].name}, and by differences "
            f"the kernel adds {done[row, part, k]:.6g}; they have to agree",
        )


def _check_variants(place: EffectPlace, effect: Effect, refuse: Refusal) -> None:
    """The ways in which an effect that is not linear can act are ways, and its kernel runs."""
    assert effect.variants is not None
    rows: Any = rows_in_motion() if effect.in_motion else rows_at_rest()
    reading = rows.rate if isinstance(rows, MotionRows) else rows.n
    with said_of_field(refuse, "variants"):
        ways = effect.variants(place, rows, np.array(reading), 1e-5)
    if not isinstance(ways, Sequence) or not all(isinstance(way, Variant) for way in ways):
        raise refuse("variants", "give no list of Variant")
    for way in ways:
        if way.offset.shape != reading.shape or way.columns.shape[:2] != reading.shape:
            raise refuse("variants", f"have arrays {way.offset.shape} and {way.columns.shape} for rows {reading.shape}")
        if len(way.limits) != len(effect.parameters):
            raise refuse("variants", f"limit {len(way.limits)} parameters of {len(effect.parameters)}")
    values = [0.5 * (p.largest + (p.smallest or 0.0)) for p in effect.parameters]
    with said_of_field(refuse, "kernel"):
        seen = added_by(place, effect, values, rows)
    if not np.isfinite(seen).all():
        raise refuse("kernel", "does not give a finite number on some rows")
