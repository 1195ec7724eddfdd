"""The grid: drives, moments, faults, and the fault names by which a drive may stop."""

from __future__ import annotations

import random
from collections.abc import Mapping
from dataclasses import dataclass

from fluxlock.config.specs import CLOCK_HZ
from fluxlock.cosim.plan import Action
from fluxlock.memory import BLOCK_ADDRESS

Change = tuple[float, str, Mapping[str, object]]  # after the moment (s), kind and arguments of an `Action`

CURRENT = frozenset({"phase_over_current", "dc_over_current"})
LOCK = frozenset({"lost_lock", "start_failed"})
LINK = frozenset({"under_voltage", "over_voltage"})
CHANNEL = frozenset({"voltage_channel", "stuck_channel", "current_sum"})
PIN = frozenset({"fault_pin"})
ANY = frozenset({"*"})


@dataclass(frozen=True)
class Fault:
    """One thing that goes wrong. names: faults that tell it rightly; "*": only gates and currents are judged.

    must_stop: riding through is no right end. turning: only where the machine is driven already.
    """

    name: str
    changes: tuple[Change, ...]
    names: frozenset[str]
    must_stop: bool = False
    turning: bool = False


@dataclass(frozen=True)
class Moment:
    """An instant of a drive's scenario at which its runs part. turning: the machine is driven, with a lock."""

    name: str
    at_s: float
    turning: bool = True


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
)


def _sensor(channel: str, **arguments: object) -> Change:
    return (0.0, "sensor", {"channel": channel, **arguments})


def _stuck(channel: str, code: int | None = None) -> Change:
    return (0.0, "fault", {"kind": "stuck_channel", "channel": channel, "code": code})


def _fault(kind: str, **arguments: object) -> Change:
    return (0.0, "fault", {"kind": kind, **arguments})


def _later(seconds: float, change: Change) -> Change:
    return (seconds, *change[1:])


CLEAR = _fault("clear")
SENSED_CURRENT = CHANNEL | CURRENT | LOCK
SENSED_VOLTAGE = CHANNEL | CURRENT | LOCK
MACHINE = CURRENT | LOCK | LINK | {"current_sum", "overspeed"}

PLANT_FAULTS: tuple[Fault, ...] = (
    *(Fault(f"{x} stuck", (_stuck(x),), SENSED_VOLTAGE) for x in ("va", "vb", "vc")),
    *(Fault(f"{x} stuck at {code}", (_stuck(x, code),), SENSED_VOLTAGE) for x, code in (("va", 4095), ("vb", 0))),
    *(Fault(f"{x} stuck", (_stuck(x),), SENSED_CURRENT, must_stop=True) for x in ("ia", "ib", "ic", "idc")),
    *(Fault(f"{x} stuck at {code}", (_stuck(x, code),), SENSED_CURRENT, must_stop=True)
      for x, code in (("ia", 2048), ("ib", 4095), ("ic", 0), ("idc", 2048))),
    Fault("vdc stuck", (_stuck("vdc"),), CHANNEL, must_stop=True),
    Fault("vdc stuck at 3300", (_stuck("vdc", 3300),), CHANNEL, must_stop=True),
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
    Fault("load tenfold", ((0.0, "load", {"constant_nm": 0.2}),), LOCK | CURRENT | {"overload"}),
    Fault("load drives", ((0.0, "load", {"constant_nm": -0.05}),), LOCK | LINK | CURRENT | {"overspeed"}),
    Fault("fault pin for 1 us", (_fault("fault_pin"), _later(1e-6, CLEAR)), PIN, must_stop=True),
    Fault("fault pin", (_fault("fault_pin"),), PIN, must_stop=True),
    Fault("va, vb, vc at 4095 for 1 ms",
          (*(_stuck(x, 4095) for x in ("va", "vb", "vc")), _later(1e-3, CLEAR)), SENSED_VOLTAGE),
    Fault("ia at 4095 for 1 us", (_stuck("ia", 4095), _later(1e-6, CLEAR)), CURRENT),
)  # fmt: skip

# Registers are drawn evenly by name, memory by address: image, state, stack, and the block that boot has checked.
UPSET_BYTES = BLOCK_ADDRESS + 0x400


def upsets(rng: random.Random, registers: int, words: int) -> list[Fault]:
    """Single bits that flip: in a register, in the memory."""
    found = []
    for number in range(registers):
        at = {"share": rng.random(), "bit_share": rng.random()}
        found.append(Fault(f"register upset {number}", ((0.0, "register", at),), ANY))
    for number in range(words):
        place = {"address": 4 * rng.randrange(0x80 // 4, UPSET_BYTES // 4), "bit": rng.randrange(32)}
        found.append(Fault(f"memory upset {number}", ((0.0, "memory", place),), ANY))
    return found


def actions_of(fault: Fault, cycle: int) -> tuple[Action, ...]:
    """The fault's changes at a moment."""
    return tuple(
        Action(cycle + round(at_s * CLOCK_HZ), kind, dict(arguments)) for at_s, kind, arguments in fault.changes
    )
