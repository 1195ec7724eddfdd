"""The progress bar of a run."""

from __future__ import annotations

from rich.console import Console
from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn, TimeRemainingColumn

from fluxlock.analysis.rundata import BUILDING, ProgressInfo


class ProgressBar:
    """Simulated time, motor speed and simulation rate while a run goes on.

    The times beside them are those of the stage: what was spent on building is no measure of what is left to simulate.
    Where no terminal shows the bar there is a line for each stage, and for each tenth of the run.
    """

    def __init__(self, console: Console, duration_s: float) -> None:
        self._console = console
        self._told: tuple[str, int] | None = None
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
        if self._console.is_terminal:
            self._progress.start()
        return self

    def __exit__(self, *_: object) -> None:
        if self._console.is_terminal:
            self._progress.stop()

    def __call__(self, info: ProgressInfo) -> None:
        """Show what a run tells of itself."""
        tenth = min(int(10 * info.t_s / info.duration_s), 10)
        if not self._console.is_terminal and (info.phase, tenth) != self._told:
            self._told = info.phase, tenth
            text = f"{info.phase}: {info.t_s:.3f} of {info.duration_s:.3f} s, {info.speed_rpm:.0f} r/min"
            self._console.print(text, highlight=False)
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
