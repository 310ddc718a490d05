"""Records as tables, with the columns of their files."""

from typing import Any

import numpy as np
import polars as pl

from .columns import ANGLES, APPROACH, FORCE, INCREMENT, MOUNTING, QUATERNION, RATE, TEMPERATURE
from .kinds import PositionRecord, RawRecord, StrapdownRecord
from .output import degrees_that_read_back


def frame_of(record: PositionRecord | RawRecord | StrapdownRecord) -> pl.DataFrame:
    """A record as a table; `trihedron.tools.records.reading.record_of` takes it back.

    An attitude that is not known is null.
    """
    columns: dict[str, Any] = {}
    if isinstance(record, PositionRecord):
        columns["position"] = record.position
    columns["time_s"] = record.time_s
    if isinstance(record, StrapdownRecord):
        columns |= _three(RATE, record.rate) | _three(INCREMENT, record.increment)
    else:
        angles = (record.alpha, record.beta)
        columns |= {name: degrees_that_read_back(angle) for name, angle in zip(ANGLES, angles, strict=True)}
    columns |= _three(FORCE, record.specific_force)
    if record.temperature is not None:
        columns[TEMPERATURE] = record.temperature
    if isinstance(record, PositionRecord):
        for name, sense in zip(APPROACH, (record.approach_alpha, record.approach_beta), strict=True):
            if sense is not None:
                columns[name] = sense.astype(np.int64)
        if record.mounting is not None:
            columns[MOUNTING] = list(record.mounting)
    if isinstance(record, StrapdownRecord) and record.attitude is not None:
        columns |= dict(zip(QUATERNION, record.attitude.T, strict=True))
        return pl.DataFrame(columns).with_columns(pl.col(QUATERNION).fill_nan(None))
    return pl.DataFrame(columns)


def _three(names: tuple[str, ...], values: np.ndarray | None) -> dict[str, np.ndarray]:
    return {} if values is None else {name: values[:, axis] for axis, name in enumerate(names)}
