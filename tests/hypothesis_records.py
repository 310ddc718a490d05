"""Records with an error of a known formula, by a generator that shares nothing with the product, and answers to it."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from independent_bench import SIGMA, G, Stand
from trihedron.models.effects import EffectPlace
from trihedron.tools.diagnosis.hypothesis import places_of
from trihedron.tools.diagnosis.procedure import answered
from trihedron.tools.evidence.bench import bench_evidence
from trihedron.tools.records import PositionRecord, read_record


@dataclass(frozen=True)
class Seen:
    """What an error may depend on, at N positions: true angles [rad], inputs [g], hours, temperature, senses."""

    alpha: np.ndarray
    beta: np.ndarray
    n: np.ndarray
    hours: np.ndarray
    temperature: np.ndarray


Errors = Callable[[Seen], np.ndarray]


def record_with(path: Path, seed: int, left: str, errors: Errors, count: int = 36) -> Path:
    """A position record in which `left`, a reading f1 to f3 [g] or an encoder [rad], errs by a function (N,)."""
    rng = np.random.default_rng(seed)
    stand = Stand.drawn(rng)
    alpha, beta = rng.uniform(0.0, 2.0 * np.pi, (2, count))
    time_s = np.round(np.cumsum(rng.uniform(40.0, 90.0, count)), 1)
    hours = (time_s - time_s[0]) / 3600.0
    temperature = np.round(20.0 + 4.0 * np.sin(9.0 * hours + seed) + rng.uniform(-2.0, 2.0, count), 4)
    n = stand.inputs(alpha, beta)
    true = alpha - stand.alpha_error - stand.alpha_star, beta - stand.beta_error
    added = errors(Seen(*true, n, hours, temperature))
    reading = stand.readings(n) + rng.uniform(-SIGMA, SIGMA, n.shape)
    if left[0] == "f":
        reading[:, int(left[1]) - 1] += added
    else:
        alpha, beta = alpha + (left == "alpha") * added, beta + (left == "beta") * added
    names = "position,time_s,alpha_deg,beta_deg,f1_mps2,f2_mps2,f3_mps2,temperature_degC"
    columns = [np.arange(1, count + 1), time_s, np.degrees(alpha), np.degrees(beta), *(G * reading.T), temperature]
    formats = ["%d", "%.1f", *["%.9f"] * 5, "%.4f"]
    np.savetxt(path, np.column_stack(columns), fmt=formats, delimiter=",", header=names, comments="")
    return path


TRUE: dict[str, tuple[Errors, str]] = {
    "f2 += c*sin(3*alpha)": (lambda s: 8e-5 * np.sin(3 * s.alpha), "f1 += c*sin(3*alpha)"),
    "f1 += c*n1**5": (lambda s: -3e-4 * s.n[:, 0] ** 5, "f1 += c*n1**2"),
    "f3 += c*n3*n1*n2": (lambda s: 3e-4 * s.n.prod(axis=1), "f3 += c*n3**3"),
    "f1 += a*exp(-hours/0.2)": (lambda s: 1.5e-4 * np.exp(-s.hours / 0.2), "f1 += a*sin(2*beta)"),
    "f2 += c*step(hours - 0.3)": (lambda s: -6e-5 * (s.hours > 0.3), "f2 += c*step(hours - 0.15)"),
    "f3 += c*(temperature - 20)**2": (lambda s: 1.2e-5 * (s.temperature - 20.0) ** 2, "f3 += c*hours"),
    "alpha += c*sin(9*alpha) + d*cos(9*alpha)": (
        lambda s: 8e-5 * np.sin(9 * s.alpha + 1.0),
        "alpha += c*sin(8*alpha) + d*cos(8*alpha)",
    ),
    "beta += c*abs(sin(beta))": (lambda s: 2e-4 * np.abs(np.sin(s.beta)), "alpha += c*abs(sin(alpha))"),
    "f2 += c*sin(20*n2)": (lambda s: 7e-5 * np.sin(20.0 * s.n[:, 1]), "f2 += c*sin(12*n2)"),
    "f1 += c*n2**2*hours + d*n3*hours": (
        lambda s: (4e-4 * s.n[:, 1] ** 2 - 3e-4 * s.n[:, 2]) * s.hours,
        "f1 += c*n2*hours + d*n3**2*hours",
    ),
}
"""Of each formula what errs by it, and another formula that is false of the same record."""
SIZES = {
    "f2 += c*sin(3*alpha)": (8e-5,),
    "f1 += c*n1**5": (-3e-4,),
    "f3 += c*n3*n1*n2": (3e-4,),
    "f1 += a*exp(-hours/0.2)": (1.5e-4,),
    "f2 += c*step(hours - 0.3)": (-6e-5,),
    "f3 += c*(temperature - 20)**2": (1.2e-5,),
    "alpha += c*sin(9*alpha) + d*cos(9*alpha)": (8e-5 * np.cos(1.0), 8e-5 * np.sin(1.0)),
    "beta += c*abs(sin(beta))": (2e-4,),
    "f2 += c*sin(20*n2)": (7e-5,),
    "f1 += c*n2**2*hours + d*n3*hours": (4e-4, -3e-4),
}
"""The true coefficients."""


def place_of(text: str, *, in_motion: bool = False) -> EffectPlace:
    """The effect of a formula."""
    (place,) = places_of([text], at_table=not in_motion, with_gyros=in_motion)
    return place


def check_answers(text: str, folder: Path) -> None:
    """A true formula stands with intervals that hold its coefficients; the false one beside it is refuted."""
    errors, false = TRUE[text]
    left = text.split()[0]
    path = record_with(folder / "r.positions.csv", len(text), left, errors)
    evidence = bench_evidence(read_record(path, PositionRecord), noise_bound=SIGMA)
    right = answered(evidence, place_of(text), rerun=False)
    assert right.answer == "stands"
    assert right.radius <= 1.0 < right.radius_before
    for parameter, size in zip(right.parameters, SIZES[text], strict=True):
        assert parameter.low is not None
        assert parameter.high is not None
        # The zero of the inner encoder is not told; it is a thousandth of the size here.
        assert parameter.low - 3e-3 * abs(size) <= size <= parameter.high + 3e-3 * abs(size)
    wrong = answered(evidence, place_of(false), rerun=False)
    assert wrong.answer == "refuted"
    assert wrong.radius > 1.0
    assert wrong.parameters == ()
