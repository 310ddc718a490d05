"""Files that hold several tables of numbers: MATLAB, NumPy, HDF5, Parquet, ULog, ROS bags, MCAP, TDMS, ArduPilot.

A part of a file is a table with named columns. A library reads each but ArduPilot's text. Nothing is unpickled.
"""

import io
import json
import re
from collections import Counter
from collections.abc import Callable, Iterable, Mapping, Sequence
from contextlib import redirect_stdout
from dataclasses import dataclass, field
from functools import partial
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np
import polars as pl
from numpy.typing import NDArray

from ..errors import InputError
from ..files import bytes_of
from .array_reader import HDF5, NUMPY, UNNAMED
from .layout import are_beside, parts_of_seconds
from .names import heading
from .sheet import FEWEST_NUMBERS, LARGE, LOOKED_AT, refuse_other
from .tables import TABLES
from .workbook import output_of_reader

MOST_CHANNELS = 16
"""Largest number of columns of an array; the longer side has the rows."""
FEWEST_ROWS = 3
ULOG = b"ULog\x01\x12\x35"
ARROW, PARQUET, ROS1, MCAP, TDMS, SQLITE = b"ARROW1", b"PAR1", b"#ROSBAG V", b"\x89MCAP", b"TDSm", b"SQLite format 3\0"
ARDUPILOT = re.compile(rb"^FMT, ?\d+, ?\d+,", re.MULTILINE)
"""Line of a text log of ArduPilot that names the columns of a message."""
JSON = re.compile(rb'(\xef\xbb\xbf)?\s*(\[\s*)?\{\s*"')
"""First bytes of objects, one after the other or in a list."""
LARGEST_LIST = 250_000_000
"""Largest list of objects that is read [bytes]: it is held whole."""
NUMBERS = {int, float, type(None)}
"""Types of a column of JSON."""
EXTRAS = {"nptdms": "pip install 'trihedron[tdms]'"}
"""Library -> command that installs it, if not that for all others."""
EXTRA = "pip install 'trihedron[logs]'"

IMU = ("sensor_msgs/msg/Imu", "sensor_msgs/Imu")
IMU_COLUMNS = (
    "header.stamp",
    *(f"angular_velocity.{axis}" for axis in "xyz"),
    *(f"linear_acceleration.{axis}" for axis in "xyz"),
)
ARRAY_READER = Path(__file__).with_name("array_reader.py")
"""Programme that reads HDF5 and MATLAB files: their libraries may crash on a damaged one."""


@dataclass(frozen=True)
class Channel:
    """A column of a part: its name, its unit if the file states one, its numbers (N,)."""

    name: str
    values: NDArray[Any] | pl.Series
    unit: str = ""


@dataclass(frozen=True)
class Part:
    """A table in a file: its name there, the number of its rows, the names of its columns, and how it is read."""

    name: str
    rows: int
    names: tuple[str, ...]
    read: Callable[[], list[Channel]]
    rate: float = 0.0
    remark: str = ""


@dataclass
class Tree:
    """Shapes and units of arrays of a file by their paths, and its single numbers.

    `load` returns the arrays of some paths that are not yet in `arrays`.
    """

    shapes: dict[str, tuple[int, ...]] = field(default_factory=dict)
    units: dict[str, str] = field(default_factory=dict)
    numbers: dict[str, float] = field(default_factory=dict)
    arrays: dict[str, NDArray[Any]] = field(default_factory=dict)
    load: Callable[[Iterable[str]], Mapping[str, NDArray[Any]]] | None = None

    def parts(self) -> list[Part]:
        """Return the arrays of equal length in a folder as tables, and those of the whole file where they differ."""
        groups: dict[tuple[str, int], list[str]] = {}
        for path, shape in self.shapes.items():
            rows = _rows_of(shape)
            if rows >= FEWEST_ROWS:
                group = path if _is_timed(path, shape) else path.rpartition("/")[0]
                groups.setdefault((group, rows), []).append(path)
        together: dict[int, list[str]] = {}
        for (group, rows), paths in groups.items():
            if [group] != paths:
                together.setdefault(rows, []).extend(paths)
        parts = [self._part(name, rows, paths) for (name, rows), paths in groups.items()]
        for rows, paths in together.items():
            if all(len(part.names) < len(paths) or part.rows != rows for part in parts):
                parts.append(self._part("", rows, paths))
        return parts

    def _part(self, name: str, rows: int, paths: list[str]) -> Part:
        names = []
        for path in paths:
            names += _names_in(path, self.shapes[path])
        rate = 0.0
        for path, number in self.numbers.items():
            if path.rpartition("/")[2].replace("_", "").lower() in TABLES["rates"]["names"] and number > 0.0:
                rate = number
        return Part(name, rows, tuple(names), partial(self._read, paths), rate)

    def _read(self, paths: Iterable[str]) -> list[Channel]:
        channels = []
        arrays = self.arrays if self.load is None else self.load(paths)
        for path in paths:
            shape, values = self.shapes[path], arrays[path]
            columns = values.reshape(-1, 1) if _is_line(shape) else values.reshape(shape)
            if columns.ndim == 2 and columns.shape[0] < columns.shape[1]:
                columns = columns.T
            names = _names_in(path, shape, is_timed=bool((np.diff(columns[:, 0]) > 0).all()))
            for name, column in zip(names, columns.T, strict=True):
                channels.append(Channel(name, np.ascontiguousarray(column), self.units.get(path, "")))
        return channels


def _is_line(shape: tuple[int, ...]) -> bool:
    return len(shape) == 1 or (len(shape) == 2 and min(shape) == 1)


def _rows_of(shape: tuple[int, ...]) -> int:
    """Return the rows of an array of channels; 0 for any other array."""
    if _is_line(shape):
        return max(shape)
    if len(shape) == 2 and min(shape) <= MOST_CHANNELS:
        return max(shape)
    return 0


def _is_timed(path: str, shape: tuple[int, ...]) -> bool:
    """Return True for an array of four columns with the name of an instrument: a time and three channels."""
    return len(shape) == 2 and min(shape) == 4 and bool(heading(f"{path.rpartition('/')[2]} x").column)


def _names_in(path: str, shape: tuple[int, ...], *, is_timed: bool = True) -> list[str]:
    """Return the names of an array's columns: its own, with the number of the column from 0; `is_timed`: the first
    column may be a time."""
    folder, _, name = path.rpartition("/")
    if name.lower() in ("x", "y", "z") and folder:
        name = f"{folder.rpartition('/')[2]} {name}"
    if _is_line(shape):
        return [name]
    if is_timed and _is_timed(path, shape):
        return ["time", *(f"{name} {axis}" for axis in "xyz")]
    return [f"{name}[{k}]" for k in range(min(shape))]


def array_channels(array: NDArray[Any]) -> list[Channel]:
    """Return the columns of an array without names.

    Raises InputError if it is not an array of two dimensions with three rows or more.
    """
    parts = Tree({UNNAMED: array.shape}, arrays={UNNAMED: array}).parts()
    if not parts:
        raise InputError(f"table: has the shape {array.shape}; rows of at least three numbers are needed")
    return parts[0].read()


def labelled_channels(source: Any) -> list[Channel]:
    """Return the columns of a Dataset or DataArray of xarray along its longest dimension, with the units it states.

    A second dimension gives a column for each of its labels: "accel x", or the label where it is a name itself.
    """
    along = max(source.sizes, key=source.sizes.get)
    arrays = {**source.coords, **(source.data_vars if hasattr(source, "data_vars") else {source.name or "": source})}
    channels = []
    for name, array in arrays.items():
        across = [dimension for dimension in array.dims if dimension != along]
        if along not in array.dims or len(across) > 1:
            continue
        unit, values = str(array.attrs.get("units", "")), array.transpose(along, ...).values
        if values.dtype.kind in "mM":
            unit, values = "ns", values.astype(f"{values.dtype.kind}8[ns]").astype(np.int64)
        if not across:
            channels.append(Channel(str(name), values, unit))
            continue
        labels = [f"[{k}]" for k in range(values.shape[1])]
        if across[0] in array.coords:
            labels = [str(label) for label in array.coords[across[0]].values]
        for label, column in zip(labels, values.T, strict=True):
            channels.append(Channel(label if len(label) > 1 and label[0] != "[" else f"{name} {label}", column, unit))
    return channels


def joined_stamps(channels: list[Channel]) -> list[Channel]:
    """Return columns with whole seconds and the part of a second beside them as one column of nanoseconds."""
    for whole, part, digits, is_named in parts_of_seconds([channel.name for channel in channels]):
        columns = [np.asarray(channels[place].values, dtype=np.float64) for place in (whole, part)]
        if any(not np.isfinite(column).all() or (column != np.round(column)).any() for column in columns):
            continue
        seconds, parts = (column.astype(np.int64) for column in columns)
        first = zip(*(column[:LOOKED_AT].astype(str).tolist() for column in (seconds, parts)), strict=True)
        if is_named or are_beside(first, digits):
            name = channels[whole].name.rpartition(".")[0] or "time"
            others = [channel for place, channel in enumerate(channels) if place not in (whole, part)]
            return [Channel(name, seconds * 10**9 + parts * 10 ** (9 - digits), "ns"), *others]
    return channels


def is_container(path: Path, begin: bytes) -> bool:
    """Return True if a file or folder holds tables that a library reads."""
    return _reader_of(path, begin) is not None


def parts_of(path: Path, begin: bytes) -> list[Part]:
    """Return the tables of a file.

    Raises InputError if a library is missing, or cannot read the file.
    """
    reader = _reader_of(path, begin)
    assert reader is not None
    word, read = reader
    try:
        parts = read(path)
    except InputError:
        raise
    except ImportError as error:
        library = (error.name or "").partition(".")[0]
        raise InputError(
            f"{path}: is a {word}; to read it: {EXTRAS.get(library, EXTRA)} ({library} is missing)"
        ) from error
    except Exception as error:
        raise InputError(f"{path}: is not a readable {word} ({_reason(error)}); copy or export it again") from error
    if not parts:
        raise InputError(f"{path}: holds no table of numbers with {FEWEST_ROWS} rows or more")
    return parts


def channels_of(path: Path, part: Part) -> list[Channel]:
    """Return the columns of a part; raises InputError if a library cannot read them."""
    try:
        return part.read()
    except InputError:
        raise
    except Exception as error:
        raise InputError(f"{path}: {part.name}: cannot be read ({_reason(error)}); copy or export it again") from error


def _reason(error: Exception) -> str:
    return " ".join((str(error) or type(error).__name__).split())[:200]


def _reader_of(path: Path, begin: bytes) -> tuple[str, Callable[[Path], list[Part]]] | None:
    """Return the kind of a file in words, and its reader; None for text and workbooks."""
    if path.is_dir():
        return "folder of a ROS 2 bag", _ros_parts
    if begin.startswith(HDF5) or begin[512:].startswith(HDF5):
        return "HDF5 file (.h5, .mat v7.3)", _hdf5_parts
    is_text = begin.decode("latin-1").isprintable() or all(byte in b"\t\r\n" or 32 <= byte < 127 for byte in begin)
    if begin.startswith(b"MATLAB") or (path.suffix.lower() == ".mat" and begin and not is_text):
        return "MATLAB file (.mat)", _array_parts
    if begin.startswith(NUMPY):
        return "NumPy file (.npy)", _array_parts
    if begin.startswith(b"PK") and path.suffix.lower() == ".npz":
        return "NumPy archive (.npz)", _array_parts
    for magic, word, reader in (
        (PARQUET, "Parquet file", _parquet_parts),
        (ARROW, "Arrow file (.feather)", _arrow_parts),
        (ULOG, "ULog file", _ulog_parts),
        (ROS1, "ROS 1 bag", _ros_parts),
        (SQLITE, "ROS 2 bag", _ros_parts),
        (MCAP, "MCAP file", _mcap_parts),
        (TDMS, "TDMS file", _tdms_parts),
    ):
        if begin.startswith(magic):
            return word, reader
    if ARDUPILOT.search(begin):
        return "text log of ArduPilot", _ardupilot_parts
    if JSON.match(begin):
        return "JSON file", _json_parts
    word = TABLES["kinds"].get(path.suffix.lower())
    if word and begin:
        raise InputError(f"{path}: does not begin as a {word} does; copy or export it again")
    return None


def _hdf5_parts(path: Path) -> list[Part]:
    if find_spec("h5py") is None:
        raise ImportError("h5py is missing", name="h5py")
    return _array_parts(path)


def _array_parts(path: Path) -> list[Part]:
    tree = Tree(load=partial(_arrays, path))
    for name, shape, unit, number in json.loads(output_of_reader(ARRAY_READER, str(path))):
        if number is None:
            tree.shapes[name], tree.units[name] = tuple(shape), unit
        else:
            tree.numbers[name] = number
    return tree.parts()


def _arrays(path: Path, names: Iterable[str]) -> dict[str, NDArray[Any]]:
    output = io.BytesIO(output_of_reader(ARRAY_READER, str(path), *names))
    return {name: np.load(output, allow_pickle=False) for name in names}


def _parquet_parts(path: Path) -> list[Part]:
    schema = pl.read_parquet_schema(path)
    rows = pl.scan_parquet(path).select(pl.len()).collect().item()
    return [Part("", rows, tuple(schema), partial(_parquet_channels, path))]


def _arrow_parts(path: Path) -> list[Part]:
    return _parts_with("", table_channels(pl.read_ipc(path)))


def _parquet_channels(path: Path) -> list[Channel]:
    return table_channels(pl.read_parquet(path))


def table_channels(frame: pl.DataFrame) -> list[Channel]:
    """Return the columns of a table; structures and arrays of fixed length become columns, times nanoseconds."""
    channels = []
    for series in frame:
        dtype = series.dtype
        if isinstance(dtype, pl.Struct):
            inner = series.struct.unnest()
            named = inner.rename({name: f"{series.name}.{name}" for name in inner.columns})
            channels += table_channels(named)
        elif isinstance(dtype, pl.List | pl.Array):
            nested = series.cast(pl.List(dtype.inner))
            lengths = nested.list.len().unique().to_list()
            if len(lengths) == 1 and lengths[0] and lengths[0] <= MOST_CHANNELS:
                for k in range(lengths[0]):
                    channels.append(Channel(f"{series.name}[{k}]", nested.list.get(k)))
        elif dtype.is_temporal() and dtype != pl.Date and dtype != pl.Time:
            cast = pl.Duration("ns") if isinstance(dtype, pl.Duration) else pl.Datetime("ns")
            plain = series.dt.replace_time_zone(None) if isinstance(dtype, pl.Datetime) else series
            channels.append(Channel(series.name, plain.cast(cast).cast(pl.Int64), "ns"))
        else:
            channels.append(Channel(series.name, series))
    return channels


def _ulog_parts(path: Path) -> list[Part]:
    library = import_module("pyulog")
    # the library writes its warnings to the output
    with redirect_stdout(io.StringIO()) as output:
        log = library.ULog(str(path))
    remark = _remark_of(output)
    several = {topic.name for topic in log.data_list if topic.multi_id}
    parts = []
    for topic in log.data_list:
        name = f"{topic.name}/{topic.multi_id}" if topic.name in several else topic.name
        channels = [Channel(_short(topic.name, column), values) for column, values in topic.data.items()]
        parts += _parts_with(name, channels, remark)
    return parts


def _parts_with(name: str, channels: list[Channel], remark: str = "") -> list[Part]:
    """Return the part of columns that are read, none where it has too few rows."""
    rows = len(channels[0].values)
    if rows < FEWEST_ROWS:
        return []
    return [Part(name, rows, tuple(channel.name for channel in channels), partial(list, channels), remark=remark)]


def _remark_of(output: io.StringIO) -> str:
    """Return a remark with the first warning that a library wrote."""
    warning = output.getvalue().partition("\n")[0]
    return f"rows may be missing: {warning}" if warning else ""


def _short(topic: str, column: str) -> str:
    if column.lower() in ("x", "y", "z"):
        return f"{topic} {column}"
    return column


def _tdms_parts(path: Path) -> list[Part]:
    library, output = import_module("nptdms"), io.StringIO()
    library.log.log_manager.console_handler.setStream(output)
    file = library.TdmsFile.read(path)
    remark = _remark_of(output)
    parts = []
    for group in file.groups():
        channels: dict[int, list[Channel]] = {}
        for channel in group.channels():
            values = np.asarray(channel[:])
            if values.dtype.kind not in "iufb":
                continue
            unit = str(channel.properties.get("unit_string", ""))
            same = channels.setdefault(len(values), [])
            step = channel.properties.get("wf_increment")
            if not same and step:
                begin = channel.properties.get("wf_start_offset", 0.0)
                same.append(Channel("time", begin + np.arange(len(values)) * step, "s"))
            same.append(Channel(channel.name, values, unit))
        for same in channels.values():
            parts += _parts_with(group.name, same, remark)
    return parts


def _ros_parts(path: Path) -> list[Part]:
    with _ros_reader(path) as reader:
        connections = [(connection.topic, connection.msgtype, connection.msgcount) for connection in reader.connections]
    parts = [
        Part(topic.strip("/"), count, IMU_COLUMNS, partial(_imu_channels, path, topic))
        for topic, kind, count in connections
        if kind in IMU and count >= FEWEST_ROWS
    ]
    if not parts:
        kinds = sorted({kind for _, kind, _ in connections})
        raise InputError(f"{path}: has no messages sensor_msgs/Imu, but {', '.join(kinds)[:200] or 'none'}")
    return parts


def _ros_reader(path: Path) -> Any:
    highlevel, stores = import_module("rosbags.highlevel"), import_module("rosbags.typesys")
    return highlevel.AnyReader([path], default_typestore=stores.get_typestore(stores.Stores.ROS2_HUMBLE))


def _imu_channels(path: Path, topic: str) -> list[Channel]:
    """Return the stamps [ns], rates and specific forces of a topic's messages."""
    stamps, rows = list[int](), list[list[float]]()
    with _ros_reader(path) as reader:
        connections = [connection for connection in reader.connections if connection.topic == topic]
        for connection, _, content in reader.messages(connections=connections):
            message = reader.deserialize(content, connection.msgtype)
            stamps.append(message.header.stamp.sec * 10**9 + message.header.stamp.nanosec)
            rate, force = message.angular_velocity, message.linear_acceleration
            rows.append([rate.x, rate.y, rate.z, force.x, force.y, force.z])
    values = [np.array(stamps, dtype=np.int64), *np.array(rows, dtype=np.float64).T]
    return [Channel(name, column) for name, column in zip(IMU_COLUMNS, values, strict=True)]


def _mcap_parts(path: Path) -> list[Part]:
    reader = import_module("mcap.reader")
    with path.open("rb") as file:
        summary = reader.make_reader(file).get_summary()
    if summary is None or summary.statistics is None:
        raise InputError(f"{path}: has no summary; repair it: mcap recover {path.name}")
    encodings = {channel.message_encoding for channel in summary.channels.values()}
    if "json" not in encodings:
        if not encodings & {"cdr", "ros1"}:
            what = f"has messages as {', '.join(sorted(encodings))}"
            raise InputError(f"{path}: {what}; those of ROS (cdr) and JSON are read")
        return _ros_parts(path)
    rows: dict[str, list[dict[str, Any]]] = {}
    with path.open("rb") as file:
        for _, channel, message in reader.make_reader(file).iter_messages():
            if channel.message_encoding == "json":
                rows.setdefault(channel.topic, []).append({"log_time": message.log_time} | json.loads(message.data))
    parts = []
    for topic, messages in rows.items():
        parts += _parts_with(topic.strip("/"), _channels_of_objects(messages))
    return parts


def _channels_of_objects(objects: Sequence[Mapping[str, Any]]) -> list[Channel]:
    """Return the columns of objects of JSON; names inside others have points between them."""
    return joined_stamps(table_channels(pl.json_normalize(objects, separator=".", infer_schema_length=None)))


def _json_parts(path: Path) -> list[Part]:
    """Return the tables of a list of objects, of lines with an object each, or of an object that holds columns."""
    if path.stat().st_size > LARGE:
        return _parts_with("", joined_stamps(table_channels(_large_json(path))))
    content = bytes_of(path, "a measured file is needed", most=LARGE)
    objects: Any
    try:
        objects = [json.loads(line) for line in content.splitlines() if line.strip()]
    except ValueError:
        objects = json.loads(content)
    if isinstance(objects, list) and len(objects) == 1:
        (objects,) = objects
    if isinstance(objects, dict) and all(map(str.isdecimal, objects)):
        objects = list(objects.values())
    tables: dict[str, Any] = {"": objects}
    columns = list[Channel]()
    if isinstance(objects, dict) and "schema" in objects:
        # a result of this product
        refuse_other(path, content)
    if isinstance(objects, dict):
        # pandas numbers the rows, or those of each column
        inside = {key: list(value.values()) if isinstance(value, dict) else value for key, value in objects.items()}
        tables = {key: value for key, value in inside.items() if isinstance(value, list)}
        for key, value in tables.items():
            types = set(map(type, value))
            if types <= NUMBERS:
                columns.append(Channel(key, pl.Series(value, dtype=pl.Float64 if float in types else pl.Int64)))
    is_table = len(columns) >= FEWEST_NUMBERS and len({len(column.values) for column in columns}) == 1
    parts = _parts_with("", columns) if is_table else []
    for name, rows in tables.items():
        if len(rows) >= FEWEST_ROWS and all(isinstance(row, dict) for row in rows):
            parts += _parts_with(name, _channels_of_objects(rows))
    if not parts:
        refuse_other(path, content)
    return parts


def _large_json(path: Path) -> pl.DataFrame:
    """Return the table of a large list of objects, or of lines with an object each.

    Raises InputError for a list that takes too much memory.
    """
    if b"[" not in read_begin(path).partition(b"{")[0]:
        return pl.read_ndjson(path, infer_schema_length=None)
    if path.stat().st_size > LARGEST_LIST:
        advice = f"write an object in each line: jq -c '.[]' {path.name}"
        raise InputError(f"{path}: is a list of more than {LARGEST_LIST} bytes, which is held whole; {advice}")
    return pl.read_json(path, infer_schema_length=None)


def _ardupilot_parts(path: Path) -> list[Part]:
    names, counts = dict[str, tuple[str, ...]](), Counter[str]()
    with path.open(encoding="utf-8", errors="replace") as file:
        for line in file:
            message, *fields = (field.strip() for field in line.split(","))
            counts[message] += 1
            if message == "FMT":
                names[fields[2]] = tuple(fields[4:])
    return [
        Part(message, counts[message], columns, partial(_ardupilot_channels, path, message, columns))
        for message, columns in names.items()
        if columns and counts[message] >= FEWEST_ROWS
    ]


def _ardupilot_channels(path: Path, message: str, columns: Sequence[str]) -> list[Channel]:
    """Return the columns of a message; a line that is cut short lacks some."""
    with path.open(encoding="utf-8", errors="replace") as file:
        rows = [line.partition(",")[2].replace(" ", "") for line in file if line.startswith(f"{message},")]
    text = io.StringIO("".join(rows))
    return table_channels(pl.read_csv(text, has_header=False, new_columns=columns, infer_schema_length=None))


def frame_of(path: Path, channels: list[Channel]) -> pl.DataFrame:
    """Return columns as a table; names that are there twice get a number.

    Raises InputError if the columns have different lengths.
    """
    series: dict[str, pl.Series] = {}
    for channel in channels:
        name, count = channel.name, 1
        while name in series:
            count += 1
            name = f"{channel.name} ({count})"
        values = channel.values
        if isinstance(values, np.ndarray):
            native = values.astype(values.dtype.newbyteorder("="), copy=False)
            values = pl.Series(name, native.astype(np.float32) if native.dtype == np.float16 else native)
        series[name] = values.alias(name)
    lengths = {len(column) for column in series.values()}
    if len(lengths) != 1:
        raise InputError(f"{path}: its columns have {len(lengths)} different lengths")
    return pl.DataFrame(list(series.values()))


def read_begin(path: Path) -> bytes:
    """Return the first bytes of a file; none of a folder or a pipe, which would wait for a writer."""
    if not path.is_file():
        return b""
    with path.open("rb") as file:
        return io.BytesIO(file.read(1024)).getvalue()
