from .answers import Advise as Advise
from .at_table import measure as measure
from .desk import Desk as Desk
from .server import DeskServer as DeskServer
from .server import TableView as TableView
from .server import open_records as open_records
