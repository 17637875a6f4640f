# Two commands are all there is to know: `make run` and `make test`. Both install what they need.
.PHONY: help run test test-kilted lint clean
.DEFAULT_GOAL := help

# Nodes of this checkout talk on this machine only, unless the user has said otherwise.
export ROS_AUTOMATIC_DISCOVERY_RANGE ?= LOCALHOST
ARGS ?=

help:
	@echo 'make run   the main job: a virtual lathe chatters, is flagged and cured; the run is kept'
	@echo '           (make run ARGS="--scenario no_clearance" for another scenario)'
	@echo 'make test  linters, types and every test'
	@echo 'make test-kilted  what talks to ROS, on the wheels of ROS 2 Kilted instead of Jazzy'

run:
	@python=$$(scripts/environment) && $$python -m lathe_chatter.cli run $(ARGS)

lint:
	@python=$$(scripts/environment jazzy test) && $$python -m ruff check . \
	  && $$python -m ruff format --check . && $$python -m mypy

test: lint
	@python=$$(scripts/environment jazzy test) && $$python -m lathe_chatter.precompile \
	  && $$python -m pytest -n 2 --dist loadfile $(ARGS)

# The rest of the tests never import ROS: what passes with Jazzy passes with Kilted.
test-kilted:
	@python=$$(scripts/environment kilted test) && $$python -m lathe_chatter.precompile \
	  && $$python -m pytest -n 2 --dist loadfile tests/nodes tests/commands/test_run.py $(ARGS)

clean:
	rm -rf .venv-* build install log *.egg-info .mypy_cache .ruff_cache .pytest_cache
