"""Noise of records of real sensors: white noise as on the data sheet, and predictions of rests that were not used."""

import numpy as np
import pytest

import trihedron as th
from generator.noise import known, static_record
from record_files import measured
from trihedron.tools.noise import Noise
from trihedron.tools.noise.pieces import at_rest
from trihedron.tools.records import StrapdownRecord

SPAN = 2.0
"""A drift over this time, less the bias of the same time before [s]."""
BAND = 1.959964
RECORDS = (
    "mpu9150-0",
    "mpu9150-1",
    "mpu9150-2",
    "mpu9150-4",
    "xsens-imu-tk",
    "broad-03",
    "broad-06",
    "broad-08",
    "broad-21",
)
DATA_SHEET = {"gyro": 0.3, "accelerometer": 400.0}
"""N of an MPU-9150 by its data sheet: 0.005 deg/s/√Hz [deg/√h] and 400 µg/√Hz."""


def halves(record: StrapdownRecord) -> tuple[StrapdownRecord, StrapdownRecord]:
    """Return the two halves of a record by rows at rest."""
    rows = np.cumsum(np.linalg.norm(known(record.rate), axis=1) < 0.05)
    middle = int(np.searchsorted(rows, rows[-1] / 2))
    parts = []
    for chosen in (slice(0, middle), slice(middle, None)):
        parts.append(
            StrapdownRecord(
                time_s=record.time_s[chosen],
                rate=known(record.rate)[chosen],
                increment=None,
                specific_force=record.specific_force[chosen],
            )
        )
    return parts[0], parts[1]


def inside(noise: Noise, record: StrapdownRecord) -> list[bool]:
    """Return for each drift of a record's rests whether it lies in the 95 % band that the noise predicts."""
    still = at_rest([record])
    rows = round(SPAN / still.step)
    results = []
    for channel, predicted in zip(still.channels, noise.channels, strict=True):
        deviation = predicted.drift(SPAN, SPAN)
        for piece in channel.pieces:
            for start in range(0, len(piece) - 2 * rows, 2 * rows):
                bias = piece[start : start + rows].mean()
                drift = still.step * (piece[start + rows : start + 2 * rows] - bias).sum()
                results.append(bool(abs(drift) <= BAND * deviation))
    return results


@pytest.mark.first(1)
@pytest.mark.parametrize("name", RECORDS[:4])
def test_white_noise_is_that_of_the_data_sheet_within_a_factor(name):
    result = th.noise(measured(name))
    for channel in result.channels:
        white = known(known(channel.coefficient("N")).data_sheet_estimate)
        assert 1.0 / 2.5 < white / DATA_SHEET[channel.sensor] < 2.5


@pytest.mark.acceptance
def test_rests_that_were_not_used_are_predicted():
    every = []
    for name in RECORDS:
        first, second = halves(measured(name))
        results = inside(th.noise(first), second)
        print(name, len(results), np.mean(results))
        every += results
    print(len(every), np.mean(every))
    assert 0.90 <= np.mean(every) <= 0.98


@pytest.mark.acceptance
def test_drifts_of_made_noise_are_predicted():
    sizes = {"N": 1e-4, "B": 4e-5}
    record = static_record(60_000, 0.02, sizes, {"N": 1e-3, "K": 1e-5}, seed=3)
    first, second = halves(record)
    assert 0.90 <= np.mean(inside(th.noise(first), second)) <= 0.98
