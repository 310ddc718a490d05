"""What a person runs."""

from collections.abc import Callable
from typing import Any

shown: Callable[[Any, str], str | None] | None = None
"""(result, "text" or "notebook") -> what a person sees of it, None of a part that has no document of its own; set by
`trihedron`, as results know nothing of it."""
