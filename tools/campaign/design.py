"""Which run is which: its parameters and its seed, from the campaign and the run's number alone.

Run number = (combination × samples + sample) × repeats + repeat. With Saltelli's sampling the samples are the rows of
A, then of B, then of A with each column from B; a row has the same random errors in all of them, so that a parameter
that does nothing has indices of exactly nothing.
"""

from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.stats import qmc

from .file import Campaign

_SAMPLES_STREAM, _ERRORS_STREAM = 0, 1
_CHUNK = 256
"""Rows of a Sobol sequence that are made at once."""
Value = float | str | bool


class Design:
    """The runs of a campaign.

    Parameters
    ----------
    campaign : Campaign
    """

    def __init__(self, campaign: Campaign) -> None:
        self.campaign = campaign
        self._chunk: tuple[int, NDArray] | None = None

    @cached_property
    def _lists(self) -> dict[str, list[Any]]:
        return {name: axis.listed() for name, axis in self.campaign.lists.items()}

    @cached_property
    def _hypercube(self) -> NDArray:
        """All points of a Latin hypercube: it has no shorter description."""
        sampler = qmc.LatinHypercube(len(self.campaign.distributions), rng=self._generator())
        return sampler.random(self.campaign.sampling.points)

    def _generator(self, *key: int) -> np.random.Generator:
        return np.random.default_rng(np.random.SeedSequence(self.campaign.seed, spawn_key=(_SAMPLES_STREAM, *key)))

    def _sobol(self, columns: int, row: int) -> NDArray:
        """A row of a scrambled Sobol sequence of so many columns."""
        chunk, at = divmod(row, _CHUNK)
        if self._chunk is None or self._chunk[0] != chunk:
            sampler = qmc.Sobol(columns, rng=self._generator())
            if chunk:
                sampler.fast_forward(chunk * _CHUNK)
            self._chunk = (chunk, sampler.random(_CHUNK))
        return self._chunk[1][at]

    def _cube(self, sample: int) -> NDArray:
        """The point of a sample in the unit cube of the distributions."""
        campaign, count = self.campaign, len(self.campaign.distributions)
        method = campaign.sampling.method
        if method == "latin-hypercube":
            return self._hypercube[sample]
        if method == "sobol":
            return self._sobol(count, sample)
        if method == "saltelli":
            block, row = divmod(sample, campaign.sampling.points)
            both = self._sobol(2 * count, row)
            point = both[count:] if block == 1 else both[:count].copy()
            if block > 1:
                point[block - 2] = both[count + block - 2]
            return point
        return self._generator(sample).random(count)

    def values(self, run: int) -> dict[str, Value]:
        """The parameters of a run, in the order of the file."""
        campaign = self.campaign
        combination, sample = divmod(run // campaign.repeats, campaign.samples)
        spread = campaign.distributions
        cube = self._cube(sample) if spread else np.zeros(0)
        drawn = {name: float(axis.quantile(u)) for (name, axis), u in zip(spread.items(), cube, strict=True)}
        listed: dict[str, Value] = {}
        for name, values in reversed(self._lists.items()):
            at = combination % len(values)
            listed[name] = values[at]
            if campaign.sampling.lists == "product":
                combination //= len(values)
        return {name: listed[name] if name in listed else drawn[name] for name in campaign.parameters}

    def seed(self, run: int) -> np.random.SeedSequence:
        """The seed of everything in a run that is random beside its parameters."""
        number = run
        if self.campaign.sampling.method == "saltelli":
            number = run % self.campaign.sampling.points
        return np.random.SeedSequence(self.campaign.seed, spawn_key=(_ERRORS_STREAM, number))


def short_seed(seed: np.random.SeedSequence) -> int:
    """A seed as the components take one, from 0 to 2**31 - 1."""
    return int(seed.generate_state(1, np.uint32)[0] >> 1)
