"""Published rows that are not reproduced: what is known of each, and what was tried."""

from dataclasses import dataclass

from .published import ANGLES
from .reproduction import ReproducedRow

TOLERANCE = 0.05
"""A number is reproduced when it comes out within this fraction of the printed one."""

TRIED = "tried without success: exact π, other T, errors taken at every n-th step only, words of 36 to 42 bits"


@dataclass(frozen=True)
class Unexplained:
    """Rows that do not come out, and what can be said of them."""

    rows: tuple[int, ...]
    sentence: str


UNEXPLAINED = (
    Unexplained(
        (5, 17),
        "variant 5: ψ and γ are printed 8e-6 degrees larger, ϑ agrees to four digits; tried without success: exact π, "
        "T from 60 to 1200 s, normalised quaternions",
    ),
    Unexplained((36,), "γ in print is 5.74e-7, surely for 5.74e-6: the text has it two orders below 5.97e-4"),
    Unexplained(
        (43, 45),
        "not possible as the largest errors of one run: an error of ϑ that is drift about the third axis is seen in γ "
        f"with sin 15° of its size, which is more than the γ in print; {TRIED}",
    ),
    Unexplained(
        (46,),
        "ϑ fits normalised quaternions, γ fits quaternions that are not, ψ lies halfway between: (7.20) itself is "
        "reconstructed, the book was not at hand",
    ),
    Unexplained((38, 74, 75, 80), f"drift in ψ or γ comes out larger than in print; {TRIED}"),
    Unexplained((62, 69), f"ψ comes out 14 % larger than in print from the first second on; {TRIED}"),
    Unexplained(
        (78, 83),
        "(7.20) and (19) carry the same three numbers in print: one row is a copy, and neither fits it in all angles",
    ),
    Unexplained((79, 84), f"ϑ comes out 6 % larger and 8 % smaller than in print, while ψ agrees; {TRIED}"),
)
"""What is known of the rows that are not reproduced."""


def not_reproduced(row: ReproducedRow) -> list[str]:
    """The angles of a row that come out more than `TOLERANCE` away from print."""
    return [name for name, ratio in zip(ANGLES, row.ratio, strict=True) if not abs(ratio - 1.0) <= TOLERANCE]


def sentence_for(row: ReproducedRow) -> str:
    """What is known of a row that is not reproduced; empty for one that is."""
    if not not_reproduced(row):
        return ""
    known = [entry.sentence for entry in UNEXPLAINED if row.row.number in entry.rows]
    return known[0] if known else "unknown"
