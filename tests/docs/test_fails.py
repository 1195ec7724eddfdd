# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Pages of docs/fails against the code: faults, trips, limits, verdicts, keys, and the lines that they quote."""

from __future__ import annotations

import re
from pathlib import Path
from typing import get_args

import pytest

from fluxlock.base.paths import ROOT
from fluxlock.config import Scenario
from fluxlock.config.inverter import Inverter
from fluxlock.config.motor import Motor
from fluxlock.config.scenario import Accept, TripCause
from fluxlock.config.wording import keys_of
from fluxlock.flash.loader import RESULTS
from fluxlock.interface.names import fault_names
from fluxlock.results import verdict

FOLDER = ROOT / "docs" / "fails"
PAGES = sorted(FOLDER.rglob("*.md"))
TEXTS = {page.relative_to(FOLDER).as_posix(): page.read_text(encoding="utf-8") for page in PAGES}
LISTS = ("index.md", "stopped/index.md")
OTHERS = "\n".join(text for name, text in TEXTS.items() if name not in LISTS)
KEYS = {
    *keys_of(Scenario),
    *(f"motor.{key}" for key in keys_of(Motor)),
    *(f"inverter.{key}" for key in keys_of(Inverter)),
}
TABLES = {key.partition(".")[0] for key in KEYS if "." in key}


def named(text: str) -> set[str]:
    """Words and lines set as code."""
    return set(re.findall(r"`([^`\n]+)`", text))


def wrong_keys(text: str) -> list[str]:
    """Keys in a page that no file has: what is set as code and begins with the name of a table."""
    words = (word.split(" = ")[0] for word in named(text))
    dotted = [word for word in words if re.fullmatch(r"[a-z_]+(\.[a-z0-9_]+)+", word)]
    return sorted(word for word in dotted if word.partition(".")[0] in TABLES and word not in KEYS)


def wrong_quotes(text: str) -> list[str]:
    """Quoted lines of a verdict that name a fault or a trip that there is none of."""
    faults = re.findall(r"ended in fault (\w+)", text)
    trips = [
        cause
        for trip in re.findall(r"^failed: trip at [\d.]+ s: (\S+)$", text, re.MULTILINE)
        for cause in trip.split("+")
    ]
    return [name for name in faults if name not in fault_names()] + [t for t in trips if t not in get_args(TripCause)]


def test_every_fault_has_a_page() -> None:
    """Each fault of the firmware, and each trip, stands on a page.

    Verifies: DOC-09
    """
    faults = set(fault_names())
    assert len(faults) > 30
    # The command of a run calls the trip `software` by its fault's name.
    trips = {"software_trip" if trip == "software" else trip for trip in get_args(TripCause)}
    assert sorted((faults | trips) - named(OTHERS)) == []


def test_every_limit_has_a_page() -> None:
    """The verdict's limits and what `[[accept]]` knows are on the pages, the limits with the line's own words.

    Verifies: DOC-09
    """
    for limit in verdict.LIMITS.values():
        assert limit in named(OTHERS), limit
        assert verdict.LIMIT_TEXTS[limit] in OTHERS, limit
    accepted = set(get_args(Accept.model_fields["what"].annotation))
    assert verdict.LIMITS.items() and accepted >= set(verdict.LIMITS.values())


def test_results_of_the_loader() -> None:
    """A refusal of the flash that the page quotes is the loader's.

    Verifies: DOC-09
    """
    assert (
        "the flash did not erase or write" in RESULTS
        and "the flash did not erase or write" in TEXTS["stopped/flash.md"]
    )


@pytest.mark.parametrize("page", PAGES, ids=lambda p: p.relative_to(FOLDER).as_posix())
def test_keys(page: Path) -> None:
    """Every key of a page is in the scenario's, the motor's or the inverter's file.

    Verifies: DOC-09
    """
    assert wrong_keys(TEXTS[page.relative_to(FOLDER).as_posix()]) == []


@pytest.mark.parametrize("page", PAGES, ids=lambda p: p.relative_to(FOLDER).as_posix())
def test_quoted_faults(page: Path) -> None:
    """Quoted lines name faults and trips that there are.

    Verifies: DOC-09
    """
    assert wrong_quotes(TEXTS[page.relative_to(FOLDER).as_posix()]) == []


def test_wrong_words_are_found() -> None:
    """A key or a fault that has gone is found.

    Verifies: DOC-09
    """
    assert wrong_keys("`drive.start.curent_a` and `motor.psi_vs = 1`, `x.y`") == ["drive.start.curent_a"]
    assert wrong_quotes("failed: the drive ended in fault jammed") == ["jammed"]
    assert wrong_quotes("failed: trip at 0.05 s: phase_current+noise\n") == ["noise"]


def test_index_leads_everywhere() -> None:
    """The index has every page, and every page leads back.

    Verifies: DOC-09
    """
    for name, text in TEXTS.items():
        folder, _, file = name.rpartition("/")
        above = "stopped/index.md" if folder and file != "index.md" else "index.md"
        if name != "index.md":
            assert f"]({name if above == 'index.md' else file})" in TEXTS[above], name
            assert f"({'../' if folder else ''}index.md)" in text.split("##")[0], name
