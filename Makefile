# Every target makes the virtual environment it needs. PYTHON, VENV and ARGS can be set:
#   make run ARGS="frame -s baruch"      make test ARGS="tests/test_cli.py"

PYTHON ?= $(shell command -v python3.11 || command -v python3)
VENV ?= .venv
ARGS ?=
KERNELS ?= SkylakeX Haswell Nehalem Sandybridge Zen

BIN := $(VENV)/bin
# uv, where it is there, installs the same packages in a fifth of the time.
INSTALL := $(if $(shell command -v uv),uv pip install --python $(BIN)/python,$(BIN)/python -m pip \
	--disable-pip-version-check install)

ifeq ($(wildcard femubench/core/__init__.py),)
$(error femubench/core is no link to the folder core: clone once more with \
  `git clone -c core.symlinks=true` (on Windows, in developer mode))
endif

# Tests whose figures go through linear algebra; KERNELS are those of OpenBLAS, of which a processor
# without AVX-512 runs all but SkylakeX, and every x86-64 runs Nehalem.
NUMERICAL := $(addprefix tests/test_,advice*.py assembly.py attach*.py \
	beam_elements.py calibration.py challenge.py close_modes.py condensation.py diagnos*.py effects_*.py eigen.py \
	element_strategies.py exhibits.py expansion.py frame_extensions.py frf.py kernels.py \
	localisation.py look*.py matrix_strategies.py pairing.py papers_*.py preload.py rigid_modes.py \
	scenarios.py scoring.py sections.py sensitiv*.py sparse_eigen.py stretched_twins.py suite.py truths_*.py)
# A file stays on one worker, and with it what its tests share; in the order of names, since those with
# few tests take long and would come last.
ON_ALL_CORES := -n 2 --dist loadfile --no-loadscope-reorder -p no:benchmark

# What a change is tried with while one works on it; `test` has the rest that does not take hours.
# Of these files each test is quick, and all together are not.
LONG := browser $(addprefix test_,conformance.py diagnosed_strategy.py diagnosis_blind.py diagnosis_faults.py \
	harness_sandbox.py hostile_imports.py identify.py library.py publish.py resume.py standing_judge.py)
QUICK := -m "not slow and not nightly" $(addprefix --ignore=tests/,$(LONG))
LINT := ruff layout budgets mypy

.PHONY: run check test lint nightly pytest pyright $(LINT) docs kernels bench bench-report truths format clean
.DELETE_ON_ERROR:

run: $(VENV)/.installed
	@# 1 tells that some strategy failed on some case, which is a finding and no fault of make.
	$(BIN)/bench run $(ARGS) || test $$? -eq 1

check: $(VENV)/.installed-test
	$(BIN)/ruff check .
	OPENBLAS_NUM_THREADS=1 $(BIN)/pytest $(ON_ALL_CORES) $(QUICK) $(ARGS)

# Nothing that fails keeps the rest from running.
test: $(VENV)/.installed-test
	@status=0; \
	$(MAKE) --no-print-directory lint || status=1; \
	$(MAKE) --no-print-directory pytest || status=1; \
	exit $$status

lint: $(VENV)/.installed-test
	@$(MAKE) --no-print-directory -k -j 2 --output-sync=target $(LINT)

ruff: $(VENV)/.installed-test
	$(BIN)/ruff check .

layout: $(VENV)/.installed-test
	$(BIN)/ruff format --check .

budgets: $(VENV)/.installed-test
	$(BIN)/python benchmarks/line_budget.py

mypy: $(VENV)/.installed-test
	$(BIN)/mypy -p femubench -p truths

pyright: $(VENV)/.installed-test
	$(BIN)/pyright --pythonpath $(BIN)/python

pytest: $(VENV)/.installed-test
	OPENBLAS_NUM_THREADS=1 $(BIN)/pytest $(or $(ARGS),$(ON_ALL_CORES))

nightly: $(VENV)/.installed-test
	@status=0; \
	OPENBLAS_NUM_THREADS=1 $(BIN)/pytest $(ON_ALL_CORES) -m nightly $(ARGS) || status=1; \
	$(MAKE) --no-print-directory -k pyright docs kernels truths ARGS= || status=1; \
	exit $$status

docs: $(VENV)/.installed-test
	$(BIN)/sphinx-build -q -E -W --keep-going -c docs -b html . build/site $(ARGS)
	@echo "build/site/index.html"

kernels: $(VENV)/.installed-test
	for kernel in $(KERNELS); do \
		echo "OPENBLAS_CORETYPE=$$kernel"; \
		OPENBLAS_CORETYPE=$$kernel OPENBLAS_NUM_THREADS=1 \
			$(BIN)/pytest $(ON_ALL_CORES) $(or $(ARGS),$(NUMERICAL)) || exit 1; done

bench: $(VENV)/.installed-test
	$(BIN)/pytest benchmarks -o addopts="--import-mode=importlib -ra" --benchmark-only $(ARGS)

# A quarter of an hour and up to 1.5 GB; docs/development/performance.md says what is measured.
bench-report: $(VENV)/.installed-test
	OPENBLAS_NUM_THREADS=1 $(BIN)/python benchmarks/performance.py --write $(ARGS)

# gmsh's wheel wants Debian's libglu1-mesa, libxcursor1, libxft2 and libxinerama1.
truths: $(VENV)/.installed-truths
	OPENBLAS_NUM_THREADS=1 $(BIN)/python -m truths $(ARGS)

format: $(VENV)/.installed-test
	$(BIN)/ruff check --fix .
	$(BIN)/ruff format .

clean:
	rm -rf $(VENV) build dist docs/api *.egg-info .mypy_cache .ruff_cache .pytest_cache .benchmarks .coverage .hypothesis
	find . -name __pycache__ -type d -prune -exec rm -rf {} +

$(BIN)/python:
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11))' || \
		{ echo "Python 3.11 or later is needed; set PYTHON"; exit 1; }
	@$(PYTHON) -m venv $(VENV) || { rm -rf $(VENV); \
		echo "Python's venv is missing; on Debian: apt install python3-venv"; exit 1; }

# Installed by link: a change of a source file needs no other install, one of the dependencies does.
$(VENV)/.installed: pyproject.toml | $(BIN)/python
	$(INSTALL) --quiet -e .
	touch $@

$(VENV)/.installed-test: pyproject.toml | $(BIN)/python
	$(INSTALL) --quiet -e '.[test]'
	touch $@ $(VENV)/.installed

$(VENV)/.installed-truths: pyproject.toml | $(BIN)/python
	$(INSTALL) --quiet -e '.[truths]'
	touch $@ $(VENV)/.installed
