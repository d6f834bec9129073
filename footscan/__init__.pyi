from footscan.measure.any_mesh import measure as measure
from footscan.results_table import results as results
from footscan.scan import open_scan as open_scan
