# Needs Python 3.11 to 3.13, git and make. Everything else goes into $(VENV).
PYTHON ?= python3
VENV ?= .venv
BIN := $(VENV)/bin
PIP := $(BIN)/python -m pip --disable-pip-version-check install --quiet --constraint constraints.txt

.PHONY: sweep extremes test lint browser clean

## sweep: the main job; the table on the screen, dataset, plot and 3-D page in build/
sweep: $(VENV)/.run
	mkdir -p build
	$(BIN)/python -m kickdyn.posture_sweep --out build/sweep.nc --plot build/sweep.png --view build/kick.html

## extremes: kickdyn against 50 digits where numbers get difficult
extremes: $(VENV)/.run
	$(BIN)/python -m kickdyn.accuracy.extremes

## test: the whole suite
test: $(VENV)/.dev browser
	$(BIN)/python -m pytest -n auto

## lint: format, style, types, layers
lint: $(VENV)/.dev
	$(BIN)/ruff format --check .
	$(BIN)/ruff check .
	$(BIN)/mypy
	$(BIN)/lint-imports

## browser: Chromium, which the tests of the 3-D page open it with (Debian package chromium)
browser:
	@command -v chromium >/dev/null || command -v google-chrome >/dev/null || \
	if [ "$$(id -u)" = 0 ] && command -v apt-get >/dev/null; then \
		apt-get update -qq && DEBIAN_FRONTEND=noninteractive apt-get install -y -qq --no-install-recommends chromium; \
	else \
		echo "no chromium: the tests that open a page are skipped; 'sudo apt-get install chromium' brings it"; \
	fi

$(VENV)/bin/python:
	$(PYTHON) -m venv $(VENV)

$(VENV)/.run: pyproject.toml constraints.txt | $(VENV)/bin/python
	$(PIP) --editable .
	touch $@

$(VENV)/.dev: pyproject.toml constraints.txt | $(VENV)/bin/python
	$(PIP) --editable ".[dev]"
	touch $@ $(VENV)/.run

clean:
	rm -rf $(VENV) build dist .mypy_cache .pytest_cache .ruff_cache .hypothesis .import_linter_cache
