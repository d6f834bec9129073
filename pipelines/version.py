"""Name and version of this program, as files that it writes bear them."""

from importlib.metadata import version

SOFTWARE = f"footscan {version('footscan')}"
