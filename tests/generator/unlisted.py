"""Records with a fault outside the catalogue: an unknown function of one quantity at one place.

The function has a known factor or none. The unit of its size is detection: 2 σ over the Chebyshev distance of the unit
fault from the range of bench and block at these positions. A programme of this module computes it.

An alternative that a record cannot separate from the truth counts as the truth. It is another place and quantity. Some
function of it, with no more pieces than the true one needs, changes the readings like the fault to within a quarter of
σ. Or it is α for n3, which is its cosine.
"""

from collections.abc import Callable, Iterator
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path

import numpy as np
from scipy.optimize import linprog

from generator import SIGMA
from generator.positions import Law, Session, errors

COUNTS = (16, 20, 24, 30, 36, 48, 60, 100)
PIECES, LIKE_TRUTH = (1, 2, 3, 4, 5, 6, 7, 8, 10, 12, 16, 24), 0.25
"""Numbers of pieces of a function that are tried; largest distance from the fault of an equivalent function [σ]."""
LARGEST = 3e-3
"""Largest change of a reading by a fault [g]: a larger fault is not weak."""
CIRCLES = ("alpha", "beta")


@dataclass(frozen=True)
class Pair:
    """A place, the quantity on which its fault depends, and the known factor of the unknown function, if any."""

    place: str
    quantity: str
    factor: str | None = None


@dataclass
class Fault:
    """Change by a fault of unit size at each of N rows.

    `kind` is smooth, jump, or sharp (a smooth function cannot describe it at these few positions). `readings` (N, 3)
    [g] are added. `encoder` (2, N) [rad] is the error of the outer and inner encoder. `turn` (2, N) [rad] is the axes'
    turn beyond their readings. `also` are effects of a catalogue that contain it.
    """

    pair: Pair
    kind: str
    readings: np.ndarray | float = 0.0
    encoder: np.ndarray | float = 0.0
    turn: np.ndarray | float = 0.0
    also: list[tuple[str, str]] = field(default_factory=list)


@dataclass(frozen=True)
class Outside:
    """A record and its hidden fault; `multiple` is its size in units of detection, `same` are all correct answers."""

    file: str
    shape: str
    kind: str
    place: str
    quantity: str
    factor: str | None
    positions: int
    multiple: float
    size: float
    pieces: int | None
    same: list[tuple[str, str, str | None]]
    also: list[tuple[str, str]]


@dataclass(frozen=True)
class Known:
    """A session with its true inputs (N, 3), and the model's derivatives (3 N, 18)."""

    session: Session
    n: np.ndarray
    model: np.ndarray

    @staticmethod
    def of(session: Session) -> "Known":
        stand, angles = session.stand, (session.alpha, session.beta)
        n = stand.inputs(*angles)
        moved = [
            replace(stand, kappa=stand.kappa + 1e-6),
            replace(stand, epsilon=stand.epsilon + 1e-6),
            replace(stand, alpha_error=stand.alpha_error + 1e-6),
        ]
        for axis in np.eye(3):
            moved.append(replace(stand, theta=stand.theta + 1e-6 * axis))
        columns = []
        for other in moved:
            columns.append((other.readings(other.inputs(*angles)) - stand.readings(n)) / 1e-6)
        for i, channel in enumerate(np.eye(3)):
            for j in range(i):
                columns.append(n[:, [j]] * channel)
            for sign in (1.0, -1.0):
                columns.append(np.where(sign * n[:, [i]] > 0.0, n[:, [i]], 0.0) * channel)
            columns.append(np.ones_like(n) * channel)
        return Known(session, n, np.stack(columns, axis=-1).reshape(n.size, -1))

    def values(self, quantity: str) -> np.ndarray:
        """Return a quantity (N,)."""
        values = {
            "alpha": self.session.alpha,
            "beta": self.session.beta,
            "time": self.session.hours,
            "temperature": self.session.temperature,
            "n1": self.n[:, 0],
            "n2": self.n[:, 1],
            "n3": self.n[:, 2],
        }
        product = np.ones(len(self.n))
        for name in quantity.split():
            product = product * values[name]
        return product

    def part(self, quantity: str) -> np.ndarray:
        """Return a quantity (N,) scaled from 0 at its least to 1 at its greatest."""
        values = self.values(quantity)
        return (values - values.min()) / np.ptp(values)

    def read(self, fault: Fault, size: float) -> tuple[tuple[np.ndarray, np.ndarray], np.ndarray]:
        """Return read angles, and readings (N, 3) without errors."""
        true = np.array([self.session.alpha, self.session.beta])
        stand = self.session.stand
        reading = stand.readings(stand.inputs(*(true + size * fault.turn))) + size * fault.readings
        alpha, beta = true + size * fault.encoder
        return (alpha, beta), reading

    def change(self, fault: Fault, size: float = 1e-5) -> np.ndarray:
        """Return a fault's change of the readings against the model at the read angles (3 N,) [g], by unit size."""
        angles, reading = self.read(fault, size)
        stand = self.session.stand
        return ((reading - stand.readings(stand.inputs(*angles))) / size).ravel()

    def unit_turns(self) -> dict[str, np.ndarray]:
        """Return derivatives (N, 3) by turns: about the outer axis, of the outer axis, about the inner axis, of it."""
        stand, (a, b), h = self.session.stand, (self.session.alpha, self.session.beta), 1e-6
        moved = {
            "outer": (stand, a + h, b),
            "kappa": (replace(stand, kappa=stand.kappa + h), a, b),
            "inner": (stand, a, b + h),
            "epsilon": (replace(stand, epsilon=stand.epsilon + h), a, b),
        }
        nominal = stand.readings(self.n)
        return {name: (s.readings(s.inputs(x, y)) - nominal) / h for name, (s, x, y) in moved.items()}

    def carriers(self) -> Iterator[tuple[Pair, list[np.ndarray]]]:
        """Yield each pair with the factors of a function of its quantity, (N, 3) for each component."""
        turns = self.unit_turns()
        for p in range(3):
            on, own = np.eye(3)[p] * np.ones_like(self.n), f"n{p + 1}"
            products = ("n1 n2", "n1 n3", "n2 n3")
            for quantity in ("n1", "n2", "n3", *products, "alpha", "beta", "time", "temperature"):
                yield Pair(f"accelerometer-{p + 1}", quantity), [on]
            for quantity in ("time", "temperature"):
                yield Pair(f"accelerometer-{p + 1}", quantity, own), [on * self.n[:, [p]]]
                zero = 20.0 if quantity == "temperature" else 0.0
                yield Pair(f"accelerometer-{p + 1}", own, quantity), [on * (self.values(quantity)[:, None] - zero)]
        for quantity in ("alpha", "beta", "time", "temperature"):
            yield Pair("outer-axis", quantity), [turns["outer"], turns["kappa"]]
            yield Pair("inner-axis", quantity), [turns["inner"], turns["epsilon"]]
        yield Pair("inner-axis", "beta", "sin alpha"), [turns["inner"] * np.sin(self.session.alpha)[:, None]]

    def pieces(self, quantity: str, count: int) -> np.ndarray:
        """Return hat functions (N, ...) of equal pieces; on a circle for an angle."""
        values = self.values(quantity)
        if quantity in CIRCLES:
            at = np.remainder(values, 2.0 * np.pi) / (2.0 * np.pi) * count
            off = np.remainder(at[:, None] - np.arange(count) + count / 2.0, count) - count / 2.0
        else:
            off = self.part(quantity)[:, None] * count - np.arange(count + 1)
        return np.clip(1.0 - np.abs(off), 0.0, None)

    def steps(self, quantity: str) -> np.ndarray:
        """Return one jump in each gap between two values of a quantity (N, N - 1)."""
        values = self.values(quantity)
        return np.where(values[:, None] > np.sort(values)[:-1], 1.0, 0.0)


# The shapes: unknown to the model, at unit size.


def bell(off: np.ndarray, width: float) -> np.ndarray:
    """Return a bump of height one."""
    return np.exp(-0.5 * (off / width) ** 2)


def around(angle: np.ndarray, centre: float) -> np.ndarray:
    """Return the angle from a centre, within half a turn."""
    return np.remainder(angle - centre + np.pi, 2.0 * np.pi) - np.pi


def teeth_of(angle: np.ndarray, phase: float) -> np.ndarray:
    """Return a sawtooth: a straight line from -1 to 1 in each turn."""
    return 2.0 * np.remainder(angle / (2.0 * np.pi) + phase, 1.0) - 1.0


def on_encoder(truth: Known, rng: np.random.Generator, law: Callable[[np.ndarray], np.ndarray], kind: str) -> Fault:
    """Return a fault of an encoder: a function of its angle is added to its reading."""
    axis = int(rng.integers(2))
    encoder = np.zeros((2, len(truth.n)))
    encoder[axis] = law(truth.values(CIRCLES[axis]))
    return Fault(Pair(("outer-axis", "inner-axis")[axis], CIRCLES[axis]), kind, encoder=encoder)


def on_accelerometer(truth: Known, p: int, quantity: str, values: np.ndarray, kind: str = "smooth") -> Fault:
    """Return a fault with values (N,) added to the readings of accelerometer p, from 0."""
    return Fault(Pair(f"accelerometer-{p + 1}", quantity), kind, readings=values[:, None] * np.eye(3)[p])


def encoder_bump(truth: Known, rng: np.random.Generator) -> Fault:
    centre, width = rng.uniform(0.0, 2.0 * np.pi), np.radians(rng.uniform(15.0, 45.0))
    return on_encoder(truth, rng, lambda angle: bell(around(angle, centre), width), "smooth")


def sawtooth(truth: Known, rng: np.random.Generator) -> Fault:
    teeth, phase = int(rng.integers(3, 9)), rng.uniform()
    return on_encoder(truth, rng, lambda angle: teeth_of(teeth * angle, phase), "sharp")


def ninth_harmonic(truth: Known, rng: np.random.Generator) -> Fault:
    phase = rng.uniform(0.0, 2.0 * np.pi)
    return on_encoder(truth, rng, lambda angle: np.sin(9.0 * angle + phase), "sharp")


def fifth_power(truth: Known, rng: np.random.Generator) -> Fault:
    p = int(rng.integers(3))
    return on_accelerometer(truth, p, f"n{p + 1}", truth.n[:, p] ** 5)


def local_bump(truth: Known, rng: np.random.Generator) -> Fault:
    p = int(rng.integers(3))
    values = bell(truth.n[:, p] - rng.uniform(-0.8, 0.8), rng.uniform(0.12, 0.3))
    return on_accelerometer(truth, p, f"n{p + 1}", values)


def bent_input(truth: Known, rng: np.random.Generator) -> Fault:
    p, width = int(rng.integers(3)), rng.uniform(0.25, 0.6)
    x = truth.n[:, p] / width
    return on_accelerometer(truth, p, f"n{p + 1}", np.tanh(x) if rng.uniform() < 0.5 else x / np.sqrt(1.0 + x**2))


def other_input(truth: Known, rng: np.random.Generator) -> Fault:
    p, further = int(rng.integers(3)), int(rng.integers(1, 3))
    j = (p + further) % 3
    laws = (lambda x: x**3, lambda x: np.tanh(3.0 * x), lambda x: bell(x - 0.4, 0.3))
    return on_accelerometer(truth, p, f"n{j + 1}", laws[int(rng.integers(3))](truth.n[:, j]))


def slow_sine(truth: Known, rng: np.random.Generator) -> Fault:
    p = int(rng.integers(3))
    turns = rng.uniform(0.8, 2.0) * truth.part("time") + rng.uniform()
    fault = on_accelerometer(truth, p, "time", np.sin(2.0 * np.pi * turns))
    return replace(fault, also=[("bias-wander", fault.pair.place)])


def sag_twice(truth: Known, rng: np.random.Generator) -> Fault:
    turn = np.zeros((2, len(truth.n)))
    turn[1] = np.sin(truth.session.alpha) * np.sin(2.0 * truth.session.beta + rng.uniform(0.0, 2.0 * np.pi))
    return Fault(Pair("inner-axis", "beta", "sin alpha"), "smooth", turn=turn)


def varying_scale(truth: Known, rng: np.random.Generator) -> Fault:
    p, quantity = int(rng.integers(3)), str(rng.choice(["time", "temperature"]))
    x = truth.part(quantity)
    law = np.sin(2.0 * np.pi * (rng.uniform(0.6, 1.2) * x + rng.uniform())) if rng.uniform() < 0.5 else np.exp(-4.0 * x)
    fault = on_accelerometer(truth, p, quantity, law * truth.n[:, p])
    return replace(fault, pair=replace(fault.pair, factor=f"n{p + 1}"))


def of_temperature(truth: Known, rng: np.random.Generator) -> Fault:
    p, x, at = int(rng.integers(3)), truth.part("temperature"), rng.uniform(0.3, 0.7)
    laws = ((x - at) ** 2, np.tanh((x - at) / 0.15), bell(x - at, 0.18))
    return on_accelerometer(truth, p, "temperature", laws[int(rng.integers(3))])


def one_jump(truth: Known, rng: np.random.Generator) -> Fault:
    which, at = int(rng.integers(4)), rng.uniform(0.25, 0.75)
    if which == 0:
        # Linear once around and back: a circle allows no single jump.
        phase = rng.uniform()
        return on_encoder(truth, rng, lambda angle: teeth_of(angle, phase), "jump")
    if which == 1:
        encoder = np.zeros((2, len(truth.n)))
        encoder[0] = truth.part("time") > at
        return Fault(Pair("outer-axis", "time"), "jump", encoder=encoder)
    p = int(rng.integers(3))
    quantity = "temperature" if which == 2 else f"n{(p + 1) % 3 + 1}"
    return on_accelerometer(truth, p, quantity, (truth.part(quantity) > at).astype(float), "jump")


def of_outer_angle(truth: Known, rng: np.random.Generator) -> Fault:
    p, centre = int(rng.integers(3)), rng.uniform(0.0, 2.0 * np.pi)
    values = np.exp(rng.uniform(1.0, 4.0) * (np.cos(truth.session.alpha - centre) - 1.0))
    return on_accelerometer(truth, p, "alpha", values)


SHAPES: tuple[Callable[[Known, np.random.Generator], Fault], ...] = (
    encoder_bump,
    sawtooth,
    fifth_power,
    local_bump,
    ninth_harmonic,
    slow_sine,
    sag_twice,
    varying_scale,
    of_temperature,
    bent_input,
    other_input,
    one_jump,
    of_outer_angle,
)


# Distances, and alternatives that equal the truth


def distance(change: np.ndarray, columns: np.ndarray) -> float:
    """Return the least of max |change - columns x| over x."""
    count, wide = columns.shape
    scale = np.abs(columns).max(axis=0)
    columns = columns / np.where(scale > 0.0, scale, 1.0)
    size = float(np.abs(change).max())
    if size == 0.0:
        return 0.0
    up = np.hstack([columns, -np.ones((count, 1))])
    down = np.hstack([-columns, -np.ones((count, 1))])
    limits = [(None, None)] * wide + [(0.0, None)]
    ends = np.concatenate([change, -change]) / size
    for method in ("highs-ds", "highs-ipm"):
        solution = linprog(np.append(np.zeros(wide), 1.0), np.vstack([up, down]), ends, bounds=limits, method=method)
        if solution.success:
            return size * float(solution.fun)
    raise ArithmeticError("no solver finds the distance")


def as_near(change: np.ndarray, columns: np.ndarray, near: float) -> bool:
    """Return True if columns come within `near`; least squares, never above, spare most programmes."""
    rest = change - columns @ np.linalg.lstsq(columns, change, rcond=1e-10)[0]
    if np.abs(rest).max() <= near:
        return True
    return float(np.sqrt(np.mean(rest**2))) <= near and distance(change, columns) <= near


def carried(carriers: list[np.ndarray], functions: np.ndarray) -> np.ndarray:
    """Return columns (3 N, K) of functions (N, k) times each carrier (N, 3)."""
    return np.hstack([(c[:, :, None] * functions[:, None, :]).reshape(-1, functions.shape[1]) for c in carriers])


def stands_with_pieces(truth: Known, change: np.ndarray, pair: Pair, carriers: list[np.ndarray], count: int) -> bool:
    columns = np.hstack([truth.model, carried(carriers, truth.pieces(pair.quantity, count))])
    return as_near(change, columns, LIKE_TRUTH * SIGMA)


def stands_with_a_jump(truth: Known, change: np.ndarray, pair: Pair, carriers: list[np.ndarray]) -> bool:
    """Return True if a linear function with one jump can replace the change."""
    linear = np.hstack([truth.model, carried(carriers, truth.pieces(pair.quantity, 1))])
    for step in truth.steps(pair.quantity).T:
        if as_near(change, np.hstack([linear, carried(carriers, step[:, None])]), LIKE_TRUTH * SIGMA):
            return True
    return False


def same_as(truth: Known, fault: Fault, change: np.ndarray) -> tuple[int | None, list[Pair]]:
    """Return the pieces that the truth needs (None: a jump, or more than all of `PIECES`), and the equivalent pairs."""
    pairs = dict(truth.carriers())
    if fault.kind == "jump":
        standing = [pair for pair, carriers in pairs.items() if stands_with_a_jump(truth, change, pair, carriers)]
        return None, [fault.pair, *standing]
    if fault.pair not in pairs:
        return None, [fault.pair]
    for count in PIECES:
        if count > len(truth.n) // 2:
            break
        if stands_with_pieces(truth, change, fault.pair, pairs[fault.pair], count):
            return count, [pair for pair, c in pairs.items() if stands_with_pieces(truth, change, pair, c, count)]
    return None, [fault.pair]


def outside_case(folder: Path, seed: int, index: int) -> Outside:
    """Return case `index` of a seed: shapes in turn, each time another bench; its record is in the folder."""
    shape = SHAPES[index % len(SHAPES)]
    for attempt in range(30):
        rng = np.random.default_rng([seed, index, attempt])
        count, multiple = int(rng.choice(COUNTS)), float(rng.uniform(1.2, 5.0))
        truth = Known.of(Session.drawn(rng, count))
        fault, sign = shape(truth, rng), float(rng.choice([-1.0, 1.0]))
        unit = truth.change(fault)
        away = distance(unit, truth.model)
        if away < 1e-6 * np.abs(unit).max():
            continue
        size = sign * multiple * 2.0 * SIGMA / away
        if abs(size) * np.abs(unit).max() > LARGEST:
            continue
        angles, reading = truth.read(fault, size)
        path = folder / f"case{index:03d}.positions.csv"
        truth.session.write(path, angles, reading + errors(rng, count)[0], rng)
        pieces, same = same_as(truth, fault, size * unit)
        if fault.pair.quantity == "n3":
            same = [*same, replace(fault.pair, quantity="alpha")]
        answers = dict.fromkeys((pair.place, pair.quantity, pair.factor) for pair in (fault.pair, *same))
        return Outside(
            file=path.name,
            shape=shape.__name__,
            kind=fault.kind,
            **asdict(fault.pair),
            positions=count,
            multiple=multiple,
            size=size,
            pieces=pieces,
            same=list(answers),
            also=fault.also,
        )
    raise AssertionError(f"{shape.__name__}, seed {seed}, case {index}: no bench shows it")


# An error by a formula


@dataclass(frozen=True)
class Formula:
    """An error by a formula, its true coefficients, and another formula that is false for the same record."""

    error: Law
    sizes: tuple[float, ...]
    false: str


FORMULAS = {
    "f2 += c*sin(3*alpha)": Formula(lambda s: 8e-5 * np.sin(3 * s.alpha), (8e-5,), "f1 += c*sin(3*alpha)"),
    "beta += c*abs(sin(beta))": Formula(lambda s: 2e-4 * np.abs(np.sin(s.beta)), (2e-4,), "alpha += c*abs(sin(alpha))"),
    "f1 += c*n1**5": Formula(lambda s: -3e-4 * s.n[:, 0] ** 5, (-3e-4,), "f1 += c*n1**2"),
    "f3 += c*n3*n1*n2": Formula(lambda s: 3e-4 * s.n.prod(axis=1), (3e-4,), "f3 += c*n3**3"),
    "f1 += a*exp(-hours/0.2)": Formula(lambda s: 1.5e-4 * np.exp(-s.hours / 0.2), (1.5e-4,), "f1 += a*sin(2*beta)"),
    "f2 += c*step(hours - 0.3)": Formula(lambda s: -6e-5 * (s.hours > 0.3), (-6e-5,), "f2 += c*step(hours - 0.15)"),
    "f3 += c*(temperature - 20)**2": Formula(
        lambda s: 1.2e-5 * (s.temperature - 20.0) ** 2, (1.2e-5,), "f3 += c*hours"
    ),
    "alpha += c*sin(9*alpha) + d*cos(9*alpha)": Formula(
        lambda s: 8e-5 * np.sin(9 * s.alpha + 1.0),
        (8e-5 * np.cos(1.0), 8e-5 * np.sin(1.0)),
        "alpha += c*sin(8*alpha) + d*cos(8*alpha)",
    ),
    "f2 += c*sin(20*n2)": Formula(lambda s: 7e-5 * np.sin(20.0 * s.n[:, 1]), (7e-5,), "f2 += c*sin(12*n2)"),
    "f1 += c*n2**2*hours + d*n3*hours": Formula(
        lambda s: (4e-4 * s.n[:, 1] ** 2 - 3e-4 * s.n[:, 2]) * s.hours,
        (4e-4, -3e-4),
        "f1 += c*n2*hours + d*n3**2*hours",
    ),
}
