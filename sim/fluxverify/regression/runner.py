# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Runs the cases side by side; a run whose inputs have not changed is read from its folder instead."""

from __future__ import annotations

import json
import shutil
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path

from fluxlock import commission
from fluxlock.api import simulate
from fluxlock.base.paths import BUILD, PACKAGE, ROOT, content_hash
from fluxlock.base.writable import check_folder, file_lock
from fluxlock.commission.protocol import MeasurementError
from fluxlock.commission.simulate import Measured, measure
from fluxlock.config import Scenario, load_scenario
from fluxlock.config.scenario import Accept
from fluxlock.cosim.chip import build_chip
from fluxlock.cosim.outcome import TRACE, Run, read_outcome
from fluxlock.cosim.program import Row as RegisterRow
from fluxlock.cosim.program import run_program, run_script
from fluxlock.cosim.run import chip_of, image_of
from fluxlock.firmware import build_commission, build_firmware, build_program
from fluxlock.generate.registers import check_build
from fluxlock.plant import PlantParams
from fluxlock.results.rundata import RunData, SimulationFault, load_trace, save_trace

FOLDER = BUILD / "regression"
KEY = "key.txt"
MEASURED = "measured.json"
KEYS = FOLDER / "keys"  # a file per finished run, named by its key: the folder below FOLDER that holds the run
# Python that a run's data depend on; the metrics are computed anew from the data.
RUN_SOURCES = ("plant", "cosim", "config", "firmware")


class RunFailed(Exception):
    """A run of a case broke off."""


@dataclass(frozen=True)
class Runner:
    """What a case gets: its folder, whether to be short, and the way to run scenarios.

    quick: cases run a short version of themselves, with the same limits. seed: of the noise. plots: of each run.
    unvouched: runs that did not pass their verdict and why, a line each.
    """

    case_id: str
    quick: bool = False
    seed: int = 1
    plots: bool = True
    unvouched: list[str] = field(default_factory=list)

    def drive(
        self,
        scenario: str | Path,
        name: str,
        *overrides: str,
        seed: int | None = None,
        accept: Mapping[str, str] | None = None,
        expects: bool = False,
    ) -> Run:
        """Run a scenario (absolute, or in scenarios/) with overrides, or read the same run's result from before.

        name: of the run within the case; a run that another case or a figure has finished is read from there. A run
        that cannot be vouched for is listed in `unvouched`; its `[[expect]]` count with expects only.
        accept: what may happen -> why, as in `[[accept]]`. Raises RunFailed if the simulation breaks off.
        """
        loaded = load_scenario(ROOT / "scenarios" / scenario, overrides)
        accepted = [*loaded.accept, *(Accept.model_validate({"what": k, "why": v}) for k, v in (accept or {}).items())]
        loaded = loaded.model_copy(update={"expect": loaded.expect if expects else [], "accept": accepted})
        used_seed = self.seed if seed is None else seed
        image = image_of(loaded)

        def run(folder: Path) -> None:
            simulate(loaded, folder=folder, seed=used_seed, plots=self.plots)

        folder = self.folder(name)
        made = _made(folder, _key(loaded, used_seed, image), f"{name}, seed {used_seed}", run)
        outcome = read_outcome(loaded, made)
        self.unvouched.extend(f"{name}: {line}" for line in outcome.verdict.failures)
        return outcome

    def program(self, program: str, table: bytes, scenario: str | Path, name: str, *overrides: str) -> RunData:
        """Run a program of `sw/images/bench` with its table on a scenario's chip and plant, or read what it gave."""
        loaded = load_scenario(ROOT / "scenarios" / scenario, overrides)

        def run(folder: Path) -> None:
            save_trace(folder / TRACE, run_program(program, table, loaded, folder, self.seed))

        key = _key(loaded, self.seed, build_program(program), table)
        return load_trace(_made(self.folder(name), key, name, run) / TRACE)

    def script(self, rows: Sequence[RegisterRow], plant: PlantParams, duration_s: float, name: str) -> RunData:
        """Carry out register accesses on the chip with injection in place of the firmware, or read what came before."""

        def run(folder: Path) -> None:
            save_trace(folder / TRACE, run_script(rows, plant, duration_s, folder, self.seed))

        chip = build_chip(phases=plant.machine.phases, injection=True, method="vector")
        key = content_hash(_sources(build_program("script")), chip.key, plant, list(rows), duration_s, self.seed)
        return load_trace(_made(self.folder(name), key, name, run) / TRACE)

    def identify(self, bench: Scenario, name: str) -> Measured:
        """Measure the machine of a bench through the chip, or read what was measured before."""

        def run(folder: Path) -> None:
            try:
                measured = measure(bench, folder / "simulator", self.seed)
            except MeasurementError as error:
                raise SimulationFault(str(error)) from error
            (folder / MEASURED).write_text(json.dumps(asdict(measured)), encoding="utf-8")

        sources = sorted(Path(commission.__file__).parent.glob("*.py"))
        key = _key(bench, self.seed, build_commission(), content_hash(sources).encode())
        stored = _made(self.folder(name), key, name, run) / MEASURED
        return Measured(**json.loads(stored.read_text(encoding="utf-8")))

    def folder(self, name: str) -> Path:
        """Folder of a run."""
        return FOLDER / ("quick" if self.quick else "full") / self.case_id / name


def _made(folder: Path, key: str, what: str, run: Callable[[Path], None]) -> Path:
    """Folder of the run with this key: one that is finished, else `folder`, filled by `run`."""
    with file_lock(KEYS / f"{key}.lock"):
        finished = _finished(key, folder)
        if finished is not None:
            return finished
        shutil.rmtree(folder, ignore_errors=True)
        folder.mkdir(parents=True)
        try:
            run(folder)
        except SimulationFault as error:
            raise RunFailed(f"{what}: {error}") from error
        shutil.rmtree(folder / "simulator", ignore_errors=True)
        (folder / KEY).write_text(key, encoding="utf-8")
        (KEYS / key).write_text(folder.relative_to(FOLDER).as_posix(), encoding="utf-8")
    return folder


def _finished(key: str, folder: Path) -> Path | None:
    """Folder of a finished run: the case's own, else the last one that was made with this key."""
    note = KEYS / key
    candidates = [folder, *([FOLDER / note.read_text(encoding="utf-8")] if note.exists() else [])]
    for candidate in candidates:
        path = candidate / KEY
        if path.exists() and path.read_text(encoding="utf-8") == key:
            return candidate
    return None


def _key(scenario: Scenario, seed: int, image: Path, table: bytes = b"") -> str:
    judged = {"expect", "accept", "expect_trip", "expect_fault"}  # by the data
    settings = json.dumps(scenario.model_dump(mode="json", exclude=judged), sort_keys=True)
    return content_hash(_sources(image), chip_of(scenario).key, settings, seed, table)


def _sources(image: Path) -> list[Path]:
    return [*(path for name in RUN_SOURCES for path in (PACKAGE / name).rglob("*.py")), image]


def prepare_runs(quick: bool) -> None:
    """Before runs side by side: folders that can be written, and the first chip, once for all workers."""
    check_build()
    for folder in (FOLDER, FOLDER / ("quick" if quick else "full"), KEYS):
        check_folder(folder)
    build_chip(method="six-step")
    build_firmware(BUILD / "firmware")
