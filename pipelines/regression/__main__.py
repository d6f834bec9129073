"""`python -m pipelines.regression [SUITE] ...`, what a scheduler starts: the same as `footscan regress`."""

import sys

from pipelines.cli.main import run_command

if __name__ == "__main__":
    sys.exit(run_command(["regress", *sys.argv[1:]]))
