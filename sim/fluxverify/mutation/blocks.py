# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Blocks whose tests are measured: sources, test bench, tests, goal."""

from __future__ import annotations

from dataclasses import dataclass, field

NONE = 0  # the selector's value for the block as it is


@dataclass(frozen=True)
class Block:
    """One block. Paths are relative to `rtl/`, those of `bench_sources` may begin with `cocotb_tests/`.

    reset: input that is high for the first `reset_clocks` clocks of a proof; its tests begin with it, too.
    """

    name: str
    sources: tuple[str, ...]  # all of them become one flat netlist
    test_modules: tuple[str, ...]
    goal_percent: float
    bench: str = ""  # top module of the tests, if it is not the block
    instance: str = ""  # of the block in it
    bench_sources: tuple[str, ...] = ()  # beside the block's
    parameters: dict[str, int] = field(default_factory=dict)
    left_out: tuple[str, ...] = ()  # tests of the modules that are no tests of the block's behaviour
    environment: dict[str, str] = field(default_factory=dict)
    reset: str = "rst_i"
    reset_clocks: int = 1


_PWM = ("pwm/fl_sequencer.sv", "pwm/fl_pwm_state.sv", "safety/fl_gate_guard.sv", "cocotb_tests/pwm/fl_pwm_chain.sv")
_ZCD = ("fl_asin_pkg", "fl_angle_time", "fl_interpolator", "fl_crossing_time", "fl_zcd")

# fl_board is not here: its tests look at the chip's stand-in and the monitors by name, and a flat netlist has neither.
# Broken copies of its gate path stand in tests/formal/test_safety_proofs.py.
BLOCKS = {
    block.name: block
    for block in (
        Block(
            name="fl_gate_guard",
            sources=("safety/fl_gate_guard.sv",),
            test_modules=("cocotb_tests.safety.test_fl_gate_guard",),
            goal_percent=95.0,
            parameters={"Phases": 3},
            left_out=("assertion_is_alive",),  # forces registers; assertions are not part of the netlist
            environment={"GUARD_SEED": "3", "GUARD_POLARITY": "0"},
        ),
        Block(
            name="fl_trip",
            sources=("common/fl_sync.sv", "safety/fl_trip.sv"),
            test_modules=("cocotb_tests.safety.test_fl_trip", "cocotb_tests.safety.test_active_short"),
            goal_percent=95.0,
            bench="fl_safety_chain",
            instance="u_trip",
            bench_sources=("safety/fl_gate_guard.sv", "cocotb_tests/safety/fl_safety_chain.sv"),
            parameters={"Phases": 3},
        ),
        Block(
            name="fl_settings_lock",
            sources=("safety/fl_settings_lock.sv",),
            test_modules=("cocotb_tests.safety.test_fl_settings_lock",),
            goal_percent=95.0,
        ),
        Block(
            name="fl_watchdog",
            sources=("safety/fl_watchdog.sv",),
            test_modules=("cocotb_tests.safety.test_fl_watchdog",),
            goal_percent=95.0,
            parameters={"Width": 16},  # every period is run out in full
        ),
        Block(
            name="fl_clock_monitor",
            sources=("common/fl_sync.sv", "safety/fl_clock_monitor.sv"),
            test_modules=("cocotb_tests.safety.test_fl_clock_monitor",),
            goal_percent=95.0,
            left_out=("bad_from_configuration_on",),  # of the first clocks of a simulation, and by name of a register
            # Intervals are run out in full; limits off the powers of two, which other orders of the count would keep.
            parameters={"BeatCycles": 4, "LeastCycles": 6, "MostCycles": 11},
            environment={"MONITOR_SIZES": "4 6 11"},
            reset="hold_i",
            reset_clocks=3,  # through its synchroniser
        ),
        Block(
            name="fl_async_clear",
            sources=("safety/fl_async_clear.sv",),
            test_modules=("cocotb_tests.safety.test_fl_async_clear",),
            goal_percent=95.0,
            parameters={"Stages": 4},  # the most that a board has
            reset="clear_i",
        ),
        Block(
            name="fl_pll_reset",
            sources=("safety/fl_async_clear.sv", "board/fl_pll_reset.sv"),
            test_modules=("cocotb_tests.board.test_fl_pll_reset",),
            goal_percent=95.0,
            parameters={"PulseCycles": 5, "RepeatCycles": 16},  # pulses and pauses are run out in full
            reset="locked_i",  # high: it comes to rest, after the rest of a pulse
            reset_clocks=21,
        ),
        Block(
            name="fl_driver_enable",
            sources=("safety/fl_driver_enable.sv",),
            test_modules=("cocotb_tests.safety.test_fl_driver_enable",),
            goal_percent=95.0,
            # Many edges; with 2 and 3 alone no other order of the count takes as long as the right one.
            parameters={"HalfCycles": 3},
            environment={"HALF_CYCLES": "3"},
        ),
        Block(
            name="fl_brake",
            sources=("safety/fl_brake.sv",),
            test_modules=("cocotb_tests.safety.test_fl_brake",),
            goal_percent=95.0,
            parameters={"LongestWidth": 21},  # every time is run out in full
            left_out=("all_bits_of_the_longest_time_count",),  # sets a register that the netlist need not have
        ),
        Block(
            name="fl_carrier",
            sources=("pwm/fl_carrier.sv",),
            test_modules=("cocotb_tests.pwm.test_fl_carrier", "cocotb_tests.pwm.test_fl_carrier_commutation"),
            goal_percent=85.0,
            bench="fl_pwm_chain",
            instance="u_carrier",
            bench_sources=_PWM,
        ),
        Block(
            name="fl_leg_carrier",
            sources=("pwm/fl_leg_carrier.sv",),
            test_modules=("cocotb_tests.pwm.test_fl_leg_carrier",),
            goal_percent=85.0,
            parameters={"Phases": 3},
        ),
        Block(
            name="fl_zcd",
            sources=tuple(f"zcd/{name}.sv" for name in _ZCD),
            test_modules=tuple(
                f"cocotb_tests.zcd.{name}" for name in ("test_fl_zcd", "test_fl_zcd_methods", "test_fl_zcd_limits")
            ),
            goal_percent=85.0,
            parameters={"Phases": 3},
            # Long comparisons of the methods; average_is_the_mean and wait_ends_at_its_clock check each crossing.
            left_out=("averaging_beats_interpolation", "averaging_waits_no_longer"),
        ),
    )
}
