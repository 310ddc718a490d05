from .checked import check as check
from .findings import Check as Check
from .findings import Problem as Problem
from .tables import channels_warning as channels_warning
