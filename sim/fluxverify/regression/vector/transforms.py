# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Transforms and modulator of the hardware against floating point over random vectors: worst errors of block tests."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

from fluxlock.base.paths import ROOT
from fluxverify.regression.block_test import measure
from fluxverify.regression.case import Row, case
from fluxverify.regression.runner import Runner

FOC = [
    *("common/fl_sine_pkg.sv", "common/fl_sincos.sv"),
    *(f"foc/{name}.sv" for name in ("fl_foc_pkg", "fl_mac", "fl_sqrt", "fl_ratio", "fl_foc")),
]
CHAIN: list[str | Path] = [
    "foc/fl_modulator.sv",
    "pwm/fl_leg_carrier.sv",
    "safety/fl_gate_guard.sv",
    ROOT / "cocotb_tests" / "pwm" / "fl_vector_chain.sv",
]
LIMIT = 1.0
MODULATOR_NOTE = (
    "compare_clocks: error of a leg's compare less half a unit of voltage, by which the rounded zero sequence shifts "
    "all legs alike. vector_clocks: length of the difference between the vector asked for and that of the upper "
    "switches' clocks in a carrier."
)


@case("vector/transforms")
def transforms(runner: Runner) -> Iterator[Row]:
    """Currents, voltages, compares and gates over random vectors: within 1 LSB of floating point."""
    for phases in (3,) if runner.quick else (3, 5):
        chosen = {"phases": phases, "seed": runner.seed}
        errors = measure(
            "fl_foc",
            FOC,
            "cocotb_tests.foc.test_fl_foc",
            "transforms_are_within_one_lsb",
            runner.seed,
            {"Phases": phases},
        )
        yield Row(
            f"vector/transforms/clarke-park-{phases}",
            {**chosen, "vectors": 3000, "lsb": "2^-17 of full scale"},
            {name: errors[name] for name in ("current_lsb", "voltage_lsb")},
            {name: (None, LIMIT) for name in ("current_lsb", "voltage_lsb")},
        )
        modulator = measure(
            "fl_modulator",
            ["foc/fl_modulator.sv"],
            "cocotb_tests.foc.test_fl_modulator",
            "random_vectors",
            runner.seed,
            {"Phases": phases},
        )
        gates = measure(
            "fl_vector_chain",
            CHAIN,
            "cocotb_tests.pwm.test_vector_chain",
            "random_vectors_from_the_gates",
            runner.seed,
            {"Phases": phases},
        )
        yield Row(
            f"vector/transforms/modulator-{phases}",
            {**chosen, "vectors": 1500, "vectors_at_the_gates": 115},
            {"compare_clocks": modulator["compare_clocks"], "vector_clocks": gates["vector_clocks"]},
            {"compare_clocks": (None, LIMIT), "vector_clocks": (None, LIMIT)},
            MODULATOR_NOTE,
        )
