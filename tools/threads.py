"""One thread for the linear algebra of a call from Python: matrices are small here, threads only wait for each other.

How sums are rounded does not depend on the number of processors then, either. The command line says it before anything
is imported; a script may have imported NumPy long before, so the library itself is told.
"""

import ctypes
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import cache
from itertools import product
from pathlib import Path
from threading import Lock

import numpy as np

_LOCK, _BEFORE = Lock(), list[list[int]]()
PREFIXES, SUFFIXES = ("scipy_openblas", "openblas"), ("64_", "")


@contextmanager
def one_thread() -> Iterator[None]:
    """Give OpenBLAS one thread, as NumPy and SciPy bring it with them; what else there may be stays as it is.

    Of calls side by side the last one gives back the numbers that the first one found.
    """
    with _LOCK:
        _BEFORE.append([get() for get, _ in _libraries()])
        for _, set_to in _libraries():
            set_to(1)
    try:
        yield
    finally:
        with _LOCK:
            # What stands first was found when no call was inside, whichever ends last.
            counts = _BEFORE.pop()
            if not _BEFORE:
                for (_, set_to), count in zip(_libraries(), counts, strict=True):
                    set_to(count)


@cache
def _libraries() -> list[tuple[Callable[[], int], Callable[[int], None]]]:
    """What says and sets the number of threads of each OpenBLAS beside the packages."""
    packages = Path(np.__file__).parent.parent
    paths = []
    for folder in ("numpy.libs", "numpy/.dylibs", "scipy.libs", "scipy/.dylibs"):
        paths.extend((packages / folder).glob("*openblas*"))
    calls = []
    for path in sorted(paths):
        try:
            library = ctypes.CDLL(str(path))
        except OSError:
            continue
        for prefix, suffix in product(PREFIXES, SUFFIXES):
            get = getattr(library, f"{prefix}_get_num_threads{suffix}", None)
            set_to = getattr(library, f"{prefix}_set_num_threads{suffix}", None)
            if get is not None and set_to is not None:
                calls.append((get, set_to))
                break
    return calls
