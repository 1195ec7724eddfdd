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
.PHONY: help demo check test can canopen native test-socketcan lint regression campaign mutation coverage bench synth formal docs site release-check setup
.PHONY: place clean distclean

help: ## list the targets
	@sed -n 's/^\([a-z-]*\):.*## \(.*\)/\1|\2/p' $(MAKEFILE_LIST) | awk -F'|' '{printf "  make %-14s %s\n", $$1, $$2}'

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

setup: $(TEST) $(LINT) $(FORMAL) $(COVERAGE) $(SYNTH) ## install every dependency group

demo: $(RUN) ## start a motor and hold it at 60 000 r/min: results and plots in build/demo
	@.venv/bin/fluxlock demo --seed $(SEED)

check: $(TEST) $(LINT) $(FORMAL) ## minutes before a commit: lint, units, what has changed, a short closed loop (SINCE=revision)
	@$(PY) -m fluxlock.check --jobs $(JOBS) $(if $(SINCE),--since $(SINCE))

test: $(TEST) $(FORMAL) $(COVERAGE) $(SYNTH) ## unit, block, firmware and closed-loop tests, proofs of the safety blocks
	@FLUXLOCK_TEST_TIMES=build/test-times.json $(PY) -m pytest -n $(JOBS) --dist worksteal

can: $(TEST) ## CAN controller on a bus with independent nodes: 20 000 random frames (FRAMES=...)
	@FLUXLOCK_CAN_FRAMES=$(or $(FRAMES),20000) $(PY) -m pytest cocotb_tests/can/test_fl_can.py tests/can

canopen: $(TEST) ## the tests of the CANopen node alone, with 5000 frames to refuse on a full bus (FRAMES=...)
	@FLUXLOCK_CAN_FUZZ=$(or $(FRAMES),5000) $(PY) -m pytest tests/canopen cocotb_tests/soc/test_boot_store.py \
	  tests/campaign/test_fuzz.py tests/campaign/test_campaign.py::test_the_node_tells

native: $(TEST) ## the tests of the firmware in the simulator's process alone
	@$(PY) -m pytest tests/closed_loop/test_native_firmware.py tests/canopen/test_chip.py::test_without_the_core

test-socketcan: $(TEST) ## the same master, candump, cansend and cangen on a real vcan0, under User-Mode Linux where the kernel has none
	@$(PY) -c 'from fluxlock.cosim.run import chip_of; from fluxlock.config import load_scenario; chip_of(load_scenario("scenarios/can.toml"))'
	@FLUXLOCK_SOCKETCAN=vcan0 tools/socketcan.sh $(PY) -m pytest tests/canopen/test_master.py tests/canopen/can_utils.py

lint: $(TEST) $(LINT) ## Verilator, Verible and Yosys on the RTL, C warnings, ruff, mypy, requirement matrix
	@$(PY) -m fluxlock.lint --jobs $(JOBS)

regression: $(TEST) ## the long sets with their limits: build/regression.json (QUICK=1: short; CASES=...: some)
	@.venv/bin/fluxlock regression $(CASES) $(if $(QUICK),--quick) --jobs $(JOBS) --seed $(SEED)

campaign: $(TEST) ## faults of plant, sensors and chip at many moments: build/campaign.json (QUICK=1: few; DRIVES=...: some)
	@.venv/bin/fluxlock campaign $(DRIVES) $(if $(QUICK),--quick) --jobs $(JOBS) --seed $(SEED)
	@$(if $(QUICK)$(DRIVES),echo "docs/verification/campaign.md stays as it is: it shows the whole grid only",$(PY) -m fluxlock.campaign.page)

bench: $(TEST) ## closed loop against a bare simulation of the same chip: build/bench.json
	@$(PY) -m fluxlock.bench

synth: $(SYNTH) ## Yosys and nextpnr for ECP5: build/synth.json, tables in docs (ONLY=...: some)
	@$(PY) -m fluxlock.synth $(ONLY) --seed $(SEED) --jobs $(JOBS)

formal: $(TEST) $(FORMAL) ## proofs of the safety blocks
	@$(PY) -m pytest -n $(JOBS) --dist worksteal tests/formal

mutation: $(TEST) $(FORMAL) ## defects put into RTL blocks, found by their tests or not: build/mutate (BLOCKS=...: some)
	@.venv/bin/fluxlock mutate $(BLOCKS) --jobs $(JOBS) --seed $(SEED)
	@$(PY) -m fluxlock.docs.mutation

coverage: $(TEST) $(COVERAGE) ## RTL, C and Python reached by the tests: build/coverage/report.md (BLOCKS=...: RTL of some folders)
	@$(PY) -m fluxlock.coverage $(BLOCKS) --jobs $(JOBS)

site: $(RUN) .venv/.group-docs ## the documentation as a site: build/site/html
	@$(PY) -m fluxlock.docs.site

release-check: $(RUN) ## refuse generated pages that were made from other sources than this tree
	@$(PY) -m fluxlock.docs.release

docs: $(TEST) ## register reference, schema pages, verification matrix
	@$(PY) -m fluxlock.build html
	@$(PY) -m fluxlock.docs

clean: ## remove everything built
	rm -rf build

distclean: clean ## remove the environment too
	rm -rf .venv
