# `make help` lists the targets. PYTHON=python3.12 chooses the interpreter of a new .venv.

PYTHON ?= python3
# The index from which pip takes torch; PyPI without it.
TORCH_INDEX ?=
BIN := .venv/bin
PIP := $(BIN)/python -m pip install --quiet --disable-pip-version-check --constraint constraints.txt
READY := .venv/.ready

# The tests start thousands of processes, each of which would compile every module anew.
unexport PYTHONDONTWRITEBYTECODE

.DEFAULT_GOAL := help
.PHONY: help setup tournament pytest test test-full check format layout reference docs bench clean

help: ## list the targets
	@awk -F ':.*## ' '/^[a-z-]+:.*## / { printf "  make %-12s %s\n", $$1, $$2 }' $(MAKEFILE_LIST)

setup: $(READY) ## make .venv, install all extras as constraints.txt pins them, and compile the rules and the fighters

$(READY): pyproject.toml constraints.txt
	@command -v $(PYTHON) >/dev/null || { echo "make setup: there is no $(PYTHON); install Python 3.11 or later, or name one: make setup PYTHON=..." >&2; exit 1; }
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11))' || { echo "make setup: $$($(PYTHON) --version) is too old; the arena needs 3.11 or later, name one: make setup PYTHON=python3.12" >&2; exit 1; }
	@$(PYTHON) -c 'import ensurepip, venv' 2>/dev/null || { echo "make setup: $(PYTHON) cannot make a virtual environment; on Debian and Ubuntu, install the package python3-venv" >&2; exit 1; }
	$(PYTHON) -m venv .venv
	$(PIP) $(if $(TORCH_INDEX),--index-url $(TORCH_INDEX)) torch
	$(PIP) --editable '.[dev]'
	$(BIN)/arena doctor --compile
	@touch $@

tournament: $(READY) ## run the starter league over the network, results in ./arena-data
	$(BIN)/arena tournament run starter --data arena-data

check: $(READY) ## ruff, mypy and lint-imports
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy
	$(BIN)/lint-imports --no-logo

pytest: $(READY) ## the tests, in sizes that take minutes
	$(BIN)/pytest -n auto --dist worksteal

test: check pytest ## check, then pytest

test-full: check ## the same, in the sizes that claims need
	ARENA_TEST_SIZE=full $(BIN)/pytest -n auto --dist worksteal -o faulthandler_timeout=7200

format: $(READY) ## let ruff rewrite the sources
	$(BIN)/ruff check --fix .
	$(BIN)/ruff format .

layout: $(READY) ## generate docs/reference/layout.md
	$(BIN)/python docs/make_layout.py

reference: $(READY) ## generate what docs/reference has of the code itself
	$(BIN)/python docs/make_reference.py

docs: $(READY) ## build the documentation into build/docs; a warning is an error
	$(BIN)/python -m sphinx --builder html --fail-on-warning --keep-going --quiet docs build/docs

bench: $(READY) ## run every benchmark
	$(BIN)/arena bench --all

clean: ## remove .venv and all caches
	rm -rf .venv .mypy_cache .pytest_cache .ruff_cache .hypothesis .import_linter_cache build dist
	find . -name __pycache__ -type d -prune -exec rm -rf {} +
