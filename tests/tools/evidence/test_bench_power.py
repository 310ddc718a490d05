"""The power against faults outside the catalogue: equal to that of an independent programme, and true for records."""

import re
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.optimize import linprog

from generator import SIGMA
from generator.positions import Session, errors
from generator.unlisted import Known, carried
from trihedron.tools.calibration import calibrate
from trihedron.tools.diagnosis import diagnose
from trihedron.tools.evidence import PIECES, SECTORS, Pair
from trihedron.tools.evidence.power import LARGEST_INPUT, Power
from trihedron.tools.records import PositionRecord, read_record

PAIRS = ("accelerometer-2 n2", "accelerometer-1 n3", "accelerometer-3 alpha", "accelerometer-3 hours n3")
PAIRS += ("outer-axis alpha", "inner-axis beta tilt", "outer-axis hours")


def drawn(path: Path, seed: int, count: int) -> tuple[Known, PositionRecord]:
    """Return a session, and its record without errors."""
    rng = np.random.default_rng(seed)
    truth = Known.of(Session.drawn(rng, count))
    session = truth.session
    session.write(path, (session.alpha, session.beta), session.stand.readings(truth.n), rng)
    record = read_record(path)
    assert isinstance(record, PositionRecord)
    return truth, record


def class_of(truth: Known, pair: str) -> tuple[NDArray, NDArray]:
    """Return the effect of values at knots on readings (3 N, K), and the functions (K, d) that parameters imitate."""
    place, quantity, factor = (*pair.split(), "")[:3]
    values = truth.values({"hours": "time"}.get(quantity, quantity))
    if quantity in ("alpha", "beta"):
        knots = 2.0 * np.pi * np.arange(SECTORS) / SECTORS
        off = np.remainder(values[:, None] - knots + np.pi, 2.0 * np.pi) - np.pi
        hats = np.clip(1.0 - np.abs(off) * SECTORS / (2.0 * np.pi), 0.0, None)
    else:
        ends = (-LARGEST_INPUT, LARGEST_INPUT) if quantity[0] == "n" else (values.min(), values.max())
        knots = np.linspace(*ends, PIECES + 1)
        hats = np.array([np.interp(values, knots, unit) for unit in np.eye(len(knots))]).T
    if "axis" in place:
        turns = truth.unit_turns()
        outer = place == "outer-axis"
        carrier = turns[("kappa" if outer else "epsilon") if factor else ("outer" if outer else "inner")]
    else:
        p = int(place[-1]) - 1
        carrier = np.eye(3)[p] * (truth.n[:, [p]] if factor else np.ones_like(truth.n))
    imitated = [np.ones(len(knots))]
    if pair == "accelerometer-2 n2":
        imitated += [np.maximum(knots, 0.0), np.minimum(knots, 0.0)]
    elif pair == "accelerometer-1 n3":
        imitated += [knots]
    elif pair == "accelerometer-3 alpha":
        # n3 is cos α, with its own scale factor for each sign.
        imitated += [np.cos(knots), np.abs(np.cos(knots))]
    return carried([carrier], hats), np.array(imitated).T


def most_hidden(model: NDArray, columns: NDArray, imitated: NDArray) -> tuple[float, NDArray, NDArray]:
    """Return the greatest size that 2 σ hides, the values at the knots, and the parameters' part of them (3 N,)."""
    base = np.linalg.qr(imitated)[0]
    projection = np.eye(len(imitated)) - base @ base.T
    every = np.hstack([model, columns])
    scale = np.abs(every).max(axis=0)
    rows = np.vstack([every, -every]) / scale
    solutions = []
    for cost_row in projection:
        cost = -np.append(np.zeros(model.shape[1]), cost_row) / scale
        free = [(None, None)] * len(cost)
        solved = linprog(cost, rows, np.full(len(rows), 2.0), bounds=free, method="highs")
        assert solved.success
        solutions.append((-solved.fun * SIGMA, solved.x / scale * SIGMA))
    size, x = max(solutions, key=lambda cost_row: cost_row[0])
    return size, x[model.shape[1] :], every @ x


@pytest.mark.acceptance
def test_the_power_is_that_of_a_programme_that_shares_nothing(tmp_path: Path):
    truth, record = drawn(tmp_path / "r.csv", 5, 24)
    power = {
        " ".join((e["place"], e["quantity"], *filter(None, [e.get("factor")]))): e["size"]
        for e in diagnose(record, noise_bound=SIGMA).to_json()["power"]
    }
    for pair in PAIRS:
        assert power[pair] == pytest.approx(most_hidden(truth.model, *class_of(truth, pair))[0], rel=0.03), pair


@pytest.mark.parametrize("pair", ["accelerometer-2 n2", "outer-axis alpha"])
def test_a_fault_just_below_can_hide_and_one_just_above_never_does(pair: str, tmp_path: Path):
    path, rng = tmp_path / "r.csv", np.random.default_rng(0)
    truth, _ = drawn(path, 6, 24)
    columns, imitated = class_of(truth, pair)
    _, values, remaining = most_hidden(truth.model, columns, imitated)
    fault, hiding = (columns @ values).reshape(-1, 3), -0.5 * remaining.reshape(-1, 3)
    session = truth.session

    def verdict(share: float, noise: NDArray) -> str:
        reading = session.stand.readings(truth.n) + share * fault + noise
        session.write(path, (session.alpha, session.beta), reading, rng)
        record = read_record(path)
        assert isinstance(record, PositionRecord)
        return calibrate(record, noise_bound=SIGMA).verdict

    assert verdict(0.97, 0.97 * hiding) == "consistent"
    noises = [hiding, *(errors(rng, len(truth.n))[0] for _ in range(6))]
    assert {verdict(1.04, noise) for noise in noises} == {"falsified"}


@pytest.mark.acceptance
def test_no_size_is_sure_where_nothing_was_measured(tmp_path: Path):
    """Accelerometer 1 never senses more than half of g: its behaviour beyond is unknown."""
    truth, _ = drawn(tmp_path / "r.csv", 8, 60)
    low_input = np.abs(truth.n[:, 0]) < 0.5
    session, rng = truth.session, np.random.default_rng(1)
    part = Session(session.stand, *(getattr(session, k)[low_input] for k in ("alpha", "beta", "time_s", "temperature")))
    part.write(tmp_path / "p.csv", (part.alpha, part.beta), part.stand.readings(truth.n[low_input]), rng)
    record = read_record(tmp_path / "p.csv")
    assert isinstance(record, PositionRecord)
    result = diagnose(record, noise_bound=SIGMA)
    sizes = {(e["place"], e["quantity"]): e["size"] for e in result.power or () if "factor" not in e}
    assert sizes["accelerometer-1", "n1"] is None
    assert sizes["accelerometer-1", "beta"] is not None
    result.report(tmp_path / "page.html")
    cells = re.sub(r"<[^>]+>", " ", (tmp_path / "page.html").read_text(encoding="utf-8")).split()
    assert "own input inf" in " ".join(cells)


def test_what_only_a_fault_beyond_every_instrument_would_show_is_said_to_show_at_no_size():
    pair = Pair("accelerometer-1", "n1", np.linspace(-1.0, 1.0, 5), lambda hats: hats, "accelerometer-1")
    assert [Power(pair, size).entry["size"] for size in (0.5, 1.0, 690.0, np.inf)] == [0.5, 1.0, None, None]
