# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""What goes wrong on a board around the chip: its clock, the oscillator that watches it, the lock of the PLL."""

from __future__ import annotations

from fluxlock.clock import CLOCK_HZ
from fluxlock.cosim.chip import OSCILLATOR_KHZ
from fluxverify.campaign.faults import FOR_EVER_S, held
from fluxverify.campaign.grid import CLOCK, NONE, PIN, Change, Fault

# To open gates: clocks of the oscillator from the chip's last edge, clocks of the chip from the oscillator's.
STOP_TO_OFF, OSC_STOP_TO_OFF = 62, 102
# A pin is forced from the next clock edge but one on, the log sees a gate at an edge.
SEEN_S = 3 / CLOCK_HZ
CLOCK_OFF_S = STOP_TO_OFF / (1e3 * OSCILLATOR_KHZ) + SEEN_S
OSCILLATOR_OFF_S = OSC_STOP_TO_OFF / CLOCK_HZ + SEEN_S
AT_ONCE_S = SEEN_S
# A stop that its monitor must find, one that none has to, and the time that a PLL takes for another lock.
LONG_S, SHORT_S, LOCK_S = 5e-6, 200e-9, 3e-3
SPAN_S = 7e-3  # no state of the drive is longer in its scenario


def _stands(clock: str, span_s: float, at_s: float = 0.0) -> tuple[Change, ...]:
    """A clock without edges."""
    return held([clock], span_s, 0, at_s)


def _unlocked(span_s: float, at_s: float = 0.0) -> tuple[Change, ...]:
    """The PLL says that it has no lock."""
    return held(["locked_i"], span_s, 0, at_s)


def board_faults() -> list[Fault]:
    """Stops of both clocks, shorter and longer than their monitors wait, and losses of the lock.

    A chip whose clock stands, or that the lock's loss resets, tells no name: gates and enable alone are judged.
    """

    def halted(name: str, changes: tuple[Change, ...], off_s: float) -> Fault:
        return Fault(name, changes, NONE, span_s=SPAN_S, off_s=off_s, silent=True)

    def named(name: str, changes: tuple[Change, ...], off_s: float) -> Fault:
        return Fault(name, changes, CLOCK, must_stop=True, span_s=SPAN_S, off_s=off_s)

    stop = _stands("clk_i", FOR_EVER_S)
    return [
        halted("clock stops", stop, CLOCK_OFF_S),
        named("clock stops for 5 us", _stands("clk_i", LONG_S), CLOCK_OFF_S),
        Fault("clock stops for 200 ns", _stands("clk_i", SHORT_S), CLOCK, span_s=SPAN_S),
        named("oscillator stops", _stands("osc_i", FOR_EVER_S), OSCILLATOR_OFF_S),
        named("oscillator stops for 5 us", _stands("osc_i", LONG_S), OSCILLATOR_OFF_S),
        Fault("oscillator stops for 200 ns", _stands("osc_i", SHORT_S), CLOCK, span_s=SPAN_S),
        halted("both clocks stop, the lock goes", (*stop, *_stands("osc_i", FOR_EVER_S), *_unlocked(FOR_EVER_S)),
               AT_ONCE_S),
        halted("lock goes", _unlocked(FOR_EVER_S), AT_ONCE_S),
        halted("lock goes for 1 clock", _unlocked(0.0), AT_ONCE_S),
        halted("lock and clock go for 3 ms", (*_unlocked(LOCK_S), *_stands("clk_i", LOCK_S)), AT_ONCE_S),
        halted("clock stops for 3 ms, the lock goes for 1 clock meanwhile",
               (*_stands("clk_i", LOCK_S), *_unlocked(0.0, LONG_S)), CLOCK_OFF_S),
        halted("clock stops, the driver reports a fault", (*stop, *held(["fault_pin_i"], FOR_EVER_S, 1)), AT_ONCE_S),
        Fault("driver reports a fault for 1 clock", held(["fault_pin_i"], 0.0, 1), PIN, must_stop=True, span_s=SPAN_S,
              off_s=AT_ONCE_S),
    ]  # fmt: skip
