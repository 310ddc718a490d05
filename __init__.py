"""Trihedron: FMI co-simulation components for inertial instruments.

``import trihedron as th``, then ``th.simulate``, ``th.plan``, ``th.calibrate``, ``th.diagnose``, ``th.export``, ...:
see ``dir(th)``. Nothing is imported before it is used. Frames and symbols stand in `trihedron.models`.
"""

import sys
from functools import cache
from typing import Any

from . import tools
from .version import VERSION

__version__ = VERSION
_TYPES = {
    "Check": "check",
    "Exported": "exporting",
    "Imported": "foreign",
    "InputError": "errors",
    "Installation": "installation",
    "Simulation": "orchestrator",
}
_FUNCTIONS = {
    "batch": ("batch",),
    "corrections": ("apply", "correction", "export_calibration"),
    "library": (
        "campaign_report",
        "compare",
        "doctor",
        "export",
        "export_notebook",
        "export_ssp",
        "hide",
        "new",
        "plot",
        "run_campaign",
        "simulate",
    ),
    "measured": (
        *("attitude_of_record", "bench_at", "calibrate", "check", "diagnose"),
        *("calibrate_together", "diagnose_together", "import_record", "inspect", "noise"),
    ),
    "planning.library": ("plan", "plan_check", "plan_hand", "plan_imu", "plan_positions"),
    "records": ("read_record",),
    "workbench": ("measure",),
}
_COMMANDS = {
    "attitude": ("measured", "attitude_of_record"),
    "campaign": ("library", "run_campaign"),
    "demo": ("demo", "run_demo"),
    "fmpy_input": ("exporting", "write_fmpy_input"),
    "hidden": ("library", "hide"),
    "instrument_add": ("instrument", "add_to_instrument"),
    "instrument_list": ("instrument", "entries_of"),
    "instrument_show": ("instrument", "nearest_of_instrument"),
    "instrument_trend": ("instrument", "trend_of_instrument"),
    "open": ("workbench", "open_records"),
    "plan_target": ("planning.library", "plan"),
    "reproduce_attitude": ("papers", "reproduce_attitude"),
    "reproduce_calibration": ("papers", "check_published_calibration"),
    "reproduce_word_length": ("papers", "word_length_errors"),
}
"""Functions by the names of their commands, each with its module and its name there."""
_HOME = _TYPES | dict(sorted((name, module) for module, names in _FUNCTIONS.items() for name in names))
"""In which module of the tools each name is; the stub beside this file says the same to those who check types."""
_NAMES = [*_HOME, *_COMMANDS, "__version__"]
# `from trihedron import *` leaves Python's own `open` in its place.
__all__ = [name for name in _NAMES if name != "open"]  # pyright: ignore[reportUnsupportedDunderAll]


def __getattr__(name: str) -> Any:
    """Import an attribute when it is first used."""
    if name in _NAMES:
        from importlib import import_module

        module, member = _COMMANDS.get(name) or (_HOME[name], name)
        defined = getattr(import_module(f"trihedron.tools.{module}"), member)
        return defined if name in _TYPES else _in_python(defined, name)
    raise AttributeError(f"module 'trihedron' has no attribute '{name}'", name=name, obj=sys.modules[__name__])


@cache
def _in_python(function: Any, name: str) -> Any:
    """Return a function that checks its arguments."""
    from .tools.arguments import in_python

    return in_python(function, name)


def __dir__() -> list[str]:
    return [*__all__, *(name for name in globals() if name.startswith("__"))]


def _shown(result: Any, medium: str, *options: Any) -> Any:
    """Show a result to a person: see `tools.shown`."""
    from .tools import reports

    return reports.shown(result, medium, *options)


tools.shown = _shown
