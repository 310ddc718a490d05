"""Batches: one command for many records, on several processes or a Dask cluster; an interrupted one goes on."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
