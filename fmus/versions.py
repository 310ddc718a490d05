"""The version of the program, and those of installed distributions."""

from functools import cache
from importlib import import_module

VERSION = "0.2.0"
"""Version of the program, as in pyproject.toml."""


@cache
def version(package: str = "trihedron") -> str:
    """Version of a distribution that is installed, "none" where it is not: each is looked for once."""
    if package == "trihedron":
        return VERSION
    metadata = import_module("importlib.metadata")
    try:
        return metadata.version(package)
    except metadata.PackageNotFoundError:
        return "none"
