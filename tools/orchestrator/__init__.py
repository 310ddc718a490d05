"""The orchestrator: it couples the FMUs of a scenario, runs them, and writes the run with its provenance."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
