# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""The commissioning program on the chip: parameters that it cannot measure by, and a host that falls silent."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from fluxlock.base.paths import ROOT
from fluxlock.clock import CLOCK_HZ
from fluxlock.commission.bench import bench_of
from fluxlock.commission.simulate import known_of
from fluxlock.cosim.chip import build_chip
from fluxlock.cosim.launch import run_plan
from fluxlock.cosim.run import IMAGE_FILE, prepare
from fluxlock.firmware import build_commission, write_image
from tests.commission.falls_silent import FallsSilent

MOTOR, INVERTER = ROOT / "motors" / "motor-1.toml", ROOT / "inverters" / "bench-25v.toml"
TIME_S = 0.03  # 10 ms of it the boot


def test_program_refuses_the_regulator_on_the_core(tmp_path: Path) -> None:
    """Nobody would answer a regulator step there: the program says so instead of being interrupted for ever.

    Verifies: IDENT-09
    """
    bench = bench_of(MOTOR, INVERTER)
    dialogue, block = known_of(bench)
    block.update({"vector_direct": 1})
    plan = prepare(bench, tmp_path, 1, stop_cycle=round(TIME_S * CLOCK_HZ), block=block)
    write_image(plan.folder / IMAGE_FILE, build_commission(), block)
    meta = run_plan(replace(plan, dialogue=dialogue, final_commands=()), build_chip(method="vector"))
    assert "vector_direct is 1" in meta["fault"] and "set it to 0" in meta["fault"], meta["fault"]
    assert all(line.startswith("error: vector_direct") for line in meta["uart"].splitlines()), meta["uart"]


FORSAKEN = "error: no line for too long; gates off"


def test_gates_go_off_when_the_host_is_silent(tmp_path: Path) -> None:
    """After its patience the program drives nothing until the host has said `o`; lines that it does not know are none.

    Verifies: IDENT-10
    """
    bench = bench_of(MOTOR, INVERTER)
    dialogue, block = known_of(bench)
    plan = prepare(bench, tmp_path, 1, stop_cycle=round(0.2 * CLOCK_HZ), block=block)
    write_image(plan.folder / IMAGE_FILE, build_commission(), block)
    talk = FallsSilent(dialogue.scales.scale())
    meta = run_plan(replace(plan, dialogue=talk, final_commands=()), build_chip(method="vector"))
    assert meta["conclusion"] == ["ok", "ok", FORSAKEN, FORSAKEN, "ok", "ok"], meta
