"""Files checked before they are used: everything that is wrong at once, with lines."""

from .files import check
from .findings import Check, Problem

__all__ = ["Check", "Problem", "check"]
