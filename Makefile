# Everything a person or CI types. The environment is .venv: made with nothing but a Python >= 3.11
# that has venv, filled from constraints.txt (exact versions, checked by hash).
#
#   make report     set up if needed, then print the report of the stored captures
#   make venv       set up what the tests need, without system packages
#   make test       set up, system packages included where that is possible, then run the quick tests
#   make test-all   the same with the slow ones: every capture through each Lua, tshark and the auditor
#   make lint       ruff check, ruff format --check, mypy --strict; luacheck where it is installed
#   make matrix     run the plugin's tests on Wireshark 3.4, 4.0, 4.4, 4.6 and on plain Lua 5.2 to 5.4
#   make pythons    run the analyzer's tests on Python 3.13 and 3.14
#   make windows    run the analyzer's tests on Python for Windows, by Wine (root, Debian, mvn)
#   make audit      let the auditor read N random conversations, planned from SEED on, and all captures
#   make bench      time the analyzer and the plugin against tshark    (BENCH=--small for a quick one)
#   make bench-hurtful  time and memory of conversations that want much of both    (BENCH="--frames 20000 100000")
#   make fuzz       look for inputs on which ds47 breaks, MINUTES=1 in all, TARGETS="codec calls" of all, or TARGETS=lua
#   make dist       write the plugin as one Lua file, dist/ds47-2_0_0_dev0.lua (the version, with underscores)
#   make pyz        write the command as one file for any Python, dist/ds47.pyz
#   make page       write the analyzer as one page for a browser without network, dist/ds47.html (needs npm)
#   make wheelhouse  write what a computer without internet installs from, dist/ds47-VERSION-wheelhouse.zip
#   make site       build the documentation as a site that needs no network, build/site/html, and as a zip into dist/
#   make release    write all of these, wheels, bill of materials and checksums into dist/, and check each
#                   (RELEASE_KEY=~/.ssh/KEY signs the checksums)
#   make try-release  try what that wrote in bare systems without network: page, pyz, wheelhouse, container (root, Debian)
#   make captures   let the lab write captures/ again, and store results where there are none
#   make rule       write the skeletons of a new rule: ID=DS4 for the next of DS4xx, or its number
#   make generated  write again all that follows from other files: tables, vectors, surface, manual, shown output
#   make tables     write lua/ds47/spec/tables.lua from python/ds47/spec/*.toml again, the JSON Schemas, and the columns in docs/data.md
#   make surface    write what a version promises to keep, tests/vectors/surface.txt
#   make man        write the manual pages from the help of the commands, man/
#   make screenshot take the pictures of Wireshark again, and those of reports, page and site
#   make readme     put present output into README.md, README.zh.md and the pages of docs/
#   make oracles    record the two S7 stacks anew and compare what they did with what is said of it (Linux)
#   make constraints  resolve constraints.txt anew
#   make clean      remove what the targets above made
#
# PYTHON=... chooses the interpreter, ARGS=... goes to pytest, which runs in one process with PARALLEL= (empty);
# MATRIX=trixie chooses of the matrix, PYTHONS=forky of the Pythons, TRY=firefox of the bare systems;
# WITH="python3.12 python3.13" are further Pythons that `make release` compiles wheels for.
# ORACLES=... is where `make oracles` puts captures: captures/s7-stacks takes them over.
# LUACHECK=must, MATRIX=--must and PYTHONS=--must fail where what they need is missing; otherwise they say so and go on.

PYTHON ?= $(shell tools/find-python.sh)
ARGS ?=
PARALLEL ?= -n auto --dist loadfile --no-loadscope-reorder
BENCH ?=
N ?= 300
SEED ?= 1
MINUTES ?= 1
TARGETS ?=
MATRIX ?=
PYTHONS ?=
TRY ?=
WITH ?=
DIST := $(CURDIR)/dist
LUACHECK ?=
ORACLES ?= build/oracles/captures

VENV := .venv
BIN := $(VENV)/bin
RUN := $(VENV)/.run
STAMP := $(VENV)/.installed

export PIP_DISABLE_PIP_VERSION_CHECK := 1
export PYTHONUTF8 := 1
# Else each of some thousand starts of Python compiles all that it imports again.
unexport PYTHONDONTWRITEBYTECODE

.DEFAULT_GOAL := report
.DELETE_ON_ERROR:
.NOTPARALLEL:
.PHONY: report test test-all audit lint format matrix pythons windows bench bench-hurtful fuzz dist pyz page wheelhouse site release try-release captures rule generated tables surface man screenshot readme oracles constraints clean \
  system venv FORCE

report: $(RUN)
	@$(BIN)/ds47 report captures

test: system
	@$(MAKE) --no-print-directory venv
	@echo "The quick tests: some 4 minutes on two free cores (all of them, with the slow ones: make test-all)." >&2
	$(BIN)/python -m pytest $(PARALLEL) -m "not slow" $(ARGS)

test-all: system
	@$(MAKE) --no-print-directory venv
	$(BIN)/python -m pytest $(PARALLEL) $(ARGS)

audit: $(STAMP)
	$(BIN)/python -m tests.audit --count $(N) --seed $(SEED) captures/*.pcapng captures/*-stacks/*.pcapng \
		captures/profibus/*.pcapng
	$(BIN)/python -m tests.audit --holes --count $(N) --seed $(SEED) captures/real-stacks/*.pcapng \
		captures/lossy-stacks/*.pcapng captures/field/*.pcap*

lint: $(STAMP)
	@failed=0; run() { echo "$$*"; "$$@" || failed=1; }; \
	run $(BIN)/ruff check .; \
	run $(BIN)/ruff format --check .; \
	run $(BIN)/mypy --strict python/ds47; \
	if command -v luacheck >/dev/null 2>&1; then \
	  run luacheck --quiet --no-color .; \
	elif [ "$(LUACHECK)" = must ]; then \
	  echo "luacheck is missing (Debian: lua-check)" >&2; failed=1; \
	else \
	  echo "luacheck is not installed (Debian: lua-check): lint of the Lua files skipped" >&2; \
	fi; \
	exit $$failed

format: $(STAMP)
	$(BIN)/ruff check --fix .
	$(BIN)/ruff format .

matrix: $(STAMP)
	$(BIN)/python tools/matrix.py $(MATRIX)

pythons:
	@tools/pythons.sh $(PYTHONS) -- $(PARALLEL) $(ARGS)

windows: $(STAMP)
	$(BIN)/python tools/windows.py $(ARGS)

bench: $(STAMP)
	$(BIN)/python bench/way.py $(filter --trial,$(BENCH))
	$(BIN)/python bench/run.py $(BENCH)
	$(BIN)/python bench/formats.py $(BENCH)
	$(BIN)/python bench/plugin.py $(BENCH)

bench-hurtful: $(STAMP)
	$(BIN)/python bench/hurtful.py $(BENCH)

# Beside .venv, because there are wheels for few systems.
build/fuzz/lib/.installed: tests/fuzz/requirements.txt $(STAMP)
	@rm -rf build/fuzz/lib
	@$(BIN)/python -m pip install --quiet --require-hashes --no-deps --only-binary :all: --target build/fuzz/lib -r $<
	@touch $@

fuzz: build/fuzz/lib/.installed
	$(BIN)/python -m tests.fuzz --minutes $(MINUTES) $(TARGETS)

dist: $(RUN)
	$(BIN)/python tools/make_bundle.py

pyz: $(STAMP)
	$(BIN)/python tools/release/make_pyz.py

page: $(STAMP)
	$(BIN)/python tools/release/make_page.py

wheelhouse: $(STAMP)
	$(BIN)/python tools/release/make_wheelhouse.py

# An environment of its own, as large as ours; the package never imports what is in it.
build/site/env/.installed: tools/site/requirements.txt
	@echo "Installing what builds the documentation (once, some ten seconds) ..." >&2
	@"$(PYTHON)" -m venv --clear build/site/env
	@build/site/env/bin/python -m pip install --quiet --require-hashes --no-deps --only-binary :all: -r $<
	@touch $@

site: $(STAMP) build/site/env/.installed
	$(BIN)/python -m tools.site.assemble build/site/pages
	@version=$$($(BIN)/python -c "import ds47; print(ds47.__version__)") && set -x && \
	NO_MKDOCS_2_WARNING=1 DS47_FOOT="ds47 $$version" \
		build/site/env/bin/mkdocs build --quiet --strict -f tools/site/mkdocs.yml && \
	$(BIN)/python -m tools.site.pack build/site/html dist/ds47-$$version-docs.zip

release: $(STAMP) site
	$(BIN)/python tools/release/make_release.py $(DIST) $(WITH)

try-release: $(STAMP)
	$(BIN)/python tools/release/try_release.py $(TRY)

captures: $(STAMP)
	$(BIN)/python -m ds47.lab captures
	$(BIN)/ds47 baseline captures | sed '/is there already/d'

tables: $(STAMP)
	$(BIN)/python tools/make_tables.py
	$(BIN)/python tools/make_schemas.py

rule: $(STAMP)
	$(BIN)/python tools/make_rule.py $(ID)

generated: tables man
	for part in messages conversations diagnoses by_chance tables; do $(BIN)/python tests/vectors/sources/$$part.py || exit; done
	$(BIN)/python tools/make_surface.py
	$(BIN)/python tools/make_diagnoses.py
	TZ=UTC $(BIN)/python tools/readme_report.py

surface: $(STAMP)
	$(BIN)/python tools/make_surface.py

man: $(RUN)
	$(BIN)/python tools/make_man.py

screenshot: $(STAMP)
	$(BIN)/python tools/screenshots.py
	TZ=UTC $(BIN)/python tools/html_screenshots.py

readme: $(STAMP)
	$(BIN)/python tools/readme_report.py

# Two environments that share nothing with .venv; the package never imports what is in them.
build/oracles/%/.installed: tools/oracles/%.txt
	@"$(PYTHON)" -m venv --clear build/oracles/$*
	@build/oracles/$*/bin/python -m pip install --quiet --require-hashes --no-deps --only-binary :all: -r $<
	@touch $@

oracles: $(STAMP) build/oracles/snap7-pure/.installed build/oracles/snap7-cpp/.installed
	$(BIN)/python tools/oracles/record.py $(ORACLES) build/oracles/snap7-pure/bin/python build/oracles/snap7-cpp/bin/python
	DS47_S7_STACKS=$(ORACLES) $(BIN)/python -m pytest -q tests/python/test_s7_oracles.py tests/python/test_wireshark_s7.py

system:
	@tools/system-packages.sh "$(PYTHON)" "$(BIN)/python"

venv: $(STAMP)

# A virtual environment holds absolute paths, so one of a checkout that was moved is made again.
ifneq ($(shell cat $(RUN) 2>/dev/null),$(CURDIR))
$(RUN): FORCE
endif

# What the command needs; then, for the tests and tools, all the rest.
$(RUN): constraints-run.txt pyproject.toml
	@echo "Setting up $(VENV) (once, some ten seconds) ..." >&2
	@tools/check-python.sh "$(PYTHON)"
	@rm -f $(RUN) $(STAMP)
	@"$(PYTHON)" -m venv --clear $(VENV)
	@$(BIN)/python -m pip install --quiet --require-hashes -r constraints-run.txt
	@$(BIN)/python -m pip install --quiet --no-index --no-deps --no-build-isolation --editable .
	@printf '%s\n' "$(CURDIR)" > $(RUN)

$(STAMP): $(RUN) constraints.txt
	@echo "Installing what the tests need (once, up to a minute) ..." >&2
	@$(BIN)/python -m pip install --quiet --require-hashes -r constraints.txt
	@touch $(STAMP)

# Two files for Linux, macOS and Windows and every Python from 3.11 on; they name no index.
COMPILE := build/resolver/bin/uv pip compile --quiet --universal --python-version 3.11 \
  --generate-hashes --no-annotate --no-emit-index-url --custom-compile-command "make constraints"

constraints:
	@"$(PYTHON)" -m venv --clear build/resolver
	@build/resolver/bin/python -m pip install --quiet --require-hashes --no-deps --only-binary :all: -r tools/resolver/requirements.txt
	$(COMPILE) pyproject.toml --upgrade --all-extras --output-file constraints.txt
	$(COMPILE) pyproject.toml --extra build --constraints constraints.txt --output-file constraints-run.txt
	$(COMPILE) tools/site/requirements.in --upgrade --output-file tools/site/requirements.txt
	$(COMPILE) tests/fuzz/requirements.in --output-file tests/fuzz/requirements.txt
	$(COMPILE) tools/resolver/requirements.in --output-file tools/resolver/requirements.txt

clean:
	rm -rf $(VENV) build dist bench/data .mypy_cache .ruff_cache .pytest_cache .hypothesis
	find python tests tools -name __pycache__ -type d -prune -exec rm -rf {} +

FORCE:
