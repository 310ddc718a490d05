"""What a record says against a model, in one form whatever the record, and its makers."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
