"""What a master does in a step: one flat table of operations on addresses, which two loops can run.

A row is an operation's code and seven whole numbers, with two real numbers beside it. The rows of a step are run from
the first to the last, for every step; what is recorded has a table of its own.

| operation | whole numbers | real numbers |
|---|---|---|
| FEED | steps from which rows hold, their number, first row, bytes of a row, target, its cursor | |
| MOVE | target, source, bytes | |
| MOVE8 | target, source: eight bytes | |
| CONVERT | target, source, type of the target, of the source | factor, offset |
| CALL4 | function, instance, references, their number, values: FMI 2.0's get and set | |
| CALL5 | function, instance, references, their number, values, their number: FMI 3.0's | |
| STEP2, STEP3 | fmi2DoStep or fmi3DoStep, instance, noSetFMUStatePriorToCurrentPoint, place of what it returns | |
| FINITE | first of so many real numbers, their number | |
| STATE | function of a state (get or free), instance, place of the state | |
| BEGIN | a new loop of connections: the first iteration | |
| RESTORE | function that sets a state, instance, place of the state: in all iterations but the first | |
| COMPARE | value, place of its value in the iteration before, its type | tolerance |
| REPEAT | row to go back to while a value changes, most iterations | |
"""

WIDTH = 8
FEED, MOVE, MOVE8, CONVERT, CALL4, CALL5, STEP2, STEP3, FINITE, STATE, BEGIN, RESTORE, COMPARE, REPEAT = range(14)

# What both loops keep in whole numbers.
STEP, LAST_STEP, ROW, EVERY, ROWS, RECORDS, ITERATION, CHANGING, STATUS, AT, CURSORS = range(11)
"""Step to make, step to stop before, row to record, every which step, rows of both tables, iteration, the row of the
value that changed most, status of the call that failed, its row (-1: none), first cursor of a feed."""

# What both loops keep in real numbers.
START, LENGTH, CHANGE = range(3)
"""Start and step [s], the largest change of a value in the last iteration, against what is allowed."""

NOT_FINITE, NOT_SETTLED, ENDED, EARLY = 100, 101, 102, 103
"""Statuses beside FMI's: a value that is not finite, a loop that does not settle, an FMU that asks for the end of the
simulation, or that has returned before the end of the step."""
WARNING = 1
"""The worst status of FMI with which a run goes on."""
