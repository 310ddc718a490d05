from .importing import Imported as Imported
from .importing import import_record as import_record
