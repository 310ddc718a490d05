"""The types of FMI's getters and setters: what a value takes in memory."""

import ctypes
from dataclasses import dataclass
from typing import Any

import numpy as np


@dataclass(frozen=True)
class ValueType:
    """A type as `fmi2Get...` and `fmi3Get...` name it.

    Attributes
    ----------
    kind : str
        what it stands for: Real, Integer, Boolean or String
    dtype : type
        of an array of such values; a String is the address of its bytes
    code : int
        how `trihedron.tools.orchestrator.operations` names it
    c_type : type
        ctypes' name of it
    """

    kind: str
    dtype: Any
    code: int
    c_type: Any

    @property
    def whole_span(self) -> tuple[int, int]:
        """The least and the greatest whole number."""
        info = np.iinfo(self.dtype)
        return int(info.min), int(info.max)


_INT32 = ValueType("Integer", np.int32, 6, ctypes.c_int32)
VALUE_TYPES = {
    "Real": ValueType("Real", np.float64, 0, ctypes.c_double),
    "Integer": _INT32,
    "Boolean2": ValueType("Boolean", np.int32, 6, ctypes.c_int32),
    "Float64": ValueType("Real", np.float64, 0, ctypes.c_double),
    "Float32": ValueType("Real", np.float32, 1, ctypes.c_float),
    "Int8": ValueType("Integer", np.int8, 2, ctypes.c_int8),
    "UInt8": ValueType("Integer", np.uint8, 3, ctypes.c_uint8),
    "Int16": ValueType("Integer", np.int16, 4, ctypes.c_int16),
    "UInt16": ValueType("Integer", np.uint16, 5, ctypes.c_uint16),
    "Int32": _INT32,
    "UInt32": ValueType("Integer", np.uint32, 7, ctypes.c_uint32),
    "Int64": ValueType("Integer", np.int64, 8, ctypes.c_int64),
    "UInt64": ValueType("Integer", np.uint64, 9, ctypes.c_uint64),
    "Boolean": ValueType("Boolean", np.uint8, 3, ctypes.c_uint8),
    # An FMU may reuse the memory of its strings at the next call: they come last.
    "String": ValueType("String", np.uintp, 9, ctypes.c_size_t),
}
"""Every type by its name; FMI 2.0's Boolean, which is an int, is Boolean2."""
