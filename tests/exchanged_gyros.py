"""Records of a carried block with true attitude, right and with an effect beside, for gyros that are exchanged.

Motion, attitude and readings are those of `strapdown_records`, which shares nothing with the product.
"""

import numpy as np

from strapdown_records import G, drawn_motion, seen_attitude
from trihedron.tools.records import StrapdownRecord

EFFECTS = ("scale", "bias-drift", "sensitivity", "lag", "quadratic", "step", "quantisation", "gap")


def seen_record(seed: int, effect: str = "", *, moves: int = 16) -> StrapdownRecord:
    """A block moved from rest to rest, as cameras see it in some rows or all; an effect of ten times the noise."""
    rng = np.random.default_rng([3, seed])
    time, rate, n, attitude = drawn_motion(rng, moves)
    p, size = int(rng.integers(3)), float(rng.choice([-1.0, 1.0]))
    gyros = rate @ (np.eye(3) + rng.normal(0.0, 3e-3, (3, 3))).T + rng.normal(0.0, 0.01, 3)
    added = {
        "scale": 0.02 * rate[:, p],
        "bias-drift": 0.01 * time / time[-1],
        "sensitivity": 0.01 * n[:, (p + 1) % 3],
        "quadratic": 0.01 * rate[:, p] ** 2,
        "step": 0.01 * (time > rng.uniform() * time[-1]),
    }
    gyros[:, p] += size * added.get(effect, np.zeros(len(time)))
    if effect == "lag":
        gyros = np.roll(gyros, 3, axis=0)
    if effect == "quantisation":
        gyros = 0.01 * np.round(gyros / 0.01)
    gyros += 1e-3 * rng.standard_normal(gyros.shape)
    block = np.eye(3) + np.tril(rng.normal(0.0, 5e-3, (3, 3)))
    force = G * (n @ block.T + rng.normal(0.0, 5e-3, 3)) + 0.01 * rng.standard_normal(n.shape)
    seen = seen_attitude(rng, attitude, 10.0 ** rng.uniform(-4.0, -2.5))
    seen[np.arange(len(time)) % int(rng.choice([1, 1, 4, 10])) != 0] = np.nan
    kept = np.ones(len(time), dtype=bool)
    if effect == "gap":
        kept[len(time) // 3 : len(time) // 3 + 40] = False
    return StrapdownRecord(time[kept], gyros[kept], None, force[kept], seen[kept])
