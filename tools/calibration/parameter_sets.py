"""Calibrated block and gyros as components: parameter sets of SSP (.ssv), and FMUs that start with their values."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from ...fmus import build, components
from ...fmus.component import Component, can_extend, extend, started
from ...fmus.parameters import (
    Interval,
    Parameters,
    calibrated_block,
    calibrated_effects,
    calibrated_gyros,
    calibrated_intervals,
    of_one_record,
    parameter_set,
)
from ...models.effects import EffectPlace, parameter_name
from ..errors import InputError
from ..files import whole_file, whole_folder
from ..result import Result
from ..rounding import upwards

BLOCKS = {"": ("AccelerometerBlock", "AccelerometerCompensation"), "-gyros": ("GyroBlock", "GyroCompensation")}
"""Ending of a parameter set's name -> the components that it fits: the instruments, and their compensation."""
Sized = Mapping[EffectPlace, tuple[Sequence[float], Sequence[Interval]]]
"""Effects, each with the values of its parameters and the intervals of these."""


@dataclass(frozen=True)
class Start:
    """Start of a component: `values` of its parameters, and the `ends` of the possible intervals of their elements.

    `name` is that of its files; where it is not the component's the FMU starts with other values, and these are those
    of another mounting.
    """

    name: str
    component: Component
    values: Parameters
    ends: Mapping[str, Interval]

    @staticmethod
    def of(
        component: str, values: Parameters, ends: Mapping[str, Interval], effects: Sized, ending: str = ""
    ) -> "Start":
        """Return a component, by its name, with values of its own and of those effects that it can have.

        Raises a ValueError if the component does not accept a value. `ending` is the end of its files' name.
        """
        nominal = components()[component]
        acting = {place: sizes_and_ends for place, sizes_and_ends in effects.items() if can_extend(nominal, place)}
        parameters, possible = dict(values), dict(ends)
        for place, (sizes, intervals) in acting.items():
            for parameter, size, interval in zip(place.definition.parameters, sizes, intervals, strict=True):
                name = parameter_name(place, parameter.name)
                parameters[name], possible[name] = float(size), interval
        return Start(f"{component}{ending}", started(extend(nominal, list(acting)), parameters), parameters, possible)

    def write(self, path: Path, text: str) -> None:
        """Write the parameter set (.ssv); `text` describes it."""
        with whole_file(path) as beside:
            beside.write_bytes(parameter_set(self.component, self.values, text, self.ends))


@dataclass(frozen=True)
class CalibratedInstrument:
    """Components that start with a calibration's values by their endings in `BLOCKS`, and a description.

    `stays` are effects that the compensations do not take out, and explanations that none has, in words.
    """

    starts: Mapping[str, Sequence[Start]]
    text: str
    stays: Sequence[str]

    @classmethod
    def of(cls, result: Result, option: str) -> "CalibratedInstrument":
        """Return accelerometers and gyros; a calibration of several has the last's biases.

        Raises an InputError, which begins with the option, if the calibration lacks an estimate, or the components do
        not accept a value, or cannot have an effect.
        """
        try:
            content = of_one_record(result.to_json())
            effects = calibrated_effects(content)
            blocks: dict[str, tuple[Parameters, Mapping[str, Interval]]] = {}
            # A diagnosis of a strapdown record names effects of the gyros alone.
            if content["parameters"] or not effects:
                blocks[""] = calibrated_block(content), calibrated_intervals(content)
            of_gyros = calibrated_gyros(content) or ({}, {})
            beside_gyros = any(place.definition.component == "GyroBlock" for place in effects)
            if of_gyros[0] or beside_gyros:
                blocks["-gyros"] = of_gyros
            if beside_gyros and content.get("gravity_mps2") is not None:
                # Sensitivities are per g of this size.
                of_gyros[0]["gravity"] = content["gravity_mps2"]
            if not blocks:
                raise ValueError("the calibration has neither parameters nor effects of an instrument")
            starts = {}
            for ending, (values, ends) in blocks.items():
                starts[ending] = [Start.of(name, values, ends, effects) for name in BLOCKS[ending]]
        except ValueError as error:
            raise InputError(f"{option}: {error}") from error
        about, source, sigma = "an instrument", content.get("provenance"), content["sigma"]["value"]
        if source is not None:
            about = f"{source['record']} (SHA-256 {source['record_sha256'] or 'none'})"
        bound = "" if sigma is None else f", noise bound {upwards(sigma, 3)} g"
        stays = []
        for ending, (_, compensation) in starts.items():
            for place in effects:
                if place.definition.component == BLOCKS[ending][0] and place not in compensation.component.effects:
                    stays.append(f"{compensation.name} does not take out {place.title}")
        explanations = len(content.get("sets") or ())
        if explanations > 1:
            first = ", ".join(content["sets"][0]["effects"])
            stays.append(f"the record does not tell which of {explanations} explanations is true: these have {first}")
        return cls(starts, f"Calibration of {about}, verdict {content['verdict']}{bound}, case (A1)", stays)


def write_parameter_set(result: Result, path: Path) -> None:
    """Write the calibrated block as an .ssv file, values with their intervals; both components have these parameters.

    Calibrated gyros go into a file of their own, NAME-gyros.ssv. Errors as of `CalibratedInstrument.of`.
    """
    instrument = CalibratedInstrument.of(result, f"--ssv {path}")
    for ending, (block, _) in instrument.starts.items():
        block.write(path.with_name(f"{path.stem}{ending}{path.suffix}"), instrument.text)


def export_calibrated(result: Result, folder: Path) -> tuple[list[Path], Sequence[str]]:
    """Write FMUs that start with the calibrated values, and beside each its parameter set.

    Of accelerometers, and of gyros where they are calibrated, the block and its compensation. Errors as of
    `CalibratedInstrument.of`, and where the folder cannot be written. Returns the files, and in words what the
    compensations do not take out.
    """
    instrument = CalibratedInstrument.of(result, f"--export {folder}")
    files = []
    with whole_folder(folder) as draft:
        for starts in instrument.starts.values():
            for start in starts:
                files.append(build(start.component, draft))
                files.append(draft / f"{start.name}.ssv")
                start.write(files[-1], instrument.text)
    return [folder / path.name for path in files], instrument.stays
