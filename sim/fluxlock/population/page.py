# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""docs/verification/population.md from the documents of the last populations: `python -m fluxlock.population.page`."""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Sequence
from typing import Any

from fluxlock.base.paths import ROOT
from fluxlock.base.writable import EXIT_BAD_INPUT, guarded
from fluxlock.config import ConfigError, Problem
from fluxlock.population import injection_judge, injection_life, judge, life
from fluxlock.population.draw import POPULATIONS
from fluxlock.population.injection_draw import injection_ranges
from fluxlock.population.ranges import ranges
from fluxlock.population.run import FOLDER, NAMED, OUTCOMES, outcomes
from fluxlock.population.table import EXAMPLES, count, deciles, groups
from fluxlock.results import verdict
from fluxlock.sources import sources_text

PAGE = ROOT / "docs" / "verification" / "population.md"
UNITS = {
    "power_w": ("power at base speed", "W"),
    "supply_v": ("supply", "V"),
    "pole_pairs": ("pole pairs", ""),
    "base_hz": ("base frequency, electrical", "Hz"),
    "resistance_pu": ("resistance", "per unit"),
    "inductance_pu": ("inductance", "per unit"),
    "saliency": ("L_q / L_d", ""),
    "run_up_s": ("run-up at rated torque without load", "s"),
}
INJECTION_UNITS = {
    **{key: text for key, text in UNITS.items() if key != "inductance_pu"},
    "inductance_pu": ("inductance of the d axis", "per unit"),
    "carrier_hz": ("carrier frequency", "Hz"),
    "saturation": ("share of L_d that rated current along the magnet takes", ""),
    "saturation_minus": ("share that it gives against the magnet, over that", ""),
    "cross_deg": ("turn of the axes at rated i_q", "°"),
    "third": ("inductance of the third plane over L_d, five phases", ""),
    "dead_time_s": ("dead time", "s"),
    "bits": ("bits of the converter", ""),
    "coulomb": ("Coulomb friction over rated torque", ""),
    "viscous": ("viscous friction at base speed over rated torque", ""),
    "target": ("target over base speed, either direction", ""),
}
TITLES = {"vector": "Vector", "six-step": "Six-step", "injection": "Injection"}
Document = dict[str, Any]


def _machines() -> list[str]:
    r, error = ranges(), ranges().file_error
    lines = ["| quantity | from | to | unit |", "|---|---|---|---|"]
    for key, (name, unit) in UNITS.items():
        low, high = getattr(r, key)
        lines.append(f"| {name} | {low:g} | {high:g} | {unit} |")
    shares = ", ".join(f"{name} {100 * share:g} %" for name, share in error.model_dump().items())
    return [
        *lines,
        "",
        f"The EMF is {' or '.join(r.emf)}. The phases differ by up to {100 * r.phases_unequal:g} % each. The carrier "
        f"fits at least {r.carriers_per_sector_min:g} times into a sector at base speed. The motor file is wrong by up "
        f"to these shares: {shares}.",
        "",
        "`sim/fluxlock/population/ranges.toml` holds the ranges. A test keeps its hash, so that a drive is mended and "
        "not its machines.",
    ]


def _lives() -> list[str]:
    return [
        "The rotor turns and the drive catches it. The drive then holds eight operating points:",
        "",
        "1. the lowest speed with light load, with full load and with light load again",
        f"2. {100 * life.MIDDLE_SHARE:g} % and 100 % of the base speed with full load, then "
        f"{100 * life.MIDDLE_SHARE:g} % again",
        "3. 100 % with light load",
        "4. the lowest speed, after a target that falls at once",
        "",
        f"The lowest speed is {100 * life.LOWEST_SHARE:g} % of the base speed, or {life.LEAST_MARGIN:g} times the "
        "least speed that `fluxlock motor info` states. A machine that would need more than "
        f"{100 * life.REFUSED_SHARE:g} % is refused. Fan, viscous and Coulomb friction add up to at most the rated "
        "torque.",
        "",
        "A life is *refused* if the check of its files names a reason. It is *right* if it keeps all of these limits:",
        "",
        "| quantity | limit |",
        "|---|---|",
        f"| mean speed | ± {100 * life.SPEED_TOLERANCE:g} % |",
        f"| speed, peak to peak | {100 * judge.RIPPLE_SHARE:g} %, or {judge.RIPPLE_OF_IDEAL:g} times that of an ideal "
        "drive on the same machine |",
        f"| speed beyond a new target | {100 * judge.OVERSHOOT_SHARE:g} % of the change |",
        f"| current, mean over 1 ms | {verdict.CURRENT_SHARE:g} times its limit |",
        f"| angle error of vector control | {judge.ANGLE_RMS_DEG:g}° rms, less what the file's errors make |",
        f"| commutation error of six-step control | {judge.COMMUTATION_RMS_DEG:g}° rms |",
        "| trips, faults, restarts | none |",
    ]


def _injection() -> list[str]:
    r, over, j = injection_ranges(), injection_ranges().over_file, injection_judge
    lines = ["| quantity | from | to | unit |", "|---|---|---|---|"]
    for key, (name, unit) in INJECTION_UNITS.items():
        low, high = getattr(r, key)
        lines.append(f"| {name} | {low:g} | {high:g} | {unit} |")
    return [
        "## Starts by injection",
        "",
        "Salient machines that start from a rest that the drive does not know.",
        "",
        *lines,
        "",
        f"Each {r.five_phase_every}rd machine has five phases. {100 * r.linear_share:g} % do not saturate. Period and "
        "amplitude are those that `fluxlock injection` prints for the files. The machine differs from its file: "
        f"resistance by up to {100 * over.resistance:g} %, each inductance by {100 * over.inductance:g} %, flux by "
        f"{100 * over.flux:g} %. Its inertia is {over.inertia[0]:g} to {over.inertia[1]:g} times that of the file. The "
        f"rotor stands, or turns with up to {100 * r.turning:g} % of the base speed ({100 * r.turning_share:g} % of "
        f"the machines), or is blocked ({100 * r.blocked_share:g} %). {injection_life.RUN_S:g} s or "
        f"{injection_life.RUN_CONSTANTS:g} time constants of the speed loop after the search, whichever is longer, "
        f"friction of {r.load:g} times the rated torque comes on.",
        "",
        "`sim/fluxlock/population/injection.toml` holds the ranges, and a test their hash. A life is *refused* if the "
        "check of its files names a reason. It is *named* if a fault ends it in time. It is *right* if it keeps all of "
        "these limits:",
        "",
        "| quantity | limit |",
        "|---|---|",
        f"| angle error, from {j.SETTLE_S:g} s after the search and after the friction on | {j.RMS_DEG:g}° rms |",
        f"| motion of a rotor that stands while the search lasts | {j.SEARCHED_DEG:g}° el. |",
        f"| motion against the target after the search | {j.BACKWARD_DEG:g}° el. |",
        f"| motion towards the target | more than {j.FORWARD_DEG:g}° el., unless the rotor is blocked |",
        "",
        "It is *wrong* otherwise, and also if a fault comes too late:",
        "",
        "| what goes on | until the fault at most |",
        "|---|---|",
        f"| angle off by more than {j.LOST_DEG:g}° | {1e3 * j.NAMED_S:g} ms |",
        f"| reported speed off by {100 * j.SPEED_SHARE:g} % and {100 * j.SPEED_OF_BASE:g} % of the base speed | "
        f"{1e3 * j.NAMED_S:g} ms |",
        f"| motion against the target | {j.WRONG_WAY_DEG:g}° el. |",
        "",
    ]


def _result(document: Document) -> list[str]:
    rows, method = document["rows"], document["method"]
    shown = outcomes(method)
    counts = ", ".join(
        f"{count(rows, outcome)} {'ended by a named fault' if outcome == NAMED else outcome}" for outcome in shown
    )
    lines = [
        f"## {TITLES[method]}",
        "",
        f"`fluxlock population run --method {method} --lives {len(rows)} --seed {document['seed']}`. "
        f"Made from {sources_text(document['sources'])}.",
        "",
        f"**{len(rows)} lives: {counts}.**".replace("refused,", "refused by name,"),
        "",
        f"| inductance, per unit | {' | '.join(shown)} |",
        "|---" * (1 + len(shown)) + "|",
        *(_decile(part, shown) for part in deciles(rows)),
        "",
    ]
    found = groups(rows)
    if found:
        lines += [
            "| outcome | first reason | lives | beside another | machines | example |",
            "|---|---|---|---|---|---|",
        ]
    for g in found:
        some = ", ".join(map(str, g.indices[:EXAMPLES]))
        lines.append(f"| {g.outcome} | {g.kind} | {len(g.indices)} | {g.also} | {some} | {g.example} |")
    return [*lines, ""]


def _decile(part: tuple[float, ...], shown: Sequence[str]) -> str:
    low, high, *counts = part
    by_outcome = dict(zip(OUTCOMES, counts, strict=True))
    return f"| {low:.3f} … {high:.3f} | {' | '.join(str(by_outcome[outcome]) for outcome in shown)} |"


def page(documents: Sequence[Document]) -> str:
    """The page."""
    lines = [
        "# Population",
        "",
        "Random machines that nobody tuned the drive for, and how the drive does on each.",
        "`python -m fluxlock.population.page` writes this page from `build/population`.",
        "",
        "```",
        "fluxlock population draw 7 --method vector --out build/machine-7   # the files of machine 7",
        "fluxlock native build/machine-7/scenario.toml --play               # run it on the host",
        "fluxlock population plot 7 --method vector                         # its life as a picture",
        "```",
        "",
        "## Machines",
        "",
        *_machines(),
        "",
        "## Lives",
        "",
        *_lives(),
        "",
        "The firmware's C code runs on models of chip and machine. The vector model has no ripple of the carrier. The "
        "six-step model switches the conducting pair, and the outgoing phase's current ends at once.",
        "",
    ]
    for document in documents:
        lines += [*_injection(), *_result(document)] if document["method"] == "injection" else _result(document)
    return "\n".join(lines).rstrip("\n") + "\n"


def read_documents() -> list[Document]:
    """Of all populations; ConfigError names those that are missing."""
    found: list[Document] = []
    problems = []
    for method in POPULATIONS:
        path = FOLDER / f"{method}.json"
        try:
            found.append(json.loads(path.read_text(encoding="utf-8")))
        except (OSError, ValueError):
            text = f"is no population; `fluxlock population run --method {method}` writes it"
            problems.append(Problem(str(path), "", text))
    if problems:
        raise ConfigError(problems)
    return found


def main(arguments: Sequence[str] | None = None) -> int:
    """Write the page; exit code 2 if a document is missing."""
    argparse.ArgumentParser(prog="python -m fluxlock.population.page", description=__doc__).parse_args(arguments)
    try:
        documents = read_documents()
    except ConfigError as error:
        for problem in error.problems:
            print(f"error: {problem}", file=sys.stderr)
        return EXIT_BAD_INPUT
    PAGE.write_text(page(documents), encoding="utf-8")
    print(f"written: {PAGE}")
    return 0


if __name__ == "__main__":
    sys.exit(guarded(main))
