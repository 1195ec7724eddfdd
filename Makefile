# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

# Fluxlock. Every target sets up what it needs below .venv and build; `make help` lists them.
SHELL := /bin/sh
PY := .venv/bin/python
JOBS ?= $(shell nproc 2>/dev/null || echo 2)
SEED ?= 1
export PYTHONPYCACHEPREFIX := $(CURDIR)/build/pycache
unexport PYTHONDONTWRITEBYTECODE
.NOTPARALLEL:

.DEFAULT_GOAL := help
.PHONY: help demo wheel check test can canopen native test-socketcan test-wheel lint regression campaign population mutation coverage bench synth formal docs site diagrams release-check setup
.PHONY: place clean distclean

# A target's text stands behind ## with what it gives; its group stands in a line of its own behind ##@.
help:
	@echo 'Usage: make TARGET. Each target installs what it needs. Times: two cores, first run.'
	@awk -F ':.*## ' '/^##@ / { printf "\n%s\n", substr($$0, 5) } \
	  /^[a-z-]+:.*## / { printf "  %-14s %s\n", $$1, $$2 }' $(MAKEFILE_LIST)
	@printf '\nEvery command of a user: .venv/bin/fluxlock --help\n'

# One stamp a dependency group, renewed when the lock changes.
.venv/.group-%: uv.lock pyproject.toml tools/setup.sh
	@tools/setup.sh $*

# A checkout that was set up may have been moved since.
place:
	@tools/place.sh

RUN := place .venv/.group-run
TEST := $(RUN) .venv/.group-test
LINT := $(RUN) .venv/.group-lint
FORMAL := .venv/.group-formal
COVERAGE := .venv/.group-coverage
SYNTH := $(RUN) .venv/.group-synth

##@ Run

demo: $(RUN) ## a motor from standstill to 60 000 r/min: results and plots in build/demo; 2 min (SEED=n)
	@.venv/bin/fluxlock demo --seed $(SEED)

##@ Put it on a board

synth: $(SYNTH) ## bitstreams and sizes for ECP5 by Yosys and nextpnr: build/synth; 1 h (ONLY=three-phase)
	@$(PY) -m fluxlock.synth $(ONLY) --seed $(SEED) --jobs $(JOBS)

##@ Take it along

wheel: $(TEST) ## the package, dist/fluxlock-VERSION-py3-none-any.whl: pip installs it without a checkout; 10 s
	@$(PY) -m hatchling build -t wheel

##@ Check a change

check: $(TEST) $(LINT) $(FORMAL) ## before a commit: lint, units, what has changed, a short closed loop; minutes (SINCE=revision)
	@$(PY) -m fluxverify.check --jobs $(JOBS) $(if $(SINCE),--since $(SINCE))

test: $(TEST) $(FORMAL) $(COVERAGE) $(SYNTH) ## every test and proof: units, blocks, firmware, closed loops; 30 min to 1 h (JOBS=n)
	@FLUXLOCK_TEST_TIMES=build/test-times.json $(PY) -m pytest -n $(JOBS) --dist worksteal

lint: $(TEST) $(LINT) ## Verilator, Verible, Yosys, C warnings, ruff, mypy, licences, requirement matrix; 20 s to minutes
	@$(PY) -m fluxverify.lint --jobs $(JOBS)

##@ One part of the tests

formal: $(TEST) $(FORMAL) ## proofs of the safety blocks alone; minutes
	@$(PY) -m pytest -n $(JOBS) --dist worksteal tests/formal

can: $(TEST) ## CAN controller among independent nodes: 20 000 random frames; minutes (FRAMES=n)
	@FLUXLOCK_CAN_FRAMES=$(or $(FRAMES),20000) $(PY) -m pytest cocotb_tests/can/test_fl_can.py tests/can

canopen: $(TEST) ## CANopen node alone, with 5000 frames to refuse; minutes (FRAMES=n)
	@FLUXLOCK_CAN_FUZZ=$(or $(FRAMES),5000) $(PY) -m pytest tests/canopen cocotb_tests/soc/test_boot_store.py \
	  tests/campaign/test_fuzz.py tests/campaign/test_campaign.py::test_the_node_tells

native: $(TEST) ## firmware in the simulator's process alone; minutes
	@$(PY) -m pytest tests/closed_loop/test_native_firmware.py tests/closed_loop/test_injection.py \
	  tests/canopen/test_chip.py::test_without_the_core

test-socketcan: $(TEST) ## master, candump, cansend and cangen on a real vcan0; minutes
	@$(PY) -c 'from fluxlock.cosim.run import chip_of; from fluxlock.config import load_scenario; chip_of(load_scenario("scenarios/can.toml"))'
	@FLUXLOCK_SOCKETCAN=vcan0 tools/socketcan.sh $(PY) -m pytest tests/canopen/test_master.py tests/canopen/can_utils.py

test-wheel: $(TEST) ## the wheel in an environment and a home of its own, then its demo; minutes (PYTHON=python3.12)
	@PYTHON=$(PYTHON) $(PY) -m pytest -q -s tests/package/pip_install.py

##@ Long runs

regression: $(TEST) ## long sets with their limits: build/regression.json; 2 h (QUICK=1, CASES=six-step/starts)
	@$(if $(QUICK)$(CASES),,FLUXLOCK_BOOT_FIRMWARE=1 $(PY) -m pytest -q -n $(JOBS) cocotb_tests/soc/test_boot_firmware.py)
	@.venv/bin/fluxverify regression $(CASES) $(if $(QUICK),--quick) --jobs $(JOBS) --seed $(SEED)

campaign: $(TEST) ## faults at many moments, each ending judged: build/campaign.json; hours (QUICK=1, DRIVES=vector)
	@.venv/bin/fluxverify campaign $(DRIVES) $(if $(QUICK),--quick) --jobs $(JOBS) --seed $(SEED)
	@$(if $(QUICK)$(DRIVES),echo "docs/verification/campaign.md stays as it is: it shows the whole grid only",$(PY) -m fluxverify.campaign.page)

population: $(TEST) ## random machines that nobody tuned for, each life judged: build/population; 1 h (METHOD=vector LIVES=n SEED=n)
	@.venv/bin/fluxlock population run $(if $(METHOD),--method $(METHOD)) $(if $(LIVES),--lives $(LIVES)) --jobs $(JOBS) --seed $(SEED)

bench: $(TEST) ## speed of the closed loop against a bare simulation: build/bench.json; minutes
	@$(PY) -m fluxverify.bench

mutation: $(TEST) $(FORMAL) ## defects put into RTL blocks, found or not: build/mutate; hours (BLOCKS=fl_trip)
	@.venv/bin/fluxverify mutate $(BLOCKS) --jobs $(JOBS) --seed $(SEED)
	@$(PY) -m fluxverify.docs.mutation

coverage: $(TEST) $(COVERAGE) ## RTL, C and Python that the tests reach: build/coverage/report.md; hours (BLOCKS=safety)
	@$(PY) -m fluxverify.coverage $(BLOCKS) --jobs $(JOBS)

##@ Pages

site: $(RUN) .venv/.group-docs ## documentation as a site with search: build/site/html; minutes
	@$(PY) -m fluxverify.docs.site

diagrams: $(TEST) .venv/.group-docs ## timing and block diagrams of the pages from the RTL; 2 min
	@FLUXLOCK_WRITE_DIAGRAMS=1 $(PY) -m pytest -q cocotb_tests/timing
	@$(PY) docs/site/timing.py
	@$(PY) -m fluxverify.docs.hierarchy
	@$(PY) -m fluxverify.docs.gallery

docs: $(TEST) ## register reference, schema pages, README tables, verification matrix; 1 min
	@$(PY) -m fluxlock.generate.registers html
	@$(PY) -m fluxverify.docs

release-check: $(RUN) ## refuses pages that were made from other sources than this tree; seconds
	@$(PY) -m fluxverify.docs.release

##@ The environment

setup: $(TEST) $(LINT) $(FORMAL) $(COVERAGE) $(SYNTH) ## every dependency group into .venv; 1 min

clean: ## removes build
	rm -rf build

distclean: clean ## removes build and .venv
	rm -rf .venv
