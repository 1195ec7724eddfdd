# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""From the checked files of a scenario to the records of the plant and to its actions."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

from fluxlock.clock import CLOCK_HZ
from fluxlock.config import Inverter, Scenario
from fluxlock.config.motor import RPM_PER_RAD_S, machine_params
from fluxlock.config.scenario import DEAD_CORE_S, HALL_GLITCH_S, NOISY_LSB, Event
from fluxlock.cosim.broken_code import TO_ITSELF, entry, rewrite
from fluxlock.cosim.plan import Action
from fluxlock.plant import (
    InverterParams,
    MechanicsParams,
    PlantParams,
    RecordingParams,
    SensingParams,
    channel_names,
)


def inverter_params(i: Inverter) -> InverterParams:
    """The power stage of an inverter file."""
    return InverterParams(
        supply_v=i.supply_v,
        r_on_ohm=i.on_resistance_ohm,
        diode_drop_v=i.diode_drop_v,
        diode_r_ohm=i.diode_resistance_ohm,
        supply_r_ohm=i.supply_resistance_ohm,
        dc_link_c_f=i.dc_link_f,
        supply_diode=i.supply_diode,
        chopper_ohm=i.brake_chopper.resistance_ohm if i.brake_chopper else 0.0,
        chopper_on_v=i.brake_chopper.on_v if i.brake_chopper else 0.0,
        chopper_off_v=i.brake_chopper.off_v if i.brake_chopper else 0.0,
        chopper_driven=i.brake_chopper is not None and i.brake_chopper.longest_on_s is not None,
    )


def sensing_params(i: Inverter, phases: int) -> SensingParams:
    """The sense chain of an inverter file; with five phases all have the values of the first."""
    names = channel_names(phases)
    offsets = i.sensing.offset_lsb if phases == 3 else (i.sensing.offset_lsb[0],) * phases
    by_name = dict(zip(names[phases : 2 * phases], offsets, strict=True))
    return SensingParams(
        v_full_scale_v=i.sensing.voltage_full_scale_v,
        i_full_scale_a=i.sensing.current_full_scale_a,
        bits=i.sensing.bits,
        divider_gain=i.sensing.divider_gain if phases == 3 else (i.sensing.divider_gain[0],) * phases,
        offset_lsb=tuple(by_name.get(name, 0.0) for name in names),
        divider_pole_s=i.sensing.divider_pole_s,
        noise_lsb_rms=i.sensing.noise_lsb,
        conversion_s=i.sensing.conversion_s,
        sources=i.sensing.sources,
        edge=i.sensing.edge.params(i.sensing.current_full_scale_a),
    )


def plant_params(s: Scenario, record_every: int, zoom: tuple[tuple[int, int], ...]) -> PlantParams:
    """The plant of a scenario."""
    m, i, load = s.motor, s.inverter, s.shaft_load
    return PlantParams(
        machine=machine_params(m),
        inverter=inverter_params(i),
        sensing=sensing_params(i, m.phases),
        mechanics=MechanicsParams(
            inertia_kgm2=m.inertia_kgm2,
            mode=s.mechanics.mode,
            fan_nm_s2_per_rad2=load.fan_nm_s2_per_rad2,
            constant_nm=load.constant_nm,
            viscous_nm_s_per_rad=load.viscous_nm_s_per_rad,
            coulomb_nm=load.coulomb_nm,
            stiction_ratio=load.stiction_ratio,
            theta_e_rad=math.radians(s.initial.theta_deg),
            omega_m_rad_s=s.initial.speed_rpm / RPM_PER_RAD_S,
            profile=tuple((t, rpm / RPM_PER_RAD_S) for t, rpm in s.mechanics.profile),
        ),
        recording=RecordingParams(every_strobes=record_every, zoom=zoom),
        clock_period_s=1.0 / CLOCK_HZ,
    )


def action_of(s: Scenario, event: Event) -> Action:
    """One event of a scenario as the session carries it out."""
    cycle = max(1, round(event.at_s * CLOCK_HZ))
    value: Any
    if event.command is not None:
        return Action(cycle, "console", {"line": event.command})
    if event.speed_rpm is not None:
        return Action(cycle, "console", {"line": f"set speed_rpm {round(event.speed_rpm)}"})
    if event.accel_rpm_per_s is not None:
        return Action(cycle, "console", {"line": f"set accel_rpm_s {round(event.accel_rpm_per_s)}"})
    if event.load_factor is not None:
        load, f = s.shaft_load, event.load_factor
        value = {
            "fan_nm_s2_per_rad2": f * load.fan_nm_s2_per_rad2,
            "constant_nm": f * load.constant_nm,
            "viscous_nm_s_per_rad": f * load.viscous_nm_s_per_rad,
            "coulomb_nm": f * load.coulomb_nm,
            "ramp_s": event.ramp_s,
        }
        return Action(cycle, "load", value)
    if event.supply_v is not None:
        return Action(cycle, "supply", {"supply_v": event.supply_v, "ramp_s": event.ramp_s})
    assert event.fault is not None
    fault = event.fault
    if fault.kind == "shorted_winding":
        phases = tuple("ABCDE".index(p) for p in fault.phases or ())
        value = {"phases": phases, "turns_fraction": fault.turns_fraction or 0.05}
    elif fault.phases is not None:
        value = {"phases": tuple("ABCDE".index(p) for p in fault.phases)}
    elif fault.kind == "stuck_channel":
        value = {"channel": fault.channel, "code": fault.code}
    elif fault.kind == "noisy_channels":
        value = {"noise_lsb": NOISY_LSB if fault.noise_lsb is None else fault.noise_lsb}
    elif fault.kind == "hall_glitch":
        return Action(cycle, "pin", {"pin": "hall_i[0]", "cycles": round(HALL_GLITCH_S * CLOCK_HZ), "level": None})
    else:
        value = {}
    return Action(cycle, "fault", {"kind": fault.kind, **value})


def actions_of(s: Scenario, event: Event, image: Path) -> tuple[Action, ...]:
    """One event of a scenario with the firmware's image, whose code a dead core has not."""
    if event.fault is None or event.fault.kind != "dead_core":
        return (action_of(s, event),)
    begin, end = (max(1, round((event.at_s + after_s) * CLOCK_HZ)) for after_s in (0.0, DEAD_CORE_S))
    at = entry(image, "trap_control")
    return rewrite(image, at, TO_ITSELF, begin) + rewrite(image, at, TO_ITSELF, end)
