# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Benches of a first start without the chip: the averaged measurement, a board whose programs run on the host."""

from __future__ import annotations

from dataclasses import dataclass

from fluxlock.commission.bench import bench_for
from fluxlock.commission.simulate import Measured, known_of
from fluxlock.config import Motor, Scenario
from fluxlock.cosim.parameters import parameter_block
from fluxlock.firmware import build_commission
from fluxlock.firmware.host import one_at_a_time
from fluxlock.first_start import bench as benches
from fluxlock.first_start.bench import wiring_of
from fluxlock.flash.image import pack_image
from fluxlock.generate.memory import FLASH_BLOCK, FLASH_IMAGE
from fluxlock.native.vector_run import vector_chip_of
from tests.commission.averaged_bench import AveragedBench, Machine, converse
from tests.flash.board_terminal import Answer


def averaged(scenario: Scenario) -> AveragedBench:
    """The commissioning program and the scenario's machine, without switching."""
    m, stage = scenario.motor, scenario.inverter
    machine = Machine(
        m.pole_pairs,
        sum(m.resistance_ohm) / 3 + stage.on_resistance_ohm,
        m.mean_inductance_h,
        m.mean_inductance_h,
        sum(m.psi_vs) / 3 * m.emf_fundamental,
        m.inertia_kgm2,
        m.load.coulomb_nm,
        m.load.viscous_nm_s_per_rad,
        m.load.fan_nm_s2_per_rad2,
    )
    return AveragedBench(known_of(bench_for(scenario))[0].scales, machine, seed=1)


def averaged_identify(scenario: Scenario) -> Measured:
    """The measurement at that bench."""
    lab = averaged(scenario)
    return Measured(converse(lab, known_of(bench_for(scenario))[0].conversation()), lab.time_s, 1.0)


@dataclass
class TwinBoard:
    """A board whose programs run on the host: time goes on with each line."""

    scenario: Scenario
    measured: Motor | None = None

    def __call__(self, flash: dict[int, bytes]) -> Answer:
        """The console of what has been written."""
        image = b"".join(flash[at] for at in sorted(flash) if FLASH_IMAGE <= at < FLASH_BLOCK)
        block = b"".join(flash[at] for at in sorted(flash) if at >= FLASH_BLOCK)
        if image.startswith(pack_image(build_commission().read_bytes(), 3)):
            return averaged(self.scenario).reply
        wiring = wiring_of(self.scenario)
        if block.startswith(parameter_block(wiring).pack()):
            chip = vector_chip_of(wiring, 1)
            chip.advance(round(5e-3 / chip.timing.period_s))

            def tested(line: str) -> list[str]:
                chip.advance(round(5e-3 / chip.timing.period_s))
                return list(chip.fw.command(line))

            return tested
        play = benches.player(benches.quiet(self.scenario), 1, 1.0)
        play.advance(benches.BOOT_S)

        def turned(line: str) -> list[str]:
            play.advance(play.now + (0.02 if line == "status" else 1e-3))
            play.take()
            return list(play.firmware.command(line))

        return turned


def warm(scenario: Scenario) -> None:
    """Compile what a board's programs need: a board answers within a second, a compiler does not."""
    with one_at_a_time():
        vector_chip_of(wiring_of(scenario), 1).advance(1)
        play = benches.player(benches.quiet(scenario), 1, 1.0)
        play.advance(1e-3)
        play.take()
