# Needs Python 3.11 to 3.13, git and make. Everything else goes into $(VENV). `make help` lists the targets.
PYTHON ?= python3
VENV ?= .venv
BIN := $(VENV)/bin
PIP := $(BIN)/python -m pip --disable-pip-version-check install --quiet --constraint constraints.txt

.PHONY: sweep help extremes fuzz notebooks test test-slow test-lowest test-all docs package lint browser clean

# versions of Python for `make test-all`, as `python3.11` and so on (pyenv or deadsnakes have them)
PYTHONS ?= 3.11 3.12 3.13

## sweep: the main job; the table on the screen, dataset, plot and 3-D page in build/
sweep: $(VENV)/.run
	mkdir -p build
	$(BIN)/python -m kickdyn.posture_sweep --out build/sweep.nc --plot build/sweep.png --view build/kick.html

## help: this list
help:
	@sed -n 's/^## /make /p' Makefile

## extremes: compares kickdyn with 50 digits for ill-conditioned input, and draws the picture of the docs
extremes: $(VENV)/.dev
	@echo "This takes about a minute."
	$(BIN)/python tests/extremes --plot docs/images/extremes.png

## fuzz: tries broken files and command lines for ten minutes; fails if one gives neither a result nor a clear refusal
fuzz: $(VENV)/.dev
	@echo "This takes ten minutes."
	$(BIN)/python tools/fuzz.py --seconds 600

## notebooks: runs the notebooks and stores their outputs for readers; needs Chromium
notebooks: $(VENV)/.dev browser
	@echo "This takes about a minute, and longer on the first run, which compiles."
	$(BIN)/python tools/notebook_outputs.py

## test: all that protects users, 2 to 4 minutes on 2 idle cores once everything is installed and compiled
test: $(VENV)/.dev
	$(BIN)/python -m pytest -n auto -m "not slow" --processor-limit 20 $(PYTEST_OPTIONS)

## test-slow: notebooks, the site of the docs, pages in a browser, motions, MuJoCo, clusters, extremes; 5 to 10 minutes on 2 idle cores
test-slow: $(VENV)/.dev browser
	$(BIN)/python -m pytest -n auto -m slow $(PYTEST_OPTIONS)

## test-lowest: the tests of `make test`, except docs, with the lowest version of each package that pyproject.toml allows, in .venv-lowest
test-lowest:
	@# pyparsing 3.3 deprecates what matplotlib 3.9 calls
	@echo "This takes two minutes to install, and then as long as \`make test\`."
	$(PYTHON) -m venv .venv-lowest
	.venv-lowest/bin/python -m pip --disable-pip-version-check install --quiet --constraint constraints-lowest.txt --editable ".[test]" "pyparsing<3.3"
	.venv-lowest/bin/python -m pytest -n auto -m "not slow" -W ignore::DeprecationWarning --ignore tests/test_docs.py

## test-all: the whole suite with each Python of PYTHONS, and what users install
test-all: package
	@for version in $(PYTHONS); do command -v python$$version >/dev/null || \
		{ echo "no python$$version: install it, or name those that are here: make test-all PYTHONS='3.11'"; exit 1; }; done
	set -e; for version in $(PYTHONS); do \
		$(MAKE) test test-slow PYTHON=python$$version VENV=.venv-$$version; done

## package: wheel and sdist in dist/, built twice with equal bytes, checked, each installed into an empty environment and run
package: $(VENV)/.dev
	@echo "This takes about two minutes, most of it to install kickdyn twice."
	rm -rf dist build/package
	$(BIN)/hatchling build
	$(BIN)/hatchling build -d build/package/again
	cd dist && for built in *; do cmp $$built ../build/package/again/$$built || exit 1; done
	$(BIN)/twine check --strict dist/*
	$(PYTHON) -m venv --clear build/package
	build/package/bin/python -m pip --disable-pip-version-check install --quiet check-wheel-contents
	build/package/bin/check-wheel-contents dist/*.whl
	set -e; for built in dist/*.whl dist/*.tar.gz; do \
		$(PYTHON) -m venv --clear build/package; \
		build/package/bin/python -m pip --disable-pip-version-check install --quiet --constraint constraints.txt $$built; \
		(cd / && "$(CURDIR)/build/package/bin/kickdyn" posture-sweep --json - >/dev/null); \
		echo "$$built: installs and runs"; done

## docs: the pages as a site in build/site, notebooks run; a warning is an error
docs: $(VENV)/.dev
	@echo "This takes about a minute."
	$(BIN)/python -m sphinx -W --keep-going -q -b html -d build/trees docs build/site
	@echo "build/site/index.html"

## lint: format, style, types, layers of imports and their cycles
lint: $(VENV)/.dev
	@echo "This takes about half a minute the first time, then a few seconds."
	$(BIN)/ruff format --check .
	$(BIN)/ruff check .
	$(BIN)/mypy
	$(BIN)/lint-imports

## browser: Chromium, which the tests of the 3-D page open it with (Debian package chromium)
browser:
	@command -v chromium >/dev/null || command -v google-chrome >/dev/null || \
	if [ "$$(id -u)" = 0 ] && command -v apt-get >/dev/null; then \
		apt-get update -qq && DEBIAN_FRONTEND=noninteractive apt-get install -y -qq --no-install-recommends chromium chromium-sandbox; \
	else \
		echo "no chromium: the tests that open a page are skipped; 'sudo apt-get install chromium chromium-sandbox' brings it"; \
	fi

$(VENV)/bin/python:
	$(PYTHON) -m venv $(VENV)

$(VENV)/.run: pyproject.toml constraints.txt | $(VENV)/bin/python
	$(PIP) --editable .
	touch $@

$(VENV)/.dev: pyproject.toml constraints.txt | $(VENV)/bin/python
	$(PIP) --editable ".[dev]"
	touch $@ $(VENV)/.run

## clean: removes everything that these targets created
clean:
	rm -rf $(VENV) .venv-* build dist .mypy_cache .pytest_cache .ruff_cache .hypothesis .import_linter_cache
