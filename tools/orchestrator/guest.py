"""A guest: an FMU of somebody else, in a process of its own, so that what it does to its process it does not to ours.

It has what an FMU's library has (`trihedron.tools.orchestrator.fmu.Library`): functions by their addresses, as the loop
over the steps calls them. Behind an address is a function of ours, which asks the process (`guest_process.py`).
Inputs go with the step that they are for, and what is read after a step comes with its answer: one question for each.
"""

import ctypes
import marshal
import os
import shutil
import signal
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Callable, Sequence
from contextlib import suppress
from importlib import util
from mmap import mmap
from pathlib import Path
from typing import Any

import fmpy

from .archive import UnpackedFmu
from .guest_process import BINARY, HEAD, TEXT
from .interface import VALUE_TYPES, block_of, bytes_at

NO_INSTANCE = "no instance"
FAILED = 4
"""What an address of a guest that is lost gives: Fatal, after which nothing may be called."""
PRINTED = 2048
LONGEST_PRINTED = 200
_LOOKS = 20
"""So often within its limit of time it is looked whether a call takes longer."""
_WORD = ctypes.c_size_t
_SHAPES: dict[str, tuple[Any, ...]] = {
    "fmi2DoStep": (_WORD, ctypes.c_double, ctypes.c_double, ctypes.c_int),
    "fmi3DoStep": (_WORD, ctypes.c_double, ctypes.c_double, ctypes.c_bool, *[_WORD] * 4),
}
_STEP_RETURNS = 16


class LostError(Exception):
    """The process is gone."""


class Guest:
    """The process of one FMU, with its instance.

    `lost` says how it ended, where it has ended by itself; `component` is its instance's address over there.
    """

    def __init__(self, fmu: UnpackedFmu, name: str, hear: Callable[[int, str], None]) -> None:
        self.lost, self.blamed = "", ""
        self.raised: BaseException | None = None
        self._hear, self._limit = hear, fmu.call_limit_s
        self._entries: dict[str, Any] = {}
        self._numbers: dict[tuple[str, bytes, int], int] = {}
        self._pending: list[tuple[Any, ...]] = []
        self._follows: list[int] = []
        self._fetched: dict[int, tuple[int, Any]] = {}
        self._texts: dict[int, list[Any]] = {}
        self._stepping = self._late = False
        self._began: float | None = None
        self._printed = b""
        self._folder = Path(tempfile.mkdtemp(prefix="guest-", dir=fmu.folder.parent))
        # Its working folder is another one, which is its own.
        work, progress = self._folder / "work", self._folder / "progress"
        work.mkdir()
        progress.write_bytes(b"\0")
        with progress.open("r+b") as file:
            self._progress = mmap(file.fileno(), 1)
        program = [sys.executable, "-P", str(Path(__file__).with_name("guest_process.py"))]
        pipe = subprocess.PIPE
        # Ctrl-C is not meant for it: it ends with the run.
        self._process = subprocess.Popen(
            program, stdin=pipe, stdout=pipe, stderr=pipe, cwd=work, start_new_session=True
        )
        assert self._process.stdin is not None
        assert self._process.stdout is not None
        self._to, self._from = self._process.stdin, self._process.stdout
        self._reader = threading.Thread(target=self._drain, daemon=True)
        self._reader.start()
        # How long Python takes to start is not the FMU's affair.
        self._ask(("follow", []))
        if self._limit is not None:
            threading.Thread(target=self._watch, args=(self._limit,), daemon=True).start()
        resources = fmu.folder / "resources"
        where = resources.as_uri() if fmu.version == 2 else f"{resources}/" if resources.is_dir() else ""
        logger = "" if fmu.python_module else _logger()
        try:
            loading = ("load", str(fmu.library), fmu.version, name, fmu.token, where, logger, str(progress))
            found = self._ask((*loading, fmu.handled))
            if not found:
                raise RuntimeError(NO_INSTANCE)
        except LostError as error:
            self.close()
            raise RuntimeError(f"it {self.lost}") from error
        except BaseException:
            self.close()
            raise
        self.component: int = found

    def _drain(self) -> None:
        """Take what the FMU prints, and keep the end of it."""
        assert self._process.stderr is not None
        while text := os.read(self._process.stderr.fileno(), 1 << 16):
            self._printed = (self._printed + text)[-PRINTED:]

    def _watch(self, limit: float) -> None:
        """End the process when a request takes longer than its limit."""
        while self._process.poll() is None:
            began = self._began
            if began is not None and time.monotonic() - began > limit:
                self._late = True
                self._process.kill()
                return
            time.sleep(min(limit / _LOOKS, 0.5))

    def _hear_printed(self) -> None:
        """Take the last line that the FMU has printed for what it says."""
        lines = self._printed.decode("utf-8", "replace").split("\n")
        last = next((" ".join(line.split()) for line in reversed(lines) if line.strip()), "")
        self._hear(0, last[:LONGEST_PRINTED])

    def _questions(self, *operations: tuple[Any, ...]) -> list[Any]:
        """What each of the operations gives, and those that wait before them; fewer where one has failed."""
        if self.lost:
            raise LostError
        asked, self._pending = [*self._pending, *operations], []
        request = marshal.dumps(asked)
        try:
            self._began = time.monotonic()
            self._to.write(HEAD.pack(len(request)) + request)
            self._to.flush()
            head = self._from.read(HEAD.size)
            if len(head) < HEAD.size:
                raise EOFError
            found, log, wrong = marshal.loads(self._from.read(*HEAD.unpack(head)))
        except (OSError, EOFError, ValueError, TypeError) as error:
            at = self._progress[0]
            names = [self._name_of(operation) for operation in asked]
            followed = [("get", number) for number in self._follows]
            self._bury()
            if at >= len(names) and operations and operations[-1][0] == "step":
                # The step was made; the getter that follows is what fails.
                self.blamed = self._name_of(followed[at - len(names)])
                return [0] * (len(asked) - 1) + [(0, bytes(_STEP_RETURNS))]
            self.blamed = self.blamed or names[min(at, len(names) - 1)]
            raise LostError from error
        except BaseException:
            # Ctrl-C, a second time: what comes back now would be taken for the answer to something else.
            self._process.kill()
            self._bury()
            raise
        finally:
            self._began = None
        for status, text in log:
            self._hear(status, text)
        if wrong:
            raise RuntimeError(wrong)
        return found

    def _ask(self, *operations: tuple[Any, ...]) -> Any:
        """What the last of the operations gives; the status of one before it that has failed."""
        waiting = [*self._pending, *operations]
        found = self._questions(*operations)
        if len(found) < len(waiting):
            self.blamed = self._name_of(waiting[len(found) - 1])
            return found[-1]
        last = len(waiting) - 1
        if operations[-1][0] == "step":
            self._fetched = dict(zip(self._follows, found[last + 1 :], strict=False))
        return found[last]

    def _name_of(self, operation: tuple[Any, ...]) -> str:
        """The function of FMI that an operation calls."""
        verb, first = operation[:2]
        names = {number: name for (name, *_), number in self._numbers.items()}
        return names.get(first, "") if verb in ("set", "get", "define") else str(first)

    def _bury(self) -> None:
        """Say how the process has ended."""
        with suppress(subprocess.TimeoutExpired):
            self._process.wait(5.0)
        self._reader.join(1.0)
        self._hear_printed()
        code = self._process.poll()
        if self._late:
            self.lost = f"did not return within {self._limit:g} s (run.call_limit_s)"
        elif code is None:
            self._process.kill()
            self.lost = "lost its connection"
        elif code < 0:
            names = {int(number): number.name for number in signal.Signals}
            self.lost = f"crashed ({names.get(-code, f'signal {-code}')})"
        else:
            self.lost = f"ended its process (exit status {code})"

    def call(self, name: str, *arguments: Any) -> int:
        """Call a function of plain arguments; its status."""
        try:
            status = self._ask(("call", name, arguments))
        except LostError:
            return FAILED
        self._stepping = self._stepping or name.endswith("ExitInitializationMode")
        return status

    def address(self, name: str) -> int:
        """Where a function of ours is that calls a C function over there; an AttributeError where there is none."""
        if name not in self._entries:
            if not self._ask(("has", name)):
                raise AttributeError(name)
            made, words = self._entry(name)
            self._entries[name] = ctypes.CFUNCTYPE(ctypes.c_int, *words)(self._guarded(made))
        found = ctypes.cast(self._entries[name], ctypes.c_void_p).value
        assert found is not None
        return found

    def _guarded(self, function: Callable[..., int]) -> Callable[..., int]:
        """A function that C can call: what it raises is kept, and it gives a status."""

        def guarded(*words: Any) -> int:
            try:
                return function(*words)
            except LostError:
                return FAILED
            except BaseException as error:
                self.raised = error
                return FAILED

        return guarded

    def _entry(self, name: str) -> tuple[Callable[..., int], Sequence[Any]]:
        """The function behind an address, and the types of what it takes."""
        if name in _SHAPES:

            def step(_: int, begin: float, length: float, flag: int, *places: int) -> int:
                self._fetched = {}
                found = self._ask(("step", name, begin, length, int(flag)))
                status, returned = found if isinstance(found, tuple) else (found, b"")
                if places:
                    ctypes.memmove(places[0], returned, len(returned))
                return status

            return step, _SHAPES[name]
        if name.lower().endswith("fmustate"):

            def state(_: int, word: int) -> int:
                self._fetched = {}
                kept = ctypes.c_size_t(word) if "Set" in name else ctypes.c_size_t.from_address(word)
                found = self._ask(("state", name, kept.value))
                if not isinstance(found, tuple):
                    return found
                if "Set" not in name:
                    kept.value = found[1]
                return found[0]

            return state, (_WORD, _WORD)
        if name.endswith("Status"):

            def status(_: int, kind: int, place: int) -> int:
                found, value = self._ask(("status", name, kind))
                ctypes.memmove(place, value, 8 if "Real" in name else 4)
                return found

            return status, (_WORD, ctypes.c_int, _WORD)
        if name.endswith("InputDerivatives"):

            def derivatives(_: int, references: int, several: int, orders: int, values: int) -> int:
                sizes = (references, 4 * several), (orders, 4 * several), (values, 8 * several)
                self._pending.append(("derivatives", name, *(ctypes.string_at(*size) for size in sizes)))
                return 0

            return derivatives, [_WORD] * 5
        return self._accessor(name), [_WORD] * (4 if name.startswith("fmi2") else 5)

    def _accessor(self, name: str) -> Callable[..., int]:
        """The function behind the address of a getter or a setter."""
        kind = name[len("fmi2Get") :]
        kind = "Boolean2" if name.startswith("fmi2") and kind == "Boolean" else kind
        size = {"String": TEXT, "Binary": BINARY}.get(kind) or VALUE_TYPES[kind].dtype().itemsize

        def number_of(references: int, several: int, count: int) -> int:
            key = (name, ctypes.string_at(references, 4 * several), count)
            number = self._numbers.get(key)
            if number is None:
                number = self._numbers[key] = len(self._numbers)
                self._pending.append(("define", number, name, key[1], count, size))
            return number

        def setter(_: int, references: int, several: int, values: int, count: int | None = None) -> int:
            count = several if count is None else count
            number = number_of(references, several, count)
            if size == TEXT:
                given: Any = [text or b"" for text in (ctypes.c_char_p * count).from_address(values)]
            elif size == BINARY:
                given = [bytes_at(block) for block in (ctypes.c_size_t * count).from_address(values)]
            else:
                given = ctypes.string_at(values, size * count)
            if not self._stepping:
                return self._ask(("set", number, given))
            self._pending.append(("set", number, given))
            return 0

        def getter(_: int, references: int, several: int, values: int, count: int | None = None) -> int:
            number = number_of(references, several, several if count is None else count)
            found = self._fetched.pop(number, None)
            if found is None:
                found = self._ask(("get", number))
                if self._stepping and number not in self._follows:
                    self._follows.append(number)
                    self._pending.append(("follow", list(self._follows)))
            if not isinstance(found, tuple):
                return found
            status, read = found
            if size in (TEXT, BINARY):
                made = ctypes.create_string_buffer if size == TEXT else block_of
                kept = self._texts[number] = [made(text) for text in read]
                read = b"".join(ctypes.addressof(text).to_bytes(8, sys.byteorder) for text in kept)
            ctypes.memmove(values, read, len(read))
            return status

        return setter if name[4:7] == "Set" else getter

    def free(self, name: str) -> int:
        """Free the instance and end the process; the status of the call."""
        status = self.call(name)
        self.close()
        return status

    def close(self) -> None:
        """End the process, whatever it is doing; may be called twice."""
        if self.lost or self._process.poll() is not None or self._began is not None:
            self._process.kill()
        with suppress(OSError):
            self._to.close()
        try:
            self._process.wait(5.0)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()
        self._reader.join(1.0)
        self._from.close()
        if self._process.stderr is not None and not self._reader.is_alive():
            self._process.stderr.close()
        self._progress.close()
        shutil.rmtree(self._folder, ignore_errors=True)


def _logger() -> str:
    """FMPy's library that writes out what an FMU of FMI 2.0 logs in the way of printf; empty where there is none."""
    found = util.find_spec("fmpy.logging")
    assert found is not None
    path = Path(str(found.origin)).parent / fmpy.platform / f"logging{fmpy.sharedLibraryExtension}"
    return str(path) if path.is_file() else ""
