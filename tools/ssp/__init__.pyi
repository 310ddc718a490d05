from .read import opened as opened
from .write import write_ssp as write_ssp
