# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Inverter file: supply, power stage, sensing, protection."""

from __future__ import annotations

from typing import ClassVar, Literal, Self

from pydantic import Field, model_validator

from fluxlock.config.edge import Edge
from fluxlock.config.fields import Model, PhaseOrder, PhaseValues, check_once, conflict, quantity, with_unit

SafeState = Literal["off", "short"]


class Sensing(Model):
    """Converter and the analog chain before it."""

    bits: int = quantity("Resolution of the converter codes; the chip takes 12.", "bit", 12, 12, default=12)
    sample_period_s: float = quantity("Period of the sample sets (all channels at once).", "s", 0.32e-6, 1e-3)
    conversion_s: float = quantity("Time from sample-and-hold to valid codes.", "s", 0.0, 1e-3, default=0.4e-6)
    voltage_full_scale_v: float = quantity("Voltage at full scale of the voltage channels.", "V", 1, 2000)
    current_full_scale_a: float = quantity("Current at full scale, both signs.", "A", 0.1, 5000)
    divider_pole_s: float = quantity(
        "Time constant of the voltage dividers' RC pole; 0 = none.", "s", 0.0, 1e-3, default=0.0
    )
    divider_gain: PhaseValues = quantity(
        "Gain error of the phases' dividers as a factor: one number or three.",
        "",
        0.5,
        2.0,
        default=(1.0, 1.0, 1.0),
    )
    noise_lsb: float = quantity("Noise of every sample, rms, white.", "LSB", 0.0, 50.0, default=1.0)
    offset_lsb: PhaseValues = quantity(
        "Offset of the phase-current channels: one number or three.",
        "LSB",
        -200,
        200,
        default=(0.0, 0.0, 0.0),
    )
    current_order: PhaseOrder = Field(
        default="ABC",
        description="Phases whose current sensors are at the inputs A, B, C of the chip. The drive takes them for "
        '`"ABC"`: another order is a wrong wiring, which `fluxlock check-wiring` names.',
    )
    current_inverted: list[Literal["A", "B", "C"]] = Field(
        default_factory=list,
        description="Inputs that show the current with the wrong sign, a wrong wiring too.",
    )
    voltage_order: PhaseOrder = Field(
        default="ABC",
        description="The same as `current_order` of the voltage dividers.",
    )
    unconnected: list[Literal["va", "vb", "vc", "ia", "ib", "ic"]] = Field(
        default_factory=list,
        description="Inputs without a sensor: they show zero and noise.",
    )
    edge: Edge = Field(default_factory=Edge, description="What switching edges leave in the channels.")

    @property
    def sources(self) -> dict[str, tuple[str, float]]:
        """Signal at the input of a channel, and its factor: what differs from a right wiring of three phases."""
        found = {}
        for kind, order in (("v", self.voltage_order), ("i", self.current_order)):
            for letter, phase in zip("ABC", order, strict=True):
                name, source = kind + letter.lower(), kind + phase.lower()
                sign = -1.0 if kind == "i" and letter in self.current_inverted else 1.0
                factor = 0.0 if name in self.unconnected else sign
                if (source, factor) != (name, 1.0):
                    found[name] = (source, factor)
        return found

    @property
    def step_v(self) -> float:
        """Step of the voltage channels."""
        return self.voltage_full_scale_v / 2.0**self.bits

    @property
    def settling_s(self) -> float:
        """Time from a gate edge until a sample counts as far as the dividers go (s): it follows one that is settled."""
        return max(0.4e-6, 6.0 * self.divider_pole_s) + self.sample_period_s

    @model_validator(mode="after")
    def _each_once(self) -> Self:
        for key in ("current_inverted", "unconnected"):
            check_once(key, getattr(self, key))
        return self

    @model_validator(mode="after")
    def _conversion(self) -> Self:
        if self.conversion_s > self.sample_period_s:
            raise conflict(
                "conversion_s",
                f"{with_unit(self.conversion_s, 's')} is longer than sample_period_s "
                f"({with_unit(self.sample_period_s, 's')})",
            )
        return self


class Protection(Model):
    """Limits at which the hardware trips, and what it does then."""

    phase_current_a: float = quantity("Phase current, both signs.", "A", 0.1, 5000)
    dc_current_a: float = quantity("DC-link current, both signs.", "A", 0.1, 5000)
    over_voltage_v: float | None = quantity(
        "DC-link voltage above which the drive trips.",
        "V",
        1,
        2000,
        default=None,
        absent="1.25 `supply_v`, at most 0.98 `voltage_full_scale_v`",
    )
    under_voltage_v: float | None = quantity(
        "DC-link voltage below which the drive trips; 0 = never.", "V", 0, 2000, default=None, absent="0.6 `supply_v`"
    )
    safe_state: SafeState = Field(
        default="off",
        description="After a hardware trip: all gates off, or the lower ones on (`short`), an active short circuit of "
        "the machine, unless over-current, the fault pin, the converter or a changed setting rules it out.",
    )


class BrakeChopper(Model):
    """Resistor that takes regenerated energy from the DC link."""

    on_v: float = quantity("DC-link voltage at which it turns on.", "V", 1, 2000)
    off_v: float = quantity("DC-link voltage at which it turns off.", "V", 1, 2000)
    resistance_ohm: float = quantity("Resistance.", "Ohm", 0.01, 1e4)
    longest_on_s: float | None = quantity(
        "The chip's brake pin drives it, for no longer than this between two falls of the link below `off_v`.",
        "s",
        1e-4,
        40,
        default=None,
        absent="it acts by itself, for any time",
    )

    @model_validator(mode="after")
    def _hysteresis(self) -> Self:
        if self.off_v >= self.on_v:
            raise conflict("off_v", f"{with_unit(self.off_v, 'V')} is not below on_v ({with_unit(self.on_v, 'V')})")
        return self


class Inverter(Model):
    """Inverter of three or five legs with its supply and its sensing.

    >>> from fluxlock import load_inverter
    >>> load_inverter("inverters/drive-48v.toml").protection.phase_current_a  # A
    22.0
    """

    OF_A_FILE: ClassVar[bool] = True

    name: str = Field(min_length=1, description="Name for tables and plots.")
    description: str = Field(default="", description="Free text.")
    legs: int = quantity("Legs: 3 or 5, as many as the motor has phases.", "", 3, 5, default=3)
    supply_v: float = quantity("Voltage of the supply.", "V", 1, 1500)
    supply_resistance_ohm: float = quantity("Resistance of the supply.", "Ohm", 0.0, 100, default=0.0)
    dc_link_f: float = quantity(
        "Capacitance of the DC link; 0 = none (the supply feeds the legs directly).",
        "F",
        0.0,
        1.0,
        default=0.0,
    )
    supply_diode: bool = Field(default=False, description="`true`: no energy returns to the supply.")
    on_resistance_ohm: float = quantity("On-resistance of a switch.", "Ohm", 0.0, 10, default=0.0)
    diode_drop_v: float = quantity("Forward drop of a diode.", "V", 0.0, 10, default=0.7)
    diode_resistance_ohm: float = quantity("Resistance of a diode.", "Ohm", 0.0, 10, default=0.0)
    dead_time_s: float = quantity(
        "Least gap between one switch of a leg turning off and the other turning on.", "s", 0.0, 20e-6
    )
    min_pulse_s: float = quantity("Shortest pulse and shortest gap.", "s", 40e-9, 80e-6)
    gate_high_active_low: bool = Field(default=False, description="Upper gates are active low: the chip is built so.")
    gate_low_active_low: bool = Field(default=False, description="Lower gates are active low: the chip is built so.")
    gate_delay_s: float = quantity(
        "Delay of gate driver and switch; the chip commutates that much earlier.",
        "s",
        0.0,
        10e-6,
        default=0.0,
    )
    precharge_s: float = quantity(
        "Time before a start in which all lower switches are on and charge the bootstrap capacitors.",
        "s",
        1e-4,
        1.0,
        default=2e-3,
    )
    sensing: Sensing = Field(description="Converter and analog chain.")
    protection: Protection = Field(description="Hardware trips.")
    brake_chopper: BrakeChopper | None = Field(default=None, description="Brake chopper, if there is one.")

    @property
    def gate_polarity(self) -> int:
        """Gate pins that are active low: bit 0 the upper ones, bit 1 the lower ones."""
        return int(self.gate_high_active_low) | int(self.gate_low_active_low) << 1

    def with_pole(self, pole_s: float) -> Self:
        """The same one with another time constant of its dividers (s)."""
        sensing = self.sensing.model_copy(update={"divider_pole_s": pole_s})
        return self.model_copy(update={"sensing": sensing})

    @property
    def over_voltage_v(self) -> float:
        """Trip of the link, below the converter's full scale, which could never be exceeded."""
        stated_v, full_v = self.protection.over_voltage_v, self.sensing.voltage_full_scale_v
        return min(1.25 * self.supply_v, 0.98 * full_v) if stated_v is None else stated_v

    @property
    def under_voltage_v(self) -> float:
        """Trip of the link, 0: never."""
        stated_v = self.protection.under_voltage_v
        return 0.6 * self.supply_v if stated_v is None else stated_v

    @model_validator(mode="after")
    def _consistent(self) -> Self:
        if self.legs == 4:
            raise conflict("legs", "4 is not permitted, permitted: 3, 5")
        for key in ("divider_gain", "offset_lsb") if self.legs == 5 else ():
            if len(set(getattr(self.sensing, key))) > 1:
                raise conflict(f"sensing.{key}", "must be one number with legs = 5")
        if self.legs == 5 and self.sensing.sources:
            raise conflict("sensing", "has a wrong wiring, which is of three phases only, with legs = 5")
        if self.dc_link_f > 0 and self.supply_resistance_ohm == 0:
            raise conflict("supply_resistance_ohm", "must be above 0 Ohm with a DC-link capacitor (dc_link_f)")
        for key in ("supply_diode", "brake_chopper"):
            if getattr(self, key) and self.dc_link_f == 0:
                raise conflict(key, "needs a DC-link capacitor (dc_link_f)")
        if self.min_pulse_s < self.dead_time_s:
            raise conflict(
                "min_pulse_s",
                f"{with_unit(self.min_pulse_s, 's')} is shorter than dead_time_s "
                f"({with_unit(self.dead_time_s, 's')}): such a pulse vanishes in the dead time",
            )
        highest_v = self.supply_v * max(*self.sensing.divider_gain, 1.0)
        if highest_v > self.sensing.voltage_full_scale_v:
            raise conflict(
                "sensing.voltage_full_scale_v",
                f"{with_unit(self.sensing.voltage_full_scale_v, 'V')} does not cover supply_v times the "
                f"largest divider gain ({with_unit(highest_v, 'V')})",
            )
        for key in ("phase_current_a", "dc_current_a"):
            limit = getattr(self.protection, key)
            if limit >= self.sensing.current_full_scale_a:
                raise conflict(
                    f"protection.{key}",
                    f"{with_unit(limit, 'A')} is not below sensing.current_full_scale_a "
                    f"({with_unit(self.sensing.current_full_scale_a, 'A')})",
                )
        slew_s = self.sensing.edge.value("slew_s")
        if slew_s > self.min_pulse_s:
            text = f"{with_unit(slew_s, 's')} is longer than min_pulse_s ({with_unit(self.min_pulse_s, 's')}): such a "
            raise conflict("sensing.edge.slew_s", text + "pulse never reaches its rail")
        self._check_voltage_limits()
        self._check_brake()
        return self

    def _check_voltage_limits(self) -> None:
        """The link's limits must enclose the supply and lie within what the converter can see."""
        over_v, under_v = self.protection.over_voltage_v, self.protection.under_voltage_v
        supply, full = with_unit(self.supply_v, "V"), with_unit(self.sensing.voltage_full_scale_v, "V")
        if over_v is None and self.supply_v >= 0.98 * self.sensing.voltage_full_scale_v:
            text = f"{full} leaves no room for an over-voltage trip above supply_v ({supply})"
            raise conflict("sensing.voltage_full_scale_v", text)
        # The converter's largest code exceeds the one before it, and nothing below its first code.
        step_v = self.sensing.step_v
        highest_v = self.sensing.voltage_full_scale_v - 2 * step_v
        if over_v is not None and over_v > highest_v:
            text = f"{with_unit(over_v, 'V')} is above {with_unit(highest_v, 'V')}, two steps of the converter below "
            text += f"sensing.voltage_full_scale_v ({full}): it could never act"
            raise conflict("protection.over_voltage_v", text)
        if under_v is not None and 0 < under_v < step_v:
            text = f"{with_unit(under_v, 'V')} is below one step of the converter ({with_unit(step_v, 'V')}): it could "
            text += "never act, which 0 says"
            raise conflict("protection.under_voltage_v", text)
        if over_v is not None and over_v <= self.supply_v:
            text = f"{with_unit(over_v, 'V')} is not above supply_v ({supply}): the drive would trip at once"
            raise conflict("protection.over_voltage_v", text)
        if under_v is not None and under_v >= self.supply_v:
            text = f"{with_unit(under_v, 'V')} is not below supply_v ({supply}): the drive would trip at once"
            raise conflict("protection.under_voltage_v", text)

    def _check_brake(self) -> None:
        """A brake switch that the chip drives works above the supply and below the trip, by codes that differ."""
        brake, limit_v = self.brake_chopper, self.over_voltage_v
        if brake is None or brake.longest_on_s is None:
            return
        on, off, limit = (with_unit(volts, "V") for volts in (brake.on_v, brake.off_v, limit_v))
        if brake.off_v <= self.supply_v:
            text = f"{off} is not above supply_v ({with_unit(self.supply_v, 'V')}): it would never turn off"
            raise conflict("brake_chopper.off_v", text)
        if brake.on_v >= limit_v:
            raise conflict("brake_chopper.on_v", f"{on} is not below the over-voltage trip ({limit})")
        least_v = 4 * self.sensing.step_v
        if brake.on_v - brake.off_v < least_v:
            text = f"{off} is less than 4 converter steps ({with_unit(least_v, 'V')}) below on_v ({on})"
            raise conflict("brake_chopper.off_v", text)
