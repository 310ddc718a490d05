from .cause import Cause as Cause
from .extension import export_extended as export_extended
from .procedure import diagnose as diagnose
from .result import Diagnosis as Diagnosis
