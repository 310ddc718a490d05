"""The native flavour: a component's table and kernels in C, behind FMI 2.0 or FMI 3.0, with all sources."""

import hashlib
import textwrap
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from xml.etree.ElementTree import Element, SubElement

import fmpy

from ..archive import accompanying_files, document_bytes, identity, model_description, write_archive
from ..component import Component, Variable
from ..reference import layered_reference
from ..source import SourcePart, flat_parts
from .compile import FLAGS, Platform, binary
from .tangent import tangent_name, tangents
from .translate import Signature, kernel_name, translate

COMPILED = {
    2: ("model.c", "component.c", "values.c", "state.c", "exchange.c", "fmi2.c", "fmi2_exchange.c"),
    3: (
        "model.c",
        "component.c",
        "values.c",
        "state.c",
        "exchange.c",
        "fmi3.c",
        "fmi3_exchange.c",
        "fmi3_refused.c",
    ),
}
"""Source files of each version of FMI that are compiled."""

DIFFERENTIATED = ("initialise", "respond")
"""The kernels that make outputs of inputs and parameters as they stand, between steps."""

MODEL_C = """/* {description}. Made by Trihedron from the component's kernels and table. */
#include "component.h"

{kernels}
#define NONE INFINITY

const Variable variables[] = {{
{variables}
}};

const uint32_t reals[] = {{{reals}}};

const double start_values[MEMORY_SIZE] = {{
{starts}
}};

const char *const messages[] = {{
{messages}
}};
{calls}"""

MODEL_H = """/* {description}. Made by Trihedron. */
#ifndef MODEL_H
#define MODEL_H

#define FMI_VERSION {fmi}
#define MODEL_TOKEN "{token}"
#define MODEL_HASH 0x{digest}ull
#define VARIABLE_COUNT {variables}u
#define MEMORY_SIZE {memory}
#define DERIVATIVES {derivatives}
#define EXCHANGE {exchange}

#endif
"""


@dataclass(frozen=True)
class Row:
    """Item of a value reference: a variable, an element of an array in FMI 2.0, or an effect's parameter."""

    variable: Variable
    name: str
    place: int
    size: int


def places(component: Component) -> dict[str, int]:
    """Place of each variable's first element in the memory; the parameters of effects stand together, last."""
    at, first = 0, {}
    for variable in component.own:
        first[variable.name] = at
        at += max(variable.size, 1)
    first["effect"] = at
    return first


def rows(component: Component, fmi: int) -> list[Row]:
    """The variables that the world sees, in the order of their value references from 1 on."""
    where = places(component)
    count = len(component.interface) - component.effect_count
    table: list[Row] = []
    for variable in component.interface[:count]:
        at = where[variable.name]
        if fmi == 3 or not variable.size:
            table.append(Row(variable, variable.name, at, max(variable.size, 1)))
        else:
            table += [Row(variable, name, at + i, 1) for i, name in enumerate(variable.elements)]
    return table + [Row(v, v.name, where["effect"] + i, 1) for i, v in enumerate(component.interface[count:])]


def _bound(value: float | None, sign: str) -> str:
    if value is None:
        return f"{sign}NONE"
    return repr(float(value))


def _row(row: Row) -> str:
    lower, upper = row.variable.limits
    v = row.variable
    fixed = int(v.causality == "parameter" and v.variability == "fixed")
    parts = [f'"{row.name}"', v.type.upper(), v.causality.upper(), str(fixed), str(row.place), str(row.size)]
    parts += [_bound(lower, "-"), _bound(upper, "")]
    return f"    {{{', '.join(parts)}}},"


def _real(row: Row) -> str:
    """A row in the table of the calls of every step: where its value is, and whether it is an input; 0: not real."""
    if row.variable.type != "real":
        return "0"
    return str(4 * row.place + 2 * (row.variable.causality == "input") + 1)


def _text(message: str) -> str:
    return '    "' + message.replace("\\", "\\\\").replace('"', '\\"') + '",'


def _starts(component: Component) -> list[float]:
    """The memory at the start; without effects there is still a place to point at."""
    values: list[float] = []
    for variable in component.variables:
        values += map(float, variable.starts)
    if not component.effect_count:
        values.append(0.0)
    return values


def _arguments(component: Component, kernel: str, signature: Signature, memory: str = "memory") -> list[str]:
    """Return the arguments of a kernel: its times, and places of the memory or of another of the same layout.

    A TypeError where the table has a scalar and the kernel a vector, or the reverse.
    """
    where = places(component)
    scalars = {variable.name for variable in component.of("parameter", "input") if not variable.size}
    arguments = []
    for name, kind in zip(component.arguments[kernel], signature.kinds, strict=True):
        if name in ("time", "step"):
            arguments.append(name if memory == "memory" else "0.0")
            continue
        arguments.append(f"{memory}[{where[name]}]" if name in scalars else f"{memory} + {where[name]}")
        if (name in scalars) == (kind == "Vector"):
            raise TypeError(f"kernel {kernel} of {component.name}: {name} is a {kind} there, not in the table")
    return arguments


def _calls(component: Component, kernels: dict[str, Signature]) -> str:
    """The functions by which the component's kernels work on the memory."""
    texts = []
    for kernel, kind in (("initialise", "int64_t"), ("step", "int64_t"), ("respond", "void")):
        body = ["    (void)memory;", "    (void)time;", "    (void)step;"]
        if kernel in component.kernels:
            call = f"{kernel_name(kernel)}({', '.join(_arguments(component, kernel, kernels[kernel]))});"
            body.append(f"    {call}" if kind == "void" else f"    return {call}")
        texts.append(
            f"\n{kind} model_{kernel}(double *memory, double time, double step)\n{{\n" + "\n".join(body) + "\n}\n"
        )
    if component.exchange:
        event = "INFINITY"
        if "next_event" in kernels:
            event = (
                f"{kernel_name('next_event')}({', '.join(_arguments(component, 'next_event', kernels['next_event']))})"
            )
        head = "\ndouble model_next_event(double *memory, double time)\n{\n    (void)memory;\n    (void)time;\n"
        texts.append(f"{head}    return {event};\n}}\n")
    if component.derivatives:
        texts.append(_derivatives(component, kernels))
    return "".join(texts)


def _derivatives(component: Component, kernels: dict[str, Signature]) -> str:
    """The function by which a derivative of the memory is carried along."""
    called = {}
    for kernel in DIFFERENTIATED:
        if kernel in component.kernels:
            signature = kernels[kernel]
            pairs = zip(
                _arguments(component, kernel, signature), _arguments(component, kernel, signature, "dot"), strict=True
            )
            arguments = [f"{argument}, {dot}" for argument, dot in pairs]
            arguments.append("slope")
            called[kernel] = f"{kernel_name(tangent_name(kernel))}({', '.join(arguments)})"
    lines = ["(void)memory;", "(void)dot;", "(void)time;", "double slope[1] = {0.0};"]
    lines += [f"int64_t message = initialising ? {called['initialise']} : 0;"]
    if "respond" in called:
        lines += ["if (message == 0) {", f"    {called['respond']};", "}"]
    lines += ["return message;"]
    head = "\nint64_t model_differentiate(double *memory, double *dot, double time, int initialising)\n{\n"
    return head + "".join(f"    {line}\n" for line in lines) + "}\n"


@cache
def _translated(parts: tuple[SourcePart, ...], differentiated: tuple[str, ...]) -> tuple[str, dict[str, Signature]]:
    """C of the parts, and of the tangents of those kernels: the same for every start value and edition of FMI."""
    if differentiated:
        parts += tuple(tangents(parts, differentiated))
    return translate(parts)


def model_c(component: Component, fmi: int) -> str:
    """Source of the table, the start values and the kernels.

    Raises
    ------
    RestrictionError
        a kernel is not in restricted Python
    """
    differentiated: tuple[str, ...] = ()
    if component.derivatives:
        differentiated = tuple(kernel for kernel in DIFFERENTIATED if kernel in component.kernels)
    text, kernels = _translated(flat_parts(component), differentiated)
    table, reals = rows(component, fmi), ["0"]
    reals += map(_real, table)
    return MODEL_C.format(
        description=component.description,
        kernels=text,
        variables="\n".join(_row(row) for row in table),
        reals="\n".join(textwrap.wrap(", ".join(reals), 110)),
        starts="\n".join(f"    {value!r}," for value in _starts(component)),
        messages="\n".join(_text(m) for m in component.messages) or '    "",',
        calls=_calls(component, kernels),
    )


def model_h(component: Component, fmi: int, token: str, source: str) -> str:
    """Sizes and identity of the model whose model.c is `source`."""
    return MODEL_H.format(
        description=component.description,
        fmi=fmi,
        token=token,
        digest=hashlib.sha256(f"state 1\n{source}".encode()).hexdigest()[:16],
        variables=len(rows(component, fmi)),
        memory=len(_starts(component)),
        derivatives=int(component.derivatives),
        exchange=int(component.exchange),
    )


@cache
def shared_sources(fmi: int) -> dict[str, bytes]:
    """The sources that all components share: ours, and the headers of FMI from FMPy."""
    folder = Path(__file__).parent / "sources"
    names = [*COMPILED[fmi][1:], "component.h"]
    headers = sorted((Path(fmpy.__file__).parent / "c-code").glob(f"fmi{fmi}*.h"))
    texts = {name: (folder / name).read_bytes() for name in names}
    return texts | {path.name: path.read_bytes() for path in headers}


def build_description(component: Component, fmi: int) -> bytes:
    """buildDescription.xml: how the sources are compiled."""
    root = Element("fmiBuildDescription", fmiVersion="3.0")
    configuration = SubElement(root, "BuildConfiguration", modelIdentifier=component.name)
    options = " ".join(flag for flag in FLAGS if flag.startswith(("-ff", "-fno")))
    files = SubElement(configuration, "SourceFileSet", language="C99", compilerOptions=options)
    for name in COMPILED[fmi]:
        SubElement(files, "SourceFile", name=name)
    return document_bytes(root)


def native_sources(component: Component, fmi: int) -> dict[str, bytes]:
    """Every source file of a component's native FMU, by its name."""
    source = model_c(component, fmi)
    shared = shared_sources(fmi)
    token = identity(component, source.encode() + b"".join(shared.values()), fmi=fmi, sources=COMPILED[fmi])
    texts = {"model.c": source.encode(), "model.h": model_h(component, fmi, token, source).encode()}
    return texts | shared


def native_members(
    component: Component, fmi: int, platforms: Sequence[Platform], *, portable: bool
) -> dict[str, bytes]:
    """The files of the FMU, by their names in the archive."""
    sources = native_sources(component, fmi)
    content = sources["model.c"] + b"".join(shared_sources(fmi).values())
    members = {f"sources/{name}": text for name, text in sources.items()}
    if fmi == 3:
        members["sources/buildDescription.xml"] = build_description(component, fmi)
    members["modelDescription.xml"] = model_description(component, content, fmi=fmi, sources=COMPILED[fmi])
    for platform in platforms:
        library = binary(platform, component.name, sources, portable=portable)
        members[f"binaries/{platform.folder(fmi)}/{component.name}{platform.suffix}"] = library
    header = next(text for name, text in sources.items() if name.endswith("FunctionTypes.h"))
    members |= layered_reference(component, fmi)
    return members | accompanying_files(component, fmi, header.decode("utf-8", "replace"))


def build_native_fmu(
    component: Component, folder: Path, fmi: int, platforms: Sequence[Platform], *, portable: bool
) -> Path:
    """Build the FMU into `folder`; the same component, compiler and platforms give the same bytes.

    Parameters
    ----------
    component : Component
    folder : Path
        made when it is missing
    fmi : int
        2 or 3
    platforms : sequence of Platform
    portable : bool
        whether the host's binary too is to run on old systems, where ziglang is installed

    Returns
    -------
    Path
        ``<folder>/<component's name>.fmu``

    Raises
    ------
    BuildError
        the compiler fails
    RestrictionError
        a kernel is not in restricted Python
    """
    folder.mkdir(parents=True, exist_ok=True)
    path = folder / f"{component.name}.fmu"
    write_archive(path, native_members(component, fmi, platforms, portable=portable))
    return path
