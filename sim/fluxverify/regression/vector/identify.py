# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Commissioning on the chip: what `fluxlock identify` measures against the plant that it measured."""

from __future__ import annotations

import math
from collections.abc import Iterator
from pathlib import Path
from random import Random

from fluxlock.base.paths import ROOT
from fluxlock.commission.bench import bench_of
from fluxlock.commission.report import VOUCHED_PERCENT, quantities
from fluxlock.config import Inverter, load_inverter
from fluxlock.config.motor import RPM_PER_RAD_S
from fluxverify.regression.case import Number, Row, case
from fluxverify.regression.runner import Runner

INVERTERS = ROOT / "inverters"
# Seeds of generated motors, one of which is salient, and their inverters.
GENERATED = {1: "drive-24v", 8: "drive-48v"}
# Name in the table, in the row; those that the command vouches for are limited.
SHOWN = {
    "R winding + switch, mean": "resistance_error_percent",
    "R winding + switch, A": "resistance_a_error_percent",
    "R winding + switch, B": "resistance_b_error_percent",
    "R winding + switch, C": "resistance_c_error_percent",
    "L d": "inductance_d_error_percent",
    "L q": "inductance_q_error_percent",
    "flux": "flux_error_percent",
    "inertia": "inertia_error_percent",
}


def generated_motor(seed: int, inverter: Inverter) -> str:
    """Text of a motor file with numbers drawn at random, as a machine for this inverter could have them."""
    draw = Random(seed)
    pole_pairs = draw.randint(1, 6)
    omega = 2.0 * math.pi * 10 ** draw.uniform(2.3, 3.1)
    current = draw.uniform(0.25, 0.5) * inverter.protection.phase_current_a
    phase_v = inverter.supply_v / math.sqrt(3)
    psi = draw.uniform(0.6, 0.85) * phase_v / omega
    resistance = draw.uniform(0.02, 0.08) * phase_v / current
    inductance = draw.uniform(0.1, 0.3) * phase_v / current / omega
    torque = 1.5 * pole_pairs * psi * current
    speed_rpm = omega / pole_pairs * RPM_PER_RAD_S
    phases = [resistance * draw.uniform(0.96, 1.04) for _ in range(3)]
    lines = [
        f'name = "generated, seed {seed}"',
        f"pole_pairs = {pole_pairs}",
        f"resistance_ohm = [{', '.join(f'{x:.5g}' for x in phases)}]",
        f"inductance_h = {inductance:.5g}",
        f"psi_vs = {psi:.5g}",
        'emf = "sinusoidal"',
        f"inertia_kgm2 = {torque * draw.uniform(0.05, 0.3) / (omega / pole_pairs):.5g}",
        f"rated_current_a = {current:.3f}",
        f"max_speed_rpm = {speed_rpm:.1f}",
        *([f"inductance_q_h = {inductance * draw.uniform(1.2, 2.0):.5g}"] if draw.random() < 0.5 else []),
        "[load]",
        f"fan_torque_nm = {draw.uniform(0.2, 0.6) * torque:.5g}",
        f"fan_speed_rpm = {speed_rpm:.1f}",
        f"coulomb_nm = {draw.uniform(0.0, 0.03) * torque:.5g}",
    ]
    return "\n".join(lines) + "\n"


def _row(runner: Runner, name: str, motor: Path, inverter: Path, seed: int | None = None) -> Row:
    bench = bench_of(motor, inverter)
    measured = runner.identify(bench, name)
    found = {q.name: q for q in quantities(measured.values, bench.inverter.on_resistance_ohm, bench.motor)}
    values: dict[str, Number] = {key: found[q].error_percent for q, key in SHOWN.items()}
    friction = next(q for q in found.values() if q.name.startswith("friction at"))
    values |= {
        "friction_at_top_error_percent": friction.error_percent,
        "dead_time_voltage_mv": 1e3 * measured.values["dead_v"],
        "chip_time_s": measured.duration_s,
    }
    return Row(
        f"vector/identify/{name}",
        {
            "motor": bench.motor.name,
            "inverter": bench.inverter.name,
            **({} if seed is None else {"motor_seed": seed}),
            "pole_pairs": bench.motor.pole_pairs,
        },
        values,
        {SHOWN[q]: (-limit, limit) for q, limit in VOUCHED_PERCENT.items()},
    )


@case("vector/identify", long=True)
def identify(runner: Runner) -> Iterator[Row]:
    """The machine that identify measures through the chip is the one on the bench: R, L, flux 3 %, inertia 10 %."""
    yield _row(runner, "Motor-I", ROOT / "motors" / "motor-1.toml", INVERTERS / "bench-25v.toml")
    if runner.quick:
        return
    yield _row(runner, "Motor-II", ROOT / "motors" / "motor-2.toml", INVERTERS / "bench-15v.toml")
    for number, (seed, inverter) in enumerate(GENERATED.items(), 1):
        name, file = f"generated-{number}", INVERTERS / f"{inverter}.toml"
        motor = runner.folder(name).with_suffix(".toml")
        motor.parent.mkdir(parents=True, exist_ok=True)
        motor.write_text(generated_motor(seed, load_inverter(file)), encoding="utf-8")
        yield _row(runner, name, motor, file, seed)
