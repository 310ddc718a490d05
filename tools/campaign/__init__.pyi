from .runs import carry_out_campaign as carry_out_campaign
from .store import open_result as open_result
from .summary import CampaignResult as CampaignResult
from .summary import Comparison as Comparison
from .summary import compare_campaigns as compare_campaigns
from .summary import summarise as summarise
