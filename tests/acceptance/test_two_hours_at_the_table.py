"""Two hours at 100 Hz: memory does not grow, and a resumed session is the same."""

from pathlib import Path

import numpy as np
import pytest

from simulated_table import HEADER, text_of
from trihedron.models.bench import nominal_input
from trihedron.tools.measure import Measurement, SessionOptions, read_programme

pytestmark = pytest.mark.acceptance

POSITIONS = [(a, b) for a in (20, 65, 110, 155) for b in (25, 145, 265)]
DWELL_ROWS, MOVE_ROWS = 12_000, 400


def resident() -> float:
    """Return the memory of this process [MB]."""
    return int(Path("/proc/self/statm").read_text().split()[1]) * 4096 / 2**20


@pytest.mark.skipif(not Path("/proc/self/statm").exists(), reason="memory is read from /proc")
def test_memory_is_flat_over_720_000_readings(tmp_path: Path):
    (tmp_path / "plan.csv").write_text("alpha_deg,beta_deg\n" + "".join(f"{a},{b}\n" for a, b in POSITIONS))
    programme = read_programme(tmp_path / "plan.csv")
    options, rng = SessionOptions(1e-5), np.random.default_rng(1)
    entry = Measurement.begun(programme, options, tmp_path / "m.csv", "the table", resume=False)
    entry.feed(HEADER.encode())
    peak, last, time_s = [], np.zeros(2), 0.0
    way = np.minimum(np.arange(DWELL_ROWS) / MOVE_ROWS, 1.0)[:, None]
    for k in range(60):
        to = np.array(POSITIONS[k % 12], dtype=float)
        angles = last + (to - last) * way
        force = 9.80665 * nominal_input(np.radians(angles[:, 0]), np.radians(angles[:, 1]), np.eye(3)) + rng.uniform(
            -3e-5, 3e-5, (DWELL_ROWS, 3)
        )
        times = time_s + 0.01 * np.arange(1, DWELL_ROWS + 1)
        last, time_s = to, float(times[-1])
        payload = text_of(np.column_stack([times, angles, force])).encode()
        for start in range(0, len(payload), 50_000):
            entry.feed(payload[start : start + 50_000])
            entry.watch.present()
        peak.append(resident())
    assert entry.lines.rows == 720_000
    assert len(entry.session.good) == 59
    assert max(peak[12:]) < peak[11] + 15.0, peak
    entry.files.close()
    again = Measurement.begun(programme, options, tmp_path / "m.csv", "the table", resume=True)
    assert again.session.standing == entry.session.standing
    assert resident() < peak[11] + 40.0
    again.files.close()
