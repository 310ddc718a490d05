from .run_view import shown_run as shown_run
from .terminal import Terminal as Terminal
from .terminal import terminal_of as terminal_of
