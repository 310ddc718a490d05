"""Metamorphic relations: changes of a record that do not change the result, or change it in a known way.

Each takes a table of a record and returns another one, with the options for it.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import polars as pl

CYCLE = np.roll(np.eye(3), 1, axis=1)
"""New axis 1 is the old 2, 2 the old 3, 3 the old 1: a rotation."""
QUARTER = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
READINGS = ["f1_mps2", "f2_mps2", "f3_mps2"]
Matrix = Mapping[str, Any]


@dataclass(frozen=True)
class Changed:
    """A record after a change: its table, its options, and the new number of each accelerometer."""

    table: pl.DataFrame
    options: Matrix = field(default_factory=dict)
    accelerometers: tuple[int, ...] = (1, 2, 3)


def named(matrix: np.ndarray) -> dict[str, Any]:
    """Return a mounting in the library's form."""
    return {"turned": matrix.tolist()}


def shifted(table: pl.DataFrame) -> Changed:
    """Set the clock later, by a number that costs no digits."""
    return Changed(table.with_columns(pl.col("time_s") + 4096.0))


def whole_turns(table: pl.DataFrame) -> Changed:
    """Continue the angles instead of restarting from zero."""
    return Changed(table.with_columns(pl.col("alpha_deg") + 360.0, pl.col("beta_deg") - 720.0))


def other_columns(table: pl.DataFrame) -> Changed:
    """Reorder the columns."""
    return Changed(table.select(table.columns[::-1]))


def stronger_gravity(table: pl.DataFrame) -> Changed:
    """Use a unit of readings that is a 64th larger, and gravity in it."""
    return Changed(table.with_columns(pl.col(READINGS) * (1.0 + 2.0**-6)), {"gravity": 9.80665 * (1.0 + 2.0**-6)})


def doubled(table: pl.DataFrame) -> Changed:
    """Write the last position twice, which adds no information."""
    again = table.tail(1).with_columns(pl.col("position") + 1, pl.col("time_s") + 20.0)
    return Changed(pl.concat([table, again]))


def another_order(table: pl.DataFrame) -> Changed:
    """Measure the positions in another order, without any dependence on order or time."""
    retained = table.select("position", "time_s")
    mixed = table.drop("position", "time_s").sample(fraction=1.0, shuffle=True, seed=1)
    return Changed(retained.hstack(mixed.select(c for c in mixed.columns if not c.startswith("approach"))))


def axes_renamed(table: pl.DataFrame) -> Changed:
    """Renumber the block's axes, and the mounting with them."""
    new = [pl.col(READINGS[k]).alias(READINGS[j]) for j, k in enumerate(np.argmax(CYCLE, axis=1))]
    return Changed(table.with_columns(new), {"mounting": named(CYCLE)}, (3, 1, 2))


def channels_renamed(table: pl.DataFrame) -> Changed:
    """Reorder and reverse the file's channels, with the option that corrects it."""
    new = [pl.col("f3_mps2").alias("f1_mps2"), -pl.col("f1_mps2").alias("f2_mps2"), pl.col("f2_mps2").alias("f3_mps2")]
    return Changed(table.with_columns(new), {"channels": ("-2,3,1",)})


def base_turned(table: pl.DataFrame) -> Changed:
    """Count the inner axis from another mark, a quarter of a turn off, and adapt the mounting."""
    return Changed(table.with_columns(pl.col("beta_deg") - 90.0), {"mounting": named(_inner_turn(90.0))})


def two_mountings(table: pl.DataFrame) -> Changed:
    """Return one record joined from two: the block was taken off and put back between them."""
    half = pl.when(pl.int_range(pl.len()) < pl.len() // 2).then(pl.lit("a")).otherwise(pl.lit("b"))
    pair = {"a": np.eye(3).tolist(), "b": np.eye(3).tolist()}
    return Changed(table.with_columns(half.alias("mounting")), {"mounting": pair})


def _inner_turn(degrees: float) -> np.ndarray:
    """Return the mounting that keeps the block's attitude when the inner axis's angle is smaller by these degrees."""
    from trihedron.models.bench import nominal_input

    alpha, beta = np.radians([10.0, 50.0, 200.0, 300.0]), np.radians([20.0, 110.0, 240.0, 30.0])
    before = nominal_input(alpha, beta, np.eye(3))
    for turn in (QUARTER, QUARTER.T):
        if np.allclose(nominal_input(alpha, beta - np.radians(degrees), turn), before, atol=1e-12):
            return turn
    raise AssertionError("the inner axis is not the third of the block")


Change = Callable[[pl.DataFrame], Changed]
EXACT: dict[str, Change] = {
    "time shifted": shifted,
    "columns in another order": other_columns,
    "channels renamed": channels_renamed,
}
"""Changes that leave the result the same, number by number."""
SAME: dict[str, Change] = {
    "angles of whole turns more": whole_turns,
    "another unit of force": stronger_gravity,
    "a position doubled": doubled,
    "positions permuted": another_order,
    "base turned with the mounting": base_turned,
}
"""Changes that leave the result the same except for rounding."""


def differences(one: Any, other: Any, tolerance: float, path: str = "") -> list[str]:
    """Return the differences of two plain values beyond the relative `tolerance`."""
    if isinstance(one, dict) and isinstance(other, dict):
        keys = sorted({*one, *other})
        return [d for k in keys for d in differences(one.get(k), other.get(k), tolerance, f"{path}.{k}")]
    if isinstance(one, list) and isinstance(other, list) and len(one) == len(other):
        pairs = enumerate(zip(one, other, strict=True))
        return [d for k, (a, b) in pairs for d in differences(a, b, tolerance, f"{path}[{k}]")]
    if isinstance(one, float) and isinstance(other, float):
        near = abs(one - other) <= tolerance * max(abs(one), abs(other))
        return [] if near or one == other else [f"{path}: {one} and {other}"]
    return [] if one == other else [f"{path}: {one} and {other}"]
