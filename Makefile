# PYTHON=/path/to/python3.12 make setup   chooses the interpreter; otherwise the first of python3, python3.11 .. python3.14 that fits.
export PYTHON
BIN := .venv/bin

.PHONY: help setup compiled demo browser ready-to-test test test-slow lint format clean

help:     ## this list
	@sed -n 's/^\([a-z-]*\):[^#]*## \(.*\)/  make \1	\2/p' $(MAKEFILE_LIST)

setup:    ## system libraries, .venv, pinned packages; starts at once when they are there
	@scripts/setup.sh

compiled: setup
	@$(BIN)/python -m compileall -q footscan pipelines schemas  # also where Python must not write byte code by itself
	@$(BIN)/python -m footscan.ahead_of_time

demo: compiled ## films, calibrates, scans and measures a foot; the result is in demo/
	@$(BIN)/footscan demo

browser: setup
	@scripts/browser.sh

ready-to-test:
	@$(MAKE) --no-print-directory --jobs=3 lint compiled browser

# Byte code of the test modules is kept even where PYTHONDONTWRITEBYTECODE is set: pytest takes 16 s to make it.
test test-slow: export PYTHONDONTWRITEBYTECODE =
test test-slow: PYTEST := $(BIN)/pytest --dist worksteal

test: ready-to-test ## lint, then the tests, in the end those that keep time; pages in Debian's Chromium; films are kept in .pytest_cache
	$(PYTEST) -n 2 -m "not real_time and not slow"
	$(PYTEST) -n 3 -m "real_time and not slow" --reruns 2 -r fER  # they mostly wait

test-slow: ready-to-test ## the tests that repeat whole runs or draw many samples
	$(PYTEST) -n 2 -m "slow and not real_time"
	$(PYTEST) -n 3 -m "slow and real_time" --reruns 2 -r fER

lint: setup   ## style, layout and types
	$(BIN)/ruff check
	$(BIN)/ruff format --check
	$(BIN)/mypy

format: setup ## puts the sources into the project's layout
	$(BIN)/ruff check --fix
	$(BIN)/ruff format

clean:    ## removes the environment and what the tools left; results stay
	rm -rf .venv build dist *.egg-info .mypy_cache .ruff_cache .pytest_cache .hypothesis
	find . -name __pycache__ -prune -exec rm -rf {} +
