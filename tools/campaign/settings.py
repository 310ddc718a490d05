"""The sections of a campaign file that say what one run is."""

from typing import Annotated, Literal

from pydantic import BaseModel, ConfigDict, Field, model_validator

Positive = Annotated[float, Field(gt=0.0, allow_inf_nan=False)]
Pair = Annotated[tuple[float, float], Field(strict=False)]
Whole = Annotated[tuple[int, int], Field(strict=False)]


class _Section(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True, strict=True)


class CalibrationSetting(_Section):
    """A static calibration: readings of a bench at some positions, with errors within σ, calibrated.

    Attributes
    ----------
    positions : str
        CSV file with alpha_deg, beta_deg; without it the 24 positions of scenarios/static-calibration-positions.csv
    truth : "drawn" or "given"
        what parameters that are not swept are: drawn within the bounds for each run, or zero
    noise : str
        "uniform" within ± noise_part σ, or "edge": ± noise_part σ
    noise_part : float
        size of the errors as a part of σ
    noise_bound, gravity, baseline, convention, bounds
        as for `calibrate`
    """

    positions: str | None = None
    truth: Literal["drawn", "given"] = "drawn"
    noise: Literal["uniform", "edge"] = "uniform"
    noise_part: Annotated[float, Field(ge=0.0, le=1e6)] = 1.0
    noise_bound: Positive = 1e-5
    gravity: Positive = 9.80665
    baseline: Literal["asymmetric", "symmetric"] = "asymmetric"
    convention: Literal["A1", "A2"] = "A1"
    bounds: Pair = (3e-3, 1e-2)


class AttitudeSetting(_Section):
    """An attitude run: a motion, gyros with errors, an algorithm, against the true attitude.

    Attributes
    ----------
    motion : str
        of the paper: 1 to 6, small, first, second
    duration_s, rate_hz : float
        length of the run, gyro samples a second
    algorithm : str
        name of an attitude algorithm
    noise_bound_radps : float
        bound of the gyros' errors of each sample
    """

    motion: str = "1"
    duration_s: Positive = 60.0
    rate_hz: Positive = 1000.0
    algorithm: str = "two-sample-rodrigues"
    noise_bound_radps: Annotated[float, Field(ge=0.0, allow_inf_nan=False)] = 0.0

    @model_validator(mode="after")
    def _size(self) -> "AttitudeSetting":
        if not 8 <= self.duration_s * self.rate_hz <= 1e8:
            raise ValueError("duration_s times rate_hz: a run has from 8 to 100,000,000 samples")
        return self


class Reduction(_Section):
    """A number from a column of a run's record."""

    column: str
    take: Literal["last", "first", "mean", "min", "max", "max-abs", "rms", "std"] = "last"


class SimulationSetting(_Section):
    """A scenario, simulated.

    Attributes
    ----------
    scenario : str
        its file
    seeds : "derived" or "fixed"
        every parameter `seed` of an FMU is another one for each run, or what the scenario says
    scalars : dict
        name -> column of the record and what is taken of it; without it the last value of every column
    calibrate : bool
        average the rests of the record and calibrate them too
    noise_bound : float
        σ of that calibration
    """

    scenario: str
    seeds: Literal["derived", "fixed"] = "derived"
    scalars: dict[str, Reduction] | None = None
    calibrate: bool = False
    noise_bound: Positive = 1e-5


class HiddenSetting(_Section):
    """A case of the hidden-effect suite: drawn, measured in time, diagnosed.

    Attributes
    ----------
    suite : str or None
        of scenarios/hidden/suites.toml; it decides the rest, its seed and number of cases
    mode, effects, positions, noise, size
        as for `trihedron hidden`, where no suite is named
    """

    suite: str | None = None
    mode: Literal["clean", "single", "between", "pairs"] = "single"
    effects: list[str] = Field(default_factory=list)
    positions: Whole = (12, 100)
    noise: Literal["uniform", "edge", "correlated", "all"] = "all"
    size: Pair | None = None

    @model_validator(mode="after")
    def _suite_decides(self) -> "HiddenSetting":
        others = sorted(self.model_fields_set - {"suite"})
        if self.suite is not None and others:
            raise ValueError(f"{others[0]} is what suite decides")
        return self
