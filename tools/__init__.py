"""Code behind the commands and the Python functions that a person runs."""

from collections.abc import Callable
from typing import Any

shown: Callable[..., Any] | None = None
"""(result, "text" or "notebook") -> what a person sees of it, None of a part of one that has no document of its own;
(result, "page", path, record) writes its page, (result, "figures", record) gives the pictures on it by their names,
(result, "sheet", path, record, about) writes the sheet of a calibration;
set by `trihedron`, as results know nothing of it."""
