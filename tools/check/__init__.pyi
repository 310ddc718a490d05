from .checked import check as check
from .files import channels_warning as channels_warning
from .findings import Check as Check
from .findings import Problem as Problem
