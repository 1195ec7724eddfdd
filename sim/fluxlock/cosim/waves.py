# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""View of an FST: the chip's signals in groups, for GTKWave (save file) and Surfer (command file)."""

from __future__ import annotations

import re
from collections.abc import Collection, Mapping, Sequence
from pathlib import Path

from fluxlock.cosim.chip import TOP

WAVE_FILE = "waves.fst"  # written by the simulator main
GTKWAVE_FILE = "waves.gtkw"
SURFER_FILE = "waves.sucl"

# GTKWave's flags of a row. b: binary, d: decimal, x: hexadecimal, c: decimal drawn as a curve, s: the same, signed.
FORMATS = {"b": "28", "d": "24", "x": "22", "c": "8024", "s": "8420"}
CURVE_ROWS = 2  # that a curve gets below its own

SIX_STEP = "g_six_step.u_six_step."
GROUPS_OF_PATH = {"six-step": ("carrier", "crossing", "commutation"), "vector": ("vector",)}


def groups(phases: int, paths: Collection[str]) -> dict[str, tuple[str, ...]]:
    """Groups of rows: format, and name below the top as in the FST. No group of a path that the chip lacks."""
    last = phases - 1
    shown = {
        "carrier": (
            f"c {SIX_STEP}u_pwm.u_carrier.count_o[15:0]",
            f"d {SIX_STEP}u_pwm.u_carrier.last_q[15:0]",
            f"d {SIX_STEP}u_pwm.u_carrier.width_q[15:0]",
            f"b {SIX_STEP}u_pwm.u_carrier.pulse_o",
            "b carrier_start",
        ),
        "gates": (
            f"b req_h[{last}:0]",
            f"b req_l[{last}:0]",
            f"b gate_o[{2 * last + 1}:0]",
            f"b gate_h_o[{last}:0]",
            f"b gate_l_o[{last}:0]",
        ),
        "sampling": (
            "b adc_strobe_o",
            "b adc_valid_i",
            "b sample_valid",
            "d sample_time[31:0]",
            "b sample_pwm.on",
            *(f"s sample.sample[{channel}][17:0]" for channel in range(2 * phases + 1)),  # v a b c, i a b c, vdc
        ),
        "crossing": (
            f"b {SIX_STEP}u_zcd.u_zcd.enable_q",
            f"s {SIX_STEP}u_zcd.u_zcd.rel_q[17:0]",
            f"b {SIX_STEP}u_zcd.u_zcd.counts",
            "b zc_valid",
            "b zc_late",
            "d zc_sector[2:0]",
            "d zc_time[31:0]",
        ),
        "commutation": (
            f"d {SIX_STEP}u_comm.u_timer.mode_q[1:0]",
            f"b {SIX_STEP}sched_valid",
            f"d {SIX_STEP}comm_sched[31:0]",
            f"b {SIX_STEP}comm_valid",
            "b comm_applied",
            "d seq_sector[2:0]",
        ),
        "vector": (
            "b vector_source",
            "b vector_update",
            "b g_vector.u_foc.u_vector.instant",
            "d g_vector.u_foc.u_vector.theta[31:0]",
            "b vector_sync",
            "b vector_deadline",
        ),
        "safety": (
            "b u_safety.enabled",
            "b fault_pin_i",
            "b brake_o",
            "b tripped",
            "b trip_event",
            "b trip_cause.phase_current",
            "b trip_cause.dc_current",
            "b trip_cause.fault_pin",
            "b trip_cause.lost_lock",
            "b trip_cause.over_voltage",
            "b trip_cause.under_voltage",
            "b trip_cause.software",
            "b trip_cause.deadline",
        ),
        "bus": (
            "b irq_control",
            "b irq_deferred",
            "b io_stb",
            "b io_we",
            "b io_ack",
            "x io_adr[29:0]",
            "x io_wdat[31:0]",
            "x io_rdat[31:0]",
            "b tick",
            "b update",
        ),
        "console": (
            "b uart_rx_i",
            "b uart_tx_o",
        ),
        "time": (
            "b clk_i",
            "b rst_i",
            "d now[31:0]",
        ),
    }
    lacking = {group for path, names in GROUPS_OF_PATH.items() if path not in paths for group in names}
    return {group: rows for group, rows in shown.items() if group not in lacking}


def _gtkwave(folder: Path, shown: Mapping[str, Sequence[str]]) -> list[str]:
    # With both paths GTKWave finds the FST from anywhere, also when the folder has moved.
    lines = [f'[dumpfile] "{folder / WAVE_FILE}"', f'[savefile] "{folder / GTKWAVE_FILE}"', "[sst_expanded] 1"]
    for group, signals in shown.items():
        lines += ["@800200", f"-{group}"]
        for signal in signals:
            style, name = signal.split()
            lines += [f"@{FORMATS[style]}", f"{TOP}.{name}"]
            if style in "cs":
                lines += ["@20000", *["-"] * CURVE_ROWS]
        lines += ["@1000200", f"-{group}"]
    return lines


def _surfer(shown: Mapping[str, Sequence[str]]) -> list[str]:
    """Names as Surfer's reader sees them: without range, and an element of an array is `array.[index]`."""
    lines = []
    for group, signals in shown.items():
        lines.append(f"divider_add {group}")
        for signal in signals:
            name = re.sub(r"\[\d+:\d+\]$", "", signal.split()[1])
            lines.append(f"variable_add {TOP}." + re.sub(r"(\w+)\.\1(\[\d+\])$", r"\1.\2", name))
    return lines


def write_view(folder: Path, phases: int, paths: Collection[str]) -> None:
    """Write the viewers' files beside `waves.fst`, of a chip of so many phases with the paths of these methods."""
    shown = groups(phases, paths)
    for name, lines in ((GTKWAVE_FILE, _gtkwave(folder.resolve(), shown)), (SURFER_FILE, _surfer(shown))):
        (folder / name).write_text("\n".join(lines) + "\n")
