"""Files checked before they are used: everything that is wrong at once, with lines."""

from trihedron.checking.files import check
from trihedron.checking.result import Check, Problem

__all__ = ["Check", "Problem", "check"]
