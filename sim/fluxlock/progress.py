"""The progress bar of a run."""

from __future__ import annotations

from rich.console import Console
from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn, TimeRemainingColumn

from fluxlock.analysis.rundata import BUILDING, ProgressInfo


class ProgressBar:
    """Simulated time, motor speed and simulation rate while a run goes on.

    The times beside them are those of the stage: what was spent on building is no measure of what is left to simulate.
    """

    def __init__(self, console: Console, duration_s: float) -> None:
        self._progress = Progress(
            TextColumn("{task.fields[phase]:<10}"),
            BarColumn(),
            TextColumn("{task.completed:.3f}/{task.total:.3f} s"),
            TextColumn("{task.fields[speed]:>8.0f} r/min"),
            TextColumn("{task.fields[rate]:5.2f} Mcycle/s"),
            TimeElapsedColumn(),
            TimeRemainingColumn(),
            console=console,
        )
        self._task = self._progress.add_task("run", total=duration_s, phase=BUILDING, speed=0.0, rate=0.0)
        self._building = True

    def __enter__(self) -> ProgressBar:
        self._progress.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._progress.stop()

    def __call__(self, info: ProgressInfo) -> None:
        """Show what a run tells of itself."""
        if self._building and info.phase != BUILDING:
            self._building = False
            self._progress.reset(self._task)
        self._progress.update(
            self._task,
            completed=min(info.t_s, info.duration_s),
            total=info.duration_s,
            phase=info.phase,
            speed=info.speed_rpm,
            rate=info.rate_cycles_per_s / 1e6,
        )
