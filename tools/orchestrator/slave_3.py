"""One running FMU of FMI 3.0."""

import ctypes
from collections.abc import Iterable
from typing import Any

import numpy as np
from fmpy import fmi3

from ..errors import InputError
from .archive import UnpackedFmu
from .interface import Interface, Value, Variable
from .slave import LISTENING, Slave


def _listen(environment: int | None, status: int, _category: bytes, text: bytes | None) -> None:
    """Give a message to the instance that it comes from."""
    message = " ".join((text or b"").decode("utf-8", "replace").split())
    slave = LISTENING.get(environment or 0)
    for instance in [slave] if slave else list(LISTENING.values()):
        instance.hear(status, message)


_LOGGER = fmi3.fmi3LogMessageCallback(_listen)
_NO_UPDATE = fmi3.fmi3IntermediateUpdateCallback()


class Slave3(Slave):
    """An instance of an FMU of FMI 3.0."""

    prefix = "fmi3"
    set_state, get_state, free_state = "fmi3SetFMUState", "fmi3GetFMUState", "fmi3FreeFMUState"

    def _loaded(self, fmu: UnpackedFmu) -> Any:
        assert fmu.description.coSimulation is not None
        return fmi3.FMU3Slave(
            instanceName=self.name,
            guid=fmu.description.instantiationToken,
            modelIdentifier=fmu.description.coSimulation.modelIdentifier,
            unzipDirectory=str(fmu.folder),
        )

    def _instantiate(self, fmu: UnpackedFmu) -> None:
        resources = f"{fmu.folder / 'resources'}/" if (fmu.folder / "resources").is_dir() else None
        self._fmu.component = self._fmu.fmi3InstantiateCoSimulation(
            self.name.encode(),
            str(fmu.description.instantiationToken).encode(),
            None if resources is None else resources.encode(),
            False,
            True,
            False,
            False,
            (fmi3.fmi3ValueReference * 0)(),
            0,
            id(self),
            _LOGGER,
            _NO_UPDATE,
        )
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
        if variable.kind == "String":
            memory = (ctypes.c_char_p * len(values))(*(str(value).encode() for value in values))
            place = ctypes.addressof(memory)
        else:
            memory = np.array(values, dtype=variable.value_type.dtype)
            place = memory.ctypes.data
        name = self.accessor("Set", variable.access)
        reference = ctypes.c_uint(variable.reference)
        words = (ctypes.c_void_p, ctypes.c_void_p, ctypes.c_size_t, ctypes.c_void_p, ctypes.c_size_t)
        function = ctypes.CFUNCTYPE(ctypes.c_int, *words)(self.address(name))
        status = function(self.component, ctypes.addressof(reference), 1, place, len(values))
        if status > 1:
            self.fail(name, status, None)

    def begin(self, start: float, stop: float) -> None:
        """Enter initialisation with the times of the run."""
        self.call("fmi3EnterInitializationMode", False, 0.0, start, True, stop)
