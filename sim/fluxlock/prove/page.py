# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""What `fluxlock prove` found: the verdict in words, one picture, one JSON document."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from fluxlock.prove.cases import HOLDS, REFUSED, SHARES, VALUES, Row
from fluxlock.prove.life import FULL_SHARE, LIGHT, SAG_SHARE, SPEED_TOLERANCE, Machine
from fluxlock.results.verdict import Verdict

COLOURS = {"holds": "#009E73", "fails": "#D55E00", "refused": "#999999", "broken": "#000000"}
LEFT_OUT = (
    "The twin has no gates, no ripple of the carrier, no Hall sensors and no saturation; six-step has no freewheeling. "
    "Heat, cogging and the first turn's wiring are not tried. `fluxlock run` shows the chip clock by clock."
)
REASONS = 3


@dataclass(frozen=True)
class Proof:
    """Everything that was run. nominal: with the right values, the last one is that of `machine.high`."""

    machine: Machine
    nominal: list[Row]
    rows: list[Row]

    @property
    def at_right_values(self) -> list[Row]:
        """The nominal life that counts, and the starts from every rest angle."""
        return [self.nominal[-1], *(row for row in self.rows if row.case.group == "rest")]

    def span(self, name: str) -> tuple[float, float]:
        """Largest error of a value below and above that was run and holds, nothing nearer to 0 failing."""
        rows = {share: self.row(name, share) for share in SHARES}
        low = high = 0.0
        for share in sorted(s for s in SHARES if s > 0):
            if not rows[share].holds:
                break
            high = share
        for share in sorted((s for s in SHARES if s < 0), reverse=True):
            if not rows[share].holds:
                break
            low = share
        return low, high

    def row(self, name: str, share: float) -> Row:
        """The life in which a value of the file is off by a share."""
        return next(row for row in self.rows if row.case.name == f"{name} {100 * share:+.0f} %")

    def verdict(self) -> Verdict:
        """First line: whether it holds with right values; then why not, or by how much each value may be wrong."""
        m = self.machine
        wrong = [row for row in self.at_right_values if not row.holds]
        names = f"{m.motor.name} on {m.inverter.name}, {m.method}"
        if wrong:
            count = f"{len(wrong)} of {len(self.at_right_values)} lives"
            lines = [f"{names}: does not hold with the file's own values, {count}"]
            lines += [f"{row.case.name}: {row.outcome}: {'; '.join(row.reasons[:1])}" for row in wrong[:REASONS]]
            return Verdict(False, lines)
        reach = (
            f"holds {m.low_rpm:.0f} to {m.high * m.motor.max_speed_rpm:.0f} r/min, light and loaded, both directions"
        )
        lines = [f"{names}: {reach}, from {len(self.at_right_values) - 1} starts at rest"]
        if len(self.nominal) > 1:
            lines.append(f"above: {self.nominal[-2].outcome}: {self.nominal[-2].reasons[0]}")
        for name in VALUES.values():
            low, high = self.span(name)
            lines.append(f"{name} of the file may be off by {100 * low:+.0f} … {100 * high:+.0f} %{self._why(name)}")
        return Verdict(True, lines)

    def _why(self, name: str) -> str:
        """What happens at the first share that does not hold."""
        for share in sorted(SHARES, key=abs):
            row = self.row(name, share)
            if not row.holds:
                return f"; {100 * share:+.0f} %: {row.outcome}: {row.reasons[0]}"
        return ", the most that was tried"

    def document(self) -> dict[str, object]:
        """For JSON."""
        m, verdict = self.machine, self.verdict()
        return {
            "motor": m.motor.name,
            "inverter": m.inverter.name,
            "method": m.method,
            "carrier_hz": m.carrier_hz,
            "passed": verdict.passed,
            "lines": verdict.lines,
            "speeds_rpm": {"low": m.low_rpm, "high": m.high * m.motor.max_speed_rpm},
            "may_be_off": {name: self.span(name) for name in VALUES.values()},
            "left_out": LEFT_OUT,
            "rows": [row.as_json() for row in (*self.nominal, *self.rows)],
        }


def write_json(proof: Proof, path: Path) -> None:
    """The document."""
    path.write_text(json.dumps(proof.document(), indent=1) + "\n", encoding="utf-8")


def draw(proof: Proof, path: Path) -> None:
    """One page: rest angles, errors of the file, and what was demanded."""
    from fluxlock.theory.six_step.plots import save

    m, verdict = proof.machine, proof.verdict()
    figure = Figure(figsize=(11, 8.5), layout="constrained")
    grid = figure.add_gridspec(2, 2, height_ratios=(3, 2))
    rest = figure.add_subplot(grid[0, 0], projection="polar")
    for radius, load in ((1.0, LIGHT), (1.4, 1.0)):
        rows = [row for row in proof.rows if row.case.group == "rest" and row.case.load == load]
        angles = [np.radians(row.case.theta_deg) for row in rows]
        rest.scatter(angles, [radius] * len(rows), c=[COLOURS[row.outcome] for row in rows], s=40)
    rest.set_ylim(0, 1.6)
    rest.set_yticks([1.0, 1.4], labels=["light", "full load"])
    rest.set_title("starts by rest angle, electrical")
    values = figure.add_subplot(grid[0, 1])
    shares = sorted((*SHARES, 0.0))
    for y, name in enumerate(VALUES.values()):
        for share in shares:
            row = proof.nominal[-1] if share == 0.0 else proof.row(name, share)
            values.scatter([100 * share], [y], c=COLOURS[row.outcome], s=260, marker="s")
            if row.angle_deg is not None:
                values.annotate(
                    f"{row.angle_deg:.1f}", (100 * share, y), ha="center", va="center", fontsize=7, color="w"
                )
    values.set_yticks(range(len(VALUES)), labels=list(VALUES.values()))
    values.set_xticks([100 * share for share in shares])
    values.set_xlabel("file over machine, %; number: largest rms error of the angle, deg")
    values.set_title("value of the file that is wrong")
    values.margins(0.12)
    for outcome in (HOLDS, "fails", REFUSED):
        values.scatter([], [], c=COLOURS[outcome], label=outcome)
    values.legend(loc="upper center", bbox_to_anchor=(0.5, -0.13), ncols=3, frameon=False)
    text = figure.add_subplot(grid[1, :])
    text.axis("off")
    own = m.motor.load.torque_nm(m.motor.max_speed_rpm) > 0.0
    full = (
        "the load of the motor file"
        if own
        else f"a fan with {100 * FULL_SHARE:.0f} % of the rated torque at the highest speed"
    )
    demanded = (
        f"Demanded: mean speed within {100 * SPEED_TOLERANCE:.0f} % at {m.low_rpm:.0f}, half of the highest and "
        f"{m.high * m.motor.max_speed_rpm:.0f} r/min, a load step at half and full speed, the supply down to "
        f"{100 * SAG_SHARE:.0f} % under load, reversal; no trip, no fault, no lost angle. "
        f"Full load: {full}; light: {100 * LIGHT:.0f} % of it. Carrier {m.carrier_hz:.0f} Hz."
    )
    lines = [*verdict.lines, "", demanded, "", LEFT_OUT]
    text.text(0.0, 1.0, "\n".join(_wrapped(lines)), va="top", fontsize=8, transform=text.transAxes)
    figure.suptitle("holds" if verdict.passed else "does not hold", color=COLOURS[HOLDS if verdict.passed else "fails"])
    save(figure, path)


def _wrapped(lines: Sequence[str], width: int = 165) -> list[str]:
    import textwrap

    return [part for line in lines for part in (textwrap.wrap(line, width) or [""])]
