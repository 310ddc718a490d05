"""Sets of effects that make a falsified record fit, sorted by what their sizes may be."""

from collections.abc import Sequence
from dataclasses import dataclass

from ...models.effects import EffectPlace
from ..evidence.evidence import Evidence
from ..evidence.fit import Fit
from .cause import Finding, NamedEffect, finding_of
from .search import equivalence_groups


@dataclass(frozen=True, eq=False)
class Candidates:
    """Sets of effects that make a falsified record fit.

    Attributes
    ----------
    groups : list of list of Fit
        all sets, those together that cannot be told apart
    findings : list of Finding
        one of each group whose effects cannot be nothing; sets that contain another one stand last
    idle : list of Finding
        one of each other group: each size of some effect in it may be zero
    containing : list of Finding
        sets that contain one of the findings, and so can always do what that does: no rivals of it
    """

    groups: Sequence[Sequence[Fit]]
    findings: Sequence[Finding]
    idle: Sequence[Finding]
    containing: Sequence[Finding]

    @staticmethod
    def of(evidence: Evidence, fits: Sequence[Fit]) -> "Candidates":
        """Sort the sets that a search returned."""
        groups = equivalence_groups(evidence.model, fits)
        every = [finding_of(evidence, group) for group in groups[: evidence.model.effort.most_sets]]
        acting = [finding for finding in every if finding.acts]
        idle = [finding for finding in every if not finding.acts]
        containing = []
        for finding in every:
            if any(finding.contains(rival) for rival in acting):
                containing.append(finding)
        acting.sort(key=lambda finding: finding in containing)
        return Candidates(groups, acting, idle, containing)

    @property
    def not_shown(self) -> tuple[str, ...]:
        """Return the reason for not naming sets whose effects may be zero."""
        return tuple(dict.fromkeys(finding.not_shown for finding in self.idle))

    @property
    def are_several(self) -> bool:
        """Return true if more than one set remains."""
        return len(self.groups) > 1 + len(self.containing)

    def beside(self, finding: Finding) -> tuple[tuple[NamedEffect, ...], ...]:
        """Return other sets that no measurement can tell from that of a finding."""
        effects = set(finding.fit.places)
        for group in self.groups:
            if any(set(fit.places) == effects for fit in group):
                return tuple(named(fit.places) for fit in group[1:])
        return ()


def named(places: Sequence[EffectPlace]) -> tuple[NamedEffect, ...]:
    """Return places of effects as results name them."""
    return tuple(NamedEffect.of(place) for place in places)
