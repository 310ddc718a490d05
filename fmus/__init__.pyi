from .archive import version as version
from .catalogue import build as build
from .catalogue import component_names as component_names
from .catalogue import components as components
