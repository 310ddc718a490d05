from .run import Simulation as Simulation
from .run import run_folder as run_folder
from .run import run_scenario as run_scenario
from .run import simulate_table as simulate_table
from .scenario import RunOptions as RunOptions
from .scenario import Scenario as Scenario
from .scenario import read_scenario as read_scenario
