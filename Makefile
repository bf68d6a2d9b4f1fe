# Everything a person or CI types. The environment is .venv: made with nothing but a Python >= 3.11
# that has venv, filled from constraints.txt (exact versions, checked by hash).
#
#   make report     set up if needed, then print the report of the stored captures
#   make test       set up, system packages included where that is possible, then run the tests
#   make lint       ruff check, ruff format --check, mypy --strict
#   make bench      time the analyzer against tshark        (BENCH=--small for a quick one)
#   make captures   let the lab write captures/ again
#   make readme     put the present report into README.md
#   make constraints  resolve constraints.txt anew
#   make clean      remove what the targets above made
#
# PYTHON=... chooses the interpreter, ARGS=... goes to pytest.

PYTHON ?= $(shell tools/find-python.sh)
ARGS ?=
BENCH ?=
UV_VERSION := 0.13.9

VENV := .venv
BIN := $(VENV)/bin
STAMP := $(VENV)/.installed

export PIP_DISABLE_PIP_VERSION_CHECK := 1
export PYTHONUTF8 := 1

.DEFAULT_GOAL := report
.DELETE_ON_ERROR:
.NOTPARALLEL:
.PHONY: report test lint format bench captures readme constraints clean system venv FORCE

report: $(STAMP)
	@$(BIN)/ds47 report captures

test: system
	@$(MAKE) --no-print-directory venv
	$(BIN)/python -m pytest $(ARGS)

lint: $(STAMP)
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy --strict python/ds47

format: $(STAMP)
	$(BIN)/ruff check --fix .
	$(BIN)/ruff format .

bench: $(STAMP)
	$(BIN)/python bench/run.py $(BENCH)

captures: $(STAMP)
	$(BIN)/python -m ds47.lab captures

readme: $(STAMP)
	$(BIN)/python tools/readme_report.py

system:
	@tools/system-packages.sh "$(PYTHON)" "$(BIN)/python"

venv: $(STAMP)

# A virtual environment holds absolute paths, so one of a checkout that was moved is made again.
ifneq ($(shell cat $(STAMP) 2>/dev/null),$(CURDIR))
$(STAMP): FORCE
endif

$(STAMP): constraints.txt pyproject.toml
	@echo "Setting up $(VENV) (once, some ten seconds) ..." >&2
	@tools/check-python.sh "$(PYTHON)"
	@rm -f $(STAMP)
	@"$(PYTHON)" -m venv --clear $(VENV)
	@$(BIN)/python -m pip install --quiet --require-hashes -r constraints.txt
	@$(BIN)/python -m pip install --quiet --no-index --no-deps --no-build-isolation --editable .
	@printf '%s\n' "$(CURDIR)" > $(STAMP)

# One file for Linux, macOS and Windows and every Python from 3.11 on; names no index.
constraints:
	@"$(PYTHON)" -m venv --clear build/resolver
	@build/resolver/bin/python -m pip install --quiet uv==$(UV_VERSION)
	build/resolver/bin/uv pip compile --quiet --upgrade pyproject.toml --all-extras --universal \
	  --python-version 3.11 --generate-hashes --no-annotate --no-emit-index-url \
	  --custom-compile-command "make constraints" --output-file constraints.txt

clean:
	rm -rf $(VENV) build dist bench/data .mypy_cache .ruff_cache .pytest_cache .hypothesis
	find python tests tools -name __pycache__ -type d -prune -exec rm -rf {} +

FORCE:
