from .importing import Imported as Imported
from .importing import listed as listed
from .importing import make_record as make_record
from .mapping import OpenQuestions as OpenQuestions
from .numbers import clock as clock
from .numbers import parsed_moment as parsed_moment
from .numbers import parsed_number as parsed_number
from .numbers import sexagesimal as sexagesimal
