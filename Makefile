.DEFAULT_GOAL := help
PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
CORE := $(VENV)/.core
STAMP := $(VENV)/.installed
PIP := $(BIN)/python -m pip install --quiet --disable-pip-version-check --constraint constraints.txt --editable
# What the demo plays; Pink and mink come with the packages for development.
DEMO := qp sns dls null_space mfac rhc_gradient rhc rhc_foresight
RIVALS = $(foreach name,pink mink,$(if $(wildcard $(VENV)/lib/python*/site-packages/$(name)),$(name)))
FUZZ := 20000
PYTEST := $(BIN)/python -m pytest -n auto --dist worksteal
# Each process that tests start would compile hundreds of modules anew.
export PYTHONDONTWRITEBYTECODE :=

.PHONY: help setup demo test slow fuzz check format lint types layers docs bench rivals clean

help: ## Show this list
	@grep -E '^[a-z]+:.*##' $(MAKEFILE_LIST) | sed -E 's/^([a-z]+):.*## /  make \1\t/' | expand -t 18

setup: $(STAMP) ## Create .venv and install the pinned dependencies

$(CORE): pyproject.toml constraints.txt
	$(PYTHON) -m venv $(VENV)
	$(PIP) .
	@touch $@

$(STAMP): $(CORE)
	$(PIP) ".[dev]"
	@touch $@

demo: $(CORE) ## Play eight solvers on a Panda and on the paper's trajectory: tables, and results/demo/report.html
	$(BIN)/ikgym evaluate --scenarios panda-turn varga7-fast --policies $(DEMO) $(RIVALS) --workers 2 --out results/demo --overwrite
	@echo 'Look at the columns cost ratio (1: best known) and followed; README.md says why solvers differ.'

test: $(STAMP) ## Run the tests that are not marked slow
	$(PYTEST) -m "not slow"

slow: $(STAMP) ## Run the tests that are marked slow
	$(PYTEST) -m slow

fuzz: $(STAMP) ## Hand random input and damaged files to what reads them, FUZZ examples a property
	IKGYM_FUZZ=$(FUZZ) $(PYTEST) tests/test_fuzz.py tests/baselines/test_damaged_files.py

format: $(STAMP) ## Format the code and sort its imports
	$(BIN)/ruff format .
	$(BIN)/ruff check --fix .

lint: $(STAMP) ## Check format and style
	$(BIN)/ruff format --check .
	$(BIN)/ruff check .

types: $(STAMP) ## Check types
	$(BIN)/mypy

layers: $(STAMP) ## Check the imports between layers
	$(BIN)/lint-imports

check: $(STAMP) ## All that CI runs: format, lint, types, layers, tests, slow tests
	$(MAKE) --no-print-directory lint
	$(MAKE) --no-print-directory types
	$(MAKE) --no-print-directory layers
	$(MAKE) --no-print-directory test
	$(MAKE) --no-print-directory slow

docs: results/demo/report.html ## Build the documentation as a site in results/site; a broken link or reference fails
	NO_MKDOCS_2_WARNING=1 $(BIN)/python -m mkdocs build --strict
	@echo 'results/site/index.html; to search in it: python -m http.server --directory results/site'

results/demo/report.html: | $(CORE)
	$(MAKE) --no-print-directory demo

bench: $(STAMP) ## Measure the tables of docs/bench.md: speed next to other environments, libraries and solvers
	$(BIN)/python -m docs.measure environments calls kinematics inverse
	$(BIN)/python -m docs.tables

rivals: $(STAMP) ## Install the solvers and environments that bench compares with
	$(PIP) ".[rivals]"

clean: ## Remove .venv, results and caches
	rm -rf $(VENV) results .pytest_cache .mypy_cache .ruff_cache .import_linter_cache
	find . -name __pycache__ -type d -prune -exec rm -rf {} +
