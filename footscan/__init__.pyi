from footscan.public import measure as measure
from footscan.public import open_scan as open_scan
from footscan.public import results as results
