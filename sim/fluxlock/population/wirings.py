# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Machines of the population wired right and wrong: the drive's test of the wiring before their first turn.

Each machine is wired right, with each of the 5 wrong orders of its dividers, and with some of the 47 wrong orders and
signs of its current sensors, drawn by its number.
"""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from functools import partial
from itertools import combinations, permutations
from typing import Any

import numpy as np

from fluxlock.base.progress import counting_bars
from fluxlock.base.writable import check_file
from fluxlock.config import Scenario
from fluxlock.config.scenario import Initial
from fluxlock.firmware.binding import names
from fluxlock.firmware.host import one_at_a_time
from fluxlock.native.vector_run import Play
from fluxlock.population.draw import Draw
from fluxlock.population.life import life_of, refusals
from fluxlock.population.run import FOLDER
from fluxlock.results.verdict import Verdict, say
from fluxlock.wiring.measure import BOOT_S, KEPT_S, judge, lead
from fluxlock.wiring.naming import CURRENT_SHARE, LETTERS
from fluxlock.wiring.reach import ByConsole, WiringError
from fluxlock.workers import side_by_side

# Limits: with the coast before it, electrical.
LONGEST_S, MOST_DEG = 0.2, 5.0
ORDERS = ["".join(order) for order in permutations(LETTERS)]
SIGNS = ["".join(letters) for count in range(4) for letters in combinations(LETTERS, count)]
CURRENTS = [(order, signs) for order in ORDERS for signs in SIGNS][1:]


@dataclass(frozen=True)
class Trial:
    """One wiring of one machine. said: what was found, "" if the wiring is named as it is; seen: the dividers were."""

    wiring: str
    said: str
    seen: bool
    longest_s: float
    current_share: float
    moved_deg: float

    @property
    def limits(self) -> list[str]:
        """Limits that it broke."""
        found = []
        if self.longest_s > LONGEST_S:
            found.append(f"{1e3 * self.longest_s:.0f} ms")
        if self.current_share > CURRENT_SHARE:
            found.append(f"{100 * self.current_share:.1f} % of the rated current")
        if self.moved_deg >= MOST_DEG:
            found.append(f"{self.moved_deg:.1f}°")
        return found


@dataclass(frozen=True)
class Machine:
    """All trials of a machine. refused: why there are none."""

    index: int
    refused: str = ""
    trials: list[Trial] = field(default_factory=list)

    @property
    def wrong(self) -> list[str]:
        """False alarms, wirings that were named wrong or not at all, broken limits."""
        faults = [(t.wiring, [t.said] if t.said else []) for t in self.trials]
        broken = [(t.wiring, t.limits) for t in self.trials]
        return [f"machine {self.index}, {wiring}: {text}" for wiring, texts in faults + broken for text in texts]


def wirings_of(index: int, drawn: int) -> list[dict[str, Any]]:
    """Keys of the inverter's sensing: the right wiring, the dividers' orders, so many of the current sensors."""
    rng = np.random.default_rng(np.random.SeedSequence((index, len(CURRENTS))))
    some = sorted(rng.choice(len(CURRENTS), min(drawn, len(CURRENTS)), replace=False).tolist())
    currents = [{"current_order": CURRENTS[k][0], "current_inverted": list(CURRENTS[k][1])} for k in some]
    return [{}, *({"voltage_order": order} for order in ORDERS[1:]), *currents]


@one_at_a_time()
def try_wiring(scenario: Scenario, keys: dict[str, Any]) -> Trial:
    """The drive's test of a vector scenario with keys of its inverter's sensing."""
    sensing = scenario.inverter.sensing.model_copy(update=keys)
    inverter = scenario.inverter.model_copy(update={"sensing": sensing})
    wired = scenario.model_copy(update={"inverter": inverter, "event": [], "window": [], "expect": []})
    play = Play(wired, scenario.seed, KEPT_S)
    play.advance(BOOT_S)
    play.chip.keep_rows(round(KEPT_S / play.chip.timing.period_s))
    seen, said = True, ""
    expected = (sensing.current_order, "".join(sensing.current_inverted), sensing.voltage_order)
    try:
        told, peak_a = lead(ByConsole(play.firmware.command), lambda seconds: play.advance(play.now + seconds))
        measured = judge(told, wired, peak_a)
    except WiringError as error:
        said = str(error)
    else:
        wiring, seen = measured.wiring, bool(measured.voltage_v.any())
        found = (wiring.current_order, wiring.current_inverted, wiring.voltage_order if seen else sensing.voltage_order)
        passes = not keys or (not seen and "voltage_order" in keys)
        if found != expected or measured.passed != passes:
            said = f"{measured.fault}, {'; '.join(finding.what for finding in measured.findings) or 'passed'}"
    rows = play.chip.rows()
    return Trial(
        " ".join(f"{key}={value}" for key, value in keys.items()) or "right",
        said,
        seen,
        float((rows["state"] == names("drive_state_t").index("starting")).sum() * play.chip.timing.period_s),
        float(np.abs(rows["i"]).max() / scenario.rated_current_a),
        math.degrees(float(np.abs(rows["theta"] - rows["theta"][0]).max())),
    )


def try_machine(seed: int, drawn: int, index: int) -> Machine:
    """All trials of a machine, at rest at its rest angle; `drawn` wirings of the current sensors."""
    draw = Draw.of(seed, index)
    life = life_of(draw, "vector")
    if reasons := refusals(life):
        return Machine(index, reasons[0])
    scenario = life.scenario.model_copy(update={"initial": Initial(theta_deg=draw.theta_deg)})
    return Machine(index, "", [try_wiring(scenario, keys) for keys in wirings_of(index, drawn)])


def try_machines(seed: int, indices: Iterable[int], drawn: int, jobs: int, done: Callable[[], None]) -> list[Machine]:
    """The machines by index; done: called for each as it comes."""
    machines: list[Machine] = []

    def store(_: int, machine: Machine) -> None:
        machines.append(machine)
        done()

    side_by_side(partial(try_machine, seed, drawn), list(indices), jobs, store)
    return sorted(machines, key=lambda machine: machine.index)


def verdict_of(machines: list[Machine]) -> Verdict:
    """Counts, the largest values, and each thing that is wrong."""
    trials = [trial for machine in machines for trial in machine.trials]
    unseen = [machine.index for machine in machines if any(not trial.seen for trial in machine.trials)]
    wrong = [text for machine in machines for text in machine.wrong]
    text = f"{len(trials)} tests on {sum(not m.refused for m in machines)} machines, {len(wrong)} wrong; "
    text += f"{sum(bool(m.refused) for m in machines)} machines refused"
    if trials:
        text += f"; at most {1e3 * max(t.longest_s for t in trials):.0f} ms, "
        text += f"{100 * max(t.current_share for t in trials):.1f} % of the rated current, "
        text += f"{max(t.moved_deg for t in trials):.2f}°"
    if unseen:
        text += f"; dividers not seen of {len(unseen)} machines ({', '.join(map(str, unseen))})"
    return Verdict(bool(trials) and not wrong, [text, *wrong])


def run_wirings(seed: int, indices: range, drawn: int, jobs: int) -> bool:
    """Try the machines, write build/population/wiring.json, say what was found; False if something is wrong."""
    path = FOLDER / "wiring.json"
    check_file(path)
    with counting_bars() as bars:
        task = bars.add_task("wirings", total=len(indices))
        machines = try_machines(seed, indices, drawn, jobs, partial(bars.update, task, advance=1))
    rows = [
        {
            "index": m.index,
            "refused": m.refused,
            "trials": [vars(trial) | {"limits": trial.limits} for trial in m.trials],
        }
        for m in machines
    ]
    path.write_text(json.dumps({"seed": seed, "drawn": drawn, "machines": rows}, indent=1) + "\n", encoding="utf-8")
    verdict = verdict_of(machines)
    say(verdict)
    print(f"written: {path}")
    return verdict.passed
