from .importing import Imported as Imported
from .importing import make_record as make_record
