# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Chart of the chip's angle error over speed with wrong parameters, from the rows of `make regression`."""

from __future__ import annotations

from typing import Any

from matplotlib.figure import Figure

from fluxlock.theory.six_step.plots import finish

CASE = "vector/parameter-errors/"
ERROR, CLOSED = "angle_error_deg.", "closed_form_deg."


def parameter_map(rows: list[dict[str, Any]]) -> Figure | None:
    """Mean angle error (deg) in bands about each speed (r/min), and the closed form; None without such rows.

    rows: as in build/regression.json. Short versions have too few speeds to draw and count as none.
    """
    found = [row for row in rows if row["id"].startswith(CASE)]
    courses = {row["conditions"]["machine_against_file"]: course for row in found if len(course := _course(row)) > 1}
    if not courses:
        return None
    figure = Figure(figsize=(9, 5.5), layout="constrained")
    axes = figure.subplots()
    for number, (name, course) in enumerate(courses.items()):
        speeds = [speed / 1e3 for speed, _, _ in course]
        axes.plot(speeds, [error for _, error, _ in course], "o-", color=f"C{number}", markersize=4, label=name)
        axes.plot(speeds, [closed for _, _, closed in course], ":", color=f"C{number}", linewidth=1)
    axes.set_title("Machine against its file, chip (points) and closed form at rest (dotted)")
    finish(axes, "speed / (1000 r/min)", "angle error / deg el. (+ = ahead)")
    axes.legend(loc="lower left", fontsize=8)
    return figure


def _course(row: dict[str, Any]) -> list[tuple[float, float, float]]:
    """(r/min, error, closed form) by speed."""
    values = row["values"]
    speeds = [name.removeprefix(ERROR) for name in values if name.startswith(ERROR)]
    return sorted((float(s), values[ERROR + s], values[CLOSED + s]) for s in speeds if s.isdigit())
