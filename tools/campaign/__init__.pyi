from .runs import run_campaign as run_campaign
from .store import open_result as open_result
from .summary import CampaignResult as CampaignResult
from .summary import Comparison as Comparison
from .summary import compare as compare
from .summary import summarise as summarise
