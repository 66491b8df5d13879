# The two main commands are `make run` and `make test`. Both install what they need.
.DEFAULT_GOAL := help
PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
OLDEST := var/oldest
NEWEST := var/newest
NEW_TESTS ?= tests/robot tests/server tests/contract
ARGS ?=

.PHONY: help run install test test-brick test-browsers test-newest test-oldest test-stalls test-windows check conformance extensions mutate docs site dist format screenshots clean \
  lint types suite

help: ## List all commands
	@grep -hE '^[a-z-]+:.*## ' $(MAKEFILE_LIST) | sed 's/:.*## /\t/' | expand -t 16

run: $(VENV)/.demo ## Start the simulated robot and its page (ARGS="--lan" for a phone)
	$(BIN)/drivelesson $(ARGS)

install: ## Put the command `drivelesson` on your PATH
	@PYTHON="$(PYTHON)" sh install.sh

# Four workers more than cores, because tests of browsers and processes mostly wait.
JOBS ?= $(shell expr $$(getconf _NPROCESSORS_ONLN) + 4)
NPM := $(if $(shell command -v npm),tests/web/node_modules/.made)

test test-brick test-newest test-oldest test-stalls test-windows: export OMP_NUM_THREADS := 1  # see tests/conftest.py
# Cache bytecode: tests start many processes, and each would compile the program again.
test test-brick test-newest test-oldest test-stalls check: export PYTHONDONTWRITEBYTECODE :=

test: lint $(NPM) ## Run all checks and tests (JOBS=1 to run one test at a time)
	@$(MAKE) --no-print-directory --jobs 2 types suite

suite: $(VENV)/.dev
	$(BIN)/python -m pytest -p tests.progress --numprocesses $(JOBS) --dist loadfile --no-loadscope-reorder $(ARGS)

test-brick: $(VENV)/.dev ## Teach and drive a server on an emulated EV3 (needs root; prints what is missing)
	DRIVELESSON_BRICK=1 $(BIN)/python -m pytest tests/robot/bodies/ev3/test_server_on_brick.py $(ARGS)

test-browsers: $(VENV)/.dev ## Teach and drive a robot in Firefox and WebKit (prints what is missing)
	DRIVELESSON_OTHER_BROWSERS=1 $(BIN)/python -m pytest tests/e2e/test_other_browsers.py $(ARGS)

test-stalls: $(VENV)/.dev ## Run the real-time tests while all processes pause at random
	$(BIN)/python -m tests.stalls -m realtime --numprocesses $(JOBS) --dist loadfile \
	  --deselect tests/robot/bodies/ev3/test_server_on_brick.py $(ARGS)

test-windows: $(VENV)/.dev ## Run tests on Windows' Python under Wine, and teach a robot there (installs what it needs)
	$(BIN)/python -m tests.windows $(ARGS)

# The tests of the parts that may differ with old libraries: routes and their models, sockets, the
# start, arrays and pictures. `make test` tests the rest, which does not depend on these libraries.
OLD_TESTS := $(addprefix tests/server/,access board cli coaching exchange hosting library recordings simulator \
  test_drive.py bodies/test_eye.py test_hostile_values.py test_identity.py \
  test_protocol.py test_real_server.py study/test_interrupted_sessions.py \
  study/test_study_folder.py study/test_study_sessions.py test_teaching_routes.py) \
  tests/contract/test_cameras.py \
  tests/robot/bodies/pybricks tests/robot/bodies/remote tests/robot/bodies/ros \
  tests/robot/bodies/lego_education tests/robot/bodies/mjpeg \
  tests/robot/bodies/ev3/test_stock.py \
  tests/robot/learner/test_bsoc.py

test-oldest: $(OLDEST)/.made ## Run the server's tests with the library versions of Debian 12
	$(OLDEST)/bin/python -m pytest -p tests.oldest.newer_client -p no:anyio \
	  -p no:cacheprovider $(OLD_TESTS) --ignore tests/server/access/test_unpaired_flood.py \
	  --numprocesses $(JOBS) --dist loadfile --no-loadscope-reorder -m "not slow" \
	  -k "not browser and not films_and_datasets and not foreign_client" $(ARGS)

test-newest: $(NEWEST)/.made ## Check types and run the quick tests on the newest Python of this machine
	@if [ -x $(NEWEST)/bin/python ]; then set -e; \
	  $(NEWEST)/bin/mypy --cache-dir $(NEWEST)/mypy; \
	  $(NEWEST)/bin/python -m pytest -p no:cacheprovider $(NEW_TESTS) \
	    --numprocesses $(JOBS) --dist loadfile --no-loadscope-reorder \
	    -m "not slow and not realtime and not browser" $(ARGS); \
	else echo "This machine has no Python newer than 3.11, so nothing was tested."; fi

check: lint types ## Check format, lint, types, import contracts, layout and docs, without the other tests
	$(BIN)/python -m pytest -q -m 'not slow' tests/architecture tests/docs

lint: $(VENV)/.dev
	$(BIN)/ruff format --check .
	$(BIN)/ruff check .
	$(BIN)/lint-imports

types: $(VENV)/.dev
	$(BIN)/mypy

conformance: $(VENV)/.dev ## Test our files and metrics with the newest versions of other programs
	$(BIN)/python -m tests.conformance $(ARGS)

extensions: $(VENV)/.dev ## Count the lines of the core and of each extension
	@$(BIN)/python -m tests.architecture.extensions

mutate: $(VENV)/.dev ## Inject faults into safety-critical modules, and list those that no test notices
	$(BIN)/python -m tests.mutation $(ARGS)

docs: $(VENV)/.dev ## Regenerate the parts of the documents that come from the code
	$(BIN)/python -m tests.docs

site: $(VENV)/.site ## Build the documents as a site in site/; every warning is an error
	NO_MKDOCS_2_WARNING=1 $(BIN)/mkdocs build --strict --quiet

dist: $(VENV)/.dist ## Build wheel and sdist in dist/, and check their description for a package index
	rm -rf dist
	$(BIN)/python -m build --outdir dist
	$(BIN)/twine check --strict dist/*

format: $(VENV)/.dev ## Format, and fix what can be fixed automatically
	$(BIN)/ruff format .
	$(BIN)/ruff check --fix .

screenshots: $(VENV)/.dev ## Take the pictures of every screen for the docs (needs Chromium)
	$(BIN)/python -m tests.e2e.screenshots docs/images

tests/web/node_modules/.made: tests/web/package-lock.json
	cd tests/web && npm ci --no-audit --no-fund
	@touch $@

clean: ## Remove .venv and everything that make has installed there
	rm -rf $(VENV)

$(BIN)/python:
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11))' || \
	  { echo "Drivelesson needs Python 3.11 or newer; set it with: make PYTHON=/path/to/python3.11" >&2; exit 1; }
	@echo "Creating the virtual environment $(VENV) ..."
	$(PYTHON) -m venv $(VENV)
	$(BIN)/python -m pip install --quiet --upgrade pip  # Python 3.11's own pip takes twice as long

$(VENV)/.demo: pyproject.toml | $(BIN)/python
	@echo "Installing Drivelesson's requirements in $(VENV). This takes one to three minutes, and only once."
	$(BIN)/python -m pip install --no-compile --editable .
	@touch $@

$(VENV)/.dev: pyproject.toml | $(BIN)/python
	$(BIN)/python -m pip install --quiet --no-compile --editable '.[dev]'
	@touch $@ $(VENV)/.demo

# The additional tools that build the documents and the packages.
$(VENV)/.site $(VENV)/.dist: $(VENV)/.%: pyproject.toml | $(BIN)/python
	$(BIN)/python -m pip install --quiet --no-compile --editable '.[$*]'
	@touch $@

$(NEWEST)/.made: pyproject.toml tests/newest_python.sh
	rm -rf $(NEWEST) && mkdir -p $(NEWEST)
	@python="$$(sh tests/newest_python.sh)"; if [ -n "$$python" ]; then set -e; \
	  "$$python" -m venv $(NEWEST); \
	  $(NEWEST)/bin/python -m pip install --quiet --upgrade pip; \
	  $(NEWEST)/bin/python -m pip install --quiet --no-compile --editable '.[dev]'; \
	fi
	@touch $@

$(OLDEST)/.made: tests/oldest/debian-12.txt pyproject.toml Makefile
	rm -rf $(OLDEST)
	python3.11 -m venv $(OLDEST)
	$(OLDEST)/bin/python -m pip install --quiet --upgrade pip
	$(OLDEST)/bin/python -m pip install --quiet --no-compile --no-deps --requirement tests/oldest/debian-12.txt
	$(OLDEST)/bin/python -m pip install --quiet --no-compile --constraint tests/oldest/debian-12.txt \
	  pytest pytest-timeout hypothesis 'httpx>=0.27' 'opencv-python-headless<4.9' python-ev3dev2 vermin \
	  'cryptography>=42' 'segno>=1.6' 'zeroconf>=0.131' 'panda3d>=1.10.14' 'mcap>=1.1' 'tqdm>=4.65' \
	  'protobuf>=4.22' 'imagesize>=2.0' 'shtab>=1.6' 'pytest-xdist>=3.5'
	$(OLDEST)/bin/python -m pip install --quiet --no-deps --target $(OLDEST)/newer websockets
	mv $(OLDEST)/newer/websockets $(OLDEST)/lib/python3.11/site-packages/newer_websockets
	$(OLDEST)/bin/python -m pip install --quiet --no-deps --editable .
	@touch $@
