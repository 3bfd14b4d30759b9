# make demo: the station with three simulated robots.   make test, make walks: everything that can be tested here.
PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin

# Without these files every process would compile the product's source anew.
unexport PYTHONDONTWRITEBYTECODE

.PHONY: help demo test walks check bench reproduce manual-pictures wheel client client-wheel setup setup-dev ready environment dialect packages app flight coverage clean

help:
	@echo "make demo    start the station with three simulated robots and print its address"
	@echo "make test    run every test that this machine can run, but the walks"
	@echo "make walks   real demos as a user meets them, most in a real browser; takes minutes"
	@echo "make check   format, lint, types, import directions, and the operator app's checks"
	@echo "make bench   measure against the bars and beside peers; writes build/bench.json"
	@echo "make reproduce   the thesis's results beside ours, in build/reproduction"
	@echo "make wheel   the product as one file for pip, in build/wheel"
	@echo "make client-wheel   the client of scripts as one file for pip, in build/client"
	@echo "make setup   only prepare: environment, operator app, MAVLink dialect, compiled kernels"

# A demo with cameras needs what finds their tags.
demo: ready $(if $(findstring --cameras,$(DEMO)),$(VENV)/camera.stamp)
	@$(BIN)/grace demo $(DEMO)

# Two at a time: each worker begins with half of the tests, and whoever is done takes over some of
# the other's, so that no long file at the end leaves a core idle.
# 5 is pytest's word for "none of these among TESTS".
test: setup-dev
	$(BIN)/python -m pytest -n 2 --dist worksteal -m "not walk" $(TESTS) || [ $$? -eq 5 ]

# One by one: each runs a station, a simulator and mostly a browser.
walks: setup-dev
	$(BIN)/python -m pytest -m walk $(TESTS) || [ $$? -eq 5 ]

check: setup-dev
	$(BIN)/ruff format --check .
	$(BIN)/ruff check .
	$(BIN)/basedpyright
	$(BIN)/lint-imports
	$(BIN)/python -m webui.build check

bench: setup-dev
	$(BIN)/python -m benchmarks.run $(AREAS)

reproduce: setup $(VENV)/reproduction.stamp
	@for name in $$($(BIN)/grace reproduce --list | awk '{print $$1}'); do \
		$(BIN)/grace reproduce $$name --out build/reproduction || exit 1; done

# The pictures of the operator's manual, drawn anew from a demo.
manual-pictures: setup-dev
	$(BIN)/python -m tests.browser.manual_pictures

coverage: setup-dev
	$(BIN)/python -m pytest --cov --cov-report=term-missing:skip-covered $(TESTS)

# With what the lock file pins, and without a network once that is here.
wheel: ready
	@rm -rf build/wheel
	@$(BIN)/python -m pip wheel --quiet --disable-pip-version-check --no-deps --no-build-isolation -w build/wheel .
	@rm -rf build/lib build/bdist.*
	@ls build/wheel/*.whl

# Models and methods of every request, made of what the station says of itself.
client: dialect
	@$(BIN)/python -m server.cli openapi | $(BIN)/python -m grace_client.generator -

client-wheel: ready client
	@rm -rf build/client
	@$(BIN)/python -m pip wheel --quiet --disable-pip-version-check --no-deps --no-build-isolation -w build/client ./grace_client
	@rm -rf grace_client/build grace_client/*.egg-info
	@ls build/client/*.whl

setup: ready
	@$(BIN)/grace compile

setup-dev: $(VENV)/dev.stamp ready client
	@$(BIN)/grace compile

# All that a demo needs to begin; the station compiles the other kernels while it runs. The steps
# that wait for nothing of each other go side by side.
ready:
	@$(MAKE) --no-print-directory -j2 environment packages
	@$(MAKE) --no-print-directory -j2 app flight

environment: $(VENV)/runtime.stamp
	@:

dialect:
	@$(BIN)/python -m robot_link.mavlink.build

packages:
	@$(PYTHON) -m webui.build packages

app: dialect
	@$(BIN)/python -m webui.build

flight:
	@$(BIN)/grace compile --flight

$(VENV)/runtime.stamp: requirements.lock pyproject.toml
	@$(PYTHON) -c 'import sys; sys.version_info >= (3, 11) or sys.exit("Python 3.11 or newer is needed; say make PYTHON=python3.12")'
	@test -x $(BIN)/python || $(PYTHON) -m venv $(VENV)
	@echo "Installing the pinned packages"
	@$(BIN)/python -m pip install --quiet --disable-pip-version-check --no-deps --require-hashes -r requirements.lock
	@$(BIN)/python -m pip install --quiet --disable-pip-version-check --no-deps --no-build-isolation -e .
	@touch $@

$(VENV)/dev.stamp: $(VENV)/runtime.stamp requirements-dev.lock
	@echo "Installing the pinned packages for tests and checks"
	@$(BIN)/python -m pip install --quiet --disable-pip-version-check --no-deps --require-hashes -r requirements-dev.lock
	@$(BIN)/python -m pip check --disable-pip-version-check
	@touch $@

$(VENV)/camera.stamp: $(VENV)/runtime.stamp requirements-camera.lock
	@echo "Installing the pinned packages for cameras"
	@$(BIN)/python -m pip install --quiet --disable-pip-version-check --require-hashes --no-deps -r requirements-camera.lock
	@touch $@

$(VENV)/reproduction.stamp: $(VENV)/runtime.stamp requirements-reproduction.lock
	@echo "Installing the pinned packages for figures"
	@$(BIN)/python -m pip install --quiet --disable-pip-version-check --require-hashes --no-deps -r requirements-reproduction.lock
	@touch $@

clean:
	rm -rf $(VENV) build webui/dist webui/app/node_modules robot_link/mavlink/dialect grace_client/generated
	find . -name __pycache__ -type d -prune -exec rm -rf {} +
