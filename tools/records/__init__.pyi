from .kinds import PositionRecord as PositionRecord
from .kinds import RawRecord as RawRecord
from .kinds import StrapdownRecord as StrapdownRecord
from .kinds import write_record as write_record
from .limits import limits_of as limits_of
from .noise import tells_noise as tells_noise
from .read import Source as Source
from .read import read_record as read_record
