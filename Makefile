.DEFAULT_GOAL := help
PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
STAMP := $(VENV)/.installed
DEMO := all

.PHONY: help setup demo test check format lint types layers bench rivals clean

help: ## Show this list
	@grep -E '^[a-z]+:.*##' $(MAKEFILE_LIST) | sed -E 's/^([a-z]+):.*## /  make \1\t/' | expand -t 18

setup: $(STAMP) ## Create .venv and install the pinned dependencies

$(STAMP): pyproject.toml constraints.txt
	$(PYTHON) -m venv $(VENV)
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --constraint constraints.txt --editable ".[dev]"
	@touch $@

demo: $(STAMP) ## Evaluate the baselines on the default scenario: table and plots in results/demo
	$(BIN)/python -m baselines.evaluate --scenarios varga7-fast --policies $(DEMO) --out results/demo --overwrite

test: $(STAMP) ## Run the whole test suite
	$(BIN)/python -m pytest -n auto --dist worksteal

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

check: lint types layers test ## All that CI runs: lint, types, layers, tests

bench: $(STAMP) ## Measure speed beside other environments, libraries and solvers: report in results/bench
	$(BIN)/python -m benchmarks

rivals: $(STAMP) ## Install the solvers and environments that bench compares with (1.2 GB)
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --constraint constraints.txt --editable ".[rivals]"

clean: ## Remove .venv, results and caches
	rm -rf $(VENV) results .pytest_cache .mypy_cache .ruff_cache .import_linter_cache
	find . -name __pycache__ -type d -prune -exec rm -rf {} +
