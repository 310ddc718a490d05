"""What an extension does to what was not used to find it: the extended FMUs, exported, run by the orchestrator."""

import tempfile
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...fmus import build
from ...models.effects import CATALOGUE, EffectPlace
from .evidence import Evidence, Gain, estimated

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


def gain_by_folds(
    evidence: Evidence,
    places: Sequence[EffectPlace],
    count: int,
    simulated: Callable[[Sequence[EffectPlace], Path], Callable[[NDArray, Sequence[NDArray]], list[NDArray]]],
    unit: float,
) -> list[Gain]:
    """The gain on each scored kind of pieces, cut into blocks in time.

    For each block the parameters are estimated on the others, without the effects and with them; the exported FMUs
    are run with these; the errors of the block's own pieces count.

    Parameters
    ----------
    evidence : Evidence
    places : sequence of EffectPlace
        the effects that were named
    count : int
        of blocks
    simulated : callable
        effects, an empty folder for FMUs -> (solution (P + k,), numbers of some pieces of each kind -> their errors)
    unit : float
        in which sizes of errors are quoted
    """
    folds, results = evidence.folds(count), []
    with tempfile.TemporaryDirectory(prefix="trihedron-extended-", ignore_cleanup_errors=True) as name:
        for number, chosen in enumerate(((), tuple(places))):
            folder = Path(name) / str(number)
            folder.mkdir()
            simulate, matrix = simulated(chosen, folder), evidence.matrix(chosen)
            errors = [np.full(evidence.parts[k].error.shape, np.nan) for k in evidence.scored]
            for fold in range(folds.count):
                used = folds.of_row != fold
                solution = estimated(matrix[used], evidence.residual[used])
                held = [np.flatnonzero(folds.of_piece[k] == fold) for k in evidence.scored]
                for error, at, mine in zip(errors, held, simulate(solution, held), strict=True):
                    error[at] = mine
            results.append(errors)
    return [
        gain_of(before, after, unit, over=evidence.parts[k].label, pieces=len(before))
        for k, before, after in zip(evidence.scored, *results, strict=True)
    ]
