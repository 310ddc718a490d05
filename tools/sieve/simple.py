"""A simple fault of a record that makes the model fit."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, Literal

from ...models.effects import EffectPlace
from ..calibrated import Calibration
from ..evidence.evidence import Evidence
from ..evidence.fit import Fit

KindOfFault = Literal["sigma", "rows", "stretch", "break", "function"]


@dataclass(frozen=True, eq=False)
class Simple:
    """A fault of a record: with it, and some effects if any, the model fits.

    Attributes
    ----------
    kind : str
    numbers : int
        coefficients that it adds to the model, one more for each number that is searched for, those of effects counted
    where : tuple of str
        places at which it acts: "row-20", "accelerometer-3", "outer-axis"
    sentence : str
        the fault in plain words
    radius : float
        the largest error over its bound that remains
    evidence : Evidence
        in which the model stands: the record without its wrong rows, with the wider bound, with one more bias
    rows : tuple of int
        numbers of wrong rows as in the file
    change : mapping
        the change that makes a row fit, or the change at a break, with its unit: {"alpha_deg": -0.4002}
    within : mapping
        ends of the possible values of a change, where σ is a bound
    before_row, time_s : int, float
        place of a break
    between_rows : tuple of int
        rows, or rests of a series, between which a break may be: around all gaps that fit
    fit : Fit or None
        effects beside the fault, fitted to its evidence
    beside : tuple of EffectPlace
        of a break, which its fit holds: the effects beside it
    """

    kind: KindOfFault
    numbers: int
    where: tuple[str, ...]
    sentence: str
    radius: float
    evidence: Evidence
    rows: tuple[int, ...] = ()
    change: Mapping[str, Any] = field(default_factory=dict)
    within: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    before_row: int | None = None
    time_s: float | None = None
    between_rows: tuple[int, int] | None = None
    fit: Fit | None = None
    beside: tuple[EffectPlace, ...] = ()


def calibration_of(simple: Simple) -> Calibration:
    """Return the calibration of the model that fits."""
    return simple.evidence.reader.calibration_of(simple.fit)
