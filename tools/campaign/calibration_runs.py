"""A run that is a static calibration: a record made from a bench's truth and calibrated, in memory."""

import io
import json
from collections.abc import Mapping
from importlib import resources

import numpy as np
import polars as pl
from numpy.typing import NDArray

from ...models.bench import ELEMENTARY, TARGETS, elementary_reading, target_values
from ..calibration import calibrate
from ..errors import InputError, nearest
from ..records import PositionRecord
from ..trials.bench import draw_truth, true_elementary
from .design import Value
from .file import Campaign
from .kinds import Output, Result
from .settings import CalibrationSetting

SETTINGS = ("noise_part", "noise_bound", "gravity", "baseline", "convention")
"""What can be swept beside the elementary parameters of the bench."""
SWEPT = tuple(name for name in ELEMENTARY if name not in ("gamma_12", "gamma_13", "gamma_23"))
"""Elementary parameters of case (A1), of which the exact targets are known."""
DWELL_S = 30.0


class CalibrationRuns:
    """Static calibrations.

    A record of a bench is made with the exact model, with errors within σ; `calibrate` gets the record and σ. The
    scalars are its verdict and radius, how many true values lie outside their intervals (0 is what is guaranteed), the
    largest error as a part of what is guaranteed, and of each target the error, the guaranteed error and the width of
    the interval.
    """

    def __init__(self, campaign: Campaign, setting: CalibrationSetting) -> None:
        self.setting = setting
        self.diagnose = campaign.keep.diagnosis
        self.record = campaign.keep.record
        known = [*SWEPT, *SETTINGS]
        for name in campaign.parameters:
            if name not in known:
                raise InputError(f"parameters.{name}: is not known; {nearest(name, known)}")
        if setting.convention == "A2" or "convention" in campaign.parameters:
            raise InputError("calibration.convention: the true values are those of A1; give A1")
        if setting.positions is None:
            text = resources.files("trihedron.scenarios").joinpath("static-calibration-positions.csv").read_bytes()
        else:
            text = (campaign.base_folder / setting.positions).read_bytes()
        self.alpha, self.beta = read_angles(text, setting.positions or "static-calibration-positions.csv")
        self.outputs = {
            "verdict": Output(pl.String, good=("consistent",)),
            "radius": Output(pl.Float64, "lower"),
            "misses": Output(pl.Int64, "lower"),
            "worst_error_ratio": Output(pl.Float64, "lower"),
            **{
                f"{symbol}_{what}": Output(pl.Float64, "lower")
                for symbol in TARGETS
                for what in ("error", "guaranteed", "width")
            },
        }

    def run(self, number: int, values: Mapping[str, Value], seed: np.random.SeedSequence) -> Result:
        """Make a record and calibrate it."""
        chosen = self.setting.model_copy(update={name: value for name, value in values.items() if name in SETTINGS})
        rng = np.random.default_rng(seed)
        truth = self._truth(rng, values, symmetric=chosen.baseline == "symmetric")
        errors = rng.uniform(-1.0, 1.0, (len(self.alpha), 3))
        if chosen.noise == "edge":
            errors = np.sign(errors)
        reading = elementary_reading(truth, self.alpha, self.beta, np.eye(3))
        reading = reading + chosen.noise_part * chosen.noise_bound * errors
        count = len(self.alpha)
        record = PositionRecord(
            position=np.arange(1, count + 1),
            time_s=DWELL_S * np.arange(count),
            alpha=self.alpha,
            beta=self.beta,
            specific_force=chosen.gravity * reading,
        )
        options = {"noise_bound": chosen.noise_bound, "gravity": chosen.gravity, "baseline": chosen.baseline}
        result = calibrate(record, **options, bounds=chosen.bounds, convention=chosen.convention)
        true = dict(zip(TARGETS, target_values(truth, np.eye(3)).tolist(), strict=True))
        scalars: dict[str, Value | int | None] = {"verdict": result.verdict, "radius": result.radius}
        misses, ratio = 0, 0.0
        for estimate in result.parameters:
            symbol = estimate.symbol
            if symbol not in true or estimate.estimate is None or estimate.guaranteed_error is None:
                continue
            error = abs(estimate.estimate - true[symbol])
            scalars[f"{symbol}_error"] = error
            scalars[f"{symbol}_guaranteed"] = estimate.guaranteed_error
            ratio = max(ratio, error / estimate.guaranteed_error)
            if estimate.low is not None and estimate.high is not None:
                scalars[f"{symbol}_width"] = estimate.high - estimate.low
                misses += not estimate.low <= true[symbol] <= estimate.high
        scalars |= {"misses": misses, "worst_error_ratio": ratio}
        diagnosis = None
        if self.diagnose:
            from ..diagnosis import diagnose

            found = diagnose(record, **options, bounds=chosen.bounds, rerun=False)
            diagnosis = json.dumps(found.to_json(), ensure_ascii=False, allow_nan=False)
        return Result(scalars, record_table(record) if self.record else None, diagnosis)

    def _truth(self, rng: np.random.Generator, values: Mapping[str, Value], *, symmetric: bool) -> NDArray:
        """Elementary parameters (24,): those that are swept, the others drawn or zero."""
        truth = np.zeros(len(ELEMENTARY))
        # Drawn in any case: the errors are then the same whatever is swept.
        drawn = draw_truth(rng, symmetric=symmetric)
        if self.setting.truth == "drawn":
            mounting_error = drawn["TurntableMotion"]["mounting_error"]
            truth = true_elementary(drawn, tuple(mounting_error))
        for name, value in values.items():
            if name in SWEPT:
                truth[ELEMENTARY.index(name)] = float(value)
        return truth


def read_angles(content: bytes, label: str) -> tuple[NDArray, NDArray]:
    """Angles [rad] of a list of positions, CSV with alpha_deg and beta_deg."""
    try:
        table = pl.read_csv(io.BytesIO(content), comment_prefix="#")
        angles = table.select("alpha_deg", "beta_deg").cast(pl.Float64).to_numpy()
    except pl.exceptions.PolarsError as error:
        reason = str(error).splitlines()[0]
        raise InputError(f"{label}: is no list of positions with alpha_deg and beta_deg ({reason})") from error
    if not np.isfinite(angles).all() or not len(angles):
        raise InputError(f"{label}: holds no positions, or angles that are not finite numbers")
    return np.radians(angles[:, 0]), np.radians(angles[:, 1])


def record_table(record: PositionRecord) -> pl.DataFrame:
    """A position record as the table that a file of it has."""
    columns = {
        "position": record.position,
        "time_s": record.time_s,
        "alpha_deg": np.degrees(record.alpha),
        "beta_deg": np.degrees(record.beta),
        **{f"f{p + 1}_mps2": record.specific_force[:, p] for p in range(3)},
    }
    return pl.DataFrame(columns)
