"""Campaigns: thousands of runs from one file, on this machine or a Dask cluster; an interrupted one stays valid."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
