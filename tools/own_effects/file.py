"""Effects from a user's own file: run because the user names it, checked, and tried like those of the catalogue.

Nothing but an option names such a file; a scenario or a record never does.
"""

import ast
import hashlib
import inspect
import linecache
import math
import re
import sys
import traceback
import warnings
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from types import ModuleType

import numpy as np

from ...fmus.catalogue import COMPONENTS
from ...fmus.component import extend
from ...fmus.native.translate import RestrictionError, translate
from ...fmus.source import flat_parts, kernel_functions
from ...fmus.units import UNITS, unit_named
from ...models.arrays import Floats
from ...models.effects import (
    CATALOGUE,
    POSITION_EFFECTS,
    STRAPDOWN_EFFECTS,
    Effect,
    EffectParameter,
    EffectPlace,
    MotionRows,
    Rows,
    Variant,
)
from ...models.effects.columns import ONSET, PORTS, WHOLE, ports
from ...models.effects.definition import ACCELEROMETERS, AXES, GYRO_BLOCK, whole_numbers
from ..errors import InputError, nearest, one_line
from ..files import advice_on, bytes_of

TABLE_PLACES = (*AXES, "base")
STAGES = {
    ("AccelerometerBlock", "reading_effects"): ACCELEROMETERS,
    ("AccelerometerBlock", "final_effects"): ACCELEROMETERS,
    ("TurntableMotion", "encoder_effects"): TABLE_PLACES,
    ("TurntableMotion", "geometry_effects"): (*TABLE_PLACES, "mounting"),
    ("GyroBlock", "reading_effects"): (GYRO_BLOCK,),
    ("GyroBlock", "final_effects"): (GYRO_BLOCK,),
    ("AttitudeComputer", "increment_effects"): ("attitude-computer",),
}
"""Components and stages that effects extend, and the places there."""
COUNT = 7
"""Rows on which a kernel is tried."""
AT_REST, IN_MOTION = (0.1, 0.5), (1e-5, 2e-5)
"""Parts of the largest coefficients at which a kernel has to be linear; in motion to first order."""
AGREE, FIRST_ORDER = 1e-6, 1e-3
"""Largest relative differences from a linear response, at rest and in motion."""
Refusal = Callable[[str, str], InputError]
"""A field and its fault -> the error to raise."""
NAME = re.compile(r"[a-z][a-z0-9]*(-[a-z0-9]+)*")
PARAMETER = re.compile(r"[a-z][a-z0-9]*(_[a-z0-9]+)*")
LARGEST_FILE = 1 << 20
"""Bytes of a file of effects."""
BUILT_IN = frozenset(CATALOGUE)
"""Names that no effect of a user's own can have."""


@dataclass(frozen=True)
class OwnEffects:
    """A file of effects as it was read: worker processes and later readers run the same text.

    Attributes
    ----------
    path : str
        as the user named it
    source : str
        its text
    """

    path: str
    source: str

    @staticmethod
    def read(path: "str | Path | OwnEffects | None") -> "OwnEffects | None":
        """The file of that name; an InputError where it cannot be read, None where none is named."""
        if path is None or isinstance(path, OwnEffects):
            return path
        file = Path(path)
        content = bytes_of(file, "a file of effects is needed", label=f"--effects-from {file}", most=LARGEST_FILE)
        advice = advice_on(file, content)
        if advice:
            raise InputError(f"--effects-from {file}: is not a file of effects{advice}")
        try:
            return OwnEffects(str(file), content.decode("utf-8-sig"))
        except UnicodeDecodeError as error:
            raise InputError(
                f"--effects-from {file}: is not UTF-8 text ({error.reason} at byte {error.start})"
            ) from error

    def effects(self) -> tuple[Effect, ...]:
        """Return the checked effects of the file; an InputError names the wrong line or field and the reason."""
        if self not in _LOADED:
            effects_given = self._given()
            # An effect is looked up by its name, in its check too.
            with _known(effects_given), warnings.catch_warnings():
                warnings.simplefilter("ignore")
                checked = []
                for effect in effects_given:
                    checked.append(check_effect(self.path, effect))
                _LOADED[self] = tuple(checked)
        return _LOADED[self]

    def _given(self) -> list[Effect]:
        """Return the effects of the file, from EFFECT or EFFECTS."""
        module = self._run()
        single, several = getattr(module, "EFFECT", None), getattr(module, "EFFECTS", None)
        if single is None and several is None:
            raise InputError(
                f"{self.path}: gives neither EFFECT nor EFFECTS; EFFECT = accelerometer_effect(...) is one"
            )
        if several is not None and not isinstance(several, list | tuple):
            raise InputError(f"{self.path}: EFFECTS is a {type(several).__name__}; it is a tuple of effects")
        fields = []
        if single is not None:
            fields.append(("EFFECT", single))
        for k, effect in enumerate(several or ()):
            fields.append((f"EFFECTS[{k}]", effect))
        if not fields:
            raise InputError(f"{self.path}: EFFECTS is empty; it is a tuple of effects")
        effects: dict[str, Effect] = {}
        for field, effect in fields:
            if not isinstance(effect, Effect):
                what = f"a {type(effect).__name__}"
                raise InputError(
                    f"{self.path}: {field} is {what}; accelerometer_effect, table_effect and so on give an Effect"
                )
            if not isinstance(effect.name, str):
                raise InputError(f"{self.path}: {field}: name is a {type(effect.name).__name__}; it is text")
            if effect.name in BUILT_IN:
                raise InputError(
                    f"{self.path}: {field}: {effect.name} is an effect of the catalogue; take another name"
                )
            if effects.get(effect.name, effect) is not effect:
                raise InputError(f"{self.path}: {field}: {effect.name} stands there twice; give each its own name")
            effects[effect.name] = effect
        return list(effects.values())

    def _run(self) -> ModuleType:
        """The file's module, run from the text that was read."""
        name = f"trihedron_effects_{hashlib.sha256(f'{self.path} {self.source}'.encode()).hexdigest()[:16]}"
        origin = Path(self.path).name
        # Kernels are read from their source: that of this very text, whatever becomes of the file.
        lines = self.source.splitlines(keepends=True)
        linecache.cache[origin] = (len(self.source), None, lines, origin)
        module = ModuleType(name)
        module.__file__, module.__package__ = origin, ""
        sys.modules[name] = module
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")
                code = compile(ast.parse(self.source, origin), origin, "exec")
        except (SyntaxError, ValueError, RecursionError, MemoryError) as error:
            line = ""
            if isinstance(error, SyntaxError) and error.lineno:
                line = f", line {error.lineno}"
            if isinstance(error, SyntaxError):
                message = error.msg
            else:
                message = str(error)
            raise InputError(f"{self.path}{line}: is not Python ({one_line(message)})") from error
        try:
            exec(code, vars(module))
        except (Exception, SystemExit) as error:
            advice = "the file is run as it is read"
            if written_for_signatures(error):
                advice = FORMER
            raise InputError(f"{self.path}{line_in_file(error, origin)}: {message_of(error)}; {advice}") from error
        return module


FORMER = (
    "an effect is its kernel, places, sizes and sentence: leave away the values of its parameters (third argument), "
    "signature, turns, from_coefficients, needs and in_motion"
)
"""Advice on a file that repeats facts of an effect's kernel."""
FORMER_NAMES = ("own_input", "turned", "polar_coefficients", "all_coefficients")
FORMER_FIELDS = ("signature", "turns", "from_coefficients", "needs", "in_motion")


def written_for_signatures(error: BaseException) -> bool:
    """Return true if a file fails because it uses the former interface, where an effect gave its signature."""
    message = str(error)
    if isinstance(error, ImportError):
        return any(f"cannot import name {name!r}" in message for name in FORMER_NAMES)
    of_effect = isinstance(error, TypeError) and ("_effect()" in message or "Effect.__init__()" in message)
    return of_effect and ("positional argument" in message or any(repr(name) in message for name in FORMER_FIELDS))


_LOADED: dict[OwnEffects, tuple[Effect, ...]] = {}
"""Effects by the text that defines them."""


def line_in_file(error: BaseException, origin: str) -> str:
    """The last line of a file that led to an error."""
    line = ""
    for frame in traceback.extract_tb(error.__traceback__):
        if frame.filename == origin:
            line = f", line {frame.lineno}"
    return line


def message_of(error: BaseException) -> str:
    """An error of a file in one line."""
    message = one_line(" ".join(str(error).split()))
    if message:
        return f"{type(error).__name__}: {message}"
    return type(error).__name__


@contextmanager
def _known(effects: Sequence[Effect]) -> Iterator[None]:
    """Have effects in the catalogue within the block; where it fails the catalogue is as it was before."""
    before = dict(CATALOGUE)
    if any(before.get(effect.name, effect) is not effect for effect in effects):
        # Another text under the same name: nothing made of the former one may be taken for it.
        kernel_functions.cache_clear()
    CATALOGUE.update((effect.name, effect) for effect in effects)
    try:
        yield
    except InputError:
        CATALOGUE.clear()
        CATALOGUE.update(before)
        raise


@contextmanager
def with_effects_of(file: "str | Path | OwnEffects | None") -> Iterator[OwnEffects | None]:
    """Add the effects of a file to the catalogue within the block; their names stay known.

    An InputError where it cannot be used.
    """
    file_read = OwnEffects.read(file)
    if file_read is None:
        yield None
        return
    effects = file_read.effects()
    with _known(effects):
        pass
    added: list[tuple[dict[str, Effect], Effect]] = []
    for effect in effects:
        if effect.in_motion:
            catalogue = STRAPDOWN_EFFECTS
        else:
            catalogue = POSITION_EFFECTS
        # Within another such block the same ones are there already.
        if catalogue.get(effect.name) is not effect:
            catalogue[effect.name] = effect
            added.append((catalogue, effect))
    try:
        yield file_read
    finally:
        for catalogue, effect in added:
            catalogue.pop(effect.name, None)


# Checks of an effect: names, places, units, limits, kernel


def check_effect(path: str, effect: Effect) -> Effect:
    """Return the effect; an InputError says which of its fields is wrong, and what would be right."""

    def refuse(field: str, why: str) -> InputError:
        line = ""
        if field == "kernel" and inspect.isfunction(effect.kernel):
            line = f", line {effect.kernel.__code__.co_firstlineno}"
        return InputError(f"{path}{line}: effect {one_line(effect.name)}: {field} {why}")

    if not NAME.fullmatch(effect.name):
        raise refuse("name", "is not in small letters and hyphens, as half-scale")
    stage = (str(effect.component), str(effect.stage))
    if stage not in STAGES:
        stages = "; ".join(f"{component} with {name}" for component, name in STAGES)
        raise refuse("component and stage", f"are {effect.component} and {effect.stage}; there are {stages}")
    if not (isinstance(effect.places, tuple) and effect.places):
        raise refuse("places", "are not a tuple of at least one EffectPlace")
    for place in effect.places:
        _check_place(place, effect, STAGES[stage], refuse)
    if len(set(effect.places)) < len(effect.places):
        raise refuse("places", "have one twice")
    for place in effect.places:
        with errors_of_field(refuse, "of_place"):
            at_place = effect.at(place)
        _check_at(place, at_place, refuse)
    return effect


@contextmanager
def errors_of_field(refuse: Refusal, field: str) -> Iterator[None]:
    """Report any error of a user's function as an error of its field."""
    try:
        yield
    except InputError:
        raise
    except Exception as error:
        message = one_line(" ".join(str(error).split()))
        raise refuse(field, f"raises {type(error).__name__}: {message}") from error


def _check_place(place: object, effect: Effect, homes: Sequence[str], refuse: Refusal) -> None:
    if not isinstance(place, EffectPlace):
        raise refuse("places", f"have a {type(place).__name__} in them, not an EffectPlace")
    if place.effect != effect.name:
        raise refuse("places", f"have one of effect {place.effect!r}; it is {effect.name!r} there, too")
    if place.where not in homes:
        raise refuse("places", f"have {place.where!r}; at {effect.stage} there are {', '.join(homes)}")
    order_known = place.order is None or place.order in range(1, 100)
    if any(axis not in (1, 2, 3) for axis in place.axes) or not order_known:
        raise refuse("places", f"have {place.title}; axes are from 1 to 3, an order is a whole number from 1")


def _check_at(place: EffectPlace, effect: Effect, refuse: Refusal) -> None:
    """Check the effect as it is at one of its places."""
    _check_parameters(effect, refuse)
    _check_arguments(effect, refuse)
    with errors_of_field(refuse, "kernel"):
        try:
            translate(flat_parts(extend(COMPONENTS[str(effect.component)], [place])))
        except RestrictionError as error:
            raise refuse("kernel", f"is not in restricted Python: {error}") from error
        except (TypeError, OSError, ValueError) as error:
            raise refuse("kernel", f"cannot be carried to an FMU: {one_line(str(error))}") from error
    with errors_of_field(refuse, "sentence"):
        sentence = effect.sentence(place, {p.name: _middle(p) for p in effect.parameters})
    if not isinstance(sentence, str) or not sentence.strip() or not sentence.isprintable():
        raise refuse("sentence", "gives no line of text")
    if effect.formula:
        with errors_of_field(refuse, "formula"):
            names = {p.name: "1" for p in effect.parameters}
            effect.formula.format(p="1", i="1", j="2", angle="α", order="1", **names)
    if effect.variants is not None:
        _check_variants(place, effect, refuse)
    else:
        _check_columns(place, effect, refuse)


def _check_arguments(effect: Effect, refuse: Refusal) -> None:
    """Check that the kernel takes the number of arguments that its stage and its parameters require."""
    kernel = effect.kernel
    if not inspect.isfunction(kernel):
        raise refuse("kernel", f"is {kernel!r}; it is a function in restricted Python, by which it is exported")
    with errors_of_field(refuse, "kernel"):
        count = len(inspect.signature(kernel).parameters)
        integers = len(whole_numbers(kernel))
    expected = 2 + integers + len(effect.parameters) + 1
    if count != expected:
        numbers = ""
        if integers:
            numbers = f", {integers} whole number{'s' * (integers != 1)}"
        values = ", ".join(p.name for p in effect.parameters)
        raise refuse(
            "kernel",
            f"takes {count} arguments; it takes {expected}: context, values{numbers}, {values}, and what it adds to",
        )


def _check_parameters(effect: Effect, refuse: Refusal) -> None:
    parameters = effect.parameters
    if not (isinstance(parameters, tuple) and parameters):
        raise refuse("parameters", "are not a tuple of at least one EffectParameter")
    before = ""
    for p in parameters:
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
        if p.name.endswith("phase") and not before.endswith("amplitude"):
            raise refuse(f"parameter {p.name}", "is a phase without an amplitude before it")
        before = p.name
    if len({p.name for p in parameters}) < len(parameters):
        raise refuse("parameters", "have a name twice")


def _is_number(value: object) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool) and math.isfinite(value)


def _middle(parameter: EffectParameter) -> float:
    """Return the middle of zero, or the smallest value, and the largest."""
    return 0.5 * (parameter.largest + (parameter.smallest or 0.0))


# Rows on which effects are tried


def rows_for(effect: Effect) -> Rows | MotionRows:
    """Return a few rows of a table's record, or steps of a block that is carried."""
    rng = np.random.default_rng(17)
    hours, warm = np.linspace(0.0, 2.0, COUNT), rng.uniform(15.0, 30.0, COUNT)
    vectors = rng.normal(size=(COUNT, 3))
    vectors /= np.linalg.norm(vectors, axis=1)[:, None]
    senses, rates = rng.choice([-1.0, 1.0], (COUNT, 5)), rng.uniform(-2.0, 2.0, (COUNT, 8))
    if effect.in_motion and effect.component != "TurntableMotion":
        step = np.full(COUNT, 0.01)
        return MotionRows(rates[:, :3], rates[:, 3:6], vectors, 0.01 * hours, step, warm, period=0.01)
    by_alpha, by_beta, by_kappa, by_epsilon = rng.uniform(-1.0, 1.0, (4, COUNT, 3))
    return Rows(
        hours=hours,
        alpha=rng.uniform(-3.0, 3.0, COUNT),
        beta=rng.uniform(-3.0, 3.0, COUNT),
        n=vectors,
        by_alpha=by_alpha,
        by_beta=by_beta,
        by_kappa=by_kappa,
        by_epsilon=by_epsilon,
        temperature=warm,
        input_sense=senses[:, :3],
        sense_alpha=senses[:, 3],
        sense_beta=senses[:, 4],
        axis_rates=rates[:, 6:],
    )


def kernel_additions(place: EffectPlace, effect: Effect, values: Sequence[float], rows: Rows | MotionRows) -> Floats:
    """Return the terms (N, ports) that the kernel adds to the ports of its stage, row by row."""
    assert effect.kernel is not None
    added = np.zeros((COUNT, PORTS[str(effect.stage)]))
    contexts, inputs = rows.seen_by(effect.component)
    context, seen = np.array(contexts).T.tolist(), np.array(inputs).T.tolist()
    numbers: list[float] = list(effect.place_numbers(place))
    numbers += map(float, values)
    for row in range(COUNT):
        port = [0.0] * added.shape[1]
        effect.kernel(context[row], seen[row], *numbers, port)
        added[row] = port
    return added


# The kernel


def _check_columns(place: EffectPlace, effect: Effect, refuse: Refusal) -> None:
    """Check that a linear effect's kernel adds each parameter times a column, alone and together, and nothing else."""
    rows, count = rows_for(effect), len(effect.linear_parameters)
    # An effect with an onset acts on all of these rows; one that settles does so while they last.
    number = WHOLE[ONSET] if effect.searched == ONSET else float(rows.hours[-1])
    last = [] if effect.searched is None else [number]
    if effect.in_motion:
        part, agree = (IN_MOTION, FIRST_ORDER)
    else:
        part, agree = (AT_REST, AGREE)

    def added(coefficients: Floats) -> Floats:
        values = list(effect.from_coefficients(coefficients))
        values += last
        with errors_of_field(refuse, "kernel"):
            ports_added = kernel_additions(place, effect, values, rows)
        if not np.isfinite(ports_added).all():
            raise refuse("kernel", "does not give a finite number on some rows")
        return ports_added

    if np.abs(added(np.zeros(count))).max() > 1e-12:
        raise refuse("kernel", "adds something where its parameters are zero")
    largest = float(min(p.largest for p in effect.linear_parameters if not p.name.endswith("phase")))
    # A growing effect has no other side.
    if all(p.smallest is None for p in effect.linear_parameters):
        signs = (1.0, -1.0)
    else:
        signs = (1.0,)
    slopes = []
    for size in (part[0] * largest, part[1] * largest):
        for sign in signs:
            slope = np.zeros((COUNT, PORTS[str(effect.stage)], count))
            for k, unit in enumerate(np.eye(count)):
                slope[:, :, k] = added(sign * size * unit) / (sign * size)
            slopes.append(slope)
    scale = max(1.0, float(np.abs(slopes[0]).max()))
    if float(np.abs(np.array(slopes[1:]) - slopes[0]).max()) > agree * scale:
        raise refuse("kernel", "is not linear in its parameters; an effect that is not has variants")
    size = part[0] * largest
    if np.abs(added(size * np.ones(count)) / size - slopes[0].sum(axis=2)).max() > agree * scale * count:
        raise refuse("kernel", "does not add its parameters' parts: together they do something else than each alone")
    with errors_of_field(refuse, "columns" if effect.columns else "kernel"):
        columns = ports(effect, place, rows, number)
    if columns.shape != slopes[0].shape:
        raise refuse("columns", f"give an array {columns.shape} for {COUNT} rows; {slopes[0].shape} is right")
    miss = np.abs(columns - slopes[0])
    if not miss.max() <= agree * scale:
        row, port, k = np.unravel_index(int(miss.argmax()), miss.shape)
        raise refuse(
            "columns" if effect.columns else "kernel",
            f"says {columns[row, port, k]:.6g} of component {port + 1} by {effect.parameters[k].name}, and by "
            f"differences the kernel adds {slopes[0][row, port, k]:.6g}; they have to agree",
        )
    if np.abs(columns).max() == 0.0 and not effect.in_motion:
        raise refuse("kernel", "adds nothing on any row")


def _check_variants(place: EffectPlace, effect: Effect, refuse: Refusal) -> None:
    """Check that the ways in which an effect that is not linear can act are ways, and that its kernel runs."""
    assert effect.variants is not None
    rows = rows_for(effect)
    if isinstance(rows, MotionRows):
        reading = rows.rate
    else:
        reading = rows.n
    with errors_of_field(refuse, "variants"):
        ways = effect.variants(place, rows, np.array(reading), 1e-5)
    if not isinstance(ways, Sequence) or not all(isinstance(way, Variant) for way in ways):
        raise refuse("variants", "give no list of Variant")
    for way in ways:
        if way.offset.shape != reading.shape or way.columns.shape[:2] != reading.shape:
            raise refuse("variants", f"have arrays {way.offset.shape} and {way.columns.shape} for rows {reading.shape}")
        if len(way.limits) != len(effect.parameters):
            raise refuse("variants", f"limit {len(way.limits)} parameters of {len(effect.parameters)}")
    with errors_of_field(refuse, "kernel"):
        added = kernel_additions(place, effect, [_middle(p) for p in effect.parameters], rows)
    if not np.isfinite(added).all():
        raise refuse("kernel", "does not give a finite number on some rows")
