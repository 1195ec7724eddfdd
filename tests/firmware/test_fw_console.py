# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""The console: commands, replies, ranges, bad input."""

from __future__ import annotations

import random
import re

import pytest

from fluxlock.base.paths import ROOT
from tests.firmware import machines
from tests.firmware.firmware_bench import Bench


@pytest.fixture
def ready() -> Bench:
    """A drive that is ready."""
    bench = Bench(drive=machines.drive(accel_rpm_per_s=150_000.0, current_limit_a=22.5))
    assert bench.until_state("ready", 0.1)
    return bench


def test_every_reply_ends_with_ok_or_error(ready: Bench) -> None:
    """All commands of the help text answer, the last line is `ok`.

    Verifies: FW-23
    """
    commands = ready.fw.command("help")[0].split(" | ")
    assert [c.split()[0] for c in commands] == [
        *("help", "status", "get", "set", "start", "stop", "faults", "clear", "stats"),
    ]
    for command in ("help", "status", "get", "faults", "stats", "get duty"):
        assert ready.fw.command(command)[-1] == "ok", command


@pytest.mark.parametrize(
    ("line", "reply"),
    [
        ("frobnicate", "error: unknown command, try help"),
        ("set", "error: set name value"),
        ("set speed_rpm", "error: set name value"),
        ("set speed_rpm 1 2 3", "error: too many words"),
        ("set nonsense 1", "error: unknown name"),
        ("set duty 1", "error: cannot be set"),
        ("get nonsense", "error: unknown name"),
        ("set speed_rpm abc", "error: value out of range"),
        ("set speed_rpm 100001", "error: value out of range"),
        ("set speed_rpm 99999999999", "error: value out of range"),
        ("set speed_rpm -100001", "error: value out of range"),
        ("set accel_rpm_s 0", "error: value out of range"),
        ("set current_limit_a -1", "error: value out of range"),
        ("set current_limit_a 50.001", "error: value out of range"),
        ("set carrier_hz 1", "error: value out of range"),
        ("set carrier_hz 1000000", "error: value out of range"),
        ("set commutation XSC", "error: value out of range"),
        ("set pattern 4", "error: value out of range"),
        ("set advance_q16 32768", "error: value out of range"),
        ("set freeze 2", "error: value out of range"),
        ("set irq_load 10", "error: value out of range"),
        ("start", "error: speed_rpm is 0"),
        ("stop later", "error: stop [now]"),
        ("clear", "error: no fault to clear"),
        ("x" * 200, "error: line too long"),
    ],
)
def test_bad_input_changes_nothing(ready: Bench, line: str, reply: str) -> None:
    """One clear message, and every setting as before.

    Verifies: FW-23
    """
    before = [x for x in ready.fw.command("get") if not x.startswith(("idc", "motor", "idle"))]
    assert ready.fw.command(line) == [reply]
    ready.run(0.001)
    assert [x for x in ready.fw.command("get") if not x.startswith(("idc", "motor", "idle"))] == before


@pytest.mark.parametrize(
    ("name", "value", "shown"),
    [
        ("speed_rpm", "-45000", "-45000"),
        ("accel_rpm_s", "123456", "123456"),
        ("advance_q16", "-1092", "-1092"),
        ("commutation", "RSC", "RSC"),
        ("commutation", "1", "NSC"),
        ("pattern", "H_PWM-L_ON", "H_PWM-L_ON"),
        ("carrier_hz", "20000", "20000"),
        ("sync_rect", "1", "1"),
        ("current_limit_a", "12.5", "12.500"),
        ("dc_limit_a", "7.25", "7.250"),
        ("freeze", "1", "1"),
        ("balance", "vertical", "vertical"),
        ("advance_speed_q16", "6553", "6553"),
        ("advance_current_q16", "-3276", "-3276"),
        ("catch", "0", "0"),
        ("brake_limit_a", "7.5", "7.500"),
        ("linearity", "1", "1"),
        ("current_loop", "1", "1"),
        ("torque_mnm", "-3.25", "-3.250"),
        ("current_ma", "-1500", "-1500"),
        ("zcd_method", "averaged", "averaged"),
        ("zcd_method", "0", "first"),
        ("zcd_source", "star_point", "star_point"),
        ("zcd_source", "2", "mean"),
        ("compute_back", "1", "1"),
        ("correction_a", "1", "1"),
        ("irq_load", "3000", "3000"),
    ],
)
def test_settings_read_back(ready: Bench, name: str, value: str, shown: str) -> None:
    """What is set is shown by get.

    Verifies: FW-23
    """
    assert ready.fw.command(f"set {name} {value}") == ["ok"]
    assert ready.fw.command(f"get {name}") == [f"{name} {shown}", "ok"]


def test_settings_from_the_parameters(ready: Bench) -> None:
    """After boot the settings are those of the parameter block.

    Verifies: FW-23
    """
    shown = dict(line.split(" ", 1) for line in ready.fw.command("get")[:-1])
    assert shown["accel_rpm_s"] == "150000"
    assert shown["current_limit_a"] == "22.500"
    assert shown["vdc_v"] == "25.000"
    assert shown["carrier_hz"] == "40000"
    assert shown["commutation"] == "CSC"


def test_bytes_before_boot_are_not_lost(ready: Bench) -> None:
    """A line received while the core boots is answered without another byte to announce it.

    Verifies: FW-23
    """
    line = b"get commutation\n"
    ready.fw.lib.fl_host_uart_send(line, len(line))
    ready.fw.boot()
    ready.fw.poll()
    assert ready.fw.replies() == ["commutation CSC", "ok"]


def test_line_ends_and_blanks(ready: Bench) -> None:
    """CR, LF and both end a line; blanks do not matter; empty lines are not answered.

    Verifies: FW-23
    """
    assert ready.fw.command("  set   freeze\t1 \r") == ["ok"]
    assert ready.fw.command("\r\n\r\n get freeze\r") == ["freeze 1", "ok"]


def test_settings_reach_the_registers_while_running() -> None:
    """Pattern, commutation, advance and carrier take effect at the next control tick.

    Verifies: FW-23, FW-24
    """
    bench = Bench()
    bench.start(60_000)
    bench.run(0.6)
    for line in ("commutation RSC", "pattern H_PWM-L_ON", "advance_q16 -500", "carrier_hz 20000"):
        assert bench.fw.command(f"set {line}") == ["ok"]
    bench.step()
    control = bench.get("pwm.control")
    assert (control >> 4 & 3, control >> 8 & 3) == (0, 1)
    assert bench.get("comm.delay") >> 16 == 0x10000 - 500
    assert bench.get("pwm.period") == 2500
    assert bench.get("timer.update") & 2


def test_statistics_and_load(ready: Bench) -> None:
    """`stats` lists the measured handlers and overruns; the load generator's period is written.

    Verifies: FW-24
    """
    ready.put("irq.overrun", (3 << 16) | 5)
    lines = ready.fw.command("stats")
    handlers = {line.split()[1]: [int(x) for x in line.split()[2:]] for line in lines if line.startswith("isr")}
    assert {"control", "control_entry", "uart"} <= handlers.keys()
    minimum, mean, maximum, count = handlers["control_entry"]
    assert minimum <= mean <= maximum == 20
    assert count == ready.ticks
    assert lines[-4:] == ["overruns 3 5", "bytes_lost 0 0 0", "lines_refused 0 0 0", "ok"]
    ready.fw.command("set irq_load 2500")
    assert ready.get("timer.load_period") == 2500
    assert ready.get("irq.enable") & 0x80
    assert ready.get("irq.route") == 0x03


LOST = "error: bytes lost"
# Settings whose value tells which of two lines was carried out.
SETTINGS = ("advance_q16", "advance_speed_q16", "advance_current_q16", "accel_rpm_s", "current_ma")


def send(bench: Bench, text: str) -> None:
    data = text.encode("latin-1")
    assert bench.fw.lib.fl_host_uart_send(data, len(data)) == len(data)


def answers(bench: Bench) -> list[str]:
    """Last line of each reply since they were last taken."""
    return [line for line in bench.fw.replies() if line == "ok" or line.startswith("error: ")]


@pytest.mark.parametrize(
    ("before", "ends", "begun", "after", "expected"),
    [
        # Inside of a line; its end; its end and the next one's begin; two whole lines; all between two that are whole.
        ("set advance_q16 1", 0, True, "7\n", [LOST]),
        ("set advance_q16 1", 1, False, "", [LOST]),
        ("set advance_q16 1", 1, True, "17\n", [LOST, LOST]),
        ("get freeze\n", 2, False, "get catch\n", ["freeze 0", "ok", LOST, LOST, "catch 1", "ok"]),
        ("get freeze\r", 0, False, "get catch\n", ["freeze 0", "ok", "catch 1", "ok"]),
        ("get freeze\n", 0, True, "\n", ["freeze 0", "ok", LOST]),
        ("x" * 100, 0, True, "\n", [LOST]),
    ],
)
def test_marks_of_lost_bytes(
    ready: Bench, before: str, ends: int, begun: bool, after: str, expected: list[str]
) -> None:
    """The line that a mark of the UART hurts is answered in its place and not carried out, its neighbours are.

    Verifies: FW-53
    """
    send(ready, before)
    ready.fw.lib.fl_host_uart_lose(ends, begun)
    send(ready, after)
    ready.fw.poll()
    assert ready.fw.replies() == expected
    ready.run(0.001)
    assert ready.fw.command("get advance_q16") == ["advance_q16 0", "ok"], "carried out although bytes are missing"
    lost = expected.count(LOST)
    assert ready.fw.command("stats")[-2] == f"lines_refused {lost} 0 0"


@pytest.mark.parametrize("seed", range(4))
def test_lines_behind_a_full_ring(ready: Bench, seed: int) -> None:
    """Bursts longer than the ring: one answer a line in the order of the lines, each carried out whole or refused.

    Verifies: FW-53
    """
    draw = random.Random(seed)
    print(f"seed {seed}")
    refused = done = 0
    for _ in range(30):
        value = {name: ready.fw.command(f"get {name}")[0].split()[1] for name in SETTINGS}
        sent: list[tuple[str, str | None, str]] = []
        burst = ""
        for _ in range(draw.randint(1, 30)):
            name, number = draw.choice(SETTINGS), str(draw.randint(1, 20_000))
            setting = draw.random() < 0.5
            sent.append((name, number if setting else None, f"set {name} {number}" if setting else f"get {name}"))
            burst += " " * draw.randint(0, 8) + sent[-1][2] + draw.choice(["\n", "\r", "\r\n", "\n\n  \n"])
        send(ready, burst)
        ready.fw.poll()
        replies = iter(ready.fw.replies())
        for name, number, line in sent:
            reply = next(replies, "none")
            if reply == LOST:
                refused += 1
                continue
            done += 1
            if number is None:
                assert reply == f"{name} {value[name]}", line
                reply = next(replies)
            else:
                value[name] = number
            assert reply == "ok", line
        assert next(replies, None) is None, "more answers than lines"
        for name in SETTINGS:
            assert ready.fw.command(f"get {name}") == [f"{name} {value[name]}", "ok"]
    assert refused > 50 and done > 100
    assert ready.fw.command("stats")[-2] == f"lines_refused {refused} 0 0"


def test_a_lost_line_is_told_without_another_byte(ready: Bench) -> None:
    """Nobody has to send more to hear that a line was lost; what comes then is whole again.

    Verifies: FW-53
    """
    send(ready, "get freeze\n" * 23 + "x" * 30 + "\n")
    ready.fw.poll()
    assert answers(ready) == ["ok"] * 23 + [LOST]
    assert ready.fw.command("get freeze") == ["freeze 0", "ok"]


def test_counts_of_lost_bytes_and_refused_lines(ready: Bench) -> None:
    """What the FIFO has lost, wrong stop bits, what the ring has lost; lines refused by each reason.

    Verifies: FW-53
    """
    ready.put("uart.status", 7 << 16 | 3 << 8)
    send(ready, "x" * 300 + "\n")
    ready.fw.poll()
    assert ready.fw.replies() == [LOST]
    assert ready.fw.command("y" * 80) == ["error: line too long"]
    assert ready.fw.command("get freeze*00") == [with_checksum("error: wrong checksum")]
    assert ready.fw.command("stats")[-3:-1] == ["bytes_lost 3 7 45", "lines_refused 1 1 1"]


def crc8(text: str) -> int:
    """Remainder of the text times x^8 by x^8 + x^2 + x + 1, by long division."""
    rest = int.from_bytes(text.encode(), "big") << 8
    while rest.bit_length() > 8:
        rest ^= 0x107 << rest.bit_length() - 9
    return rest


def with_checksum(text: str) -> str:
    return f"{text}*{crc8(text):02X}"


def test_checksums_of_lines_and_replies(ready: Bench) -> None:
    """A line with a right checksum is carried out, and each line of its reply has one.

    Verifies: FW-54
    """
    assert crc8("123456789") == 0xF4  # check value of CRC-8/SMBUS
    page = (ROOT / "docs" / "reference" / "console.md").read_text()
    examples = re.findall(r"^(?:> )?(\S.*)\*([0-9A-F]{2})$", page, re.MULTILINE)
    assert len(examples) == 3 and all(f"{crc8(text):02X}" == digits for text, digits in examples)
    assert ready.fw.command(with_checksum("set freeze 1")) == [with_checksum("ok")]
    assert ready.fw.command(with_checksum("get freeze")) == [with_checksum("freeze 1"), with_checksum("ok")]
    assert ready.fw.command(with_checksum(" frobnicate  ")) == [with_checksum("error: unknown command, try help")]
    assert ready.fw.command("get freeze") == ["freeze 1", "ok"], "a line without one gets none"
    for command in ("help", "get", "stats", "faults"):
        reply = ready.fw.command(with_checksum(command))
        assert len(reply) > 1
        for line in reply:
            assert line == with_checksum(line[:-3])
    longest = "get freeze".rjust(76)
    assert ready.fw.command(with_checksum(longest))[-1] == with_checksum("ok")
    assert ready.fw.command(with_checksum(" " + longest)) == [with_checksum("error: line too long")]
    assert ready.fw.command("*00") == [with_checksum("error: unknown command, try help")]


def test_wrong_checksums_change_nothing(ready: Bench) -> None:
    """Another byte in its place, two equal ones left out, digits that are none: refused by name.

    Verifies: FW-54
    """
    draw = random.Random(1)
    print("seed 1")
    right = with_checksum("set accel_rpm_s 60001")
    wrong = [right.replace("000", "0"), right.lower(), right[:-1], right + " ", right + "0", "*", "**", right + right]
    while len(wrong) < 500:
        at = draw.randrange(len(right) - 3)
        other = chr(draw.randrange(0x20, 0x7F))
        if other not in (right[at], "*"):
            wrong.append(right[:at] + other + right[at + 1 :])
    for line in wrong:
        if line != right:
            assert ready.fw.command(line) == [with_checksum("error: wrong checksum")], line
    assert ready.fw.command("get accel_rpm_s") == ["accel_rpm_s 150000", "ok"]
    assert ready.fw.command(right) == [with_checksum("ok")]
    assert ready.fw.command("get accel_rpm_s") == ["accel_rpm_s 60001", "ok"]


def test_refused_lines_do_not_count_as_heard() -> None:
    """Noise does not keep a drive alive whose host is silent.

    Verifies: FW-48, FW-53
    """
    bench = Bench()
    bench.start(60_000)
    bench.run(0.6)
    assert bench.fw.command("set command_timeout_ms 20") == ["ok"]
    for _ in range(30):
        bench.run(0.001)
        bench.fw.lib.fl_host_uart_lose(1, False)
        bench.fw.poll()
        assert bench.fw.replies() == [LOST]
    assert bench.fw.command("get fault") == ["fault command_timeout", "ok"]


def test_freewheel_angle(ready: Bench) -> None:
    """Times over the measured sector give degrees; open ones count as 60, a tick without one changes nothing.

    Verifies: FW-33
    """
    assert ready.fw.command("get freewheel_deg") == ["freewheel_deg none", "ok"]
    ready.start(30_000)
    ready.run(0.5)
    assert ready.get("freewheel.control") == 1
    sector = ready.get("comm.snap_period") / 6

    def tick(total: float, longest: int, entered: int, count: int, open_ones: int) -> list[float]:
        ready.put("freewheel.snap_sum", round(total))
        ready.put("freewheel.snap_max", longest | entered << 24)
        ready.put("freewheel.snap_count", count | open_ones << 16)
        ready.step()
        return [float(word) for word in ready.fw.command("get freewheel_deg")[0].split()[1:]]

    assert tick(sector * 0.5, round(sector * 0.3), 4, 2, 0) == pytest.approx([15.0, 18.0, 5.0], abs=0.2)
    assert ready.fw.telemetry().freewheel.count == 2
    assert tick(0, 0, 0, 0, 0) == pytest.approx([15.0, 18.0, 5.0], abs=0.2)
    assert tick(sector * 0.5, 0xFFFFFF, 0, 1, 1) == pytest.approx([45.0, 60.0, 1.0], abs=0.2)


def test_idle_time_leaves_out_what_interrupts(ready: Bench) -> None:
    """Rounds of the main loop count as the last quiet one, whatever an interrupt adds to them.

    Verifies: FW-24
    """
    now = 1_000_000

    def poll(*rounds: int) -> None:
        nonlocal now
        for cycles in rounds:
            now += cycles
            ready.put("sys.time_now", now)
            ready.fw.poll()

    def idle() -> tuple[int, int]:
        nonlocal now
        now += 310
        ready.put("sys.time_now", now)
        first, second = ready.fw.command("get idle")[0].split()[1:]
        return int(first), int(second)

    poll(0, 290, 300, 310)
    before, start = idle()
    assert start == now
    poll(310, 1700, 305, 2500)
    after, end = idle()
    assert end - start == 310 + 1700 + 305 + 2500 + 310
    assert after - before == 310 + 310 + 305 + 305 + 310
