"""HarmonicMotion: a body whose Euler-Krylov angles are sums of harmonics."""

import math

from ..models import harmonic_motion
from ..models.harmonic_motion import HARMONICS
from .component import Component, Variable, fixed, output, state, work
from .units import STANDARD_GRAVITY


def _harmonics(name: str, letter: str, amplitude: float, frequency: float) -> tuple[Variable, ...]:
    """Parameters of one angle; its first harmonic is given, the others are zero."""
    rest = (0.0,) * (HARMONICS - 1)
    return (
        fixed(
            f"{name}_amplitude",
            f"amplitudes of the harmonics of {letter}",
            HARMONICS,
            "rad",
            "deg",
            start=(amplitude, *rest),
        ),
        fixed(
            f"{name}_frequency", f"frequencies of the harmonics of {letter}", HARMONICS, "Hz", start=(frequency, *rest)
        ),
        fixed(f"{name}_phase", f"phases of the harmonics of {letter} at time 0", HARMONICS, "rad", "deg"),
    )


HARMONIC_MOTION = Component(
    name="HarmonicMotion",
    description="Angular motion with harmonic Euler-Krylov angles: increments, specific force and true attitude",
    variables=(
        *_harmonics("psi", "ψ (about the second axis)", math.radians(15.0), 1.0),
        *_harmonics("theta", "ϑ (then about the third axis)", math.radians(5.0), 0.5),
        *_harmonics("gamma", "γ (then about the first axis)", math.radians(15.0), 1.0),
        fixed(
            "pi", "value of π in 2π f t; the paper's program must have had 3.141592", start=math.pi, within=(3.0, 3.3)
        ),
        fixed(
            "trapezoid_nodes",
            "0: increments exact to rounding; M: trapezoid rule with M nodes over `step_samples` increments",
            type="integer",
            within=(0.0, 10001.0),
        ),
        fixed(
            "step_samples",
            "increments over which the nodes of the trapezoid rule are laid",
            start=1.0,
            type="integer",
            within=(1.0, 100.0),
        ),
        fixed(
            "gravity",
            "g: gravity, along the second axis of the reference",
            unit="m/s2",
            start=STANDARD_GRAVITY,
            within=(0.0, 100.0),
            nominal=10.0,
        ),
        output("angle", "Euler-Krylov angles ψ, ϑ, γ", 3, "rad", "deg"),
        output("rate", "angular rate in body axes", 3, "rad/s", "deg/s"),
        output(
            "increment", "integral of the angular rate over the last step", 3, "rad", "arcsec", variability="discrete"
        ),
        output("specific_force", "specific force in body axes", 3, "m/s2", "g", nominal=10.0),
        output("attitude", "true attitude quaternion, scalar first, body to reference", 4),
        state("last_step", "length of the last step", 1),
        state("intervals", "intervals of the trapezoid rule in one increment; 0: exact", 1),
        state("bandwidth", "bound of the circular frequencies in the rates", 1),
        state("harmonics", "amplitude, circular frequency and phase of each harmonic", 9 * HARMONICS),
        work("angle_rate", "rates of the angles", 3),
        work("work", "a quaternion", 4),
    ),
    model=(harmonic_motion.initialise, harmonic_motion.step),
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
