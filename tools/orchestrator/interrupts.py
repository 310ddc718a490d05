"""Ctrl-C during a run: it ends the run between two calls of FMUs, never inside one."""

import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType


class Interrupt:
    """Whether Ctrl-C was pressed; false until then."""

    def __init__(self) -> None:
        self.pressed = False

    def __bool__(self) -> bool:
        return self.pressed


@contextmanager
def held_interrupt() -> Iterator[Interrupt]:
    """Hold the first Ctrl-C back until the block looks at it or ends; the second one acts at once.

    An FMU that runs Python in this process would be struck by the exception itself, and report it as its own failure.

    Yields
    ------
    Interrupt
        true once Ctrl-C was pressed: the block should then end

    Raises
    ------
    KeyboardInterrupt
        at the end of the block, when Ctrl-C was pressed
    """
    interrupt = Interrupt()
    before = signal.getsignal(signal.SIGINT)
    if threading.current_thread() is not threading.main_thread() or before is not signal.default_int_handler:
        # Handlers belong to the main thread; and what a host program does about Ctrl-C is its own affair.
        yield interrupt
        return

    def note(_number: int, _frame: FrameType | None) -> None:
        interrupt.pressed = True
        signal.signal(signal.SIGINT, before)

    signal.signal(signal.SIGINT, note)
    try:
        yield interrupt
    finally:
        signal.signal(signal.SIGINT, before)
    if interrupt:
        raise KeyboardInterrupt
