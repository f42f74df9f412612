# Targets work from a fresh clone with only Python 3.11 to 3.13 and make; the environment is made once.
# The first of these that can make an environment is taken: those of a distribution come first, since they are
# compiled with profiles and compile kernels in a sixth less time than those of pyenv without.
# Another: make PYTHON=python3.13 VENV=.venv313 test
PYTHON ?= $(firstword $(foreach name,$(wildcard /usr/bin/python3.11 /usr/bin/python3.12 /usr/bin/python3.13) \
	python3.11 python3.12 python3.13 python3,$(shell \
	$(name) -c 'import sys, ensurepip; sys.exit(not (3, 11) <= sys.version_info[:2] <= (3, 13))' 2>/dev/null && echo $(name))))
VENV ?= .venv
BIN := $(VENV)/bin
PROJECT := pyproject.toml constraints.txt
# one worker per core, each with some 2 GB; tests/conftest.py says which files share a worker, and their order
TESTS = $(BIN)/python -m pytest --numprocesses auto --maxprocesses 8 --dist loadfile --no-loadscope-reorder
# test files with the mark: importing all others takes a minute of each worker
PROOFS = $(shell grep -rl 'mark\.installation' tests --include='test_*.py')
INSTALL = $(BIN)/python -m pip install --quiet --constraint constraints.txt --editable

.PHONY: help demo test test-all test-rest test-rest-plant test-rest-envs test-rest-training test-rest-others test-nightly test-quick coverage lint docs figures format clean
.DELETE_ON_ERROR:

help:
	@echo "make demo        the published PI law beside a predictive one: a verdict, and results/demo/report.html"
	@echo "make test        prove this installation: each layer against an independent reference"
	@echo "make test-all    all tests: make test, make test-rest (the other ones) and make test-nightly (the longest)"
	@echo "make test-quick  all but the slow ones, as after an edit: minutes once their kernels are compiled"
	@echo "make coverage    what the quick tests reach of what users touch; pages in htmlcov"
	@echo "make lint        ruff and mypy;  make format: let ruff fix what it can"
	@echo "make docs        the documentation site, in site/"
	@echo "make figures     redraw the pictures of the manual that need no long runs"
	@echo "make clean       remove results and build leftovers (the environment stays; rm -r $(VENV) removes it)"

$(BIN)/python:
	@test -n "$(PYTHON)" || { echo "needs Python 3.11, 3.12 or 3.13: make PYTHON=/path/to/python3.12" >&2; exit 1; }
	$(PYTHON) -m venv $(VENV)

$(VENV)/.installed-demo: $(PROJECT) | $(BIN)/python
	$(INSTALL) ".[mpc,plot,render,report]"
	@touch $@

$(VENV)/.installed-dev: $(PROJECT) | $(BIN)/python
	$(INSTALL) ".[dev]"
	$(BIN)/python -m pip install --quiet --constraint constraints.txt --no-deps rosco capytaine hipersim xarray mo-gymnasium
	@touch $@ $(VENV)/.installed-demo

# one process: the cases share one kind of scene, which two would both compile
demo: $(VENV)/.installed-demo
	@$(BIN)/fowt study --controller mpc --against gspi_oc3 --seeds 1 --out results/demo

test: $(VENV)/.installed-dev
	@echo "minutes, most of them for compiling kernels, which are kept"
	$(TESTS) -m "installation and not nightly" --durations=10 $(PROOFS)

test-all: test test-rest test-nightly

# in parts, each in processes of its own: kernels stay in memory, and those of all tests would take 24 GB
test-rest: test-rest-plant test-rest-envs test-rest-training test-rest-others

PLANT_TESTS := tests/plant tests/analysis tests/scene tests/weather
ENV_TESTS := tests/envs tests/controllers
REST = $(TESTS) -m "not installation and not nightly" --durations=20

test-rest-plant: $(VENV)/.installed-dev
	$(REST) $(PLANT_TESTS)

test-rest-envs: $(VENV)/.installed-dev
	$(REST) $(ENV_TESTS)

test-rest-training: $(VENV)/.installed-dev
	$(REST) tests/training

test-rest-others: $(VENV)/.installed-dev
	$(REST) $(addprefix --ignore=,$(PLANT_TESTS) $(ENV_TESTS) tests/training)

test-nightly: $(VENV)/.installed-dev
	$(TESTS) -m nightly --durations=20

test-quick: $(VENV)/.installed-dev
	$(TESTS)

coverage: $(VENV)/.installed-dev
	$(TESTS) --cov --cov-report=term --cov-report=html

lint: $(VENV)/.installed-dev
	$(BIN)/ruff check .
	rm -rf build/typing && $(BIN)/python -c "from fowt_env.layout import link_packages; link_packages('build/typing')"
	cd build/typing && $(abspath $(BIN))/mypy --config-file $(CURDIR)/pyproject.toml

# the variable silences an advertisement of the theme's
docs: $(VENV)/.installed-dev
	NO_MKDOCS_2_WARNING=1 $(BIN)/mkdocs build --strict --clean --config-file .mkdocs.yml

# studies with stored tables are only drawn; turbulence.gif and pictures of long runs have their commands in the text
FIGURES := docs/figures
DATA := training/design/data
figures: $(VENV)/.installed-dev
	$(BIN)/fowt simulate --wind ntm:18:B --sea jonswap:7.5:10:3.3 --plot $(FIGURES)/pi_18mps.png
	$(BIN)/fowt dev benchmark accuracy --axes reference --out $(FIGURES)
	$(BIN)/fowt dev benchmark accuracy --axes reference --out $(FIGURES) \
		--platform iea15_volturnus_s --beside $(FIGURES)/accuracy.csv
	$(BIN)/fowt model linearize --out results/poles && cp results/poles/poles.png $(FIGURES)/linear_poles.png
	$(BIN)/fowt model linearize --winds 12:24:2 --out results/bode && cp results/bode/bode.png $(FIGURES)/linear_bode.png
	$(BIN)/fowt design front --runs $(DATA)/lqr_over_wind.csv --bound $(DATA)/linear_bound.csv --plot $(FIGURES)/linear_bound.png
	$(BIN)/fowt design front --runs $(DATA)/lqr_sweep.csv --bound $(DATA)/linear_bound.csv --plot $(FIGURES)/lqr_sweep.png

format: $(VENV)/.installed-dev
	$(BIN)/ruff check --fix .

clean:
	rm -rf results site build dist *.egg-info .pytest_cache .ruff_cache .mypy_cache .hypothesis htmlcov .coverage .coverage.*
	find . -name __pycache__ -not -path "./$(VENV)/*" -prune -exec rm -rf {} +
