"""The sources of native FMUs compiled for other platforms: the same bits, except for sin, cos and atan2."""

import hashlib
import os
import random
import shutil
import struct
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from component_kinds import draw_inputs, draw_parameters, elements_of
from named import Named
from trihedron.fmus import PLATFORMS, components, zig_version
from trihedron.fmus.component import Component
from trihedron.fmus.native.c_source import native_sources
from trihedron.fmus.native.compile import FLAGS, binary
from trihedron.models.attitude_algorithms.computer import INCREMENTS

STEPS = 1000
RUNNERS = {"x86_64-linux-musl": None, "aarch64-linux-musl": "qemu-aarch64", "x86_64-windows-gnu": "wine"}
BOUND = 1e-12
"""Largest difference from the platforms' sin and cos, relative to the largest output."""


def script_and_result(component: Component) -> tuple[str, list[float]]:
    """Return lines for the host, and the real outputs of plain Python after each step."""
    rng = random.Random(5)
    kinds = {name: v.type for name, v in elements_of(component).items()}
    names = [name for name in elements_of(component, "output") if kinds[name] == "real"]
    model, lines, printed = Named(component), ["enter - -"], []

    def set_all(values: dict[str, float]) -> None:
        model.put(**values)
        lines.extend(f"{kinds[name]} {model.at[name]} {float(value).hex()}" for name, value in values.items())

    parameters = draw_parameters(component, rng)
    if component.name == "AttitudeComputer":
        # Rates and mixed inputs suit some algorithms only.
        parameters["input_kind"] = INCREMENTS
    set_all(parameters)
    model.begin()
    lines.append("leave - -")
    for k in range(STEPS):
        if k % 20 == 0 or component.name == "AttitudeComputer":
            set_all(draw_inputs(component, rng))
        model.step(k * 0.02, 0.02)
        lines.append(f"step {(k * 0.02).hex()} {(0.02).hex()}")
        lines += [f"show {model.at[e]} 0" for e in names]
        printed += [float(model[e]) for e in names]
    return "\n".join(lines) + "\n", printed


@pytest.mark.acceptance
@pytest.mark.parametrize("target", list(RUNNERS))
@pytest.mark.parametrize("name", sorted(components()))
def test_other_platforms_give_the_same_bits_but_for_sin_and_cos(name, target, tmp_path):
    runner = RUNNERS[target]
    if zig_version() is None:
        pytest.skip("skipped: no ziglang")
    if runner is not None and shutil.which(runner) is None:
        pytest.skip(f"skipped: no {runner}")
    component = components()[name]
    for file, content in native_sources(component, 2).items():
        (tmp_path / file).write_bytes(content)
    shutil.copy(Path(__file__).parents[1] / "native_host.c", tmp_path / "host.c")
    output = "host.exe" if "windows" in target else "host"
    static = [] if "windows" in target else ["-static"]
    command = [sys.executable, "-m", "ziglang", "cc", "-target", target, *FLAGS, *static, "-o", output]
    sources = sorted(path.name for path in tmp_path.glob("*.c"))
    subprocess.run([*command, *sources, "-lm"], cwd=tmp_path, check=True, capture_output=True)
    script, expected = script_and_result(component)
    (tmp_path / "script.txt").write_text(script)
    run = [*([runner] if runner else []), str(tmp_path / output), "script.txt"]
    quiet = {**os.environ, "WINEDEBUG": "-all"}
    process = subprocess.run(run, cwd=tmp_path, capture_output=True, text=True, env=quiet)
    assert process.returncode == 0, process.stderr
    reference = np.array([float.fromhex(line) for line in process.stdout.split()])
    plain = np.array(expected)
    assert reference.shape == plain.shape
    difference = float(np.abs(reference - plain).max() / np.abs(plain).max())
    print(f"{name} on {target}: greatest difference {difference:.2e} of the largest output")
    if "sin(" in (tmp_path / "model.c").read_text():
        assert difference <= BOUND
    else:
        assert reference.tobytes() == plain.tobytes()


def load_commands(library: bytes) -> dict[int, bytes]:
    """Return the load commands of a Mach-O library, by their kind."""
    count, at, commands = struct.unpack_from("<I", library, 16)[0], 32, {}
    for _ in range(count):
        kind, length = struct.unpack_from("<2I", library, at)
        commands[kind] = library[at : at + length]
        at += length
    return commands


@pytest.mark.acceptance
@pytest.mark.parametrize(("name", "oldest"), [("x86_64-darwin", (10, 7)), ("aarch64-darwin", (11, 0))])
def test_libraries_for_macos_are_found_by_their_name_signed_and_for_old_systems(name, oldest):
    if zig_version() is None:
        pytest.skip("skipped: no ziglang")
    library = binary(PLATFORMS[name], "Name", native_sources(components()["TableController"], 2), portable=True)
    commands = load_commands(library)
    assert commands[0xD][24:].rstrip(b"\0") == b"@rpath/Name.dylib"
    # LC_BUILD_VERSION, or LC_VERSION_MIN_MACOSX for older systems.
    (word,) = struct.unpack_from("<I", *((commands[0x32], 12) if 0x32 in commands else (commands[0x24], 8)))
    assert (word >> 16, word >> 8 & 255) == oldest
    # The signature: every page of the library before it has the hash in its code directory.
    begin, size = struct.unpack_from("<2I", commands[0x1D], 8)
    signature = library[begin : begin + size]
    at = signature.index(bytes.fromhex("fade0c02"))
    flags, hashes, _, _, count, limit = struct.unpack_from(">6I", signature, at + 12)
    page = 1 << signature[at + 39]
    assert flags & 2, "ad hoc"
    assert limit == begin
    for k in range(count):
        digest = hashlib.sha256(library[k * page : min((k + 1) * page, limit)]).digest()
        assert signature[at + hashes + 32 * k :][:32] == digest
