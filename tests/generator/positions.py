"""Records of a table's positions: sessions at a stand, with effects of the catalogue and without, and their files."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from generator import SIGMA, G
from generator.effects import Sized, Visits, axes_off, encoders_off, last_stage, readings_added, slipped
from generator.stands import Stand, record
from trihedron.tools.records import PositionRecord, write_record

COLUMNS = "position,time_s,alpha_deg,beta_deg,f1_mps2,f2_mps2,f3_mps2,temperature_degC,approach_alpha,approach_beta"
FORMATS = ("%d", "%.1f", "%.9f", "%.9f", "%.9f", "%.9f", "%.9f", "%.4f", "%d", "%d")


@dataclass(frozen=True)
class Session:
    """A stand with its visits: true readings of the encoders [rad], times [s], temperatures, (N,) each."""

    stand: Stand
    alpha: np.ndarray
    beta: np.ndarray
    time_s: np.ndarray
    temperature: np.ndarray

    @staticmethod
    def drawn(rng: np.random.Generator, count: int) -> "Session":
        """Draw positions anywhere; the temperature swings and drifts."""
        stand = Stand.drawn(rng)
        alpha, beta = np.radians(np.round(rng.uniform(0.0, 360.0, (2, count)), 3))
        time_s = np.round(np.cumsum(rng.uniform(40.0, 80.0, count)) * rng.choice([1.0, 3.0]), 1)
        part = (time_s - time_s[0]) / (time_s[-1] - time_s[0])
        wave = np.sin(2.0 * np.pi * (rng.uniform(0.3, 1.5) * part + rng.uniform()))
        temperature = np.round(20.0 + rng.uniform(1.0, 6.0) * wave + rng.uniform(-3.0, 3.0) * part, 4)
        return Session(stand, alpha, beta, time_s, temperature)

    @staticmethod
    def planned(stand: Stand, alpha: np.ndarray, beta: np.ndarray) -> "Session":
        """Return a session with a position every 10 s; the temperature swings once in ten minutes."""
        time_s = 10.0 * np.arange(1, len(alpha) + 1)
        temperature = np.round(20.0 + 4.0 * np.sin(2.0 * np.pi * time_s / 600.0), 4)
        return Session(stand, alpha, beta, time_s, temperature)

    @property
    def hours(self) -> np.ndarray:
        """Time since the first row [h]."""
        return (self.time_s - self.time_s[0]) / 3600.0

    @property
    def senses(self) -> np.ndarray:
        """Sense (N, 2) of the last move of each axis."""
        moves = np.diff(np.stack([self.alpha, self.beta], axis=1), axis=0, prepend=-1.0)
        senses = np.sign(moves)
        for row in range(1, len(senses)):
            senses[row] = np.where(senses[row] == 0.0, senses[row - 1], senses[row])
        return senses

    def visits(self, n: np.ndarray) -> Visits:
        """Return the circumstances of effects at inputs (N, 3)."""
        offset = self.stand.alpha_error + self.stand.alpha_star, self.stand.beta_error
        angles = np.stack([self.alpha, self.beta], axis=1) - offset
        return Visits(angles, n, self.hours, self.temperature, self.senses)

    def read(self, hidden: Sequence[Sized] = (), error: Any = 0.0) -> tuple[np.ndarray, np.ndarray]:
        """Return encoder angles (N, 2) [rad] and readings (N, 3) [g], with effects and errors (N, 3)."""
        blind = self.visits(np.zeros((len(self.alpha), 3)))
        off = axes_off(blind, hidden)
        tilted = replace(
            self.stand,
            kappa=self.stand.kappa + off[:, 0],
            epsilon=self.stand.epsilon + off[:, 2],
            theta=slipped(self.visits(self.stand.inputs(self.alpha, self.beta)), self.stand.theta, hidden),
        )
        n = tilted.inputs(self.alpha + off[:, 1], self.beta + off[:, 3])
        angles = np.stack([self.alpha, self.beta], axis=1) + encoders_off(blind, hidden)
        visits = self.visits(n)
        reading = self.stand.readings(n) + readings_added(visits, hidden) + error
        return angles, last_stage(visits, self.stand.own(n), reading, hidden)

    def record(self, hidden: Sequence[Sized] = (), error: Any = 0.0) -> PositionRecord:
        """Return the record with effects and errors (N, 3) [g]."""
        angles, reading = self.read(hidden, error)
        return self.recorded(angles, reading)

    def recorded(self, angles: np.ndarray, reading: np.ndarray) -> PositionRecord:
        """Return the record of readings (N, 3) [g] at angles (N, 2) [rad] of the encoders."""
        return replace(
            record(reading, *angles.T),
            time_s=self.time_s,
            temperature=self.temperature,
            approach_alpha=self.senses[:, 0],
            approach_beta=self.senses[:, 1],
        )

    def write(
        self, path: Path, angles: tuple[np.ndarray, np.ndarray], reading: np.ndarray, rng: np.random.Generator
    ) -> None:
        """Write a record of readings (N, 3) [g] at encoder angles; senses of approach are drawn."""
        senses = rng.choice([-1, 1], (2, len(reading)))
        degrees = np.degrees(np.stack(angles, axis=1))
        number = np.arange(1, len(reading) + 1)
        columns = [number, self.time_s, degrees, G * reading, self.temperature, senses.T]
        np.savetxt(path, np.column_stack(columns), FORMATS, ",", header=COLUMNS, comments="", encoding="utf-8")


def standard_positions() -> tuple[np.ndarray, np.ndarray]:
    """Return angles (40,) each [rad]: 24 with all signs certain, 16 between them that share no angle."""
    pairs = []
    for k in range(8):
        for beta in (25, 145, 265):
            pairs.append((20 + 45 * k, beta))
    for k in range(16):
        pairs.append(((13 + 67 * k) % 360, (33 + 101 * k) % 360))
    alpha, beta = np.radians(np.array(pairs, dtype=float)).T
    return alpha, beta


def hidden_record(
    seed: int, place: Any = None, sizes: Sequence[float] = (), *, symmetric: bool = False
) -> PositionRecord:
    """Return the standard positions in random order, with one effect or none; errors are uniform within σ."""
    rng = np.random.default_rng(seed)
    session = standard_session(rng, symmetric=symmetric)
    hidden = [] if place is None else [(place, sizes)]
    return session.record(hidden, rng.uniform(-SIGMA, SIGMA, (40, 3)))


def drawn_record(
    seed: int,
    hidden: Sequence[Sized] = (),
    count: int = 30,
    *,
    at_bound: bool = False,
    exact: bool = False,
    temperature: bool = False,
    symmetric: bool = False,
) -> PositionRecord:
    """Return positions anywhere, every 10 s, with effects; errors are uniform within σ, or at it, or none."""
    rng = np.random.default_rng([seed, count])
    stand = Stand.drawn(rng)
    if symmetric:
        stand = replace(stand, minus=stand.plus)
    session = Session.planned(stand, *np.radians(np.round(rng.uniform(0.0, 360.0, (2, count)), 3)))
    error = rng.uniform(-SIGMA, SIGMA, (count, 3))
    if at_bound:
        error = SIGMA * np.sign(error)
    record = session.record(hidden, 0.0 * error if exact else error)
    return record if temperature else replace(record, temperature=None)


Law = Callable[[Visits], np.ndarray]
"""The change (N,) at visits."""


def record_with(
    seed: int | Sequence[int],
    faults: Mapping[str, Law],
    count: int = 36,
    *,
    larger: float = 1.0,
    temperature: Callable[[np.ndarray], np.ndarray] | None = None,
) -> PositionRecord:
    """Return a record of a drawn session with errors of readings f1 to f3 [g], or encoders alpha and beta [rad].

    `larger` multiplies the errors that σ allows; `temperature` is a function of the part of the time from 0 to 1.
    """
    rng = np.random.default_rng(seed)
    session = Session.drawn(rng, count)
    if temperature is not None:
        session = replace(session, temperature=np.round(temperature(session.hours / session.hours[-1]), 4))
    n = session.stand.inputs(session.alpha, session.beta)
    visits, reading = session.visits(n), session.stand.readings(n) + larger * errors(rng, count)[0]
    angles = np.stack([session.alpha, session.beta], axis=1)
    for target, fault in faults.items():
        if target[0] == "f":
            reading[:, int(target[1]) - 1] += fault(visits)
        else:
            angles[:, int(target == "beta")] += fault(visits)
    return session.recorded(angles, reading)


def standard_session(rng: np.random.Generator, *, symmetric: bool = False) -> Session:
    """Return a stand at the standard positions in random order."""
    stand = Stand.drawn(rng)
    if symmetric:
        stand = replace(stand, minus=stand.plus)
    alpha, beta = standard_positions()
    order = rng.permutation(len(alpha))
    return Session.planned(stand, alpha[order], beta[order])


def of_one_instrument(
    seed: int,
    count: int = 3,
    *,
    positions: int = 24,
    shared: Sequence[Sized] = (),
    own: Mapping[int, Sequence[Sized]] | None = None,
) -> list[PositionRecord]:
    """Return records of one block; bias, mounting and table change daily; effects in all, and in some by number."""
    rng = np.random.default_rng(seed)
    block = Stand.drawn(rng)
    records = []
    for day in range(count):
        stand = replace(Stand.drawn(rng), gamma=block.gamma, plus=block.plus, minus=block.minus, gravity_error=0.0)
        alpha, beta = np.radians(np.round(rng.uniform(0.0, 360.0, (2, positions)), 1))
        session = Session.planned(stand, alpha, beta)
        hidden = [*shared, *(own or {}).get(day, ())]
        records.append(session.record(hidden, rng.uniform(-SIGMA, SIGMA, (positions, 3))))
    return records


def errors(rng: np.random.Generator, count: int) -> tuple[np.ndarray, str]:
    """Return errors (N, 3) [g] within σ, and their distribution: uniform, Gaussian within it, or at it."""
    error = rng.uniform(-SIGMA, SIGMA, (count, 3))
    shape = str(rng.choice(["uniform", "gaussian", "bound"], p=[0.5, 0.3, 0.2]))
    if shape == "gaussian":
        error = np.clip(rng.normal(0.0, SIGMA / 2.5, (count, 3)), -SIGMA, SIGMA)
    if shape == "bound":
        error = SIGMA * rng.choice([-1.0, 1.0], (count, 3))
    return error, shape


def write_hidden_record(
    path: Path, seed: int, place: Any = None, sizes: Sequence[float] = (), *, symmetric: bool = False
) -> None:
    """Write a `hidden_record`."""
    write_record(hidden_record(seed, place, sizes, symmetric=symmetric), path)
