"""Draws of everyday faults of a laboratory, each with the answer that a diagnosis should give."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from generator import SIGMA
from generator.broken import broken_record, two_things
from generator.effects import Sized
from generator.positions import Session, errors
from generator.wrong_pieces import OF_MOVES, OF_RESTS, with_wrong_piece
from generator.wrong_rows import SPOILED, with_wrong_rows, with_wrong_stretch
from trihedron.models.effects import EffectPlace

COUNTS = (24, 36, 48, 60)
EFFECTS: Sequence[Sized] = (
    (EffectPlace("quadratic", "accelerometer-1"), (2e-4,)),
    (EffectPlace("cross-product", "accelerometer-3", axes=(1, 2)), (-2e-4,)),
    (EffectPlace("cubic", "accelerometer-2"), (6e-4,)),
)
"""Effects beside a fault, and their sizes."""
LISTED = {"bias": "bias-step", "scale factor": "scale-step", "mounting": "mounting-slip"}
"""Breaks that the catalogue names."""


@dataclass(frozen=True)
class Fault:
    """A record with a fault, and the test of an answer: true of an explanation that names the fault.

    `stands`: the record is consistent, and a warning names this.
    """

    record: Any
    names: Callable[[Any], bool]
    options: dict[str, Any]
    stands: str = ""


def by_rows(record: Any, rows: tuple[int, ...], kind: str, beside: EffectPlace | None = None) -> Fault:
    """Return a fault that an answer names by its rows, and by the effect beside it."""

    def names(explanation: Any) -> bool:
        places = {cause.place for cause in explanation.causes}
        is_beside = beside is None or beside in places
        return explanation.kind == kind and explanation.rows == rows and is_beside

    return Fault(record, names, {"noise_bound": SIGMA})


def wrong_rows(rng: np.random.Generator, count: int) -> Fault:
    """One to three wrong rows."""
    what = str(rng.choice(list(SPOILED)))
    wrong = with_wrong_rows(int(rng.integers(1_000_000)), what, count, int(rng.integers(1, 4)))
    return by_rows(wrong.record, wrong.rows, "rows")


def wrong_readings(rng: np.random.Generator, count: int) -> Fault:
    """Two wrong readings of different accelerometers."""
    session = Session.drawn(rng, count)
    angles, reading = session.read((), errors(rng, count)[0])
    rows, channels = np.sort(rng.choice(count, 2, replace=False)), rng.choice(3, 2, replace=False)
    reading[rows, channels] += SIGMA * rng.choice([-1.0, 1.0], 2) * rng.uniform(10.0, 30.0, 2)
    return by_rows(session.recorded(angles, reading), tuple((rows + 1).tolist()), "rows")


def exchanged_stretch(rng: np.random.Generator, count: int) -> Fault:
    """Two channels exchanged over four rows up to a fifth of all."""
    wrong = with_wrong_stretch(
        int(rng.integers(1_000_000)),
        "channels exchanged",
        max(count, 36),
        int(rng.integers(4, max(count, 36) // 5 + 1)),
    )
    return by_rows(wrong.record, wrong.rows, "stretch")


def disturbed_stretch(rng: np.random.Generator, count: int) -> Fault:
    """Disturb four rows in a row, and more."""
    wrong = with_wrong_stretch(
        int(rng.integers(1_000_000)), "disturbed", max(count, 36), int(rng.integers(4, max(count, 36) // 5 + 1))
    )
    return by_rows(wrong.record, wrong.rows, "stretch")


def one_break(rng: np.random.Generator, count: int) -> Fault:
    """One change of bench or block."""
    group = str(rng.choice(["bias", "outer zero", "inner zero", "biases", "mounting", "scale factors", "common scale"]))
    broken = broken_record(int(rng.integers(1_000_000)), group, count, 8.0)

    def names(explanation: Any) -> bool:
        if explanation.kind == "break":
            return abs(explanation.before_row - broken.before_row) <= 1
        return [cause.effect for cause in explanation.causes] == [LISTED.get(group)]

    return Fault(broken.record, names, {"noise_bound": SIGMA})


def by_break(two: Any, beside: EffectPlace | None = None, rows: tuple[int, ...] | None = None, again: int = 0) -> Fault:
    """Return a fault that an answer names by a break, and an effect, rows, or a second break."""

    def names(explanation: Any) -> bool:
        if explanation.kind != "break" or abs(explanation.before_row - two.before_row) > 1:
            return False
        if beside is not None and beside not in {cause.place for cause in explanation.causes}:
            return False
        later = any(f"_from_row_{again + shift}" in key for key in explanation.change for shift in (-1, 0, 1))
        return explanation.rows == rows and (later or not again)

    return Fault(two.record, names, {"noise_bound": SIGMA})


def two_breaks(rng: np.random.Generator, count: int) -> Fault:
    """Two changes at different times."""
    groups = [("bias", "bias"), ("outer zero", "biases"), ("inner zero", "bias"), ("common scale", "outer zero")]
    two = two_things(int(rng.integers(1_000_000)), groups[int(rng.integers(4))], count)
    return by_break(two, again=two.further_row)


def break_and_effect(rng: np.random.Generator, count: int) -> Fault:
    """A break beside an effect."""
    place, size = EFFECTS[int(rng.integers(len(EFFECTS)))]
    group = str(rng.choice(["biases", "outer zero", "inner zero"]))
    return by_break(two_things(int(rng.integers(1_000_000)), (group,), max(count, 36), ((place, size),)), beside=place)


def break_and_row(rng: np.random.Generator, count: int) -> Fault:
    """A break beside a disturbed row."""
    group = str(rng.choice(["biases", "outer zero", "bias"]))
    two = two_things(int(rng.integers(1_000_000)), (group,), max(count, 36), wrong_row=True)
    return by_break(two, rows=(two.further_row,))


def row_and_effect(rng: np.random.Generator, count: int) -> Fault:
    """A wrong row beside an effect."""
    place, size = EFFECTS[int(rng.integers(len(EFFECTS)))]
    what = str(rng.choice(["angle", "sign", "disturbed", "angles exchanged"]))
    wrong = with_wrong_rows(int(rng.integers(1_000_000)), what, max(count, 36), 1, ((place, size),))
    return by_rows(wrong.record, wrong.rows, "rows", place)


def turned_block(rng: np.random.Generator, count: int) -> Fault:
    """A fixture that bends."""
    place = EffectPlace("fixture-flexure", "mounting", axes=(int(rng.integers(1, 3)), int(rng.integers(1, 4))))
    session = Session.drawn(rng, count)
    size = float(rng.choice([-1.0, 1.0]) * rng.uniform(8e-5, 1.5e-4))
    record = session.record([(place, (size,))], errors(rng, count)[0])

    def names(explanation: Any) -> bool:
        every = {cause.place for cause in explanation.causes}
        for cause in explanation.causes:
            every |= set(cause.alike)
        return place in every

    return Fault(record, names, {"noise_bound": SIGMA})


def small_bound(rng: np.random.Generator, count: int) -> Fault:
    """A noise bound 1.4 to 1.8 times too small."""
    record = Session.drawn(rng, count).record((), SIGMA * rng.uniform(-1.0, 1.0, (count, 3)))
    bound = SIGMA / float(rng.uniform(1.4, 1.8))
    return Fault(record, lambda explanation: explanation.kind == "sigma", {"noise_bound": bound})


def coarse_encoder(rng: np.random.Generator, count: int) -> Fault:
    """Encoders that read in steps of 0.1°, 1' or 0.01°."""
    session = Session.drawn(rng, count)
    alpha, beta = rng.uniform(0.0, 2.0 * np.pi, (2, count))
    session = replace(session, alpha=alpha, beta=beta)
    angles, reading = session.read((), errors(rng, count)[0])
    step = float(rng.choice([0.1, 1.0 / 60.0, 0.01]))
    record = session.recorded(np.radians(step * np.round(np.degrees(angles) / step)), reading)
    return Fault(record, lambda _: False, {"noise_bound": SIGMA}, "the angles are in steps of")


def wrong_rest(rng: np.random.Generator, count: int) -> Fault:
    """A wrong rest of a block moved by hand."""
    return by_piece("rest", str(rng.choice(list(OF_RESTS))), rng)


def wrong_move(rng: np.random.Generator, count: int) -> Fault:
    """A wrong move of a block moved by hand."""
    return by_piece("move", str(rng.choice(list(OF_MOVES))), rng)


def by_piece(kind: str, what: str, rng: np.random.Generator) -> Fault:
    """Return a fault that an answer names by its piece."""
    wrong = with_wrong_piece(int(rng.integers(1_000_000)), kind, what, int(rng.choice([14, 18, 24])))
    label = (f"{wrong.kind}-{wrong.number}",)
    return Fault(wrong.record, lambda explanation: (explanation.kind, explanation.where) == ("rows", label), {})


FAULTS: dict[str, Callable[[np.random.Generator, int], Fault]] = {
    "rows": wrong_rows,
    "readings": wrong_readings,
    "stretch exchanged": exchanged_stretch,
    "stretch disturbed": disturbed_stretch,
    "break": one_break,
    "two breaks": two_breaks,
    "break and effect": break_and_effect,
    "break and row": break_and_row,
    "row and effect": row_and_effect,
    "turn of the block": turned_block,
    "σ too small": small_bound,
    "coarse encoder": coarse_encoder,
    "rest": wrong_rest,
    "move": wrong_move,
}


def drawn_fault(seed: int, kind: str) -> Fault:
    """Return a fault of a kind, of 24 to 60 positions."""
    rng = np.random.default_rng([seed, list(FAULTS).index(kind)])
    return FAULTS[kind](rng, int(rng.choice(COUNTS)))


def outcome_of(fault: Fault, diagnosis: Any) -> str:
    """Return how a diagnosis answers: "right", "among others", "nothing" or "wrong"."""
    if fault.stands:
        named = diagnosis.verdict == "consistent" and any(fault.stands in line for line in diagnosis.warnings)
        return "right" if named else ("wrong" if diagnosis.verdict == "explained" else "nothing")
    names = [fault.names(explanation) for explanation in diagnosis.explanations]
    if diagnosis.verdict == "explained":
        return "right" if names[0] else "wrong"
    return "among others" if any(names) else "nothing"
