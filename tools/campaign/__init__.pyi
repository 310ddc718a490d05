from .compare import Comparison as Comparison
from .compare import compare as compare
from .execute import run_campaign as run_campaign
from .store import open_result as open_result
from .summary import CampaignResult as CampaignResult
from .summary import summarise as summarise
