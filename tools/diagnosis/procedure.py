"""From a record to a verdict on the simulation: the procedure of `trihedron diagnose`, for any record.

Falsify the model; search for the smallest sets of effects that mend it; judge them by left-out data. Bound the possible
sizes; propose measurements that separate the remaining sets.
"""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

from ...models.effects import EffectPlace
from ..bounded.programmes import SolverError
from ..bounded.sets import MAX_SET
from ..bounded.work import Budget, CutOff, Work, shared_budget
from ..calibrated import Calibration
from ..errors import InputError
from ..evidence.evidence import Evidence
from ..evidence.fit import Fit, Gain
from ..records import PositionRecord, StrapdownRecord
from ..sieve import LEAST_OF_TWO, Simple, other_breaks, tells_two_things, with_rounding, wrong_pieces
from .beyond import Beyond, keys_of
from .candidates import Candidates, named
from .cause import Finding, NamedEffect, causes_of, centred, excluded_sizes, finding_of
from .dependence import Dependence, Proven, Suffices, dependence, residual_structure
from .helps import of_lengths, only_at_one_length, what_helps
from .hypothesis import Hypothesis, answered, not_answered, places_of
from .kinds import KnownDirections, check_room, evidence_of, evidence_with_formulas, kind_of
from .result import FAULTS, LIMITED, Diagnosis, Explanation, StandsWith
from .rivals import Listed, Unlisted, complexity_of, least_complexity
from .search import MOST_WORK, Found, search, single_radii
from .shortlist import CLOSE, Shortlist, next_step, pairs_of_faults, simplest_first, single_faults
from .witness import Judgement, Witness, by_need, judgement_of, objections_of

FUNCTIONS, POSSIBLE = "functions of one quantity", "what is possible of a function"
ALL_STAGES = 20.0
"""Work of all stages of a diagnosis together, as a multiple of that of the search for sets of effects."""
MOST_SINGLES = 4
"""Most single effects whose noise bound is stated of a record that no set explains."""


def diagnose(
    record: PositionRecord | StrapdownRecord | KnownDirections,
    *,
    evidence: Evidence | None = None,
    hypotheses: Sequence[str] = (),
    rerun: bool = True,
    extend: bool = False,
    progress: bool = False,
    **options: Any,
) -> Diagnosis:
    """Say whether the simulation can be true of a record, and if not, which smallest set of effects mends it.

    Parameters
    ----------
    record : PositionRecord, StrapdownRecord, KnownDirections
    evidence : Evidence, optional
        of the record; by default it is made with the options, as for `evidence_of`
    hypotheses : sequence of str
        formulas that are judged
    rerun : bool
        simulate the held-out data again, without and with the effects that are named, and compute the power
    extend : bool
        extend the model by a function outside the catalogue, though an effect of the catalogue stands
    progress : bool
        show a bar on standard error, where that is a terminal

    Raises
    ------
    InputError
        for a record that cannot be used or would need too much memory, or a formula that is none
    """
    if not isinstance(record, KnownDirections):
        check_room(record)
    at_table = kind_of(record).at_table
    formulas = places_of(hypotheses, at_table=at_table, with_gyros=not at_table or options.get("bench") is not None)
    if evidence is None:
        evidence = evidence_of(record, **options)
    beside = evidence_with_formulas(record, evidence, formulas, **options)
    try:
        return diagnosed(evidence, rerun=rerun, extend=extend, progress=progress, formulas=formulas, beside=beside)
    except SolverError as error:
        raise InputError(f"{record.path}: {error}; {evidence.reader.too_large}") from error


def diagnosed(
    evidence: Evidence,
    *,
    rerun: bool = True,
    extend: bool = False,
    progress: bool = False,
    most_work: float = MOST_WORK,
    budget: Budget | None = None,
    formulas: Sequence[EffectPlace] = (),
    beside: Evidence | None = None,
) -> Diagnosis:
    """Diagnose evidence of any record; a SolverError where errors are too large to solve.

    `most_work` is that of the search, `budget` that of all stages, by default of `ALL_STAGES` times as much.
    `formulas` are judged by evidence that knows them, `beside`. Others are as for `diagnose`.
    """
    evidence = with_rounding(evidence)
    with shared_budget(budget or Budget(ALL_STAGES * most_work * evidence.model.effort.cost)) as budget:
        procedure = Procedure(evidence, rerun, extend, progress, most_work, budget)
        diagnosis = procedure.diagnosis()
        return procedure.with_answers(diagnosis, beside or evidence, formulas) if formulas else diagnosis


@dataclass(frozen=True, eq=False)
class Procedure:
    """The stages of a diagnosis, each worked out once, when it is needed; options as of `diagnosed`."""

    evidence: Evidence
    rerun: bool
    extend: bool
    progress: bool
    most_work: float
    budget: Budget

    def diagnosis(self) -> Diagnosis:
        """The result."""
        if self.missing:
            return self._result("insufficient", self.missing)
        if not self.evidence.model.falsified:
            return self._of_model_that_stands()
        try:
            with self.budget.of("what explains the record"):
                faults = self.faults or self._in_place_of_steps
                return self._of_list(faults) if faults else self._of_physics()
        except CutOff:
            return self._not_judged()

    def with_answers(self, diagnosis: Diagnosis, beside: Evidence, formulas: Sequence[EffectPlace]) -> Diagnosis:
        """Return the diagnosis with the formulas judged by evidence that knows them."""
        before, answers = len(self.budget.cut_off), []
        for place in formulas:

            def stage(place: EffectPlace = place) -> Hypothesis:
                return answered(beside, place, diagnosis.findings, rerun=self.rerun)

            answers.append(self._within_budget(f"the formula {place.law}", stage, None) or not_answered(beside, place))
        warnings = diagnosis.warnings
        if names := self.budget.cut_off[before:]:
            warnings = (*warnings, LIMITED + "; ".join(names))
        return diagnosis.model_copy(update={"hypotheses": tuple(answers), "warnings": warnings})

    @cached_property
    def _untried(self) -> list[str]:
        """Stages in which the solver failed."""
        return []

    def _tried(self, what: str, stage: Callable[[], Any], otherwise: Any) -> Any:
        """Return the result of a stage; if the solver fails, a substitute result that reports it."""
        try:
            return self._within_budget(what, stage, otherwise)
        except SolverError:
            self._untried.append(what)
        return otherwise

    def _within_budget(self, what: str, stage: Callable[[], Any], otherwise: Any) -> Any:
        """Return the result of a stage; if the work has reached its limit, a substitute: the budget keeps its name."""
        try:
            with self.budget.of(what):
                return stage()
        except CutOff:
            return otherwise

    # Falsify

    @cached_property
    def head(self) -> Mapping[str, Any]:
        """Return the keys of the assumptions, and of the model without effects."""
        return self.evidence.reader.head()

    @cached_property
    def missing(self) -> Mapping[str, Any]:
        """Return the keys of missing data, where nothing can be fitted."""
        return self.evidence.reader.missing()

    @cached_property
    def lengths(self) -> Mapping[str, Any]:
        """Return the keys of each length of moves or windows; empty for a record without them."""
        return self._within_budget("each length", lambda: of_lengths(self.evidence), {})

    @cached_property
    def _read_off(self) -> tuple[str, ...]:
        """Why effects that readings show by themselves are not named."""
        return tuple(effect.objection for effect in self.evidence.reader.read_off if effect.objection)

    @cached_property
    def dependence(self) -> Dependence | None:
        """Return the dependence of the misfit on place and quantity."""
        return self._tried(FUNCTIONS, lambda: dependence(self.evidence, Work(self.budget.limit, FUNCTIONS)), None)

    # Search

    @cached_property
    def faults(self) -> tuple[Simple, ...]:
        """The faults of the record, or, where neither one of them nor an effect or a function does, pairs of them."""
        if self.objections:
            # Single pieces may be why a record contradicts its description.
            return self._tried(FAULTS, lambda: wrong_pieces(self.evidence), ())
        single = self._tried(FAULTS, lambda: single_faults(self.evidence), ())
        simple_enough = bool(single) and single[0].numbers <= LEAST_OF_TWO + CLOSE
        if simple_enough or not tells_two_things(self.evidence):
            return single
        if self.dependence is not None and (self.dependence.least or math.inf) < LEAST_OF_TWO:
            return single
        if search(self.evidence.model, largest=1).fits:
            return single
        pairs = self._within_budget("pairs of faults of the record", lambda: pairs_of_faults(self.evidence), ())
        return simplest_first([*single, *pairs])

    @property
    def _in_place_of_steps(self) -> tuple[Simple, ...]:
        """Breaks of other parts that do as well as a step of the catalogue beside other effects."""
        fits = [finding.fit for finding in self.candidates.findings] if self.found.fits else []
        return self._tried("breaks in place of steps", lambda: other_breaks(self.evidence, fits), ())

    @cached_property
    def objections(self) -> tuple[str, ...]:
        """Why nothing is searched for."""
        return (*self.evidence.reader.objections(), *self._read_off)

    @cached_property
    def found(self) -> Found:
        """Return the smallest sets of effects that make the record fit."""
        if self.objections:
            return Found(())
        largest = MAX_SET
        if self.faults:
            # Larger sets need more numbers than the simplest fault: no rivals of it.
            while largest > 1 and least_complexity(largest) > self.faults[0].numbers + 1:
                largest -= 1
        return search(self.evidence.model, progress=self.progress, most_work=self.most_work, largest=largest)

    @cached_property
    def candidates(self) -> Candidates:
        """The same, sorted."""
        return Candidates.of(self.evidence, self.found.fits)

    # Judge

    @cached_property
    def listed(self) -> Listed:
        """Return the catalogue in comparison with functions of one quantity."""
        return Listed(self.evidence)

    @cached_property
    def beside_catalogue(self) -> Dependence | None:
        """Return the dependence, marked where a set of the catalogue explains the misfit as simply."""
        return self.dependence and self.listed.beside(self.dependence, self.found.fits)

    @cached_property
    def proven(self) -> Proven | None:
        """Return the proven place and quantity."""
        return self.beside_catalogue and Proven.of(self.beside_catalogue)

    @cached_property
    def proves_quantity(self) -> bool:
        """Return true if a quantity is proven."""
        return self.proven is not None and self.proven.quantity is not None

    @cached_property
    def unlisted(self) -> Unlisted:
        """Return the fitting functions outside the catalogue, next to the first set that fits."""
        candidates = self.candidates
        first = candidates.findings[0].fit if candidates.findings else candidates.groups[0][0]
        return Unlisted.of(self.beside_catalogue, self.listed, first)

    @cached_property
    def functions(self) -> Mapping[str, Any]:
        """Return the keys of the function of a proven place and quantity, next to the sets that fit."""
        fits = self.found.fits
        return self._functions_beside(fits, extend=self.extend or not fits)

    def _functions_beside(self, fits: Sequence[Fit], *, extend: bool) -> Mapping[str, Any]:
        dependence = self.beside_catalogue
        if dependence is None or dependence.proven is None:
            return {}
        beyond = Beyond(self.evidence, dependence.proven.pair, dependence.proven.form, tuple(fits))
        return self._tried(POSSIBLE, lambda: keys_of(beyond, extend=extend, rerun=self.rerun), {})

    @cached_property
    def caution(self) -> tuple[str, ...]:
        """Return sentences on explanations that the record cannot tell from the sets that fit."""
        caution = (*self.functions.get("caution", ()), *self.unlisted.caution)
        # Other laws do as well as sets that one function holds, though no quantity is proven.
        return caution if self._beyond_held is None else caution + self._beyond_held.caution

    @cached_property
    def _beyond_held(self) -> Beyond | None:
        """Functions of the quantity on which the first set depends, where neither that is proven nor the set simple."""
        held, fits = self.unlisted.held, self.found.fits
        several = len(fits[0].places) > self.evidence.model.effort.most_known_alone
        if held is None or self.proves_quantity or not several:
            return None
        beyond = Beyond(self.evidence, held.pair, held.form, tuple(fits))
        return self._within_budget(POSSIBLE, lambda: beyond if beyond.bands else None, None)

    # Bound the possible sizes

    @cached_property
    def nominal(self) -> Fit | None:
        """Return the nominal model, centred, if it fits; else None."""
        if self.missing or self.evidence.model.falsified:
            return None
        return centred(self.evidence, self.evidence.model.baseline)

    def _explanations(self, sets: Sequence[Finding], functions: Mapping[str, Any]) -> tuple[Explanation, ...]:
        """Return all explanations that fit: sets of the catalogue, then equally simple functions outside it."""
        explanations = []
        for finding in sets:
            explanations.append(Explanation.of(finding, self.evidence.reader.calibration_of(finding.fit)))
        if "extension" in functions:
            explanations.append(Explanation.of_extension(functions["extension"]))
        return tuple(explanations)

    def _excluded(self, evidence: Evidence, fit: Fit) -> tuple[dict[str, Any], ...] | None:
        """Return the excluded sizes of effects beside a fit; None where the work has reached its limit."""
        return self._within_budget(
            "the sizes of effects that are excluded", lambda: excluded_sizes(evidence, fit), None
        )

    def _of_model(self, evidence: Evidence, fit: Fit, calibration: Calibration, excluded: Any) -> Mapping[str, Any]:
        """Return the keys of a model with effects."""
        of_model = evidence.reader.of_model
        return self._within_budget("what changes with the effects", lambda: of_model(fit, calibration, excluded), {})

    def _gain(self, evidence: Evidence, fit: Fit) -> Gain | None:
        """Return the gain on held-out data, where these are simulated again."""
        if not self.rerun:
            return None
        return self._within_budget("the gain on held-out data", lambda: evidence.gain(fit), None)

    # The results

    def _not_judged(self) -> Diagnosis:
        """Unexplained: the work has reached its limit before any set or fault that fits was judged."""
        reason = "would do; it was not judged, since the work has a limit"
        return self._unexplained([f"{fit.title} {reason}" for fit in self.found.fits])

    def _of_list(self, faults: Sequence[Simple]) -> Diagnosis:
        """Return the diagnosis from one list of record faults, effects and functions of a quantity."""
        shortlist = Shortlist.of(faults, self.candidates if self.found.fits else None, self.dependence)
        # Breaks in place of steps are rivals of sets that contain a step, not of a simpler law.
        if shortlist.is_beaten or (not self.faults and shortlist.has_simpler_function):
            return self._of_physics()
        if shortlist.names_the_first:
            return self._of_fault(shortlist.first, shortlist.explanations)
        findings = shortlist.findings
        return self._result(
            "ambiguous",
            {},
            explanations=(*shortlist.explanations, *self._explanations(findings, {})),
            findings=findings,
            alternatives=tuple(finding.causes for finding in findings),
            next=next_step(shortlist.first),
        )

    def _of_fault(self, fault: Simple, explanations: Sequence[Explanation]) -> Diagnosis:
        """A fault of the record explains it, and nothing else does that is as simple."""
        self.budget.check()
        keys: dict[str, Any] = {"explanations": explanations, "next": next_step(fault)}
        if fault.evidence is not self.evidence:
            # Objections of the model with the fault do not count.
            diagnosis = self._result("explained", {}, **keys)
            warnings = (*fault.evidence.reader.head().get("warnings", ()), *self._not_tried)
            return diagnosis.model_copy(update={"warnings": warnings, "remaining": fault.evidence})
        if fault.kind == "break" or fault.fit is None:
            return self._result("explained", {}, **keys)
        # Single readings that are off are effects of the model.
        finding, calibration = finding_of(self.evidence, [fault.fit]), explanations[0].calibration
        assert calibration is not None
        judgement = judgement_of(self.evidence, finding.fit)
        excluded = self._excluded(self.evidence, finding.fit)
        model = self._of_model(self.evidence, finding.fit, calibration, excluded)
        return self._result("explained", model, findings=[finding], excluded=excluded, judgement=judgement, **keys)

    def _of_physics(self) -> Diagnosis:
        """Return the diagnosis from effects of the simulation alone."""
        return self._of_sets() if self.found.fits else self._without_a_set()

    def _of_model_that_stands(self) -> Diagnosis:
        """Consistent, unless the record is too short, or readings show an effect by themselves."""
        evidence, fit = self.evidence, self.nominal
        assert fit is not None
        excluded = self._excluded(evidence, evidence.model.baseline)
        calibration = evidence.reader.calibration_of(fit)
        model = evidence.reader.of_model(fit, calibration, excluded)
        if self._read_off:
            return self._unexplained(self._read_off, calibration=calibration)
        verdict = "insufficient" if "missing" in model else "consistent"
        if evidence.reader.read_off and verdict == "consistent":
            finding = Finding(causes_of(evidence, fit), fit)
            explanations = (Explanation.of(finding, calibration),)
            return self._result(
                "explained",
                model,
                calibration=calibration,
                explanations=explanations,
                findings=[finding],
                excluded=excluded,
            )
        return self._result(verdict, model, calibration=calibration, excluded=excluded)

    def _without_a_set(self) -> Diagnosis:
        """Unexplained: nothing of the catalogue mends the model."""
        lengths = self.lengths.get("lengths", ())
        helpful, sentences = self._within_budget("what helps", lambda: what_helps(self.evidence, lengths), ((), ()))
        gain = self._gain(self.evidence, self.evidence.model.refit(helpful)) if helpful else None
        return self._unexplained((*self.objections, *sentences), self.functions, gain=gain)

    def _of_sets(self) -> Diagnosis:
        """Return the diagnosis from the sets of effects that fit."""
        candidates, unlisted = self.candidates, self.unlisted
        findings, idle = candidates.findings, candidates.not_shown
        if self._formulas:
            return self._of_formulas(self._formulas)
        if not findings:
            return self._not_named(idle, unshown=candidates.idle)
        if self.found.is_sample and unlisted.rivals:
            return self._not_named((*(_as_simple(finding, unlisted) for finding in findings), *idle))
        if untried := self.evidence.model.untried(self.found.size):
            return self._not_named((*(f"{finding.title} would do; {untried}" for finding in findings), *idle))
        best, judgement = findings[0], judgement_of(self.evidence, findings[0].fit)
        if candidates.are_several or not self.found.complete:
            return self._ambiguous(
                findings,
                [finding.fit for finding in findings],
                judgement=judgement,
                complete=self.found.complete,
                not_named=idle,
                objections=objections_of(judgement),
            )
        at_one_length: tuple[str, ...] = ()
        if not isinstance(judgement, Witness):
            judgement = by_need(judgement)
            order = [effect.place for effect in self.evidence.reader.read_off]
            order += [witness.place for witness in judgement if witness.place is not None]
            best = best.in_order(order)
            at_one_length = only_at_one_length(self.evidence, best.fit, self.lengths.get("lengths", ()))
        if objections := (*objections_of(judgement), *at_one_length):
            return self._not_named(objections, findings=[best], judgement=judgement)
        if unlisted.rivals:
            return self._ambiguous([best], [best.fit, *unlisted.fits(self.evidence)], judgement=judgement)
        return self._explained(best, judgement)

    @cached_property
    def _formulas(self) -> Sequence[Fit]:
        """Return the proven formulas that need at least two numbers fewer than any set of effects."""
        beyond = self.functions.get("beyond")
        if beyond is None or self.found.unsolved:
            # A set that was not tried may need as few numbers.
            return ()
        formulas = [law.fit for law in beyond.laws if not law.is_listed and len(law.fit.places) == 1]
        least = min((complexity_of(fit.places) for fit in formulas), default=0)
        of_sets = [complexity_of(fit.places) for fit in self.found.fits]
        if not self.found.complete:
            of_sets.append(least_complexity(self.found.size))
        if least + 1 >= min(of_sets):
            return ()
        shortest = [fit for fit in formulas if complexity_of(fit.places) == least]
        return sorted(shortest, key=lambda fit: fit.radius)

    def _of_formulas(self, fits: Sequence[Fit]) -> Diagnosis:
        """A formula explains the record, or one of several of as few numbers; every set of effects needs more."""
        self.budget.check()
        evidence = self.evidence.including([place for fit in fits for place in fit.places])
        findings = []
        for fit in fits:
            middle = centred(evidence, fit)
            findings.append(Finding(causes_of(evidence, middle), middle))
        first, is_named = findings[0].fit, len(findings) == 1
        calibration = evidence.reader.calibration_of(first)
        judgement = judgement_of(evidence, first)
        excluded = self._excluded(evidence, first) if is_named else ()
        explanations = [Explanation.of(finding, calibration) for finding in findings]
        explanations += [Explanation.of(other) for other in self.candidates.findings]
        return self._result(
            "explained" if is_named else "ambiguous",
            self._of_model(evidence, first, calibration, excluded) if is_named else {},
            functions=_without_caution(self.functions, "extension"),
            explanations=explanations,
            alternatives=() if is_named else tuple(finding.causes for finding in findings),
            level="quantity",
            findings=findings,
            judgement=judgement,
            gain=self._gain(evidence, first) if is_named else None,
            excluded=excluded,
        )

    def _explained(self, best: Finding, judgement: Judgement) -> Diagnosis:
        """One set of effects explains the record, and no other does."""
        self.budget.check()
        functions = self.functions
        if not functions and self._beyond_held is not None:
            held = self._beyond_held
            functions = self._within_budget(POSSIBLE, lambda: keys_of(held, extend=self.extend, rerun=self.rerun), {})
        explanations = self._explanations([best], functions)
        calibration = explanations[0].calibration
        assert calibration is not None
        excluded = self._excluded(self.evidence, best.fit)
        return self._result(
            "explained",
            self._of_model(self.evidence, best.fit, calibration, excluded),
            functions=_without_caution(functions),
            explanations=explanations,
            # Other laws of a quantity change nothing that a person does: `level`, `laws` and `band` have them.
            caution=self.unlisted.caution,
            level=self._level(best, functions.get("beyond")),
            findings=[best],
            judgement=judgement,
            containing=tuple(named(finding.fit.places) for finding in self.candidates.containing),
            equivalent_sets=self.candidates.beside(best),
            gain=self._gain(self.evidence, best.fit),
            excluded=excluded,
        )

    def _level(self, best: Finding, beyond: Beyond | None) -> str | None:
        """Return the level to which the record proves the only set: law or quantity; None where not compared."""
        if not self.unlisted.compared or self.dependence is None:
            return None
        other_laws = self.unlisted.same is not None or (beyond is not None and bool(beyond.caution))
        if self.proves_quantity:
            # Without a comparison with other laws of the quantity, no law is unique.
            return "quantity" if other_laws or beyond is None else "law"
        if len(best.fit.places) > self.evidence.model.effort.most_known_alone:
            return "quantity" if beyond is not None and beyond.caution else None
        return "quantity" if other_laws else "law"

    def _ambiguous(self, findings: Sequence[Finding], fits: Sequence[Fit], **keys: Any) -> Diagnosis:
        """Return the ambiguous result: several models fit, and a measurement would separate them."""
        functions = dict(self.functions)
        if "beyond" in functions and "extension" not in functions:
            beyond = functions["beyond"]
            extension = self._within_budget(POSSIBLE, lambda: beyond.extension(self.rerun), None)
            if extension is not None:
                functions["extension"] = extension
        rivals = tuple(Explanation.of_function(rival) for rival in self.unlisted.rivals)
        return self._result(
            "ambiguous",
            self._within_budget("what to measure next", lambda: self.evidence.reader.probe(fits), {}),
            functions=functions,
            explanations=(*self._explanations(findings, functions), *rivals),
            alternatives=tuple(finding.causes for finding in findings),
            caution=self.caution,
            findings=findings,
            **keys,
        )

    def _not_named(self, objections: Sequence[str], **keys: Any) -> Diagnosis:
        """Return the unexplained result: sets of effects fit, but each has an objection."""
        extended = self._functions_beside((), extend=True)
        caution = extended.get("caution", self.caution)
        return self._unexplained(objections, {**self.functions, **extended}, caution=caution, **keys)

    def _unexplained(
        self, objections: Sequence[str], functions: Mapping[str, Any] | None = None, **keys: Any
    ) -> Diagnosis:
        proven = self.proven if self.evidence.model.falsified else None
        if proven is not None:
            keys |= {"level": "place", "depends_on": proven.not_excluded}
            if proven.quantity:
                keys |= {"level": "quantity", "depends_on": (proven.on, *proven.same)}
        structure = residual_structure(self.evidence.reader.channels())
        return self._result(
            "unexplained",
            {},
            functions=functions or {},
            explanations=self._explanations((), functions or {}),
            not_named=tuple(objections),
            residual_structure=structure,
            **keys,
        )

    def _result(
        self,
        verdict: str,
        model_keys: Mapping[str, Any],
        *,
        functions: Mapping[str, Any] | None = None,
        explanations: Sequence[Explanation] = (),
        **keys: Any,
    ) -> Diagnosis:
        """Return the result: keys of every record, `more` keys of its evidence, and the `keys` that are not empty.

        `functions` are keys of functions of one quantity.
        """
        content: dict[str, Any] = {"evidence": self.evidence, "explanations": explanations, "causes": (), "gain": None}
        content |= self.head
        if not self.missing:
            content |= {**self.lengths, **self._power}
            if self.evidence.model.falsified:
                content |= self._of_misfit
            if verdict in ("unexplained", "ambiguous"):
                content["stands_with"] = self._stands_with
        content |= functions or {}
        content.pop("extension", None)
        content |= model_keys
        for key, value in keys.items():
            if value not in (None, ()):
                content[key] = value
        if verdict == "explained":
            content["causes"] = explanations[0].causes
        if "calibration" not in content:
            content["calibration"] = self.evidence.reader.calibration_of()
        warnings = *self.head.get("warnings", ()), *model_keys.get("warnings", ())
        content["warnings"] = (*warnings, *self._not_tried)
        return Diagnosis.model_validate({**content, "verdict": verdict})

    @property
    def _stands_with(self) -> tuple[StandsWith, ...]:
        """Return the bounds that the model needs alone, and with effects."""
        if not self.evidence.model.falsified or self.evidence.reader.stated_bound is None:
            return ()
        return self._within_budget("the bounds that would do", self._bounds_that_would_do, ())

    def _bounds_that_would_do(self) -> tuple[StandsWith, ...]:
        reader, bound = self.evidence.reader, self.evidence.reader.stated_bound
        assert bound is not None
        sets: list[tuple[Sequence[EffectPlace], float]] = [((), self.evidence.model.radius)]
        if self.found.fits:
            sets += [(finding.fit.places, finding.fit.radius) for finding in self.candidates.findings]
        else:
            sets += [((place,), radius) for place, radius in self._singles[:MOST_SINGLES]]
        entries = []
        for places, radius in sets:
            entries.append(
                StandsWith(
                    effects=tuple(NamedEffect.of(self.evidence.reader.named(place)) for place in places),
                    noise_bound=radius * bound,
                    option=reader.option_of_bounds(radius, places),
                )
            )
        return tuple(entries)

    @cached_property
    def _singles(self) -> Sequence[tuple[EffectPlace, float]]:
        """Return single effects with the radii that they leave."""
        if not self.evidence.model.effort.ranks_each:
            return ()
        return self._within_budget("each effect alone", lambda: single_radii(self.evidence.model), ())

    @property
    def _not_tried(self) -> list[str]:
        """Sentences on sets of effects and stages on which the solver failed, and on searches that a limit ended."""
        unsolved = list(self.found.warnings if self.evidence.model.falsified and not self.missing else ())
        unsolved += [f"not tried, since the solver failed: {what}" for what in dict.fromkeys(self._untried)]
        if self.budget.cut_off:
            unsolved.append(LIMITED + "; ".join(self.budget.cut_off))
        return unsolved

    @cached_property
    def _power(self) -> Mapping[str, Any]:
        if not self.rerun:
            return {}
        power = self._tried("the detection limit", self.evidence.reader.power, ())
        return {"power": power} if power else {}

    @cached_property
    def _of_misfit(self) -> Mapping[str, Any]:
        """Return the keys of a falsified model: dependences of the misfit, sufficient bound, gain of single effects."""
        evidence = self.evidence
        keys: dict[str, Any] = {"tried": tuple((place.title, radius) for place, radius in self._singles)}
        if evidence.reader.stated_bound is not None:
            keys["noise_bound_needed"] = evidence.model.radius * evidence.reader.stated_bound
        if self.dependence is not None:
            keys["suffices"] = tuple(Suffices.of(standing) for standing in self.dependence.standing)
            keys |= {"dependence": self.beside_catalogue, "proven": self.proven}
        return {**keys, **self.found.keys}


def _without_caution(functions: Mapping[str, Any], *names: str) -> dict[str, Any]:
    """Return keys of functions without their cautions, and without some other keys."""
    return {key: value for key, value in functions.items() if key not in ("caution", *names)}


def _as_simple(finding: Finding, unlisted: Unlisted) -> str:
    """Why a set that was found before the search was cut off is not named."""
    rival = unlisted.rivals[0].pair.in_words
    return f"{finding.title} would fit; so may sets that were not tried and, equally simple, {rival}"
