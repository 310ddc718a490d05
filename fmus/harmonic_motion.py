"""HarmonicMotion: a body whose Euler-Krylov angles are sums of harmonics."""

import math

from ..models import harmonic_motion
from ..models.harmonic_motion import HARMONICS
from .component import Component, Variable
from .units import STANDARD_GRAVITY


def _harmonics(name: str, letter: str, amplitude: float, frequency: float) -> tuple[Variable, ...]:
    """Parameters of one angle; its first harmonic is given, the others are zero."""
    rest = (0.0,) * (HARMONICS - 1)
    return (
        Variable(
            f"{name}_amplitude",
            f"amplitudes of the harmonics of {letter}",
            "parameter",
            HARMONICS,
            "rad",
            "deg",
            start=(amplitude, *rest),
            variability="fixed",
        ),
        Variable(
            f"{name}_frequency",
            f"frequencies of the harmonics of {letter}",
            "parameter",
            HARMONICS,
            "Hz",
            start=(frequency, *rest),
            variability="fixed",
        ),
        Variable(
            f"{name}_phase",
            f"phases of the harmonics of {letter} at time 0",
            "parameter",
            HARMONICS,
            "rad",
            "deg",
            variability="fixed",
        ),
    )


HARMONIC_MOTION = Component(
    name="HarmonicMotion",
    description="Angular motion with harmonic Euler-Krylov angles: increments, specific force and true attitude",
    variables=(
        *_harmonics("psi", "ψ (about the second axis)", math.radians(15.0), 1.0),
        *_harmonics("theta", "ϑ (then about the third axis)", math.radians(5.0), 0.5),
        *_harmonics("gamma", "γ (then about the first axis)", math.radians(15.0), 1.0),
        Variable(
            "pi",
            "value of π in 2π f t; the paper's program must have had 3.141592",
            "parameter",
            start=math.pi,
            variability="fixed",
            minimum=3.0,
            maximum=3.3,
        ),
        Variable(
            "trapezoid_nodes",
            "0: increments exact to rounding; M: trapezoid rule with M nodes over `step_samples` increments",
            "parameter",
            variability="fixed",
            type="integer",
            minimum=0.0,
            maximum=10001.0,
        ),
        Variable(
            "step_samples",
            "increments over which the nodes of the trapezoid rule are laid",
            "parameter",
            start=1.0,
            variability="fixed",
            type="integer",
            minimum=1.0,
            maximum=100.0,
        ),
        Variable(
            "gravity",
            "g: gravity, along the second axis of the reference",
            "parameter",
            unit="m/s2",
            start=STANDARD_GRAVITY,
            variability="fixed",
            minimum=0.0,
            maximum=100.0,
            nominal=10.0,
        ),
        Variable("angle", "Euler-Krylov angles ψ, ϑ, γ", "output", 3, "rad", "deg"),
        Variable("rate", "angular rate in body axes", "output", 3, "rad/s", "deg/s"),
        Variable(
            "increment",
            "integral of the angular rate over the last step",
            "output",
            3,
            "rad",
            "arcsec",
            variability="discrete",
        ),
        Variable("specific_force", "specific force in body axes", "output", 3, "m/s2", "g", nominal=10.0),
        Variable("attitude", "true attitude quaternion, scalar first, body to reference", "output", 4),
        Variable("last_step", "length of the last step", size=1),
        Variable("intervals", "intervals of the trapezoid rule in one increment; 0: exact", size=1),
        Variable("bandwidth", "bound of the circular frequencies in the rates", size=1),
        Variable("harmonics", "amplitude, circular frequency and phase of each harmonic", size=9 * HARMONICS),
        Variable("angle_rate", "rates of the angles", "work", 3),
        Variable("work", "a quaternion", "work", 4),
    ),
    initialise=harmonic_motion.initialise,
    step=harmonic_motion.step,
    respond=None,
    messages=(
        "trapezoid_nodes - 1 is not a multiple of step_samples: the intervals of one increment must be a whole number",
        "the step holds more than 1e6 rad of the motion's phase, or the motion is not finite",
    ),
    equations=(
        "ψ, ϑ, γ = Σ A sin(2π f t + φ)",
        "λ = q₂(ψ) ∘ q₃(ϑ) ∘ q₁(γ)",
        "ω = (γ̇ + ψ̇ sin ϑ, ψ̇ cos ϑ cos γ + ϑ̇ sin γ, ϑ̇ cos γ − ψ̇ cos ϑ sin γ), increment = ∫ ω dt over the step",
        "specific force = λ* ∘ (0, g, 0) ∘ λ",
    ),
    source="Chelnokov, Perelyaev, Chelnokova 2016, section 3",
    step_size=0.001,
    stop_time=600.0,
)
