"""Records with a fault that is in no catalogue, by a generator that shares nothing with the product.

    python tests/outside_shapes.py FOLDER --cases 200 --seed 1

writes caseNNN.positions.csv and truth.json. A fault is an unknown function of one quantity at one place, with a known
factor or without. Its size is in units of detection: 2 σ over the Chebyshev distance of the
unit fault from what the model of bench and block can say at these positions, by a programme of this module's own.

What a record cannot tell from the truth counts as the truth: another place and quantity of which some function, of no
more pieces than the true one needs, does to the readings what the fault does to within a quarter of σ; and α for n3,
which is its cosine.
"""

import argparse
import json
from collections.abc import Callable, Iterator
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path

import numpy as np
from scipy.optimize import linprog

from independent_bench import SIGMA, Session, errors

COUNTS = (16, 20, 24, 30, 36, 48, 60, 100)
PIECES, LIKE_TRUTH = (1, 2, 3, 4, 5, 6, 7, 8, 10, 12, 16, 24), 0.25
"""Pieces of a function that are tried; so near to the fault [σ] a function stands for it."""
LARGEST = 3e-3
"""No fault changes a reading by more [g]: what is larger is no weak fault."""
CIRCLES = ("alpha", "beta")


@dataclass(frozen=True)
class Pair:
    """A place, the quantity on which its fault depends, and the known factor of the unknown function, if any."""

    place: str
    quantity: str
    factor: str | None = None


@dataclass
class Fault:
    """What a fault of unit size does at each of N rows.

    `kind` is smooth, jump, or sharp (a smooth function is no description of it at so few positions). `readings` (N, 3)
    [g] are added; `encoder` (2, N) [rad] is what outer and inner encoder read too much; `turn` (2, N) [rad] what the
    axes turn further than they read. `also` are effects of a catalogue that hold it.
    """

    pair: Pair
    kind: str
    readings: np.ndarray | float = 0.0
    encoder: np.ndarray | float = 0.0
    turn: np.ndarray | float = 0.0
    also: list[tuple[str, str]] = field(default_factory=list)


@dataclass(frozen=True)
class Outside:
    """A record and what is hidden in it; `multiple` is its size in units of detection, `same` are all right answers."""

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
    """A session with what its generator knows of it: true inputs (N, 3), and the model's derivatives (3 N, 18)."""

    session: Session
    n: np.ndarray
    model: np.ndarray

    @staticmethod
    def of(session: Session) -> "Known":
        stand, angles = session.stand, (session.alpha, session.beta)
        n = stand.inputs(*angles)
        columns = []
        for name in ("kappa", "epsilon", "alpha_error"):
            moved = replace(stand, **{name: getattr(stand, name) + 1e-6})
            columns.append((moved.readings(moved.inputs(*angles)) - stand.readings(n)) / 1e-6)
        for axis in np.eye(3):
            moved = replace(stand, theta=stand.theta + 1e-6 * axis)
            columns.append((moved.readings(moved.inputs(*angles)) - stand.readings(n)) / 1e-6)
        for i, one in enumerate(np.eye(3)):
            columns += [n[:, [j]] * one for j in range(i)]
            columns += [np.where(sign * n[:, [i]] > 0.0, n[:, [i]], 0.0) * one for sign in (1.0, -1.0)]
            columns.append(np.ones_like(n) * one)
        return Known(session, n, np.stack([column.ravel() for column in columns], axis=1))

    def values(self, quantity: str) -> np.ndarray:
        """A quantity (N,)."""
        found = {"alpha": self.session.alpha, "beta": self.session.beta, "time": self.session.hours}
        found |= {"temperature": self.session.temperature, "n1": self.n[:, 0], "n2": self.n[:, 1], "n3": self.n[:, 2]}
        return np.prod([found[name] for name in quantity.split()], axis=0)

    def part(self, quantity: str) -> np.ndarray:
        """A quantity (N,) from 0 at its least to 1 at its greatest."""
        values = self.values(quantity)
        return (values - values.min()) / np.ptp(values)

    def read(self, fault: Fault, size: float) -> tuple[tuple[np.ndarray, np.ndarray], np.ndarray]:
        """Angles that are read, and readings (N, 3) without errors."""
        true = np.array([self.session.alpha, self.session.beta])
        stand = self.session.stand
        reading = stand.readings(stand.inputs(*(true + size * fault.turn))) + size * fault.readings
        alpha, beta = true + size * fault.encoder
        return (alpha, beta), reading

    def change(self, fault: Fault, size: float = 1e-5) -> np.ndarray:
        """What a fault does to readings beside the model's at the angles that are read (3 N,) [g], by unit size."""
        angles, reading = self.read(fault, size)
        stand = self.session.stand
        return ((reading - stand.readings(stand.inputs(*angles))) / size).ravel()

    def unit_turns(self) -> dict[str, np.ndarray]:
        """Derivatives (N, 3) by turns: about the outer axis, of the outer axis, about the inner axis, of it."""
        stand, (a, b), h = self.session.stand, (self.session.alpha, self.session.beta), 1e-6
        moved = {
            "outer": (stand, a + h, b),
            "kappa": (replace(stand, kappa=stand.kappa + h), a, b),
            "inner": (stand, a, b + h),
            "epsilon": (replace(stand, epsilon=stand.epsilon + h), a, b),
        }
        here = stand.readings(self.n)
        return {name: (s.readings(s.inputs(x, y)) - here) / h for name, (s, x, y) in moved.items()}

    def carriers(self) -> Iterator[tuple[Pair, list[np.ndarray]]]:
        """Each pair with what a function of its quantity is multiplied by, (N, 3) for each component."""
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
        """Hat functions (N, ...) of so many equal pieces; on a circle for an angle."""
        values = self.values(quantity)
        if quantity in CIRCLES:
            at = np.remainder(values, 2.0 * np.pi) / (2.0 * np.pi) * count
            off = np.remainder(at[:, None] - np.arange(count) + count / 2.0, count) - count / 2.0
        else:
            off = self.part(quantity)[:, None] * count - np.arange(count + 1)
        return np.clip(1.0 - np.abs(off), 0.0, None)

    def steps(self, quantity: str) -> np.ndarray:
        """One jump in each gap between two values of a quantity (N, N - 1)."""
        values = self.values(quantity)
        return np.where(values[:, None] > np.sort(values)[:-1], 1.0, 0.0)


# The shapes: what is unknown to the model, at unit size.


def bell(off: np.ndarray, width: float) -> np.ndarray:
    """A bump of height one."""
    return np.exp(-0.5 * (off / width) ** 2)


def around(angle: np.ndarray, centre: float) -> np.ndarray:
    """The angle from a centre, within half a turn."""
    return np.remainder(angle - centre + np.pi, 2.0 * np.pi) - np.pi


def on_encoder(known: Known, rng: np.random.Generator, law: Callable[[np.ndarray], np.ndarray], kind: str) -> Fault:
    """A function of an encoder's angle that this encoder reads too much."""
    axis = int(rng.integers(2))
    encoder = np.zeros((2, len(known.n)))
    encoder[axis] = law(known.values(CIRCLES[axis]))
    return Fault(Pair(("outer-axis", "inner-axis")[axis], CIRCLES[axis]), kind, encoder=encoder)


def on_accelerometer(known: Known, p: int, quantity: str, values: np.ndarray, kind: str = "smooth") -> Fault:
    """Values (N,) added to the readings of accelerometer p, from 0."""
    return Fault(Pair(f"accelerometer-{p + 1}", quantity), kind, readings=values[:, None] * np.eye(3)[p])


def encoder_bump(known: Known, rng: np.random.Generator) -> Fault:
    centre, width = rng.uniform(0.0, 2.0 * np.pi), np.radians(rng.uniform(15.0, 45.0))
    return on_encoder(known, rng, lambda angle: bell(around(angle, centre), width), "smooth")


def sawtooth(known: Known, rng: np.random.Generator) -> Fault:
    teeth, phase = int(rng.integers(3, 9)), rng.uniform()
    law = lambda angle: 2.0 * np.remainder(teeth * angle / (2.0 * np.pi) + phase, 1.0) - 1.0  # noqa: E731
    return on_encoder(known, rng, law, "sharp")


def ninth_harmonic(known: Known, rng: np.random.Generator) -> Fault:
    phase = rng.uniform(0.0, 2.0 * np.pi)
    return on_encoder(known, rng, lambda angle: np.sin(9.0 * angle + phase), "sharp")


def fifth_power(known: Known, rng: np.random.Generator) -> Fault:
    p = int(rng.integers(3))
    return on_accelerometer(known, p, f"n{p + 1}", known.n[:, p] ** 5)


def local_bump(known: Known, rng: np.random.Generator) -> Fault:
    p = int(rng.integers(3))
    values = bell(known.n[:, p] - rng.uniform(-0.8, 0.8), rng.uniform(0.12, 0.3))
    return on_accelerometer(known, p, f"n{p + 1}", values)


def bent_input(known: Known, rng: np.random.Generator) -> Fault:
    p, width = int(rng.integers(3)), rng.uniform(0.25, 0.6)
    x = known.n[:, p] / width
    return on_accelerometer(known, p, f"n{p + 1}", np.tanh(x) if rng.uniform() < 0.5 else x / np.sqrt(1.0 + x**2))


def other_input(known: Known, rng: np.random.Generator) -> Fault:
    p, further = int(rng.integers(3)), int(rng.integers(1, 3))
    j = (p + further) % 3
    laws = (lambda x: x**3, lambda x: np.tanh(3.0 * x), lambda x: bell(x - 0.4, 0.3))
    return on_accelerometer(known, p, f"n{j + 1}", laws[int(rng.integers(3))](known.n[:, j]))


def slow_sine(known: Known, rng: np.random.Generator) -> Fault:
    p = int(rng.integers(3))
    turns = rng.uniform(0.8, 2.0) * known.part("time") + rng.uniform()
    fault = on_accelerometer(known, p, "time", np.sin(2.0 * np.pi * turns))
    return replace(fault, also=[("bias-wander", fault.pair.place)])


def sag_twice(known: Known, rng: np.random.Generator) -> Fault:
    turn = np.zeros((2, len(known.n)))
    turn[1] = np.sin(known.session.alpha) * np.sin(2.0 * known.session.beta + rng.uniform(0.0, 2.0 * np.pi))
    return Fault(Pair("inner-axis", "beta", "sin alpha"), "smooth", turn=turn)


def varying_scale(known: Known, rng: np.random.Generator) -> Fault:
    p, quantity = int(rng.integers(3)), str(rng.choice(["time", "temperature"]))
    x = known.part(quantity)
    law = np.sin(2.0 * np.pi * (rng.uniform(0.6, 1.2) * x + rng.uniform())) if rng.uniform() < 0.5 else np.exp(-4.0 * x)
    fault = on_accelerometer(known, p, quantity, law * known.n[:, p])
    return replace(fault, pair=replace(fault.pair, factor=f"n{p + 1}"))


def of_temperature(known: Known, rng: np.random.Generator) -> Fault:
    p, x, at = int(rng.integers(3)), known.part("temperature"), rng.uniform(0.3, 0.7)
    laws = ((x - at) ** 2, np.tanh((x - at) / 0.15), bell(x - at, 0.18))
    return on_accelerometer(known, p, "temperature", laws[int(rng.integers(3))])


def one_jump(known: Known, rng: np.random.Generator) -> Fault:
    which, at = int(rng.integers(4)), rng.uniform(0.25, 0.75)
    if which == 0:
        # Once around, linear back: a circle allows no jump alone.
        phase = rng.uniform()
        law = lambda angle: 2.0 * np.remainder(angle / (2.0 * np.pi) + phase, 1.0) - 1.0  # noqa: E731
        return on_encoder(known, rng, law, "jump")
    if which == 1:
        encoder = np.zeros((2, len(known.n)))
        encoder[0] = known.part("time") > at
        return Fault(Pair("outer-axis", "time"), "jump", encoder=encoder)
    p = int(rng.integers(3))
    quantity = "temperature" if which == 2 else f"n{(p + 1) % 3 + 1}"
    return on_accelerometer(known, p, quantity, (known.part(quantity) > at).astype(float), "jump")


def of_outer_angle(known: Known, rng: np.random.Generator) -> Fault:
    p, centre = int(rng.integers(3)), rng.uniform(0.0, 2.0 * np.pi)
    values = np.exp(rng.uniform(1.0, 4.0) * (np.cos(known.session.alpha - centre) - 1.0))
    return on_accelerometer(known, p, "alpha", values)


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


# Distances, and what cannot be told from the truth


def distance(change: np.ndarray, columns: np.ndarray) -> float:
    """The least of max |change - columns x| over x."""
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
        found = linprog(np.append(np.zeros(wide), 1.0), np.vstack([up, down]), ends, bounds=limits, method=method)
        if found.success:
            return size * float(found.fun)
    raise ArithmeticError(found.message)


def as_near(change: np.ndarray, columns: np.ndarray, near: float) -> bool:
    """Whether columns come as near as that; least squares, never above, spare most programmes."""
    left = change - columns @ np.linalg.lstsq(columns, change, rcond=1e-10)[0]
    if np.abs(left).max() <= near:
        return True
    return float(np.sqrt(np.mean(left**2))) <= near and distance(change, columns) <= near


def carried(carriers: list[np.ndarray], functions: np.ndarray) -> np.ndarray:
    """Columns (3 N, K) of functions (N, k) times each carrier (N, 3)."""
    return np.hstack([(c[:, :, None] * functions[:, None, :]).reshape(-1, functions.shape[1]) for c in carriers])


def stands_with_pieces(known: Known, change: np.ndarray, pair: Pair, carriers: list[np.ndarray], count: int) -> bool:
    columns = np.hstack([known.model, carried(carriers, known.pieces(pair.quantity, count))])
    return as_near(change, columns, LIKE_TRUTH * SIGMA)


def stands_with_a_jump(known: Known, change: np.ndarray, pair: Pair, carriers: list[np.ndarray]) -> bool:
    """Whether a linear function with one jump stands for the change."""
    linear = np.hstack([known.model, carried(carriers, known.pieces(pair.quantity, 1))])
    return any(
        as_near(change, np.hstack([linear, carried(carriers, step[:, None])]), LIKE_TRUTH * SIGMA)
        for step in known.steps(pair.quantity).T
    )


def same_as(known: Known, fault: Fault, change: np.ndarray) -> tuple[int | None, list[Pair]]:
    """Pieces that the truth needs (None: a jump, or more than all of `PIECES`), and the pairs that stand for it."""
    every = dict(known.carriers())
    if fault.kind == "jump":
        return None, [fault.pair, *(p for p, c in every.items() if stands_with_a_jump(known, change, p, c))]
    if fault.pair not in every:
        return None, [fault.pair]
    for count in (count for count in PIECES if count <= len(known.n) // 2):
        if stands_with_pieces(known, change, fault.pair, every[fault.pair], count):
            return count, [p for p, c in every.items() if stands_with_pieces(known, change, p, c, count)]
    return None, [fault.pair]


def outside_case(folder: Path, seed: int, index: int) -> Outside:
    """Case `index` of a seed, one shape after the other, each time another bench; its record is in the folder."""
    shape = SHAPES[index % len(SHAPES)]
    for attempt in range(30):
        rng = np.random.default_rng([seed, index, attempt])
        count, multiple = int(rng.choice(COUNTS)), float(rng.uniform(1.2, 5.0))
        known = Known.of(Session.drawn(rng, count))
        fault, sign = shape(known, rng), float(rng.choice([-1.0, 1.0]))
        unit = known.change(fault)
        away = distance(unit, known.model)
        if away < 1e-6 * np.abs(unit).max():
            continue
        size = sign * multiple * 2.0 * SIGMA / away
        if abs(size) * np.abs(unit).max() > LARGEST:
            continue
        angles, reading = known.read(fault, size)
        path = folder / f"case{index:03d}.positions.csv"
        known.session.write(path, angles, reading + errors(rng, count)[0], rng)
        pieces, same = same_as(known, fault, size * unit)
        if fault.pair.quantity == "n3":
            same = [*same, replace(fault.pair, quantity="alpha")]
        told = list(dict.fromkeys((p.place, p.quantity, p.factor) for p in (fault.pair, *same)))
        pair = asdict(fault.pair)
        return Outside(
            path.name, shape.__name__, fault.kind, **pair, positions=count, multiple=multiple, size=size,
            pieces=pieces, same=told, also=fault.also,
        )  # fmt: skip
    raise AssertionError(f"{shape.__name__}, seed {seed}, case {index}: no bench shows it")


def main() -> None:
    """Write cases and their truth."""
    parser = argparse.ArgumentParser(description="Records with faults that are in no catalogue, and truth.json.")
    parser.add_argument("folder", type=Path)
    parser.add_argument("--cases", type=int, default=200)
    parser.add_argument("--seed", type=int, default=1)
    asked = parser.parse_args()
    asked.folder.mkdir(parents=True, exist_ok=True)
    cases = [asdict(outside_case(asked.folder, asked.seed, index)) for index in range(asked.cases)]
    (asked.folder / "truth.json").write_text(json.dumps(cases, indent=1) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
