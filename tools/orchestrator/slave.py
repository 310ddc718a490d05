"""One running FMU, of FMI 2.0 or 3.0: its library, its instance, its log, every call with its status looked at."""

import ctypes
import math
import os
import sys
from collections import deque
from collections.abc import Iterable
from contextlib import suppress
from pathlib import Path
from typing import Any, NoReturn
from weakref import WeakValueDictionary

import fmpy
import numpy as np
from fmpy import fmi2, fmi3
from fmpy.fmi1 import FMICallException

from ..errors import InputError
from .interface import Interface, Value, Variable
from .load import UnpackedFmu

STATUSES = ("OK", "Warning", "Discard", "Error", "Fatal", "Pending")
DISCARD = 2
FATAL = 4


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


def _listen(environment: int | None, status: int, text: bytes | None, name: bytes | None = None) -> None:
    """Give a message to the instance that it comes from: by its environment, else by its name, else to all."""
    message = " ".join((text or b"").decode("utf-8", "replace").split())
    slave, called = LISTENING.get(environment or 0), (name or b"").decode("utf-8", "replace")
    heard = [slave] if slave else [s for s in LISTENING.values() if s.name == called] or list(LISTENING.values())
    for instance in heard:
        instance.hear(status, message)


LISTENING: "WeakValueDictionary[int, Slave]" = WeakValueDictionary()
# One logger for all instances, never freed: FMPy's proxy knows only the logger that it was given last.
_LOGGER_2 = fmi2.fmi2CallbackLoggerTYPE(lambda at, name, status, _, text: _listen(at, status, text, name))
_LOGGER_3 = fmi3.fmi3LogMessageCallback(lambda at, status, _, text: _listen(at, status, text))
_NO_UPDATE = fmi3.fmi3IntermediateUpdateCallback()


class Slave:
    """An instance of an FMU of FMI 2.0. A failing call is an InputError with FMU, call, time and the FMU's own words.

    Parameters
    ----------
    name : str
        the FMU's name in the scenario
    fmu : UnpackedFmu
        what to instantiate
    """

    prefix = "fmi2"
    fmpy_class: Any = fmi2.FMU2Slave
    token = "guid"
    set_state, get_state, free_state = "fmi2SetFMUstate", "fmi2GetFMUstate", "fmi2FreeFMUstate"

    def __init__(self, name: str, fmu: UnpackedFmu) -> None:
        self.name = name
        self.label = fmu.label
        self._log: deque[tuple[int, str]] = deque(maxlen=64)
        LISTENING[id(self)] = self
        self._dead = False
        self._instance: Any = None
        forget_script(fmu)
        here = Path.cwd()
        assert fmu.description.coSimulation is not None
        try:
            self._fmu: Any = self.fmpy_class(
                instanceName=self.name,
                guid=getattr(fmu.description, self.token),
                modelIdentifier=fmu.description.coSimulation.modelIdentifier,
                unzipDirectory=str(fmu.folder),
                libraryPath=str(fmu.library),
            )
        except Exception as error:  # FMPy raises plain Exception, AttributeError or OSError here
            raise InputError(f"{self}: its library cannot be loaded ({' '.join(str(error).split())})") from error
        finally:
            os.chdir(here)
        try:
            self._instantiate(fmu)
        except Exception as error:  # FMPy raises plain Exception when it gets no instance
            self._unload()
            raise InputError(f"{self}: {self.prefix}Instantiate failed{self._said()}") from error
        self._instance = self._fmu
        self.component: int = self._fmu.component

    def _instantiate(self, fmu: UnpackedFmu) -> None:
        callbacks = self._callbacks = fmi2.fmi2CallbackFunctions()
        callbacks.logger = _LOGGER_2
        callbacks.allocateMemory = fmi2.fmi2CallbackAllocateMemoryTYPE(fmpy.calloc)
        callbacks.freeMemory = fmi2.fmi2CallbackFreeMemoryTYPE(fmpy.free)
        callbacks.componentEnvironment = id(self)
        # FMPy's proxy expands printf patterns. PythonFMU hands over finished text in which "%s" may stand (of an
        # exception, say): expanding it would read memory that is nobody's.
        if fmu.python_module is None:
            with suppress(ImportError, OSError, AttributeError):
                from fmpy.logging import addLoggerProxy

                addLoggerProxy(ctypes.byref(callbacks))
        self._fmu.instantiate(callbacks=callbacks, loggingOn=True)

    def __str__(self) -> str:
        return f"FMU '{self.name}' ({self.label})"

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

    def refuse_not_finite(self, variables: Iterable[Variable], values: Iterable[float], time: float) -> NoReturn:
        """Refuse the run because one of these outputs is not finite."""
        found = [(v.name, float(x)) for v, x in zip(variables, values, strict=True) if not math.isfinite(x)]
        raise InputError(f"{self}: {found[0][0]} is {found[0][1]} at {time:.9g} s")

    def call(self, name: str, *arguments: Any) -> None:
        """Call an FMI function by name with this instance; a status above Warning is an InputError."""
        try:
            getattr(self._fmu, name)(self.component, *arguments)
        except FMICallException as error:
            self.fail(name, error.status, None)

    def address(self, name: str) -> int:
        """Where a C function of the library is."""
        try:
            found = ctypes.cast(self._fmu.dll[name], ctypes.c_void_p).value
        except AttributeError as error:
            raise InputError(f"{self}: its library has no function {name}") from error
        assert found is not None
        return found

    def accessor(self, verb: str, access: str) -> str:
        """Name of the function that gets or sets values of a type."""
        return f"{self.prefix}{verb}{'Boolean' if access == 'Boolean2' else access}"

    def set_values(self, values: Iterable[tuple[Variable, Value]], _interface: Interface) -> None:
        """Set variables one by one, as is done before the run."""
        for variable, value in values:
            text = isinstance(value, str)
            c_type = ctypes.c_char_p if text else np.ctypeslib.as_ctypes_type(variable.value_type.dtype)
            memory = (c_type * 1)(value.encode() if text else value)
            reference = (ctypes.c_uint * 1)(variable.reference)
            try:
                self.call(self.accessor("Set", variable.access), reference, 1, memory)
            except InputError as error:
                raise InputError(f"{error} [setting {variable.name} = {value!r}]") from error

    def begin(self, start: float, stop: float) -> None:
        """Tell the times of the run and enter initialisation."""
        self.call("fmi2SetupExperiment", 0, 0.0, start, 1, stop)
        self.call("fmi2EnterInitializationMode")

    def free_state_at(self, place: int) -> None:
        """Free a state that stands at an address."""
        if self._instance is not None and not self._dead:
            free = ctypes.CFUNCTYPE(ctypes.c_int, ctypes.c_void_p, ctypes.c_void_p)(self.address(self.free_state))
            free(self.component, place)

    def close(self, *, finished: bool = False) -> None:
        """Terminate (after a run that came to its end), free, unload; may be called twice."""
        instance, self._instance = self._instance, None
        if instance is None or self._dead:
            # After Fatal, FMI allows no further call.
            return
        try:
            if finished:
                self.call(f"{self.prefix}Terminate")
        finally:
            if not self._dead:
                getattr(instance, f"{self.prefix}FreeInstance")(self.component)
                self._unload()

    def _unload(self) -> None:
        """Unload the library; PythonFMU's lets go of its interpreter first.

        At the end of the process it would do so in memory that it has freed, which corrupts the heap: that library of
        C++ is not really unloaded before.
        """
        with suppress(AttributeError):
            self._fmu.dll["finalizePythonInterpreter"]()
        self._fmu.freeLibrary()


class Slave3(Slave):
    """An instance of an FMU of FMI 3.0."""

    prefix = "fmi3"
    fmpy_class = fmi3.FMU3Slave
    token = "instantiationToken"
    set_state, get_state, free_state = "fmi3SetFMUState", "fmi3GetFMUState", "fmi3FreeFMUState"

    def _instantiate(self, fmu: UnpackedFmu) -> None:
        resources = fmu.folder / "resources"
        where = f"{resources}/".encode() if resources.is_dir() else None
        token = str(fmu.description.instantiationToken).encode()
        visible, logging, events, early = False, True, False, False
        self._fmu.component = self._fmu.fmi3InstantiateCoSimulation(
            self.name.encode(), token, where, visible, logging, events, early,
            (fmi3.fmi3ValueReference * 0)(), 0, id(self), _LOGGER_3, _NO_UPDATE,
        )  # fmt: skip
        if not self._fmu.component:
            raise RuntimeError("no instance")

    def set_values(self, values: Iterable[tuple[Variable, Value]], interface: Interface) -> None:
        """Set variables, arrays as a whole: what is not given of an array keeps its start value."""
        arrays: dict[int, dict[Variable, Value]] = {}
        for variable, value in values:
            arrays.setdefault(variable.reference, {})[variable] = value
        for given in arrays.values():
            first = next(iter(given))
            name = first.name.rpartition("[")[0] if first.size > 1 else first.name
            elements = interface.find(name)
            whole = [given.get(v, v.start) for v in elements]
            if None in whole:
                raise InputError(f"{self}: {name} has no start values; give all its {len(whole)} elements")
            try:
                self._set(first, whole)
            except InputError as error:
                shown = whole[0] if len(whole) == 1 else whole
                raise InputError(f"{error} [setting {name} = {shown!r}]") from error

    def _set(self, variable: Variable, values: list[Any]) -> None:
        name, reference = self.accessor("Set", variable.access), ctypes.c_uint(variable.reference)
        # Its prototype is FMPy's, which knows no memory of numpy.
        words = (ctypes.c_void_p, ctypes.c_void_p, ctypes.c_size_t, ctypes.c_void_p, ctypes.c_size_t)
        function = ctypes.CFUNCTYPE(ctypes.c_int, *words)(self.address(name))
        if variable.kind == "String":
            values = [ctypes.create_string_buffer(str(value).encode()) for value in values]
            memory = np.array([ctypes.addressof(text) for text in values], dtype=np.uint64)
        else:
            memory = np.array(values, dtype=variable.value_type.dtype)
        status = function(self.component, ctypes.addressof(reference), 1, memory.ctypes.data, len(values))
        if status > 1:
            self.fail(name, status, None)

    def begin(self, start: float, stop: float) -> None:
        """Enter initialisation with the times of the run."""
        self.call("fmi3EnterInitializationMode", False, 0.0, start, True, stop)
