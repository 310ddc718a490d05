"""What a run gives, and what makes runs of one kind."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Literal, Protocol

import numpy as np
import polars as pl

from .design import Value

Better = Literal["lower", "higher"]


@dataclass(frozen=True)
class Output:
    """A scalar that a run gives.

    Attributes
    ----------
    dtype : polars data type
        Float64, Int64, String or Boolean
    better : "lower", "higher" or None
        which way is better, where one is: of numbers and of flags
    good : tuple of str
        of a text: the values that are as they should be
    """

    dtype: type[pl.DataType]
    better: Better | None = None
    good: tuple[str, ...] = ()


@dataclass(frozen=True)
class Result:
    """What a run gave.

    Attributes
    ----------
    scalars : mapping
        name -> value, for every output of the kind
    record : DataFrame or None
        where one was asked for
    diagnosis : str or None
        JSON, where one was asked for
    """

    scalars: Mapping[str, Value | int | None]
    record: pl.DataFrame | None = None
    diagnosis: str | None = None


class Runner(Protocol):
    """Runs of one kind, prepared once in each process."""

    @property
    def outputs(self) -> Mapping[str, Output]:
        """Name -> what it is, of every scalar that a run gives."""
        ...

    def run(self, number: int, values: Mapping[str, Value], seed: np.random.SeedSequence) -> Result:
        """Make a run.

        Raises
        ------
        InputError
            or anything else: the run failed, and its message is recorded
        """
        ...


@dataclass(frozen=True)
class Columns:
    """Columns of a campaign's data set.

    Attributes
    ----------
    parameters, outputs : dict
        name -> polars data type; name -> Output, those that are kept
    """

    parameters: dict[str, type[pl.DataType]]
    outputs: dict[str, Output]
    diagnosis: bool = False
    record: bool = False
    own: tuple[str, ...] = field(default=("run", "failed", "diagnosis"))

    @property
    def schema(self) -> dict[str, type[pl.DataType]]:
        """Name -> data type, in order."""
        kept = {name: output.dtype for name, output in self.outputs.items()}
        last: dict[str, type[pl.DataType]] = {"diagnosis": pl.String} if self.diagnosis else {}
        return {"run": pl.Int64, **self.parameters, "failed": pl.String, **kept, **last}
