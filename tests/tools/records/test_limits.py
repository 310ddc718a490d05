"""Channels at their limit: found in drawn motions with every kind of noise and step, and never in sound records."""

from dataclasses import dataclass
from typing import Any

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from generator import G
from generator.carried import POSES, true_motion
from record_files import measured
from trihedron.tools.records import RawRecord, StrapdownRecord, channel_limits

PERIOD = 0.01
KINDS = {
    "exact": (0.0, 0.0),
    "written": (0.0, 1e-5),
    "noisy": (3e-3, 1e-8),
    "steps": (2e-3, 2e-3),
    "coarse": (3e-4, 2e-3),
}
"""Noise of the readings and their step, both as a part of the largest one."""


@dataclass(frozen=True)
class Drawn:
    """Readings of gyros and accelerometers (N, 3) before noise and steps, and their description."""

    rng: np.random.Generator
    kind: str
    rate: np.ndarray
    force: np.ndarray

    def record(
        self, limit: np.ndarray | None = None, least: np.ndarray | None = None, hold: int = 1
    ) -> StrapdownRecord:
        """Return the record; gyros within `least` and `limit` (3,), every reading repeated `hold` times."""
        rate, force = self.noisy(self.rate), self.noisy(self.force)
        limit = np.full(3, np.inf) if limit is None else limit
        rate = self.stepped(np.clip(rate, -limit if least is None else least, limit), self.rate)
        rows = np.arange(len(rate)) // hold * hold
        force = self.stepped(force, self.force)
        return StrapdownRecord(PERIOD * np.arange(len(rate)), rate[rows], None, force[rows])

    def noisy(self, values: np.ndarray) -> np.ndarray:
        return values + KINDS[self.kind][0] * np.abs(values).max() * self.rng.standard_normal(values.shape)

    def stepped(self, values: np.ndarray, of: np.ndarray) -> np.ndarray:
        step = KINDS[self.kind][1] * np.abs(of).max()
        return step * np.round(values / step) if step else values


def gravity_along(rng: np.random.Generator, rate: np.ndarray) -> np.ndarray:
    """Return the readings of accelerometers while the block turns (N, 3) [m/s²]."""
    up = rng.standard_normal(3)
    up /= np.linalg.norm(up)
    components = []
    for turn in Rotation.from_rotvec(-PERIOD * rate).as_matrix():
        components.append(up)
        up = turn @ up
    return G * np.array(components)


def smooth_motion(seed: int, kind: str, count: int = 3000) -> Drawn:
    """Return gyros that read a few sines each, 0.05 to 2 Hz."""
    rng = np.random.default_rng([seed, *map(ord, kind)])
    time, rate = PERIOD * np.arange(count), np.zeros((count, 3))
    for axis in range(3):
        for _ in range(rng.integers(1, 5)):
            frequency = np.exp(rng.uniform(np.log(0.05), np.log(2.0)))
            rate[:, axis] += rng.uniform(0.3, 1.0) * np.sin(2.0 * np.pi * frequency * time + rng.uniform(0.0, 7.0))
    return Drawn(rng, kind, rate, gravity_along(rng, rate))


def table_motion(seed: int, kind: str, count: int = 5000) -> Drawn:
    """Return a table at constant rates, with straight or soft ramps between them, about one axis or two."""
    rng = np.random.default_rng([seed, *map(ord, kind)])

    def profile() -> np.ndarray:
        top, level, rate = rng.uniform(0.2, 3.0), 0.0, [np.zeros(int(rng.integers(300)))]
        while sum(map(len, rate)) < count:
            new, ramp = rng.choice([0.0, top, top, -top]), int(rng.integers(0, 150))
            s = np.linspace(0.0, 1.0, ramp + 2)[1:-1]
            s = s if seed % 2 else 0.5 - 0.5 * np.cos(np.pi * s)
            rate += [level + (new - level) * s, np.full(int(rng.integers(100, 1500)), new)]
            level = new
        return np.concatenate(rate)[:count]

    outer, inner, rate = profile(), profile(), np.zeros((count, 3))
    if seed % 4 < 2:
        rate[:, int(rng.integers(3))] = outer
    else:
        angle = PERIOD * np.cumsum(inner)
        rate = np.stack([outer * np.sin(angle), outer * np.cos(angle), inner], axis=1)
    still = np.tile([0.0, 0.0, G], (count, 1))
    return Drawn(rng, kind, rate, gravity_along(rng, rate) if rng.random() < 0.7 else still)


def moves_by_hand(seed: int, kind: str) -> Drawn:
    """Return moves between rests; the gyros of every second record turn in one sense alone."""
    rng = np.random.default_rng([seed, *map(ord, kind)])
    _, rate, n = true_motion(POSES[rng.permutation(len(POSES))], rng.uniform(0.5, 3.0), rng.uniform(0.7, 3.0))
    return Drawn(rng, kind, np.abs(rate) if seed % 2 else rate, G * n)


@pytest.mark.first(1)
@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("motion", [smooth_motion, table_motion, moves_by_hand])
def test_no_sound_record_has_a_limit(motion, kind):
    """Rests, constant rates, plateaus of coarse steps and repeated samples are not limits."""
    for seed in range(12):
        record = motion(seed, kind).record(hold=1 + seed // 4 % 2)
        assert channel_limits(record).lines == [], seed


@pytest.mark.first(1)
@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("side", ["largest", "least", "both"])
def test_a_clipped_gyro_is_found_and_no_other_channel_is(kind, side):
    """All its rows at the limit are found, on the clipped side alone; few are missed at steps of 2e-3 of the motion."""
    missed = 0
    for seed in range(16):
        drawn = smooth_motion(100 + seed, kind)
        axis = seed % 3
        values, limit, least = drawn.rate[:, axis], np.full(3, np.inf), np.full(3, -np.inf)
        room = drawn.rng.uniform(0.6, 0.9)
        if side != "least":
            limit[axis] = room * values.max()
        if side != "largest":
            least[axis] = room * values.min()
        if side == "both":
            limit[axis], least[axis] = (sign * min(limit[axis], -least[axis]) for sign in (1.0, -1.0))
        record: Any = drawn.record(limit, least)
        limits = channel_limits(record)
        assert limits.rows.keys() <= {f"w{axis + 1}"}, seed
        missed += not limits.rows
        for mask in limits.rows.values():
            clipped = np.zeros(len(record), dtype=bool)
            for extreme, used in (
                (record.rate[:, axis].max(), side != "least"),
                (record.rate[:, axis].min(), side != "largest"),
            ):
                clipped |= used & (record.rate[:, axis] == extreme)
            assert not (mask & ~clipped).any()
            assert side == "both" or np.array_equal(mask, clipped)
    assert missed <= (5 if kind in ("coarse", "steps") else 0)


@pytest.mark.parametrize(("rows", "is_limit"), [(1, False), (2, False), (4, True), (5, True)])
def test_a_few_rows_in_a_row_are_a_limit_where_noise_does_not_repeat(rows, is_limit):
    """A shock is clipped once; two equal rows may be chance."""
    for seed in range(6):
        record = smooth_motion(200 + seed, "noisy").record()
        rate = np.array(record.rate)
        rate[1200 : 1200 + rows, 1] = -1.2 * np.abs(rate[:, 1]).max()
        limits = channel_limits(StrapdownRecord(record.time_s, rate, None, record.specific_force))
        assert {name: np.flatnonzero(mask).tolist() for name, mask in limits.rows.items()} == (
            {"w2": list(range(1200, 1200 + rows))} if is_limit else {}
        )


@pytest.mark.parametrize("jitter", [0.0, 2e-4])
def test_increments_are_judged_as_they_were_measured(jitter):
    """Over logged times that jitter equal increments give different rates."""
    drawn = smooth_motion(7, "exact")
    record: Any = drawn.record(0.8 * np.abs(drawn.rate).max(axis=0))
    time = record.time_s + np.random.default_rng(0).uniform(-jitter, jitter, len(record))
    summed = StrapdownRecord(time, None, PERIOD * record.rate, record.specific_force)
    limits = channel_limits(summed)
    assert limits.rows.keys() == channel_limits(record).rows.keys() != set()
    assert all(" rad, " in line for line in limits.lines)


def test_an_accelerometer_at_its_limit_in_one_rest_is_found_in_strapdown_and_raw_records():
    """Noise is absent there, and present in every other rest."""
    drawn = moves_by_hand(2, "noisy")
    record = drawn.record()
    force = np.clip(record.specific_force, -0.8 * G, 0.8 * G)
    for limited in (
        StrapdownRecord(record.time_s, record.rate, None, force),
        RawRecord(record.time_s, np.zeros(len(record)), np.zeros(len(record)), force),
    ):
        assert channel_limits(limited).rows.keys() == {"f1", "f2", "f3"}
        assert "saturated, at -7.84532 and 7.84532 m/s²" in channel_limits(limited).lines[0]


def test_dead_channels_and_channels_of_few_values_have_no_limit():
    rate = np.zeros((400, 3))
    rate[:, 1], rate[:, 2] = np.sign(np.sin(np.arange(400))), np.round(3.0 * np.sin(0.02 * np.arange(400)))
    assert channel_limits(StrapdownRecord(PERIOD * np.arange(400), rate, None, rate[:, ::-1])).lines == []


@pytest.mark.first(2)
@pytest.mark.parametrize("name", ["broad-03", "broad-21", "mpu9150-0", "mpu9150-1", "mpu9150-2", "xsens-imu-tk"])
def test_no_measured_record_has_a_limit(name):
    assert channel_limits(measured(name)).lines == []


def test_a_limit_in_a_measured_record_is_found():
    """Accelerometers have steps of 1e-4 g and gyros of 1/16 deg/s."""
    record: Any = measured("mpu9150-0")
    rate = np.clip(record.rate, None, 0.6 * record.rate.max(axis=0))
    step = 0.0625 * np.pi / 180.0
    rate = np.where(rate < record.rate, step * np.floor(rate / step), rate)
    hurt = StrapdownRecord(record.time_s, rate, None, record.specific_force)
    assert channel_limits(hurt).rows.keys() == {"w1", "w2", "w3"}
