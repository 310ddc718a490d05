"""Evidence of a block that is carried by hand, or beside the true attitude.

The simulation, FMUs of gyro block and attitude computer, carries the attitude through the record; what it misses at the
ends of moves or windows is the evidence.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...fmus.parameters import Parameters, elements_of
from ...models.effects import CATALOGUE, EffectPlace
from ..bounded.programmes import Growth, chebyshev_radius
from ..calibrated import UNITS, Calibration, Parameter, Sigma
from ..locks import own_folder
from ..motion.carry import GyroModel, carried_attitude, carried_scenario, compensated_increments, reads
from ..motion.increments import starting_attitude
from ..motion.norm import LARGEST, NAMES
from ..orchestrator.load import usual_flavour
from ..orchestrator.scenario import FmuSetting, RecordSetting, Scenario
from ..records.columns import FORCE, INCREMENT, QUATERNION
from ..rounding import digits, downwards, exactly, residual, upwards
from .carried_run import BIAS, LONG, CarriedRun
from .evidence import Evidence, ReadOff, Trial, parameters_with, rms_size
from .extension import Extension, Sized, Start, takes
from .fit import ARCMIN, Fit, Gain, estimated, extended_fmus, gain_of
from .power import powers_of_record
from .references import Gravity, Truth, all_rows, rotation_vectors, turned
from .rows import Channel

SCALE = EffectPlace("gyro-scale-misalignment", "gyro-block")
LATENCY = EffectPlace("latency", "gyro-block")
COMPONENTS = ("GyroBlock", "AttitudeComputer", "AccelerometerBlock")
SHUFFLES = 40
FOLDS, FOLDS_OF_LONG = 4, 2
"""Blocks in time of which each is simulated with parameters from the others; of long records each is run by itself."""
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
OF_ACCELEROMETERS = "rests with each axis up, down and between, some of them repeated at the end"


@dataclass(frozen=True, eq=False)
class Carried(CarriedRun):
    """Evidence of a carried block.

    `bounds_from` says in words what the bounds come from; `least_radius` is what all effects together leave, where that
    is more than one bound; `limits` are those that the accelerometers show in rests.
    """

    bounds_from: str = ""
    least_radius: float | None = None
    limits: tuple[ReadOff, ...] = ()

    @property
    def read_off(self) -> tuple[ReadOff, ...]:
        """Accelerometers' limits that the model cannot do without."""
        return self.limits

    @property
    def quoted(self) -> int:
        """Number of the part whose errors are quoted: single moves, or the windows of the middle length."""
        return self.scored[0 if isinstance(self.reference, Gravity) else len(self.scored) // 2]

    @property
    def bias_at_rest(self) -> NDArray[np.float64] | None:
        """The gyros' mean at rest (3,) that was taken out [rad/s]."""
        return self.model.bias if self.at_rest is not None and len(self.found.rests) else None

    @property
    def not_seen(self) -> tuple[EffectPlace, ...]:
        """Effects on the block that this record could not show at any possible size."""
        every = (p for e in CATALOGUE.values() if e.component in COMPONENTS for p in e.places)
        told = (*self.own, *self.places, *self.starting, *(effect.place for effect in self.read_off))
        others = [place for place in every if place not in told]
        return (*(place for place in self.places if place not in self.seen), *others)

    def quantities(self) -> dict[str, NDArray[np.float64]]:
        """What the errors of the quoted pieces may depend on: (S, k) each.

        ``rate``: mean rate about each axis; ``turn``: its integral; ``orientation``: specific force at the beginning;
        ``time``; ``temperature`` where the record has it.
        """
        motion, pieces = self.motion, self.parts[self.quoted].pieces
        sums = np.cumsum((motion.rate - self.model.bias) * motion.step[:, None], axis=0)
        turn = sums[pieces.last] - sums[pieces.first]
        force = motion.force(pieces.first)
        found = {
            "rate": turn / pieces.durations(motion.time_s)[:, None],
            "turn": turn,
            "orientation": force / np.maximum(np.linalg.norm(force, axis=1), 1e-12)[:, None],
            "time": motion.time_s[pieces.first][:, None],
        }
        if motion.temperature is not None:
            found["temperature"] = motion.temperature[pieces.first][:, None]
        return found

    # Runs of the simulation

    def gyros_with(self, places: Sequence[EffectPlace], solution: NDArray) -> GyroModel:
        """The gyros with steps of the model's parameters and coefficients of effects (P + k,)."""
        gyros = with_parameters(self.model, self.own, solution[self.of_forces : len(self.names)])
        bias = gyros.bias
        if self.at_rest is not None:
            bias = bias - self.at_rest[:, self.numbers_of(places)] @ solution[len(self.names) :]
        own = {place: values for place, values in self.values_of(places, solution).items() if is_of_gyros(place)}
        return GyroModel(bias, gyros.scale_misalignment, own)

    def simulated(
        self, fmus: Mapping[str, Path], places: Sequence[EffectPlace], solution: NDArray, held: Sequence[NDArray]
    ) -> list[NDArray[np.float64]]:
        """Errors (n, d) of numbers (n,) of some pieces of each scored kind, by FMUs that are extended by effects.

        The solution (P + k,) are steps of the model's parameters and coefficients of the effects.
        """
        pieces = [kind.selected(at) for kind, at in zip(self.reference.scored, held, strict=True)]
        rows = all_rows(pieces)
        # What counts the hours must count them from the record's beginning; of a long record a part is run.
        whole = len(self.motion) <= LONG or reads(places, "HOURS")
        begin, end = (0, len(self.motion)) if whole else (int(rows[0]), int(rows[-1]) + 1)
        gyros = self.gyros_with(places, solution)
        attitude = carried_attitude(self.motion.part(begin, end), gyros, self.found.gravity, fmus)
        forces = {p: values for p, values in self.values_of(places, solution).items() if not is_of_gyros(p)}
        up = self.reference.directions((self.point + solution[: len(self.names)])[: len(NAMES)], forces)
        errors = []
        for k, (mine, at) in enumerate(zip(pieces, held, strict=True)):
            moved = replace(mine, first=mine.first - begin, last=mine.last - begin)
            errors.append(self.reference.errors(k, turned(moved, attitude), up, up, at))
        return errors

    def errors_along(self, attitude: NDArray, step: NDArray) -> list[NDArray[np.float64]]:
        """Errors of each part with another attitude and a step of the model's parameters; norms stay."""
        reference, x, errors = self.reference, self.point[: len(NAMES)], []
        first, up = reference.directions(x), reference.directions(x + step[: len(NAMES)])
        for part in self.parts:
            rotation = turned(part.pieces, attitude)
            if part.pieces.kind == "norms":
                errors.append(part.error)
            elif part.pieces.kind == "rests":
                errors.append(rotation_vectors(rotation))
            else:
                errors.append(reference.errors(reference.scored.index(part.pieces), rotation, up, first))
        return errors

    # What the engine asks

    @property
    def falsified(self) -> bool:
        """Whether the model cannot be true of the record; a bias that is not constant is not its."""
        return super().falsified or self.unsteady is not None

    @property
    def unsteady(self) -> str | None:
        """That the gyros are not constant at rest; None where they are but for noise."""
        return None if self.reference.noise is None else self.reference.noise.said

    @property
    def jumps(self) -> bool:
        """Whether a change of the biases between two rests makes the gyros constant at rest."""
        return self.reference.noise is not None and self.reference.noise.jumps

    def head(self) -> Mapping[str, Any]:
        """The record, what it is held against, the bound, the baseline and what no record of this kind shows."""
        bias = {} if self.bias_at_rest is None else {"bias_at_rest": self._bias_at_rest(None)}
        stated = {}
        if isinstance(self.reference, Truth) and self.reference.stated is not None:
            stated = {"reference_bound_arcmin": self.reference.stated / ARCMIN}
        jumping = (self.unsteady,) if self.jumps and self.unsteady else ()
        return {
            **super().head(),
            "warnings": (*self.warnings, *jumping),
            "noise_bound_arcmin": self.stated_bound,
            "cannot_be_seen": [place.entry for place in self.not_seen],
            **bias,
            **stated,
        }

    def _bias_at_rest(self, left_in: float | None) -> Mapping[str, Any]:
        assert self.bias_at_rest is not None
        return {"radps": self.bias_at_rest.tolist(), "rms_if_left_in_arcmin": left_in}

    def power(self) -> Sequence[Mapping[str, Any]]:
        """The power of the record against the model without effects, of each place and quantity."""
        room = self.bound * (1.0 + self.limit)
        return [one.entry for one in powers_of_record(self.pairs(), self.nominal, room)]

    @property
    def stated_bound(self) -> float:
        """The median bound of the quoted errors [arcmin]; all bounds grow as it does."""
        return float(np.median(self.parts[self.quoted].bound)) / ARCMIN

    def of_misfit(self) -> Mapping[str, Any]:
        """What the mean at rest would do, were it left in."""
        if (measured := self.as_measured()) is None:
            return {}
        return {"bias_at_rest": self._bias_at_rest(rms_size(measured.parts[self.quoted].error) / ARCMIN)}

    def as_measured(self) -> Evidence | None:
        """The evidence with the mean at rest left in; None where none is taken out."""
        if self.bias_at_rest is None or BIAS not in self.places:
            return None
        own = self.numbers_of([BIAS])
        return self.with_errors([part.error + part.columns[..., own] @ self.bias_at_rest for part in self.parts])

    def of_model(self, fit: Fit, calibration: Calibration, excluded: Sequence[Mapping[str, Any]]) -> Mapping[str, Any]:
        """What the record leaves open; what a wrong clock would do."""
        keys: dict[str, Any] = {"warnings": self._clock_doubt(fit)}
        if not fit.places and (missing := self._left_open(calibration.parameters, excluded)):
            keys["missing"] = missing
        return keys

    def calibration_of(self, fit: Fit | None = None) -> Calibration:
        """The block's parameters by least squares beside a fit's effects, and what the record leaves possible."""
        stands = fit is not None
        fit = fit or self.baseline
        ends = fit.ends(0.0, self.most_rows) if stands else np.tile([-np.inf, np.inf], (len(self.names), 1))
        radius = max([fit.radius, *(effect.radius for effect in self.read_off)])
        if stands and fit.places:
            radius = fit.radius
        falsified = not fit.places and (self.falsified or radius > self.limit)
        return Calibration(
            verdict="falsified" if falsified else "consistent",
            sigma=Sigma.of(None, self.bounds_from),
            radius=radius,
            estimator="analytic centre" if stands else "least squares",
            parameters=parameters_with(self.names, fit.estimate[: len(self.names)], ends, inside=True),
            units={"radius": "1", "parameters": UNITS["parameters"]},
        )

    def _left_open(self, parameters: Sequence[Parameter], excluded: Sequence[Mapping[str, Any]]) -> tuple[str, ...]:
        """What the record leaves open of the gyros, and what would tell it."""
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
        if not self.own and not any(entry["effect"] == SCALE.effect for entry in excluded):
            return ("the block hardly turns: no scale factor of a gyro is bounded; turn it about each of its axes",)
        return ()

    def _clock_doubt(self, fit: Fit) -> tuple[str, ...]:
        """That a wrong clock does to rates what scale factors do that are alike, where they may be alike."""
        if SCALE not in fit.places or self.found.record.rate is None:
            return ()
        intervals = fit.intervals(most_rows=self.most_rows)[fit.places.index(SCALE)]
        low, high = np.array(intervals).reshape(3, 3, 2).transpose(2, 0, 1)
        least, most = float(np.diag(low).max()), float(np.diag(high).min())
        beside = ~np.eye(3, dtype=bool)
        if not (least <= most and least * most > 0.0 and (low[beside] <= 0.0).all() and (high[beside] >= 0.0).all()):
            return ()
        percent = 50.0 * (least + most)
        changed = f"{exactly(abs(percent), 2)} % too {'long' if percent > 0 else 'short'}"
        return (f"time stamps that are {changed} would do the same",)

    def objections(self) -> tuple[str, ...]:
        """Parameters that no instrument has, gyros that wander at rest, errors that all effects together leave."""
        wandering = () if self.unsteady is None or self.jumps else (self.unsteady,)
        too_large = () if self.least_radius is None else (self._too_large(self.least_radius),)
        parameters = tuple(
            f"{name} would be {digits(value, 2)}: check units, order and signs of the axes"
            for (name, unit), value in zip(self.names, self.baseline.central, strict=True)
            if unit == "1" and abs(value) > LARGEST
        )
        return (*parameters, *wandering, *too_large)

    def _too_large(self, least: float) -> str:
        assert isinstance(self.reference, Truth)
        part, stated = self.parts[self.quoted], self.reference.stated
        bound = float(np.median(part.bound)) / ARCMIN
        explained = "noise and reference at rest explain"
        taken = f"at rest it scatters by {upwards(self.reference.at_rest / ARCMIN, 3)}"
        if stated is not None:
            explained = "noise at rest and the true attitude's error as stated explain"
            taken = f"{exactly(stated / ARCMIN, 12)} is stated, and {taken}"
        needed = upwards(self.needed(self.places), 3)
        return (
            f"all effects of the catalogue together leave errors of {residual(least)} bounds, and none that sets in at "
            f"a time is enough: over {part.label} the bound would have to be {downwards(least * bound, 3)} arcmin, and "
            f"{explained} {upwards(bound, 3)}; something that is not in the catalogue acts, or the true attitude errs "
            f"more than that in motion: it would have to err by {needed} arcmin or more at a row; {taken}"
        )

    def needed(self, places: Sequence[EffectPlace]) -> float:
        """The least bound of the true attitude's error at any row [arcmin] with which these effects are enough."""
        assert isinstance(self.reference, Truth)
        pairs = zip(self.parts, self.reference.of_windows, strict=True)
        others = np.concatenate([(part.bound - of_truth).ravel() for part, of_truth in pairs]) / ARCMIN
        scale = np.concatenate([part.bound.ravel() for part in self.parts]) / ARCMIN
        matrix, count = self.matrix(places) * scale[:, None], len(self.names)
        low, high = self.limits_of(places)
        free = np.full(count, np.inf)
        # A window has an error at each end.
        least, _, _ = chebyshev_radius(
            matrix,
            self.residual * scale,
            np.full(len(scale), 2.0),
            growth=Growth(others, np.zeros_like(matrix), np.append(-free, low), np.append(free, high)),
        )
        return max(least, self.reference.at_rest / ARCMIN)

    def would_need(self, places: Sequence[EffectPlace]) -> str:
        """By how much the true attitude would have to err where nothing acts but these effects."""
        if not isinstance(self.reference, Truth):
            return ""
        needed = upwards(self.needed(places), 3)
        return f"were that all, the true attitude would have to err by {needed} arcmin or more at a row"

    def channels(self) -> Sequence[Channel]:
        """The quoted errors about each axis, with what they may depend on."""
        part, left = self.parts[self.quoted], self.split(self.baseline.left)[self.quoted]
        if isinstance(self.reference, Gravity):
            up = self.reference.directions(self.point[: len(NAMES)])
            left = np.einsum("skp,sk->sp", self.reference.across(0, up), left)
        bound, quantities = part.bound.max(axis=1), self.quantities()
        return [Channel({"axis": axis + 1}, left[:, axis], bound, quantities) for axis in range(3)]

    def trials(self, fit: Fit) -> Iterator[Trial]:
        """Each effect of a fit: blocks in time left out without it, with it, with its signature at other pieces."""
        made = self.with_onsets(fit)
        folds, rng = made.folds(), np.random.default_rng(len(made.residual))
        reached = made.left_out(fit.places, folds)
        for place in fit.places:
            others = [p for p in fit.places if p != place]
            shuffled = (made._shuffled(place, rng).left_out(fit.places, folds) for _ in range(SHUFFLES))
            errors = made.left_out(others, folds), reached
            yield Trial((place,), errors, None, shuffled, rows=np.arange(len(reached)))

    def _shuffled(self, place: EffectPlace, rng: np.random.Generator) -> Evidence:
        """The evidence with the signature of one effect moved to other pieces of the same kind."""
        own, parts = self.numbers_of([place]), []
        for part in self.parts:
            columns = part.columns.copy()
            columns[..., own] = part.columns[rng.permutation(len(part))][..., own]
            parts.append(replace(part, columns=columns))
        return replace(self, parts=tuple(parts))

    def gain(self, fit: Fit) -> Gain | None:
        """Errors of pieces that were not used, in arcminutes, the quoted kind first; None: values that no gyro has.

        For each block in time the parameters are estimated on the others, without the effects and with them; the
        exported FMUs are run with these; the errors of the block's own pieces count.
        """
        made = self.with_onsets(fit)
        folds, results = made.folds(FOLDS if len(made.motion) <= LONG else FOLDS_OF_LONG), []
        of_rows = made.of_rows(folds)
        with own_folder() as scratch:
            for number, places in enumerate(((), fit.places)):
                folder = scratch / str(number)
                folder.mkdir()
                fmus = extended_fmus(places, folder, ("GyroCompensation", "AttitudeComputer"), usual_flavour())
                matrix = made.matrix(places)
                errors = [np.full(made.parts[k].error.shape, np.nan) for k in made.scored]
                for fold in range(of_rows.max() + 1):
                    solution = estimated(matrix[of_rows != fold], made.residual[of_rows != fold])
                    gyros = made.gyros_with(places, solution)
                    if not takes("GyroCompensation", gyros.parameters, gyros.effects):
                        return None
                    held = [np.flatnonzero(folds[k] == fold) for k in made.scored]
                    for error, at, mine in zip(errors, held, made.simulated(fmus, places, solution, held), strict=True):
                        error[at] = mine
                results.append(errors)
        kinds = [
            gain_of(before, after, ARCMIN, over=made.parts[k].label, pieces=len(before))
            for k, before, after in zip(made.scored, *results, strict=True)
        ]
        first, *others = sorted(kinds, key=lambda kind: abs(kinds.index(kind) - made.scored.index(made.quoted)))
        return first.model_copy(update={"others": others})

    def applied(self, effects: Mapping[EffectPlace, NDArray]) -> NDArray[np.float64]:
        """Errors (S, d) of the quoted moves or windows [rad]."""
        places, sizes, point = self.own_with(effects)
        held = [np.arange(len(self.parts[k])) for k in self.scored]
        with own_folder() as scratch:
            fmus = extended_fmus(places, scratch, ("GyroCompensation", "AttitudeComputer"), usual_flavour())
            found = self.simulated(fmus, places, np.concatenate([point - self.point, sizes]), held)
        return found[self.scored.index(self.quoted)]

    def without_added(self, effects: Mapping[EffectPlace, NDArray]) -> tuple[Sequence[EffectPlace], dict[str, Any]]:
        """Increments less what effects of the gyros add to them, by the inverse of a block with them."""
        undone = {p: (p.definition.component, p.definition.stage) == ("GyroBlock", "reading_effects") for p in effects}
        places = [p for p in effects if p in self.places and undone[p]]
        known = np.concatenate([np.zeros(0), *(effects[place] for place in places)])
        sizes = self.values_of(places, np.concatenate([np.zeros(len(self.names)), known]))
        return places, {"rate": None, "increment": compensated_increments(self.motion, sizes, self.found.gravity)}

    @property
    def quoted_errors(self) -> tuple[str, str, float]:
        """Moves, or windows of the middle length, in arcminutes."""
        return self.parts[self.quoted].label, "arcmin", ARCMIN

    def extension(self, fit: Fit, effects: Sized) -> Extension:
        """Gyros, attitude computer and, where gravity is the reference, accelerometers as they are found, and a run.

        The run carries the attitude through the record, from the true one where it is known at the first row; the
        accelerometers' readings go through their inverse, unless they have effects, which it cannot take out.
        """
        point = fit.estimate[: len(self.names)]
        gyros = self.with_onsets(fit).gyros_with(fit.places, np.append(point - self.point, fit.stated))
        bias = gyros.bias
        vectors = (point, *fit.ends(0.0, self.most_rows).T, np.full(len(point), np.nan))
        found, low, high, depends = (self._parameters(vector, bias) for vector in vectors)
        starts = []
        for name, values in found.items():
            least, most, told = (elements_of(side[name]) for side in (low, high, depends))
            intervals = {element: (least[element], most[element]) for element, v in told.items() if np.isnan(v)}
            starts.append(Start.of(name, values, intervals, effects))
        return Extension(starts, {"scenario": self._scenario(fit)})

    def _parameters(self, vector: NDArray, bias: NDArray) -> dict[str, Parameters]:
        """Parameters of the components with the model's (P,); the gyros' bias (3,) [rad/s] where it is none."""
        x, own = np.split(vector, [self.of_forces])
        scale = own[3:] if SCALE in self.own else self.model.scale_misalignment
        gyros: Parameters = {"gravity": self.found.gravity}
        gyros |= {"bias": (own[:3] if self.own else bias).tolist(), "scale_misalignment": scale.tolist()}
        found: dict[str, Parameters] = {"GyroBlock": gyros, "GyroCompensation": gyros, "AttitudeComputer": {}}
        if len(x):
            gamma: dict[str, float] = dict(zip(NAMES, x.tolist(), strict=True))
            diagonal = [gamma[f"gamma_{p}{p}"] for p in (1, 2, 3)]
            block: Parameters = {
                "gravity": self.found.gravity,
                "scale_error_plus": diagonal,
                "scale_error_minus": diagonal,
                **{name: gamma[name] for name in ("gamma_21", "gamma_31", "gamma_32")},
                "bias": x[6:].tolist(),
            }
            found |= {"AccelerometerBlock": block, "AccelerometerCompensation": block}
        return found

    def _scenario(self, fit: Fit) -> Scenario:
        """The run of the exported FMUs through the record: it gives a strapdown record of the body."""
        _, attitude = starting_attitude(self.found.record)
        if self.found.record.attitude is None or not np.isfinite(self.found.record.attitude[0]).all():
            attitude = [1.0, 0.0, 0.0, 0.0]
        gyros = [place for place in fit.places if is_of_gyros(place)]
        fmus = {
            "compensation": FmuSetting(fmu="GyroCompensation.fmu"),
            "computer": FmuSetting(fmu="AttitudeComputer.fmu", parameters={"initial_attitude": attitude}),
        }
        shown = {INCREMENT: "compensation.increment", QUATERNION: "computer.attitude"}
        if self.of_forces and len(gyros) == len(fit.places):
            fmus["accelerometers"] = FmuSetting(fmu="AccelerometerCompensation.fmu")
            shown[FORCE] = "accelerometers.specific_force"
        columns = {name: f"{output}[{i}]" for names, output in shown.items() for i, name in enumerate(names, start=1)}
        made = carried_scenario(self.motion, gyros, fmus)
        return made.model_copy(update={"record": RecordSetting(columns=columns)})

    def probe(self, fits: Sequence[Fit]) -> Mapping[str, Any]:
        """What to add to the record, for the effects that not all sets have."""
        common = set(fits[0].places).intersection(*(fit.places for fit in fits[1:]))
        open_effects = dict.fromkeys(place.effect for fit in fits for place in fit.places if place not in common)
        shown_by: dict[str, list[str]] = {}
        for name in open_effects:
            shown_by.setdefault(SHOWN_BY.get(name, OF_ACCELEROMETERS), []).append(name)
        said = [f"{what} (shows {', '.join(names)})" for what, names in shown_by.items()]
        if isinstance(self.reference, Gravity) and "latency" in open_effects:
            said.append("the true attitude beside the record: between rests latency leaves no error")
        return {"next": said}


def is_of_gyros(place: EffectPlace) -> bool:
    """Whether an effect is carried with the attitude; others change what the accelerometers say at rest."""
    return place.definition.component != "AccelerometerBlock"


def with_parameters(model: GyroModel, places: Sequence[EffectPlace], step: NDArray) -> GyroModel:
    """The gyros with steps (3,) or (9,) of bias, scale and misalignment added, in the order of the places."""
    bias, scale, at = model.bias, model.scale_misalignment, 0
    for place in places:
        if place == BIAS:
            bias, at = bias + step[at : at + 3], at + 3
        else:
            scale, at = scale + step[at : at + 9], at + 9
    return GyroModel(bias, scale, model.effects)
