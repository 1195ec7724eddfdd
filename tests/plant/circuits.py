# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Random circuits and switching sequences for the tests."""

from __future__ import annotations

import dataclasses

import numpy as np

from fluxlock.plant import (
    InverterParams,
    MachineParams,
    MechanicsParams,
    PlantParams,
    RecordingParams,
    SaturationParams,
    SensingParams,
    ThirdParams,
)

CLOCK_S = 1e-9
DEAD_CYCLES = 200


def triple(rng: np.random.Generator, mean: float, spread: float) -> tuple[float, float, float]:
    a, b, c = (float(v) for v in mean * (1 + spread * rng.uniform(-1, 1, 3)))
    return a, b, c


def random_params(
    rng: np.random.Generator, mechanics: str = "imposed", divider_pole_s: float = 0.0, salient: bool = False
) -> PlantParams:
    """Any circuit the plant can be given, from 12 V toys to 400 V drives, motoring and regenerating.

    salient: with L_q from a third to four times L_d.
    """
    supply_v = float(np.exp(rng.uniform(np.log(12), np.log(400))))
    amps = float(np.exp(rng.uniform(np.log(2), np.log(100))))
    l_h = supply_v * 25e-6 / amps * float(rng.uniform(0.5, 4))
    r_ohm = l_h / float(np.exp(rng.uniform(np.log(2e-4), np.log(1e-2))))
    pole_pairs = int(rng.integers(1, 8))
    omega_e = float(np.exp(rng.uniform(np.log(300), np.log(12000)))) * float(rng.choice([-1, 1]))
    # Peak line EMF from a tenth of the supply to a third above it.
    psi = supply_v * float(rng.uniform(0.06, 0.78)) / abs(omega_e)
    machine = MachineParams(
        pole_pairs=pole_pairs,
        r_ohm=triple(rng, r_ohm, 0.2),
        l_h=triple(rng, l_h, 0.25),
        m_h=triple(rng, -0.25 * l_h, 0.6) if rng.random() < 0.5 else (0.0, 0.0, 0.0),
        psi_vs=triple(rng, psi, 0.1),
        emf="sinusoidal" if rng.random() < 0.5 else "trapezoidal",
        flat_top_deg=float(rng.choice([120.0, 120.0, rng.uniform(90, 150)])),
    )
    capacitor = rng.random() < 0.5
    supply_r = float(rng.uniform(0.005, 0.1)) * supply_v / amps
    chopper = capacitor and rng.random() < 0.4
    inverter = InverterParams(
        supply_v=supply_v,
        r_on_ohm=float(rng.uniform(0, 0.02)) * supply_v / amps,
        diode_drop_v=float(rng.choice([0.0, 0.7, 1.5])),
        diode_r_ohm=float(rng.uniform(0, 0.02)) * supply_v / amps,
        supply_r_ohm=supply_r,
        dc_link_c_f=float(np.exp(rng.uniform(np.log(5e-6), np.log(1e-3)))) / supply_r if capacitor else 0.0,
        supply_diode=bool(capacitor and rng.random() < 0.5),
        chopper_ohm=2.0 * supply_v / amps if chopper else 0.0,
        chopper_on_v=1.04 * supply_v,
        chopper_off_v=1.01 * supply_v,
    )
    if salient:
        ratio = float(np.exp(rng.uniform(np.log(1 / 3), np.log(4))))
        machine = dataclasses.replace(machine, l_h=(l_h,) * 3, m_h=(0.0,) * 3, l_q_h=ratio * l_h)
    omega_m = omega_e / pole_pairs
    profile = ((0.0, omega_m), (2e-3, omega_m * float(rng.uniform(0.5, 1.5)))) if rng.random() < 0.3 else ()
    power = abs(psi * omega_e) * amps
    torque = power / abs(omega_m)
    free = mechanics == "free"
    return PlantParams(
        machine,
        inverter,
        SensingParams(2.0 * supply_v, 5 * amps, divider_pole_s=divider_pole_s),
        MechanicsParams(
            # Speed changes by a few per cent a millisecond at nominal torque.
            inertia_kgm2=torque * 1e-3 / (float(rng.uniform(0.02, 0.2)) * abs(omega_m)),
            mode="free" if free else "imposed",
            fan_nm_s2_per_rad2=0.3 * torque / omega_m**2,
            viscous_nm_s_per_rad=0.2 * torque / abs(omega_m),
            constant_nm=0.3 * torque,
            coulomb_nm=0.1 * torque,
            theta_e_rad=float(rng.uniform(0, 2 * np.pi)),
            omega_m_rad_s=omega_m,
            profile=() if free else profile,
        ),
        RecordingParams(energies=True),
        clock_period_s=CLOCK_S,
    )


def random_five_phase(
    rng: np.random.Generator, mechanics: str = "imposed", divider_pole_s: float = 0.0, saturated: bool = False
) -> PlantParams:
    """Any five-phase circuit; saturated: with both kinds of saturation."""
    base = random_params(rng, mechanics, divider_pole_s)
    l_h, psi = base.machine.l_h[0], base.machine.psi_vs[0]
    amps = base.sensing.i_full_scale_a / 5.0
    l_q = l_h * float(np.exp(rng.uniform(np.log(0.4), np.log(2.5))))
    third = ThirdParams(
        l_d_h=l_h * float(rng.uniform(0.15, 0.6)),
        l_q_h=l_h * float(rng.uniform(0.15, 0.6)),
        mutual_h=0.2 * l_h * float(rng.uniform(-1, 1)),
        psi_vs=psi * float(rng.uniform(-0.15, 0.15)),
    )
    machine = MachineParams(
        pole_pairs=base.machine.pole_pairs,
        r_ohm=tuple(base.machine.r_ohm[0] * float(f) for f in rng.uniform(0.8, 1.2, 5)),
        l_h=(l_h,) * 5,
        l_q_h=l_q,
        psi_vs=(psi,) * 5,
        phases=5,
        third=third,
        saturation=random_saturation(rng, amps, l_q / l_h) if saturated else None,
    )
    return dataclasses.replace(base, machine=machine)


def random_saturation(rng: np.random.Generator, amps: float, ratio: float) -> SaturationParams:
    """Saturation of a machine with L_q / L_d = ratio that is felt at the given current."""
    plus = float(rng.uniform(-0.2, 0.0))
    # L_dq of a few per cent of L_q, whatever the saliency: the angle of the axes is larger where that is small.
    angle = min(0.6, 0.08 * ratio / abs(ratio - 1.0)) * rng.uniform(-1, 1, 4) / np.array([4.0, 3.0, 6.0, 6.0])
    return SaturationParams(
        current_a=2.0 * amps,
        plus=plus,
        minus=-plus * float(rng.uniform(0.0, 0.6)),
        angle_rad=tuple(float(a) / amps**k for k, a in enumerate(angle)),  # type: ignore[arg-type]
        angle_current_a=amps,
    )


def random_saturated(
    rng: np.random.Generator, mechanics: str = "imposed", divider_pole_s: float = 0.0, five: bool = False
) -> PlantParams:
    """Any circuit with a machine that saturates; five: of five phases."""
    if five:
        return random_five_phase(rng, mechanics, divider_pole_s, saturated=True)
    base = random_params(rng, mechanics, divider_pole_s, salient=True)
    m = base.machine
    assert m.l_q_h is not None
    saturation = random_saturation(rng, base.sensing.i_full_scale_a / 5.0, m.l_q_h / m.l_h[0])
    machine = dataclasses.replace(m, psi_vs=(m.psi_vs[0],) * 3, emf="sinusoidal", saturation=saturation)
    return dataclasses.replace(base, machine=machine)


def random_gates(rng: np.random.Generator, duration_cycles: int, legs: int = 3) -> list[tuple[int, int]]:
    """Gate changes (cycle, gates): six-step chopping, arbitrary legs, coasting; with dead time."""
    t, gates = 1000, 0
    style, until = 0, 0
    rows: list[tuple[int, int]] = []
    pair = (0, 1)
    while t < duration_cycles:
        if t >= until:
            style = int(rng.choice([0, 0, 0, 1, 1, 2]))
            until = t + int(rng.integers(20_000, 80_000))
            a, b = rng.permutation(legs)[:2]
            pair = (int(a), int(b))
        if style == 0:
            on = bool(rng.random() < 0.6)
            wanted = (1 << (2 * pair[0]) if on else 0) | 2 << (2 * pair[1])
        elif style == 1:
            wanted = sum(int(rng.integers(0, 3)) << (2 * x) for x in range(legs))
        else:
            wanted = 0
        reversing = 0
        for x in range(legs):
            if (gates >> (2 * x) & 3) ^ (wanted >> (2 * x) & 3) == 3:
                reversing |= 3 << (2 * x)
        if reversing:
            rows.append((t, wanted & ~reversing))
            t += DEAD_CYCLES
        rows.append((t, wanted))
        gates = wanted
        t += int(np.exp(rng.uniform(np.log(300), np.log(25_000))))
    return rows
