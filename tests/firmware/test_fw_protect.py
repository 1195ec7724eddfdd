# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Slow protection: I²t, sum of the currents, stuck channels, silent console; alone and in the drive on the host."""

from __future__ import annotations

import itertools
import math
import random
import re

import pytest

from fluxlock.config import Scenario
from fluxlock.config.inverter import BrakeChopper, SafeState
from fluxlock.firmware.binding import new
from fluxlock.headers import CData
from fluxlock.native import averaged_motor as am
from tests.firmware import machines
from tests.firmware.firmware_bench import INVERTER_1, Bench, fault_of


@pytest.mark.parametrize("ratio", [1.1, 1.5, 2.0, 3.0])
def test_overload_time(ratio: float, lib: CData) -> None:
    """Constant current above the rated one: too hot after 3 T / (ratio² - 1), from cold.

    Verifies: FW-45
    """
    rated, ticks = 20_000, 1000
    heat = new("overload_t")
    settings = new("overload_settings_t", rated_i_q17=rated, ticks=ticks)
    current = round(ratio * rated)
    steps = 0
    while not lib.overload_step(heat, settings, current, 4):
        steps += 1
        assert steps < 100_000
    assert 4 * steps == pytest.approx(3 * ticks / (ratio**2 - 1), abs=8)


def test_overload_follows_the_integral(lib: CData) -> None:
    """Random currents against the integral in floating point; the rated current for ever, T = 0 for ever.

    Verifies: FW-45
    """
    seed = random.randrange(1 << 32)
    rng = random.Random(seed)
    print(f"seed {seed}")
    for _ in range(20):
        rated, ticks = rng.randrange(1, 1 << 17), rng.randrange(1, 2000)
        heat, settings = new("overload_t"), new("overload_settings_t", rated_i_q17=rated, ticks=ticks)
        model, limit = 0.0, 3.0 * rated**2 * ticks
        for _ in range(3000):
            current = rng.randrange(-(1 << 17), 1 << 17)
            hot = lib.overload_step(heat, settings, current, 1)
            model = max(0.0, model + float(current) ** 2 - float(rated) ** 2)
            assert hot == (model > limit)
            model = min(model, limit)
    heat, settings = new("overload_t"), new("overload_settings_t", rated_i_q17=5000, ticks=10)
    assert not any(lib.overload_step(heat, settings, 5000, 1) for _ in range(10_000))
    settings.ticks = 0
    assert not any(lib.overload_step(heat, settings, 131_071, 1) for _ in range(10_000))


class NoisyBench(Bench):
    """The averaged model with the converter's noise, and channels that may keep a value (q17)."""

    def __post_init__(self) -> None:
        self.rng = random.Random(1)
        self.kept: dict[str, int] = {}
        super().__post_init__()

    def told(self) -> Scenario:
        return self.scenario

    def _snapshot(self) -> None:
        super()._snapshot()
        step = 64  # of the converter
        count = self.get("sense.snap_count")
        for x, name in enumerate(("ia", "ib", "ic")):
            value = signed(self.get("sense.snap_channel", 3 + x)) + round(self.rng.gauss(0, step))
            self.put("sense.snap_channel", self.kept.get(name, value), 3 + x)
        for name in ("vdc", "idc"):
            noise = round(self.rng.gauss(0, step * math.sqrt(count)))
            value = signed(self.get(f"sense.snap_{name}_sum")) + noise
            self.put(f"sense.snap_{name}_sum", self.kept[name] * count if name in self.kept else value)

    def shown(self, name: str) -> int:
        """What a channel shows now, q17."""
        if name in ("vdc", "idc"):
            return signed(self.get(f"sense.snap_{name}_sum")) // self.get("sense.snap_count")
        return signed(self.get("sense.snap_channel", 3 + "abc".index(name[1])))


def signed(word: int) -> int:
    """Two's complement of 32 bits."""
    return word - (1 << 32) if word >> 31 else word


NOISY = machines.inverter(noise_lsb=1.0)


@pytest.mark.parametrize("channel", ["ia", "ib", "ic", "vdc", "idc"])
def test_stuck_channel_is_named(channel: str) -> None:
    """A current channel or vdc that keeps what it shows, while running, is named within 30 ms; gone, the drive starts.

    Verifies: FW-46
    """
    bench = NoisyBench(inverter=NOISY)
    bench.start(30_000)
    bench.run(0.3)
    assert bench.fw.state == "running"
    bench.kept = {channel: bench.shown(channel)}
    assert bench.until_state("fault", 0.03)
    assert fault_of(bench) in ("stuck_channel", "current_sum")
    assert channel not in ("vdc", "idc") or fault_of(bench) == "stuck_channel"
    assert bench.get("safety.guard") & 1 == 0
    bench.kept = {}
    assert bench.fw.command("clear") == ["ok"]
    assert bench.until_state("ready", 0.01)
    bench.start(30_000, 5.0)


@pytest.mark.parametrize("code_q17", [-100_000, 0, 30_000])
def test_wrong_current_does_not_add_up(code_q17: int) -> None:
    """A current channel that shows something else, noise and all, is named by the sum within 20 ms.

    Verifies: FW-47
    """
    bench = NoisyBench(inverter=NOISY)
    bench.start(30_000)
    bench.run(0.3)
    rng = random.Random(2)
    for _ in range(200):
        bench.kept = {"ib": code_q17 + round(rng.gauss(0, 64))}
        bench.run(1e-4)
        if bench.fw.state == "fault":
            break
    assert fault_of(bench) == "current_sum"


def test_no_false_alarm_at_rest() -> None:
    """Ready, with the gates off, with and without a supply; no noise told, a value may stay.

    Verifies: FW-46, FW-47
    """
    bench = NoisyBench(inverter=NOISY)
    assert bench.until_state("ready", 0.1)
    bench.kept = {"vdc": 0}
    bench.run(0.5)
    assert bench.fw.state == "ready"
    quiet = Bench()
    quiet.start(30_000)
    quiet.run(0.5)
    assert quiet.fw.state == "running"


def test_overload_is_named() -> None:
    """More than the rated current for long: overload, not before its time.

    Verifies: FW-45
    """
    bench = Bench(
        motor=machines.motor(overload_s=0.4, rated_current_a=6.616), drive=machines.drive(current_limit_a=20.0)
    )
    bench.start(30_000)
    bench.run(0.3)
    assert bench.fw.state == "running"
    bench.model.m[am.M_FAN] *= 6.0
    before = bench.now
    assert bench.until_state("fault", 1.0)
    assert fault_of(bench) == "overload"
    assert bench.now - before > 0.02


@pytest.mark.parametrize("lines", [True, False])
def test_silent_console(lines: bool) -> None:
    """With a promise of a line every 50 ms a silence opens the gates by name; lines in time keep the drive running.

    The look that sees it comes within 8 ticks of 0.1 ms.

    Verifies: FW-48
    """
    bench = Bench()
    bench.start(30_000)
    assert bench.fw.command("set command_timeout_ms 50") == ["ok"]
    assert bench.fw.command("get command_timeout_ms") == ["command_timeout_ms 50", "ok"]
    for _ in range(10):
        bench.run(0.04)
        assert bench.fw.state == "running"
        bench.fw.command("get state")
        if not lines:
            break
    if not lines:
        bench.run(0.0495)
        assert bench.fw.state == "running"
        bench.run(0.0005 + 0.0009)
        assert (bench.fw.state, fault_of(bench)) == ("fault", "command_timeout")
        bench.fw.command("clear")
        bench.run(0.5)
        assert bench.fw.state == "ready", "without power there is nothing to stop"


def test_silence_by_the_parameter_block() -> None:
    """The scenario's timeout holds from boot on.

    Verifies: FW-48
    """
    bench = Bench(drive=machines.drive(command_timeout_ms=50))
    assert bench.fw.command("get command_timeout_ms") == ["command_timeout_ms 50", "ok"]
    assert bench.until_state("ready", 0.1)
    assert bench.fw.command("set speed_rpm 30000") == ["ok"]
    assert bench.fw.command("start") == ["ok"]
    bench.run(0.049)
    assert bench.fw.state == "starting"
    bench.run(0.002)
    assert (bench.fw.state, fault_of(bench)) == ("fault", "command_timeout")


def test_silence_hides_no_other_fault() -> None:
    """Wrong currents and a silent console found in one look: the fault is that of the currents.

    Verifies: FW-49
    """

    def started() -> NoisyBench:
        bench = NoisyBench(inverter=NOISY)
        bench.start(30_000)
        while bench.ticks < 4000:
            bench.step()
        return bench

    def fault_tick(bench: NoisyBench, wrong_from: float = math.inf) -> int:
        while bench.fw.state == "running":
            bench.kept = {"ib": 30_000} if bench.ticks >= wrong_from else {}
            bench.step()
        return bench.ticks

    wrong = started()
    late = fault_tick(wrong, wrong_from=4000) - 4000
    assert fault_of(wrong) == "current_sum"
    silent = started()
    silent.fw.command("set command_timeout_ms 50")
    end = fault_tick(silent)
    assert fault_of(silent) == "command_timeout"
    assert (end - late) % 8 == 0, "looks are every eighth tick"
    both = started()
    both.fw.command("set command_timeout_ms 50")
    assert fault_tick(both, wrong_from=end - late) == end
    assert fault_of(both) == "current_sum"


@pytest.mark.parametrize(
    ("monitor", "name"),
    [
        (0, "deadline"),
        (1, "watchdog"),
        (2, "watchdog"),
        (4, "settings_changed"),
        (6, "settings_changed"),
        (8, "brake_overload"),
        (16, "no_samples"),
        (24, "no_samples"),
        (32, "converter"),
        (32 | 1, "converter"),
        (32 | 8, "converter"),
        (32 | 16, "no_samples"),
        (32 | 4, "settings_changed"),
        (64, "clock"),
        (64 | 63, "clock"),
    ],
)
def test_deadline_trip_is_told_apart(monitor: int, name: str) -> None:
    """The monitor register names what the deadline trip means.

    Verifies: FW-49
    """
    bench = Bench()
    bench.start(30_000)
    bench.put("safety.monitor", monitor)
    bench.trip(0x80)
    bench.run(0.0003)
    assert (bench.fw.state, fault_of(bench)) == ("fault", name)


@pytest.mark.parametrize("present", [False, True])
def test_converter_fault_is_cleared_when_it_is_gone(present: bool) -> None:
    """A frame that stays bad is the same fault again after clear; one that was is forgotten.

    Verifies: FW-18, FW-49
    """
    bench = Bench()
    assert bench.until_state("ready", 0.1)
    bench.put("safety.monitor", 1 << 5)
    bench.trip(0x80, now=0x80 if present else 0)
    bench.run(0.0003)
    assert (bench.fw.state, fault_of(bench)) == ("fault", "converter")
    assert bench.fw.command("clear") == ["ok"]
    bench.run(0.01)
    assert (bench.fw.state, fault_of(bench)) == (("fault", "converter") if present else ("ready", "none"))


@pytest.mark.parametrize(
    ("channel", "cause", "told"),
    [(0, 1, "ia"), (2, 4, "ic"), (4, 1, "ie"), (6, 2, "idc"), (7, 16, "vdc"), (7, 32, "vdc")],
)
def test_trip_log_names_its_channel(channel: int, cause: int, told: str) -> None:
    """The console tells of a trip which channel the code was of: a phase's current or one of the link.

    Verifies: FW-18
    """
    bench = Bench()
    bench.put("safety.log_cause", 3000 << 16 | channel << 12 | 1 << 8 | cause)
    bench.put("safety.log_time", 123_456)
    (line,) = {line for line in bench.fw.command("faults") if line.startswith("trip ")}
    assert re.fullmatch(rf"trip \w+ clock 123456 channel {told} code 3000", line), line


@pytest.mark.parametrize(("choice", "bit"), [("off", 0), ("short", 1)])
def test_safe_state_is_set_at_boot(choice: SafeState, bit: int) -> None:
    """It reaches the guard's register before the lock.

    Verifies: FW-51
    """
    bench = Bench(inverter=machines.inverter(safe_state=choice))
    assert bench.get("safety.lock") == 0x10CC
    assert bench.get("safety.guard") == bit << 8


@pytest.mark.parametrize("brake", [None, BrakeChopper(on_v=28.0, off_v=27.0, resistance_ohm=1.0, longest_on_s=0.5)])
def test_brake_is_set_at_boot(brake: BrakeChopper | None) -> None:
    """Thresholds, time and age, before the lock; without a brake of the inverter file it is off.

    Verifies: FW-50
    """
    bench = Bench(inverter=machines.inverter(brake_chopper=brake, dc_link_f=1e-3, supply_resistance_ohm=1e-3))
    assert bench.get("safety.lock") == 0x10CC
    assert bench.get("safety.brake") & 1 == (brake is not None)
    assert bench.get("safety.sample_age") == 4 * 50
    assert bench.get("safety.brake_time") == (25_000_000 if brake else 0)
    step = INVERTER_1.sensing.step_v
    level = round(28.0 / step) | round(27.0 / step) << 16 if brake else 0
    assert bench.get("safety.brake_level") == level


def test_watchdog_gets_every_step_and_settings_are_locked() -> None:
    """Every fourth step is told, in order; the lock is closed at boot, after the settings.

    Verifies: FW-49
    """
    bench = Bench()
    assert bench.get("safety.lock") == 0x10CC
    assert bench.get("safety.watchdog") == 8 * 5000
    told = []
    for _ in range(600):
        bench.run(4e-4)
        told.append(bench.get("safety.feed"))
    assert all((b - a) % 256 == 1 for a, b in itertools.pairwise(told))
