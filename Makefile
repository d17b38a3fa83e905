# make demo   a demonstration becomes a tree, and the tree runs      make test   all tests
# make bench  measurements, as ratios                                make lint   format, lint, types, imports
# make docs   the documentation as a site, in site/
# make twin   a robot's cell to connect to: ROS 2 and a simulation      make test-twin   tests over real ROS processes
# Each does all the set-up first; a second call finds it done. Nothing outside this folder changes.

SHELL := /bin/bash
VENV := .venv
PIP := $(VENV)/bin/python -m pip --disable-pip-version-check -qq
EXTRAS := sim,train,report,ros,remote,mujoco,warp,cluster,docs,dev
# A file's tests in one process: what they share is made once. Files in the order of tests/conftest.py.
PYTEST_FLAGS ?= -n logical --maxprocesses 4 --dist loadfile --no-loadscope-reorder

TWIN := .twin

# Tests start hundreds of processes, and each would compile all modules anew.
unexport PYTHONDONTWRITEBYTECODE

.PHONY: twin twin-environment test-twin test-perturbed demo test attacks bench docs lint format style types imports setup clean

demo: setup
	$(VENV)/bin/bt-tasksim demo

LIVE := $(wildcard tests/bt_tasksim/hardware/twin/test_live*.py)

# Tests with deadlines of a robot's cell: nothing may run beside them.
DEADLINES := $(addprefix tests/bt_tasksim/hardware/,safety/test_faults.py safety/test_watchdog.py twin/test_launch.py)

test: setup
	@$(VENV)/bin/python -m pytest -q $(DEADLINES); first=$$?; \
	$(VENV)/bin/python -m pytest $(PYTEST_FLAGS) $(addprefix --ignore ,$(LIVE) $(DEADLINES)) && exit $$first

# Real ROS processes in real time: one test after the other.
test-twin: setup twin-environment
	$(VENV)/bin/python -m pytest $(LIVE)

# The tests that stand on physics again, since it rounds differently on another processor: drive targets nudged
# (rad), worlds drawn with other seeds. PARTS=3: each perturbation has another third of the tests, the first one that
# of the number PART. ONE=2: the last perturbation alone.
PARTS ?= 1
PART ?= 0
ONE ?=
PHYSICAL = $(shell grep -rl --include='test_*.py' 'mark\.physical' tests)
PERTURBED ?= "--nudge=-1e-6" "--nudge=2e-7 --shift-seeds=1000" "--nudge=1e-6 --shift-seeds=2000"

test-perturbed: setup
	@failed=0; k=0; \
	for how in $(PERTURBED); do \
	  this=$$k; k=$$((k + 1)); [ "$(or $(ONE),all)" = all ] || [ "$(ONE)" = $$this ] || continue; \
	  how="$$how --part=$$(((this + $(PART)) % $(PARTS)))/$(PARTS)"; \
	  echo "Physical tests, $$how"; \
	  $(VENV)/bin/python -m pytest -q $(PYTEST_FLAGS) -m physical $(PHYSICAL) $$how || failed=1; \
	done; exit $$failed

# Damaged inputs of every kind, some seconds of each, two kinds at a time; python -m tests.attacks KIND --cases N
# counts more.
SECONDS_EACH ?= 30
ATTACKS := logs trajectories replays yaml_files settings checkpoints ros_messages

attacks: setup
	@printf '%s\n' $(ATTACKS) | xargs -P 2 -I {} \
	  $(VENV)/bin/python -m tests.attacks {} --cases 1000000 --seconds $(SECONDS_EACH)

bench: setup
	$(VENV)/bin/bt-tasksim bench

# The documentation as a site, in site/index.html; a dead link is an error.
docs: $(VENV)/packages.stamp
	NO_MKDOCS_2_WARNING=1 $(VENV)/bin/mkdocs build --strict

lint: format style types imports

format: $(VENV)/packages.stamp
	$(VENV)/bin/ruff format --check .

style: $(VENV)/packages.stamp
	$(VENV)/bin/ruff check .

types: $(VENV)/packages.stamp
	$(VENV)/bin/mypy

imports: $(VENV)/packages.stamp
	$(VENV)/bin/lint-imports

setup: $(VENV)/packages.stamp $(VENV)/rendering.stamp

# ROS 2, a bridge and a simulated cell, on this machine alone.
twin: $(VENV)/packages.stamp twin-environment
	$(VENV)/bin/bt-tasksim twin

twin-environment: $(TWIN)/made

$(TWIN)/made: $(VENV)/made.stamp tools/make_twin.py tools/twin_packages.lock.txt
	@$(VENV)/bin/python tools/make_twin.py $(TWIN)

clean:
	rm -rf $(VENV) .vulkan $(TWIN)

$(VENV)/made.stamp:
	@python=$$(for name in python3.11 python3.12 python3.13 python3; do \
	    "$$name" -c 'import sys; sys.exit(sys.version_info < (3, 11))' 2>/dev/null && { command -v "$$name"; break; }; \
	  done); \
	if [ -z "$$python" ]; then echo "bt-tasksim needs Python 3.11 or newer, and none was found." >&2; exit 1; fi; \
	echo "Making a virtual environment with $$python ..."; "$$python" tools/make_venv.py $(VENV)
	@touch $@

# torch first, so that nothing else chooses its build. mani_skill brings OpenCV's desktop build, which needs
# libGL; the headless one is the same version and goes over it, last.
$(VENV)/packages.stamp: $(VENV)/made.stamp pyproject.toml constraints.txt
	@echo "Installing packages (2.8 GB in all; some minutes the first time) ..."
	@$(PIP) install -c constraints.txt setuptools torch
	@$(PIP) install -c constraints.txt --no-build-isolation -e '.[$(EXTRAS)]'
	@$(PIP) install -c constraints.txt --no-deps --force-reinstall opencv-python-headless
	@touch $@

# Stays undone where no driver can be had, so that the next call tries again.
$(VENV)/rendering.stamp: $(VENV)/packages.stamp tools/fetch_vulkan_driver.py
	@$(VENV)/bin/python tools/fetch_vulkan_driver.py --stamp $@
