"""The true attitude of a block on a calibrated table: what its gyros, and an attitude computer, can be held against."""

import math
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from ...fmus.units import ARCMIN
from ...models.bench import TARGETS
from ...models.bench_turns import earth_in_base
from ..calibrated import Calibration
from ..errors import InputError
from ..records import BenchRecord, PositionRecord, StrapdownRecord
from ..records.comments import INERTIAL
from ..records.rests import without_turns
from ..rounding import upwards
from .gyros import Bench

OF_AXES = ("X3", "X8", "-X12", "X13")
"""Targets whose errors turn the block by an angle that depends on the table's; what stays in the base drops out."""


def attitudes(
    targets: NDArray, time: NDArray, alpha: NDArray, beta: NDArray, mounting: NDArray, earth: NDArray
) -> NDArray[np.float64]:
    """Attitude (N, 4) of the block against inertial space, unit quaternions, scalar first, body to reference.

    Parameters
    ----------
    targets : (18,) array
        in the order of `TARGETS`
    time, alpha, beta : (N,) array
        [s]; encoder readings [rad]
    mounting, earth : (3, 3), (3,) array
        Q; Earth's rotation in axes of the base [rad/s], whose axes are the reference at time zero
    """
    kappa, shift, epsilon = targets[:3]

    def about(axis: int, angle: NDArray | float) -> Rotation:
        return Rotation.from_rotvec(np.atleast_1d(angle)[:, None] * np.eye(3)[axis])

    base = Rotation.from_rotvec(time[:, None] * earth) * about(1, kappa)
    inner = base * about(0, alpha - shift) * about(1, epsilon) * about(2, beta)
    block = inner * Rotation.from_matrix(mounting.T) * Rotation.from_rotvec(targets[14:11:-1])
    return block.as_quat()[:, [3, 0, 1, 2]]


def strapdown_by_table(found: Calibration, record: PositionRecord, bench: Bench | None) -> StrapdownRecord:
    """The strapdown record of a bench record, with the true attitude by the table as it was calibrated.

    Its comments say that the attitude is inertial, and by how much it may err at a row. An InputError for a calibration
    that is not consistent, or not of the gyros too.
    """
    raw = record.raw
    if not isinstance(raw, BenchRecord) or found.gyros is None or bench is None:
        raise InputError("--strapdown: is of a bench record with --latitude-deg and --azimuth-deg")
    if found.verdict != "consistent":
        raise InputError(f"--strapdown: the calibration is {found.verdict}: no table tells a true attitude")
    known = {e.symbol: e for e in found.parameters}
    if any(symbol not in known for symbol in TARGETS):
        raise InputError("--strapdown: is of --convention A1 and --baseline asymmetric")
    values = np.array([known[symbol].estimate for symbol in TARGETS], dtype=float)
    errors = np.array([known[symbol].error_bound for symbol in OF_AXES], dtype=float)
    earth = earth_in_base(math.radians(bench.latitude_deg), math.radians(bench.azimuth_deg))
    (mounting,) = found.mountings.values()
    angles = without_turns(raw.alpha), without_turns(raw.beta)
    attitude = attitudes(values, raw.time_s - raw.time_s[0], *angles, np.array(mounting), earth)
    bound = math.sqrt(2.0) * found.gyros.encoder_bound + float(errors.sum())
    key, value = INERTIAL
    said = {key: value, "attitude_bound_arcmin": upwards(bound / ARCMIN, 2)}
    return replace(raw.gyros, attitude=attitude, about={**raw.about, **said})
