"""What runs together: FMUs, their parameters, their buffers, their order."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field

from .archive import UnpackedFmu
from .bus import FmuBus
from .coupling import Coupling, Group
from .interface import Interface, Value, Variable


@dataclass(frozen=True)
class Ensemble:
    """What runs together.

    Attributes
    ----------
    groups : sequence of Group
        the FMUs in the order in which they step
    fmus, interfaces, parameters, buses : mapping
        by the FMU's name: what to instantiate, its variables, what to set before initialisation, its buffers
    coupling : Coupling
        how cycles of connections are taken
    """

    groups: Sequence[Group]
    fmus: Mapping[str, UnpackedFmu]
    interfaces: Mapping[str, Interface]
    parameters: Mapping[str, Iterable[tuple[Variable, Value]]]
    buses: Mapping[str, FmuBus]
    coupling: Coupling = field(default_factory=Coupling)

    @property
    def order(self) -> list[str]:
        """The FMUs in the order in which they step."""
        return [name for group in self.groups for name in group.members]
