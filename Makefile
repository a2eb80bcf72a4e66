# Two commands for a newcomer: `make demo` and `make test`. Each makes .venv first when it is missing.
PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
STAMP := $(VENV)/.installed
DOCS := $(VENV)/.installed-docs
FLOORS := .venv-floors
PIP := -m pip install --quiet --disable-pip-version-check

.PHONY: demo test test-all test-floors test-wheel docs clean

demo: $(STAMP)
	PATH="$(CURDIR)/$(BIN):$$PATH" sh sample_logs/demo.sh

test: $(STAMP)
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy
	$(BIN)/pytest -q -n auto --dist loadfile --no-loadscope-reorder

# The slow tests too, the installed wheel in an empty environment among them.
test-all: $(STAMP)
	$(BIN)/pytest -q -n auto --dist loadfile --no-loadscope-reorder -m "slow or not slow"

test-wheel: $(STAMP)
	$(BIN)/pytest -q -m slow tests/test_wheel.py

# Weekly: the tests with the lowest version that pyproject.toml allows of every dependency.
test-floors:
	rm -rf $(FLOORS)
	$(PYTHON) -m venv $(FLOORS)
	$(PYTHON) tests/floors.py > $(FLOORS)/constraints.txt
	$(FLOORS)/bin/python $(PIP) --constraint $(FLOORS)/constraints.txt --editable '.[cluster,pandas,remote,view]' \
		hypothesis jsonschema 'moto[server]' pytest pytest-xdist
	$(FLOORS)/bin/pytest -q -n auto --dist loadfile --no-loadscope-reorder

# The site, in docs/_build/html; a warning is an error.
docs: $(DOCS)
	$(BIN)/python -m sphinx -W --keep-going -q -b html docs docs/_build/html
	@echo 'docs/_build/html/index.html'

$(STAMP): pyproject.toml
	$(PYTHON) -c 'import sys; sys.exit(0 if sys.version_info >= (3, 11) else "navirl needs Python 3.11 or newer; choose one with: make PYTHON=/path/to/python3.11 ...")'
	$(PYTHON) -m venv $(VENV)
	$(BIN)/python $(PIP) --editable '.[dev]'
	touch $@

$(DOCS): $(STAMP)
	$(BIN)/python $(PIP) --editable '.[docs]'
	touch $@

clean:
	rm -rf $(VENV) $(FLOORS) demo build dist docs/_build docs/_generated
