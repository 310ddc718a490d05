"""Cases: a block with errors of a usual kind, a motion, and an effect of a size that the record must show."""

import math
from dataclasses import dataclass, replace
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from ...fmus.units import STANDARD_GRAVITY
from ...models.effects import CATALOGUE, POSITION_EFFECTS, STRAPDOWN_EFFECTS, EffectPlace
from ..bounded.programmes import chebyshev_radius
from ..errors import InputError, nearest
from ..evidence.carried import carried_evidence
from ..evidence.evidence import Evidence
from ..records import StrapdownRecord
from ..strapdown import inspect_record
from .measurement import FURTHEST_STAMP, Instruments, Secret, measure
from .motion import BEFORE_A_CAMERA, BETWEEN_RESTS, TrueMotion, draw_motion, without_coning
from .noise import Noise

Reference = Literal["gravity", "truth"]
BASELINE = {"gravity": "calibrated", "truth": "nominal"}
"""What a diagnosis takes for known, by the record's reference."""
RATES_HZ = (50.0, 100.0, 200.0)
TRIES = 40
"""So often another effect is drawn where one cannot be hidden."""
SIZES = (2.0, 3.0)
"""Sizes relative to that of sure detection."""
TAKEN_OUT = ("gyro-bias",)
"""The mean over the rests is taken out of every record before anything is judged: such a bias shows nowhere."""
UNSEEN_BETWEEN_RESTS = ("latency",)
"""A lag turns nothing from one rest to the next."""
UNDERSAMPLING = "undersampling"
"""Not of a component that reads: the increments lack what the body's turning between two rows adds to them."""
STAMPS = "jitter"
"""The effect of the time stamps; its size is how far they jitter, the sampling being regular."""


@dataclass(frozen=True, eq=False)
class StrapdownCase:
    """A record to be made, with its secret.

    Attributes
    ----------
    seed, index : int
    reference : "gravity" or "truth"
        what the record can be held against
    motion : TrueMotion
    instruments : Instruments
    temperature : (N + 1,) array or None
        [°C]
    secret : Secret or None
        None: a clean record
    size : float
        of what is hidden, relative to that of sure detection
    jitter : float
        of the time stamps, in periods
    redrawn : int
        effects that were drawn before and could not be hidden
    """

    seed: int
    index: int
    reference: Reference
    motion: TrueMotion
    instruments: Instruments
    temperature: NDArray[np.float64] | None
    secret: Secret | None = None
    size: float = 0.0
    jitter: float = 0.0
    redrawn: int = 0

    @property
    def places(self) -> tuple[EffectPlace, ...]:
        """What is hidden."""
        return () if self.secret is None else (self.secret.place,)

    def record(self) -> StrapdownRecord:
        """What a laboratory would hand over."""
        # Rates know nothing of the time stamps: only what is made of both is wrong.
        stamps_alone = (
            self.secret is not None and self.secret.place.effect == STAMPS and not self.instruments.increments
        )
        composed = [] if self.secret is None or stamps_alone else [self.secret]
        motion = self.motion
        if self.secret is not None and self.secret.place.effect == UNDERSAMPLING:
            motion, composed = without_coning(motion, self.secret.values[0]), []
        return measure(
            motion,
            self.instruments,
            composed,
            self.seed * 100_003 + self.index,
            temperature=self.temperature,
            truth=self.reference == "truth",
            jitter=self.jitter,
        )

    def answer(self) -> dict[str, Any]:
        """The secret, for a file."""
        hidden = None if self.secret is None else self.secret.entry()
        return {
            "seed": self.seed,
            "case": self.index,
            "reference": self.reference,
            "hidden": hidden,
            "size": self.size,
            "stamps_jitter_periods": self.jitter,
            "gyros": dict(self.instruments.gyros),
            "accelerometers": dict(self.instruments.accelerometers),
        }


def draw_clean(seed: int, index: int, reference: Reference | None = None) -> StrapdownCase:
    """A case with nothing hidden; by default every second one has the true attitude."""
    chosen: Reference = reference or ("truth" if index % 2 else "gravity")
    rng = np.random.default_rng([seed, index])
    period = 1.0 / rng.choice(RATES_HZ)
    motion = draw_motion(rng, BEFORE_A_CAMERA if chosen == "truth" else BETWEEN_RESTS, period)
    instruments = draw_instruments(rng, chosen)
    temperature = None
    if rng.random() < 0.5:
        hours = period * np.arange(len(motion)) / 3600.0
        temperature = np.round(rng.uniform(15.0, 30.0) + rng.uniform(1.0, 8.0) * (1.0 - np.exp(-hours / 0.05)), 2)
    return StrapdownCase(seed, index, chosen, motion, instruments, temperature)


def draw_instruments(rng: np.random.Generator, reference: Reference) -> Instruments:
    """A block of small instruments; before a camera its gyros are delivered with scale factors that are right."""
    scale = rng.uniform(-0.01, 0.01, 3).tolist()
    gyros: dict[str, object] = {"bias": rng.uniform(-0.02, 0.02, 3).tolist()}
    gamma = rng.uniform(-0.01, 0.01, 9).tolist()
    if reference == "gravity":
        gyros["scale_misalignment"] = gamma
    accelerometers: dict[str, object] = {
        "scale_error_plus": scale,
        "scale_error_minus": scale,
        "bias": rng.uniform(-0.02, 0.02, 3).tolist(),
        **{f"gamma_{ij}": float(rng.uniform(-0.01, 0.01)) for ij in ("21", "31", "32")},
    }
    return Instruments(
        gyros=gyros,
        accelerometers=accelerometers,
        gyro_noise=Noise(math.radians(between(rng, 2e-3, 1.5e-2)), math.radians(between(rng, 2.0, 20.0) / 3600.0)),
        accelerometer_noise=Noise(between(rng, 2e-5, 4e-4), between(rng, 4e-6, 6e-5)),
        truth_noise=math.radians(rng.uniform(0.005, 0.02)),
        increments=bool(rng.random() < 0.5),
    )


def between(rng: np.random.Generator, low: float, high: float) -> float:
    """A number between two, every decade as likely as another."""
    return float(np.exp(rng.uniform(math.log(low), math.log(high))))


def system_of(case: StrapdownCase, record: StrapdownRecord) -> Evidence | None:
    """The linear system that a diagnosis makes of a record; None where it can make none."""
    found = inspect_record(record, gravity=STANDARD_GRAVITY)
    if case.reference == "gravity" and (found.accelerometers is None or found.accelerometers.least_squares is None):
        return None
    return carried_evidence(found, BASELINE[case.reference])


def sure_size(system: Evidence, place: EffectPlace, direction: NDArray) -> float:
    """The size, along a direction of the coefficients, from which the record surely disproves the model.

    Twice the bounds over the largest error that one unit leaves with the best parameters of the model.
    """
    unit = system.columns_of([place]) @ direction
    radius, _, _ = chebyshev_radius(system.nominal, unit, np.ones(len(unit)))
    return 2.0 / radius if radius > 0.0 else math.inf


def hideable() -> tuple[str, ...]:
    """Names of effects that some record can hide."""
    forces = [e.name for e in POSITION_EFFECTS.values() if e.component == "AccelerometerBlock" and e.variants is None]
    own = [e.name for e in STRAPDOWN_EFFECTS.values() if e.variants is None and e.name not in TAKEN_OUT]
    return (*own, *forces)


def draw_case(
    seed: int, index: int, effects: tuple[str, ...] = (), sizes: tuple[float, float] = SIZES
) -> StrapdownCase:
    """A case with an effect of a size relative to that of sure detection.

    Parameters
    ----------
    seed, index : int
    effects : tuple of str
        names to draw from; all that a record can hide where there are none
    sizes : (float, float)
        least and largest

    Raises
    ------
    InputError
        an effect that is not in the catalogue of strapdown records, or that this record cannot show
    """
    for name in effects:
        if name not in hideable():
            raise InputError(f"--effect {name}: not one that can be hidden here; {nearest(name, hideable())}")
    clean = draw_clean(seed, index)
    rng = np.random.default_rng([seed, index, 1])
    system = system_of(clean, clean.record())
    if system is None:
        raise InputError(f"case {index}: its rests do not tell the accelerometers' parameters")
    names = sorted({place.effect for place in system.places if not effects or place.effect in effects})
    unseen = (*TAKEN_OUT, *(UNSEEN_BETWEEN_RESTS if clean.reference == "gravity" else ()))
    names = [name for name in names if name not in unseen]
    for redrawn in range(TRIES if names else 0):
        name = names[rng.integers(len(names))]
        places = [place for place in system.places if place.effect == name]
        place = places[rng.integers(len(places))]
        case = hidden_in(clean, system, place, rng, sizes)
        if case is not None:
            return replace(case, redrawn=redrawn)
    raise InputError(f"case {index}: a record with {clean.reference} for its reference cannot show such an effect")


def hidden_in(
    clean: StrapdownCase, system: Evidence, place: EffectPlace, rng: np.random.Generator, sizes: tuple[float, float]
) -> StrapdownCase | None:
    """The case with an effect in it; None where its size would be more than is called possible."""
    wanted = float(rng.uniform(*sizes))
    effect = CATALOGUE[place.effect].at(place)
    if effect.component == "AttitudeComputer" and not clean.instruments.increments:
        return None
    if place.effect == STAMPS:
        return with_jitter(clean, place, wanted)
    direction = rng.normal(size=len(effect.parameters))
    direction /= np.linalg.norm(direction)
    if effect.parameters[0].smallest == 0.0:
        direction = np.abs(direction)
    values = effect.from_coefficients(wanted * sure_size(system, place, direction) * direction)
    if not all(np.isfinite(v) and p.possible(v) for v, p in zip(values, effect.parameters, strict=True)):
        return None
    return replace(clean, secret=Secret(place, values), size=wanted)


def with_jitter(clean: StrapdownCase, place: EffectPlace, wanted: float) -> StrapdownCase | None:
    """The case with time stamps that jitter while the sampling does not."""
    secret = Secret(place, (1.0,))
    furthest = replace(clean, secret=secret, jitter=FURTHEST_STAMP)
    system = system_of(furthest, furthest.record())
    if system is None or place not in system.places:
        return None
    part = wanted * sure_size(system, place, np.ones(1))
    return replace(furthest, jitter=part * FURTHEST_STAMP, size=wanted) if part <= 1.0 else None
