from .page import report_file as report_file
from .page import text as text
from .page import write_page as write_page
