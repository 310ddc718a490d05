from .fit import export_extended as export_extended
