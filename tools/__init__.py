"""What a person runs."""

from collections.abc import Callable
from typing import Any

shown: Callable[[Any, str], str] | None = None
"""(result, "text" or "notebook") -> what a person sees of it; set by `trihedron`, as results know nothing of it."""
