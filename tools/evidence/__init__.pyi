from .gain import export_extended as export_extended
