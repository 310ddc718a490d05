"""XML of SSP, read without entities."""

from pathlib import Path
from urllib.parse import unquote, urlsplit
from xml.etree import ElementTree
from xml.etree.ElementTree import Element
from xml.parsers import expat

from ..errors import InputError
from ..orchestrator.quantities import Scale, scale_of
from .archive import refuse_outside
from .namespaces import NAMESPACES

MOST_BYTES = 128 << 20
DEEPEST = 200
"""Elements in one another: what nests deeper is meant to hurt."""


def qualified(name: str) -> str:
    """A prefixed name as ElementTree has it: `ssd:System` with its namespace."""
    prefix, _, local = name.partition(":")
    return f"{{{NAMESPACES[prefix]}}}{local}"


def children(element: Element, path: str) -> list[Element]:
    """The elements at a path of prefixed names."""
    return element.findall(path, NAMESPACES)


def child(element: Element, path: str) -> Element | None:
    """The first element at a path of prefixed names."""
    return element.find(path, NAMESPACES)


def local_name(element: Element) -> str:
    """An element's name without its namespace."""
    return element.tag.rpartition("}")[2] if isinstance(element.tag, str) else ""


def parsed(xml: bytes, label: str, root: str) -> Element:
    """The root element of an XML document.

    Raises
    ------
    InputError
        not well-formed, a DOCTYPE or an entity, nested too deeply, or another root
    """

    def doctype(*_: object) -> None:
        raise InputError(f"{label}: declares a DOCTYPE; an .ssp must not")

    depth = 0

    def begin(*_: object) -> None:
        nonlocal depth
        depth += 1
        if depth > DEEPEST:
            raise InputError(f"{label}: is nested more than {DEEPEST} elements deep; not read")

    def end(_: str) -> None:
        nonlocal depth
        depth -= 1

    if len(xml) > MOST_BYTES:
        raise InputError(f"{label}: is larger than {MOST_BYTES >> 20} MiB; not read")
    parser = expat.ParserCreate()
    parser.StartDoctypeDeclHandler = doctype
    parser.EntityDeclHandler = doctype
    parser.StartElementHandler = begin
    parser.EndElementHandler = end
    try:
        parser.Parse(xml, True)
        element = ElementTree.fromstring(xml)
    except (expat.ExpatError, ElementTree.ParseError, LookupError, ValueError) as error:
        raise InputError(f"{label}: is not well-formed XML ({error})") from error
    if element.tag != qualified(root):
        raise InputError(f"{label}: its root is <{local_name(element)}>, not <{root}> of SSP")
    return element


def read_document(folder: Path, source: str, label: str, root: str) -> Element:
    """The root element of a file of the archive.

    Parameters
    ----------
    folder : Path
        where the archive was unpacked
    source : str
        URI relative to the archive
    label : str
        the archive
    root : str
        prefixed name of the root element
    """
    name = f"{label}: {source}"
    try:
        content = (folder / member(folder, source, label)).read_bytes()
    except OSError as error:
        raise InputError(f"{name}: cannot be read ({error.strerror})") from error
    return parsed(content, name, root)


def member(folder: Path, source: str, label: str) -> str:
    """The file of the archive that a URI names; what lies elsewhere is refused."""
    try:
        parts = urlsplit(source)
    except ValueError as error:
        raise InputError(f"{label}: source '{source}' is not a URI ({error})") from error
    if parts.scheme or parts.netloc or parts.query or parts.fragment or not parts.path:
        raise InputError(f"{label}: source '{source}' is not a file of the archive; nothing else is opened")
    path = unquote(parts.path).removeprefix("./")
    refuse_outside(path, label)
    if not (folder / path).is_file():
        raise InputError(f"{label}: has no file '{path}', which its description names")
    return path


def number_of(element: Element, attribute: str, label: str, default: float | None = None) -> float:
    """A number of an attribute; refused where it is missing without a default, or is none."""
    text = element.get(attribute)
    if text is None and default is not None:
        return default
    try:
        value = float(str(text))
    except ValueError:
        value = float("nan")
    if not abs(value) < float("inf"):
        raise InputError(f"{label}: {attribute} of <{local_name(element)}> is {text!r}, not a finite number")
    return value


def units_of(root: Element, path: str, label: str) -> dict[str, Scale]:
    """The units that a document defines; an InputError for one that is none."""
    units: dict[str, Scale] = {}
    for unit in children(root, f"{path}/ssc:Unit"):
        base = child(unit, "ssc:BaseUnit")
        if base is None:
            continue
        where = f"{label}: unit '{unit.get('name')}'"
        exponents = {k: number_of(base, k, where, 0.0) for k in ("kg", "m", "s", "A", "K", "mol", "cd", "rad")}
        factor = number_of(base, "factor", where, 1.0)
        if factor == 0.0:
            raise InputError(f"{where}: factor is 0")
        broken = [k for k, power in exponents.items() if not power.is_integer()]
        if broken:
            raise InputError(f"{where}: the exponent of {broken[0]} is {exponents[broken[0]]:g}, not a whole number")
        whole = {k: int(power) for k, power in exponents.items()}
        units[str(unit.get("name"))] = scale_of(whole, factor, number_of(base, "offset", where, 0.0))
    return units
