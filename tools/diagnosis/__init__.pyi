from .cause import Cause as Cause
from .extension import export_extended as export_extended
from .procedure import diagnose as diagnose
from .result import Diagnosis as Diagnosis
from .several import Several as Several
from .several import diagnosed_together as diagnosed_together
from .several import labels_of as labels_of
