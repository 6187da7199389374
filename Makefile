# Everything a fresh machine needs comes from here: `make demo` and `make test` install what they run.
PYTHON ?= $(shell .ci/python)
VENV ?= .venv
# The extra that brings ROS.
ROS ?= ros
# Which versions of everything else: those that are known to pass. `CONSTRAINTS=` takes the newest.
CONSTRAINTS ?= -c .ci/constraints.txt
BIN := $(VENV)/bin
# A change of these takes a new installation: the compiled path is built by it.
BUILT_OF := pyproject.toml .ci/constraints.txt setup.py $(wildcard syncrelay/*/compiled/*.p[xy][xi]) docker/build_messages.py
# What the wheels of ROS lack of what the tests need.
BUILD_TF2_MSGS = $(BIN)/python docker/build_messages.py docker/messages/tf2_msgs >/dev/null \
	|| echo "tf2_msgs could not be built (it takes g++): tests with transforms are skipped" >&2
export PIP_DISABLE_PIP_VERSION_CHECK = 1
# Where an image sets it, each process that the tests start would compile all modules of this tree again: 0.06 to 0.2 s.
unexport PYTHONDONTWRITEBYTECODE

.PHONY: demo test test-fast simulate mutants test-kilted test-container test-workspace test-fleet test-lerobot test-release test-bare test-cost faults soak lint schema reference docs bench wheel release clean

demo: $(VENV)/demo
	$(BIN)/syncrelay demo --seconds 10

# Many tests wait on real processes, so twice as many run at once as there are cores; who is done first takes from others.
test: $(VENV)/test
	$(BIN)/python -m pytest -n $(shell expr 2 \* $$(nproc)) --dist worksteal --durations=30 --durations-min=2 $(ARGS)

# Most of the tests in under a minute, for after each change: what needs no DDS, no process, no browser and no seconds,
# and of each property fewer examples. One that starts a process all the same fails.
test-fast: $(VENV)/test
	$(BIN)/python -m pytest -n $(shell nproc) --dist worksteal -p tests.no_processes --hypothesis-profile=quick \
		-m "not (ros or browser or process or peer or real_data or faults or long)" \
		$(addprefix tests/,config dataflow explain recordings status sync) $(ARGS)

# The relay on ROS 2 Kilted: the compiled path proves itself, and messages are relayed over DDS. ARGS=tests/ros runs
# all of these tests.
test-kilted:
	$(MAKE) test VENV=.venv-kilted ROS=kilted \
		ARGS="$(or $(ARGS),tests/ros/test_compiled_backend.py tests/ros/test_backends.py tests/ros/test_sets.py tests/ros/test_node.py)"

# Builds docker/Dockerfile with a Docker engine of its own and tests the image; says so where there can be none.
test-container: $(VENV)/test
	tests/container/run $(BIN)/python $(ARGS)

# Builds a colcon workspace with this clone in it, and runs what it installs.
test-workspace: $(VENV)/test $(VENV)/colcon/done
	SYNCRELAY_COLCON=$(VENV)/colcon $(BIN)/python -m pytest tests/workspace $(ARGS)

# Makes a release in a clone of this one, from whatever is committed.
test-release: $(VENV)/test
	SYNCRELAY_RELEASE=1 $(BIN)/python -m pytest -s tests/test_release.py $(ARGS)

# What `pip install .` alone gives, in a venv that has nothing else: every command runs, or says which extra to install.
test-bare: $(VENV)/test
	rm -rf $(VENV)/bare
	$(BIN)/python -m venv $(VENV)/bare
	$(VENV)/bare/bin/python -m pip install -q $(CONSTRAINTS) .
	SYNCRELAY_BARE=$(abspath $(VENV)/bare/bin/python) $(BIN)/python -m pytest tests/cli/test_extras.py $(ARGS)

# Many recordings on Ray clusters, each in namespaces of its own, and from servers of object storage on this machine.
# SYNCRELAY_FAULTS=long takes 1,000 recordings. Not in CI: what it installs takes two minutes.
test-fleet: $(VENV)/fleet
	.ci/network-tools
	$(BIN)/python -m pytest -m "ray or storage" tests/recordings/fleet $(ARGS)

# Has lerobot's own loader read what `export --format lerobot` writes. Not in CI: lerobot needs PyTorch, which comes with
# CUDA, 5.5 GB on the disk. Needs Python 3.12 or later, as lerobot does.
test-lerobot:
	$(MAKE) .venv-lerobot/lerobot VENV=.venv-lerobot
	.venv-lerobot/bin/python -m pytest tests/recordings/datasets/test_lerobot_loader.py tests/recordings/datasets/test_lerobot.py $(ARGS)

# Breaks what a robot breaks, at length, and prints what was survived; compares the engine with C++ on many more streams,
# and tries what must hold of all inputs on many more of them. `make test` has the short form of each.
faults: $(VENV)/test
	.ci/network-tools
	SYNCRELAY_FAULTS=long $(BIN)/python -m pytest -m "(faults or long or peer or hypothesis) and not soak" $(ARGS)

# A quarter of an hour and two million messages.
soak: $(VENV)/test
	SYNCRELAY_FAULTS=long $(BIN)/python -m pytest -m soak $(ARGS)

# Plays the whole relay in worlds drawn by seeds, in virtual time, with faults at any moment, and checks what must always
# hold; docs/explanation/simulator.md says more. A failure prints its seed and the smallest world that still fails.
simulate: $(VENV)/test
	$(BIN)/python -m tests.simulated --seed $(or $(SEED),1) --hours $(or $(HOURS),10) $(ARGS)

# Puts one small fault after the other into the package, and looks whether the tests notice; it prints those that live.
mutants: $(VENV)/test
	$(BIN)/python -m tests.mutants $(if $(ROOMS),--rooms $(ROOMS)) --sample $(or $(SAMPLE),200) --seed $(or $(SEED),1) $(ARGS)

lint: $(VENV)/lint
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy
	$(BIN)/lint-imports

# The schema that editors read, where they find it; a test holds it to the models.
schema: $(VENV)/test
	$(BIN)/python -m syncrelay schema > schema/syncrelay-1.json
	$(BIN)/python -m syncrelay schema --test > schema/syncrelay-test-1.json

# The pages of docs/reference that say what the program knows; a test holds them to it.
reference: $(VENV)/test
	$(BIN)/python -m docs.generate

# The pages of docs/ as a site in build/docs, with its search; what a page gets wrong is an error.
docs: $(VENV)/docs
	$(BIN)/python -m sphinx -W --keep-going -n -q docs build/docs

bench: $(VENV)/test
	$(BIN)/python bench/engine.py
	$(BIN)/python bench/recordings.py
	$(BIN)/python bench/relay.py

# Compares what a message costs with the last release. A regression of a tenth fails, be the machine busy or not.
test-cost: $(VENV)/test
	.ci/cost $(BIN)/python

# What a release hands out, built and tried: an sdist, and a wheel for this machine and this Python.
wheel: $(BIN)/python
	.ci/wheel $(BIN)/python

# A commit and a tag v$(VERSION) in this clone, once the sdist, the wheel, the pages and the image are built and tried in
# another; CONTRIBUTING.md says how. DRY=1 does all of it and leaves this clone as it was.
release: $(BIN)/python
	DRY=$(DRY) .ci/release $(BIN)/python "$(VERSION)"

clean:
	rm -rf .venv* build dist *.egg-info syncrelay/*/compiled/*.so .mypy_cache .ruff_cache .pytest_cache .hypothesis .import_linter_cache docs/repository

$(BIN)/python:
	@test -n "$(PYTHON)" || { echo "Python 3.11 or 3.12 is needed: apt-get install python3 python3-venv" >&2; exit 1; }
	$(PYTHON) -m venv $(VENV) || { apt-get update && apt-get install -y python3-venv && $(PYTHON) -m venv $(VENV); }

$(VENV)/demo: $(BIN)/python $(BUILT_OF)
	$(BIN)/python -m pip install -q $(CONSTRAINTS) -e '.[$(ROS),top,recordings]'
	touch $@

$(VENV)/test: $(BIN)/python $(BUILT_OF)
	$(BIN)/python -m pip install -q $(CONSTRAINTS) -e '.[$(ROS),test]' ros-$(ROS:ros=jazzy)-test-msgs
	$(BUILD_TF2_MSGS)
	touch $@

# All that CI runs in one venv: installed at once, and not three times over.
$(VENV)/ci: $(BIN)/python $(BUILT_OF)
	$(BIN)/python -m pip install -q $(CONSTRAINTS) -e '.[$(ROS),test,lint,docs]' ros-$(ROS:ros=jazzy)-test-msgs
	$(BUILD_TF2_MSGS)
	touch $(VENV)/test $(VENV)/lint $(VENV)/docs $@

$(VENV)/fleet: $(VENV)/test
	$(BIN)/python -m pip install -q -e '.[fleet]' gcp-storage-emulator 'moto[server,s3]'
	touch $@

$(VENV)/lerobot: $(BIN)/python $(BUILT_OF)
	$(BIN)/python -m pip install -q -e '.[datasets]' 'lerobot[dataset]>=0.6.1,<0.7' hypothesis pytest pytest-timeout
	touch $@

# What ros-dev-tools and a sourced ROS bring on a robot: colcon, CMake, and of ament_cmake and rosidl what the wheels forget to
# ask for; their CMake files name folders of the machine that built them.
# In a venv of its own, as colcon brings plugins for pytest.
$(VENV)/colcon/done: $(BIN)/python
	$(BIN)/python -m venv $(VENV)/colcon
	$(VENV)/colcon/bin/python -m pip install -q colcon-common-extensions cmake 'setuptools<80' numpy ros-jazzy-sensor-msgs \
		$(addprefix ros-jazzy-ament-,package index-python cmake cmake-include-directories cmake-python cmake-ros \
			cmake-export-definitions cmake-gtest cmake-gmock cmake-pytest) \
		$(addprefix ros-jazzy-rosidl-,default-generators default-runtime core-generators core-runtime adapter cli cmake parser \
			pycommon runtime-c runtime-cpp generator-c generator-cpp generator-py generator-type-description \
			typesupport-c typesupport-cpp typesupport-fastrtps-c typesupport-fastrtps-cpp typesupport-interface \
			typesupport-introspection-c typesupport-introspection-cpp dynamic-typesupport) \
		$(addprefix ros-jazzy-,action-msgs service-msgs fastrtps-cmake-module fastcdr rmw rcutils rcpputils rpyutils \
			python-cmake-module)
	$(VENV)/colcon/bin/python tests/workspace/exported_paths.py
	touch $@

$(VENV)/lint: $(BIN)/python pyproject.toml .ci/constraints.txt
	$(BIN)/python -m pip install -q $(CONSTRAINTS) -e '.[lint,recordings,top]'
	touch $@

$(VENV)/docs: $(BIN)/python pyproject.toml .ci/constraints.txt
	$(BIN)/python -m pip install -q $(CONSTRAINTS) -e '.[docs]'
	touch $@
