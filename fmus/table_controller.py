"""TableController: turns the table so that the computed attitude stays what it was at the start."""

from ..models import table_controller
from .component import Component, Variable

TABLE_CONTROLLER = Component(
    name="TableController",
    description="Controller of a two-axis table: feeds the computed attitude back to the commands of both axes",
    variables=(
        Variable(
            "attitude",
            "computed attitude quaternion of the block, scalar first, body to reference",
            "input",
            4,
            start=(1.0, 0.0, 0.0, 0.0),
            minimum=-1.001,
            maximum=1.001,
        ),
        Variable("inner_angle", "angle of the inner axis", "input", unit="rad", display_unit="deg"),
        Variable(
            "initial_attitude",
            "attitude quaternion that is to be held",
            "parameter",
            4,
            start=(1.0, 0.0, 0.0, 0.0),
            variability="fixed",
            minimum=-1.001,
            maximum=1.001,
        ),
        Variable(
            "gain",
            "k: an error of the attitude is turned back at the rate k times the error",
            "parameter",
            unit="Hz",
            start=1.0,
            variability="fixed",
        ),
        Variable(
            "initial_command",
            "commands before the first step",
            "parameter",
            2,
            "rad",
            "deg",
            variability="fixed",
        ),
        Variable(
            "command",
            "commanded angles of the outer (1) and the inner axis (2)",
            "output",
            2,
            "rad",
            "deg",
            variability="discrete",
        ),
        Variable("held", "commands so far", size=2),
    ),
    initialise=table_controller.initialise,
    step=table_controller.step,
    respond=None,
    messages=(
        "initial_attitude is not a unit quaternion (norm within 1e-3 of 1)",
        "attitude is zero or not finite",
    ),
    equations=(
        "e = 2 vec(λ̄₀ ∘ λ) / |λ|, the error in body axes; o = (cos β, −sin β, 0), the outer axis in them",
        "command_outer ← command_outer − k h e·o, command_inner ← command_inner − k h e₃ in each step of length h",
    ),
    source="integral control; the frames are those of the two-axis table",
    step_size=0.01,
    stop_time=60.0,
)
