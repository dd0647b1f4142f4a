# `make` prints the targets. They set up what they need: a virtual environment with pinned versions, and Debian's
# OpenCL driver for processors where no working device is found.

PYTHON ?= python3
VENV := .venv
BAKE := $(VENV)/bin/diffract-bake
INSTALL := $(VENV)/bin/python -m pip install --quiet --disable-pip-version-check
OUT ?= out

# hundreds of processes of the tests import the project: its compiled modules are kept
unexport PYTHONDONTWRITEBYTECODE

.DEFAULT_GOAL := help
.PHONY: help setup lock bake pipeline bench validation test test-fast test-avx2 lint format coverage profile clean
.PHONY: fuzz fuzz-bundles

help:
	@echo "make bake                    set up, then bake configs/elaphe.toml into $(OUT)/elaphe"
	@echo "make pipeline                set up, then bake all of configs/ (or CONFIG=\"a.toml b.toml\"); ends in one summary"
	@echo "make bench                   measure run time against error of every algorithm: table, plots, verdicts"
	@echo "make validation              compare every method with the literature's figures and theory: pages, verdicts"
	@echo "make test                    set up, then run linters and every test"
	@echo "make test-fast               set up, then run every test that is not marked slow: two minutes on two cores"
	@echo "make test-avx2               run the kernels' tests and two bakes as on a processor without AVX-512"
	@echo "make fuzz                    read 5000 mutated scans: each a reading or one line, in 5 s and 1 GB (COUNT=, SEED=)"
	@echo "make lint                    run ruff and mypy"
	@echo "make format                  fix and format the code with ruff"
	@echo "make coverage                lines and branches that the fast tests run"
	@echo "make fuzz-bundles            verify and evaluate 1000 mutated bundles, and count the exit codes"
	@echo "make profile CONFIG=...      where a warm bake of a config spends its time"
	@echo "make lock                    pin the packages of setup again, with the digests of their files"
	@echo "make kills                   kill 300 runs and interrupt 200 at random moments: the next run is unharmed"
	@echo "make setup                   set up, and do nothing else"
	@echo "make clean                   remove the environment and $(OUT)"

setup: $(VENV)/ready $(VENV)/opencl

$(VENV)/ready: pyproject.toml requirements.lock
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11))' || \
		{ echo "error: Python 3.11 or newer is needed; name one with make PYTHON=python3.12" >&2; exit 1; }
	$(PYTHON) -m venv $(VENV)
	$(INSTALL) --require-hashes --only-binary :all: --requirement requirements.lock
	$(INSTALL) --no-deps --no-build-isolation --editable .
	touch $@

# pins every package that setup installs, for all Pythons from 3.11 on, with the digests of its files. Versions stay
# where they still fit; make lock RENEW=--upgrade takes the newest. The tool itself lives in an environment of its own.
lock: $(VENV)/ready
	$(PYTHON) -m venv $(VENV)/locking
	$(VENV)/locking/bin/python -m pip install --quiet --disable-pip-version-check uv==0.13.9
	$(VENV)/locking/bin/uv pip compile --quiet --universal --python-version 3.11 --generate-hashes --no-header \
		--no-annotate --all-extras $(RENEW) --output-file requirements.lock pyproject.toml

# A device works when a kernel compiles and runs on it; `doctor` exits with 5 where none does. No driver is installed
# where DIFFRACT_BAKE_DEVICE is set, because the fault may be its value, which doctor reports.
$(VENV)/opencl: $(VENV)/ready
	@$(BAKE) doctor >/dev/null 2>&1 || test -n "$$DIFFRACT_BAKE_DEVICE" || \
		$(MAKE) --no-print-directory install-opencl
	@$(BAKE) doctor >/dev/null
	@touch $@

.PHONY: install-opencl
install-opencl:
	@if [ "$$(id -u)" = 0 ] && command -v apt-get >/dev/null; then \
		echo "no working OpenCL device: installing Debian's pocl-opencl-icd" >&2; \
		apt-get update -qq && DEBIAN_FRONTEND=noninteractive apt-get install -y -qq pocl-opencl-icd >/dev/null; \
	else \
		echo "no working OpenCL device. Ask an administrator for: apt-get install pocl-opencl-icd" >&2; \
		echo "or, without root: conda install -c conda-forge pocl ocl-icd-system. Then run make again." >&2; \
		exit 5; \
	fi

# Tests compile the shaders that bundles show; they skip that, and say so, where the compiler is absent.
.PHONY: glslang
glslang:
	@command -v glslangValidator >/dev/null || { \
		test "$$(id -u)" = 0 && command -v apt-get >/dev/null && \
		echo "no glslangValidator: installing Debian's glslang-tools" >&2 && \
		apt-get update -qq && DEBIAN_FRONTEND=noninteractive apt-get install -y -qq glslang-tools >/dev/null; \
	} || echo "no glslangValidator: shaders are not compiled by the tests. See: apt-get install glslang-tools" >&2

bake: setup
	$(BAKE) run configs/elaphe.toml --out $(OUT)

pipeline: setup
	$(BAKE) run $(or $(CONFIG),$(sort $(wildcard configs/*.toml))) --out $(OUT)

# the measured scans, where they lie next to the checkout; otherwise bench and validation use synthetic surfaces
SCANS := $(if $(wildcard ../shared/data/snakes),tests/scans/elaphe_scan.toml tests/scans/xenopeltis_scan.toml configs/blazed.toml)
bench: setup
	$(BAKE) bench speed $(SCANS) --out $(OUT)/speed

VALIDATED := $(if $(wildcard ../shared/data/snakes),--elaphe tests/scans/elaphe_scan.toml --xenopeltis tests/scans/xenopeltis_scan.toml)
validation: setup
	$(BAKE) bench figures $(VALIDATED) --out $(OUT)/figures

# commands on mutated bundles, each within 5 s and 1 GB: every exit code but 0 and 6 is a fault
FUZZED_BUNDLES ?= 1000
fuzz-bundles: setup
	OPENBLAS_NUM_THREADS=1 nice -n 19 $(VENV)/bin/python -m tests.fuzz.bundles --count $(FUZZED_BUNDLES)

lint: $(VENV)/ready
	$(VENV)/bin/ruff check .
	$(VENV)/bin/ruff format --check .
	$(VENV)/bin/mypy

format: $(VENV)/ready
	$(VENV)/bin/ruff check --fix .
	$(VENV)/bin/ruff format .

# Much of the suite is one thread at a time, so two workers share it. Tests marked `alone` hold a limit of time on the
# clock and run after the others, without a neighbour.
PYTEST := $(VENV)/bin/python -m pytest
SHARED := --numprocesses $(or $(WORKERS),2) --dist worksteal
test: setup glslang lint
	$(PYTEST) $(SHARED) -m "not alone"
	$(PYTEST) -m alone

test-fast: setup glslang
	$(PYTEST) $(SHARED) -m "not slow and not alone"
	$(PYTEST) -m "alone and not slow"

# half an hour on two cores; tests/cli/test_killing.py does a few of each
KILLS ?= 300
INTERRUPTS ?= 200
.PHONY: kills
kills: setup
	$(VENV)/bin/python -m tests.cli.kills --kills $(KILLS) --interrupts $(INTERRUPTS) --seed $(or $(SEED),1)

# PoCL builds for a processor without AVX-512 on one that has it, into a kernel cache of its own. Debian's build of PoCL
# listens to the first variable, others to the second.
AVX2_TESTS := tests/diffraction tests/tables tests/accuracy tests/cli/test_device.py tests/cli/test_polar.py tests/cli/test_run.py
test-avx2: setup
	cache="$$(mktemp -d)" && trap 'rm -rf "$$cache"' EXIT && \
		POCL_KERNELLIB_NAME=avx2 POCL_LLVM_CPU_NAME=haswell XDG_CACHE_HOME="$$cache" $(VENV)/bin/python -m pytest $(AVX2_TESTS)

# prints the counts, and keeps mutations that did anything but be read or refused in out/fuzz
COUNT ?= 5000
SEED ?= 0
fuzz: setup
	$(VENV)/bin/python -W ignore -m tests.fuzz.scans $(COUNT) $(SEED)

# lines and branches that the fast tests run; commands in child processes are not counted
coverage: setup glslang
	$(VENV)/bin/coverage run -m pytest -m "not slow"
	$(VENV)/bin/coverage report

# where a warm bake spends its time: the first run compiles kernels, the second is profiled in a store of its own
CONFIG_PROFILED := $(or $(CONFIG),configs/elaphe.toml)
profile: setup
	store="$$(mktemp -d)" && trap 'rm -rf "$$store"' EXIT && \
		$(BAKE) run $(CONFIG_PROFILED) --until table --store "$$store/warm" && \
		$(VENV)/bin/python -c "import cProfile; from cli.main import cli; \
			cProfile.run('cli(standalone_mode=False)', sort='cumulative')" \
			run $(CONFIG_PROFILED) --until table --store "$$store/cold" | head -n 60

clean:
	rm -rf $(VENV) $(OUT) *.egg-info
