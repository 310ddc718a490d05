"""Options that several commands take."""

from pathlib import Path
from typing import Annotated, Literal

from cyclopts import Parameter

from .outputs import json_file, ordinary_file, ordinary_folder
from .printing import report_file

Baseline = Literal["asymmetric", "symmetric"]
DiagnosisBaseline = Annotated[
    Literal["asymmetric", "symmetric", "calibrated", "nominal"] | None,
    Parameter(
        help="Of a position record: asymmetric (the default) or symmetric scale factors. Of a strapdown record: the "
        "gyros calibrated (the default where gravity is the reference) or nominal (where the true attitude is known)."
    ),
]
Record = Annotated[Path, Parameter(help="Position record or raw record, CSV or Parquet.")]
NoiseBound = Annotated[
    float | None,
    Parameter(
        allow_leading_hyphen=True,
        help="σ: bound of one averaged reading's error, as a fraction of g; without it the record must tell.",
    ),
]
Gravity = Annotated[float, Parameter(allow_leading_hyphen=True, help="Model value of gravity [m/s²].")]
Bounds = Annotated[
    tuple[float, float],
    Parameter(allow_leading_hyphen=True, help="u^max and v0^max of (1.7): when the sign of an input is certain."),
]
Mounting = Annotated[str, Parameter(help="Name of a preset, or a TOML file with [name] matrix = [[...], ...].")]
OutFolder = Annotated[Path, Parameter(name="--out", validator=ordinary_folder)]
JsonFile = Annotated[
    Path | None,
    Parameter(
        name="--json",
        allow_leading_hyphen=True,
        help="Write the result as JSON to this file; - is standard output, in place of the text.",
        validator=json_file,
    ),
]
ReportFile = Annotated[
    Path | None,
    Parameter(name="--report", help="Write a page with pictures to this file, .html or .pdf.", validator=report_file),
]
SsvFile = Annotated[
    Path | None,
    Parameter(
        name="--ssv",
        help="Write the block's parameters as an SSP 1.0 parameter set (.ssv) to this file.",
        validator=ordinary_file,
    ),
]
Priors = Annotated[
    tuple[str, ...],
    Parameter(
        name="--prior",
        allow_leading_hyphen=True,
        help="What is known beforehand: X16=1e-3 for |X16| <= 1e-3, or 'bounds' for all by --bounds; may be repeated.",
    ),
]
