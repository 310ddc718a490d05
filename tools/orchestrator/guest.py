"""A guest: a foreign FMU in a process of its own, which protects our process from it.

A guest offers the interface of an FMU's library (`trihedron.tools.orchestrator.fmu.Library`): functions by address, as
the loop over the steps calls them. Behind each address is a function of ours that asks the process
(`guest_process.py`). Inputs travel with their step, and outputs return with its answer: one exchange a step.
"""

import ctypes
import json
import marshal
import os
import select
import shutil
import signal
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Callable, Sequence
from contextlib import suppress
from functools import cache
from importlib import util
from pathlib import Path
from typing import Any

import fmpy
import numpy as np

from .archive import UnpackedFmu
from .guest_process import HEAD, PROGRESS, WARNING
from .interface import VALUE_TYPES, block_of, bytes_at

NO_INSTANCE = "no instance"
FAILED = 4
"""Status of every call to a lost guest: Fatal, after which no call is allowed."""
PRINTED = 2048
LONGEST_PRINTED = 200
_LOOKS = 20
"""Number of checks, within the time limit, for a call that takes longer."""
LONGEST_REPLY = 1 << 28
"""Longest reply that is read [bytes]."""
MEMORY_SHARE = 0.5
"""Largest share of the machine's memory for a guest."""
_READ = 1 << 16
_WAIT_MS = 200
"""Time to wait for a reply before checking that the process still runs [ms]."""
_UNREADABLE = (ValueError, TypeError, OverflowError, RecursionError, MemoryError)
"""Exceptions that reading a reply can raise if the FMU has corrupted it."""
_WORD = ctypes.c_size_t
_STEP_OUTPUTS = (1, 1, 1, 8)
"""Sizes of the outputs of fmi3DoStep: three flags and the last successful time [bytes]."""


class LostError(Exception):
    """The guest's process has ended."""


class Guest:
    """The process of one FMU, with its instance.

    `lost` is the reason if the process has ended by itself; `component` is the address of its instance in that process.
    """

    def __init__(self, fmu: UnpackedFmu, name: str, hear: Callable[[int, str], None]) -> None:
        self.lost, self.blamed = "", ""
        self.raised: BaseException | None = None
        self._hear, self._limit = hear, fmu.call_limit_s
        self._entries: dict[str, Any] = {}
        self._pending: list[tuple[Any, ...]] = []
        self._follows: list[tuple[str, tuple[Any, ...]]] = []
        self._fetched: dict[tuple[str, tuple[Any, ...]], tuple[int, Any]] = {}
        self._texts: dict[tuple[str, tuple[Any, ...]], list[Any]] = {}
        self._stepping = self._late = False
        self._began: float | None = None
        self._printed = b""
        self._ended = threading.Event()
        self._folder = Path(tempfile.mkdtemp(prefix="guest-", dir=fmu.folder.parent))
        self._start_process()
        # The start-up time of Python does not count against the FMU.
        self._ask("follow", [])
        if self._limit is not None:
            threading.Thread(target=self._watch, args=(self._limit,), daemon=True).start()
        try:
            _, instance = self._ask("load", settings_of(fmu, name, str(self._folder / "progress")))
            if not instance:
                raise RuntimeError(NO_INSTANCE)
        except LostError as error:
            self.close()
            raise RuntimeError(f"it {self.lost}") from error
        except BaseException:
            self.close()
            raise
        self.component: int = instance

    def _start_process(self) -> None:
        """Start the process, in a working folder of its own."""
        work, progress = self._folder / "work", self._folder / "progress"
        work.mkdir()
        progress.write_bytes(bytes(PROGRESS.size))
        # Read the file, do not map it: reading a mapped file that was cut short kills the process.
        self._progress = progress.open("rb", buffering=0)
        host = Path(__file__).with_name("guest_process.py")
        program = [sys.executable, "-P", str(host), str(memory_limit())]
        pipe = subprocess.PIPE
        # The guest ignores Ctrl-C: it ends with the run.
        self._process = subprocess.Popen(
            program, stdin=pipe, stdout=pipe, stderr=pipe, cwd=work, start_new_session=True
        )
        assert self._process.stdin is not None
        assert self._process.stdout is not None
        self._to, self._from = self._process.stdin, self._process.stdout
        self._replies = None
        if hasattr(select, "poll"):
            self._replies = select.poll()
            self._replies.register(self._from.fileno(), select.POLLIN)
        self._reader = threading.Thread(target=self._drain, daemon=True)
        self._reader.start()

    def _drain(self) -> None:
        """Read the FMU's printed output and keep the end of it."""
        assert self._process.stderr is not None
        while text := os.read(self._process.stderr.fileno(), 1 << 16):
            self._printed = (self._printed + text)[-PRINTED:]

    def _watch(self, limit: float) -> None:
        """End the process when a request takes longer than its limit."""
        while not self._ended.wait(min(limit / _LOOKS, 0.5)):
            began = self._began
            if began is not None and time.monotonic() - began > limit:
                self._late = True
                self._process.kill()
                return

    def _hear_printed(self) -> None:
        """Take the last line that the FMU printed as its message."""
        lines = [" ".join(line.split()) for line in self._printed.decode("utf-8", "replace").split("\n")]
        printed = [line for line in lines if line]
        self._hear(0, "".join(printed[-1:])[:LONGEST_PRINTED])

    def _request(self, operations: list[tuple[Any, ...]]) -> list[tuple[int, Any]]:
        """Return status and values of each operation, and of the calls after a step; fewer if one has failed."""
        request = marshal.dumps(operations)
        try:
            self._began = time.monotonic()
            self._to.write(HEAD.pack(len(request)) + request)
            self._to.flush()
            answers, log, failure = _decoded(self._received(), [*operations, *self._following(operations)])
        except (OSError, EOFError, *_UNREADABLE) as error:
            unreadable = isinstance(error, _UNREADABLE)
            if unreadable:
                self._process.kill()
            at = self._operation_at()
            self._bury()
            if unreadable and not self._late:
                self.lost = "sent a reply that cannot be read"
            follows = self._following(operations)[at - len(operations) :]
            if at >= len(operations) and follows:
                # The step has succeeded; the getter after it fails.
                self.blamed = follows[0][1]
                return [(0, ())] * len(operations)
            failed = operations[min(at, len(operations) - 1)]
            self.blamed = self.blamed or str(failed[1])
            raise LostError from error
        except BaseException:
            # A second Ctrl-C: the answer to this request would be taken for the answer to the next.
            self._process.kill()
            self._bury()
            raise
        finally:
            self._began = None
        for status, text in log:
            self._hear(status, text)
        if failure:
            raise RuntimeError(failure)
        return answers

    def _following(self, operations: Sequence[tuple[Any, ...]]) -> list[tuple[Any, ...]]:
        """Return the calls that follow these operations: the getters after a step."""
        if not _is_step(operations[-1]):
            return []
        return [("call", *call) for call in self._follows]

    def _operation_at(self) -> int:
        """Return the index of the operation in progress; 0 if the FMU has damaged the progress file."""
        content = os.pread(self._progress.fileno(), PROGRESS.size, 0) if hasattr(os, "pread") else self._progress.read()
        return PROGRESS.unpack(content)[0] if len(content) == PROGRESS.size else 0

    def _received(self) -> bytes:
        """Return the bytes of a reply.

        Raises EOFError if the process has ended, ValueError if the bytes are not a reply.
        """
        content = self._read_some()
        while len(content) < HEAD.size:
            content += self._read_some()
        (length,) = HEAD.unpack_from(content)
        if length > LONGEST_REPLY:
            raise ValueError("the reply is too long")
        while len(content) < HEAD.size + length:
            content += self._read_some()
        if len(content) > HEAD.size + length:
            raise ValueError("more than a reply")
        return bytes(content[HEAD.size :])

    def _read_some(self) -> bytearray:
        """Return the next part of a reply.

        Raises EOFError if the process has ended, even if another process still holds the pipe open.
        """
        while self._replies is not None and not self._replies.poll(_WAIT_MS):
            if self._process.poll() is not None and not self._replies.poll(0):
                raise EOFError
        part = os.read(self._from.fileno(), _READ)
        if not part:
            raise EOFError
        return bytearray(part)

    def _ask(self, *operation: Any) -> tuple[int, Any]:
        """Return status and values of an operation, or of a postponed operation before it if that has failed."""
        if self.lost:
            raise LostError
        operations, self._pending = self._pending, []
        operations.append(operation)
        answers = self._request(operations)
        count = len(operations)
        if len(answers) < count:
            self.blamed = operations[len(answers) - 1][1]
            return answers[-1]
        if _is_step(operation):
            self._fetched = dict(zip(self._follows, answers[count:], strict=False))
        return answers[count - 1]

    def _bury(self) -> None:
        """Record the reason for which the process ended."""
        with suppress(subprocess.TimeoutExpired):
            self._process.wait(5.0)
        code = self._process.poll()
        self._end_group()
        self._reader.join(1.0)
        self._hear_printed()
        if self._late:
            self.lost = f"did not return within {self._limit:g} s (run.call_limit_s)"
        elif code is None:
            self.lost = "lost its connection"
        elif code < 0:
            names = {int(number): number.name for number in signal.Signals}
            self.lost = f"crashed ({names.get(-code, f'signal {-code}')})"
        else:
            self.lost = f"ended its process (exit status {code})"

    def _end_group(self) -> None:
        """End the process and the processes that it started (its process group)."""
        self._ended.set()
        if not hasattr(os, "killpg"):
            self._process.kill()
            return
        with suppress(ProcessLookupError, PermissionError):
            os.killpg(self._process.pid, signal.SIGKILL)

    def call(self, name: str, arguments: Sequence[Any] = ()) -> tuple[int, Any]:
        """Call a function; return its status and its outputs (see `guest_process`)."""
        try:
            answer = self._ask("call", name, tuple(arguments))
        except LostError:
            return FAILED, ()
        self._stepping = self._stepping or name.endswith("ExitInitializationMode")
        return answer

    def interpolate(self, setter: str, references: bytes, times: bytes, rows: bytes) -> None:
        """Give a table of inputs to the solver."""
        with suppress(LostError):
            self._ask("interpolate", setter, references, times, rows)

    def address(self, name: str) -> int:
        """Return the address of our function that calls a C function in the guest.

        Raises AttributeError if the guest has no such function.
        """
        if name not in self._entries:
            _, exists = self._ask("has", name)
            if not exists:
                raise AttributeError(name)
            function, types = self._entry(name)
            self._entries[name] = ctypes.CFUNCTYPE(ctypes.c_int, *types)(self._guarded(function))
        address = ctypes.cast(self._entries[name], ctypes.c_void_p).value
        assert address is not None
        return address

    def _guarded(self, function: Callable[..., int]) -> Callable[..., int]:
        """Wrap a function for C: keep any exception and return a status."""

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
        """Return the function behind an address and the types of its arguments."""
        if name == "fmi2DoStep":
            return self._step(name), (_WORD, ctypes.c_double, ctypes.c_double, ctypes.c_int)
        if name == "fmi3DoStep":
            return self._step(name), [_WORD, ctypes.c_double, ctypes.c_double, ctypes.c_bool] + [_WORD] * 4
        if name.lower().endswith("fmustate"):
            return self._state(name), (_WORD, _WORD)
        if name.endswith("Status"):
            return self._status(name), (_WORD, ctypes.c_int, _WORD)
        if name.endswith("InputDerivatives"):
            return self._derivatives(name), [_WORD] * 5
        words = [_WORD] * (int(name[3]) + 2)
        if name[4:7] == "Set":
            return self._setter(name), words
        return self._getter(name), words

    def _call_into(self, name: str, arguments: tuple[Any, ...], places: Sequence[int]) -> int:
        """Call a function, copy its results to these addresses, and return its status."""
        status, contents = self._ask("call", name, arguments)
        for place, content in zip(places, contents, strict=False):
            ctypes.memmove(place, content, len(content))
        return status

    def _step(self, name: str) -> Callable[..., int]:
        def step(_: int, begin: float, length: float, final: int, *places: int) -> int:
            self._fetched = {}
            arguments: list[Any] = [begin, length, final]
            for size in _STEP_OUTPUTS[: len(places)]:
                arguments.append((bytes(size),))
            return self._call_into(name, tuple(arguments), places)

        return step

    def _state(self, name: str) -> Callable[..., int]:
        def state(_: int, word: int) -> int:
            self._fetched = {}
            if "Set" in name:
                return self._call_into(name, (word,), ())
            return self._call_into(name, ((ctypes.string_at(word, 8),),), [word])

        return state

    def _status(self, name: str) -> Callable[..., int]:
        size = 8 if "Real" in name else 4
        return lambda _, kind, place: self._call_into(name, (kind, (bytes(size),)), [place])

    def _derivatives(self, name: str) -> Callable[..., int]:
        def derivatives(_: int, references: int, count: int, orders: int, values: int) -> int:
            memory = [ctypes.string_at(place, 4 * count) for place in (references, orders)]
            arguments = (memory[0], count, memory[1], ctypes.string_at(values, 8 * count))
            self._pending.append(("call", name, arguments))
            return 0

        return derivatives

    def _setter(self, name: str) -> Callable[..., int]:
        kind = _kind(name)

        def setter(_: int, references: int, several: int, values: int, *counts: int) -> int:
            count = _count_of(several, counts)
            arguments: list[Any] = [ctypes.string_at(references, 4 * several), several]
            if kind == "String":
                texts = (ctypes.c_char_p * count).from_address(values)
                arguments.append([text or b"" for text in texts])
            elif kind == "Binary":
                blocks = [bytes_at(block) for block in (_WORD * count).from_address(values)]
                arguments += [np.array([len(block) for block in blocks], dtype=np.uint64).tobytes(), blocks]
            else:
                arguments.append(ctypes.string_at(values, VALUE_TYPES[kind].dtype().itemsize * count))
            arguments += counts
            operation = ("call", name, tuple(arguments))
            if not self._stepping:
                return self._ask(*operation)[0]
            self._pending.append(operation)
            return 0

        return setter

    def _getter(self, name: str) -> Callable[..., int]:
        kind = _kind(name)
        calls: dict[int, tuple[str, tuple[Any, ...]]] = {}

        def call_of(references: int, several: int, counts: Sequence[int]) -> tuple[str, tuple[Any, ...]]:
            """Return the call for a port, whose references never move."""
            count = _count_of(several, counts)
            output: tuple[Any, ...] = (bytes(VALUE_TYPES[kind].dtype().itemsize * count),)
            if kind == "String":
                output = ("texts", count)
            elif kind == "Binary":
                output = ("binaries", count)
            arguments: list[Any] = [ctypes.string_at(references, 4 * several), several, output]
            arguments += counts
            return name, tuple(arguments)

        def getter(_: int, references: int, several: int, values: int, *counts: int) -> int:
            if references not in calls:
                calls[references] = call_of(references, several, counts)
            call = calls[references]
            answer = self._fetched.pop(call, None)
            if answer is None:
                answer = self._ask("call", *call)
                if self._stepping and call not in self._follows:
                    self._follows.append(call)
                    self._pending.append(("follow", list(self._follows)))
            status, contents = answer
            if not contents:
                return status
            content = contents[0]
            if VALUE_TYPES[kind].by_address:
                allocate = ctypes.create_string_buffer if kind == "String" else block_of
                blocks = self._texts[call] = [allocate(text) for text in content]
                content = bytes((_WORD * len(blocks))(*map(ctypes.addressof, blocks)))
            ctypes.memmove(values, content, len(content))
            return status

        return getter

    def free(self, name: str) -> int:
        """Free the instance, end the process, and return the status of the call."""
        status, _ = self.call(name)
        self.close()
        return status

    def close(self) -> None:
        """End the process even during a call; may be called twice."""
        if self.lost or self._process.poll() is not None or self._began is not None:
            self._process.kill()
        with suppress(OSError):
            self._to.close()
        try:
            self._process.wait(5.0)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()
        if not self._ended.is_set():
            self._end_group()
        self._reader.join(1.0)
        self._from.close()
        if self._process.stderr is not None and not self._reader.is_alive():
            self._process.stderr.close()
        self._progress.close()
        shutil.rmtree(self._folder, ignore_errors=True)


@cache
def memory_limit() -> int:
    """Return the largest memory for a guest [bytes]: a share of the machine's or of the container's."""
    limits = []
    with suppress(AttributeError, ValueError, OSError):
        limits.append(os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE"))
    with suppress(ValueError, OSError):
        limits.append(int(Path("/sys/fs/cgroup/memory.max").read_text("ascii")))
    return int(MEMORY_SHARE * min(limits, default=sys.maxsize))


def _decoded(reply: bytes, operations: Sequence[tuple[Any, ...]]) -> tuple[list[Any], list[Any], str]:
    """Return answers, log and failure from a reply to these operations.

    Raises ValueError or TypeError if the bytes are not a reply.
    """
    entries, log, failure = json.loads(reply)
    if not isinstance(failure, str) or len(entries) > len(operations):
        raise ValueError("no reply")
    answers = []
    for operation, (status, value) in zip(operations, entries, strict=False):
        status = _whole(status, -(1 << 31), 1 << 31)
        answers.append((status, _value_of(operation, status, value)))
    messages = []
    for status, text in log:
        messages.append((_whole(status, -(1 << 31), 1 << 31), str(text)))
    return answers, messages, failure


def _whole(number: Any, low: int, high: int) -> int:
    if not isinstance(number, int) or not low <= number < high:
        raise ValueError("no whole number of this size")
    return number


def _value_of(operation: tuple[Any, ...], status: int, value: Any) -> Any:
    """Return the values of an operation: bytes of the requested sizes, ready to be copied into our memory."""
    if operation[0] != "call":
        return None if value is None else _whole(value, 0, 1 << 64)
    wanted = [argument for argument in operation[2] if isinstance(argument, tuple)]
    if status <= WARNING and len(value) < len(wanted):
        raise ValueError("too few values")
    contents = []
    for asked, content in zip(wanted, value, strict=False):
        if isinstance(asked[0], bytes):
            contents.append(bytes.fromhex(content))
            fits = len(contents[-1]) == len(asked[0])
        else:
            contents.append([bytes.fromhex(item) for item in content])
            fits = len(contents[-1]) == asked[1] or (status > WARNING and not content)
        if not fits:
            raise ValueError("a value of another size")
    return contents


def settings_of(fmu: UnpackedFmu, name: str, progress: str = "") -> dict[str, Any]:
    """Return the settings from which a `Host` makes an instance of an FMU."""
    resources = fmu.folder / "resources"
    location = resources.as_uri()
    if fmu.first_edition:
        location = fmu.folder.as_uri()
    elif fmu.version == 3:
        location = f"{resources}/" if resources.is_dir() else ""
    return {
        "library": str(fmu.library),
        "version": fmu.version,
        "name": name,
        "token": fmu.token,
        "resources": location,
        "logger": "" if fmu.python_module else _logger(),
        "progress": progress,
        "solver": fmu.solver,
        "clocks": fmu.clocks,
        "has_events": fmu.event_mode,
        "first_edition": fmu.first_edition,
    }


def _is_step(operation: Sequence[Any]) -> bool:
    return operation[0] == "call" and operation[1].endswith("DoStep")


def _count_of(several: int, counts: Sequence[int]) -> int:
    """Return the number of values: given by FMI 3.0, equal to the number of references in FMI 2.0."""
    if counts:
        return counts[0]
    return several


def _kind(name: str) -> str:
    """Return the value type of a getter or setter, a key of `VALUE_TYPES`."""
    kind = name[len("fmi2Get") :]
    if name.startswith("fmi2") and kind == "Boolean":
        return "Boolean2"
    return kind


def _logger() -> str:
    """Return the path of FMPy's library that formats the printf-style log of FMI 2.0; empty if there is none."""
    package = util.find_spec("fmpy.logging")
    assert package is not None
    path = Path(str(package.origin)).parent / fmpy.platform / f"logging{fmpy.sharedLibraryExtension}"
    return str(path) if path.is_file() else ""
