"""One strapdown record with a secret, written."""

import json
from collections.abc import Sequence
from pathlib import Path

from ..errors import InputError
from ..files import write_text
from ..records import write_record
from .cases import draw_case, draw_clean

RECORD_DECIMALS = 9
"""Decimals of a record's numbers."""


def write_hidden_strapdown(
    path: Path, seed: int, answer: Path | None, *, effects: Sequence[str] = (), clean: bool = False
) -> None:
    """Draw a case, measure it and write the record; the secret goes to `answer`, or nowhere.

    Parameters
    ----------
    path : Path
        strapdown record (CSV)
    seed : int
        from 0 to 2**31 - 1; of an even seed the record has gravity for its reference, of an odd one the true attitude
    answer : Path or None
        JSON file for the secret and the block's true parameters
    effects : sequence of str
        names to draw from
    clean : bool
        hide nothing

    Raises
    ------
    InputError
        a seed out of range, an effect that cannot be hidden, or a file that cannot be written
    """
    if not 0 <= seed < 2**31:
        raise InputError(f"--seed {seed}: must be a whole number from 0 to {2**31 - 1}")
    case = draw_clean(seed, seed) if clean else draw_case(seed, seed, tuple(effects))
    record = case.record()
    if answer is not None:
        write_text(answer, json.dumps(case.answer(), indent=2) + "\n")
    try:
        write_record(record, path, decimals=RECORD_DECIMALS)
    except InputError:
        if answer is not None:
            answer.unlink(missing_ok=True)
        raise
