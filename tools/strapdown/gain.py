"""What an extension does to moves and windows that were not used: the extended FMU, exported, run by the orchestrator.

The record is cut into blocks in time. For each the parameters are estimated on the others, without the effects and with
them; the exported FMUs carry the attitude through the record with these; the errors of the block's own pieces count.
"""

import tempfile
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...fmus import build
from ...models.effects import CATALOGUE, EffectPlace
from ..orchestrator.built import usual_flavour
from .building import Built, with_parameters
from .carrying import GyroModel, carried_attitude, reads
from .gravity_system import GravityPieces, directions_of, move_errors
from .held_out import blocks_in_time, largest_angle, rms_angle
from .inspection import Inspection
from .norm_calibration import NAMES
from .segments import Segments, all_rows
from .signatures import turned
from .system import weighted_step
from .truth_system import window_errors

FOLDS = 4
NAMED_FOR = {"GyroCompensation": "GyroBlock"}
"""The component whose effects another one takes out."""
LONG, FOLDS_OF_LONG = 1_000_000, 2
"""A record of more rows is cut into two blocks, and each is run by itself."""
ARCMIN = np.pi / 180.0 / 60.0
"""[rad]"""


@dataclass(frozen=True, eq=False)
class Gain:
    """Errors of pieces that were not used to estimate anything, of each kind of moves or windows.

    Attributes
    ----------
    segments : tuple of Segments
        the kinds; the first is the one that is quoted
    before, after : tuple of (S, d) array
        without and with the effects [rad]
    """

    segments: tuple[Segments, ...]
    before: tuple[NDArray[np.float64], ...]
    after: tuple[NDArray[np.float64], ...]

    def summary(self) -> dict[str, Any]:
        """Root mean squares and maxima [arcmin], of the kind that is quoted and of every other."""
        rows = [
            {
                "over": parts.label,
                "pieces": len(parts),
                "held_out_rms_before": rms_angle(before) / ARCMIN,
                "held_out_rms_after": rms_angle(after) / ARCMIN,
                "held_out_max_before": largest_angle(before) / ARCMIN,
                "held_out_max_after": largest_angle(after) / ARCMIN,
            }
            for parts, before, after in zip(self.segments, self.before, self.after, strict=True)
        ]
        return {**rows[0], "others": rows[1:]}


def export_extended(places: Sequence[EffectPlace], folder: Path, flavour: str) -> dict[str, Path]:
    """Write the FMUs that carry the attitude, extended by effects, into a folder: component -> file."""
    of_gyros = [p for p in places if CATALOGUE[p.effect].component == "GyroBlock"]
    of_computer = [p for p in places if CATALOGUE[p.effect].component == "AttitudeComputer"]
    return {
        "GyroCompensation": build("GyroCompensation", folder, of_gyros, flavour=flavour),
        "AttitudeComputer": build("AttitudeComputer", folder, of_computer, flavour=flavour),
    }


def export_gyros(places: Sequence[EffectPlace], folder: Path) -> list[Path]:
    """Write the components that effects extend, and the compensation that takes them out, into a folder."""
    components = dict.fromkeys(c for place in places if (c := CATALOGUE[place.effect].component) is not None)
    if "GyroBlock" in components:
        components["GyroCompensation"] = None
    return [
        build(name, folder, [p for p in places if CATALOGUE[p.effect].component == NAMED_FOR.get(name, name)])
        for name in components
    ]


def measure_gain(found: Inspection, built: Built, places: Sequence[EffectPlace]) -> Gain:
    """Estimate on some blocks, run the exported FMUs, take the errors of the others.

    Parameters
    ----------
    found : Inspection
        of the record
    built : Built
        its system
    places : sequence of EffectPlace
        the effects that were named
    """
    system = built.system
    long = len(built.motion) > LONG
    blocks = blocks_in_time(system, FOLDS_OF_LONG if long else FOLDS)
    of_row = blocks.rows(system)
    scored = [k for k, part in enumerate(system.parts) if part.scored]
    results: list[list[NDArray]] = []
    with tempfile.TemporaryDirectory(prefix="trihedron-extended-", ignore_cleanup_errors=True) as name:
        for number, chosen in enumerate(((), tuple(places))):
            folder = Path(name) / str(number)
            folder.mkdir()
            fmus = export_extended(chosen, folder, usual_flavour())
            errors = [np.full(system.parts[k].error.shape, np.nan) for k in scored]
            matrix = system.matrix(chosen)
            for block in range(blocks.count):
                used = of_row != block
                solution = weighted_step(matrix[used], system.residual[used])
                mine = [np.flatnonzero(blocks.of_piece[k] == block) for k in scored]
                # What counts the hours must count them from the record's beginning.
                whole = not long or reads(chosen, "HOURS")
                for error, at, found_errors in zip(
                    errors, mine, _errors(found, built, chosen, solution, fmus, mine, whole=whole), strict=True
                ):
                    error[at] = found_errors
            results.append(errors)
    order = sorted(range(len(scored)), key=lambda i: abs(i - (0 if built.forces else len(scored) // 2)))
    segments = tuple(system.parts[scored[i]].segments for i in order)
    return Gain(segments, tuple(results[0][i] for i in order), tuple(results[1][i] for i in order))


def _errors(
    found: Inspection,
    built: Built,
    places: Sequence[EffectPlace],
    solution: NDArray,
    fmus: dict[str, Path],
    mine: Sequence[NDArray],
    *,
    whole: bool,
) -> list[NDArray]:
    """Errors of some pieces of each kind with the parameters of a solution, by the exported FMUs.

    The whole record is run, or the part of it that holds the pieces.
    """
    system = built.system
    count = len(NAMES) if built.forces else 0
    step = solution[: len(system.names)]
    effects = effects_of(system.names, places, solution)
    forces = {p: v for p, v in effects.items() if CATALOGUE[p.effect].component == "AccelerometerBlock"}
    gyros = with_parameters(built.model, built.own, step[count:])
    others = {p: v for p, v in effects.items() if p not in forces}
    bias = gyros.bias
    if built.at_rest is not None:
        bias = bias - built.at_rest[:, system.numbers_of(places)] @ solution[len(system.names) :]
    model = GyroModel(bias, gyros.scale_misalignment, others)
    kinds = built.pieces.moves if isinstance(built.pieces, GravityPieces) else built.pieces
    pieces = [kind.selected(at) for kind, at in zip(kinds, mine, strict=True)]
    rows = all_rows(pieces)
    begin, end = (0, len(built.motion)) if whole else (int(rows[0]), int(rows[-1]) + 1)
    attitude = carried_attitude(built.motion.part(begin, end), model, found.gravity, fmus)
    moved = [replace(piece, first=piece.first - begin, last=piece.last - begin) for piece in pieces]
    if isinstance(built.pieces, GravityPieces):
        up = directions_of(system.point[:count] + step[:count], found.rests, found.gravity, forces)
        return [
            move_errors(turned(moves, attitude), up[ends[at, 0]], up[ends[at, 1]])
            for moves, ends, at in zip(moved, built.pieces.ends, mine, strict=True)
        ]
    assert found.record.attitude is not None
    truth = found.record.attitude[begin:end]
    return [window_errors(windows, truth, attitude) for windows in moved]


def effects_of(
    names: Sequence[tuple[str, str]], places: Sequence[EffectPlace], solution: NDArray
) -> dict[EffectPlace, tuple[float, ...]]:
    """Values of the effects' parameters from a solution (P + k,)."""
    found, at = {}, len(names)
    for place in places:
        effect = CATALOGUE[place.effect].at(place)
        found[place] = effect.from_coefficients(solution[at : at + len(effect.parameters)])
        at += len(effect.parameters)
    return found
