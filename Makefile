# Two commands are all there is to know: `make run` and `make test`. Both install what they need.
.PHONY: help run page test test-core test-kilted lint docs figures everywhere bounds soak lock clean
.DEFAULT_GOAL := help

# Nodes of this checkout talk on this machine only, unless the user has said otherwise.
export ROS_AUTOMATIC_DISCOVERY_RANGE ?= LOCALHOST
# The Python to make environments with; empty: the first of 3.10 to 3.13 on PATH.
export PYTHON ?=
ARGS ?=
# A worker more than the two cores that are there at least: many tests wait for ROS.
PYTEST = -m pytest -n 3 --dist loadfile
TALKS_TO_ROS = tests/nodes tests/cli/test_run.py
RUN_ENDS = the_clearance_makes_it_chatter_and_the_recommended_speed_cures_it \
  an_interrupted_run_is_complete_up_to_then

help:
	@echo 'make run   the main job: a virtual lathe chatters, is flagged and cured; the run is kept'
	@echo '           (make run ARGS="--scenario no_clearance" for another scenario)'
	@echo 'make page  the same machine under your own hands: a page in the browser'
	@echo 'make test  every test (make test ARGS="tests/recording -x" for some)'
	@echo 'make lint  style and types'
	@echo 'make docs  the documentation as a site: docs/_build/html/index.html'
	@echo 'make figures  the pictures of the documentation and of the paper, anew'
	@echo 'make test-core    the tests that do not talk to ROS'
	@echo 'make test-kilted  what talks to ROS, on the wheels of ROS 2 Kilted instead of Jazzy'
	@echo 'make everywhere   run and test as other users would: each Python, other folders and rights'
	@echo 'make bounds       tests of the core on the lowest and newest versions that setup.py allows'
	@echo 'make soak         every test ten times, three of them beside a busy core'
	@echo 'make lock         write requirements/*.txt anew (make lock ARGS=--upgrade)'

run:
	@python=$$(scripts/environment) && "$$python" -m lathe_chatter.cli run $(ARGS)

page:
	@python=$$(scripts/environment) && "$$python" -m lathe_chatter.cli run --page $(ARGS)

lint:
	@python=$$(scripts/environment lint) && "$$python" -m ruff check . \
	  && "$$python" -m ruff format --check . && "$$python" -m mypy

# Strict: a dead link, a public name without a docstring or an example that fails is an error.
docs:
	@python=$$(scripts/environment docs) \
	  && "$$python" -m sphinx -W --keep-going -q -b html docs docs/_build/html $(ARGS) \
	  && echo 'docs/_build/html/index.html'

figures:
	@scripts/figures $(ARGS)

test:
	@python=$$(scripts/environment jazzy test) && "$$python" -m lathe_chatter.precompile \
	  && "$$python" $(PYTEST) $(ARGS)

test-core:
	@python=$$(scripts/environment jazzy test) && "$$python" -m lathe_chatter.precompile \
	  && "$$python" $(PYTEST) $(TALKS_TO_ROS:%=--ignore=%) $(ARGS)

# What another rclpy, middleware or message package could change. The tests that never import ROS
# pass as with Jazzy; so do the pages of the documentation, and of `lathe-chatter run`, which starts
# the same nodes each time, two ends are looked at.
test-kilted:
	@python=$$(scripts/environment kilted test) && "$$python" -m lathe_chatter.precompile \
	  && "$$python" $(PYTEST) tests/nodes --ignore=tests/nodes/test_pages.py \
	    $(addprefix tests/cli/test_run.py::test_,$(RUN_ENDS)) $(ARGS)

everywhere:
	@scripts/everywhere $(ARGS)

bounds:
	@scripts/bounds $(ARGS)

soak:
	@python=$$(scripts/environment jazzy test) && "$$python" -m lathe_chatter.precompile \
	  && "$$python" benchmarks/soak.py $(ARGS)

lock:
	@scripts/lock $(ARGS)

clean:
	rm -rf .venv-* build dist install log *.egg-info .mypy_cache .ruff_cache .pytest_cache
