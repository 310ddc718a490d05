"""The process of a guest: it has one FMU of somebody else, and makes the calls that the orchestrator asks for.

It is run as a file and imports nothing but Python's own, so that it starts quickly. A request is a list of operations,
its reply what each gave until one failed, and what the FMU logged: values of Python, with their length before them.

| operation | gives |
|---|---|
| load, library, version, name, token, resources, library of FMPy's logger or "", progress, handled | instance |
| has, function | whether the library has it |
| call, function, arguments | status |
| define, number, function, references, values, bytes of a value: an access, for set and get | |
| set, number, values | status |
| get, number | status, values |
| derivatives, function, references, orders, values | status |
| step, function, time, step, flag | status, what fmi3DoStep returns; then what each of `follow` gets |
| state, function, state | status, state |
| status, function, kind | status, value |
| follow, numbers | |

`handled` is None where an FMU handles its events itself; of model exchange it has the numbers of states and of event
indicators, and a tolerance; else it is empty.
"""

import ctypes
import importlib
import marshal
import mmap
import os
import signal
import struct
import sys
import threading
import time
import types
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

HEAD = struct.Struct("<Q")
"""Length of a message."""
TEXT, BINARY = -1, -2
"""In place of the bytes of a value: it is a string of C, or bytes of any number."""
_TYPES = {"i": ctypes.c_int, "b": ctypes.c_bool, "d": ctypes.c_double}
_ARGUMENTS = {"fmi2SetupExperiment": "iddid", "fmi3EnterInitializationMode": "bddbd"}
_MODEL_EXCHANGE, _COSIMULATION = range(2)
_STEP_RETURNS = 16
"""Bytes that fmi3DoStep writes: three flags and, from the eighth on, the last successful time."""
_LOG_2 = ctypes.CFUNCTYPE(None, ctypes.c_void_p, ctypes.c_char_p, ctypes.c_int, ctypes.c_char_p, ctypes.c_char_p)
_LOG_3 = ctypes.CFUNCTYPE(None, ctypes.c_void_p, ctypes.c_int, ctypes.c_char_p, ctypes.c_char_p)


class _Callbacks(ctypes.Structure):
    """Callback functions of FMI 2.0."""

    _fields_ = (
        ("logger", _LOG_2),
        ("allocate", ctypes.c_void_p),
        ("free", ctypes.c_void_p),
        ("finished", ctypes.c_void_p),
        ("environment", ctypes.c_void_p),
    )


class Host:
    """The FMU in this process, and the operations on it."""

    def __init__(self) -> None:
        self.log: list[tuple[int, str]] = []
        self.events: Any = None
        """Of an FMU whose events are handled here: what makes its steps."""
        self._start = 0.0
        self.follows: list[int] = []
        self.progress: Any = bytearray(1)
        """Which operation of a request is being made."""
        self._accesses: dict[int, tuple[Any, Any, int, int, int]] = {}
        self._functions: dict[str, Any] = {}
        self._kept: list[Any] = []

    def _hear(self, status: int, text: bytes | None) -> None:
        self.log.append((status, " ".join((text or b"").decode("utf-8", "replace").split())))

    def load(
        self, library: str, version: int, name: str, token: str, resources: str, logger: str, file: str,
        handled: tuple[Any, ...] | None,
    ) -> int:  # fmt: skip
        """Load the library and make the instance; 0 where it gives none."""
        exchanged = bool(handled)
        if exchanged:
            self.events = _beside("guest_solver").Solver(version, self._plainly, self.log, *handled)
        elif handled is not None:
            self.events = _beside("guest_events").Events(version, self._plainly, self.log)
        with Path(file).open("r+b") as opened:
            self.progress = mmap.mmap(opened.fileno(), 1)
        here = Path.cwd()
        # Libraries that lie beside it are found there.
        os.chdir(Path(library).parent)
        try:
            self.library = ctypes.CDLL(library)
        finally:
            os.chdir(here)
        who, what, where = name.encode(), token.encode(), resources.encode() or None
        if version == 2:
            self._log: Any = _LOG_2(lambda _, __, status, ___, text: self._hear(status, text))
            memory = ctypes.CDLL("msvcrt" if os.name == "nt" else None)
            pointers = [ctypes.cast(function, ctypes.c_void_p).value for function in (memory.calloc, memory.free)]
            callbacks = _Callbacks(self._log, *pointers, None, None)
            self._kept += [memory, callbacks]
            if logger:
                # It writes out what printf would.
                proxy = ctypes.CDLL(logger).addLoggerProxy
                proxy.argtypes, proxy.restype = [ctypes.c_void_p], None
                proxy(ctypes.byref(callbacks))
            make = self._function("fmi2Instantiate", ctypes.c_void_p)
            kind = _MODEL_EXCHANGE if exchanged else _COSIMULATION
            given = who, kind, what, where, ctypes.byref(callbacks), 0, 1
        else:
            self._log = _LOG_3(lambda _, status, __, text: self._hear(status, text))
            own = handled is not None
            visible, logging, events, early = (ctypes.c_bool(on) for on in (False, True, own, own))
            if not exchanged:
                make = self._function("fmi3InstantiateCoSimulation", ctypes.c_void_p)
                more = events, early, None, ctypes.c_size_t(0), None, self._log, None
            else:
                make, more = self._function("fmi3InstantiateModelExchange", ctypes.c_void_p), (None, self._log)
            given = who, what, where, visible, logging, *more
        self.instance = ctypes.c_void_p(make(*given))
        return self.instance.value or 0

    def _function(self, name: str, returns: Any = ctypes.c_int) -> Any:
        if name not in self._functions:
            self._functions[name] = self.library[name]
            self._functions[name].restype = returns
        return self._functions[name]

    def has(self, name: str) -> bool:
        """Whether the library has a function, or something here stands in for it."""
        return hasattr(self.library, name) or (self.events is not None and name.endswith(("DoStep", "Status")))

    def _plainly(self, name: str, *arguments: Any) -> int:
        """Call a function with values of C."""
        return self._function(name)(self.instance, *arguments)

    def call(self, name: str, arguments: Sequence[Any]) -> int:
        """Call a function of plain arguments."""
        kinds = _ARGUMENTS.get(name, "")
        function = self._function(name, None if name.endswith("FreeInstance") else ctypes.c_int)
        given = [_TYPES[kind](value) for kind, value in zip(kinds, arguments, strict=True)]
        if name in _ARGUMENTS:
            self._start = arguments[2]
        status = function(self.instance, *given) or 0
        if self.events is not None and status <= 1 and name.endswith("ExitInitializationMode"):
            return self.events.enter(self._start)
        return status

    def define(self, number: int, name: str, references: bytes, count: int, size: int) -> int:
        """Lay ready what an access needs, whose values are `count` of so many bytes."""
        function = self.library[name]
        sizes = (ctypes.c_size_t,) if name.startswith("fmi3") else ()
        places = (ctypes.c_void_p,) * (2 if size == BINARY else 1)
        function.argtypes = [ctypes.c_void_p, ctypes.c_char_p, ctypes.c_size_t, *places, *sizes]
        self._accesses[number] = function, references, len(references) // 4, count, size
        return 0

    def _access(self, number: int, *memory: Any) -> int:
        function, references, several, count, _ = self._accesses[number]
        more = () if len(function.argtypes) == 4 else (count,)
        return function(self.instance, references, several, *memory, *more)

    def set(self, number: int, values: Any) -> int:
        """Set values: bytes, or strings."""
        size = self._accesses[number][-1]
        if size in (TEXT, BINARY):
            several = len(values)
            sizes = (ctypes.c_size_t * several)(*map(len, values))
            values = (ctypes.c_char_p * several)(*values)
            if size == BINARY:
                return self._access(number, sizes, values)
        return self._access(number, values)

    def get(self, number: int) -> tuple[int, Any]:
        """Get values: bytes, or strings."""
        count, size = self._accesses[number][-2:]
        if size == BINARY:
            sizes, places = (ctypes.c_size_t * count)(), (ctypes.c_void_p * count)()
            status = self._access(number, sizes, places)
            pairs = zip(places, sizes, strict=True) if status <= 1 else ()
            return status, [ctypes.string_at(at, length) if at else b"" for at, length in pairs]
        memory: Any = (ctypes.c_char_p * count)() if size == TEXT else ctypes.create_string_buffer(count * size)
        status = self._access(number, memory)
        return status, [text or b"" for text in memory] if size == TEXT else memory.raw

    def derivatives(self, name: str, references: bytes, orders: bytes, values: bytes) -> int:
        """Tell the derivatives of inputs."""
        return self._function(name)(self.instance, references, ctypes.c_size_t(len(orders) // 4), orders, values)

    def step(self, name: str, begin: float, length: float, flag: int) -> tuple[int, bytes]:
        """Make a step."""
        if self.events is not None:
            status, reached = self.events.step(begin, length)
            # Of FMI 3.0: whether it ends the run, whether before the end of the step, and when.
            returned = struct.pack(
                "=???xxxxxd", False, self.events.ended is not None, reached < begin + length, reached
            )
            return status, returned if name.startswith("fmi3") else b""
        function, given = self._function(name), (ctypes.c_double(begin), ctypes.c_double(length))
        if name.startswith("fmi2"):
            return function(self.instance, *given, flag), b""
        memory = ctypes.create_string_buffer(_STEP_RETURNS)
        places = [ctypes.byref(memory, at) for at in (0, 1, 2, 8)]
        return function(self.instance, *given, ctypes.c_bool(bool(flag)), *places), memory.raw

    def state(self, name: str, state: int) -> tuple[int, int]:
        """Get (again into a state that there is), set or free a state."""
        kept = ctypes.c_void_p(state or None)
        given = kept if "Set" in name else ctypes.byref(kept)
        return self._function(name)(self.instance, given), kept.value or 0

    def status(self, name: str, kind: int) -> tuple[int, bytes]:
        """What FMI 2.0 says of a step that was not made."""
        if self.events is not None:
            ended = self.events.ended
            number = struct.pack("d", ended or 0.0) if "Real" in name else struct.pack("ii", ended is not None, 0)
            return 0, number
        value = ctypes.create_string_buffer(8)
        return self._function(name)(self.instance, kind, value), value.raw

    def follow(self, numbers: list[int]) -> int:
        """What is got after each step from now on."""
        self.follows = numbers
        return 0

    def answer(self, request: Sequence[tuple[Any, ...]]) -> list[Any]:
        """Make the operations of a request, until one fails; what each gave, and what follows a step."""
        found: list[Any] = []
        for at, (verb, *given) in enumerate(request):
            self.progress[0] = at
            made = getattr(self, verb)(*given)
            found.append(made)
            status = made[0] if isinstance(made, tuple) else made
            if status > 1 and verb not in ("load", "has"):
                return found
            if verb == "step":
                for number in self.follows:
                    at += 1
                    self.progress[0] = at
                    found.append(self.get(number))
        return found


def _beside(name: str) -> Any:
    """A module that stands beside this file, which is here in no package."""
    package = sys.modules.setdefault("guests", types.ModuleType("guests"))
    package.__path__ = [str(Path(__file__).parent)]
    return importlib.import_module(f"guests.{name}")


def _end_with(parent: int) -> None:
    """End this process when the one that began it is gone, whatever the FMU is doing."""
    while os.getppid() == parent:
        time.sleep(1.0)
    os._exit(1)


def serve(read: Callable[[int], bytes], write: Callable[[bytes], object], flush: Callable[[], object]) -> None:
    """Answer requests until there are none any more."""
    host = Host()
    while head := read(HEAD.size):
        try:
            found, wrong = host.answer(marshal.loads(read(*HEAD.unpack(head)))), ""
        except (OSError, AttributeError, ImportError) as error:
            found, wrong = [], " ".join(str(error).split()) or type(error).__name__
        reply = marshal.dumps((found, host.log, wrong))
        host.log.clear()
        write(HEAD.pack(len(reply)) + reply)
        flush()


def main() -> None:
    """Serve on standard input and output, which the FMU does not get to see; what it prints goes to standard error."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    requests, replies = os.fdopen(os.dup(0), "rb"), os.fdopen(os.dup(1), "wb")
    os.dup2(os.open(os.devnull, os.O_RDONLY), 0)
    os.dup2(2, 1)
    threading.Thread(target=_end_with, args=(os.getppid(),), daemon=True).start()
    serve(requests.read, replies.write, replies.flush)
    sys.stdout.flush()
    # Threads of the FMU are not waited for.
    os._exit(0)


if __name__ == "__main__":
    main()
