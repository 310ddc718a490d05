"""The command that shows the whole loop."""

import sys
from contextlib import redirect_stdout
from io import StringIO
from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from .answers import STANDARD_OUTPUT, Answer, answer
from .options import JsonFile, OutFolder


def demo(
    *,
    out: OutFolder = Path("demo-results"),
    seed: int = 2026,
    show: Annotated[bool, Parameter(negative="--no-show")] = True,
    json: JsonFile = None,
) -> Answer:
    """Run the whole loop, from simulation to measured data to a named cause, and open the page of results.

    Example: trihedron demo --out demo-results

    Parameters
    ----------
    out
        Folder for everything that is made.
    seed
        Of the record with the hidden effect.
    show
        Open the page in a browser where there is a screen.
    """
    from .demo import run_demo
    from .hidden import check_seed

    check_seed(seed)
    with redirect_stdout(StringIO() if json == STANDARD_OUTPUT else sys.stdout):
        page = run_demo(out, seed=seed, show=show)
    files = sorted(str(path) for path in out.rglob("*") if path.is_file())
    return answer("", json, {"schema": "trihedron.demo/1", "page": str(page), "seed": seed, "files": files})
