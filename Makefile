# `make demo` runs the whole loop, `make test` the tests; both set up what they need in .venv.
SHELL := /bin/sh
# Matrices are small here: threads of the linear algebra would only wait for each other.
export OPENBLAS_NUM_THREADS = 1
export OMP_NUM_THREADS = 1
# Byte code is kept, whatever the caller's shell says: tests start many processes, and none is to compile all anew.
unexport PYTHONDONTWRITEBYTECODE
VENV ?= .venv
PYTHON ?= $(shell for p in python3.13 python3.12 python3.11 python3 python; do \
	$$p -c 'import sys; sys.exit(sys.version_info < (3, 11))' 2>/dev/null && { echo $$p; break; }; done)
BIN = $(VENV)/bin
READY = $(VENV)/.ready
WORKERS ?= 2
PYTEST = $(BIN)/python -m pytest -c tests/pytest.ini --rootdir tests

.PHONY: demo test acceptance bench lint docs case-studies setup lowest pythons wheel clean

demo: $(READY)
	$(BIN)/trihedron demo --out demo-results

# A worker that has none left takes tests of another one: a long file does not hold up the end.
test: $(READY)
	$(PYTEST) tests -n $(WORKERS) --dist worksteal -m "not acceptance and not benchmark_ratio"

# Two cases of each long test, and a tenth of each suite; `make acceptance CASES=all` takes all, for most of a day.
CASES ?= 2
SHARE = $(if $(filter all,$(CASES)),1,0.1)
acceptance: $(READY)
	TRIHEDRON_SUITE_SHARE=$${TRIHEDRON_SUITE_SHARE:-$(SHARE)} $(PYTEST) tests -n $(WORKERS) --dist worksteal \
		-m acceptance $(if $(filter all,$(CASES)),,--cases $(CASES)) --durations 40

# Writes the tables of cost in docs/figures.md.
bench: $(READY)
	$(PYTEST) tests/benchmarks -m benchmark_ratio -s --costs docs

lint: $(READY) build/typing/trihedron
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/lint-imports --no-cache > build/floors.txt || { cat build/floors.txt; exit 1; }
	$(BIN)/pyright
	$(BIN)/python tests/docs/plain_english.py

docs: $(READY)
	$(BIN)/python docs/builders/reference.py docs
	NO_MKDOCS_2_WARNING=1 $(BIN)/python -m mkdocs build --strict

# The measured records stand beside the project, or where TRIHEDRON_DATA says.
case-studies: $(READY)
	$(BIN)/python docs/builders/case_studies.py "$${TRIHEDRON_DATA:-../shared/data}" docs

setup: $(READY)

$(READY): pyproject.toml
	@test -n "$(PYTHON)" || { echo "Trihedron needs Python 3.11 or newer; name one with PYTHON=..." >&2; exit 2; }
	@echo "$(VENV): an environment of 1.6 GB with all that the work needs, once; it takes a minute or two"
	@$(PYTHON) -m venv $(VENV)
	@PYTHONWARNINGS=ignore $(BIN)/python -m pip install --quiet --disable-pip-version-check -e ".[dev]"
	touch $(READY)

# The root is the package: the type checker finds `trihedron` of the tests through a link of that name.
build/typing/trihedron:
	mkdir -p build/typing
	ln -sfn ../.. build/typing/trihedron

# A part of the tests that takes a minute or two: records, programmes, runs of FMUs, refusals.
PART = $(addprefix tests/,tools/records tools/bounded tools/orchestrator tools/cli/test_mistakes.py tools/test_files.py fmus/test_cache.py)
PART_OF_TESTS = -m pytest -c tests/pytest.ini --rootdir tests -q -p no:cacheprovider -W ignore::DeprecationWarning \
	-m "not acceptance and not benchmark_ratio" $(PART)

# The demo and that part with every dependency at the version that pyproject.toml asks for at the least.
lowest:
	@test -n "$(PYTHON)" || { echo "Trihedron needs Python 3.11 or newer; name one with PYTHON=..." >&2; exit 2; }
	rm -rf build/lowest && $(PYTHON) -m venv build/lowest
	$(PYTHON) tests/lowest.py > build/lowest/requirements.txt
	PYTHONWARNINGS=ignore build/lowest/bin/python -m pip install --quiet --disable-pip-version-check \
		-r build/lowest/requirements.txt -e . "pytest>=8" "hypothesis>=6.100" "pytest-xdist>=3.5"
	build/lowest/bin/trihedron demo --no-show --out build/lowest/demo --quiet
	build/lowest/bin/python $(PART_OF_TESTS) -n $(WORKERS)

# That part on every other Python that is here, with the newest releases.
pythons:
	for p in python3.12 python3.13; do $$p -c "" 2>/dev/null || { echo "no $$p here"; continue; }; \
		rm -rf build/$$p && $$p -m venv build/$$p && \
		PYTHONWARNINGS=ignore build/$$p/bin/python -m pip install --quiet --disable-pip-version-check \
			-e . "pytest>=8" "hypothesis>=6.100" "pytest-xdist>=3.5" && \
		build/$$p/bin/trihedron demo --no-show --out build/$$p/demo --quiet && \
		build/$$p/bin/python $(PART_OF_TESTS) -n $(WORKERS) || exit 1; done

# The wheel holds native FMUs of every component for all platforms, which ziglang compiles; the checkout has none.
WHEEL = build/wheel
wheel: $(READY)
	rm -rf $(WHEEL)/source dist
	mkdir -p $(WHEEL)/source
	cp -R __init__.py models fmus tools scenarios pyproject.toml README.md LICENSE $(WHEEL)/source
	test -d $(WHEEL)/zig || { rm -rf $(WHEEL)/zig.part && \
		$(BIN)/python -m pip install --quiet --disable-pip-version-check --target $(WHEEL)/zig.part "ziglang>=0.13" && \
		mv $(WHEEL)/zig.part $(WHEEL)/zig; }
	PYTHONPATH=$(CURDIR)/$(WHEEL)/zig $(BIN)/python -m trihedron.fmus.native $(WHEEL)/source/fmus/prebuilt
	$(BIN)/python -m pip wheel --quiet --disable-pip-version-check --no-deps --wheel-dir dist $(WHEEL)/source

clean:
	rm -rf $(VENV) build dist site demo-results .pytest_cache .hypothesis .ruff_cache *.egg-info
