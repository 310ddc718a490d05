from .tools.batch import batch as batch
from .tools.check import Check as Check
from .tools.corrections import apply as apply
from .tools.corrections import correction as correction
from .tools.corrections import export_calibration as export_calibration
from .tools.demo import run_demo
from .tools.errors import InputError as InputError
from .tools.exporting import Exported as Exported
from .tools.exporting import write_fmpy_input
from .tools.foreign import Imported as Imported
from .tools.installation import Installation as Installation
from .tools.instrument import add_to_instrument, entries_of, nearest_of_instrument, trend_of_instrument
from .tools.library import campaign_report as campaign_report
from .tools.library import compare as compare
from .tools.library import doctor as doctor
from .tools.library import export as export
from .tools.library import export_notebook as export_notebook
from .tools.library import export_ssp as export_ssp
from .tools.library import hide as hide
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
from .tools.papers import check_published_calibration, word_length_errors
from .tools.papers import reproduce_attitude as reproduce_attitude
from .tools.planning.library import plan as plan
from .tools.planning.library import plan_check as plan_check
from .tools.planning.library import plan_hand as plan_hand
from .tools.planning.library import plan_imu as plan_imu
from .tools.planning.library import plan_positions as plan_positions
from .tools.records import read_record as read_record
from .tools.workbench import measure as measure
from .tools.workbench import open_records

__version__: str
__all__: list[str]

attitude = attitude_of_record
campaign = run_campaign
demo = run_demo
fmpy_input = write_fmpy_input
hidden = hide
instrument_add = add_to_instrument
instrument_list = entries_of
instrument_show = nearest_of_instrument
instrument_trend = trend_of_instrument
open = open_records
plan_target = plan
reproduce_calibration = check_published_calibration
reproduce_word_length = word_length_errors
