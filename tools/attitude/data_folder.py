"""Where measured records are looked for, and where they come from."""

import os
from pathlib import Path

VARIABLE = "TRIHEDRON_DATA"
"""Environment variable that names the folder of the measured records."""

WHERE_TO_GET = (
    "broad-03.strapdown.csv is not here: it is trial 03 (undisturbed slow rotation) of the BROAD data set, D. Laidig "
    "et al., doi 10.3390/data6070072 (github.com/dlaidig/broad, CC BY 4.0), written as a strapdown record; "
    f"put it into a folder and name that in ${VARIABLE}"
)
"""What a person reads where the record is not there."""


def find_record(name: str) -> Path | None:
    """Look for a measured record by its file's name.

    Parameters
    ----------
    name : str
        such as "broad-03.strapdown.csv"

    Returns
    -------
    Path or None
        in the folder that $TRIHEDRON_DATA names, else in `../shared/data` beside the checkout, else None
    """
    named = os.environ.get(VARIABLE)
    checkout = Path(__file__).resolve().parents[2]
    for folder in [*([Path(named)] if named else []), checkout.parent / "shared" / "data"]:
        path = folder / Path(name).name
        if path.is_file():
            return path
    return None
