# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Current loops with the firmware's regulator on the host and with the hardware's in simulation, on exact machines.

Coefficients are those of the firmware in both. On the host the machine is the exact discrete model; beside the hardware
it is solved in the stationary frame in phase currents (`cocotb_tests/foc/closed_loops.py`).
"""

from __future__ import annotations

import json
import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from fluxlock.clock import CLOCK_HZ
from fluxlock.cosim.block import run_block_test
from fluxlock.firmware.binding import new
from fluxlock.firmware.vector_formats import (
    Complex,
    from_complex,
    model_at,
    regulator_design,
    to_complex,
    vector_machine,
)
from fluxlock.headers import CData
from fluxlock.theory.vector.controllers import BANDWIDTH_HZ, GAMMA, Gains, Kind, Regulator, follow, gains
from fluxlock.theory.vector.model import (
    Coefficients,
    ComplexArray,
    Park,
    Sampling,
    SmoothMachine,
    coefficients,
)
from fluxverify.regression.vector.transforms import FOC

Q30 = 2**30
FULL_Q17 = 2**17
FULL_A, FULL_V = 50.0, 30.0  # full scales of bench-25v


@dataclass(frozen=True)
class FixedLoop:
    """One loop: signed speed and delay over f_s and T_s."""

    machine: SmoothMachine
    kind: Kind
    speed: float
    delay: float
    park: Park
    period_cycles: int
    gamma: float = GAMMA

    @property
    def sampling(self) -> Sampling:
        """In seconds."""
        period_s = self.period_cycles / CLOCK_HZ
        return Sampling(period_s, self.delay * period_s, self.park)

    @property
    def omega(self) -> float:
        """Electrical speed (rad/s)."""
        return 2.0 * math.pi * self.speed / self.sampling.ts_s

    @property
    def model(self) -> Coefficients:
        """Of the machine."""
        return coefficients(self.machine, self.omega, self.sampling)

    @property
    def exact_gains(self) -> Gains:
        """In floating point."""
        return gains(self.kind, self.machine, self.omega, self.sampling, gamma=self.gamma)

    @property
    def firmware_machine(self) -> CData:
        """vector_machine_t as the parameter block has it."""
        ts, l_h = self.sampling.ts_s, self.machine.l_h
        admittance = ts * FULL_V / (l_h * FULL_A)
        resistance = self.machine.r_ohm / l_h * ts
        return vector_machine(resistance, self.delay, admittance, self.period_cycles, self.park)

    @property
    def speed_turn_q36(self) -> int:
        """2^-36 turn a clock."""
        return round(self.speed / self.period_cycles * 2**36)

    def firmware_gains(self, lib: CData) -> CData:
        """regulator_gains_t that the firmware designs."""
        machine, found = self.firmware_machine, new("regulator_gains_t")
        bandwidth = 2.0 * math.pi * BANDWIDTH_HZ * self.sampling.ts_s
        design = regulator_design(self.kind, bandwidth, self.gamma)
        model = model_at(lib, machine, self.speed_turn_q36)
        if not lib.regulator_design(found, design, machine, model):
            raise ValueError(f"{self}: the gains do not fit")
        return found

    def exact(self, reference: ComplexArray) -> ComplexArray:
        """Current (A) at the samples in floating point."""
        return follow(self.model, Regulator(self.exact_gains), reference)

    def host(self, lib: CData, reference: ComplexArray) -> ComplexArray:
        """Current (A) at the samples with the firmware's regulator."""
        model, chosen, state = self.model, self.firmware_gains(lib), new("complex_regulator_t")
        phi, gamma1, gamma2 = complex(model.phi), complex(model.gamma1), complex(model.gamma2)
        unit_a, unit_v = FULL_Q17 / FULL_A, 2**25 / FULL_V
        current, before = 0j, 0j
        found = np.empty(reference.size, dtype=np.complex128)
        for k, wanted in enumerate(reference):
            found[k] = current
            measured = from_complex(current, unit_a)
            reference_q17: Complex = from_complex(complex(wanted), unit_a)
            lib.complex_regulator_step(state, chosen, reference_q17, measured, FULL_Q17 - 1)
            u = to_complex(state.voltage_v_q25, unit_v)
            current = phi * current + gamma1 * u + gamma2 * before
            before = u
        return found

    def job(self, lib: CData, reference: ComplexArray) -> dict[str, object]:
        """What the simulation of the hardware is asked."""
        chosen, machine = self.firmware_gains(lib), self.firmware_machine
        unit_a = FULL_Q17 / FULL_A
        return {
            "resistance_ohm": self.machine.r_ohm,
            "inductance_h": self.machine.l_h,
            "period_s": self.sampling.ts_s,
            "delay_s": self.sampling.td_s,
            "turns_a_period": self.speed,
            "lead_q32": lib.vector_lead_turn_q32(machine, self.speed_turn_q36),
            "gain": [chosen.g.re, chosen.g.im],
            "hold": [chosen.h.re, chosen.h.im],
            "ratio": [chosen.ratio_q17.re, chosen.ratio_q17.im],
            "shift": chosen.shift,
            "full_scale_a": FULL_A,
            "full_scale_v": FULL_V,
            "references_i_q17": [[round(x.real * unit_a), round(x.imag * unit_a)] for x in reference.tolist()],
        }


def hardware(lib: CData, loops: Sequence[FixedLoop], reference: ComplexArray) -> list[ComplexArray]:
    """Currents (A) of the loops with the regulator of the RTL."""
    with TemporaryDirectory() as folder:
        asked, answered = Path(folder) / "loops.json", Path(folder) / "responses.json"
        asked.write_text(json.dumps([loop.job(lib, reference) for loop in loops]), encoding="utf-8")
        run_block_test(
            "fl_foc",
            FOC,
            "cocotb_tests.foc.closed_loops",
            parameters={"Phases": 3},
            extra_env={"FLUXLOCK_LOOPS": str(asked), "FLUXLOCK_RESPONSES": str(answered)},
        )
        responses = json.loads(answered.read_text(encoding="utf-8"))
    return [np.array(pairs)[:, 0] + 1j * np.array(pairs)[:, 1] for pairs in responses]
