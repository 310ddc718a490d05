"""Single records of a table's positions for the tests: a bench with one effect, or none, and what it reads."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

from numpy.typing import NDArray

from trihedron.models.effects import EffectPlace
from trihedron.tools.records import PositionRecord
from trihedron.tools.trials import suite
from trihedron.tools.trials.bench import plain_bench
from trihedron.tools.trials.draw import Case, draw_alone
from trihedron.tools.trials.sizes import Hidden


@dataclass(frozen=True)
class HiddenCase:
    """A bench in its one mounting, with one effect or none."""

    truth: dict[str, dict[str, Any]]
    place: EffectPlace | None
    values: tuple[float, ...]
    alpha: NDArray
    beta: NDArray

    def answer(self) -> dict[str, Any]:
        return _case(self, 0).answer()["hidden"]


def draw_case(seed: int, **options: Any) -> HiddenCase:
    """A bench with an effect, drawn; options of `trihedron.tools.trials.draw.draw_alone`."""
    case = draw_alone(seed, **options)
    (place, values) = (case.hidden[0].place, case.hidden[0].values) if case.hidden else (None, ())
    return HiddenCase(case.bench.truth, place, values, case.bench.alpha, case.bench.beta)


def measure(case: HiddenCase, seed: int) -> PositionRecord:
    """What a laboratory would hand over."""
    return _case(case, seed).measured()


def _case(case: HiddenCase, seed: int) -> Case:
    bench = plain_bench(case.truth, case.alpha, case.beta, symmetric=False)
    return Case(seed, None, bench, () if case.place is None else (Hidden(case.place, case.values),))


def write_hidden_record(path: Path, seed: int, answer: Path | None = None, **options: Any) -> None:
    """A record in a file; options of `trihedron.tools.trials.draw.draw_alone`."""
    suite.write_hidden_record(draw_alone(seed, **options), path, answer)
