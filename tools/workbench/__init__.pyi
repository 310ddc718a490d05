from .answers import Advise as Advise
from .desk import Desk as Desk
from .server import DeskServer as DeskServer
from .server import open_records as open_records
