"""Files of loggers and other tools, written by their own libraries: a turn of gravity with gyros, every 10 ms."""

import json
import struct
from collections.abc import Callable
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import polars as pl
import scipy.io
from mcap.writer import Writer as McapWriter
from nptdms import ChannelObject, TdmsWriter
from rosbags.rosbag1 import Writer as Ros1Writer
from rosbags.rosbag2 import StoragePlugin
from rosbags.rosbag2 import Writer as Ros2Writer
from rosbags.typesys import Stores, get_typestore

COUNT = 300
NANOS = 1700000000_123456789 + 10_000_000 * np.arange(COUNT)
"""Stamps [ns]; doubles do not hold them."""
TIME = (NANOS - NANOS[0]) * 1e-9
TURN = 0.8 * np.sin(2.0 * TIME)
FORCE = 9.80665 * np.stack([np.sin(TURN), 0.01 * np.cos(TIME), np.cos(TURN)], axis=1)
RATE = np.stack([0.01 * np.sin(3.0 * TIME), -1.6 * np.cos(2.0 * TIME), 0.02 + 0.001 * TIME], axis=1)
SI = {"units.force": "m/s2", "units.rate": "rad/s"}
STAMPS = {"units.time": "ns"}


def npz(folder: Path) -> Path:
    """Write arrays of NumPy."""
    np.savez(folder / "log.npz", t=NANOS, acc=FORCE, gyro=RATE)
    return folder / "log.npz"


def structured(folder: Path) -> Path:
    """Write a structured array."""
    names = ["t_s", "ax", "ay", "az", "wx", "wy", "wz"]
    table = np.zeros(COUNT, dtype=[(name, float) for name in names])
    for name, column in zip(names, [TIME, *FORCE.T, *RATE.T], strict=True):
        table[name] = column
    np.save(folder / "log.npy", table)
    return folder / "log.npy"


def mat5(folder: Path) -> Path:
    """Write a structure of MATLAB whose gyros lie on their side."""
    content = {"imu": {"time": TIME, "accel": FORCE, "gyro": RATE.T, "note": "bench"}, "fs": 100.0}
    scipy.io.savemat(folder / "log.mat", content)
    return folder / "log.mat"


def hdf5(folder: Path) -> Path:
    """Write groups of HDF5 with units."""
    with h5py.File(folder / "log.h5", "w") as file:
        for name, values, unit in (("time", TIME, "s"), ("accel", FORCE, "m/s^2"), ("gyro", RATE, "rad/s")):
            file[f"imu/{name}"] = values
            file[f"imu/{name}"].attrs["units"] = unit
        file["gps/latitude"] = np.zeros(7)
    return folder / "log.h5"


def mat73(folder: Path) -> Path:
    """Write what MATLAB calls v7.3: HDF5 behind 512 bytes, arrays on their side."""
    path = folder / "log73.mat"
    with h5py.File(path, "w", userblock_size=512) as file:
        file["imu/t"], file["imu/acc"], file["imu/gyr"] = TIME[None, :], FORCE.T, RATE.T
    content = bytearray(path.read_bytes())
    content[:40] = b"MATLAB 7.3 MAT-file, Platform: GLNXA64  "
    path.write_bytes(bytes(content))
    return path


def parquet(folder: Path) -> Path:
    """Write Parquet with a time column and lists."""
    stamps = pl.Series(NANOS).cast(pl.Datetime("ns"))
    frame = pl.DataFrame({"timestamp": stamps, "accel": FORCE.tolist(), "gyro": RATE.tolist()})
    frame.write_parquet(folder / "log.parquet")
    return folder / "log.parquet"


def arrow(folder: Path) -> Path:
    """Write Arrow's format with a column for each axis."""
    columns: dict[str, Any] = {"t": NANOS}
    for name, values in (("accel", FORCE), ("gyro", RATE)):
        columns |= {f"{name}_{axis}": column for axis, column in zip("xyz", values.T, strict=True)}
    pl.DataFrame(columns).write_ipc(folder / "log.feather")
    return folder / "log.feather"


def parquet_of_structures(folder: Path) -> Path:
    """Write Parquet with structures."""
    columns: dict[str, Any] = {"t": NANOS}
    for name, values in (("accel", FORCE), ("gyro", RATE)):
        columns[name] = [dict(zip("xyz", row, strict=True)) for row in values.tolist()]
    pl.DataFrame(columns).write_parquet(folder / "log2.parquet")
    return folder / "log2.parquet"


def ros1(folder: Path) -> Path:
    """Write a ROS 1 bag."""
    store = get_typestore(Stores.ROS1_NOETIC)
    with Ros1Writer(folder / "log.bag") as bag:
        topic = bag.add_connection("/imu/data_raw", "sensor_msgs/msg/Imu", typestore=store)
        for k in range(COUNT):
            message = ros_message(store, k, {"seq": k})
            bag.write(topic, int(NANOS[k]) + 5, store.serialize_ros1(message, "sensor_msgs/msg/Imu"))
    return folder / "log.bag"


def ros2(folder: Path, plugin: StoragePlugin = StoragePlugin.SQLITE3, topics: tuple[str, ...] = ("/imu",)) -> Path:
    """Write the folder of a ROS 2 bag."""
    store = get_typestore(Stores.ROS2_HUMBLE)
    with Ros2Writer(folder / "log", version=9, storage_plugin=plugin) as bag:
        for name in topics:
            topic = bag.add_connection(name, "sensor_msgs/msg/Imu", typestore=store)
            for k in range(COUNT):
                message = store.serialize_cdr(ros_message(store, k, {}), "sensor_msgs/msg/Imu")
                bag.write(topic, int(NANOS[k]) + 5, message)
    return folder / "log"


def ros2_mcap(folder: Path) -> Path:
    """Write the MCAP file of a ROS 2 bag."""
    return ros2(folder, StoragePlugin.MCAP) / "log.mcap"


def ros_message(store: Any, k: int, header: dict[str, int]) -> Any:
    """Return a message sensor_msgs/Imu of row k."""
    types = store.types
    stamp = types["builtin_interfaces/msg/Time"](sec=int(NANOS[k] // 10**9), nanosec=int(NANOS[k] % 10**9))
    vector, zeros = types["geometry_msgs/msg/Vector3"], np.zeros(9)
    return types["sensor_msgs/msg/Imu"](
        header=types["std_msgs/msg/Header"](**header, stamp=stamp, frame_id="imu"),
        orientation=types["geometry_msgs/msg/Quaternion"](0.0, 0.0, 0.0, 1.0),
        orientation_covariance=zeros,
        angular_velocity=vector(*RATE[k]),
        angular_velocity_covariance=zeros,
        linear_acceleration=vector(*FORCE[k]),
        linear_acceleration_covariance=zeros,
    )


def mcap_json(folder: Path) -> Path:
    """Write an MCAP file with messages in JSON."""
    with (folder / "json.mcap").open("wb") as file:
        writer = McapWriter(file)
        writer.start()
        channel = writer.register_channel("/imu", "json", writer.register_schema("imu", "jsonschema", b"{}"))
        for k in range(COUNT):
            stamp = {"sec": int(NANOS[k] // 10**9), "nanosec": int(NANOS[k] % 10**9)}
            content = {"header": {"stamp": stamp}}
            content["angular_velocity"] = dict(zip("xyz", RATE[k].tolist(), strict=True))
            content["linear_acceleration"] = dict(zip("xyz", FORCE[k].tolist(), strict=True))
            writer.add_message(channel, int(NANOS[k]), json.dumps(content).encode(), int(NANOS[k]))
        writer.finish()
    return folder / "json.mcap"


def tdms(folder: Path) -> Path:
    """Write TDMS of LabVIEW."""
    channels = []
    for name, values, unit in (("Accel", FORCE, "m/s^2"), ("Gyro", RATE, "rad/s")):
        for axis, column in zip("xyz", values.T, strict=True):
            properties = {"wf_increment": 0.01, "wf_start_offset": 0.0, "wf_samples": 1, "unit_string": unit}
            channels.append(ChannelObject("IMU", f"{name} {axis}", np.ascontiguousarray(column), properties=properties))
    with TdmsWriter(folder / "log.tdms") as writer:
        writer.write_segment(channels)
    return folder / "log.tdms"


def ulog(folder: Path) -> Path:
    """Write a ULog file with sensor_combined, byte by byte as the format is documented."""
    fields = "uint64_t timestamp;float[3] gyro_rad;uint32_t gyro_integral_dt;float[3] accelerometer_m_s2;"
    parts = [b"ULog\x01\x12\x35\x01" + struct.pack("<Q", 20326716)]

    def add(kind: bytes, content: bytes) -> None:
        parts.append(struct.pack("<H", len(content)) + kind + content)

    add(b"B", bytes(40))
    add(b"F", b"sensor_combined:" + fields.encode())
    add(b"A", struct.pack("<BH", 0, 7) + b"sensor_combined")
    for k in range(COUNT):
        row = struct.pack("<Q3fI3f", 20326716 + 10000 * k, *RATE[k], 4889, *FORCE[k])
        add(b"D", struct.pack("<H", 7) + row)
    path = folder / "log.ulg"
    path.write_bytes(b"".join(parts))
    return path


LOGS: dict[str, tuple[Callable[[Path], Path], dict[str, str]]] = {
    "npz": (npz, SI | STAMPS),
    "structured npy": (structured, SI),
    "mat v5": (mat5, SI | {"units.time": "s"}),
    "mat v7.3": (mat73, SI | {"units.time": "s"}),
    "HDF5": (hdf5, {}),
    "Parquet": (parquet, SI),
    "Arrow": (arrow, SI | STAMPS),
    "Parquet of structures": (parquet_of_structures, SI | STAMPS),
    "ULog": (ulog, {}),
    "ROS 1 bag": (ros1, {}),
    "ROS 2 bag": (ros2, {}),
    "MCAP of ROS 2": (ros2_mcap, {}),
    "MCAP in JSON": (mcap_json, {}),
    "TDMS": (tdms, {}),
}
"""Format -> function that writes a file, and the answers that it needs."""
