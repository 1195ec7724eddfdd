"""From the checked files of a scenario to the records of plant and firmware: one source, two readers."""

from __future__ import annotations

import math
from typing import Any

from fluxlock.config import Scenario
from fluxlock.config.motor import RPM_PER_RAD_S
from fluxlock.config.scenario import Event
from fluxlock.cosim.plan import Action
from fluxlock.firmware import DriveSpec, InverterSpec, MotorSpec
from fluxlock.plant import (
    CHANNEL_NAMES,
    EncoderParams,
    InverterParams,
    MachineParams,
    MechanicsParams,
    PlantParams,
    RecordingParams,
    SensingParams,
)

CLOCK_HZ = 50e6


def _mean(values: tuple[float, float, float]) -> float:
    return sum(values) / 3


def motor_spec(s: Scenario) -> MotorSpec:
    """What the firmware is told of the machine."""
    m, error = s.motor, s.drive.motor_error
    return MotorSpec(
        pole_pairs=m.pole_pairs,
        resistance_ohm=_mean(m.resistance_ohm) * error.resistance,
        inductance_h=m.mean_inductance_h * error.inductance,
        psi_vs=_mean(m.psi_vs) * error.flux,
        inertia_kgm2=m.inertia_kgm2,
        rated_current_a=m.rated_current_a,
        max_speed_rpm=m.max_speed_rpm,
        emf=m.emf,
    )


def inverter_spec(s: Scenario) -> InverterSpec:
    """What the firmware is told of the inverter."""
    i = s.inverter
    return InverterSpec(
        supply_v=i.supply_v,
        on_resistance_ohm=i.on_resistance_ohm,
        diode_drop_v=i.diode_drop_v,
        dead_time_s=i.dead_time_s,
        min_pulse_s=i.min_pulse_s,
        bits=i.sensing.bits,
        sample_period_s=i.sensing.sample_period_s,
        voltage_full_scale_v=i.sensing.voltage_full_scale_v,
        current_full_scale_a=i.sensing.current_full_scale_a,
        divider_pole_s=i.sensing.divider_pole_s,
        driver_delay_s=i.gate_delay_s,
        precharge_s=i.precharge_s,
        high_active_low=i.gate_high_active_low,
        low_active_low=i.gate_low_active_low,
        phase_current_trip_a=i.protection.phase_current_a,
        dc_current_trip_a=i.protection.dc_current_a,
        over_voltage_v=i.protection.over_voltage_v,
        under_voltage_v=i.protection.under_voltage_v,
    )


def drive_spec(s: Scenario) -> DriveSpec:
    """What the scenario asks of the drive."""
    d = s.drive
    return DriveSpec(
        clock_hz=CLOCK_HZ,
        commutation=d.commutation,
        pattern=d.pattern,
        carrier_hz=d.carrier_hz,
        sync_rect=d.sync_rect,
        current_limit_a=s.current_limit_a,
        accel_rpm_per_s=s.accel_rpm_per_s,
        speed_bandwidth_hz=d.speed_bandwidth_hz,
        advance_deg=d.advance_deg,
        advance_deg_at_max_speed=d.advance_deg_at_max_speed,
        advance_deg_at_rated_current=d.advance_deg_at_rated_current,
        duty_max=d.duty_max,
        zcd_method=d.zcd.method,
        zcd_source=d.zcd.source,
        zcd_sampling=d.zcd.sampling,
        compute_back=d.zcd.compute_back,
        correction_a=d.zcd.correction_a,
        thresholds=d.zcd.threshold,
        miss_limit=d.zcd.miss_limit,
        hall_mode=d.hall.mode,
        hall_filter_s=d.hall.filter_s,
        hall_offset_deg=d.hall.offset_deg,
        hall_learn=d.hall.learn,
        start_current_a=d.start.current_a,
        start_carrier_hz=d.start.carrier_hz,
        start_retries=d.start.retries,
        restart_retries=d.start.restart_retries,
        balance=d.zcd.balance,
        balance_bandwidth_hz=d.zcd.balance_bandwidth_hz,
        catch_rotor=d.start.catch,
        brake_current_limit_a=d.brake_current_limit_a,
        linearity=d.linearity,
        current_loop=d.current_loop,
        mode=d.mode,
        target_torque_nm=1e-3 * (d.torque_mnm or 0.0),
        current_bandwidth_hz=d.current_bandwidth_hz,
    )


def plant_params(s: Scenario, record_every: int, zoom: tuple[tuple[int, int], ...]) -> PlantParams:
    """The plant of a scenario."""
    m, i, load = s.motor, s.inverter, s.shaft_load
    offsets = dict(zip(("ia", "ib", "ic"), i.sensing.offset_lsb, strict=True))
    return PlantParams(
        machine=MachineParams(
            pole_pairs=m.pole_pairs,
            r_ohm=m.resistance_ohm,
            l_h=m.inductance_h if m.inductance_q_h else m.self_inductance_h,
            l_q_h=m.inductance_q_h,
            m_h=m.mutual_h,
            psi_vs=m.psi_vs,
            emf=m.emf,
            flat_top_deg=m.flat_top_deg,
            hall_offset_deg=m.hall.offset_deg if m.hall else None,
            encoder=EncoderParams(m.encoder.lines, m.encoder.index, m.encoder.offset_deg) if m.encoder else None,
        ),
        inverter=InverterParams(
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
        ),
        sensing=SensingParams(
            v_full_scale_v=i.sensing.voltage_full_scale_v,
            i_full_scale_a=i.sensing.current_full_scale_a,
            bits=i.sensing.bits,
            divider_gain=i.sensing.divider_gain,
            offset_lsb=tuple(offsets.get(name, 0.0) for name in CHANNEL_NAMES),
            divider_pole_s=i.sensing.divider_pole_s,
            noise_lsb_rms=i.sensing.noise_lsb,
            conversion_s=i.sensing.conversion_s,
        ),
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
        phases = tuple("ABC".index(p) for p in fault.phases or ())
        value = {"phases": phases, "turns_fraction": fault.turns_fraction or 0.05}
    elif fault.kind == "stuck_channel":
        value = {"channel": fault.channel, "code": fault.code}
    else:
        value = {}
    return Action(cycle, "fault", {"kind": fault.kind, **value})
