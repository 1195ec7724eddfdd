# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""The grid: drives, moments, faults, and the fault names by which a drive may stop."""

from __future__ import annotations

import random
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import cycle

from fluxlock.clock import CLOCK_HZ
from fluxlock.config import Scenario, load_scenario
from fluxlock.cosim.plan import Action
from fluxlock.interface.names import fault_names
from fluxlock.memory import BLOCK_ADDRESS
from fluxlock.paths import ROOT
from fluxlock.plant import channel_names

RUN_S = 0.040
UPSET_S = 0.015
# Twelve looks of the slow protection, and one more: 64 ticks of up to 125 us.
SLOW_S = 0.110

Change = tuple[float, str, Mapping[str, object]]  # after the moment (s), kind and arguments of an `Action`


def _faults(*names: str) -> frozenset[str]:
    """Faults of the drive by their names."""
    if unknown := sorted(set(names) - set(fault_names())):
        raise ValueError(f"the drive has no fault {unknown[0]}")
    return frozenset(names)


CURRENT = _faults("phase_over_current", "dc_over_current")
LOCK = _faults("lost_lock", "angle_lost", "stalled", "overhauled", "start_failed")
LINK = _faults("under_voltage", "over_voltage")
CHANNEL = _faults("voltage_channel", "stuck_channel", "current_sum")
PIN = _faults("fault_pin")
CONVERTER = _faults("converter")
CLOCK = _faults("clock")
SETTINGS = _faults("settings_changed")
PARAMETERS = _faults("parameter_magic", "parameter_version", "parameter_crc")
INJECTION = _faults("injection_signal", "injection_noise", "no_saliency", "polarity_unsure")
BUS = _faults("command_timeout") | {"bus_off"}  # the bus tells the other
NONE: frozenset[str] = frozenset()  # no stop is right
ANY = frozenset({"*"})


@dataclass(frozen=True)
class Fault:
    """One thing that goes wrong. names: faults that tell it rightly; "*": only gates and currents are judged.

    must_stop: riding through is no right end. turning: only where the machine is driven already. span_s: until the run
    is judged; one that stops is judged earlier. unchecked: breaks what an assertion of the RTL takes for granted.
    """

    name: str
    changes: tuple[Change, ...]
    names: frozenset[str]
    must_stop: bool = False
    turning: bool = False
    span_s: float = RUN_S
    unchecked: bool = False

    @property
    def upset(self) -> bool:
        """A bit of the chip that flips."""
        return any(kind in ("register", "memory") for _, kind, _ in self.changes)


@dataclass(frozen=True)
class Moment:
    """An instant of a drive's scenario at which its runs part.

    turning: the machine is driven, with a lock. boot: the program has not looked at its parameters yet; only these are
    disturbed.
    """

    name: str
    at_s: float
    turning: bool = True
    boot: bool = False


@dataclass(frozen=True)
class Drive:
    """A scenario and its moments.

    can: the chip has the CAN controller although the firmware has no node. pins: only pins and bits are disturbed.
    """

    name: str
    scenario: str
    moments: tuple[Moment, ...]
    can: bool = False
    pins: bool = False

    def load(self) -> Scenario:
        """The scenario."""
        return load_scenario(ROOT / "scenarios" / self.scenario)


DRIVES = (
    Drive(
        "six-step",
        "campaign/six-step.toml",
        (
            Moment("ready", 0.0035, turning=False),
            Moment("catching", 0.006, turning=False),
            Moment("accelerating", 0.020),
            Moment("steady", 0.065),
            Moment("loaded", 0.085),
        ),
    ),
    Drive("start", "demo.toml", (Moment("align", 0.060, turning=False), Moment("ramp", 0.200, turning=False))),
    Drive(
        "vector",
        "campaign/vector.toml",
        (Moment("accelerating", 0.030), Moment("steady", 0.080), Moment("loaded", 0.110)),
    ),
    Drive(
        "five-phase",
        "campaign/five-phase.toml",
        (Moment("search", 0.020, turning=False), Moment("steady", 0.270), Moment("reversing", 0.495)),
        can=True,
    ),
    Drive("hall", "six-step/hall.toml", (Moment("ramp", 0.080), Moment("steady", 0.200)), pins=True),
    Drive("encoder", "vector/encoder.toml", (Moment("steady", 0.250), Moment("reversing", 0.410)), pins=True),
    Drive("can", "campaign/can.toml", (Moment("steady", 0.080),), pins=True),
    Drive("boot", "campaign/six-step.toml", (Moment("reset", 1e-6, turning=False, boot=True),)),
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


def _held(pins: Sequence[str], span_s: float, level: int | None = None) -> tuple[Change, ...]:
    """Pins that have a level, None: the wrong one, for a time, or at one clock edge."""
    clocks = max(1, round(span_s * CLOCK_HZ))
    return tuple((0.0, "pin", {"pin": pin, "cycles": clocks, "level": level}) for pin in pins)


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
              (_fault("shorted_winding", phases=(0,), turns_fraction=0.2),), MACHINE),
        Fault("windings A, B shorted, 10 % of the turns left",
              (_fault("shorted_winding", phases=(0, 1), turns_fraction=0.1),), MACHINE),
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
            found.append(Fault(text, _held(forced, span_s), names, must_stop=must_stop, unchecked=unchecked))
    return [
        *found,
        Fault("fault_pin_i held", _held(["fault_pin_i"], FOR_EVER_S, 1), PIN, must_stop=True),
        Fault("clock_fault_i held", _held(["clock_fault_i"], FOR_EVER_S, 1), CLOCK, must_stop=True),
        Fault("uart_rx_i at 0 for 2 ms", _held(["uart_rx_i"], 2e-3, 0), NONE),
        Fault("noise on the console", ((0.0, "console", {"line": "\x01\x7fU"}),), NONE),
        Fault("adc_valid_i at 0 for 1 ms", _held(["adc_valid_i"], 1e-3, 0), frozenset({"no_samples"}), must_stop=True),
    ]


def _bus_faults(s: Scenario) -> list[Fault]:
    """The CAN bus, and a chip that does not hear it: shorter and longer than the node waits for a command."""

    def held(level: int, span_s: float) -> tuple[Change, ...]:
        return ((0.0, "bus", {"cycles": round(span_s * CLOCK_HZ), "level": level}),)

    return [
        Fault("CAN bus dominant for 1 us", held(0, 1e-6), NONE),
        Fault("CAN bus dominant for 5 ms", held(0, 5e-3), BUS),
        Fault("CAN bus dominant for 30 ms", held(0, 30e-3), BUS, must_stop=True),
        Fault("CAN bus recessive for 30 ms", held(1, 30e-3), BUS, must_stop=True),
        Fault("can_rx_i at 0 for 5 ms", _held(["can_rx_i"], 5e-3, 0), BUS),
        Fault("can_rx_i at 1 for 30 ms", _held(["can_rx_i"], 30e-3, 1), BUS, must_stop=True),
    ]


def plant_faults(drive: Drive) -> list[Fault]:
    """What goes wrong around the chip of a drive. With injection its faults tell what others tell by a lost lock."""
    s = drive.load()
    found = [] if drive.pins else [*_sensor_faults(s), *_machine_faults(s)]
    found += _pin_faults(s)
    if s.can is not None:
        found += _bus_faults(s)
    if s.drive.vector.injection is None:
        return found
    return [replace(f, names=f.names | INJECTION) if f.names & LOCK else f for f in found]


# An upset that makes sample sets come every 83 us instead of every us: nobody would see an over-current meanwhile.
SAMPLE_PERIOD = Fault(
    "sample period upset",
    ((0.0, "register", {"name": "u_sense__DOT__u_regs__DOT__field_storage_period_cycles", "bit_share": 12.5 / 16}),),
    frozenset({"no_samples"}),
    must_stop=True,
    span_s=UPSET_S,
)

# Registers are drawn evenly by name, memory by address: image, state, stack, and the block that boot has checked.
UPSET_BYTES = BLOCK_ADDRESS + 0x400
# What fl_settings_lock watches, as fields of the safety block.
SETTINGS_FIELDS = (
    "guard_safe_state", "dead_time_cycles", "trip_enable_source", "watchdog_cycles", "sample_age_cycles",
    "current_limit_phase_lsb", "current_limit_dc_lsb", "voltage_limit_over_lsb", "voltage_limit_under_lsb",
    "brake_enable", "brake_level_on_lsb", "brake_level_off_lsb", "brake_time_cycles",
)  # fmt: skip


def upsets(rng: random.Random, registers: int, words: int, settings: int) -> list[Fault]:
    """Single bits that flip: in a register, in the memory, in a locked setting."""
    found = []
    for number in range(registers):
        at = {"share": rng.random(), "bit_share": rng.random()}
        found.append(Fault(f"register upset {number}", ((0.0, "register", at),), ANY, span_s=UPSET_S))
    for number in range(words):
        place = {"address": 4 * rng.randrange(0x80 // 4, UPSET_BYTES // 4), "bit": rng.randrange(32)}
        found.append(Fault(f"memory upset {number}", ((0.0, "memory", place),), ANY, span_s=UPSET_S))
    for number in range(settings):
        field = {"name": f"u_safety__DOT__u_regs__DOT__field_storage_{rng.choice(SETTINGS_FIELDS)}"}
        change = (0.0, "register", field | {"bit_share": rng.random()})
        found.append(Fault(f"settings upset {number}", (change,), SETTINGS, must_stop=True, span_s=UPSET_S))
    return found


def parameter_upsets(rng: random.Random, count: int, block_bytes: int) -> list[Fault]:
    """Single bits of the parameter block that have flipped before the program looks at it."""
    found = []
    for number in range(count):
        place = {"address": BLOCK_ADDRESS + 4 * rng.randrange(block_bytes // 4), "bit": rng.randrange(32)}
        change = (0.0, "memory", place)
        found.append(Fault(f"parameter upset {number}", (change,), PARAMETERS, must_stop=True, span_s=UPSET_S))
    return found


def actions_of(fault: Fault, at_cycle: int, registers: Sequence[str]) -> tuple[Action, ...]:
    """The fault's changes at a moment. registers: the chip's, by which an upset's name becomes its share of all."""
    actions = []
    for at_s, kind, arguments in fault.changes:
        told = dict(arguments)
        if "name" in told:
            wanted = str(told.pop("name"))
            (number,) = (n for n, name in enumerate(registers) if name.endswith(wanted))
            told["share"] = (number + 0.5) / len(registers)
        actions.append(Action(at_cycle + round(at_s * CLOCK_HZ), kind, told))
    return tuple(actions)
