"""The compiled loop: made once by numba, kept as an object file in the cache, loaded without numba after that."""

import ctypes
import hashlib
import os
import platform
import tempfile
from collections.abc import Callable
from contextlib import suppress
from functools import cache
from importlib import metadata
from pathlib import Path
from typing import Any

import llvmlite.binding as llvm

from ...fmus.native.compile import cache_folder

_NAME = "trihedron_march"
_SOURCES = ("compiled_loop.py", "machine_access.py", "operations.py", "machine_code.py")
_POINTER = ctypes.c_void_p
March = Callable[[int, int, int, int, int], int]
_engines: list[Any] = []


def _key(cpu: str, features: str) -> str:
    """Everything that the machine code follows from."""
    digest = hashlib.sha256("\0".join([llvm.get_default_triple(), cpu, features, platform.python_version()]).encode())
    for package in ("numba", "llvmlite"):
        digest.update(f"\0{package} {metadata.version(package)}".encode())
    for name in _SOURCES:
        content = (Path(__file__).parent / name).read_bytes()
        digest.update(f"\0{name} {len(content)}\0".encode() + content)
    return digest.hexdigest()


def _object_code(machine: Any) -> bytes:
    """Compile the loop; everything that belongs to Python is taken out of it."""
    import numba

    from .compiled_loop import SIGNATURE, march

    options: dict[str, Any] = {"nopython": True, "error_model": "numpy"}
    made: Any = numba.cfunc(SIGNATURE, **options)(march)
    module = llvm.parse_assembly(made.inspect_llvm())
    inner = made.native_name.removeprefix("cfunc.")
    for function in module.functions:
        if function.name == inner:
            function.name = _NAME
        elif not function.is_declaration:
            function.linkage = "internal"
    for value in module.global_variables:
        if not value.is_declaration:
            value.linkage = "internal"
    passes = llvm.create_new_module_pass_manager()
    passes.add_global_dead_code_eliminate_pass()
    passes.run(module, llvm.create_pass_builder(machine, llvm.create_pipeline_tuning_options(3)))
    needed = [f.name for f in module.functions if f.is_declaration and not f.name.startswith("llvm.")]
    needed += [v.name for v in module.global_variables if v.is_declaration]
    if needed:
        raise RuntimeError(f"the compiled loop needs {', '.join(needed)}")
    return machine.emit_object(module)


def _kept(path: Path) -> bytes | None:
    """An object file from the cache, None where it is not there or not whole."""
    try:
        content = path.read_bytes()
    except OSError:
        return None
    digest, code = content[:32], content[32:]
    return code if hashlib.sha256(code).digest() == digest else None


def keep(path: Path, content: bytes) -> None:
    """Put a file into the cache, whole; where that cannot be written, the run goes on without it."""
    with suppress(OSError):
        path.parent.mkdir(parents=True, exist_ok=True)
        handle, beside = tempfile.mkstemp(dir=path.parent)
        with os.fdopen(handle, "wb") as file:
            file.write(content)
        Path(beside).replace(path)


@cache
def compiled_march() -> March:
    """The compiled loop, as ctypes calls it: it lets other threads of Python run.

    Returns
    -------
    callable
        takes the addresses that `trihedron.tools.orchestrator.compiled_loop.march` takes
    """
    llvm.initialize_native_target()
    llvm.initialize_native_asmprinter()
    cpu, features = llvm.get_host_cpu_name(), llvm.get_host_cpu_features().flatten()
    machine = llvm.Target.from_default_triple().create_target_machine(
        cpu=cpu, features=features, opt=3, reloc="pic", codemodel="jitdefault", jit=True
    )
    path = cache_folder() / "loops" / f"{_key(cpu, features)}.o"
    code = _kept(path)
    if code is None:
        code = _object_code(machine)
        keep(path, hashlib.sha256(code).digest() + code)
    engine = llvm.create_mcjit_compiler(llvm.parse_assembly(""), machine)
    engine.add_object_file(llvm.ObjectFileRef.from_data(code))
    engine.finalize_object()
    _engines.append(engine)
    address = engine.get_function_address(_NAME)
    # numba's functions give their value through a pointer, the second is for exceptions, of which there are none.
    function = ctypes.CFUNCTYPE(ctypes.c_int, *[_POINTER] * 7)(address)

    def march(*arguments: int) -> int:
        result = ctypes.c_int64()
        function(ctypes.addressof(result), None, *arguments)
        return result.value

    return march
