"""Parts of numpy that scipy takes by a star and does not use: they load at first use, and a command starts sooner."""

import sys
from importlib.util import LazyLoader, find_spec, module_from_spec

import numpy as np


def postpone(name: str) -> None:
    """Let a part of numpy that is not loaded yet load at its first use."""
    spec = find_spec(f"numpy.{name}")
    if name in vars(np) or spec is None or spec.loader is None:
        return
    spec.loader = LazyLoader(spec.loader)
    part = module_from_spec(spec)
    sys.modules[spec.name] = part
    spec.loader.exec_module(part)
    setattr(np, name, part)


for _part in ("f2py", "ma", "polynomial", "testing"):
    postpone(_part)
