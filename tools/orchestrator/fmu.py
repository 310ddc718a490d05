"""An FMU's instance, in this process or as a guest in its own: its operations, with the status of each call checked."""

import ctypes
import math
import struct
import sys
from collections import deque
from collections.abc import Callable, Iterable, MutableSequence, Sequence
from contextlib import suppress
from typing import Any, NoReturn

import fmpy
import numpy as np
from numpy.typing import NDArray

from ..errors import InputError
from ..locks import PREFIX
from .archive import UnpackedFmu
from .guest import NO_INSTANCE, Guest, settings_of
from .guest_process import DISCARD, WARNING, Host
from .interface import FmuVariable, Interface, Value, block_of, bytes_at

STATUSES = ("OK", "Warning", "Discard", "Error", "Fatal", "Pending")
FATAL = 4
SAME_VALUE = 1e-12
"""Relative difference within which an FMU holds a real number that was set."""


def forget_script(fmu: UnpackedFmu) -> None:
    """Make Python forget a module with the name of a PythonFMU script.

    The FMU's library imports its script by name. If the process already has a module of this name (another FMU's
    script, or an older version), the library would silently run that one.
    """
    if fmu.python_module:
        sys.modules.pop(fmu.python_module, None)
        resources = fmu.folder / "resources"
        for script in resources.glob("*.py"):
            loaded = sys.modules.get(script.stem)
            if loaded is not None and PREFIX in str(getattr(loaded, "__file__", "")):
                del sys.modules[script.stem]


_BINARY = ctypes.CFUNCTYPE(ctypes.c_int, *[ctypes.c_size_t] * 5)


def _binary(function: Any, *, setting: bool) -> Callable[..., int]:
    """Wrap fmi3GetBinary or fmi3SetBinary for the loop's memory blocks in place of sizes and addresses."""
    alive: dict[int, list[Any]] = {}

    def called(instance: int, references: int, several: int, values: int, count: int) -> int:
        blocks, sizes, places = ((ctypes.c_size_t * count)() for _ in range(3))
        if setting:
            ctypes.memmove(blocks, values, 8 * count)
            sizes[:] = [len(bytes_at(block)) for block in blocks]
            places[:] = [block + 8 if block else 0 for block in blocks]
        arguments = [ctypes.c_void_p(instance), ctypes.c_void_p(references), ctypes.c_size_t(several)]
        status = function(*arguments, sizes, places, ctypes.c_size_t(count))
        if not setting and status <= WARNING:
            contents = [ctypes.string_at(at, size) if at else b"" for at, size in zip(places, sizes, strict=True)]
            memory = alive[values] = [block_of(content) for content in contents]
            blocks[:] = [ctypes.addressof(block) for block in memory]
            ctypes.memmove(values, blocks, 8 * count)
        return status

    return called


class Library(Host):
    """The library of an FMU in this process, with one instance."""

    lost = blamed = ""
    raised: BaseException | None = None

    def __init__(self, fmu: UnpackedFmu, name: str, log: MutableSequence[tuple[int, str]]) -> None:
        super().__init__(log)
        self._binaries: dict[str, Any] = {}
        forget_script(fmu)
        _, self.component = self.load(settings_of(fmu, name))
        if not self.component:
            self._unload()
            raise RuntimeError(NO_INSTANCE)

    def address(self, name: str) -> int:
        """Return the address of a C function of the library, or of our wrapper that calls it.

        Raises AttributeError if there is none.
        """
        function = self.library[name]
        if name.endswith("Binary"):
            function = self._binaries[name] = _BINARY(_binary(function, setting="Set" in name))
        place = ctypes.cast(function, ctypes.c_void_p).value
        assert place is not None
        return place

    def free(self, name: str) -> int:
        """Free the instance and unload the library."""
        status, _ = self.call(name)
        self._unload()
        return status

    def close(self) -> None:
        """Do nothing: this instance allows no further call."""

    def _unload(self) -> None:
        """Unload the library; a PythonFMU library releases its interpreter first.

        That C++ library stays loaded until the end of the process, where it would otherwise release the interpreter in
        memory that is already freed, and corrupt the heap.
        """
        with suppress(AttributeError):
            self.library["finalizePythonInterpreter"]()
        fmpy.freeLibrary(self.library._handle)


class Slave:
    """An instance of an FMU of FMI 2.0, under its name in the scenario, in this process or as a guest in its own.

    A failing call raises InputError with the FMU, the call, the time and the FMU's own message.
    """

    prefix = "fmi2"
    set_state, get_state, free_state = "fmi2SetFMUstate", "fmi2GetFMUstate", "fmi2FreeFMUstate"

    def __init__(self, name: str, fmu: UnpackedFmu) -> None:
        self.name = name
        self.label = fmu.label
        self._log: deque[tuple[int, str]] = deque(maxlen=64)
        self._dead = self._freed = False
        self._is_solved = bool(fmu.solver)
        try:
            if fmu.guest:
                self._host: Library | Guest = Guest(fmu, name, self.hear)
            else:
                self._host = Library(fmu, name, self._log)
        except (OSError, AttributeError, RuntimeError) as error:
            reason = " ".join(str(error).split())
            if reason == NO_INSTANCE:
                raise InputError(f"{self}: {self.prefix}Instantiate failed{self._said()}") from error
            raise InputError(f"{self}: its library cannot be loaded ({reason})") from error
        self.component: int = self._host.component

    def __str__(self) -> str:
        return f"FMU '{self.name}' ({self.label})"

    def hear(self, status: int, message: str) -> None:
        """Keep a message of the FMU."""
        self._log.append((status, message))

    def _said(self) -> str:
        """Return the FMU's own message about its failure, as the end of a sentence."""
        serious = [text for status, text in self._log if status >= DISCARD and text]
        # PythonFMU may lose the exception that it reports; the script's earlier log entry says more.
        telling = [text for text in serious if not text.endswith("PyObject_CallMethod unknown error")]
        messages = telling or serious or [text for _, text in self._log if text]
        if not messages:
            return " (its log says nothing)"
        return f": {messages[-1]}"

    def fail(self, call: str, status: int, time: float | None) -> NoReturn:
        """Refuse the run because `call` returned `status`."""
        if self._host.raised is not None:
            raise self._host.raised
        self._dead = self._dead or status == FATAL
        ended, when = f"status {status}", "before the first step"
        if 0 <= status < len(STATUSES):
            ended = STATUSES[status]
        if time is not None:
            when = f"at {time:.9g} s"
        how = self._host.lost or f"ended with {ended}"
        raise InputError(f"{self}: {self._host.blamed or call} {when} {how}{self._said()}")

    def refuse_not_finite(self, variables: Iterable[FmuVariable], values: Iterable[float], time: float) -> NoReturn:
        """Refuse the run because one of these outputs is not finite."""
        infinite = []
        for variable, value in zip(variables, values, strict=True):
            if not math.isfinite(value):
                infinite.append(f"{variable.name} is {float(value)}")
        raise InputError(f"{self}: {infinite[0]} at {time:.9g} s; to run all the same: --allow-nan")

    def call(self, name: str, *arguments: Any, time: float | None = None) -> None:
        """Call an FMI function of this instance by name.

        Raises InputError for a status above Warning.
        """
        try:
            status, _ = self._host.call(name, arguments)
        except AttributeError as error:
            raise InputError(f"{self}: its library has no function {name}") from error
        if status > WARNING:
            self.fail(name, status, time)

    def address(self, name: str) -> int:
        """Return the address of a C function of the library."""
        try:
            return self._host.address(name)
        except AttributeError as error:
            raise InputError(f"{self}: its library has no function {name}") from error

    def accessor(self, verb: str, access: str) -> str:
        """Return the name of the function that gets or sets values of a type."""
        if access == "Boolean2":
            access = "Boolean"
        return f"{self.prefix}{verb}{access}"

    def set_values(self, values: Iterable[tuple[FmuVariable, Value]], _: Interface) -> None:
        """Set variables one by one, before the run."""
        for variable, value in values:
            self._set(variable, [value], f"{variable.name} = {value!r}")

    def _set(self, variable: FmuVariable, values: list[Any], setting: str) -> None:
        """Set a variable, or an array of FMI 3.0."""
        name = self.accessor("Set", variable.access)
        self.address(name)
        arguments: list[Any] = [variable.reference.to_bytes(4, sys.byteorder), 1]
        if variable.kind == "String":
            arguments.append([str(value).encode() for value in values])
        elif variable.kind == "Binary":
            blocks = [bytes.fromhex(str(value)) for value in values]
            arguments += [np.array(list(map(len, blocks)), dtype=np.uint64).tobytes(), blocks]
        else:
            arguments.append(np.array(values, dtype=variable.value_type.dtype).tobytes())
        if self.prefix == "fmi3":
            arguments.append(len(values))
        status, _ = self._host.call(name, arguments)
        if status > WARNING:
            try:
                self.fail(name, status, None)
            except InputError as error:
                raise InputError(f"{error} [setting {setting}]") from error

    def interpolate(self, variables: Sequence[FmuVariable], times: NDArray, rows: NDArray) -> None:
        """Give inputs to the solver of a guest: rows at some times [s], linear between them."""
        references = np.array([v.reference for v in variables if v.place == 0], dtype=np.uint32)
        setter = self.accessor("Set", variables[0].access)
        self.address(setter)
        self._host.interpolate(setter, references.tobytes(), times.tobytes(), rows.tobytes())

    def _read(self, variable: FmuVariable, count: int) -> list[Any] | None:
        """Return the values of a variable, or of all elements of its array; None if it cannot be read."""
        output: tuple[Any, ...] = (bytes(np.dtype(variable.value_type.dtype).itemsize * count),)
        if variable.value_type.by_address:
            output = ("texts" if variable.kind == "String" else "binaries", count)
        arguments: list[Any] = [variable.reference.to_bytes(4, sys.byteorder), 1, output]
        if self.prefix == "fmi3":
            arguments.append(count)
        name = self.accessor("Get", variable.access)
        try:
            self._host.address(name)
        except AttributeError:
            return None
        status, contents = self._host.call(name, arguments)
        if status > WARNING:
            return None
        if variable.kind == "String":
            return [text.decode("utf-8", "replace") for text in contents[0]]
        if variable.kind == "Binary":
            return [content.hex() for content in contents[0]]
        return np.frombuffer(contents[0], dtype=variable.value_type.dtype).tolist()

    def not_held(self, values: Iterable[tuple[FmuVariable, Value]]) -> list[tuple[FmuVariable, Value, Any]]:
        """Return the variables that do not hold the values given for them, with both values; None is not readable."""
        arrays: dict[tuple[str, int], list[Any] | None] = {}
        different = []
        for variable, value in values:
            key = variable.access, variable.reference
            if key not in arrays:
                arrays[key] = self._read(variable, variable.size)
            elements = arrays[key]
            held = None
            if elements is not None:
                held = elements[variable.place]
            if not _is_same(variable, value, held):
                different.append((variable, value, held))
        return different

    def begin(self, start: float, stop: float, tolerance: float | None = None) -> None:
        """Set the times of the run and a tolerance for the FMU's own solver, and enter initialisation."""
        self.call("fmi2SetupExperiment", int(tolerance is not None), tolerance or 0.0, start, 1, stop)
        self.call("fmi2EnterInitializationMode")

    def ended_at(self, begin: float) -> float | None:
        """Return the time that the step reached if an FMU of FMI 2.0 discards it and asks for the end of the run.

        Returns None if the step has not advanced: an FMU with its own solver has then failed, even if it asks for the
        end. PythonFMU does both when a script's step fails.
        """
        answers: list[bytes] = []
        for name, kind, size in (("Boolean", 3, 4), ("Real", 2, 8)):
            function = f"fmi2Get{name}Status"
            try:
                self._host.address(function)
            except AttributeError:
                return None
            status, contents = self._host.call(function, (kind, (bytes(size),)))
            if status > WARNING:
                return None
            answers += contents
        asks, (reached,) = any(answers[0]), struct.unpack("d", answers[1])
        if asks and (reached > begin or self._is_solved):
            return reached
        return None

    def free_state_at(self, place: int) -> None:
        """Free the state at an address."""
        if not self._freed and not self._dead:
            self._host.call(self.free_state, [(ctypes.string_at(place, 8),)])

    def close(self, finished: float | None = None) -> None:
        """Terminate (with the end time of a completed run), free and unload; may be called twice."""
        if self._freed:
            return
        self._freed = True
        try:
            if finished is not None and not self._dead:
                self.call(f"{self.prefix}Terminate", time=finished)
        finally:
            # After Fatal, FMI allows no further call.
            freeing = f"{self.prefix}FreeInstance"
            if self._dead:
                status = self._host.close()
            else:
                status = self._host.free(freeing)
        if status and finished is not None:
            self.fail(freeing, status, finished)


class Slave3(Slave):
    """An instance of an FMU of FMI 3.0."""

    prefix = "fmi3"
    set_state, get_state, free_state = "fmi3SetFMUState", "fmi3GetFMUState", "fmi3FreeFMUState"

    def set_values(self, values: Iterable[tuple[FmuVariable, Value]], interface: Interface) -> None:
        """Set variables, each array as a whole: elements that are not given keep their start values."""
        structural, remaining = [], []
        for variable, value in values:
            if variable.causality == "structuralParameter":
                structural.append((variable, value))
            else:
                remaining.append((variable, value))
        if structural:
            self.call("fmi3EnterConfigurationMode")
            super().set_values(structural, interface)
            self.call("fmi3ExitConfigurationMode")
        arrays: dict[int, dict[FmuVariable, Value]] = {}
        for variable, value in remaining:
            arrays.setdefault(variable.reference, {})[variable] = value
        for elements_of in arrays.values():
            first = next(iter(elements_of))
            name = first.name
            if first.size > 1:
                name = name.rpartition("[")[0]
            elements = interface.find(name)
            values_of_all = [elements_of.get(v, v.start) for v in elements]
            if None in values_of_all:
                raise InputError(f"{self}: {name} has no start values; give all its {len(values_of_all)} elements")
            self._set(
                first, values_of_all, f"{name} = {values_of_all[0] if len(values_of_all) == 1 else values_of_all!r}"
            )

    def begin(self, start: float, stop: float, tolerance: float | None = None) -> None:
        """Enter initialisation with the times of the run and a tolerance for the FMU's own solver."""
        self.call("fmi3EnterInitializationMode", tolerance is not None, tolerance or 0.0, start, True, stop)


def _is_same(variable: FmuVariable, given: Value, held: Any) -> bool:
    """Return True if a value is the given one: a Real but for the rounding of units, others exactly."""
    if held is None:
        return False
    if variable.kind == "Real":
        number = float(variable.value_type.dtype(given))
        return math.isclose(number, held, rel_tol=SAME_VALUE, abs_tol=0.0)
    if variable.kind == "Boolean":
        return bool(given) == bool(held)
    if variable.kind == "Binary":
        return str(given).lower() == held
    return given == held


SLAVES = {2: Slave, 3: Slave3}
"""Instance class for each version of FMI."""
