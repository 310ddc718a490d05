"""Files from the field that showed a fault: in `field/` of the folder of measured data."""

import gzip
import os
from pathlib import Path

import pytest


def field_file(name: str, folder: Path) -> Path:
    """Return a file of the field, unpacked into a folder if it is packed; skip the test without it."""
    places = [Path(__file__).resolve().parents[2] / "shared" / "data"]
    if os.environ.get("TRIHEDRON_DATA"):
        places.insert(0, Path(os.environ["TRIHEDRON_DATA"]))
    for place in places:
        plain, packed = place / "field" / name, place / "field" / f"{name}.gz"
        if plain.is_file():
            return plain
        if packed.is_file():
            path = folder / name
            path.write_bytes(gzip.decompress(packed.read_bytes()))
            return path
    pytest.skip(f"field/{name} is not here: give the folder of measured data as TRIHEDRON_DATA")
