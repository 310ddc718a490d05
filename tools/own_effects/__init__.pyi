from .file import OwnEffects as OwnEffects
from .file import with_effects_of as with_effects_of
