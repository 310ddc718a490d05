"""One running FMU: its library, its instance, its log, and every call with its status looked at."""

import ctypes
import os
import sys
from collections import deque
from collections.abc import Iterable
from contextlib import suppress
from pathlib import Path
from typing import Any, NoReturn
from weakref import WeakValueDictionary

import fmpy
from fmpy import fmi2
from fmpy.fmi1 import FMICallException

from trihedron.errors import InputError
from trihedron.orchestrator.archive import UnpackedFmu
from trihedron.orchestrator.interface import Value, Variable

STATUSES = ("OK", "Warning", "Discard", "Error", "Fatal", "Pending")
WARNING = 1
DISCARD = 2
FATAL = 4
C_TYPES: dict[str, Any] = {
    "Real": ctypes.c_double,
    "Integer": ctypes.c_int,
    "Boolean": ctypes.c_int,
    "String": ctypes.c_char_p,
}
_POINTER, _SIZE, _REAL, _INT = ctypes.c_void_p, ctypes.c_size_t, ctypes.c_double, ctypes.c_int
# Addresses instead of typed pointers: ctypes passes a plain int to a c_void_p fastest.
_ARGUMENTS = {
    "fmi2DoStep": [_POINTER, _REAL, _REAL, _INT],
    **{f"fmi2{verb}{kind}": [_POINTER, _POINTER, _SIZE, _POINTER] for verb in ("Set", "Get") for kind in C_TYPES},
}


def forget_script(fmu: UnpackedFmu) -> None:
    """Make Python forget a module of the name of a PythonFMU script.

    The FMU's library imports its script by name: a module that the process already has under this name (another
    FMU's script, an older version) would be run instead of it, without a word.
    """
    if fmu.python_module:
        sys.modules.pop(fmu.python_module, None)
        resources = fmu.folder / "resources"
        for script in resources.glob("*.py"):
            loaded = sys.modules.get(script.stem)
            if loaded is not None and "trihedron-run-" in str(getattr(loaded, "__file__", "")):
                del sys.modules[script.stem]


def _listen(environment: int | None, name: bytes | None, status: int, _category: bytes, text: bytes | None) -> None:
    """Give a message to the instance that it comes from: by its environment, else by its name, else to all."""
    message = " ".join((text or b"").decode("utf-8", "replace").split())
    slave = _LISTENING.get(environment or 0)
    called = (name or b"").decode("utf-8", "replace")
    heard = [slave] if slave else [s for s in _LISTENING.values() if s.name == called] or list(_LISTENING.values())
    for instance in heard:
        instance.hear(status, message)


_LISTENING: "WeakValueDictionary[int, Slave]" = WeakValueDictionary()
# One logger for all instances, never freed: FMPy's proxy knows only the logger that it was given last.
_LOGGER = fmi2.fmi2CallbackLoggerTYPE(_listen)


class Slave:
    """An instance of an FMU. A call that fails is an InputError with FMU, call, time and the FMU's own words.

    Parameters
    ----------
    name : str
        the FMU's name in the scenario
    fmu : UnpackedFmu
        what to instantiate
    """

    def __init__(self, name: str, fmu: UnpackedFmu) -> None:
        self.name = name
        self.label = fmu.label
        self._log: deque[tuple[int, str]] = deque(maxlen=64)
        _LISTENING[id(self)] = self
        self._dead = False
        self._instance: fmi2.FMU2Slave | None = None
        forget_script(fmu)
        interface = fmu.description.coSimulation
        assert interface is not None
        here = Path.cwd()
        try:
            self._fmu = fmi2.FMU2Slave(
                instanceName=name,
                guid=fmu.description.guid,
                modelIdentifier=interface.modelIdentifier,
                unzipDirectory=str(fmu.folder),
                libraryPath=str(fmu.library),
            )
        except Exception as error:  # FMPy raises plain Exception, AttributeError or OSError here
            raise InputError(f"{self}: its library cannot be loaded ({' '.join(str(error).split())})") from error
        finally:
            os.chdir(here)
        self._callbacks = self._make_callbacks(finished_text=fmu.python_module is not None)
        try:
            self._fmu.instantiate(callbacks=self._callbacks, loggingOn=True)
        except Exception as error:  # FMPy raises plain Exception when it gets no instance
            self._fmu.freeLibrary()
            raise InputError(f"{self}: fmi2Instantiate failed{self._said()}") from error
        self._instance = self._fmu
        self.component: int = self._fmu.component  # type: ignore[assignment]

    def __str__(self) -> str:
        return f"FMU '{self.name}' ({self.label})"

    def _make_callbacks(self, *, finished_text: bool) -> fmi2.fmi2CallbackFunctions:
        callbacks = fmi2.fmi2CallbackFunctions()
        callbacks.logger = _LOGGER
        callbacks.allocateMemory = fmi2.fmi2CallbackAllocateMemoryTYPE(fmpy.calloc)
        callbacks.freeMemory = fmi2.fmi2CallbackFreeMemoryTYPE(fmpy.free)
        callbacks.componentEnvironment = id(self)
        # FMPy's proxy expands printf patterns. PythonFMU hands over finished text in which "%s" may stand (of an
        # exception, say): expanding it would read memory that is nobody's.
        if not finished_text:
            with suppress(ImportError, OSError, AttributeError):
                from fmpy.logging import addLoggerProxy

                addLoggerProxy(ctypes.byref(callbacks))
        return callbacks

    def hear(self, status: int, message: str) -> None:
        """Keep a message of the FMU."""
        self._log.append((status, message))

    def _said(self) -> str:
        """What the FMU said of its failure."""
        serious = [text for status, text in self._log if status >= DISCARD and text]
        # PythonFMU may lose the exception that it reports; what the script logged before says more.
        telling = [text for text in serious if not text.endswith("PyObject_CallMethod unknown error")]
        messages = telling or serious or [text for _, text in self._log if text]
        return f": {messages[-1]}" if messages else " (its log says nothing)"

    def fail(self, call: str, status: int, time: float | None) -> NoReturn:
        """Refuse the run because `call` returned `status`."""
        self._dead = self._dead or status == FATAL
        ended = STATUSES[status] if 0 <= status < len(STATUSES) else f"status {status}"
        when = "before the first step" if time is None else f"at {time:.9g} s"
        raise InputError(f"{self}: {call} {when} ended with {ended}{self._said()}")

    def call(self, name: str, *arguments: Any, time: float | None = None) -> None:
        """Call an FMI function by name with this instance; a status above Warning is an InputError."""
        try:
            getattr(self._fmu, name)(self.component, *arguments)
        except FMICallException as error:
            self.fail(name, error.status, time)

    def function(self, name: str) -> Any:
        """The C function itself, taking addresses as plain integers; the caller looks at the status."""
        function = self._fmu.dll[name]
        function.argtypes = _ARGUMENTS[name]
        function.restype = ctypes.c_int
        return function

    def set_values(self, values: Iterable[tuple[Variable, Value]]) -> None:
        """Set variables one by one, as is done before the run."""
        for variable, value in values:
            c_type = C_TYPES[variable.access]
            number = value.encode() if isinstance(value, str) else value
            reference = (ctypes.c_uint * 1)(variable.reference)
            try:
                self.call(f"fmi2Set{variable.access}", reference, 1, (c_type * 1)(number))
            except InputError as error:
                raise InputError(f"{error} [setting {variable.name} = {value!r}]") from error

    def close(self, *, finished: bool = False) -> None:
        """Terminate (after a run that came to its end), free, unload; may be called twice."""
        instance, self._instance = self._instance, None
        if instance is None or self._dead:
            # After Fatal, FMI 2.0 allows no further call.
            return
        try:
            if finished:
                self.call("fmi2Terminate")
        finally:
            if not self._dead:
                instance.freeInstance()
