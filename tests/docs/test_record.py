# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Numbers in tables of the pages that are those of the table of the regression: each line is built from it."""

from __future__ import annotations

import re
from collections.abc import Iterator
from decimal import ROUND_HALF_UP, Decimal

import pytest

from fluxlock.base.paths import ROOT
from fluxverify.docs.regression import PAGE

LIMITS, SIX_STEP = "docs/theory/six-step-limits.md", "docs/theory/six-step.md"
ERROR, FREEWHEEL, INTERVAL = "commutation_error_deg", "freewheel_deg", "commutation_interval_deg"


def rows() -> dict[str, dict[str, str]]:
    """Values by row and name as the table of the regression prints them."""
    found = {}
    for line in PAGE.read_text(encoding="utf-8").splitlines():
        if line.startswith("| six-step/"):
            name, _, values = (cell.strip() for cell in line.split("|")[1:4])
            pairs = re.findall(r"([\w.]+) (-?[\d.e+-]+)(?=\*|,|$)", values.replace("**", "*"))
            found[name.removeprefix("six-step/")] = dict(pairs)
    return found


ROWS = rows()


def value(row: str, name: str, decimals: int) -> str:
    """A value as the pages print it: half a last digit rounded up, a true minus, none before a zero."""
    number = Decimal(ROWS[row][name]).quantize(Decimal(1).scaleb(-decimals), ROUND_HALF_UP)
    return f"{abs(number) if number == 0 else number:f}".replace("-", "−")


def pair(row: str, names: tuple[str, ...], decimals: int) -> str:
    return " / ".join(value(row, name, decimals) for name in names)


def both(without: str, with_: str) -> str:
    """The value with synchronous rectification in brackets where it differs."""
    return without if without == with_ else f"{without} ({with_})"


def commutation_errors() -> Iterator[str]:
    carriers = {20_000: "stretched", 40_000: "10", 60_000: "6.67", 80_000: "5", 100_000: "4", 120_000: "3.33"}
    for speed, n in carriers.items():
        cells = []
        for method in ("interpolated", "averaged", "first", "once-a-carrier"):
            row = f"commutation-error/{speed}-{method}"
            lost = ROWS[row]["trips"] != "0"
            cells.append("lost" if lost else pair(row, (f"{ERROR}.mean", f"{ERROR}.rms"), 2))
        yield f"| {speed // 1000} 000 | {n} | {' | '.join(cells)} |"


def sources() -> Iterator[str]:
    machines = {
        "sinusoidal": "Motor-I, sinusoidal, 60 000 r/min, 40 kHz",
        "trapezoidal": "pump, trapezoidal, 6 000 r/min, 20 kHz",
    }
    for emf, text in machines.items():
        cells = [
            pair(f"zcd-source/{emf}-{source}", (f"{ERROR}.rms", f"{ERROR}.max"), 2)
            for source in ("terminal", "star_point", "mean")
        ]
        yield f"| {text} | {' | '.join(cells)} |"


def patterns() -> Iterator[str]:
    for pattern in ("ON-PWM", "H_PWM-L_ON", "H_ON-L_PWM", "PWM-ON"):
        plain, sync = f"patterns/{pattern}", f"patterns/{pattern}-sync-rect"
        cells = [
            both(pair(plain, names, decimals), pair(sync, names, decimals))
            for names, decimals in (
                ((f"{ERROR}.rms",), 3),
                ((f"{FREEWHEEL}.mean", f"{FREEWHEEL}.max"), 1),
                (("phase_current_pp_a",), 1),
            )
        ]
        yield f"| {pattern} | {' | '.join(cells)} |"


def freewheel() -> Iterator[str]:
    for pattern in ("ON-PWM", "PWM-ON"):
        for speed in (30_000, 60_000, 90_000):
            cells = [
                pair(f"freewheel/{pattern}-{speed}-{current}A", ("chip_deg", "plant_deg", "circuit_deg"), 2)
                for current in (10, 20, 30)
            ]
            yield f"| {pattern}, {speed // 1000} 000 r/min | {' | '.join(cells)} |"


def torque_limits() -> Iterator[str]:
    for pattern in ("ON-PWM", "PWM-ON"):
        row = f"torque-limit/{pattern}"
        seen, circuit_seen, back, circuit_back = (
            ROWS[row][f"{name}_mnm"] for name in ("seen", "circuit_seen", "computed_back", "circuit_computed_back")
        )
        yield f"| {pattern} | {seen} ({circuit_seen}) | {back} ({circuit_back}) | {value(row, 'ratio', 2)} |"


def asymmetry() -> Iterator[str]:
    for machine, text in (("emf", "EMF of phase A 5 % low"), ("mutual", "mutual −9, −7, −5 µH")):
        names = [f"asymmetry/{machine}-{way}" for way in ("none", "a", "b", "both")]
        cells = [
            " … ".join(value(n, f"{INTERVAL}.{end}", 1 if n.endswith("none") else 2) for end in ("min", "max"))
            for n in names
        ]
        yield f"| {text}: intervals (deg) | {' | '.join(cells)} |"
        places = 2 if machine == "emf" else 1
        rms = [value(n, f"{INTERVAL}.rms", places if n.endswith("none") else 2) for n in names]
        yield f"| rms about 60° (deg) | {' | '.join(rms)} |"
        yield f"| torque (mN·m) | {' | '.join(value(n, 'torque_2fe_mnm', 2) for n in names)} |"


def ramps() -> Iterator[str]:
    def end(row: str) -> str:
        hertz = value(row, "highest_hz", 0)
        if ROWS[row]["trips"] != "0":
            return f"trip at {hertz} Hz, N = {value(row, 'carriers_per_sector', 2)}"
        return f"{hertz} Hz, {value(row, f'{FREEWHEEL}.max', 1)}°"

    for way, text in (("CSC", "CSC"), ("RSC", "RSC, first sample after"), ("RSC-back", "RSC, computed back")):
        yield f"| {text} | {' | '.join(end(f'ramp-1300hz/{way}-{load}mNm') for load in (20, 30))} |"


def hall() -> Iterator[str]:
    names = [f"{ERROR}.{kind}" for kind in ("mean", "rms", "max")]
    for row, text in (("before", "before learning"), ("after", "after")):
        yield f"| {text} | {' | '.join(value(f'hall/{row}', name, 2) for name in names)} |"
    cells = [" / ".join(value(f"hall/{speed}", name, 2) for speed in (20_000, 40_000, 80_000)) for name in names]
    yield f"| 20 000 / 40 000 / 80 000 r/min, learnt | {' | '.join(cells)} |"
    cells = [value("hall/reversal", name, 2) for name in names]
    yield f"| −20 000 r/min after a reversal, learnt | {' | '.join(cells)} |"


def methods() -> Iterator[str]:
    lines = {
        "Motor-I, 10 000 r/min": ("motor-1-10000",),
        "20 000 r/min": ("motor-1-20000",),
        "20 000 r/min, the firmware's flux 20 % too small / too large": ("flux-20%-20000", "flux+20%-20000"),
        "60 000 r/min": ("motor-1-60000",),
        "60 000 r/min, the firmware's flux 20 % too small / too large": ("flux-20%-60000", "flux+20%-60000"),
        "120 000 r/min": ("motor-1-120000",),
        "60 000 r/min, star point / mean of three": ("star_point-60000", "mean-60000"),
        "59 000 r/min, PWM-ON, RSC computed back / NSC / CSC": ("RSC-PWM-ON", "NSC-PWM-ON", "CSC-PWM-ON"),
        "two poles, 600 000 r/min": ("highest-600000",),
    }
    for text, names in lines.items():
        cells = [
            " / ".join(value(f"zcd-methods/{name}", f"{method}.seen_deg.rms", 3) for name in names)
            for method in ("interpolated", "averaged")
        ]
        yield f"| {text} | {' | '.join(cells)} |"


TABLES = {
    "commutation-error": (LIMITS, commutation_errors),
    "zcd-source": (LIMITS, sources),
    "patterns": (LIMITS, patterns),
    "freewheel": (LIMITS, freewheel),
    "torque-limit": (LIMITS, torque_limits),
    "asymmetry": (SIX_STEP, asymmetry),
    "ramp-1300hz": (SIX_STEP, ramps),
    "hall": (SIX_STEP, hall),
    "zcd-methods": (SIX_STEP, methods),
}


@pytest.mark.parametrize("case", TABLES)
def test_tables_are_those_of_the_record(case: str) -> None:
    """The lines of a page's table hold the values of the regression's.

    Verifies: DOC-06
    """
    page, lines = TABLES[case]
    text = (ROOT / page).read_text(encoding="utf-8")
    missing = [line for line in lines() if line not in text.splitlines()]
    assert not missing, f"{page} lacks:\n" + "\n".join(missing)
