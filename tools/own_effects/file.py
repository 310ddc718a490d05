"""Effects that stand in a file of the user's own: run because it was named, checked, and tried like the catalogue's.

Nothing but an option names such a file; a scenario or a record never does.
"""

import ast
import hashlib
import linecache
import sys
import traceback
import warnings
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from types import ModuleType

from ...fmus.source import kernel_functions
from ...models.effects import CATALOGUE, POSITION_EFFECTS, STRAPDOWN_EFFECTS, Effect
from ..errors import InputError, one_line
from ..files import bytes_of
from .kernel_check import check_effect

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
        try:
            return OwnEffects(str(file), content.decode("utf-8-sig"))
        except UnicodeDecodeError as error:
            raise InputError(
                f"--effects-from {file}: is not UTF-8 text ({error.reason} at byte {error.start})"
            ) from error

    def effects(self) -> tuple[Effect, ...]:
        """The effects of the file, checked; an InputError says in one line which line or field is wrong, and why."""
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
        """What the file gives as EFFECT or EFFECTS."""
        module = self._run()
        single, several = getattr(module, "EFFECT", None), getattr(module, "EFFECTS", None)
        if single is None and several is None:
            raise InputError(
                f"{self.path}: gives neither EFFECT nor EFFECTS; EFFECT = accelerometer_effect(...) is one"
            )
        if several is not None and not isinstance(several, list | tuple):
            raise InputError(f"{self.path}: EFFECTS is a {type(several).__name__}; it is a tuple of effects")
        fields = [("EFFECT", single)] if single is not None else []
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
            raise InputError(f"{self.path}{line_of(error, origin)}: {message_of(error)}; {advice}") from error
        return module


FORMER = (
    "an effect is its kernel, places, sizes and sentence: leave away the values of its parameters (third argument), "
    "signature, turns, from_coefficients, needs and in_motion"
)
"""What to do with a file that gives an effect what its kernel says."""
FORMER_NAMES = ("own_input", "turned", "polar_coefficients", "all_coefficients")
FORMER_FIELDS = ("signature", "turns", "from_coefficients", "needs", "in_motion")


def written_for_signatures(error: BaseException) -> bool:
    """Return whether a file fails because it gives an effect what its kernel says since."""
    message = str(error)
    if isinstance(error, ImportError):
        return any(f"cannot import name {name!r}" in message for name in FORMER_NAMES)
    of_effect = isinstance(error, TypeError) and ("_effect()" in message or "Effect.__init__()" in message)
    return of_effect and ("positional argument" in message or any(repr(name) in message for name in FORMER_FIELDS))


_LOADED: dict[OwnEffects, tuple[Effect, ...]] = {}
"""Of each text that was read what it gives."""


def line_of(error: BaseException, origin: str) -> str:
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
    """Try the effects of a file beside those of the catalogue within the block; they stay known by their names.

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
