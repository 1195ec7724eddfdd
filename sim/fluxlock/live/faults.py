# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""The faults that a page has buttons for: what each one orders, or why a source does not have it."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Literal

from fluxlock.config import Scenario
from fluxlock.config.scenario import DEAD_CORE_S, HALL_GLITCH_S, NOISY_LSB, Fault

SHORT_TURNS = 0.1  # that still act
NO_BUS = "no other node is on a bus of this drive: its commands come from the page"
PHASES: tuple[Literal["A", "B", "C", "D", "E"], ...] = ("A", "B", "C", "D", "E")


def catalogue(scenario: Scenario, missing: Callable[[Fault], str], no_bus: str = NO_BUS) -> list[dict[str, Any]]:
    """Buttons in their order: name, explanation, and the message that a click sends or the reason why there is none.

    missing: why a source does not have a fault; "": it has. no_bus: why no other node is on the drive's bus; "": it is.
    """
    supply_v = scenario.inverter.supply_v
    faults: list[tuple[str, str, Fault]] = [
        *(
            (f"Open phase {phase}", "the leg has lost the machine", Fault(kind="open_phase", phases=[phase]))
            for phase in PHASES[: scenario.motor.phases]
        ),
        (
            "Short A to B",
            "a tenth of the turns of both windings is left",
            Fault(kind="shorted_winding", phases=["A", "B"], turns_fraction=SHORT_TURNS),
        ),
        ("Upper switch A stuck", "it conducts for ever", Fault(kind="stuck_high", phases=["A"])),
        ("Stuck sensor ia", "the converter keeps its code", Fault(kind="stuck_channel", channel="ia")),
        ("Stuck sensor vdc", "the converter keeps its code", Fault(kind="stuck_channel", channel="vdc")),
        ("Noisy sensors", f"{NOISY_LSB:g} LSB on all channels", Fault(kind="noisy_channels")),
        ("Hall glitch", f"sensor A shows the wrong level for {1e3 * HALL_GLITCH_S:g} ms", Fault(kind="hall_glitch")),
        ("Stuck rotor", "it stands at once", Fault(kind="stuck_rotor")),
        ("Dead core", f"it hangs in its control interrupt for {1e3 * DEAD_CORE_S:g} ms", Fault(kind="dead_core")),
        ("Driver's fault pin", "the gate driver reports a fault", Fault(kind="fault_pin")),
    ]
    shown: list[dict[str, Any]] = []
    for name, text, fault in faults:
        why = missing(fault) or without(scenario, fault)
        order: dict[str, Any] = {"kind": "fault", "fault": fault.model_dump(exclude_unset=True)}
        shown.append({"name": name, "text": text, "order": None if why else order, "why": why})
    for name, text, volt in (
        ("Sag", "the supply falls to a half; the slider brings it back", supply_v / 2),
        ("Supply loss", "the link is shorted; the slider brings it back", 0.0),
    ):
        order = {"kind": "supply", "volt": volt, "ramp_s": 0.0}
        shown.append({"name": name, "text": text, "order": order, "why": ""})
    order_of_wires = other_wires(scenario)
    shown.append({"name": "Wrong phase order", "text": order_of_wires, "order": None, "why": order_of_wires})
    text = "the other node asks no more, and command_timeout_ms counts; Mend all has it heard again"
    silence = None if no_bus else {"kind": "bus", "silent": True}
    shown.append({"name": "Silent bus", "text": no_bus or text, "order": silence, "why": no_bus})
    mend = {"kind": "fault", "fault": {"kind": "clear"}}
    return [*shown, {"name": "Mend all", "text": "but the supply", "order": mend, "why": ""}]


def without(scenario: Scenario, fault: Fault) -> str:
    """Why a fault means nothing to a scenario's drive; "": it does."""
    if fault.kind == "hall_glitch" and scenario.drive.hall.mode == "off":
        return "this drive has no Hall sensors (drive.hall.mode)"
    return ""


def other_wires(scenario: Scenario) -> str:
    """Why no running drive shows a wrong order of its wires."""
    if scenario.drive.hall.mode != "off":
        return "wires do not change places in a running drive; to begin with them changed, change motor.hall"
    if scenario.motor.encoder is not None:
        return (
            "wires do not change places in a running drive; to begin with them changed, restart with "
            "--set motor.encoder.inverted=true"
        )
    return "a drive without an encoder or Hall sensors cannot tell: the shaft turns the other way, and nothing trips"
