# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""The two benches of a first start: a board at a serial port, and a simulated one for practice."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Protocol

from rich.console import Console as Terminal

from fluxlock.base.stage import Progress
from fluxlock.commission.bench import bench_for
from fluxlock.commission.board import measure_on_board
from fluxlock.commission.simulate import Measured as Identified
from fluxlock.commission.simulate import measure
from fluxlock.config import ConfigError, Motor, Scenario
from fluxlock.config.drive import MotorError
from fluxlock.cosim.parameters import check_parameters
from fluxlock.first_start.turn import Drive
from fluxlock.flash.board_console import Console, Port
from fluxlock.flash.command import check_board, open_port, plan_of, write_and_start
from fluxlock.flash.loader import SerialLine
from fluxlock.native.play import ScenarioPlay
from fluxlock.native.player import check_playable, player
from fluxlock.wiring.measure import Measured as Wired
from fluxlock.wiring.measure import on_board, on_twin

BOOT_S = 0.1
KEPT_S = 1.0  # of what the twin records


class Bench(Protocol):
    """Where the machine is."""

    def wiring(self, scenario: Scenario) -> Wired:
        """Test legs and sensors. Raises WiringError."""

    def identify(self, scenario: Scenario, progress: Progress) -> Identified:
        """Measure the machine. Raises MeasurementError."""

    @contextmanager
    def drive(self, scenario: Scenario, measured: Motor) -> Iterator[Drive]:
        """The scenario's drive, which knows the machine by the measured file."""


def wiring_of(scenario: Scenario) -> Scenario:
    """A vector drive of the same machine and inverter, for the test of the wiring."""
    bench = bench_for(scenario)
    vector = bench.drive.vector.model_copy(update={"dead_time_compensation": True})
    return bench.model_copy(update={"drive": bench.drive.model_copy(update={"vector": vector})})


def measured_motor(file: Motor, measured: Motor) -> Motor:
    """The file's machine with what was measured of it; sensors and shape of the EMF are the file's."""
    return file.model_copy(
        update={
            "resistance_ohm": measured.resistance_ohm,
            "inductance_h": measured.inductance_h,
            "inductance_q_h": measured.inductance_q_h,
            "psi_vs": tuple(psi * measured.emf_fundamental / file.emf_fundamental for psi in measured.psi_vs),
            "inertia_kgm2": measured.inertia_kgm2,
        }
    )


def quiet(scenario: Scenario) -> Scenario:
    """Without its events. Raises ConfigError for what the firmware does not take."""
    changed = scenario.model_copy(update={"event": [], "window": [], "expect": []})
    check_parameters(changed)
    return changed


class BoardDrive:
    """A drive at a serial port; its clock is ours."""

    def __init__(self, port: Port) -> None:
        self.ask = Console(port).ask
        self.wait: Callable[[float], None] = time.sleep


class TwinDrive:
    """A drive as a program on a machine model."""

    def __init__(self, play: ScenarioPlay) -> None:
        self._play = play
        self.wait(BOOT_S)

    def ask(self, line: str) -> list[str]:
        """See `Drive`."""
        return list(self._play.firmware.command(line))

    def wait(self, seconds: float) -> None:
        """See `Drive`."""
        self._play.advance(self._play.now + seconds)
        self._play.take()


class BoardBench:
    """A board at a serial port, which waits for its reset before each program. wait_s: how long."""

    def __init__(self, port: Path, wait_s: float) -> None:
        self._port, self._wait_s = port, wait_s

    @contextmanager
    def _running(self, scenario: Scenario) -> Iterator[Port]:
        steps = plan_of(scenario)
        with open_port(self._port) as serial:
            write_and_start(SerialLine(serial), steps, self._wait_s, Terminal(stderr=True))
            time.sleep(BOOT_S)
            yield serial

    def wiring(self, scenario: Scenario) -> Wired:
        """See `Bench`."""
        with self._running(wiring_of(scenario)) as port:
            return on_board(wiring_of(scenario), port)

    def identify(self, scenario: Scenario, progress: Progress) -> Identified:
        """See `Bench`."""
        return measure_on_board(bench_for(scenario), self._port, self._wait_s, progress)

    @contextmanager
    def drive(self, scenario: Scenario, measured: Motor) -> Iterator[Drive]:
        """See `Bench`."""
        motor = measured_motor(scenario.motor, measured)
        with self._running(quiet(scenario.model_copy(update={"motor": motor}))) as port:
            yield BoardDrive(port)


class SimulatedBench:
    """The scenario's machine on the twin and, for the measurement, on the chip. folder: of the simulator's files."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder

    def wiring(self, scenario: Scenario) -> Wired:
        """See `Bench`."""
        return on_twin(wiring_of(scenario), scenario.seed)

    def identify(self, scenario: Scenario, progress: Progress) -> Identified:
        """See `Bench`."""
        return measure(bench_for(scenario), self._folder, scenario.seed, progress)

    @contextmanager
    def drive(self, scenario: Scenario, measured: Motor) -> Iterator[Drive]:
        """See `Bench`. The plant stays the scenario's; what the file says otherwise is an error of the firmware's."""
        true, measured = scenario.motor, measured_motor(scenario.motor, measured)

        def factor(found: float, real: float) -> float:
            return min(2.0, max(0.5, found / real))

        error = MotorError(
            resistance=factor(sum(measured.resistance_ohm), sum(true.resistance_ohm)),
            inductance=factor(measured.mean_inductance_h, true.mean_inductance_h),
            flux=factor(sum(measured.psi_vs) * measured.emf_fundamental, sum(true.psi_vs) * true.emf_fundamental),
            inertia=factor(measured.inertia_kgm2, true.inertia_kgm2),
        )
        told = scenario.drive.model_copy(update={"motor_error": error})
        yield TwinDrive(player(quiet(scenario.model_copy(update={"drive": told})), scenario.seed, KEPT_S))


def check_bench(scenario: Scenario, port: Path | None) -> None:
    """ConfigError for a scenario that cannot be led through the steps, at a board's port or, None, simulated."""
    if scenario.motor.phases != 3:
        raise ConfigError([scenario.sources.problem("motor.phases", "the steps are of three phases")])
    if port is None:
        check_playable(quiet(scenario))
        return
    check_board(scenario)
    check_board(wiring_of(scenario))


def bench_of(port: Path | None, wait_s: float, folder: Path) -> Bench:
    """A board at a port, whose reset it waits for, or the simulated bench. folder: of the simulator's files."""
    return BoardBench(port, wait_s) if port is not None else SimulatedBench(folder / "simulator")
