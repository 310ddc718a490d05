from .page import report_file as report_file
from .page import write_page as write_page
from .text import text as text
