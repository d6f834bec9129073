"""Name and version of this program, for the files that it writes."""

from importlib.metadata import version

SOFTWARE = f"footscan {version('footscan')}"
"""Program name and version, e.g. `footscan 1.0`."""
