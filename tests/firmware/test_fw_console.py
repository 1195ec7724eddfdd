"""The console: commands, replies, ranges, bad input."""

from __future__ import annotations

import pytest

from fluxlock.firmware import DriveSpec
from tests.firmware.firmware_bench import Bench


@pytest.fixture
def ready() -> Bench:
    """A drive that is ready."""
    bench = Bench(drive=DriveSpec(accel_rpm_per_s=150_000.0, current_limit_a=22.5))
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
    assert lines[-2:] == ["overruns 3 5", "ok"]
    ready.fw.command("set irq_load 2500")
    assert ready.get("timer.load_period") == 2500
    assert ready.get("irq.enable") & 0x80
    assert ready.get("irq.route") == 0x03


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
    assert ready.fw.telemetry()["freewheel_count"] == 2
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
