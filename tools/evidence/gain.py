"""What an extension does to what was not used to find it: the extended FMUs, exported, run by the orchestrator."""

import tempfile
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...fmus import build
from ...models.effects import CATALOGUE, EffectPlace
from ..bounded.spaces import least_squares
from ..motion.carry import carried_attitude, reads
from ..motion.norm import NAMES
from ..orchestrator.load import usual_flavour
from .carried import LONG, Carried, is_of_gyros
from .evidence import DETERMINED, Gain
from .references import Gravity, all_rows, turned

FOLDS, FOLDS_OF_LONG = 4, 2
"""Blocks in time of a carried record; a long one is cut into fewer, and each is run by itself."""
NAMED_FOR = {"GyroCompensation": "GyroBlock"}
"""The component whose effects another one takes out."""
ARCMIN = np.pi / 180.0 / 60.0
"""[rad]"""


def gain_of(before: NDArray, after: NDArray, unit: float = 1.0, **more: Any) -> Gain:
    """The gain by errors (S, d) without and with the effects, whose sizes are quoted in a unit."""
    figures = {}
    for name, errors in (("before", before), ("after", after)):
        sizes = np.linalg.norm(errors, axis=1) / unit
        figures |= {f"held_out_rms_{name}": float(np.sqrt(np.mean(sizes**2))), f"held_out_max_{name}": sizes.max()}
    return Gain(before=before, after=after, **figures, **more)


def export_extended(
    places: Sequence[EffectPlace], folder: Path, components: Sequence[str] = (), flavour: str = "python"
) -> dict[str, Path]:
    """Write FMUs that are extended by effects into a folder: component -> file.

    Parameters
    ----------
    places : sequence of EffectPlace
    folder : Path
    components : sequence of str
        by default those that the effects extend, and the compensation that takes the gyros' out
    flavour : str
        as for `trihedron.fmus.build`
    """
    extended = {c for place in places if (c := CATALOGUE[place.effect].component) is not None}
    if "GyroBlock" in extended:
        extended.add("GyroCompensation")
    of = {name: NAMED_FOR.get(name, name) for name in components or sorted(extended)}
    return {
        name: build(name, folder, [p for p in places if CATALOGUE[p.effect].component == own], flavour=flavour)
        for name, own in of.items()
    }


def carried_gain(made: Carried, places: Sequence[EffectPlace]) -> Gain:
    """The gain on a carried record, cut into blocks in time.

    For each block the parameters are estimated on the others, without the effects and with them; the exported FMUs
    carry the attitude through the record with these; the errors of the block's own pieces count.
    """
    long = len(made.motion) > LONG
    folds = made.folds(FOLDS_OF_LONG if long else FOLDS)
    results = []
    with tempfile.TemporaryDirectory(prefix="trihedron-extended-", ignore_cleanup_errors=True) as name:
        for number, chosen in enumerate(((), tuple(places))):
            folder = Path(name) / str(number)
            folder.mkdir()
            fmus = export_extended(chosen, folder, ("GyroCompensation", "AttitudeComputer"), usual_flavour())
            errors = [np.full(made.parts[k].error.shape, np.nan) for k in made.scored]
            matrix = made.matrix(chosen)
            for fold in range(folds.count):
                used = folds.of_row != fold
                solution = least_squares(matrix[used], made.residual[used], DETERMINED)
                held = [np.flatnonzero(folds.of_piece[k] == fold) for k in made.scored]
                # What counts the hours must count them from the record's beginning.
                whole = not long or reads(chosen, "HOURS")
                found = simulated_errors(made, chosen, solution, held, fmus, whole=whole)
                for error, at, mine in zip(errors, held, found, strict=True):
                    error[at] = mine
            results.append(errors)
    quoted = made.scored.index(made.quoted)
    order = sorted(range(len(made.scored)), key=lambda i: abs(i - quoted))
    kinds = [
        gain_of(before, after, ARCMIN, over=made.parts[made.scored[i]].label, pieces=len(before))
        for i, before, after in ((i, results[0][i], results[1][i]) for i in order)
    ]
    return kinds[0].model_copy(update={"others": kinds[1:]})


def simulated_errors(
    made: Carried,
    places: Sequence[EffectPlace],
    solution: NDArray,
    held: Sequence[NDArray],
    fmus: dict[str, Path],
    *,
    whole: bool = True,
) -> list[NDArray[np.float64]]:
    """Errors of some pieces of each scored kind, by the exported FMUs with the parameters of a solution.

    Parameters
    ----------
    made : Carried
    places : sequence of EffectPlace
        with which the FMUs are extended
    solution : (P + k,) array
    held : sequence of (n,) array of int
        numbers of the pieces, of each kind
    fmus : dict
        component -> FMU file
    whole : bool
        whether the whole record is run, or the part of it that holds the pieces
    """
    count, reference = len(made.names), made.reference
    step, effects = solution[:count], made.values_of(places, solution)
    model = made.gyros_with(step, effects, solution[count:])
    pieces = [kind.selected(at) for kind, at in zip(reference.scored, held, strict=True)]
    rows = all_rows(pieces)
    begin, end = (0, len(made.motion)) if whole else (int(rows[0]), int(rows[-1]) + 1)
    attitude = carried_attitude(made.motion.part(begin, end), model, made.found.gravity, fmus)
    shifted = [replace(mine, first=mine.first - begin, last=mine.last - begin) for mine in pieces]
    rotations = [turned(mine, attitude) for mine in shifted]
    if not isinstance(reference, Gravity):
        return [reference.errors(k, rotation, at) for k, (rotation, at) in enumerate(zip(rotations, held, strict=True))]
    forces = {place: values for place, values in effects.items() if not is_of_gyros(place)}
    up = reference.directions((made.point + step)[: len(NAMES)], forces)
    return [
        np.einsum("skp,sp->sk", reference.across(k, up, at), reference.errors(k, rotation, up, at))
        for k, (rotation, at) in enumerate(zip(rotations, held, strict=True))
    ]
