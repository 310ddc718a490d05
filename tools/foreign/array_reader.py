"""List or write the arrays of a MATLAB, HDF5 or NumPy file, as a programme: a library may crash on a damaged file.

`FILE` lists the arrays as JSON: name, shape, unit, and the number of an array of one. `FILE NAME ...` writes arrays in
NumPy's format, one after the other. Status 3 comes with a reason as the last line. Only libraries are imported.
"""

import io
import json
import sys
from collections.abc import Callable, Iterator, Mapping
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

LARGEST = 4 << 30
"""Largest array that is listed, and largest content of a MATLAB file [bytes]."""
HDF5, NUMPY = b"\x89HDF\r\n\x1a\n", b"\x93NUMPY"
UNNAMED = "column"
"""Name of the columns of an array that has no name."""
Entry = tuple[str, tuple[int, ...], str, Callable[[], NDArray[Any]]]
"""Name of an array of numbers, its shape, its unit, and how it is read."""


def hdf5_arrays(file: Any) -> list[Entry]:
    """Return the arrays of an open HDF5 file, and the columns of its tables, without links to other files."""
    entries = list[Entry]()

    def visit(name: str, item: Any) -> None:
        for key, value in item.attrs.items():
            number = np.asarray(value)
            if number.size == 1:
                add(f"{name}/{key}".lstrip("/"), number.shape, number.dtype, "", lambda number=number: number)
        is_array = hasattr(item, "dtype") and item.shape is not None and not item.is_virtual and not item.external
        # MATLAB keeps the targets of references in #refs#
        if not is_array or name.startswith("#") or item.size * item.dtype.itemsize > LARGEST:
            return
        stated = {key.lower(): value for key, value in item.attrs.items()}
        unit = stated.get("units", stated.get("unit", ""))
        text = unit.decode("utf-8", "replace") if isinstance(unit, bytes) else str(unit)
        if item.dtype.names is None:
            add(name, item.shape, item.dtype, text, lambda: item[()])
        for column in item.dtype.names or ():
            add(f"{name}/{column}", item.shape, item.dtype[column], text, lambda column=column: item[column])

    def add(name: str, shape: Any, kind: Any, unit: str, load: Callable[[], NDArray[Any]]) -> None:
        if kind.base.kind in "iufb":
            entries.append((name, (*shape, *kind.shape), unit, load))

    visit("", file)
    file.visititems(visit)
    return entries


def matlab_arrays(path: str) -> list[Entry]:
    """Return the arrays of a MATLAB file up to version 7, with the fields of its structures.

    Raises ValueError if the file is too large, or holds nothing but objects.
    """
    matlab = import_module("scipy.io")
    size = sum(8.0 * np.prod([float(side) for side in shape]) for _, shape, _ in matlab.whosmat(path))
    if size > LARGEST:
        raise ValueError(f"it unpacks to more than {LARGEST} bytes")
    content = matlab.loadmat(path, squeeze_me=True)
    entries = list(_of_values(content))
    opaque = [name for name, value in content.items() if type(value).__name__ in ("MatlabOpaque", "MatlabFunction")]
    opaque += ["a table or object"] * ("__function_workspace__" in content)
    if opaque and not entries:
        what = f"{opaque[0]} is an object, which only MATLAB reads"
        raise ValueError(f"{what}; save its columns as arrays, for instance table2struct(T,'ToScalar',true)")
    return entries


def _of_values(values: Mapping[str, Any], folder: str = "") -> Iterator[Entry]:
    """Yield the arrays of numbers among the values of a file or structure, and the columns of tables."""
    for name, value in values.items():
        array = np.asarray(value)
        if name.startswith("__") or type(value).__name__ in ("MatlabOpaque", "MatlabFunction"):
            continue
        if array.dtype.names:
            inside = array.reshape(-1)[0] if array.size == 1 else array
            yield from _of_values({field: inside[field] for field in array.dtype.names}, f"{folder}{name}/".lstrip("/"))
        elif array.dtype.kind in "iufb":
            yield f"{folder}{name}", array.shape, "", lambda array=array: array


def written(entries: list[Entry], names: list[str]) -> bytes:
    """Return the list of arrays as JSON, or the arrays of some names in NumPy's format."""
    if not names:
        listed = []
        for name, shape, unit, load in entries:
            number = float(load().reshape(-1)[0]) if np.prod(shape) == 1 else None
            listed.append([name, shape, unit, number])
        return json.dumps(listed).encode()
    output = io.BytesIO()
    load_of = {name: load for name, _, _, load in entries}
    for name in names:
        np.save(output, load_of[name](), allow_pickle=False)
    return output.getvalue()


def main(path: str, *names: str) -> None:
    """Write the list or the arrays to the output; end with status 3 and a reason if the file cannot be read."""
    try:
        with Path(path).open("rb") as opened:
            begin = opened.read(1024)
        if HDF5 in begin:
            with import_module("h5py").File(path, "r") as file:
                output = written(hdf5_arrays(file), list(names))
        elif path.endswith((".npy", ".npz")) or begin.startswith(NUMPY):
            content = np.load(path, allow_pickle=False)
            if isinstance(content, np.ndarray):
                content = {"" if content.dtype.names else UNNAMED: content}
            output = written(list(_of_values(content)), list(names))
        else:
            output = written(matlab_arrays(path), list(names))
    except Exception as error:
        sys.stdout.write(" ".join((str(error) or type(error).__name__).split())[:200] + "\n")
        sys.exit(3)
    sys.stdout.buffer.write(output)


if __name__ == "__main__":
    main(*sys.argv[1:])
