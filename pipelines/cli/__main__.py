"""`python -m pipelines.cli ...`: the same as `footscan ...`, where no command is installed."""

from pipelines.cli.main import main

if __name__ == "__main__":
    main()
