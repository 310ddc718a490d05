from .folder import INSTRUMENT as INSTRUMENT
from .folder import SAID as SAID
from .folder import Entries as Entries
from .folder import Entry as Entry
from .folder import add_to_instrument as add_to_instrument
from .folder import entries_of as entries_of
from .folder import nearest_of_instrument as nearest_of_instrument
from .folder import trend_of_instrument as trend_of_instrument
