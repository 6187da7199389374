# Everything a fresh machine needs comes from here: `make demo` and `make test` install what they run.
PYTHON ?= $(shell .ci/python)
VENV ?= .venv
# The extra that brings ROS.
ROS ?= ros
BIN := $(VENV)/bin
# A change of these takes a new installation: the compiled path is built by it.
BUILT_OF := pyproject.toml setup.py syncrelay/ros/compiled/path.pyx
export PIP_DISABLE_PIP_VERSION_CHECK = 1

.PHONY: demo test test-kilted test-container test-workspace faults soak lint schema bench wheel clean

demo: $(VENV)/demo
	$(BIN)/syncrelay demo --seconds 10

# Many tests wait on real processes, so one more runs at once than there are cores; who is done first takes from others.
test: $(VENV)/test
	$(BIN)/python -m pytest -n $(shell expr 1 + $$(nproc)) --dist worksteal $(ARGS)

# The relay on ROS 2 Kilted: the path through librcl proves itself, and messages are relayed over DDS. ARGS=tests/ros runs
# all of these tests.
test-kilted:
	$(MAKE) test VENV=.venv-kilted ROS=kilted \
		ARGS="$(or $(ARGS),tests/ros/test_librcl.py tests/ros/test_policies.py tests/ros/test_node.py)"

# Builds docker/Dockerfile with a Docker engine of its own and tests the image; says so where there can be none.
test-container: $(VENV)/test
	tests/container/run $(BIN)/python $(ARGS)

# Builds a colcon workspace with this clone in it, and runs what it installs.
test-workspace: $(VENV)/test $(VENV)/colcon/done
	SYNCRELAY_COLCON=$(VENV)/colcon $(BIN)/python -m pytest tests/workspace $(ARGS)

# Breaks what a robot breaks, at length, and prints what was survived, and compares the engine with C++ on many more
# streams; `make test` has the short form of each.
faults: $(VENV)/test
	.ci/network-tools
	SYNCRELAY_FAULTS=long $(BIN)/python -m pytest -m "(faults or peer) and not soak" $(ARGS)

# A quarter of an hour and two million messages.
soak: $(VENV)/test
	SYNCRELAY_FAULTS=long $(BIN)/python -m pytest -m soak $(ARGS)

lint: $(VENV)/lint
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy
	$(BIN)/lint-imports

# The schema that editors read, where they find it; a test holds it to the models.
schema: $(VENV)/test
	$(BIN)/python -m syncrelay schema > schema/syncrelay-1.json
	$(BIN)/python -m syncrelay schema --test > schema/syncrelay-test-1.json

bench: $(VENV)/test
	$(BIN)/python bench/engine.py
	$(BIN)/python bench/relay.py

# What a release hands out, built and tried: an sdist, and a wheel for this machine and this Python.
wheel: $(BIN)/python
	.ci/wheel $(BIN)/python

clean:
	rm -rf .venv* build dist *.egg-info syncrelay/ros/compiled/*.so .mypy_cache .ruff_cache .pytest_cache .hypothesis .import_linter_cache

$(BIN)/python:
	@test -n "$(PYTHON)" || { echo "Python 3.11 or 3.12 is needed: apt-get install python3 python3-venv" >&2; exit 1; }
	$(PYTHON) -m venv $(VENV) || { apt-get update && apt-get install -y python3-venv && $(PYTHON) -m venv $(VENV); }

$(VENV)/demo: $(BIN)/python $(BUILT_OF)
	$(BIN)/python -m pip install -q -e '.[$(ROS)]'
	touch $@

$(VENV)/test: $(BIN)/python $(BUILT_OF)
	$(BIN)/python -m pip install -q -e '.[$(ROS),test]'
	touch $@

# What ros-dev-tools and a sourced ROS bring on a robot: colcon, CMake, and of ament_cmake what the wheels forget to ask for.
# In a venv of its own, as colcon brings plugins for pytest.
$(VENV)/colcon/done: $(BIN)/python
	$(BIN)/python -m venv $(VENV)/colcon
	$(VENV)/colcon/bin/python -m pip install -q colcon-common-extensions cmake 'setuptools<80' ros-jazzy-ament-package \
		ros-jazzy-ament-cmake ros-jazzy-ament-cmake-include-directories ros-jazzy-ament-cmake-python
	touch $@

$(VENV)/lint: $(BIN)/python pyproject.toml
	$(BIN)/python -m pip install -q -e '.[lint]'
	touch $@
