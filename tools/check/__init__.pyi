from .files import channels_warning as channels_warning
from .files import check as check
from .findings import Check as Check
from .findings import Problem as Problem
