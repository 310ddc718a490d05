"""Versions of the program and of installed distributions."""

from functools import cache
from importlib import import_module

from ..version import VERSION


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
