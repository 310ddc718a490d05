from .run import Simulation as Simulation
from .run import default_folder as default_folder
from .run import simulate as simulate
from .run import simulate_table as simulate_table
from .scenario import Asked as Asked
from .scenario import Scenario as Scenario
from .scenario import read_scenario as read_scenario
