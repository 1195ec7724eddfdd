# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Switching edges in the sense chain: `[sensing.edge]` of an inverter file, and the named sets of it."""

from __future__ import annotations

from dataclasses import asdict
from typing import Any, Literal, Self

from pydantic import Field, model_validator

from fluxlock.config.fields import Model, conflict, quantity, with_unit
from fluxlock.plant.edge_params import EdgeParams

Preset = Literal["clean", "T", "G", "cable", "divider"]
BY_PRESET = "from the preset"
# T and G: terms that others fitted to the open terminal of two speed controllers; they say nothing of the terminal of
# the leg that switches (own = 0) nor when the lobe of T comes, which here is that of G.
# cable: 3 m of cable, 0.6 uH/m and 100 pF/m, into a winding of 2 nF: 2.5 MHz. Skin effect of 3 ohm: 2 L / R = 1.2 us.
# The far end of the leg that switches swings about its new voltage by the whole jump, and begins below it. A tenth
# reaches the others by the winding's capacitances. Gates slow enough for such a cable: 100 ns.
# divider: taps of 47 kohm over 3.3 kohm, 3.1 kohm beside 100 pF: 310 ns. A neighbouring trace of 0.5 pF gives a tap
# 48 V * 0.5 / 100.5, behind a ratio of 15.2 that is 3.6 V at the terminal. In-line shunt amplifiers with 400 kHz, which
# settle with 0.4 us, reject a jump of 48 V by 88 dB: 1.9 mV of the 100 mV of full scale, 0.02 of it.
PRESETS: dict[Preset, dict[str, float]] = {
    "clean": {},
    "T": {
        "step_v": 2.0, "step_tau_s": 600e-9, "ring_v": 1.2, "ring_hz": 700e3, "ring_tau_s": 4e-6, "lobe_v": 0.10,
        "lobe_s": 3.5e-6,
    },
    "G": {
        "step_v": 2.5, "step_tau_s": 600e-9, "ring_v": 1.2, "ring_hz": 700e3, "ring_tau_s": 4e-6, "lobe_v": 0.69,
        "lobe_s": 3.5e-6,
    },
    "cable": {
        "ring_v": -48.0, "ring_hz": 2.5e6, "ring_tau_s": 1.2e-6, "slew_s": 100e-9, "own": 1.0, "coupling": 0.1,
    },
    "divider": {
        "step_v": 3.6, "step_tau_s": 310e-9, "own": 0.0, "coupling": 1.0, "slew_s": 30e-9,
        "current_step_share": 0.02, "current_tau_s": 400e-9,
    },
}  # fmt: skip
# Keys that have no effect, or none that is defined, without others.
NEEDS = {
    "step_v": ("step_tau_s",),
    "ring_v": ("ring_hz", "ring_tau_s"),
    "lobe_v": ("lobe_s",),
    "current_step_share": ("current_tau_s",),
}


def _term(description: str, unit: str, low: float, high: float) -> Any:  # noqa: ANN401 - a field takes its annotation, pydantic types its default Any
    return quantity(description, unit, low, high, default=None, absent=BY_PRESET)


class Edge(Model):
    """What an edge of a leg leaves in the channels. Heights hold for a terminal that jumps by `reference_v`."""

    preset: Preset = Field(
        default="clean", description="Named set of values. The other keys of this table go before it. `clean`: nothing."
    )
    reference_v: float | None = quantity(
        "Jump of the leg's terminal for which the heights hold; they scale with the jump.",
        "V",
        0.1,
        2000,
        default=None,
        absent="48",
    )
    step_v: float | None = _term("Decaying step: height at the edge.", "V", -1000, 1000)
    step_tau_s: float | None = _term("Its time constant.", "s", 0.0, 1e-3)
    ring_v: float | None = _term("Ring, a damped cosine: height at the edge.", "V", -1000, 1000)
    ring_hz: float | None = _term("Its frequency, at most half of the chip's clock.", "Hz", 0.0, 25e6)
    ring_tau_s: float | None = _term("Its time constant.", "s", 0.0, 1e-3)
    lobe_v: float | None = _term("Lobe after an edge that turns a switch off: height of its peak.", "V", -1000, 1000)
    lobe_s: float | None = _term("Time from the edge to this peak.", "s", 0.0, 1e-3)
    slew_s: float | None = _term("Time in which a terminal goes to its new voltage, in a straight line.", "s", 0, 10e-6)
    own: float | None = _term("Share of step, ring and lobe in the channel of the leg that switches.", "", -10, 10)
    coupling: float | None = _term("Share of them in the channel of every other leg, the open one too.", "", -10, 10)
    current_step_share: float | None = _term(
        "Common-mode error of the current channel of the leg that switches, of the full scale.", "", -1, 1
    )
    current_tau_s: float | None = _term(
        "Time constant of this error, and of the link's current channel after a step.", "s", 0.0, 1e-3
    )

    def value(self, key: str) -> float:
        """Value of a key, else that of the preset, else 0 (`own`) or what the plant takes."""
        stated = getattr(self, key)
        if stated is not None:
            return float(stated)
        default = 0.0 if key == "current_step_share" else asdict(EdgeParams())[key]
        return PRESETS[self.preset].get(key, default)

    def params(self, current_full_scale_a: float) -> EdgeParams | None:
        """The terms as the plant takes them; None: there are none."""
        keys = [key for key in asdict(EdgeParams()) if key != "current_step_a"]
        share = self.value("current_step_share")
        terms = EdgeParams(**{key: self.value(key) for key in keys}, current_step_a=share * current_full_scale_a)
        heights = (terms.step_v, terms.ring_v, terms.lobe_v, terms.slew_s, terms.current_tau_s)
        return terms if any(heights) else None

    @model_validator(mode="after")
    def _whole(self) -> Self:
        stated = {key for key in self.model_fields_set if getattr(self, key) is not None} - {"preset"}
        for height, others in NEEDS.items():
            for key in others:
                if self.value(height) != 0 and self.value(key) == 0:
                    raise conflict(key, f"must be above 0 beside {height} = {self.value(height):g}")
                # The time constant of the current channels works without a step, too.
                if self.value(height) == 0 and key in stated and self.value(key) != 0 and key != "current_tau_s":
                    raise conflict(key, f"has no effect without {height}")
        if self.value("ring_v") != 0 and self.value("ring_hz") * self.value("ring_tau_s") < 0.25:
            times = f"{with_unit(self.value('ring_hz'), 'Hz')} and ring_tau_s = {self.value('ring_tau_s'):g} s"
            raise conflict("ring_hz", f"{times} are no ring, it is gone in a quarter of a swing: state it as a step")
        voltage = any(self.value(key) != 0 for key in ("step_v", "ring_v", "lobe_v"))
        for key in ("own", "coupling"):
            if key in stated and not voltage:
                raise conflict(key, "has no effect without step_v, ring_v or lobe_v")
        if voltage and self.value("own") == 0 and self.value("coupling") == 0:
            raise conflict("coupling", "is 0 as is own: step, ring and lobe reach no channel")
        if "reference_v" in stated and not voltage and self.value("current_step_share") == 0:
            raise conflict("reference_v", "has no effect without a height")
        return self
