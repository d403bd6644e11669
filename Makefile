PYTHON ?= $(shell command -v python3.11 || command -v python3.12 || command -v python3)
BIN := .venv/bin
export OMP_NUM_THREADS ?= 1
export GIT_PYTHON_REFRESH ?= quiet

.PHONY: install run test lint slow-test exact bench torture clean

install: .venv/installed

.venv/installed: pyproject.toml requirements.lock
	test -x $(BIN)/python || $(PYTHON) -m venv .venv
	$(BIN)/python -m pip install --quiet --constraint requirements.lock --editable '.[dev]'
	touch .venv/installed

run: install
	$(BIN)/roboscribe synthesize pick-place-1 --seed 0 --out data/pick-place-1

test: lint
	$(BIN)/python -m pytest -q -n 2 --dist worksteal

lint: install
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy

slow-test: install
	$(BIN)/python -m pytest -q -m slow

exact: install
	$(BIN)/python -m pytest -q -m 'slow or not slow' -n 2 tests/quality/test_exact_answers.py

bench: install
	$(BIN)/python -m tests.benchmarks

torture: install
	$(BIN)/python -m tests.torture

clean:
	rm -rf .venv .mypy_cache .ruff_cache .pytest_cache .hypothesis build *.egg-info
