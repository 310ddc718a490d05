from .read import opened as opened
from .write import export_ssp as export_ssp
