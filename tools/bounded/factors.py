"""Triangles of QR decompositions, by scipy's compiled LAPACK.

All of `scipy.linalg` takes longer to load than a small calibration to compute, so its file alone is loaded.
"""

import sys
from functools import cache
from importlib import import_module
from importlib.machinery import EXTENSION_SUFFIXES
from importlib.util import module_from_spec, spec_from_file_location
from pathlib import Path
from typing import Any

import numpy as np
import scipy
from numpy.typing import NDArray

from ...models.arrays import Floats

_NAME = "_flapack"


@cache
def _lapack() -> Any:
    """Return the routines of LAPACK; those of scipy's public module where it is loaded or has no such file."""
    places = [Path(scipy.__file__).parent / "linalg" / f"{_NAME}{suffix}" for suffix in EXTENSION_SUFFIXES]
    for place in places if "scipy.linalg" not in sys.modules else ():
        spec = spec_from_file_location(f"scipy.linalg.{_NAME}", place) if place.is_file() else None
        if spec is not None and spec.loader is not None:
            routines = module_from_spec(spec)
            spec.loader.exec_module(routines)
            return routines
    return import_module("scipy.linalg.lapack")


def _factored(routine: Any, matrix: NDArray) -> Any:
    matrix = np.asarray_chkfinite(matrix)
    return routine(matrix, lwork=int(routine(matrix, lwork=-1)[-2][0]))


def triangle(matrix: NDArray) -> Floats:
    """Return R (M, n) of the QR decomposition of a matrix (M, n)."""
    if not matrix.size:
        return np.zeros(matrix.shape)
    return np.triu(_factored(_lapack().dgeqrf, matrix)[0])


def pivoted(matrix: NDArray) -> tuple[Floats, NDArray[np.int64]]:
    """Return the diagonal of R, as sizes, and the order of the columns in a QR decomposition with pivoting."""
    if not matrix.size:
        # LAPACK takes no empty matrix.
        return np.zeros(0), np.arange(matrix.shape[1])
    decomposition = _factored(_lapack().dgeqp3, matrix)
    return np.abs(np.diag(decomposition[0])), decomposition[1].astype(np.int64) - 1
