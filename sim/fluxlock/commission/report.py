# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""What a measurement gives a user: motor file, table, gains, figure."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from fluxlock.commission.plate import NamePlate
from fluxlock.config import Inverter, Motor
from fluxlock.config.motor import RPM_PER_RAD_S
from fluxlock.results.verdict import Verdict
from fluxlock.theory.six_step.plots import finish

# Below this difference over the mean the file states one number: for the phases, for the axes.
PHASE_SPREAD, SALIENCY = 0.03, 0.05
# What a measurement may be off the plant's value, by the name of the quantity, per cent.
VOUCHED_PERCENT = {"R winding + switch, mean": 3.0, "L d": 3.0, "L q": 3.0, "flux": 3.0, "inertia": 10.0}

FILE_PERCENT = 20.0  # what a data sheet may be off


@dataclass(frozen=True)
class Quantity:
    """A line of the table. true: of the plant, where there is one."""

    name: str
    unit: str
    factor: float  # from SI to the unit
    measured: float
    true: float | None = None

    @property
    def error_percent(self) -> float | None:
        """Measured less true over true."""
        return None if not self.true else 100.0 * (self.measured / self.true - 1.0)


def quantities(values: Mapping[str, Any], on_resistance_ohm: float, plant: Motor | None = None) -> list[Quantity]:
    """Everything that was measured, beside the plant's values."""
    r = values["resistance_ohm"]
    true_r = [x + on_resistance_ohm for x in plant.resistance_ohm] if plant else []
    load = plant.load if plant else None
    ld = plant.mean_inductance_h if plant and not plant.inductance_q_h else plant.inductance_h[0] if plant else None
    lq = (plant.inductance_q_h or ld) if plant else None
    psi = sum(plant.psi_vs) / 3 * plant.emf_fundamental if plant else None
    true_drag: tuple[float | None, ...] = (None,) * 3
    if load:
        true_drag = (load.coulomb_nm, load.viscous_nm_s_per_rad, load.fan_nm_s2_per_rad2)
    rows = [
        Quantity("R winding + switch, mean", "mOhm", 1e3, sum(r) / 3, sum(true_r) / 3 if true_r else None),
        *(
            Quantity(f"R winding + switch, {x}", "mOhm", 1e3, r[k], true_r[k] if true_r else None)
            for k, x in enumerate("ABC")
        ),
        Quantity("L d", "uH", 1e6, values["ld_h"], ld),
        Quantity("L q", "uH", 1e6, values["lq_h"], lq),
        Quantity("flux", "mV s", 1e3, values["psi_vs"], psi),
        Quantity("dead-time voltage of a leg", "mV", 1e3, values["dead_v"]),
        Quantity("inertia", "1e-6 kg m^2", 1e6, values["inertia_kgm2"], plant.inertia_kgm2 if plant else None),
        Quantity("friction, Coulomb", "mN m", 1e3, values["coulomb_nm"], true_drag[0]),
        Quantity("friction, viscous", "uN m s", 1e6, values["viscous_nm_s_per_rad"], true_drag[1]),
        Quantity("friction, fan", "nN m s^2", 1e9, values["fan_nm_s2_per_rad2"], true_drag[2]),
    ]
    top = max(values["run"]["omega_m"])
    drag = values["coulomb_nm"] + values["viscous_nm_s_per_rad"] * top + values["fan_nm_s2_per_rad2"] * top * top
    return [
        *rows,
        Quantity(
            f"friction at {top * RPM_PER_RAD_S:.0f} r/min",
            "mN m",
            1e3,
            drag,
            load.torque_nm(top * RPM_PER_RAD_S) if load else None,
        ),
    ]


def verdict(found: Sequence[Quantity]) -> Verdict:
    """Whether the measurement can be vouched for: what the plant has is found within VOUCHED_PERCENT."""
    lines = [
        f"{q.name} is {q.measured * q.factor:.4g} {q.unit}, the plant has {(q.true or 0.0) * q.factor:.4g} "
        f"({q.error_percent:+.1f} %, permitted {VOUCHED_PERCENT[q.name]:g} %)"
        for q in found
        if q.name in VOUCHED_PERCENT and q.error_percent is not None
        if not abs(q.error_percent) <= VOUCHED_PERCENT[q.name]
    ]
    judged = {q.name: q.error_percent for q in found if q.name in VOUCHED_PERCENT and q.error_percent is not None}
    text = ", ".join(f"{name} {error:+.2f} %" for name, error in judged.items())
    return Verdict(
        not lines, lines or [f"off the plant: {text}" if judged else "measured; there is no plant to compare"]
    )


def beside_the_file(found: Sequence[Quantity]) -> Verdict:
    """Of a real machine: what was measured, and what of it the file of its name plate states otherwise."""
    off = [
        f"{q.name} {q.error_percent:+.0f} %"
        for q in found
        if q.name in VOUCHED_PERCENT and q.error_percent is not None and abs(q.error_percent) > FILE_PERCENT
    ]
    text = f"off its file by more than {FILE_PERCENT:g} %: {', '.join(off)}" if off else "as its file says"
    return Verdict(True, [f"measured; {text}"])


@dataclass(frozen=True)
class Gain:
    """A gain of a controller."""

    name: str
    unit: str
    value: float


def gains(values: Mapping[str, Any], plate: NamePlate, current_hz: float, speed_hz: float) -> list[Gain]:
    """Gains of continuous PI controllers by bandwidth; the drive computes its own from the motor file."""
    w, s = 2.0 * math.pi * current_hz, 2.0 * math.pi * speed_hz
    torque = 1.5 * plate.pole_pairs * values["psi_vs"]
    k_p = s * values["inertia_kgm2"] / torque
    return [
        Gain(f"current, {current_hz:g} Hz: k_p d", "V/A", w * values["ld_h"]),
        Gain(f"current, {current_hz:g} Hz: k_p q", "V/A", w * values["lq_h"]),
        Gain(f"current, {current_hz:g} Hz: k_i", "V/(A s)", w * sum(values["resistance_ohm"]) / 3),
        Gain(f"speed, {speed_hz:g} Hz: k_p", "A s/rad", k_p),
        Gain(f"speed, {speed_hz:g} Hz: k_i", "A/rad", k_p * s / 4.0),
    ]


def _number(value: float) -> str:
    text = f"{value:.4g}"
    return text if any(c in text for c in ".e") else f"{text}.0"


def _phases(values: Sequence[float]) -> str:
    mean = sum(values) / len(values)
    if max(values) - min(values) <= PHASE_SPREAD * mean:
        return _number(mean)
    return f"[{', '.join(map(_number, values))}]"


def motor_file(values: Mapping[str, Any], plate: NamePlate, inverter: Inverter, origin: str) -> str:
    """Text of the motor file. origin: how it was measured, a line."""
    winding = [x - inverter.on_resistance_ohm for x in values["resistance_ohm"]]
    ld, lq = values["ld_h"], values["lq_h"]
    salient = abs(lq - ld) > SALIENCY * (ld + lq) / 2
    dead_mv = 1e3 * values["dead_v"]
    lines = [
        f"# {origin}",
        "# From the name plate: pole pairs, rated current, highest speed. Not measured: shape of the EMF.",
        f"name = {json.dumps(plate.name + ', measured')}",
        f"pole_pairs = {plate.pole_pairs}",
        f"resistance_ohm = {_phases(winding)}  # DC at three currents along each phase axis, less "
        f"{1e3 * inverter.on_resistance_ohm:g} mOhm of the switch; a leg loses {dead_mv:.0f} mV by its dead time",
    ]
    if salient:
        lines += [
            f"inductance_h = {_number(ld)}  # d axis: triangles of current at rest",
            f"inductance_q_h = {_number(lq)}  # q axis, likewise",
        ]
    else:
        lines.append(f"inductance_h = {_number((ld + lq) / 2)}  # triangles of current at rest, mean of d and q")
    lines += [
        f"psi_vs = {_number(values['psi_vs'])}  # EMF over speed, driven",
        'emf = "sinusoidal"',
        f"inertia_kgm2 = {_number(values['inertia_kgm2'])}  # torque against change of speed, all that turns",
        f"rated_current_a = {_number(plate.rated_current_a)}",
        f"max_speed_rpm = {_number(plate.max_speed_rpm)}",
    ]
    fan = values["fan_nm_s2_per_rad2"] * (plate.max_speed_rpm / RPM_PER_RAD_S) ** 2
    load = [
        (f"fan_torque_nm = {_number(fan)}\nfan_speed_rpm = {_number(plate.max_speed_rpm)}", fan),
        (f"viscous_nm_s_per_rad = {_number(values['viscous_nm_s_per_rad'])}", values["viscous_nm_s_per_rad"]),
        (f"coulomb_nm = {_number(values['coulomb_nm'])}", values["coulomb_nm"]),
    ]
    found = [text for text, value in load if value > 0.0]
    if found:
        reached = max(values["run"]["omega_m"]) * RPM_PER_RAD_S
        lines += ["", f"[load]  # as it was, up to {reached:.0f} r/min", *found]
    return "\n".join(lines) + "\n"


def figure(values: Mapping[str, Any], title: str) -> Figure:
    """Voltage over current of the three axes, what is left of it; EMF over speed; torque and speed of the run."""
    page = Figure(figsize=(11, 7), layout="constrained")
    page.suptitle(title, fontsize=11)
    (left, right), (emf, torque) = page.subplots(2, 2)
    for name, line in zip("ABC", values["lines"], strict=True):
        i, u = np.array(line["current_a"]), np.array(line["voltage_v"])
        reach = np.array([0.0, max(i)])
        points = left.plot(i, u, "o", label=f"axis {name}: {1e3 * line['slope_ohm']:.2f} mOhm")[0]
        fit = line["intercept_v"] + line["slope_ohm"] * reach
        left.plot(reach, fit, "-", color=points.get_color(), linewidth=1)
    left.legend(fontsize=8)
    finish(left, "current along the axis / A", "voltage / V")
    place = np.arange(3)
    for k, axis in enumerate("dq"):
        right.bar(place + 0.35 * k, [1e6 * x[k] for x in values["axes_h"]], 0.33, label=axis)
    right.set_xticks(place + 0.175, ["axis A", "axis B", "axis C"])
    right.legend(fontsize=8)
    finish(right, "", "inductance / uH")
    run = values["run"]
    omega = np.array(run["omega"])
    emf.plot(omega, run["magnet_emf_v"], ".", markersize=3, label="|EMF| of the magnet")
    reach = np.array([0.0, omega.max()])
    emf.plot(reach, values["psi_vs"] * reach, "-", linewidth=1, label=f"{1e3 * values['psi_vs']:.4g} mV s")
    emf.legend(fontsize=8)
    finish(emf, "electrical speed / rad/s", "EMF / V")
    time, speed = 1e3 * np.array(run["time_s"]), np.array(run["omega_m"])
    torque.plot(time, 1e3 * np.array(run["torque_nm"]), ".", markersize=3, label="from current and flux angle")
    gained = values["inertia_kgm2"] * np.gradient(speed, 1e-3 * time)
    drag = values["coulomb_nm"] + values["viscous_nm_s_per_rad"] * speed + values["fan_nm_s2_per_rad2"] * speed**2
    torque.plot(time, 1e3 * (gained + drag), "-", linewidth=1, label="J dw/dt + friction")
    torque.plot(time, 1e3 * drag, "--", linewidth=1, label="friction")
    torque.legend(fontsize=8)
    finish(torque, "time / ms", "torque / mN m")
    return page


def write_motor(path: Path, text: str) -> Motor:
    """Write the file and read it back."""
    from fluxlock.config import load_motor

    path.write_text(text, encoding="utf-8")
    return load_motor(path)
