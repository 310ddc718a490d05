"""How a result shows itself: what stands above all results says so here, and results know nothing of it."""

from collections.abc import Callable
from typing import Any

shown: Callable[[Any, str], str] | None = None
"""(result, "text" or "notebook") -> what a person sees; set by `trihedron`."""
