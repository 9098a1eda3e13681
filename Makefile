# steerlab: every target sets up .venv by itself. Another Python: make PYTHON=/path/to/python demo
# Another build of PyTorch: make TORCH=cpu|cuda|FILE demo (see tools/install.py)
PYTHON ?= python3
TORCH ?= auto
export PYTHON TORCH
BIN := .venv/bin
SETUP := pyproject.toml $(wildcard requirements/*.txt) tools/setup.sh tools/install.py

.PHONY: help demo test check bench soak build lock clean

help:
	@echo "make demo    set everything up and run a small simulated study; ends in a report"
	@echo "make test    set everything up and run the tests"
	@echo "make check   lint, format, types, layering"
	@echo "make bench   speed and accuracy against their limits"
	@echo "make build   wheel and sdist, the wheel tried in an environment of its own"
	@echo "make soak    kills, damaged files and a long day, for hours (see docs/promises.md)"
	@echo "make lock    the lists of packages in requirements/ made again from pyproject.toml"

demo: .venv/.steerlab-run
	$(BIN)/steerlab demo --out steerlab-demo --force

test: .venv/.steerlab-dev
	$(BIN)/python -m pytest -n 2 -q

check: .venv/.steerlab-dev
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/basedpyright --warnings
	$(BIN)/python -m pytest -q tests/test_layering.py

bench: .venv/.steerlab-dev
	$(BIN)/python -m benchmarks.run

soak: .venv/.steerlab-dev
	$(BIN)/python -m tests.faults.soak

build: .venv/.steerlab-dev
	rm -rf dist build
	$(BIN)/python -m build --outdir dist .
	tools/try-wheel.sh

lock: .venv/.steerlab-dev
	tools/lock.sh

clean:
	rm -rf .venv build dist steerlab-demo *.egg-info .pytest_cache .ruff_cache .hypothesis

.venv/.steerlab-run: $(SETUP)
	@tools/setup.sh run

.venv/.steerlab-dev: $(SETUP)
	@tools/setup.sh dev
