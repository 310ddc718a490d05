"""A scenario that is run many times with other parameters: FMUs are unpacked, checked and loaded once."""

import ctypes
from collections.abc import Mapping
from contextlib import ExitStack, suppress
from multiprocessing.util import Finalize
from typing import Any

import polars as pl

from ..scenario import Scenario
from .blocks import Values
from .bus import make_buses
from .connections import check_single_sources, resolve_connections
from .coupling import stepping_groups
from .ensemble import Ensemble
from .interface import Interface, Value, Variable
from .loading import Loaded, Sources, check_states, check_steps, load
from .master import run_fmus
from .parameters import resolve_parameters, value_at_start
from .recording import block_table, recorded_variables, resolve_columns
from .simulation import coupling_of, resolve_stimuli, temporary_folder


class RepeatedScenario:
    """A scenario, ready to be run again and again.

    Each run has new instances of the FMUs, so no run knows of another one, and gives the bits that
    `trihedron.tools.orchestrator.simulate` gives. The libraries stay loaded in between.

    Parameters
    ----------
    scenario : Scenario

    Raises
    ------
    InputError
        whatever the scenario asks for and cannot be done
    """

    def __init__(self, scenario: Scenario) -> None:
        self.scenario = scenario
        self._closing = ExitStack()
        # Also at the end of a process of multiprocessing, which forgets what atexit was told.
        Finalize(self, self._closing.close, exitpriority=10)
        try:
            folder = self._closing.enter_context(temporary_folder())
            self._sources = Sources(scenario.base_folder)
            self._loaded = load(scenario, self._sources, folder)
            self.interfaces: dict[str, Interface] = {name: entry.interface for name, entry in self._loaded.items()}
            self._wires = resolve_connections(scenario.connections, self.interfaces)
            self._coupling = coupling_of(scenario)
            self._groups = stepping_groups(list(self.interfaces), self._wires, self._coupling)
            check_states(self._groups, self._loaded, self._coupling)
            check_steps(self._loaded, scenario.run.step_s)
            self._columns = resolve_columns(scenario.record.columns, self.interfaces)
            self._held = []
            for entry in self._loaded.values():
                # While somebody has it open, a library is not loaded again for each instance.
                with suppress(OSError):
                    self._held.append(ctypes.CDLL(str(entry.fmu.library)))
        except BaseException:
            self._closing.close()
            raise

    def close(self) -> None:
        """Take away the unpacked FMUs."""
        self._closing.close()

    @property
    def columns(self) -> list[str]:
        """Names of the record's columns, without `time_s`."""
        return [column.name for column in self._columns]

    def run(self, parameters: Mapping[str, Mapping[str, Any]]) -> pl.DataFrame:
        """Run the scenario with some parameters in place of its own.

        Parameters
        ----------
        parameters : mapping of str to mapping
            FMU -> variable (or array, or element) -> value

        Returns
        -------
        DataFrame
            as `trihedron.tools.orchestrator.simulate` gives it
        """
        loaded = {name: self._changed(name, entry, parameters.get(name, {})) for name, entry in self._loaded.items()}
        grid, drives = resolve_stimuli(self.scenario, self._sources, loaded)
        check_single_sources(self._wires, drives)
        buses = make_buses(
            self.interfaces,
            self._wires,
            [drive for _, drive in drives],
            {name: recorded_variables(self._columns, name) for name in self.interfaces},
            lambda name, variable: value_at_start(variable, loaded[name].values),
        )
        values = {name: entry.values.values() for name, entry in loaded.items()}
        fmus = {name: entry.fmu for name, entry in loaded.items()}
        ensemble = Ensemble(self._groups, fmus, self.interfaces, values, buses, self._coupling)
        tables: list[pl.DataFrame] = []

        def keep(ticks: range, found: Values) -> None:
            tables.append(block_table(self._columns, found, ticks, grid))

        run_fmus(ensemble, grid, self.scenario.record.every, keep)
        return pl.concat(tables)

    def _changed(self, name: str, entry: Loaded, parameters: Mapping[str, Any]) -> Loaded:
        """An FMU with other values of some of its parameters."""
        if not parameters:
            return entry
        changed: dict[str, tuple[Variable, Value]] = resolve_parameters(entry.interface, parameters, {}, {})
        return Loaded(entry.fmu, entry.interface, {**entry.values, **changed})
