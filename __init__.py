"""Trihedron: FMI co-simulation components for inertial instruments.

``import trihedron as th``, then ``th.simulate``, ``th.plan``, ``th.calibrate``, ``th.diagnose``, ``th.export``, ...:
see ``dir(th)``. Nothing is imported before it is used. Frames and symbols stand in `trihedron.models`.
"""

from typing import Any

from . import tools

_TYPES = {
    "Check": "check",
    "Exported": "exporting",
    "Imported": "foreign",
    "InputError": "errors",
    "Installation": "installation",
    "Simulation": "orchestrator",
}
_FUNCTIONS = {
    "library": ("doctor", "export", "hide", "new", "plan", "plan_positions", "run_campaign", "simulate"),
    "measured": (
        *("apply", "attitude_of_record", "calibrate", "calibrate_together", "check"),
        *("diagnose", "diagnose_together", "import_record", "inspect", "read_record"),
    ),
}
_HOME = _TYPES | dict(sorted((name, module) for module, names in _FUNCTIONS.items() for name in names))
"""In which module of the tools each name is; the stub beside this file says the same to those who check types."""
__all__ = [*_HOME, "__version__"]  # pyright: ignore[reportUnsupportedDunderAll]


def __getattr__(name: str) -> Any:
    """What is asked for, imported when it is."""
    if name == "__version__":
        from importlib.metadata import version

        return version("trihedron")
    if name in _HOME:
        from importlib import import_module

        return getattr(import_module(f"trihedron.tools.{_HOME[name]}"), name)
    raise AttributeError(f"module 'trihedron' has no attribute '{name}'")


def __dir__() -> list[str]:
    return [*__all__, *(name for name in globals() if name.startswith("__"))]


def _shown(result: Any, medium: str) -> str | None:
    """What a person sees of a result: text, or the page of a notebook; None of a part of one, which has its fields."""
    from .tools.document.blocks import notebook, text
    from .tools.reports import MAKERS, document_of

    if type(result).__name__ not in MAKERS:
        return None
    return (text if medium == "text" else notebook)(document_of(result))


tools.shown = _shown
