"""Fit of noise processes to a spectrum, by the likelihood of its cosine coefficients (Whittle).

With the spectrum S_b = Σ θ_p s_p, θ ≥ 0, twice the negative logarithm of the likelihood is Σ ν_b (ln S_b + P_b / S_b).
P_b is the mean square of the ν_b coefficients of a bin.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
from scipy.optimize import minimize_scalar, nnls, root_scalar

from ...models.arrays import Floats
from .processes import Letter, template
from .spectrum import LONGEST_WARM_UP, SHORTEST_WARM_UP, Bins

ROUNDS = 60
"""Rounds of reweighted least squares."""
CONVERGED = 1e-7
"""A round that changes twice the logarithm by less is the last."""
CONSTANTS = 24
"""Correlation times that are tried."""
LEVEL = 3.841
"""Rise of twice the negative logarithm at the ends of a 95 % interval."""
LOWEST = 1e-9
"""A process below this part of its starting size is none."""
STEP = 0.02
"""First step of the logarithm of θ towards an end of an interval; each further one is twice as long."""
NEARBY = 1.5
"""Logarithms of correlation times about the best one that an interval of a Markov process takes in."""
SMOOTH: tuple[Letter, ...] = ("N", "Q", "B", "K")
"""Processes beside which the time constant of a strong warm-up is fitted."""
STRONG = 5.0
"""Size of a warm-up over its 95 % interval beyond which its time constant is fitted."""
WIDEST = 30.0
"""Change of the logarithm of θ beyond which no end is looked for."""


@dataclass(frozen=True, eq=False)
class Trend:
    """A trend of the mean: "R" or "W", its size (per second, or of the warm-up), its time constant [s]."""

    letter: Letter
    size: float
    constant: float = 0.0

    @staticmethod
    def of(size: float, constant: float) -> "Trend":
        """Return a ramp, for a constant of 0, or a warm-up."""
        return Trend("R" if constant == 0.0 else "W", size, constant)


@dataclass(frozen=True, eq=False)
class NoiseFit:
    """Processes fitted to a spectrum.

    Attributes
    ----------
    letters : tuple of str
        the processes with a spectrum
    power : ndarray, shape (p,)
        θ: squares of their coefficients
    constant : float
        correlation time of the Markov process [s]
    trend : Trend or None
        trend of the mean
    cost : float
        twice the negative logarithm of the likelihood, but for a constant
    """

    letters: tuple[Letter, ...]
    power: Floats
    constant: float
    trend: Trend | None
    cost: float

    @property
    def all_letters(self) -> tuple[Letter, ...]:
        """The processes, the trend last."""
        if self.trend is None:
            return self.letters
        return (*self.letters, self.trend.letter)

    def coefficient(self, letter: Letter) -> float:
        """Return the coefficient of a process: the square root of θ, the size of a trend; 0 where it has none."""
        if letter in self.letters:
            return math.sqrt(float(self.power[self.letters.index(letter)]))
        if self.trend is not None and self.trend.letter == letter:
            return self.trend.size
        return 0.0


def _end(rise: Callable[[float], float], step: float) -> float:
    """Return the first zero of a function of the logarithm of θ on the side of a step; infinite if there is none."""
    inside, outside = 0.0, step
    while rise(outside) < 0.0:
        inside, outside = outside, 2.0 * outside
        if abs(outside) > WIDEST:
            return math.copysign(math.inf, step)
    return root_scalar(rise, bracket=(inside, outside), method="brentq", xtol=1e-4).root


def _cost_of(fit: NoiseFit) -> float:
    return fit.cost


class Likelihood:
    """The likelihood of a spectrum: fits of any set of processes."""

    def __init__(self, bins: Bins) -> None:
        """Take the bins of one channel."""
        self.bins = bins
        # sizes near one: the fits are of ratios to a smooth level
        self.unit = float(np.exp(np.average(np.log(np.maximum(bins.power, 1e-300)), weights=bins.count)))
        self.templates: dict[tuple[Letter, float], Floats] = {}
        self.shapes: dict[float, Floats] = {}
        self.fits: dict[tuple[Letter, ...], NoiseFit] = {}

    @cached_property
    def constants(self) -> Floats:
        """Correlation times that are tried [s]: from three steps to a quarter of the record."""
        first = 3.0 * self.bins.step * math.pi / max(float(self.bins.angle[-1]), 1e-12)
        last = max(self.bins.duration / 4.0, 2.0 * first)
        return np.geomspace(first, last, CONSTANTS)

    @cached_property
    def warm_ups(self) -> list[float]:
        """Time constants of a warm-up that are tried [s]; beside a strong one its own, which no grid would meet."""
        constants = self.bins.warm_ups.tolist()
        best = min((self.fit_at(SMOOTH, 0.0, constant) for constant in constants), key=_cost_of)
        assert best.trend is not None
        low, high = self._trend_interval(best)
        if abs(low + high) < STRONG * (high - low):
            return constants
        refined: Any = minimize_scalar(
            lambda logarithm: self.fit_at(SMOOTH, 0.0, math.exp(logarithm)).cost,
            bounds=(math.log(self.bins.duration / SHORTEST_WARM_UP), math.log(self.bins.duration * LONGEST_WARM_UP)),
            options={"xatol": 1e-6},
        )
        return [*constants, math.exp(refined.x)]

    def column(self, letter: Letter, constant: float) -> Floats:
        """Return the template of a process at the bins, of size about one."""
        key = (letter, constant if letter == "M" else 0.0)
        if key not in self.templates:
            self.templates[key] = template(letter, self.bins.angle, self.bins.step, constant) / self.unit
        return self.templates[key]

    def columns(self, letters: tuple[Letter, ...], constant: float) -> Floats:
        """Return the templates (B, p) of some processes."""
        return np.stack([self.column(letter, constant) for letter in letters], axis=1)

    def spectrum(self, fit: NoiseFit, angle: Floats) -> Floats:
        """Return the variance of cosine coefficients at ω [rad per reading] by fitted processes."""
        spectrum = np.zeros(angle.shape)
        for letter, power in zip(fit.letters, fit.power, strict=True):
            spectrum += power * template(letter, angle, self.bins.step, fit.constant)
        return spectrum

    def fit(self, letters: tuple[Letter, ...], trend: Letter | None = None) -> NoiseFit:
        """Return the best fit of a set of processes, over the correlation times and then the trends of that letter."""
        if letters not in self.fits:
            self.fits[letters] = self._without_trend(letters)
        best = self.fits[letters]
        if trend is None:
            return best
        constants = [0.0] if trend == "R" else self.warm_ups
        return min((self.fit_at(letters, best.constant, constant) for constant in constants), key=_cost_of)

    def _without_trend(self, letters: tuple[Letter, ...]) -> NoiseFit:
        """Return the best fit of a set of processes over the correlation times."""
        if "M" not in letters:
            return self.fit_at(letters, 0.0, None)
        best = min((self.fit_at(letters, float(constant), None) for constant in self.constants), key=_cost_of)
        return self._refined(best, float(self.constants[1] / self.constants[0]))

    def _refined(self, best: NoiseFit, ratio: float) -> NoiseFit:
        """Return the fit with a better correlation time, by halving the step of the grid."""
        step = math.sqrt(ratio)
        for _ in range(4):
            for constant in (best.constant * step, best.constant / step):
                other = self.fit_at(best.letters, constant, None)
                if other.cost < best.cost:
                    best = other
            step = math.sqrt(step)
        return best

    def fit_at(self, letters: tuple[Letter, ...], constant: float, trend: float | None) -> NoiseFit:
        """Return the fit of a set of processes with one correlation time and one trend, by its constant."""
        columns = self.columns(letters, constant)
        power, count = self.bins.power / self.unit, self.bins.count
        size = 0.0
        theta = self._least_squares(columns, power, power)
        cost = self._cost(columns @ theta, power)
        for _ in range(ROUNDS):
            spectrum = columns @ theta
            if trend is not None:
                size = self._trend_size(spectrum, trend)
                power = self._power_without(trend, size)
            step = self._least_squares(columns, power, spectrum)
            part, cost_new = self._part_of_step(spectrum, columns @ step, power)
            theta = theta + part * (step - theta)
            change, cost = cost - cost_new, cost_new
            if abs(change) < CONVERGED * (1.0 + float(count.sum()) * 1e-6):
                break
        fitted = None if trend is None else Trend.of(size, trend)
        cost += float(count.sum()) * math.log(self.unit)
        return NoiseFit(letters, theta, constant, fitted, cost)

    def _least_squares(self, columns: Floats, power: Floats, spectrum: Floats) -> Floats:
        """Return θ ≥ 0 by least squares, weighted as the scatter of the power about a spectrum is."""
        weight = np.sqrt(self.bins.count) / np.maximum(spectrum, 1e-300)
        weighted = columns * weight[:, None]
        scale = np.sqrt((weighted * weighted).sum(axis=0))
        solution, _ = nnls(weighted / scale, power * weight)
        return solution / scale

    def _cost(self, spectrum: Floats, power: Floats) -> float:
        """Return Σ ν (ln S + P / S); infinite where the spectrum vanishes."""
        if not np.all(spectrum > 0.0):
            return math.inf
        return float(self.bins.count @ (np.log(spectrum) + power / spectrum))

    def shape(self, trend: float) -> Floats:
        """Return the single coefficients (S,) of a trend of size one."""
        if trend not in self.shapes:
            self.shapes[trend] = self.bins.trend(trend)
        return self.shapes[trend]

    def _trend_size(self, spectrum: Floats, trend: float) -> float:
        """Return the size of a trend by least squares, weighted by the spectrum."""
        weight = 1.0 / (spectrum[self.bins.is_single] * self.unit)
        shape = self.shape(trend)
        return float((weight * shape) @ self.bins.single / ((weight * shape) @ shape))

    def _power_without(self, trend: float, size: float) -> Floats:
        """Return the power of the bins without a trend."""
        power = self.bins.power.copy()
        power[self.bins.is_single] = (self.bins.single - size * self.shape(trend)) ** 2
        return power / self.unit

    def interval(self, fit: NoiseFit, letter: Letter) -> tuple[float, float]:
        """Return the ends of the 95 % interval of a coefficient, by the profile of the likelihood.

        The low end is 0 where the record does not exclude the process. The process may be one that the fit lacks.
        """
        letters = fit.letters if letter in fit.letters else (*fit.letters, letter)
        trend = None if fit.trend is None else fit.trend.constant
        if letter in ("R", "W"):
            return self._trend_interval(fit)
        best = self.fit_at(letters, fit.constant, trend)
        place = letters.index(letter)
        # the size at which the process alone makes the power, where it is not needed
        alone = float(np.median(self.bins.power / self.unit / self.column(letter, fit.constant)))
        start = max(float(best.power[place]), LOWEST * alone)

        def rise(logarithm: float) -> float:
            return self._cost_with(best, place, start * math.exp(logarithm), trend) - best.cost - LEVEL

        low, high = _end(rise, -STEP), _end(rise, STEP)
        return math.sqrt(start * math.exp(low)), math.sqrt(start * math.exp(high))

    def _cost_with(self, best: NoiseFit, place: int, theta: float, trend: float | None) -> float:
        """Return the least cost with one process of a fit fixed at a size θ; of Markov over its correlation times."""
        others = np.delete(self.columns(best.letters, best.constant), place, axis=1)
        start = others @ np.delete(best.power, place)
        letter = best.letters[place]

        def cost(logarithm: float) -> float:
            column = template(letter, self.bins.angle, self.bins.step, best.constant * math.exp(logarithm)) / self.unit
            return self._beside(column * theta, others, start, trend)[1]

        if letter != "M":
            return cost(0.0)
        least: Any = minimize_scalar(cost, bounds=(-NEARBY, NEARBY), options={"xatol": 0.02})
        return float(least.fun)

    def fit_beside(
        self, fixed: Floats, letters: tuple[Letter, ...], constant: float = 0.0, trend: float | None = None
    ) -> NoiseFit:
        """Return the fit of a set of processes beside a fixed spectrum (B,), with one correlation time and trend.

        The fit's cost is that of both.
        """
        columns = self.columns(letters, constant) if letters else np.zeros((len(self.bins.power), 0))
        theta, cost = self._beside(fixed / self.unit, columns, np.zeros(len(fixed)), trend)
        named = None
        if trend is not None:
            spectrum = fixed / self.unit + columns @ theta
            named = Trend.of(self._trend_size(spectrum, trend), trend)
        return NoiseFit(letters, theta, constant, named, cost)

    def _beside(
        self,
        fixed: Floats,
        columns: Floats,
        start: Floats,
        trend: float | None,
    ) -> tuple[Floats, float]:
        """Return θ ≥ 0 of some columns beside a fixed spectrum, from a spectrum of theirs on, and the least cost."""
        power = self.bins.power / self.unit
        theta = np.zeros(columns.shape[1])
        # a floor far below the power: nothing else may be there
        spectrum = fixed + start + LOWEST * float(np.median(power))
        cost = cost_new = math.inf
        for _ in range(ROUNDS):
            if trend is not None:
                power = self._power_without(trend, self._trend_size(spectrum, trend))
            step = spectrum
            if columns.shape[1]:
                theta = self._least_squares(columns, power - fixed, spectrum)
                step = fixed + columns @ theta
            part, cost_new = self._part_of_step(spectrum, step, power)
            spectrum = spectrum + part * (step - spectrum)
            if abs(cost - cost_new) < 1e-6:
                break
            cost = cost_new
        return theta, cost_new + float(self.bins.count.sum()) * math.log(self.unit)

    def _part_of_step(self, before: Floats, after: Floats, power: Floats) -> tuple[float, float]:
        """Return the part of a step from one spectrum towards another that does not raise the cost, and its cost."""
        cost = self._cost(before, power)
        part = 1.0
        for _ in range(12):
            cost_new = self._cost(before + part * (after - before), power)
            if cost_new <= cost:
                return part, cost_new
            part *= 0.5
        return 0.0, cost

    def _trend_interval(self, fit: NoiseFit) -> tuple[float, float]:
        """Return the ends of the 95 % interval of a trend's size, the spectrum as it is fitted."""
        assert fit.trend is not None
        spectrum = self.columns(fit.letters, fit.constant) @ fit.power * self.unit
        shape = self.shape(fit.trend.constant)
        deviation = 1.0 / math.sqrt(float(shape @ (shape / spectrum[self.bins.is_single])))
        half = math.sqrt(LEVEL) * deviation
        return fit.trend.size - half, fit.trend.size + half

    def worst_bin(self, fit: NoiseFit) -> float:
        """Return the largest deviation of a bin from the fit, in standard deviations of a normal variable."""
        spectrum = self.columns(fit.letters, fit.constant) @ fit.power
        power = self.bins.power / self.unit
        if fit.trend is not None:
            power = self._power_without(fit.trend.constant, fit.trend.size)
        # Wilson and Hilferty: the cube root of chi-square is nearly normal
        spread = 2.0 / (9.0 * self.bins.count)
        return float(np.max(np.abs(np.cbrt(power / spectrum) - (1.0 - spread)) / np.sqrt(spread)))

    def with_power(self, fit: NoiseFit, power: Floats) -> NoiseFit:
        """Return a fit with other sizes, and its cost."""
        other = replace(fit, power=power)
        spectrum = self.columns(fit.letters, fit.constant) @ power
        cost = self._cost(spectrum, self.bins.power / self.unit)
        return replace(other, cost=cost + float(self.bins.count.sum()) * math.log(self.unit))
