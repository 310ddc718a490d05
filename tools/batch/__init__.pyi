from .carrying_out import carry_out as carry_out
from .jobs import Job as Job
from .jobs import jobs_of as jobs_of
from .library import batch as batch
