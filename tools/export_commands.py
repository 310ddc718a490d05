"""The command that writes FMUs; a thin layer over `trihedron.tools.library.export`."""

from pathlib import Path
from typing import Annotated, Literal

from cyclopts import Parameter

from .answers import Answer, answer
from .options import JsonFile, OutFolder


def export(
    *components: str,
    fmi: Annotated[Literal["2", "3"], Parameter(help="FMI version; 3 needs --flavour native.")] = "2",
    flavour: Annotated[
        Literal["python", "native"], Parameter(help="What the FMU runs: Python by PythonFMU, or machine code.")
    ] = "python",
    platform: Annotated[
        str | None, Parameter(help="Of the native flavour: host (the default), all, or a name as aarch64-linux.")
    ] = None,
    effect: Annotated[
        tuple[str, ...], Parameter(help='Extend by an effect, as "quadratic accelerometer-3"; may be repeated.')
    ] = (),
    out: OutFolder = Path("fmus-exported"),
    json: JsonFile = None,
) -> Answer:
    """Write components as FMUs; all of them when none is named.

    Example: trihedron export TurntableMotion AccelerometerBlock --flavour native --fmi 3 --out fmus

    Parameters
    ----------
    components
        Names of components.
    out
        Folder for the FMUs.
    """
    from .exporting import export as write

    done = write(*components, out=out, flavour=flavour, fmi=int(fmi), platform=platform, effects=effect)
    return answer(done.lines(), json, done.to_json())
