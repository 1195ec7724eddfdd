# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""The drive and its motor in a running simulation, as a cocotb test leads and sees them."""

from __future__ import annotations

import math
import os
import pickle
from collections.abc import Callable, Coroutine, Iterable
from functools import cache
from inspect import isawaitable
from numbers import Real
from pathlib import Path
from typing import Any, TypeVar

import cocotb
import numpy as np
from numpy.typing import NDArray

from fluxlock.base.processes import end_with_parent
from fluxlock.config import Scenario
from fluxlock.cosim.native import peek
from fluxlock.cosim.plan import PLAN_ENV, Action, SessionPlan
from fluxlock.cosim.planned import session_of
from fluxlock.cosim.session import BOOT_CYCLES, LISTEN_CYCLES, PlantFault, Session
from fluxlock.drive.bench import SCENARIO_FILE
from fluxlock.drive.can import CanMaster
from fluxlock.drive.copies import Branch
from fluxlock.drive.pins import refuse_writes
from fluxlock.drive.registers import Registers
from fluxlock.firmware.binding import names, types
from fluxlock.generate.memory import TELEMETRY_ADDRESS
from fluxlock.plant import Plant
from fluxlock.plant.layout import VDC
from fluxlock.python_load import PERIOD_CYCLES, LoadFunction, PythonLoad
from fluxlock.results.metrics import Advance, Analysis
from fluxlock.results.rundata import LogKind, RunData, SimulationFault

Value = TypeVar("Value")
AT_SPEED = 0.01  # of the target
LEAST_BAND_RPM = 100.0
PHASES = "ABCDE"
LOAD_PARTS = ("constant_nm", "coulomb_nm", "viscous_nm_s_per_rad", "fan_nm_s2_per_rad2")
OWN = ("dut", "session", "scenario", "registers")  # attributes of a Drive
SENSING_ERRORS = ("offset_lsb", "gain", "noise_lsb")
# What `fault` takes beside the phases, by kind.
FAULT_DETAILS: dict[str, tuple[str, ...]] = {
    "open_phase": (),
    "shorted_winding": ("turns_fraction",),
    "stuck_high": (),
    "stuck_low": (),
    "stuck_channel": ("channel", "code"),
    "noisy_channels": ("noise_lsb",),
    "stuck_rotor": (),
    "fault_pin": ("level",),
    "supply": ("supply_v", "ramp_s"),
    "clear": (),
}


class DriveError(AssertionError):
    """The drive did not do what a test has waited for; the text says what it did."""


def check_names(what: str, given: Iterable[str], there: Iterable[str]) -> None:
    """Raise TypeError, with the right names, if one is wrong."""
    wrong = sorted(set(given) - set(there))
    if wrong:
        raise TypeError(f"{what} does not take {', '.join(wrong)}; it takes: {', '.join(there) or 'nothing more'}")


def check_number(name: str, value: object, least: float = -math.inf) -> None:
    """Raise ValueError for what is no finite number, or is less than `least`."""
    number = float(value) if isinstance(value, Real) and not isinstance(value, bool) else math.nan
    if not (math.isfinite(number) and number >= least):
        bound = "" if math.isinf(least) else f", at least {least:g}"
        raise ValueError(f"{name} = {value!r}: must be a number{bound}")


def _asked(condition: Callable[[], object]) -> object:
    found = condition()
    if isawaitable(found):
        if isinstance(found, Coroutine):
            found.close()
        raise TypeError(f"until asks {condition!r} without awaiting it: give a plain function, or await it in the test")
    return found


@cache
def session_of_process() -> Session:
    """Of the plan that the environment names. Copies of the process inherit it, made before the first clock."""
    if PLAN_ENV not in os.environ:
        raise DriveError("no scenario: start the simulator by run_tests, or with the arguments of a Bench")
    return session_of(SessionPlan.load(Path(os.environ[PLAN_ENV])))


class Drive:
    """Chip, firmware, inverter, motor and load of one simulation, from power-up on. A simulation has one.

    dut: cocotb's handle of `fl_soc`. Its pins can be read and awaited. A write raises TypeError: the plant drives them.
    Units: SI unless a name says otherwise; mechanical r/min, electrical degrees. Times count from power-up.
    The plant's values are those of its last event, a gate edge or a sample: at most one sample period old.
    Waiting: every method that takes simulated time is a coroutine. Triggers of cocotb work beside them. Awaiting an
    edge is exact and slow (some 0.2 M clocks a second); `until` looks once a millisecond and costs next to nothing.
    """

    made = False

    def __init__(self, dut: Any) -> None:  # noqa: ANN401  # cocotb's handle has no type
        if Drive.made:
            raise DriveError(
                "this simulation has a Drive whose chip has run: make each test a drive_test, or run one a simulation"
            )
        Drive.made = True
        end_with_parent()
        self.dut = dut
        self.session = session_of_process()
        self.scenario: Scenario = pickle.loads((self.session.plan.folder / SCENARIO_FILE).read_bytes())
        self.session.begin()
        self.registers = Registers(self.session.native)
        bus = self.scenario.can
        self._can = None if bus is None else CanMaster(self.session, bus)
        refuse_writes()
        self._broken: Exception | None = None
        self._load: PythonLoad | None = None
        cocotb.start_soon(self._keep_up())

    def __setattr__(self, name: str, value: object) -> None:
        """AttributeError for what a test cannot set: it would have no effect."""
        if not name.startswith("_") and name not in OWN:
            raise AttributeError(f"a Drive has no {name} to be set: load, supply, fault and set change things")
        super().__setattr__(name, value)

    async def _keep_up(self) -> None:
        """Drain the logs in time, whatever the test awaits; what goes wrong there is raised at its next wait."""
        try:
            while True:
                await self.session.advance(self.session.cycle + self.session.plan.batch_cycles)
        except (PlantFault, BufferError) as error:
            self._broken = error

    # Time

    @property
    def time_s(self) -> float:
        """Simulated time since power-up."""
        return self.session.cycle / self.session.plan.clock_hz

    async def run(self, seconds: float) -> None:
        """Let a simulated time pass."""
        check_number("seconds", seconds, 0.0)
        await self._to(self.session.cycle + round(seconds * self.session.plan.clock_hz))

    async def until(self, when: float | Callable[[], object], within_s: float = 1.0, every_s: float = 1e-3) -> None:
        """Until a time (s since power-up), or until a condition is true, which is asked every `every_s`.

        Raises DriveError if that takes longer than `within_s`, ValueError for a time that is past, TypeError for a
        condition that has to be awaited.
        """
        if not callable(when):
            check_number("when", when)
            cycle = round(when * self.session.plan.clock_hz)
            if cycle < self.session.cycle:
                raise ValueError(f"until {when:g} s: that time is past; {self}")
            await self._to(cycle)
            return
        end_s = self.time_s + within_s
        while not _asked(when):
            if self.time_s >= end_s:
                raise DriveError(f"not true within {within_s:g} s; {self}")
            await self._to(self.session.cycle + max(1, round(every_s * self.session.plan.clock_hz)))

    async def _to(self, cycle: int) -> None:
        await self.session.wait_until(cycle)
        if self._broken is not None:
            raise self._broken

    def branch(self, values: Iterable[Value], jobs: int = 1) -> Branch[Value]:
        """Go on from here once for every value: `for end in drive.branch(loads): ...`, in copies of the simulation.

        The body runs in a copy each; what the test wants of it, it gives to `end.keep`, and finds it in `kept` of the
        branch after the loop. The test itself then goes on from here, too. jobs: copies at a time. Raises BranchError,
        with every traceback, when ends have failed. The body must not leave the loop by `break` or `return`.
        """
        return Branch(values, jobs)

    # Drive

    @property
    def can(self) -> CanMaster:
        """A master on the chip's CAN bus. Raises DriveError if the scenario has none."""
        if self._can is None:
            raise DriveError("there is no CAN bus: the scenario has no [can]")
        return self._can

    async def start(self, rpm: float, within_s: float = 2.0) -> None:
        """Set the speed, start, and wait until the true speed is within 1 % of it (100 r/min at least).

        Raises DriveError if the drive refuses, stops with a fault, or is not there within `within_s`.
        """
        await self.set("speed_rpm", round(rpm))
        await self.console("start")
        await self.at_speed(rpm, within_s)

    async def at_speed(self, rpm: float, within_s: float = 2.0) -> None:
        """Wait as `start` does, for a speed that has been set."""
        band = max(AT_SPEED * abs(rpm), LEAST_BAND_RPM)

        def arrived() -> bool:
            return self.state == "running" and abs(self.speed_rpm - rpm) <= band

        await self.until(lambda: arrived() or self.state == "fault", within_s)
        if not arrived():
            raise DriveError(f"stopped on the way to {rpm:g} r/min; {self}")

    async def stop(self, now: bool = False) -> None:
        """Tell the drive to stop: down a ramp, or `now` with its gates off. Returns at once, the rotor still turns.

        Before the next start: `await drive.until(lambda: drive.state == "ready")`.
        """
        await self.console("stop now" if now else "stop")

    async def console(self, line: str) -> list[str]:
        """Send a console line; the lines of its reply without the last one, `ok`.

        Raises DriveError with the drive's text if it answers with an error, or not at all.
        """
        session = self.session
        if session.cycle < BOOT_CYCLES:
            await self._to(BOOT_CYCLES)
        session.drain()
        begin = len(session.text)
        sent = session.lines.add(session.cycle, line)
        while sent.answer is None:
            await self._to(session.cycle + LISTEN_CYCLES)
            session.drain()
        if sent.answer != "ok":
            raise DriveError(f"console line {line!r}: {sent.answer.removeprefix('error: ')}; {self}")
        return [text.strip() for text in session.text[begin:].splitlines() if text.strip() not in ("", "ok")]

    async def get(self, name: str) -> float | str:
        """A value of the console's list by its name: a number, or a word where it is none."""
        for line in await self.console(f"get {name}"):
            found, _, value = line.partition(" ")
            if found == name:
                try:
                    return float(value)
                except ValueError:
                    return value
        raise DriveError(f"the console's reply to 'get {name}' does not hold it")

    async def set(self, name: str, value: float | str) -> None:
        """Set a value of the console's list."""
        await self.console(f"set {name} {value}")

    def _telemetry(self, field: str) -> int:
        return int(peek(TELEMETRY_ADDRESS + types().offsetof("telemetry_t", field), 1)[0])

    @property
    def state(self) -> str:
        """The drive's state as the firmware publishes it: `ready`, `starting`, `running`, `stopping`, `fault`, ..."""
        return names("drive_state_t")[self._telemetry("state")]

    @property
    def fault_name(self) -> str:
        """Name of the drive's fault, `none` without one."""
        return names("fault_t")[self._telemetry("fault")]

    @property
    def gates_off(self) -> bool:
        """No switch is asked for."""
        return int(self.dut.gate_o.value) == 0

    @property
    def gate_changes(self) -> int:
        """Changes of the gates since power-up; those of one clock are one."""
        self.session.drain()
        return int(np.count_nonzero(self.session.log()[:, 1] == LogKind.GATES))

    # Motor, load, inverter

    @property
    def plant(self) -> Plant:
        """The plant itself, for what has no method here. Read its values; change it by the methods here."""
        return self.session.plant

    @property
    def speed_rpm(self) -> float:
        """True speed of the shaft, negative backwards."""
        return self.plant.speed_rpm

    @property
    def angle_deg(self) -> float:
        """True electrical angle, 0 to 360."""
        return math.degrees(self.plant.theta_e_rad) % 360.0

    @property
    def currents_a(self) -> NDArray[np.float64]:
        """Phase currents into the motor, [phase]."""
        return self.plant.currents_a

    @property
    def torque_nm(self) -> float:
        """Torque of the motor, before friction."""
        return self.plant.torque_nm

    @property
    def link_v(self) -> float:
        """True voltage of the DC link."""
        return float(self.plant.state[VDC])

    @property
    def pole_pairs(self) -> int:
        """Electrical turns in a mechanical one."""
        return self.plant.params.machine.pole_pairs

    def load(self, *, factor: float | None = None, ramp_s: float = 0.0, **torques: float) -> None:
        """Change the load, in a ramp of `ramp_s` or at once.

        factor: of every part of the scenario's load. torques: single parts, `constant_nm`, `coulomb_nm`,
        `viscous_nm_s_per_rad`, `fan_nm_s2_per_rad2`; with a factor they go before it. TypeError for another name, or
        with neither.
        """
        check_names("load", torques, LOAD_PARTS)
        if factor is None and not torques:
            raise TypeError(f"load needs a factor, or a part of the load: {', '.join(LOAD_PARTS)}")
        for name, value in {"ramp_s": ramp_s, **({} if factor is None else {"factor": factor}), **torques}.items():
            check_number(name, value)
        if factor is not None:
            mechanics = self.session.plan.plant.mechanics
            torques = {part: factor * float(getattr(mechanics, part)) for part in LOAD_PARTS} | torques
        self._act("load", {**torques, "ramp_s": ramp_s})

    def load_nm(self, function: LoadFunction | None) -> None:
        """Put a load that is written in Python on top of the others, from now on; None: take it away.

        function: of speed_rad_s, angle_rad (mechanical, unwrapped) and time_s, returns N m, see `fluxlock.simulate`. It
        is asked every 20 us. SimulationFault, at the next wait, if it breaks; ConfigError for what is no such function.
        """
        self._load = None if function is None else PythonLoad(function)
        if self._load is None:
            self.plant.hold_load(0.0)
        else:
            cocotb.start_soon(self._ask(self._load))

    async def _ask(self, load: PythonLoad) -> None:
        try:
            while self._load is load:
                self.session.ask(load)
                await self.session.wait_until(self.session.cycle + PERIOD_CYCLES)
        except SimulationFault as error:
            self._broken = error

    def supply(self, volts: float, ramp_s: float = 0.0) -> None:
        """Change the supply's voltage, in a ramp of `ramp_s` or at once."""
        check_number("volts", volts, 0.0)
        check_number("ramp_s", ramp_s, 0.0)
        self._act("supply", {"supply_v": volts, "ramp_s": ramp_s})

    def fault(self, kind: str, phases: str = "A", **details: object) -> None:
        """Break something of motor, inverter or sensing, or make it whole again (`clear`).

        kind: `open_phase`, `shorted_winding`, `stuck_high`, `stuck_low`, each of `phases`, which are letters;
        `stuck_channel`, `noisy_channels`, `stuck_rotor`, `fault_pin`, `supply`, `clear`. `shorted_winding`: of the
        turns of `phases` `turns_fraction` still act, 0.05; one phase is a short to the star point, two are one between
        terminals. details: see `FAULT_DETAILS` and `Plant.inject_fault`. TypeError for those that a kind does not take.
        """
        if kind not in FAULT_DETAILS:
            raise ValueError(f"fault {kind!r}: must be one of {', '.join(FAULT_DETAILS)}")
        check_names(f"fault {kind!r}", details, FAULT_DETAILS[kind])
        there = PHASES[: self.plant.phases]
        if not phases or set(phases) - set(there):
            raise ValueError(f"phases {phases!r}: letters of {there}, for instance {there[:2]!r}")
        numbers = tuple(there.index(letter) for letter in phases)
        self._act("fault", {"kind": kind, "phases": numbers, **details})

    def disturb(self, channel: str | None = None, **errors: float) -> None:
        """Put an error into the sensing: `offset_lsb` and `gain` of a channel, `noise_lsb` of all: `Plant.disturb`."""
        check_names("disturb", errors, SENSING_ERRORS)
        if not errors:
            raise TypeError(f"disturb needs an error: {', '.join(SENSING_ERRORS)}")
        self._act("sensor", {"channel": channel, **errors})

    def shaft(self, mode: str) -> None:
        """The shaft turns freely (`free`), at its present speed whatever the torque (`imposed`), or not (`locked`)."""
        self._act("mechanics", {"mode": mode})

    def force_pin(self, pin: str, level: int, cycles: int) -> None:
        """Give an input pin of the chip a level for so many clocks. pin: `fault_pin_i`, `hall_i[0]`, ..."""
        self._act("pin", {"pin": pin, "level": level, "cycles": cycles})

    def _act(self, kind: str, arguments: dict[str, Any]) -> None:
        self.session.act(Action(self.session.cycle, kind, arguments))

    # What was recorded

    def data(self, last_s: float = math.inf) -> RunData:
        """Logs and waveforms of the run so far or of its last seconds, as the analysis of a run takes them."""
        session = self.session
        session.drain()
        first = session.cycle - last_s * session.plan.clock_hz
        log, records, events = session.log(), session.plant.records(), session.plant.events()
        return RunData(
            log=log[log[:, 0] >= first],
            records=records[records["t_cycle"] >= first],
            plant_events=events[events["t_cycle"] >= first],
            zoom=session.plant.zoom_records(),
            clock_hz=session.plan.clock_hz,
            pole_pairs=session.plan.plant.machine.pole_pairs,
            cycles=session.cycle,
            wall_s=0.0,
            seed=session.plan.seed,
            uart=session.text.splitlines(),
        )

    def window(self, from_s: float, to_s: float | None = None) -> dict[str, Any]:
        """Metrics of a span of time, as `fluxlock run` has them of a `[[window]]`; `to_s`: default now.

        Raises ValueError if the span has no length or is not over yet.
        """
        now_s = self.time_s
        end_s = now_s if to_s is None else to_s
        if not from_s < end_s <= now_s + 0.5 / self.session.plan.clock_hz:
            raise ValueError(f"window {from_s:g} to {end_s:g} s: must end after its begin and by now, {now_s:g} s")
        data = self.data(now_s - from_s + 0.02)  # and some turns before it
        return Analysis(data, Advance.of(self.scenario)).window(from_s, end_s)

    @property
    def angle_error_deg(self) -> float:
        """Mean error of the drive's angle in the last 10 ms, positive ahead; nan if it has not commutated meanwhile.

        Vector: published angle less true angle at the current samples. Six-step: true commutations against where they
        should be; a late one is behind.
        """
        found = self.window(self.time_s - 0.01)
        if self.scenario.drive.method == "vector":
            mean = found["angle_error_deg"]["mean"]
        else:
            late = found["commutation_error_deg"]["mean"]
            mean = None if late is None else -late
        return math.nan if mean is None else float(mean)

    def __str__(self) -> str:
        happened = f"state {self.state}, fault {self.fault_name}"
        return f"at {self.time_s:.6f} s: {happened}, true speed {self.speed_rpm:.0f} r/min"
