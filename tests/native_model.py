"""A native FMU with access by the names of its component's variables."""

import zipfile
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path

import fmpy

from native_checks import Entry
from native_driver import OK, Library
from trihedron.fmus import PLATFORMS, host_name
from trihedron.fmus.component import Component, Variable


def open_fmu(path: Path, folder: Path) -> Library:
    """Unpack a native FMU and load its library for this machine."""
    binary, fmi, token = unpack(path, folder)
    return Library(binary, fmi, token)


def unpack(path: Path, folder: Path) -> tuple[Path, int, str]:
    """Return the library for this machine, the version of FMI and the identity of a native FMU."""
    with zipfile.ZipFile(path) as archive:
        archive.extractall(folder)
    description = fmpy.read_model_description(path)
    fmi = int(str(description.fmiVersion)[0])
    platform = PLATFORMS[host_name()]
    binary = folder / "binaries" / platform.folder(fmi) / f"{description.modelName}{platform.suffix}"
    return binary, fmi, str(description.guid if fmi == 2 else description.instantiationToken)


def numbering(component: Component, fmi: int) -> dict[str, list[int]]:
    """Return value references of each variable: one for each element in FMI 2.0, one in FMI 3.0."""
    numbers, at = {}, 1
    for v in component.interface:
        count = len(v.elements) if fmi == 2 else 1
        numbers[v.name] = list(range(at, at + count))
        at += count
    return numbers


def entries(component: Component, fmi: int) -> list[Entry]:
    """Return the component's table for the sequences of calls."""
    references = numbering(component, fmi)
    return [
        Entry(v.name, v.type, v.causality, v.variability, references[v.name], len(v.elements), list(v.starts))
        for v in component.interface
    ]


def as_json(entry: Entry) -> dict[str, object]:
    return asdict(entry)


@dataclass
class Model:
    """An instance with all the elements of a variable at once."""

    library: Library
    component: Component
    instance: int | None

    @classmethod
    def of(cls, library: Library, component: Component) -> "Model":
        instance = library.instantiate(b"model")
        assert instance is not None, library.log
        return cls(library, component, instance)

    def set(self, name: str, values: Sequence[float]) -> int:
        variable = next(v for v in self.component.interface if v.name == name)
        references = numbering(self.component, self.library.fmi)[name]
        return self.library.set(self.instance, variable.type, references, values)

    def get(self, variable: Variable) -> list[float]:
        references = numbering(self.component, self.library.fmi)[variable.name]
        status, values = self.library.get(self.instance, variable.type, references, len(variable.elements))
        assert status == OK, self.library.log
        return values

    def outputs(self) -> list[float]:
        values: list[float] = []
        for v in self.component.interface:
            if v.causality == "output":
                values += self.get(v)
        return values
