"""The grid: drives, moments, faults, and the fault names by which a drive may stop."""

from __future__ import annotations

import random
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from fluxlock.config.specs import CLOCK_HZ
from fluxlock.cosim.plan import Action
from fluxlock.memory import BLOCK_ADDRESS

RUN_S = 0.040
UPSET_S = 0.015
# Twelve looks of the slow protection, and one more: 64 ticks of 100 us with vector control.
SLOW_S = 0.090

Change = tuple[float, str, Mapping[str, object]]  # after the moment (s), kind and arguments of an `Action`

CURRENT = frozenset({"phase_over_current", "dc_over_current"})
LOCK = frozenset({"lost_lock", "start_failed"})
LINK = frozenset({"under_voltage", "over_voltage"})
CHANNEL = frozenset({"voltage_channel", "stuck_channel", "current_sum"})
PIN = frozenset({"fault_pin"})
SETTINGS = frozenset({"settings_changed"})
PARAMETERS = frozenset({"parameter_magic", "parameter_version", "parameter_crc"})
ANY = frozenset({"*"})


@dataclass(frozen=True)
class Fault:
    """One thing that goes wrong. names: faults that tell it rightly; "*": only gates and currents are judged.

    must_stop: riding through is no right end. turning: only where the machine is driven already. span_s: until the run
    is judged; one that stops is judged earlier.
    """

    name: str
    changes: tuple[Change, ...]
    names: frozenset[str]
    must_stop: bool = False
    turning: bool = False
    span_s: float = RUN_S

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
    """A scenario and its moments."""

    name: str
    scenario: str
    moments: tuple[Moment, ...]


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


SENSED_CURRENT = CHANNEL | CURRENT | LOCK
SENSED_VOLTAGE = CHANNEL | CURRENT | LOCK
MACHINE = CURRENT | LOCK | LINK | {"current_sum", "overspeed"}

PLANT_FAULTS: tuple[Fault, ...] = (
    *(Fault(f"{x} stuck", (_stuck(x),), SENSED_VOLTAGE) for x in ("va", "vb", "vc", "vsm")),
    *(Fault(f"{x} stuck at {code}", (_stuck(x, code),), SENSED_VOLTAGE) for x, code in (("va", 4095), ("vb", 0))),
    *(Fault(f"{x} stuck", (_stuck(x),), SENSED_CURRENT, must_stop=True) for x in ("ia", "ib", "ic")),
    *(Fault(f"{x} stuck at {code}", (_stuck(x, code),), SENSED_CURRENT, must_stop=True)
      for x, code in (("ia", 2048), ("ib", 4095), ("ic", 0))),
    Fault("idc stuck", (_stuck("idc"),), SENSED_CURRENT, must_stop=True, span_s=SLOW_S),
    Fault("idc stuck at 2048", (_stuck("idc", 2048),), SENSED_CURRENT, must_stop=True, span_s=SLOW_S),
    Fault("vdc stuck", (_stuck("vdc"),), CHANNEL, must_stop=True, span_s=SLOW_S),
    Fault("vdc stuck at 3300", (_stuck("vdc", 3300),), CHANNEL, must_stop=True, span_s=SLOW_S),
    Fault("vdc stuck at 0", (_stuck("vdc", 0),), LINK, must_stop=True),
    *(Fault(f"{x} offset {lsb:+g} LSB", (_sensor(x, offset_lsb=lsb),), SENSED_CURRENT | LINK)
      for x, lsb in (("ia", 200.0), ("ib", -400.0), ("idc", 200.0), ("va", 200.0), ("vdc", -200.0))),
    *(Fault(f"{x} gain {gain:g}", (_sensor(x, gain=gain),), SENSED_CURRENT | LINK)
      for x, gain in (("ia", 0.7), ("ic", 1.3), ("vb", 0.8), ("vdc", 1.1), ("idc", 0.7))),
    Fault("noise 30 LSB for 2 ms", ((0.0, "sensor", {"noise_lsb": 30.0}), (0.002, "sensor", {"noise_lsb": 1.0})),
          SENSED_VOLTAGE),
    Fault("phase A open", (_fault("open_phase", phases=(0,)),), MACHINE | CHANNEL),
    Fault("phase C open", (_fault("open_phase", phases=(2,)),), MACHINE | CHANNEL),
    Fault("winding A to star, 20 % of the turns left", (_fault("shorted_winding", phases=(0,), turns_fraction=0.2),),
          MACHINE),
    Fault("windings A, B shorted, 10 % of the turns left",
          (_fault("shorted_winding", phases=(0, 1), turns_fraction=0.1),), MACHINE),
    Fault("upper switch A stuck", (_fault("stuck_high", phases=(0,)),), MACHINE | PIN),
    Fault("lower switch B stuck", (_fault("stuck_low", phases=(1,)),), MACHINE | PIN),
    Fault("supply dips to 10 V for 5 ms",
          ((0.0, "supply", {"supply_v": 10.0}), (0.005, "supply", {"supply_v": 25.0, "ramp_s": 1e-3})),
          LINK | CURRENT | LOCK),
    Fault("supply fails", ((0.0, "supply", {"supply_v": 0.0}),), LINK | LOCK, must_stop=True),
    Fault("supply rises to 29.5 V", ((0.0, "supply", {"supply_v": 29.5, "ramp_s": 1e-3}),), LINK, must_stop=True),
    Fault("rotor jams", ((0.0, "mechanics", {"mode": "locked"}),), LOCK | CURRENT, turning=True),
    # A constant torque: one that is stronger than the alignment turns a rotor that stands backwards, faster and faster.
    Fault("load tenfold", ((0.0, "load", {"constant_nm": 0.2}),), LOCK | CURRENT | {"overload", "overspeed"}),
    Fault("load drives", ((0.0, "load", {"constant_nm": -0.05}),), LOCK | LINK | CURRENT | {"overspeed"}),
    Fault("fault pin for 1 us", (_fault("fault_pin"), CLEAR), PIN, must_stop=True),
    Fault("fault pin", (_fault("fault_pin"),), PIN, must_stop=True),
    Fault("va, vb, vc at 4095 for 1 ms",
          (*(_stuck(x, 4095) for x in ("va", "vb", "vc")), (1e-3, *CLEAR[1:])), SENSED_VOLTAGE),
    *(_glitch(x, 4095, SENSED_VOLTAGE) for x in ("va", "vb", "vc", "vsm")),
    _glitch("va", 0, SENSED_VOLTAGE),
    *(_glitch(x, 4095, CURRENT) for x in ("ia", "ib", "ic", "idc")),
    _glitch("ib", 0, CURRENT),
    *(_glitch("vdc", code, LINK) for code in (4095, 0)),
    # Bits 1 to 3 of the plant's pins are those of the Hall sensors, which these machines do not have.
    Fault("Hall pins for 1 us", (_fault("fault_pin", level=0b1110), CLEAR), LOCK),
    Fault("noise on the console", ((0.0, "console", {"line": "\x01\x7fU"}),), frozenset()),
)  # fmt: skip

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


def actions_of(fault: Fault, cycle: int, registers: Sequence[str]) -> tuple[Action, ...]:
    """The fault's changes at a moment. registers: the chip's, by which an upset's name becomes its share of all."""
    actions = []
    for at_s, kind, arguments in fault.changes:
        told = dict(arguments)
        if "name" in told:
            wanted = str(told.pop("name"))
            (number,) = (n for n, name in enumerate(registers) if name.endswith(wanted))
            told["share"] = (number + 0.5) / len(registers)
        actions.append(Action(cycle + round(at_s * CLOCK_HZ), kind, told))
    return tuple(actions)
