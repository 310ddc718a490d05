from .read import opened as opened
from .read import scenario_of_ssp as scenario_of_ssp
from .write import self_contained as self_contained
from .write import write_ssp as write_ssp
