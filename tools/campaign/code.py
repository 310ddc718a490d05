"""Hash of the code that affects results: a campaign or a batch goes on with the same code alone."""

import hashlib
import platform
from functools import cache
from pathlib import Path

from ... import fmus, models

PACKAGES = ("trihedron", "numpy", "scipy", "highspy", "numba", "polars", "fmpy")
_CODE = (
    "bounded",
    "by_hand",
    "calibrated.py",
    "calibration",
    "campaign",
    "compiled.py",
    "diagnosis",
    "evidence",
    "motion",
    "noise",
    "orchestrator",
    "papers",
    "records",
    "sieve",
    "trials",
)
"""Sub-packages and modules of the tools that affect results, beside models and fmus."""


@cache
def code_hash() -> str:
    """Return the hash of the code that affects results, and of the versions of its packages."""
    digest = hashlib.sha256(f"{platform.python_version()} {platform.machine()}".encode())
    for package in PACKAGES:
        digest.update(f"\0{package} {fmus.version(package)}".encode())
    tools = Path(__file__).parents[1]
    places = [Path(str(package.__file__)).parent for package in (models, fmus)]
    places += [tools / name for name in _CODE]
    for place in places:
        for path in sorted(place.rglob("*.py")) if place.is_dir() else [place]:
            digest.update(f"\0{path.relative_to(place.parent).as_posix()}\0".encode() + path.read_bytes())
    return digest.hexdigest()
