"""Before the first step: parameters, initialisation, and the first values passed on."""

import ctypes
from collections.abc import Collection, Mapping

import numpy as np

from ..errors import InputError
from . import operations as op
from .coupling import Coupling, Group
from .ensemble import Ensemble
from .grid import Grid
from .plain_loop import actions, run_once
from .program import Program, add_comparisons
from .slave import Slave


def initialise(slaves: Mapping[str, Slave], ensemble: Ensemble, grid: Grid) -> None:
    """Bring all FMUs through initialisation; outputs are passed on in it and after it.

    Raises
    ------
    InputError
        a call that fails, an output that is not finite, or a cycle that does not settle
    """
    for name in ensemble.order:
        slaves[name].set_values(ensemble.parameters[name], ensemble.interfaces[name])
    # Within a cycle nobody has the outputs of those that come later: inputs keep their start values.
    entered: list[str] = []
    for group in ensemble.groups:
        for name in group.members:
            slaves[name].begin(grid.start, grid.time(grid.steps))
            _exchange(slaves[name], ensemble, entered, grid)
            entered.append(name)
        _settle(group, slaves, ensemble, grid)
    for name in ensemble.order:
        slaves[name].call(f"{slaves[name].prefix}ExitInitializationMode")
    for group in ensemble.groups:
        for name in group.members:
            _exchange(slaves[name], ensemble, ensemble.order, grid)
        _settle(group, slaves, ensemble, grid)


def _exchange(slave: Slave, ensemble: Ensemble, sources: Collection[str], grid: Grid) -> None:
    """Set every input (stimuli as in the first step) and get every output."""
    bus, program = ensemble.buses[slave.name], Program()
    for feed in bus.feeds:
        ctypes.memmove(feed.target, feed.rows, feed.width)
    program.add_transfers(slave.name, bus, sources)
    program.add_sets(slave, bus, constants=True)
    program.add_gets(slave, bus)
    state = np.zeros(op.CURSORS, dtype=np.int64)
    with np.errstate(invalid="ignore"):
        status = run_once(actions(program, state, np.zeros(3)), state, 0, grid.start)
    if status == op.NOT_FINITE:
        port = program.places[int(state[op.AT])].port
        assert port is not None
        slave.refuse_not_finite(port.variables, port.values, grid.start)
    if status:
        slave.fail(program.places[int(state[op.AT])].call, status, None)


def _settle(group: Group, slaves: Mapping[str, Slave], ensemble: Ensemble, grid: Grid) -> None:
    """Pass the first outputs of a cycle around: once, or until they no longer change."""
    if not group.cyclic:
        return
    coupling: Coupling = ensemble.coupling
    compare = Program()
    add_comparisons(compare, group, ensemble.buses, coupling)
    state, clock = np.zeros(op.CURSORS, dtype=np.int64), np.zeros(3)
    todo = actions(compare, state, clock)
    run_once(todo, state, 0, grid.start)
    for _ in range(coupling.iterations):
        for name in group.members:
            _exchange(slaves[name], ensemble, ensemble.order, grid)
        clock[op.CHANGE] = 0.0
        run_once(todo, state, 0, grid.start)
        if coupling.kind != "iterate" or clock[op.CHANGE] <= 1.0:
            return
    changing = compare.places[int(state[op.CHANGING])]
    assert changing.variable is not None
    raise InputError(
        f"the cycle {group} does not settle in {coupling.iterations} iterations before the first step: "
        f"'{changing.fmu}.{changing.variable.name}' still changes by {float(clock[op.CHANGE]):.3g} times the tolerance"
    )
