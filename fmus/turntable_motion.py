"""TurntableMotion: the two-axis table."""

import math

from trihedron.fmus.component import Component, Variable, identity_matrix
from trihedron.fmus.units import STANDARD_GRAVITY
from trihedron.models import turntable
from trihedron.models.motion import AXIS_PLAN_SIZE
from trihedron.models.random_numbers import GENERATOR_SIZE
from trihedron.models.restricted import CONTEXT_SIZE

ARCSECOND = math.pi / 648000.0


def _angle(name: str, description: str) -> Variable:
    return Variable(
        name, description, "parameter", unit="rad", display_unit="arcsec", variability="fixed", minimum=-0.5, maximum=0.5
    )


TURNTABLE_MOTION = Component(
    name="TurntableMotion",
    description="Two-axis turntable: commanded positions, geometric errors, encoders, increments and specific force",
    variables=(
        Variable("command", "commanded encoder readings of the outer (1) and the inner axis (2)", "input", 2, "rad", "deg",
                 variability="discrete"),
        Variable("temperature", "temperature of the table", "input", unit="degC", start=20.0),
        _angle("kappa", "κ: dip of the outer axis below the horizon"),
        _angle("epsilon", "ε: lean of the inner axis towards the outer axis"),
        _angle("alpha_offset", "Δα: constant error of the outer encoder, reading less true angle"),
        _angle("beta_offset", "Δβ: constant error of the inner encoder"),
        _angle("alpha_star", "α*: lean of the inner axis across the outer axis"),
        Variable("gravity", "g: model value of gravity", "parameter", unit="m/s2", start=STANDARD_GRAVITY,
                 variability="fixed", minimum=1.0, maximum=100.0, nominal=10.0),
        Variable("gravity_error", "Δg/g: model value less true value of gravity, as a fraction", "parameter",
                 variability="fixed", minimum=-0.5, maximum=0.5),
        Variable("encoder_fluctuation_bound", "bound of the encoder error that differs from rest to rest", "parameter",
                 unit="rad", display_unit="arcsec", start=ARCSECOND, variability="fixed", minimum=0.0, maximum=0.1),
        Variable("mounting", "Q, row by row: block axes from inner-frame axes", "parameter", 9,
                 start=identity_matrix(), variability="fixed", minimum=-1.0, maximum=1.0),
        Variable("mounting_error", "ϑ: rotation vector of the mounting error, in block axes", "parameter", 3, "rad",
                 "arcsec", variability="fixed", minimum=-0.5, maximum=0.5),
        Variable("max_rate", "limit of the rate of each axis", "parameter", 2, "rad/s", "deg/s",
                 start=math.radians(60.0), variability="fixed", minimum=1e-9),
        Variable("max_acceleration", "limit of the angular acceleration of each axis", "parameter", 2, "rad/s2",
                 "deg/s2", start=math.radians(60.0), variability="fixed", minimum=1e-9),
        Variable("initial_angle", "encoder readings at the start", "parameter", 2, "rad", "deg", variability="fixed"),
        Variable("earth_rotation", "whether the Earth turns", "parameter", start=1.0, variability="fixed",
                 type="boolean"),
        Variable("latitude", "geographic latitude", "parameter", unit="rad", display_unit="deg",
                 start=math.radians(55.75), variability="fixed", minimum=-math.pi / 2, maximum=math.pi / 2),
        Variable("azimuth", "azimuth of the outer axis, from north towards east", "parameter", unit="rad",
                 display_unit="deg", variability="fixed", minimum=-2 * math.pi, maximum=2 * math.pi),
        Variable("seed", "seed of the encoders' fluctuation", "parameter", start=1.0, variability="fixed",
                 type="integer", minimum=0.0, maximum=2147483647.0),
        Variable("angle", "true angles: encoder readings less Δα + α* (outer) and Δβ (inner)", "output", 2, "rad",
                 "deg"),
        Variable("angle_reading", "readings of the encoders, with their errors", "output", 2, "rad", "deg"),
        Variable("rate", "rates of the axes", "output", 2, "rad/s", "deg/s"),
        Variable("increment", "integral of the block's angular rate against inertial space over the last step",
                 "output", 3, "rad", "arcsec", variability="discrete"),
        Variable("specific_force", "true specific force in block axes", "output", 3, "m/s2", "g", nominal=10.0),
        Variable("attitude", "attitude quaternion of the block against the base, scalar first", "output", 4),
        Variable("attitude_inertial",
                 "attitude quaternion of the block against the inertial frame that was the base's at the start",
                 "output", 4),
        Variable("dwell", "number of rests begun", "output", variability="discrete", type="integer"),
        Variable("at_rest", "whether both axes rest", "output", variability="discrete", type="boolean"),
        Variable("start", "time of the start"),
        Variable("last_step", "length of the last step"),
        Variable("plan", "plans of both axes", size=2 * AXIS_PLAN_SIZE),
        Variable("mounting_attitude", "attitude of the block against the inner frame", size=4),
        Variable("earth_rate_in_base", "rotation of the Earth in base axes", size=3),
        Variable("generator", "state of the random numbers", size=GENERATOR_SIZE),
        Variable("fluctuation", "the encoders' fluctuation as a fraction of its bound", size=2),
        Variable("senses", "senses of the last moves", size=2),
        Variable("motion", "angles and rates of the moves", size=4),
        Variable("times", "ends of phases", "work", 10),
        Variable("vector", "a vector", "work", 3),
        Variable("work", "a quaternion", "work", 4),
        Variable("context", "the circumstances that effects read", "work", CONTEXT_SIZE),
        Variable("added", "what effects add", "work", 2),
    ),
    initialise=turntable.initialise,
    step=turntable.step,
    respond=None,
    messages=(
        "mounting is not a proper orthogonal matrix (rows orthonormal to 1e-6, determinant +1)",
        "max_rate and max_acceleration must be positive",
        "command is not a finite angle",
    ),
    equations=(
        "C = exp(ϑ̂) Q R₃(β) R₂(ε) R₁(α) R₂(κ), with α = reading − Δα − α*, β = reading − Δβ",
        "specific force = C (0, 0, g − Δg)",
        "increment = ∫ exp(ϑ̂) Q (β̇ e₃ + R₃(β) R₂(ε) e₁ α̇) + C Ω dt over the step",
    ),
    source="Golovan, Matasov, Tarygin 2022, section 1",
    step_size=0.01,
    stop_time=60.0,
)
