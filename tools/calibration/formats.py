"""Calibrations for other programs: the form in each, its content, its equation, and the list of losses."""

import io
import json
import re
import zipfile
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from datetime import datetime
from pathlib import Path
from typing import Any, Literal, get_args

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from ..errors import InputError
from ..files import whole_file
from ..options import ExportTarget
from ..result import Result
from ..rounding import digits, upwards
from .affine import AffineModel, ExportRequest, stays_in_readings
from .correction import Correction

TARGETS: tuple[str, ...] = get_args(ExportTarget)
NAME = re.compile(r"[A-Za-z][A-Za-z0-9_]{0,30}")
"""A name in C and in MATLAB."""


class ExportedCalibration(Result):
    """Files of a calibration for another program.

    Attributes
    ----------
    to : str
        the program or format
    files : list of str
    equation : list of str
        how it corrects, with the files' names of the matrices
    lost : list of str
        what of the calibration the format cannot hold, and its size
    open : list of str
        directions that the calibration leaves open
    """

    schema_: Literal["trihedron.exported-calibration/1"] = Field(
        default="trihedron.exported-calibration/1", alias="schema"
    )
    to: str
    files: list[str]
    equation: list[str]
    gravity: float = Field(alias="gravity_mps2")
    verdict: str
    lost: list[str]
    open: list[str]


def write_export(correction: Correction, to: str, out: Path, request: ExportRequest) -> ExportedCalibration:
    """Write a correction for another program; see `trihedron.export_calibration`."""
    if to not in TARGETS:
        raise InputError(f"--to {to}: is not known; give one of {', '.join(TARGETS)}")
    if not NAME.fullmatch(request.name):
        raise InputError(f"--name {request.name}: must be a name of C: letters, digits, underscores, a letter first")
    model = AffineModel.of(correction)
    written = FORMATS[to](model, request)
    places = _places(out, written.contents)
    for path, content in places.items():
        with whole_file(path) as draft:
            draft.write_bytes(content)
    return ExportedCalibration(
        to=to,
        files=[str(path) for path in places],
        equation=list(written.equation),
        gravity_mps2=model.gravity,
        verdict=model.verdict,
        lost=[*written.lost, *stays_in_readings(correction)],
        open=list(model.open),
    )


def _places(out: Path, contents: Mapping[str, bytes]) -> dict[Path, bytes]:
    """Return the contents by their files: `out`, and beside it NAME-gyros for the part of that name."""
    places = {}
    for part, content in contents.items():
        places[out.with_name(f"{out.stem}-{part}{out.suffix}") if part else out] = content
    return places


FIRST_DAY = datetime(1980, 1, 1)
"""Date in a workbook: the same calibration gives the same bytes."""
DEGREES = 180.0 / np.pi
REAL32 = 9
"""Type of a parameter in files of QGroundControl."""


@dataclass(frozen=True)
class Written:
    """An export: contents of its files by the part in their names ("" for the file itself), equation, losses."""

    contents: Mapping[str, bytes]
    equation: Sequence[str]
    lost: Sequence[str] = ()


def _lost(model: AffineModel, *, gyros: bool = True) -> list[str]:
    """Return the losses of a format with one matrix for the accelerometers."""
    lost = []
    if model.asymmetry:
        error = digits(1e3 * model.asymmetry / model.gravity, 2)
        lost.append(f"the mean of both scale factors of an accelerometer stands for the two: up to {error} mg at 1 g")
    if gyros and model.gyros is None:
        lost.append("the calibration has no gyros: theirs are left as read")
    return lost


def _comments(about: Mapping[str, str], mark: str = "#") -> str:
    """Return keys and texts as comment lines; each text on one line, whatever it holds."""
    lines = []
    for key, text in about.items():
        lines.append(f"{mark} {key}: {' '.join(text.split())}\n")
    return "".join(lines)


def _number(value: float) -> str:
    """Return a number as YAML 1.1 reads it, too: with a point, also before an exponent."""
    text = repr(float(value))
    mantissa, exponent, power = text.partition("e")
    if exponent and "." not in mantissa:
        return f"{mantissa}.0e{power}"
    return text


def _row(values: NDArray | Sequence[float]) -> str:
    return f"[{', '.join(_number(value) for value in np.ravel(values))}]"


def _rows(matrix: NDArray, indent: str) -> str:
    return "".join(f"{indent}- {_row(row)}\n" for row in matrix)


def _triangular(matrix: NDArray) -> tuple[NDArray, NDArray]:
    """Return L (3, 3), lower triangular with a positive diagonal, and an orthogonal Q (3, 3) with L Q = matrix."""
    turned, upper = np.linalg.qr(matrix.T)
    signs = np.sign(np.diag(upper))
    return upper.T * signs, (turned * signs).T


def kalibr(model: AffineModel, request: ExportRequest) -> Written:
    """imu.yaml of kalibr: noise densities, and the matrices under the names of its results."""
    if request.densities is None or request.rate is None:
        raise InputError(
            "--to kalibr: needs the noise: give --noise NOISE.json of `trihedron noise`, or --rate HZ with --densities "
            "and four numbers: of the accelerometers m/s2/√Hz and m/s3/√Hz, of the gyros rad/s/√Hz and rad/s2/√Hz"
        )
    if not all(0.0 < value < np.inf for value in (*request.densities, request.rate)):
        raise InputError("--to kalibr: kalibr takes densities and a rate above 0 only")
    names = (
        "accelerometer_noise_density",
        "accelerometer_random_walk",
        "gyroscope_noise_density",
        "gyroscope_random_walk",
    )
    text = _comments(dict(model.about) | {"kalibr": "starts at M = I: give it corrected readings, or keep this M"})
    for note in request.notes:
        text += f"# {note}\n"
    for name, value in zip(names, request.densities, strict=True):
        text += f"{name}: {_number(value)}\n"
    text += f"rostopic: {json.dumps(request.topic)}\nupdate_rate: {_number(request.rate)}\nmodel: scale-misalignment\n"
    text += f"accelerometers:\n  M:\n{_rows(model.accelerometers.matrix, '  ')}"
    equation = ["accelerometers: r = M f + b, M lower triangular, forward"]
    if model.gyros is not None:
        lower, turned = _triangular(model.gyros.matrix)
        matrices = {"M": lower, "A": model.sensitivity @ turned.T, "C_gyro_i": turned}
        text += "gyroscopes:\n"
        for name, matrix in matrices.items():
            text += f"  {name}:\n{_rows(matrix, '  ')}"
        equation.append("gyros: w = M C_gyro_i ω + A C_gyro_i f + c, M lower triangular, C_gyro_i a rotation")
    bias = f"kalibr's file has no biases: b = {_row(model.accelerometers.bias)} m/s2"
    if model.gyros is not None:
        bias += f", c = {_row(model.gyros.bias)} rad/s"
    return Written({"": text.encode()}, equation, [*_lost(model, gyros=False), bias])


def imucal(model: AffineModel, request: ExportRequest) -> Written:
    """FerrarisCalibrationInfo of imucal, JSON 2.0.0; gyros in deg/s."""
    scale = np.linalg.norm(model.accelerometers.matrix, axis=1)
    gyros, bias = np.eye(3), np.zeros(3)
    if model.gyros is not None:
        gyros, bias = model.gyros.matrix, model.gyros.bias
    gyro_scale = np.linalg.norm(gyros, axis=1)
    content = {
        "acc_unit": "m/s^2",
        "gyr_unit": "deg/s",
        "from_acc_unit": "m/s^2",
        "from_gyr_unit": "deg/s",
        "comment": _comments(model.about, "").strip(),
        "K_a": np.diag(scale).tolist(),
        "R_a": (model.accelerometers.matrix / scale[:, None]).tolist(),
        "b_a": model.accelerometers.bias.tolist(),
        "K_g": np.diag(gyro_scale).tolist(),
        "R_g": (gyros / gyro_scale[:, None]).tolist(),
        "K_ga": (DEGREES * model.sensitivity).tolist(),
        "b_g": (DEGREES * bias).tolist(),
        "cal_type": "Ferraris",
        "_format_version": "2.0.0",
    }
    equation = [
        "accelerometers: f = (K_a R_a)^-1 (r - b_a) [m/s2]",
        "gyros: ω = (K_g R_g)^-1 (w - K_ga f - b_g) [deg/s], readings in deg/s, too",
    ]
    return Written({"": (json.dumps(content, indent=4) + "\n").encode()}, equation, _lost(model))


def ros(model: AffineModel, request: ExportRequest) -> Written:
    """A parameter file of ROS 2, with the names of imu_calib: the bias is subtracted after the matrix."""
    text = _comments(model.about)
    text += "/**:\n  ros__parameters:\n"
    inverse = model.accelerometers.inverse
    numbers: dict[str, NDArray] = {
        "SM": inverse,
        "bias": inverse @ model.accelerometers.bias,
        "matrix_standard_error": model.accelerometers.matrix_sd,
        "raw_bias_standard_error": model.accelerometers.bias_sd,
    }
    equation = ["accelerometers: f = SM r - bias, SM row by row, the bias after the matrix [m/s2]"]
    if model.gyros is not None:
        back = model.gyros.inverse
        numbers |= {
            "gyro_SM": back,
            "gyro_bias": back @ model.gyros.bias,
            "gyro_acceleration": back @ model.sensitivity,
            "gyro_matrix_standard_error": model.gyros.matrix_sd,
            "gyro_raw_bias_standard_error": model.gyros.bias_sd,
        }
        equation.append("gyros: ω = gyro_SM w - gyro_acceleration f - gyro_bias [rad/s]")
    text += f"    gravity: {_number(model.gravity)}\n"
    for name, values in numbers.items():
        if np.isfinite(values).all():
            text += f"    {name}: {_row(values)}\n"
    return Written({"": text.encode()}, equation, _lost(model))


def _c_array(values: NDArray) -> str:
    if values.ndim == 1:
        return f"{{{', '.join(repr(float(value)) for value in values)}}}"
    return f"{{{', '.join(_c_array(row) for row in values)}}}"


_C_FORCE = """
/* Specific force [m/s2] of readings [m/s2]. */
static inline void @_force(const double reading[3], double force[3])
{
    for (int i = 0; i < 3; ++i) {
        double rest = reading[i] - @_bias[i];
        for (int k = 0; k < i; ++k)
            rest -= @_matrix[i][k] * force[k];
        force[i] = rest / (rest > 0.0 ? @_scale_plus[i] : @_scale_minus[i]);
    }
}
"""
_C_RATE = """
/* Angular rate [rad/s] of readings [rad/s], at the specific force [m/s2] that @_force gives. */
static inline void @_rate(const double reading[3], const double force[3], double rate[3])
{
    double rest[3];
    for (int i = 0; i < 3; ++i)
        rest[i] = reading[i] - @_gyro_bias[i] - @_gyro_acceleration[i][0] * force[0]
            - @_gyro_acceleration[i][1] * force[1] - @_gyro_acceleration[i][2] * force[2];
    for (int i = 0; i < 3; ++i)
        rate[i] = @_gyro_inverse[i][0] * rest[0] + @_gyro_inverse[i][1] * rest[1] + @_gyro_inverse[i][2] * rest[2];
}
"""


def c_header(model: AffineModel, request: ExportRequest) -> Written:
    """A header of C99 (and C++): the numbers, and a function for accelerometers and one for gyros."""
    guard = f"{request.name.upper()}_CALIBRATION_H"
    said = _comments(model.about, " *").replace("*/", "* /")
    text = f"/* Calibration of an inertial instrument, written by Trihedron.\n{said} */\n"
    text += f"#ifndef {guard}\n#define {guard}\n\n"
    numbers: dict[str, tuple[str, NDArray, str]] = {
        "matrix": ("[3][3]", model.accelerometers.matrix, "A, below its diagonal"),
        "scale_plus": ("[3]", model.plus, "diagonal of A for positive inputs"),
        "scale_minus": ("[3]", model.minus, "diagonal of A for negative inputs"),
        "bias": ("[3]", model.accelerometers.bias, "b [m/s2]"),
        "matrix_standard_error": ("[3][3]", model.accelerometers.matrix_sd, "1 sigma"),
        "bias_standard_error": ("[3]", model.accelerometers.bias_sd, "1 sigma [m/s2]"),
    }
    functions = _C_FORCE
    equation = [f"{request.name}_force(reading, force): f = A^-1 (r - b) [m/s2]"]
    if model.gyros is not None:
        numbers |= {
            "gyro_inverse": ("[3][3]", model.gyros.inverse, "G^-1"),
            "gyro_acceleration": ("[3][3]", model.sensitivity, "D [rad/s per m/s2]"),
            "gyro_bias": ("[3]", model.gyros.bias, "c [rad/s]"),
            "gyro_matrix_standard_error": ("[3][3]", model.gyros.matrix_sd, "1 sigma of G"),
            "gyro_bias_standard_error": ("[3]", model.gyros.bias_sd, "1 sigma [rad/s]"),
        }
        functions += _C_RATE
        equation.append(f"{request.name}_rate(reading, force, rate): ω = G^-1 (w - D f - c) [rad/s]")
    text += f"static const double {request.name}_gravity = {model.gravity!r}; /* m/s2 */\n"
    for name, (size, values, words) in numbers.items():
        if np.isfinite(values).all():
            text += f"static const double {request.name}_{name}{size} = {_c_array(values)}; /* {words} */\n"
    text += functions.replace("@", request.name)
    return Written({"": f"{text}\n#endif\n".encode()}, equation)


def _arrays(model: AffineModel) -> dict[str, tuple[NDArray, str]]:
    """Return all numbers of a model by name, with their units."""
    inverse = model.accelerometers.inverse
    arrays = {
        "gravity": (np.array([model.gravity]), "m/s2"),
        "A": (model.accelerometers.matrix, "1"),
        "A_inverse": (inverse, "1"),
        "A_standard_error": (model.accelerometers.matrix_sd, "1"),
        "scale_plus": (model.plus, "1"),
        "scale_minus": (model.minus, "1"),
        "b": (model.accelerometers.bias, "m/s2"),
        "b_standard_error": (model.accelerometers.bias_sd, "m/s2"),
    }
    if model.gyros is not None:
        arrays |= {
            "G": (model.gyros.matrix, "1"),
            "G_inverse": (model.gyros.inverse, "1"),
            "G_standard_error": (model.gyros.matrix_sd, "1"),
            "D": (model.sensitivity, "rad/s per m/s2"),
            "D_standard_error": (model.sensitivity_sd, "rad/s per m/s2"),
            "c": (model.gyros.bias, "rad/s"),
            "c_standard_error": (model.gyros.bias_sd, "rad/s"),
        }
    return arrays


def _equation(model: AffineModel) -> list[str]:
    """Return the equations with all numbers of a model."""
    equation = ["accelerometers: f = A_inverse (r - b) [m/s2]"]
    if model.asymmetry:
        equation = [
            "accelerometers, in their order: f_i = (r_i - b_i - A_ij f_j for j < i) / scale_plus_i, or scale_minus_i "
            "where that is negative [m/s2]"
        ]
    if model.gyros is not None:
        equation.append("gyros: ω = G_inverse (w - D f - c) [rad/s]")
    return equation


def _about(model: AffineModel) -> dict[str, str]:
    """Return what every export says, with the equations in the names of the arrays."""
    return dict(model.about) | {"correction": "; ".join(_equation(model))}


def matlab(model: AffineModel, request: ExportRequest) -> Written:
    """A .mat file (version 5) with one structure."""
    from scipy.io import savemat

    fields: dict[str, Any] = {name: values for name, (values, _) in _arrays(model).items()}
    for name in ("b", "b_standard_error", "c", "c_standard_error", "scale_plus", "scale_minus"):
        if name in fields:
            fields[name] = fields[name][:, None]
    fields["about"] = _comments(_about(model), "").strip()
    stream = io.BytesIO()
    savemat(stream, {request.name: fields}, appendmat=False)
    # The first 116 bytes are a text, in which scipy writes the time.
    title = b"MATLAB 5.0 MAT-file, calibration of an inertial instrument, written by Trihedron"
    return Written({"": title.ljust(116) + stream.getvalue()[116:]}, _equation(model))


def _table(model: AffineModel) -> list[list[str | int | float | None]]:
    """Return all numbers of a model as rows: name, row, column, value, unit."""
    rows: list[list[str | int | float | None]] = []
    for name, (values, unit) in _arrays(model).items():
        for place, value in np.ndenumerate(values):
            row, column = place[0] + 1, (place[1] + 1 if len(place) > 1 else None)
            if np.isfinite(value):
                rows.append([name, row, column, float(value), unit])
    return rows


HEADER = ["name", "row", "column", "value", "unit"]


def csv_table(model: AffineModel, request: ExportRequest) -> Written:
    """A table with a row for each number, under comment lines."""
    lines = [",".join(HEADER)]
    for row in _table(model):
        lines.append(",".join("" if cell is None else str(cell) for cell in row))
    return Written({"": (_comments(_about(model)) + "\n".join(lines) + "\n").encode()}, _equation(model))


def workbook(model: AffineModel, request: ExportRequest) -> Written:
    """An Excel workbook: the matrices, all numbers as a table, and what every export says."""
    import xlsxwriter

    stream = io.BytesIO()
    book = xlsxwriter.Workbook(stream, {"in_memory": True, "strings_to_formulas": False, "strings_to_urls": False})
    book.set_properties({"created": FIRST_DAY, "title": "Calibration of an inertial instrument"})
    bold = book.add_format({"bold": True})
    about = book.add_worksheet("about")
    for row, (key, text) in enumerate(_about(model).items()):
        about.write_string(row, 0, key, bold)
        about.write_string(row, 1, text)
    matrices = book.add_worksheet("matrices")
    top = 0
    for name, (values, unit) in _arrays(model).items():
        if not np.isfinite(values).all():
            continue
        matrices.write_string(top, 0, f"{name} [{unit}]", bold)
        square = values if values.ndim == 2 else values[:, None]
        for place, value in np.ndenumerate(square):
            matrices.write_number(top + 1 + place[0], place[1], float(value))
        top += len(square) + 2
    table = book.add_worksheet("table")
    for row, cells in enumerate([HEADER, *_table(model)]):
        for column, cell in enumerate(cells):
            if cell is not None:
                table.write(row, column, cell, bold if row == 0 else None)
    for sheet in (about, matrices, table):
        sheet.set_column(0, 0, 24)
    book.close()
    return Written({"": _undated(stream.getvalue())}, _equation(model))


def _undated(content: bytes) -> bytes:
    """Return a ZIP archive whose parts have no date of their own."""
    stream = io.BytesIO()
    with zipfile.ZipFile(io.BytesIO(content)) as dated, zipfile.ZipFile(stream, "w", zipfile.ZIP_DEFLATED) as undated:
        for name in dated.namelist():
            undated.writestr(zipfile.ZipInfo(name), dated.read(name), zipfile.ZIP_DEFLATED)
    return stream.getvalue()


def imu_tk(model: AffineModel, request: ExportRequest) -> Written:
    """Files of imu_tk's CalibratedTriad: T, K and B; both triads in axes in which T is upper triangular."""
    turned, upper = np.linalg.qr(model.accelerometers.inverse)
    signs = np.sign(np.diag(upper))
    turned, upper = turned * signs, upper * signs[:, None]
    about = dict(model.about) | {
        "imu_tk": "X' = T K (X - B); first T, then K, then B",
        "its axes": f"f' = R f, R row by row {_row(turned.T)}",
    }
    contents = {"": _imu_tk_triad(upper, model.accelerometers.bias, about)}
    angle = np.arccos(np.clip(0.5 * (np.trace(turned) - 1.0), -1.0, 1.0))
    lost = _lost(model, gyros=False)
    lost.append(
        f"the axes are turned by {digits(1e3 * angle, 3)} mrad, as T is upper triangular; the file has the rotation"
    )
    if model.gyros is not None:
        back = turned.T @ model.gyros.inverse
        contents["gyros"] = _imu_tk_triad(back, model.gyros.bias, about)
        largest = float(np.linalg.norm(model.sensitivity, 2)) * model.gravity
        if largest:
            lost.append(f"the gyros' sensitivity to specific force: up to {upwards(largest)} rad/s at 1 g")
    return Written(contents, ["X' = T K (X - B) for each triad, readings X; [m/s2], [rad/s]"], lost)


def _imu_tk_triad(matrix: NDArray, bias: NDArray, about: Mapping[str, str]) -> bytes:
    """Return a triad with T K = matrix (3, 3), T with ones on its diagonal; the program ignores what follows B."""
    scale = np.diag(matrix)
    parts = []
    for values in (matrix / scale, np.diag(scale), bias[:, None]):
        parts.append("".join(" ".join(repr(float(value)) for value in row) + "\n" for row in values))
    return "\n".join([*parts, _comments(about)]).encode()


def px4(model: AffineModel, request: ExportRequest) -> Written:
    """Parameters of PX4 as QGroundControl loads them: offset and scale of each accelerometer, offsets of the gyros."""
    matrix = model.accelerometers.matrix
    scale = np.diag(matrix) / np.sum(matrix**2, axis=1)
    remaining = scale[:, None] * matrix - np.eye(3)
    rms = float(np.sqrt(np.sum(remaining**2) / 3.0))
    lines = [_comments(model.about) + "# Vehicle-Id Component-Id Name Value Type\n"]
    values = {}
    for p, axis in enumerate("XYZ"):
        values[f"CAL_ACC0_{axis}OFF"] = model.accelerometers.bias[p]
        values[f"CAL_ACC0_{axis}SCALE"] = scale[p]
    lost = _lost(model, gyros=False)
    lost.append(f"misalignments of the accelerometers: {digits(1e3 * rms, 2)} mg rms over all poses")
    if model.gyros is not None:
        for p, axis in enumerate("XYZ"):
            values[f"CAL_GYRO0_{axis}OFF"] = model.gyros.bias[p]
        part = float(np.abs(model.gyros.inverse - np.eye(3)).max())
        lost.append(f"scale factors and misalignments of the gyros: up to {digits(100.0 * part, 2)} % of the rate")
        largest = float(np.linalg.norm(model.sensitivity, 2)) * model.gravity
        if largest:
            lost.append(f"the gyros' sensitivity to specific force: up to {upwards(largest)} rad/s at 1 g")
    for name, value in values.items():
        lines.append(f"1\t1\t{name}\t{float(value)!r}\t{REAL32}\n")
    equation = ["accelerometers: f = (r - OFF) SCALE, axis by axis; gyros: ω = w - OFF; leave CAL_ACC0_ID as it is"]
    return Written({"": "".join(lines).encode()}, equation, lost)


FORMATS: dict[str, Callable[[AffineModel, ExportRequest], Written]] = {
    "kalibr": kalibr,
    "imucal": imucal,
    "ros": ros,
    "c": c_header,
    "matlab": matlab,
    "csv": csv_table,
    "xlsx": workbook,
    "imu_tk": imu_tk,
    "px4": px4,
}
"""What makes the content of each target."""
