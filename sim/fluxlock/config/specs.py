# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""From the checked files of a scenario to the records that the firmware's parameters are compiled from."""

from __future__ import annotations

from fluxlock.clock import CLOCK_HZ
from fluxlock.config.scenario import Scenario
from fluxlock.firmware.specs import BrakeSpec, DriveSpec, EncoderSpec, InverterSpec, MotorSpec, ThirdSpec


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
        emf_fundamental=m.emf_fundamental,
        encoder=EncoderSpec(**m.encoder.model_dump()) if m.encoder else None,
        saliency_h=(m.inductance_q_h - m.inductance_h[0]) * error.inductance if m.inductance_q_h else 0.0,
        phases=m.phases,
        third=ThirdSpec(**m.third.model_dump()) if m.third else None,
        curve_rad=m.saturation.angle_rad if m.saturation else (0.0,) * 4,
        curve_current_a=(m.saturation.angle_current_a or m.saturation.current_a) if m.saturation else None,
        polarity_current_a=m.saturation.current_a if m.saturation else None,
        overload_s=m.overload_s,
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
        gate_polarity=i.gate_polarity,
        phase_current_trip_a=i.protection.phase_current_a,
        dc_current_trip_a=i.protection.dc_current_a,
        over_voltage_v=i.protection.over_voltage_v,
        under_voltage_v=i.protection.under_voltage_v,
        conversion_s=i.sensing.conversion_s,
        noise_lsb=i.sensing.noise_lsb,
        safe_state=i.protection.safe_state,
        brake=BrakeSpec(i.brake_chopper.on_v, i.brake_chopper.off_v, i.brake_chopper.longest_on_s)
        if i.brake_chopper and i.brake_chopper.longest_on_s
        else None,
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
        vector=d.vector.spec() if d.method == "vector" else None,
    )
