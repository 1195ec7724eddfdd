# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Progress of long work: bars in a terminal, lines where there is none."""

from __future__ import annotations

from rich.console import Console
from rich.progress import (
    BarColumn,
    MofNCompleteColumn,
    Progress,
    ProgressColumn,
    Task,
    TaskID,
    TextColumn,
    TimeElapsedColumn,
    TimeRemainingColumn,
)
from rich.text import Text

from fluxlock.base.stage import BUILDING, ProgressInfo


class Bars(Progress):
    """Bars of tasks on the error output.

    Where no terminal shows them, a task has a line for each new description and for each tenth of it: the text of its
    columns.
    """

    def __init__(self, *columns: ProgressColumn, console: Console | None = None) -> None:
        shown_on = console or Console(stderr=True)
        super().__init__(*columns, console=shown_on, disable=not shown_on.is_terminal)
        self._told: dict[TaskID, tuple[str, int]] = {}

    def advance(self, task_id: TaskID, advance: float = 1) -> None:
        """Count what has ended, as `update` does."""
        self.update(task_id, advance=advance)

    def update(self, task_id: TaskID, **changes: object) -> None:
        """Change a task as `Progress.update` does; tell it where no terminal shows it."""
        super().update(task_id, **changes)  # type: ignore[arg-type]  # passed on untouched: the base checks them
        if self.disable:
            self._tell(self._tasks[task_id])

    def _tell(self, task: Task) -> None:
        tenth = min(int(10 * task.completed / task.total), 10) if task.total else 0
        if self._told.get(task.id) == (task.description, tenth):
            return
        self._told[task.id] = task.description, tenth
        cells = (column(task) for column in self.columns if isinstance(column, ProgressColumn))
        text = "  ".join(cell.plain for cell in cells if isinstance(cell, Text))
        self.console.print(text, highlight=False, markup=False, soft_wrap=True)


def counting_bars(console: Console | None = None) -> Bars:
    """Bars of tasks that count what has ended: its name, how many of how many, the time spent."""
    return Bars(
        TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeElapsedColumn(), console=console
    )


class ProgressBar:
    """Simulated time, motor speed and simulation rate while a run goes on.

    The times beside them are those of the stage: what was spent on building is no measure of what is left to simulate.
    """

    def __init__(self, console: Console, duration_s: float) -> None:
        self._progress = Bars(
            TextColumn("{task.description:<17}"),
            BarColumn(),
            TextColumn("{task.completed:.3f}/{task.total:.3f} s"),
            TextColumn("{task.fields[speed]:>8.0f} r/min"),
            TextColumn("{task.fields[rate]:5.2f} Mcycle/s"),
            TimeElapsedColumn(),
            TimeRemainingColumn(),
            console=console,
        )
        self._task = self._progress.add_task(BUILDING, total=duration_s, speed=0.0, rate=0.0)
        self._building = True

    def __enter__(self) -> ProgressBar:
        self._progress.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._progress.stop()

    def __call__(self, info: ProgressInfo) -> None:
        """Show what a run tells of itself."""
        if self._building and not info.phase.startswith(BUILDING):
            self._building = False
            self._progress.reset(self._task)
        self._progress.update(
            self._task,
            completed=min(info.t_s, info.duration_s),
            total=info.duration_s,
            description=info.phase,
            speed=info.speed_rpm,
            rate=info.rate_cycles_per_s / 1e6,
        )
