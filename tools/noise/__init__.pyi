from .identify import identify as identify
from .kalibr import kalibr_yaml as kalibr_yaml
from .processes import PROCESSES as PROCESSES
from .processes import SPECTRAL as SPECTRAL
from .result import ChannelNoise as ChannelNoise
from .result import Coefficient as Coefficient
from .result import Dwell as Dwell
from .result import Noise as Noise
