# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""What goes wrong in and around a chip: sensors, machine, pins, lines, firmware; what the drive may call it."""

from __future__ import annotations

import random
from collections.abc import Mapping, Sequence
from dataclasses import replace
from itertools import cycle

from fluxlock.can.frame import Frame
from fluxlock.clock import CLOCK_HZ
from fluxlock.config import Scenario
from fluxlock.cosim.broken_code import ILLEGAL, MISALIGNED, OUTSIDE, STACK_END, TO_ITSELF
from fluxlock.plant import channel_names
from fluxverify.campaign.grid import (
    BUS,
    CAN_NODE,
    CHANNEL,
    CLOCK,
    CONVERTER,
    CURRENT,
    EXCEPTION,
    INJECTION,
    LINK,
    LOCK,
    MAIN_LOOP,
    NONE,
    PIN,
    RUN_S,
    SHORTED,
    SLOW_S,
    STACK,
    WATCHDOG,
    Change,
    Drive,
    Fault,
)


def _sensor(channel: str, **arguments: object) -> Change:
    return (0.0, "sensor", {"channel": channel, **arguments})


def _stuck(channel: str, code: int | None = None) -> Change:
    return (0.0, "fault", {"kind": "stuck_channel", "channel": channel, "code": code})


def _fault(kind: str, **arguments: object) -> Change:
    return (0.0, "fault", {"kind": kind, **arguments})


CLEAR = (1e-6, *_fault("clear")[1:])  # a sample later


def _glitch(channel: str, code: int, names: frozenset[str]) -> Fault:
    return Fault(f"{channel} at {code} for 1 us", (_stuck(channel, code), CLEAR), names)


def held(pins: Sequence[str], span_s: float, level: int | None = None, at_s: float = 0.0) -> tuple[Change, ...]:
    """Pins that have a level, None: the wrong one, for a time, or at one clock edge."""
    clocks = max(1, round(span_s * CLOCK_HZ))
    return tuple((at_s, "pin", {"pin": pin, "cycles": clocks, "level": level}) for pin in pins)


# Of the rated torque. The heavy one turns a rotor that only stands aligned backwards, faster and faster.
HEAVY, DRIVING = 4.0, 1.0
# A link voltage as a plausible code, of the supply; a dip, of the supply; a rise beyond the limit, of the full scale.
PLAUSIBLE, DIP, BEYOND = 0.967, 0.4, 1 / 300
FOR_EVER_S = 10.0
SENSED = CHANNEL | CURRENT | LOCK
MACHINE = CURRENT | LOCK | LINK | {"current_sum", "overspeed"}


def _sensor_faults(s: Scenario) -> list[Fault]:
    """Converter channels: all of them stuck and with a glitch, some with another offset or gain."""
    n, sensing = s.motor.phases, s.inverter.sensing
    channels = channel_names(n)
    v, i = channels[:n], channels[n : 2 * n]
    top = (1 << sensing.bits) - 1
    middle = (top + 1) // 2
    vdc = round(PLAUSIBLE * s.inverter.supply_v / sensing.voltage_full_scale_v * (top + 1))
    terminals = [*v, "vsm"]
    given_s = SLOW_S if s.drive.method == "vector" else RUN_S
    return [
        *(Fault(f"{x} stuck", (_stuck(x),), SENSED) for x in terminals),
        *(Fault(f"{x} stuck at {code}", (_stuck(x, code),), SENSED) for x, code in ((v[0], top), (v[1], 0))),
        # What a current that stands still leaves in the sum is seen in the looks that fall far enough from where the
        # true current passes it; in six-step operation these are eight times as close.
        *(Fault(f"{x} stuck", (_stuck(x),), SENSED, must_stop=True, span_s=SLOW_S) for x in i),
        *(Fault(f"{x} stuck at {code}", (_stuck(x, code),), SENSED, must_stop=True, span_s=given_s)
          for x, code in zip(i, cycle((middle, top, 0)), strict=False)),
        Fault("idc stuck", (_stuck("idc"),), SENSED, must_stop=True, span_s=SLOW_S),
        Fault(f"idc stuck at {middle}", (_stuck("idc", middle),), SENSED, must_stop=True, span_s=SLOW_S),
        Fault("vdc stuck", (_stuck("vdc"),), CHANNEL, must_stop=True, span_s=SLOW_S),
        Fault(f"vdc stuck at {vdc}", (_stuck("vdc", vdc),), CHANNEL, must_stop=True, span_s=SLOW_S),
        Fault("vdc stuck at 0", (_stuck("vdc", 0),), LINK, must_stop=True),
        *(Fault(f"{x} offset {lsb:+g} LSB", (_sensor(x, offset_lsb=lsb),), SENSED | LINK)
          for x, lsb in ((i[0], 200.0), (i[1], -400.0), ("idc", 200.0), (v[0], 200.0), ("vdc", -200.0))),
        *(Fault(f"{x} gain {gain:g}", (_sensor(x, gain=gain),), SENSED | LINK)
          for x, gain in ((i[0], 0.7), (i[-1], 1.3), (v[1], 0.8), ("vdc", 1.1), ("idc", 0.7))),
        Fault("noise 30 LSB for 2 ms",
              ((0.0, "sensor", {"noise_lsb": 30.0}), (0.002, "sensor", {"noise_lsb": sensing.noise_lsb})), SENSED),
        Fault(f"{', '.join(v)} at {top} for 1 ms", (*(_stuck(x, top) for x in v), (1e-3, *CLEAR[1:])), SENSED),
        *(_glitch(x, top, SENSED) for x in terminals),
        _glitch(v[0], 0, SENSED),
        *(_glitch(x, top, CURRENT) for x in (*i, "idc")),
        _glitch(i[1], 0, CURRENT),
        *(_glitch("vdc", code, LINK) for code in (top, 0)),
    ]  # fmt: skip


def _machine_faults(s: Scenario) -> list[Fault]:
    """Windings, legs, supply and load."""
    n, supply_v, sensing = s.motor.phases, s.inverter.supply_v, s.inverter.sensing
    legs = "ABCDE"[:n]
    dip_v, rated_nm = DIP * supply_v, s.motor.rated_torque_nm
    rise_v = s.inverter.over_voltage_v + BEYOND * sensing.voltage_full_scale_v
    found = [
        *(Fault(f"phase {leg} open", (_fault("open_phase", phases=(x,)),), MACHINE | CHANNEL | {"open_phase"})
          for x, leg in enumerate(legs)),
        Fault("winding A to star, 20 % of the turns left",
              (_fault("shorted_winding", phases=(0,), turns_fraction=0.2),), MACHINE | SHORTED),
        Fault("windings A, B shorted, 10 % of the turns left",
              (_fault("shorted_winding", phases=(0, 1), turns_fraction=0.1),), MACHINE | SHORTED),
        *(Fault(f"{side} switch {leg} stuck", (_fault(kind, phases=(x,)),), MACHINE | PIN)
          for (x, leg), (side, kind) in zip(
              enumerate(legs), cycle((("upper", "stuck_high"), ("lower", "stuck_low"))), strict=False)),
        Fault(f"supply dips to {dip_v:g} V for 5 ms",
              ((0.0, "supply", {"supply_v": dip_v}), (0.005, "supply", {"supply_v": supply_v, "ramp_s": 1e-3})),
              LINK | CURRENT | LOCK),
        # As a short of the link: a machine that turns drives its current into it through the diodes.
        Fault("supply fails", ((0.0, "supply", {"supply_v": 0.0}),), LINK | CURRENT | LOCK, must_stop=True),
        Fault(f"supply rises to {rise_v:g} V", ((0.0, "supply", {"supply_v": rise_v, "ramp_s": 1e-3}),), LINK,
              must_stop=True),
        Fault("rotor jams", ((0.0, "mechanics", {"mode": "locked"}),), LOCK | CURRENT, turning=True),
        Fault(f"load of {HEAVY:g} times the rated torque", ((0.0, "load", {"constant_nm": HEAVY * rated_nm}),),
              LOCK | CURRENT | {"overload", "overspeed"}),
        Fault(f"load drives with {DRIVING:g} times the rated torque",
              ((0.0, "load", {"constant_nm": -DRIVING * rated_nm}),), LOCK | LINK | CURRENT | {"overspeed"}),
    ]  # fmt: skip
    if n > 3:  # with three, no current is left
        found += [
            Fault(
                f"phases A, {legs[x]} open", (_fault("open_phase", phases=(0, x)),), MACHINE | CHANNEL | {"open_phases"}
            )
            for x in (1, 2)
        ]
    return found


def _pin_faults(s: Scenario) -> list[Fault]:
    """Inputs of the chip besides clock, reset and the sensors' codes: each for 1 us, each port for a clock."""
    hall = LOCK | {"hall_sensor"} if s.motor.hall is not None else NONE
    encoder = LOCK if s.motor.encoder is not None else NONE
    ports: list[tuple[str, int, frozenset[str]]] = [
        ("fault_pin_i", 1, PIN), ("hall_i", 3, hall), ("encoder_i", 3, encoder), ("uart_rx_i", 1, NONE),
        ("can_rx_i", 1, NONE), ("spi_miso_i", 1, NONE), ("adc_valid_i", 1, NONE),
        ("adc_fault_i", 1, CONVERTER), ("clock_fault_i", 1, CLOCK),
    ]  # fmt: skip
    found = []
    for port, bits, names in ports:
        pins = [f"{port}[{bit}]" for bit in range(bits)] if bits > 1 else [port]
        # Faults of driver, converters and clock are latched by the first clock edge that sees them; sample sets have a
        # least spacing.
        must_stop, unchecked = names in (PIN, CONVERTER, CLOCK), port == "adc_valid_i"
        for text, forced, span_s in (*((f"{pin} wrong for 1 us", [pin], 1e-6) for pin in pins),
                                     (f"{port} wrong for 1 clock", pins, 0.0)):  # fmt: skip
            found.append(Fault(text, held(forced, span_s), names, must_stop=must_stop, unchecked=unchecked))
    return [
        *found,
        Fault("fault_pin_i held", held(["fault_pin_i"], FOR_EVER_S, 1), PIN, must_stop=True),
        Fault("clock_fault_i held", held(["clock_fault_i"], FOR_EVER_S, 1), CLOCK, must_stop=True),
        Fault("uart_rx_i at 0 for 2 ms", held(["uart_rx_i"], 2e-3, 0), NONE),
        Fault("noise on the console", ((0.0, "console", {"line": "\x01\x7fU"}),), NONE),
        Fault("adc_valid_i at 0 for 1 ms", held(["adc_valid_i"], 1e-3, 0), frozenset({"no_samples"}), must_stop=True),
    ]


def _bus_faults(s: Scenario) -> list[Fault]:
    """The CAN bus, and a chip that does not hear it: shorter and longer than the node waits for a command."""

    def forced(level: int, span_s: float) -> tuple[Change, ...]:
        return ((0.0, "bus", {"cycles": round(span_s * CLOCK_HZ), "level": level}),)

    return [
        Fault("CAN bus dominant for 1 us", forced(0, 1e-6), NONE),
        Fault("CAN bus dominant for 5 ms", forced(0, 5e-3), BUS),
        Fault("CAN bus dominant for 30 ms", forced(0, 30e-3), BUS, must_stop=True),
        Fault("CAN bus recessive for 30 ms", forced(1, 30e-3), BUS, must_stop=True),
        Fault("can_rx_i at 0 for 5 ms", held(["can_rx_i"], 5e-3, 0), BUS),
        Fault("can_rx_i at 1 for 30 ms", held(["can_rx_i"], 30e-3, 1), BUS, must_stop=True),
    ]


# An over-current beforehand, by a sample; `clear` and `start` when the drive rests in its fault; the start looks first.
AGAIN_S, START_S = 8e-3, 9e-3
START_AGAIN = tuple((at_s, "console", {"line": line}) for at_s, line in ((AGAIN_S, "clear"), (START_S, "start")))
LONG_START_S = 0.1  # of a rotor at rest, tried several times


def _restart_faults(s: Scenario) -> list[Fault]:
    """Starts after an over-current, of a winding that is shorted by then and of a whole one."""
    sample = _stuck(channel_names(s.motor.phases)[s.motor.phases], (1 << s.inverter.sensing.bits) - 1)
    shorts = (
        ("windings A, B shorted, 10 % of the turns left", {"phases": (0, 1), "turns_fraction": 0.1}),
        ("windings B, C shorted, 10 % of the turns left", {"phases": (1, 2), "turns_fraction": 0.1}),
        ("winding A to star, 20 % of the turns left", {"phases": (0,), "turns_fraction": 0.2}),
    )

    def shorted(arguments: Mapping[str, object]) -> Change:
        return (2 * CLEAR[0], *_fault("shorted_winding", **arguments)[1:])

    return [
        *(Fault(f"{text}, started again", (sample, CLEAR, shorted(arguments), *START_AGAIN), SHORTED | MACHINE,
                must_stop=True, span_s=LONG_START_S)
          for text, arguments in shorts),
        Fault("over-current, whole winding started again", (sample, CLEAR, *START_AGAIN), NONE),
    ]  # fmt: skip


# Windows of the firmware for its main loop and its node, and what is over by the time it starts anew.
LOOP_S, NODE_S, TICK_S = 0.2, 0.05, 130e-6
REPORTED_S = 1e-3
IDLE = ""  # the instruction with which the main loop passes its time


def _broken(function: str, word: int | str, span_s: float, offset: int = 0) -> tuple[Change, ...]:
    """Another instruction so many bytes into a function, for a time. word: a name calls this function."""
    place = {"function": function, "word": word, "offset": offset}
    return ((0.0, "code", place), (span_s, "code", place))


def _stack_overflow() -> tuple[Change, ...]:
    """The core writes the last word of the stack, from where a function that nobody calls has been."""
    unused = "trap_exception"
    stores = [change for n, word in enumerate(STACK_END) for change in _broken(unused, word, TICK_S, 4 * n)]
    return (*stores, *_broken(IDLE, unused, TICK_S))


def _firmware_faults(s: Scenario) -> list[Fault]:
    """Exceptions, hangs of what the firmware supervises, and a stack that has reached its end."""
    words = (("illegal instruction", ILLEGAL), ("misaligned load", MISALIGNED), ("jump out of the memory", OUTSIDE))
    found = [
        *(Fault(f"{text} in the {place}", _broken(function, word, TICK_S), EXCEPTION, must_stop=True)
          for place, function in (("main loop", IDLE), ("control interrupt", "trap_control"))
          for text, word in words),
        Fault("control interrupt hangs", _broken("trap_control", TO_ITSELF, 5e-3), WATCHDOG, must_stop=True,
              turning=True),
        Fault("main loop hangs", _broken(IDLE, TO_ITSELF, LOOP_S + REPORTED_S), MAIN_LOOP, must_stop=True,
              active=True, span_s=LOOP_S + 15e-3),
        Fault("stack overflow", _stack_overflow(), STACK, must_stop=True, active=True),
    ]  # fmt: skip
    if s.can is not None:
        hang = _broken("link_status", TO_ITSELF, NODE_S + REPORTED_S)
        found.append(Fault("CANopen node hangs", hang, CAN_NODE, must_stop=True, active=True, span_s=NODE_S + 15e-3))
    return found


# A flood fills the line for this time; a byte takes 10 us, a frame of 8 bytes about 130 us.
FLOOD_S, BYTE_S, FRAME_S = 30e-3, 10e-6, 130e-6
NOISE_SEED = 1


def _flood(lines: Sequence[str]) -> tuple[Change, ...]:
    return tuple((0.0, "console", {"line": line, "burst": True}) for line in lines)


def _console_floods(s: Scenario) -> list[Fault]:
    """More than the console can answer, and nothing that it can: none of it moves the drive."""
    rng, count = random.Random(NOISE_SEED), round(FLOOD_S / BYTE_S)
    noise = "".join(chr(rng.choice([10, *range(33, 127)])) for _ in range(count))
    return [
        Fault("console flood: status", _flood(["status"] * (count // 7)), NONE),
        # As many as the console's ring holds would take seconds; these take longer than a round of the main loop may.
        Fault("console flood: all values", _flood(["get"] * 25), NONE),
        Fault("console flood: line without an end", _flood(["x" * count]), NONE),
        Fault("console flood: noise", _flood([noise]), NONE),
    ]


def _bus_floods(s: Scenario) -> list[Fault]:
    """A bus that another node fills, ahead of the master's commands or behind them. None of it commands the drive."""
    assert s.can is not None
    node, count, rng = s.can.node_id, round(FLOOD_S / FRAME_S), random.Random(NOISE_SEED)
    drawn = [Frame.draw(rng) for _ in range(20 * count)]
    # Not commands of the network, SYNC, or what the node receives.
    foreign = [f for f in drawn if f.ext or (f.id > 0x80 and f.id & 0x7F != node)][:count]

    def flood(name: str, names: frozenset[str], frames: Sequence[Frame]) -> Fault:
        return Fault(f"CAN flood: {name}", ((0.0, "frames", {"frames": tuple(frames)}),), names)

    return [
        flood("foreign, ahead of the commands", BUS, [Frame(0x001, dlc=8, data=bytes(8))] * count),
        flood("foreign, behind the commands", NONE, [Frame(0x7F0, dlc=8, data=bytes(8))] * count),
        flood("of any kind", BUS, foreign),
        flood("SYNC", BUS, [Frame(0x080)] * (2 * count)),
        flood("SDO uploads", NONE, [Frame(0x600 + node, dlc=8, data=bytes([0x40, 0, 0x10, 0, 0, 0, 0, 0]))] * count),
        flood("commands that are too short", NONE, [Frame(0x400 + node, dlc=1, data=b"\x0f")] * count),
        flood("heartbeats of the node's own number", NONE, [Frame(0x700 + node, dlc=1, data=b"\x05")] * count),
    ]


def plant_faults(drive: Drive) -> list[Fault]:
    """What goes wrong in and around the chip of a drive, but for bits that flip.

    With injection its faults tell what others tell by a lost lock.
    """
    s = drive.load()
    found = [] if drive.pins else [*_sensor_faults(s), *_machine_faults(s)]
    if not drive.pins and s.motor.phases == 3:  # of five phases no line EMFs are alike
        found += _restart_faults(s)
    found += [*_pin_faults(s), *_firmware_faults(s), *_console_floods(s)]
    if s.can is not None:
        found += [*_bus_faults(s), *_bus_floods(s)]
    if s.drive.vector.injection is None:
        return found
    return [replace(f, names=f.names | INJECTION) if f.names & LOCK else f for f in found]
