"""Evidence of a block that is carried by hand, or beside the true attitude.

The simulation, FMUs of gyro block and attitude computer, carries the attitude through the record. Its errors at the
ends of moves or windows are the evidence.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...fmus.parameters import Parameters, elements_of
from ...models.arrays import Floats
from ...models.effects import CATALOGUE, EffectPlace
from ..bounded.programmes import Growth, chebyshev_radius
from ..calibrated import UNITS, Calibration, Parameter, Sigma
from ..calibration.parameter_sets import Sized, Start
from ..locks import own_folder
from ..motion.carry import TurnsTooFar, carried_scenario, compensated_increments
from ..motion.increments import starting_attitude
from ..motion.inspect import Inspection
from ..motion.norm import LARGEST, NAMES
from ..orchestrator.load import usual_flavour
from ..orchestrator.scenario import FmuSetting, RecordSetting, Scenario
from ..records.columns import FORCE, INCREMENT, QUATERNION
from ..rounding import digits, downwards, exactly, residual, upwards
from .carried_run import BIAS, LONG, Carried, is_of_gyros
from .evidence import (
    Exclusions,
    Lengths,
    Reader,
    ReadOff,
    Sizes,
    Trial,
    limits_of,
    own_with,
    parameters_with,
    rms_size,
    stacked_sizes,
    trials_in_time,
    undetermined,
)
from .extension import Extension, takes
from .fit import ARCMIN, Fit, Gain, estimated, extended_fmus, gain_of, not_in_all
from .pairs import Pair
from .power import powers_of_record
from .references import Gravity, Truth, has_truth
from .rows import Channel, Part

SCALE = EffectPlace("gyro-scale-misalignment", "gyro-block")
LATENCY = EffectPlace("latency", "gyro-block")
COMPONENTS = ("GyroBlock", "AttitudeComputer", "AccelerometerBlock")
RUN = ("GyroCompensation", "AttitudeComputer")
FOLDS, FOLDS_OF_LONG = 4, 2
"""Blocks in time, each simulated with parameters from the others; a long record has one run for each."""
SHOWN_BY = {
    "gyro-bias": "a rest of a minute and more before and after the motion",
    "gyro-bias-drift": "rests at the beginning and at the end of a longer record",
    "gyro-scale-misalignment": "several whole turns about each axis, and back",
    "gyro-scale-asymmetry": "whole turns about each axis in one sense, then as many in the other",
    "gyro-g-sensitivity": "rests with each axis up and with each axis down",
    "gyro-g-squared": "rests with each axis up and down, and with two axes at 45°",
    "gyro-rate-squared": "turns about each axis in both senses, slow and fast",
    "gyro-rate-cubed": "turns about each axis, slow and fast",
    "gyro-scale-drift": "the same turns about each axis at the beginning and at the end of a longer record",
    "gyro-bias-step": "rests throughout the record",
    "gyro-warm-up": "rests throughout the record, most of them soon after it is switched on",
    "gyro-scale-step": "the same turns about each axis throughout the record",
    "latency-step": "the same fast turns to and fro throughout the record, compared with the true attitude",
    "lag": "fast turns to and fro about each axis, compared with the true attitude while they last",
    "latency": "fast turns to and fro about each axis, compared with the true attitude while they last",
    "undersampling": "the same motion at another sampling rate",
    "jitter": "the same motion with time stamps from another clock",
    "lookup": "motion in which the quantities that it may depend on vary one without the other",
}
"""What tells each effect of the gyros from the others."""
NEAR_LEAST = 0.003
"""Part of the least stated error of a true attitude to which it is known."""
OF_ACCELEROMETERS = "rests with each axis up, down and between, some of them repeated at the end"


@dataclass(frozen=True, eq=False)
class RecordReader(Reader):
    """The reader of a record of a carried block, before the simulation is run.

    `block` is "calibrated" if the gyros' scale factors and misalignments are parameters, else "nominal". `rates` is the
    assumed meaning of a rate, "instantaneous" or "averaged". `lacks` is advice on data to add where nothing can be run.
    """

    found: Inspection
    block: str
    rates: str
    warnings: tuple[str, ...]
    lacks: tuple[str, ...] = ()

    def missing(self) -> Mapping[str, Any]:
        """Advice on data to add, for a record on which nothing can be run."""
        return {"missing": self.lacks} if self.lacks else {}

    def calibration_of(self, fit: Fit | None = None) -> Calibration:
        """Return an undetermined calibration: the record cannot be run."""
        return undetermined("")

    def head(self) -> Mapping[str, Any]:
        """Return the record and its reference, without a noise bound."""
        record = self.found.record
        return {
            "unit": "arcmin",
            "record": {"rows": len(record), "sha256": record.sha256},
            "reference": "true attitude" if has_truth(self.found) else "gravity",
            "noise_bound_arcmin": None,
            "baseline_model": self.block,
            "lengths": (),
            "order_stable": None,
            "warnings": self.warnings,
        }


@dataclass(frozen=True, eq=False)
class CarriedReader(RecordReader):
    """The reader of a run of a block that is carried.

    `bounds_from` names the source of the bounds in words. `least_radius` is the radius with all effects together, where
    that is above one bound. `limits` are those that the accelerometers show in rests.
    """

    model: Carried
    bounds_from: str = ""
    least_radius: float | None = None
    limits: tuple[ReadOff, ...] = ()

    @property
    def read_off(self) -> tuple[ReadOff, ...]:
        """Limits of the accelerometers that the model needs."""
        return self.limits

    @property
    def quoted_part(self) -> Part:
        """The part whose errors are quoted."""
        return self.rows.parts[self.model.quoted]

    def quoted_errors(self, fit: Fit) -> Floats:
        """Return the quoted errors (S, d) under a fit."""
        return self.rows.split(fit.left)[self.model.quoted]

    @property
    def pairs(self) -> Sequence[Pair]:
        """Gyros, and accelerometers where gravity is the reference, each with every quantity of the record."""
        return self.model.pairs

    @property
    def rerun(self) -> "CarriedRerun":
        """The record, simulated again."""
        return CarriedRerun(self.model)

    @cached_property
    def lengths(self) -> Lengths:
        """Moves over one, two and three rests, or windows of several lengths; as measured with the mean at rest."""
        rows, measured = self.rows, None
        if self.bias_at_rest is not None and BIAS in rows.places:
            numbers = rows.numbers_of([BIAS])
            measured = rows.with_errors([p.error + p.columns[..., numbers] @ self.bias_at_rest for p in rows.parts])
        return Lengths(self.model.quoted, partial(replace, self.model), measured, self.would_need)

    @property
    def bias_at_rest(self) -> Floats | None:
        """The gyros' mean at rest (3,) that was taken out [rad/s]."""
        return self.model.gyros.bias if self.model.at_rest is not None and len(self.model.found.rests) else None

    @property
    def not_seen(self) -> tuple[EffectPlace, ...]:
        """Effects on the block that this record could not show at any possible size."""
        tried = self.rows.places
        known = {*self.model.own, *tried, *self.model.starting, *(effect.place for effect in self.read_off)}
        unseen = [place for place in tried if place not in self.model.seen]
        for effect in CATALOGUE.values():
            if effect.component in COMPONENTS:
                unseen += [place for place in effect.places if place not in known]
        return tuple(unseen)

    def quantities(self) -> dict[str, Floats]:
        """Quantities (S, k) that the errors of the quoted pieces may depend on.

        ``rate``: mean rate about each axis; ``turn``: its integral; ``orientation``: specific force at the beginning;
        ``time``; ``temperature`` where the record has it.
        """
        motion, pieces = self.model.motion, self.quoted_part.pieces
        sums = np.cumsum((motion.rate - self.model.gyros.bias) * motion.step[:, None], axis=0)
        turn = sums[pieces.last] - sums[pieces.first]
        force = motion.force(pieces.first)
        quantities = {
            "rate": turn / pieces.durations(motion.time_s)[:, None],
            "turn": turn,
            "orientation": force / np.maximum(np.linalg.norm(force, axis=1), 1e-12)[:, None],
            "time": motion.time_s[pieces.first][:, None],
        }
        if motion.temperature is not None:
            quantities["temperature"] = motion.temperature[pieces.first][:, None]
        return quantities

    def head(self) -> Mapping[str, Any]:
        """Return the record, its reference, the bound, the baseline and the effects that such a record never shows."""
        bias, left_in = {}, None
        if self.lengths.as_measured is not None and self.model.falsified:
            left_in = rms_size(self.lengths.as_measured.parts[self.model.quoted].error) / ARCMIN
        if self.bias_at_rest is not None:
            bias = {"bias_at_rest": {"radps": self.bias_at_rest.tolist(), "rms_if_left_in_arcmin": left_in}}
        stated = {}
        if isinstance(self.model.reference, Truth) and self.model.reference.stated is not None:
            stated = {"reference_bound_arcmin": self.model.reference.stated / ARCMIN}
        jumping = (self.model.unsteady,) if self.model.jumps and self.model.unsteady else ()
        return {
            **super().head(),
            "warnings": (*self.warnings, *jumping),
            "noise_bound_arcmin": self.stated_bound,
            "cannot_be_seen": [place.entry for place in self.not_seen],
            **bias,
            **stated,
        }

    def power(self) -> Sequence[Mapping[str, Any]]:
        """The power of the record against the model without effects, of each place and quantity."""
        room = self.rows.bound * (1.0 + self.model.limit)
        return [pair_power.entry for pair_power in powers_of_record(self.pairs, self.rows.nominal, room)]

    @property
    def stated_bound(self) -> float:
        """The median bound of the quoted errors [arcmin]; all bounds scale with it."""
        return float(np.median(self.quoted_part.bound)) / ARCMIN

    def option_of_bounds(self, times: float, places: Sequence[EffectPlace]) -> str:
        """Return the option for the least error of the true attitude with which the model stands with effects.

        An error that multiplies all bounds by `times` suffices.
        """
        reference = self.model.reference
        if not isinstance(reference, Truth):
            return ""
        most = 0.0
        for part, of_truth in zip(self.rows.parts, reference.of_windows, strict=True):
            most = max(most, 0.5 * float((times - 1.0) * part.bound.max() + of_truth))
        low, high = max(reference.stated or 0.0, reference.at_rest), most
        while high - low > NEAR_LEAST * high:
            middle = 0.5 * (low + high)
            if self.model.with_stated(middle).refit(places).radius <= 1.0:
                high = middle
            else:
                low = middle
        return f"--reference-bound {upwards(high / ARCMIN, 3)}"

    def of_model(self, fit: Fit, calibration: Calibration, excluded: Exclusions) -> Mapping[str, Any]:
        """Return the warning of a wrong clock and the parameters that the record leaves open."""
        keys: dict[str, Any] = {"warnings": self._clock_doubt(fit)}
        if not fit.places and (missing := self._left_open(calibration.parameters, excluded)):
            keys["missing"] = missing
        return keys

    def calibration_of(self, fit: Fit | None = None) -> Calibration:
        """Return the block's least-squares parameters beside a fit's effects, with their possible intervals."""
        stands, names = fit is not None, self.rows.names
        fit = fit or self.model.baseline
        ends = np.tile([-np.inf, np.inf], (len(names), 1))
        if stands:
            ends = fit.ends(0.0, self.model.effort.most_rows)
        radius = fit.radius
        if not (stands and fit.places):
            for effect in self.read_off:
                radius = max(radius, effect.radius)
        falsified = not fit.places and (self.model.falsified or radius > self.model.limit)
        return Calibration(
            verdict="falsified" if falsified else "consistent",
            sigma=Sigma.of(None, self.bounds_from),
            radius=radius,
            estimator="analytic centre" if stands else "least squares",
            parameters=parameters_with(names, fit.estimate[: len(names)], ends, inside=True),
            units={"radius": "1", "parameters": UNITS["parameters"]},
        )

    def _left_open(self, parameters: Sequence[Parameter], excluded: Exclusions) -> tuple[str, ...]:
        """Return sentences on the gyros' parameters that the record leaves open, with data that determine them."""
        wide = []
        for parameter in parameters:
            low, high = parameter.low, parameter.high
            if low is None or high is None or (parameter.unit == "1" and high - low > 2.0 * LARGEST):
                wide.append(parameter.symbol)
        if wide:
            return (
                f"not determined: {', '.join(wide)}; turn the block about each of its axes, there and back, and let it "
                "rest in more poses",
            )
        if excluded is None:
            return ("a shorter record, since the work has a limit: the scale factors of this one were not bounded",)
        if not self.model.own and not any(entry["effect"] == SCALE.effect for entry in excluded):
            return ("the block hardly turns: no scale factor of a gyro is bounded; turn it about each of its axes",)
        return ()

    def _clock_doubt(self, fit: Fit) -> tuple[str, ...]:
        """Return a warning where the scale factors may all be alike: a wrong clock has the same effect on the rates."""
        if SCALE not in fit.places or self.model.found.record.rate is None:
            return ()
        intervals = fit.intervals(most_rows=self.model.effort.most_rows)[fit.places.index(SCALE)]
        low, high = np.array(intervals).reshape(3, 3, 2).transpose(2, 0, 1)
        least, most = float(np.diag(low).max()), float(np.diag(high).min())
        off_diagonal = ~np.eye(3, dtype=bool)
        zero_beside = (low[off_diagonal] <= 0.0).all() and (high[off_diagonal] >= 0.0).all()
        if not (least <= most and least * most > 0.0 and zero_beside):
            return ()
        percent = 50.0 * (least + most)
        changed = f"{exactly(abs(percent), 2)} % too {'long' if percent > 0 else 'short'}"
        return (f"time stamps that are {changed} would do the same",)

    def objections(self) -> tuple[str, ...]:
        """Return the objections: impossible parameters, gyros that wander at rest, errors left by all effects."""
        objections = []
        for (name, unit), value in zip(self.rows.names, self.model.baseline.central, strict=True):
            if unit == "1" and abs(value) > LARGEST:
                objections.append(f"{name} would be {digits(value, 2)}: check units, order and signs of the axes")
        if self.model.unsteady is not None and not self.model.jumps:
            objections.append(self.model.unsteady)
        if self.least_radius is not None:
            objections.append(self._too_large(self.least_radius))
        return tuple(objections)

    def _too_large(self, least: float) -> str:
        assert isinstance(self.model.reference, Truth)
        part, stated = self.quoted_part, self.model.reference.stated
        bound = float(np.median(part.bound)) / ARCMIN
        explained = "noise and reference at rest explain"
        scatter = f"at rest it scatters by {upwards(self.model.reference.at_rest / ARCMIN, 3)}"
        if stated is not None:
            explained = "noise at rest and the true attitude's error as stated explain"
            scatter = f"{exactly(stated / ARCMIN, 12)} is stated, and {scatter}"
        needed = upwards(self.needed(self.rows.places), 3)
        return (
            f"all effects of the catalogue together leave errors of {residual(least)} bounds, and none that sets in at "
            f"a time is enough: over {part.label} the bound would have to be {downwards(least * bound, 3)} arcmin, and "
            f"{explained} {upwards(bound, 3)}; something that is not in the catalogue acts, or the true attitude errs "
            f"more than that in motion: it would have to err by {needed} arcmin or more at a row; {scatter}"
        )

    def needed(self, places: Sequence[EffectPlace]) -> float:
        """Return the least bound of the true attitude's error at any row [arcmin] if only these effects act."""
        assert isinstance(self.model.reference, Truth)
        pairs = zip(self.rows.parts, self.model.reference.of_windows, strict=True)
        of_gyros = np.concatenate([(part.bound - of_truth).ravel() for part, of_truth in pairs]) / ARCMIN
        scale = np.concatenate([part.bound.ravel() for part in self.rows.parts]) / ARCMIN
        matrix, count = self.rows.matrix(places) * scale[:, None], len(self.rows.names)
        low, high = limits_of(places)
        free = np.full(count, np.inf)
        # A window has an error at each end.
        least, _, _ = chebyshev_radius(
            matrix,
            self.rows.residual * scale,
            np.full(len(scale), 2.0),
            growth=Growth(of_gyros, np.zeros_like(matrix), np.append(-free, low), np.append(free, high)),
        )
        return max(least, self.model.reference.at_rest / ARCMIN)

    def would_need(self, places: Sequence[EffectPlace]) -> str:
        """Return a sentence with the error of the true attitude that these effects alone would require."""
        if not isinstance(self.model.reference, Truth):
            return ""
        needed = upwards(self.needed(places), 3)
        return f"were that all, the true attitude would have to err by {needed} arcmin or more at a row"

    def channels(self) -> Sequence[Channel]:
        """Return the quoted errors about each axis, with the quantities that they may depend on."""
        part, errors = self.quoted_part, self.quoted_errors(self.model.baseline)
        if isinstance(self.model.reference, Gravity):
            up = self.model.reference.directions(self.rows.point[: len(NAMES)])
            errors = np.einsum("skp,sk->sp", self.model.reference.across(0, up), errors)
        bound, quantities = part.bound.max(axis=1), self.quantities()
        return [Channel({"axis": axis + 1}, errors[:, axis], bound, quantities) for axis in range(3)]

    def trials(self, fit: Fit) -> Iterator[Trial]:
        """Each effect of a fit: blocks in time left out without it, with it, with its signature at other pieces."""
        yield from trials_in_time(self.model.with_onsets(fit).rows, fit)

    def probe(self, fits: Sequence[Fit]) -> Mapping[str, Any]:
        """Return advice on data to add, to decide about the effects that only some of the sets hold."""
        open_effects = dict.fromkeys(place.effect for place in not_in_all(fits))
        shown_by: dict[str, list[str]] = {}
        for name in open_effects:
            shown_by.setdefault(SHOWN_BY.get(name, OF_ACCELEROMETERS), []).append(name)
        sentences = [f"{what} (shows {', '.join(names)})" for what, names in shown_by.items()]
        if isinstance(self.model.reference, Gravity) and "latency" in open_effects:
            sentences.append("the true attitude beside the record: between rests latency leaves no error")
        return {"next": sentences}


@dataclass(frozen=True, eq=False)
class CarriedRerun:
    """A record of a block that is carried, simulated again by FMUs of gyros and attitude computer."""

    model: Carried

    @property
    def quoted(self) -> tuple[str, str, float]:
        """Moves, or windows of the middle length, in arcminutes."""
        return self.model.rows.parts[self.model.quoted].label, "arcmin", ARCMIN

    def gain(self, fit: Fit) -> Gain | None:
        """Errors of pieces that were not used, in arcminutes, the quoted kind first; None: values that no gyro has.

        For each block in time the parameters are estimated on the others, without the effects and with them. The
        exported FMUs are run with these, and the errors of pieces within the block count.
        """
        model = self.model.with_onsets(fit)
        rows, folds = model.rows, model.rows.folds(FOLDS if len(model.motion) <= LONG else FOLDS_OF_LONG)
        before, after = self._errors_of_folds(model, (), folds), self._errors_of_folds(model, fit.places, folds)
        if before is None or after is None:
            return None
        kinds = []
        for k, errors_before, errors_after in zip(rows.scored, before, after, strict=True):
            label, count = rows.parts[k].label, len(errors_before)
            kinds.append(gain_of(errors_before, errors_after, ARCMIN, over=label, pieces=count))
        first, *further = sorted(kinds, key=lambda kind: abs(kinds.index(kind) - rows.scored.index(model.quoted)))
        return first.model_copy(update={"others": further})

    @staticmethod
    def _errors_of_folds(
        model: Carried, places: Sequence[EffectPlace], folds: Sequence[NDArray]
    ) -> list[Floats] | None:
        """Return the errors (S, d) of each scored part, each fold run with a fit of the others; None if impossible."""
        rows, of_rows = model.rows, model.rows.of_rows(folds)
        matrix, smoothing = rows.matrix(places), rows.smoothing(places)
        errors = [np.full(rows.parts[k].error.shape, np.nan) for k in rows.scored]
        with own_folder() as scratch:
            fmus = extended_fmus(places, scratch, RUN, usual_flavour())
            for fold in range(of_rows.max() + 1):
                remaining = of_rows != fold
                residual = np.append(rows.residual[remaining], np.zeros(len(smoothing)))
                solution = estimated(np.vstack((matrix[remaining], smoothing)), residual)
                gyros = model.gyros_with(places, solution)
                if not takes("GyroCompensation", gyros.parameters, gyros.effects):
                    return None
                numbers = [np.flatnonzero(folds[k] == fold) for k in rows.scored]
                try:
                    simulated = model.simulated(fmus, places, solution, numbers)
                except TurnsTooFar:
                    return None
                for error, at, simulated_errors in zip(errors, numbers, simulated, strict=True):
                    error[at] = simulated_errors
        return errors

    def errors(self, effects: Sizes) -> Floats:
        """Errors (S, d) of the quoted moves or windows [rad]."""
        model, rows = self.model, self.model.rows
        places, sizes, point = own_with(model, effects)
        numbers = [np.arange(len(rows.parts[k])) for k in rows.scored]
        with own_folder() as scratch:
            fmus = extended_fmus(places, scratch, RUN, usual_flavour())
            simulated = model.simulated(fmus, places, np.concatenate([point - rows.point, sizes]), numbers)
        return simulated[rows.scored.index(model.quoted)]

    def without(self, effects: Sizes) -> tuple[Sequence[EffectPlace], dict[str, Any]]:
        """Return the increments without the effects of the gyros, by the inverse of a block with them."""
        model, rows = self.model, self.model.rows
        places = []
        for place in effects:
            effect = place.definition
            if place in rows.places and effect.component == "GyroBlock" and effect.stage == "reading_effects":
                places.append(place)
        sizes = stacked_sizes(effects, places)
        values = model.values_of(places, np.concatenate([np.zeros(len(rows.names)), sizes]))
        return places, {"rate": None, "increment": compensated_increments(model.motion, values, model.found.gravity)}

    def reach(self, effects: Sizes, errors: Sizes) -> NDArray | None:
        """Return None: only gyros are corrected."""
        return None

    def extension(self, fit: Fit, effects: Sized) -> Extension:
        """Gyros, attitude computer and, where gravity is the reference, accelerometers as they are found, and a run.

        The run carries the attitude through the record, from the true one where it is known at the first row. The
        accelerometers' readings go through their inverse, unless they have effects, which it cannot take out.
        """
        point = fit.estimate[: len(self.model.rows.names)]
        gyros = self.model.with_onsets(fit).gyros_with(fit.places, np.append(point - self.model.rows.point, fit.stated))
        bias = gyros.bias
        least_point, most_point = fit.ends(0.0, self.model.effort.most_rows).T
        parameters, depends = self._parameters(point, bias), self._parameters(np.full(len(point), np.nan), bias)
        low, high = self._parameters(least_point, bias), self._parameters(most_point, bias)
        starts = []
        for name, values in parameters.items():
            least, most = elements_of(low[name]), elements_of(high[name])
            intervals = {}
            for element, unknown in elements_of(depends[name]).items():
                if np.isnan(unknown):
                    intervals[element] = least[element], most[element]
            starts.append(Start.of(name, values, intervals, effects))
        return Extension(starts, {"scenario": self._scenario(fit)})

    def _parameters(self, vector: NDArray, bias: NDArray) -> dict[str, Parameters]:
        """Return parameters of the components by the model's (P,); the gyros' bias (3,) [rad/s] if it has none."""
        x, gyro_values = np.split(vector, [self.model.of_forces])
        scale = gyro_values[3:] if SCALE in self.model.own else self.model.gyros.scale_misalignment
        gyros: Parameters = {"gravity": self.model.found.gravity}
        gyros |= {"bias": (gyro_values[:3] if self.model.own else bias).tolist(), "scale_misalignment": scale.tolist()}
        parameters: dict[str, Parameters] = {"GyroBlock": gyros, "GyroCompensation": gyros, "AttitudeComputer": {}}
        if len(x):
            gamma: dict[str, float] = dict(zip(NAMES, x.tolist(), strict=True))
            diagonal = [gamma[f"gamma_{p}{p}"] for p in (1, 2, 3)]
            block: Parameters = {
                "gravity": self.model.found.gravity,
                "scale_error_plus": diagonal,
                "scale_error_minus": diagonal,
                "gamma_21": gamma["gamma_21"],
                "gamma_31": gamma["gamma_31"],
                "gamma_32": gamma["gamma_32"],
                "bias": x[6:].tolist(),
            }
            parameters |= {"AccelerometerBlock": block, "AccelerometerCompensation": block}
        return parameters

    def _scenario(self, fit: Fit) -> Scenario:
        """The run of the exported FMUs through the record: it gives a strapdown record of the body."""
        _, attitude = starting_attitude(self.model.found.record)
        if self.model.found.record.attitude is None or not np.isfinite(self.model.found.record.attitude[0]).all():
            attitude = [1.0, 0.0, 0.0, 0.0]
        gyros = [place for place in fit.places if is_of_gyros(place)]
        fmus = {
            "compensation": FmuSetting(fmu="GyroCompensation.fmu"),
            "computer": FmuSetting(fmu="AttitudeComputer.fmu", parameters={"initial_attitude": attitude}),
        }
        recorded = {INCREMENT: "compensation.increment", QUATERNION: "computer.attitude"}
        if self.model.of_forces and len(gyros) == len(fit.places):
            fmus["accelerometers"] = FmuSetting(fmu="AccelerometerCompensation.fmu")
            recorded[FORCE] = "accelerometers.specific_force"
        columns = {}
        for names, output in recorded.items():
            for number, name in enumerate(names, start=1):
                columns[name] = f"{output}[{number}]"
        scenario = carried_scenario(self.model.motion, gyros, fmus)
        return scenario.model_copy(update={"record": RecordSetting(columns=columns)})
