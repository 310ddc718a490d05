"""The C functions of a native FMU, called directly; every message is kept. It imports only the standard library."""

import ctypes as ct
from collections.abc import Sequence
from pathlib import Path
from typing import Any

OK, WARNING, DISCARD, ERROR, FATAL = range(5)
Logger2 = ct.CFUNCTYPE(None, ct.c_void_p, ct.c_char_p, ct.c_int, ct.c_char_p, ct.c_char_p)
Logger3 = ct.CFUNCTYPE(None, ct.c_void_p, ct.c_int, ct.c_char_p, ct.c_char_p)


class Callbacks2(ct.Structure):
    """fmi2CallbackFunctions."""

    _fields_ = (
        ("logger", ct.c_void_p),
        ("allocate", ct.c_void_p),
        ("free", ct.c_void_p),
        ("finished", ct.c_void_p),
        ("environment", ct.c_void_p),
    )


C_TYPES = {
    2: {"real": ct.c_double, "integer": ct.c_int, "boolean": ct.c_int, "enumeration": ct.c_int},
    3: {"real": ct.c_double, "integer": ct.c_int32, "boolean": ct.c_bool, "enumeration": ct.c_int64},
}
ACCESS = {
    2: {"real": "Real", "integer": "Integer", "boolean": "Boolean", "enumeration": "Integer"},
    3: {"real": "Float64", "integer": "Int32", "boolean": "Boolean", "enumeration": "Int64"},
}


class Library:
    """A shared library of a native FMU.

    Parameters
    ----------
    binary : Path
        the library
    fmi : int
        2 or 3
    token : str
        GUID or instantiation token
    """

    def __init__(self, binary: Path, fmi: int, token: str) -> None:
        self.fmi, self.token = fmi, token.encode()
        self.dll = ct.CDLL(str(binary))
        self.log: list[tuple[int, str, str]] = []
        self.logger: Any
        if fmi == 2:
            self.logger = Logger2(lambda _e, _n, status, category, text: self.hear(status, category, text))
            self.callbacks = Callbacks2(logger=ct.cast(self.logger, ct.c_void_p).value)
        else:
            self.logger = Logger3(lambda _e, status, category, text: self.hear(status, category, text))

    def hear(self, status: int, category: bytes, text: bytes) -> None:
        self.log.append((status, category.decode(), text.decode()))

    def function(self, name: str, result: Any = ct.c_int) -> Any:
        function = self.dll[f"fmi{self.fmi}{name}"]
        function.restype = result
        return function

    def instantiate(
        self,
        name: bytes | None = b"instance",
        token: bytes | None = b"",
        *,
        kind: int = 1,
        callbacks: bool = True,
        logging: bool = True,
    ) -> int | None:
        """Return an instance's address, None if it is refused; an empty token is replaced by the correct one.

        A `kind` other than 1 asks for model exchange (FMI 2.0) or for event mode (FMI 3.0).
        """
        token = self.token if token == b"" else token
        if self.fmi == 2:
            table = ct.byref(self.callbacks) if callbacks else None
            return self.function("Instantiate", ct.c_void_p)(name, kind, token, b"", table, 0, int(logging))
        logger = self.logger if callbacks else None
        no = ct.c_bool(False)
        return self.function("InstantiateCoSimulation", ct.c_void_p)(
            name, token, b"", no, ct.c_bool(logging), ct.c_bool(kind != 1), no, None, ct.c_size_t(0), None, logger, None
        )

    def free(self, instance: int | None) -> None:
        self.function("FreeInstance", None)(ct.c_void_p(instance))

    def call(self, name: str, instance: int | None, *arguments: Any) -> int:
        """Return the status of a call; numbers must be ctypes objects."""
        return self.function(name)(ct.c_void_p(instance), *arguments)

    def enter(self, instance: int | None, start: float = 0.0, stop: float | None = None) -> int:
        """Set up the experiment and enter the initialisation."""
        if self.fmi == 2:
            return self.setup(instance, start, stop) or self.call("EnterInitializationMode", instance)
        flag, end = ct.c_bool(stop is not None), ct.c_double(stop or 0.0)
        tolerance = (ct.c_bool(False), ct.c_double(0.0))
        return self.call("EnterInitializationMode", instance, *tolerance, ct.c_double(start), flag, end)

    def setup(self, instance: int | None, start: float = 0.0, stop: float | None = None) -> int:
        """fmi2SetupExperiment."""
        end = (int(stop is not None), ct.c_double(stop or 0.0))
        return self.call("SetupExperiment", instance, 0, ct.c_double(0.0), ct.c_double(start), *end)

    def leave(self, instance: int | None) -> int:
        """End the initialisation."""
        return self.call("ExitInitializationMode", instance)

    def start(self, instance: int | None, start: float = 0.0) -> None:
        """Pass through the initialisation, with everything at its start value."""
        assert self.enter(instance, start) == OK, self.log
        assert self.leave(instance) == OK, self.log

    def step(self, instance: int | None, time: float, step: float) -> int:
        if self.fmi == 2:
            return self.call("DoStep", instance, ct.c_double(time), ct.c_double(step), 1)
        flags = [ct.c_bool() for _ in range(3)]
        last = ct.c_double()
        places = (*(ct.byref(flag) for flag in flags), ct.byref(last))
        return self.call("DoStep", instance, ct.c_double(time), ct.c_double(step), ct.c_bool(True), *places)

    def array(self, kind: str, values: Sequence[float]) -> Any:
        block = kind != "real"
        return (C_TYPES[self.fmi][kind] * len(values))(*(int(x) if block else x for x in values))

    def set(self, instance: int | None, kind: str, references: Sequence[int], values: Sequence[float]) -> int:
        return self._access("Set", instance, kind, references, self.array(kind, values))

    def get(self, instance: int | None, kind: str, references: Sequence[int], count: int) -> tuple[int, list[float]]:
        values = self.array(kind, [0.0] * count)
        status = self._access("Get", instance, kind, references, values)
        return status, [float(x) for x in values]

    def _access(self, verb: str, instance: int | None, kind: str, references: Sequence[int], values: Any) -> int:
        arguments = (ct.c_uint * len(references))(*references)
        counts = [ct.c_size_t(len(values))] if self.fmi == 3 else []
        name = f"{verb}{ACCESS[self.fmi][kind]}"
        return self.call(name, instance, arguments, ct.c_size_t(len(references)), values, *counts)

    @property
    def state_word(self) -> str:
        """Spelling of a state in this version."""
        return "FMUstate" if self.fmi == 2 else "FMUState"

    def save(self, instance: int | None) -> ct.c_void_p:
        """Return a saved state."""
        state = ct.c_void_p()
        assert self.call(f"Get{self.state_word}", instance, ct.byref(state)) == OK, self.log
        return state

    def serialise(self, instance: int | None, state: ct.c_void_p) -> bytes:
        size = ct.c_size_t()
        assert self.call(f"Serialized{self.state_word}Size", instance, state, ct.byref(size)) == OK
        block = ct.create_string_buffer(size.value)
        assert self.call(f"Serialize{self.state_word}", instance, state, block, size) == OK
        return block.raw

    def deserialise(self, instance: int | None, block: bytes) -> tuple[int, ct.c_void_p]:
        state = ct.c_void_p()
        name = f"DeSerialize{self.state_word}" if self.fmi == 2 else f"Deserialize{self.state_word}"
        status = self.call(name, instance, block, ct.c_size_t(len(block)), ct.byref(state))
        return status, state

    def restore(self, instance: int | None, state: ct.c_void_p) -> int:
        return self.call(f"Set{self.state_word}", instance, state)

    def discard(self, instance: int | None, state: ct.c_void_p) -> int:
        return self.call(f"Free{self.state_word}", instance, ct.byref(state))
