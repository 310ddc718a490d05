"""Trihedron: FMI co-simulation components for inertial instruments.

Notation used throughout
------------------------
Names are the field's terms; a docstring gives the paper's symbol. Everything inside is SI and radians; degrees
stand only in names that say so (``alpha_deg``). Frames:

base
    axis 1 along the horizontal projection of the table's outer axis, axis 3 up, right-handed.
inner
    fixed to the table's inner frame, axis 3 along the inner axis.
block
    the instrument frame of the accelerometer block: inner frame turned by the mounting Q and the mounting error θ.

A matrix ``r_ab`` takes components in frame b to components in frame a. A quaternion is scalar first and takes body
components to the reference. ``alpha`` is the angle of the outer axis, ``beta`` of the inner axis. Specific force
points up at rest: a level block reads (0, 0, +g).

Packages import one way: ``trihedron.models`` (physics) <- ``trihedron.fmus`` (components) <- ``trihedron`` (tools).

In a notebook: ``import trihedron as th``, then ``th.simulate``, ``th.plan``, ``th.calibrate``, ``th.diagnose``,
``th.export``, ...: see ``dir(th)``. Nothing is imported before it is used.
"""

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from trihedron.library import (
        Check,
        Exported,
        InputError,
        Installation,
        Simulation,
        apply,
        attitude_of_record,
        calibrate,
        check,
        diagnose,
        doctor,
        export,
        hide,
        inspect,
        new,
        plan,
        plan_positions,
        read_record,
        run_campaign,
        simulate,
    )

    __version__: str

__all__ = [
    "Check",
    "Exported",
    "InputError",
    "Installation",
    "Simulation",
    "__version__",
    "apply",
    "attitude_of_record",
    "calibrate",
    "check",
    "diagnose",
    "doctor",
    "export",
    "hide",
    "inspect",
    "new",
    "plan",
    "plan_positions",
    "read_record",
    "run_campaign",
    "simulate",
]


def __getattr__(name: str) -> Any:
    """What is asked for, imported when it is."""
    if name == "__version__":
        from importlib.metadata import version

        return version("trihedron")
    if name in __all__:
        from trihedron import library

        return getattr(library, name)
    raise AttributeError(f"module 'trihedron' has no attribute '{name}'")


def __dir__() -> list[str]:
    return [*__all__, *(name for name in globals() if name.startswith("__"))]
