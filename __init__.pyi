from .tools.check import Check as Check
from .tools.corrections import apply as apply
from .tools.corrections import correction as correction
from .tools.corrections import export_calibration as export_calibration
from .tools.errors import InputError as InputError
from .tools.exporting import Exported as Exported
from .tools.foreign import Imported as Imported
from .tools.installation import Installation as Installation
from .tools.library import compare as compare
from .tools.library import doctor as doctor
from .tools.library import export as export
from .tools.library import export_notebook as export_notebook
from .tools.library import hide as hide
from .tools.library import measure as measure
from .tools.library import new as new
from .tools.library import plot as plot
from .tools.library import run_campaign as run_campaign
from .tools.library import simulate as simulate
from .tools.measured import attitude_of_record as attitude_of_record
from .tools.measured import bench_at as bench_at
from .tools.measured import calibrate as calibrate
from .tools.measured import calibrate_together as calibrate_together
from .tools.measured import check as check
from .tools.measured import diagnose as diagnose
from .tools.measured import diagnose_together as diagnose_together
from .tools.measured import import_record as import_record
from .tools.measured import inspect as inspect
from .tools.measured import noise as noise
from .tools.orchestrator import Simulation as Simulation
from .tools.planning.library import plan as plan
from .tools.planning.library import plan_check as plan_check
from .tools.planning.library import plan_hand as plan_hand
from .tools.planning.library import plan_imu as plan_imu
from .tools.planning.library import plan_positions as plan_positions
from .tools.records import read_record as read_record

__version__: str
__all__: list[str]
