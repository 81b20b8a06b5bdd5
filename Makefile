# Every command makes the virtual environment it needs in .venv, once, and again when
# pyproject.toml changes. Nothing but make and Python 3.11 or newer has to be there before.

PYTHON ?=
ARGS ?=

VENV := .venv
BIN := $(VENV)/bin
INSTALLED := $(VENV)/.installed

# Run after each installation, to compile the kernels ahead of the first use. Empty: nothing.
WARM ?= $(BIN)/python -m cdpr_drake.commands.kernels
BENCH := $(BIN)/python -m benchmarks

# Another project's paths (ROS sets some) must not leak into the virtual environment.
unexport PYTHONPATH PYTHONHOME

.DEFAULT_GOAL := help
.DELETE_ON_ERROR:
.NOTPARALLEL:
.PHONY: help demo test test-slow test-all lint bench reproduce warm clean

help: ## this list
	@echo "make TARGET [PYTHON=an interpreter for .venv] [ARGS=options passed on]"
	@awk -F ':.*## ' '/^[a-z-]+:.*## / { printf "  %-9s %s\n", $$1, $$2 }' Makefile

demo: $(INSTALLED)-demo ## a robot carries a load under vision-based control, and the plots of it
	@$(BIN)/cdpr-drake run $(ARGS)

test: $(INSTALLED)-test ## the tests of what the package does, in two processes
	@echo "Testing"
	@$(BIN)/pytest -n 2 -m "not slow" $(ARGS)

test-slow: $(INSTALLED)-test ## the other tests: notebooks, benchmarks, figures that are written down
	@echo "Testing notebooks, benchmarks and figures"
	@$(BIN)/pytest -n 2 -m slow $(ARGS)

# Not two prerequisites: the second shall run even if the first fails.
test-all: $(INSTALLED)-test ## all tests
	@status=0; \
	$(MAKE) --no-print-directory test || status=1; \
	$(MAKE) --no-print-directory test-slow || status=1; \
	exit $$status

lint: $(INSTALLED)-dev ## linter, formatter (nothing is rewritten) and type checkers
	@echo "Checking the code"
	@status=0; \
	$(BIN)/ruff check || status=1; \
	$(BIN)/ruff format --check || status=1; \
	$(BIN)/mypy || status=1; \
	$(BIN)/python .ci/check_types.py cdpr_drake reproduction || status=1; \
	exit $$status

bench: $(INSTALLED)-bench ## the benchmarks, beside other programs' (NAME with ARGS=NAME)
	@$(BENCH) $(ARGS)

reproduce: $(INSTALLED)-demo ## the paper's tables and figures made again, in out/reproduction
	@$(BIN)/python -m reproduction $(ARGS)

# Should it fail, the linter and the tests tell more.
warm:
	-@$(or $(WARM),:)

clean: ## remove the virtual environments, what was built, and caches
	rm -rf .venv .venv-3.12 build dist *.egg-info
	rm -rf .hypothesis .mypy_cache .pytest_cache .ruff_cache
	find . -name __pycache__ -type d -prune -exec rm -rf {} +

# A set of extras that contains another vouches for it.
$(INSTALLED)-demo: EXTRAS := fast
$(INSTALLED)-test: EXTRAS := fast,test,notebook,cluster
$(INSTALLED)-dev: EXTRAS := fast,test,notebook,cluster,dev
$(INSTALLED)-bench: EXTRAS := fast,bench

$(INSTALLED)-demo: pyproject.toml
	$(install)
	@touch $@

$(INSTALLED)-test: pyproject.toml
	$(install)
	@touch $(INSTALLED)-demo $@

$(INSTALLED)-dev: pyproject.toml
	$(install)
	@touch $(INSTALLED)-demo $(INSTALLED)-test $@

$(INSTALLED)-bench: pyproject.toml
	$(install)
	@touch $(INSTALLED)-demo $@

# Make the virtual environment unless it works, and install this checkout with EXTRAS.
define install
@$(BIN)/python -m pip --version >/dev/null 2>&1 || { \
	python=$$(sh .ci/find-python 3.11 or-newer "$(PYTHON)") && \
	echo "Creating $(VENV) with $$python" && \
	rm -rf $(VENV) && "$$python" -m venv $(VENV); }
@echo "Installing cdpr_drake[$(EXTRAS)] into $(VENV) (a minute or two the first time)"
@$(BIN)/python -m pip install --quiet --disable-pip-version-check --editable ".[$(EXTRAS)]"
@$(MAKE) --no-print-directory warm
endef
