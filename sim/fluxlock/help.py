# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Groups of the command line's help, the examples below each command, and file names for the shell's completion."""

from __future__ import annotations

import inspect
import shutil
from collections.abc import Callable
from pathlib import Path

import typer
import typer.core
from rich.console import Console
from rich.padding import Padding
from rich.text import Text

from fluxlock.base.paths import shipped

RUN, MOTOR, LIVE, BOARD, THEORY, VERIFY = "Run", "Motor", "Live bus", "Board", "Theory", "Verify"
GROUPS = (RUN, MOTOR, LIVE, BOARD, THEORY, VERIFY)
Command = typer.core.TyperCommand | typer.core.TyperGroup
WIDE_HELP = [(kind, kind.format_help) for kind in (typer.core.TyperCommand, typer.core.TyperGroup)]
NARROW = 60  # columns; below it a table of options would cut their names


def example(*lines: str) -> str:
    """Text below a command's help: what a user types."""
    return "\n".join(["[bold]Example[/bold]" if len(lines) == 1 else "[bold]Examples[/bold]", *lines])


class Grouped(typer.core.TyperGroup):
    """A command whose help lists its groups in the order of GROUPS."""

    # The base wants a class of context that typer does not export; typer.Context is the one of it that it does.
    def list_commands(self, ctx: typer.Context) -> list[str]:  # type: ignore[override]
        """Names of the commands, group by group, as they were added within one."""

        def place(name: str) -> int:
            panel = getattr(self.commands[name], "rich_help_panel", None)
            return GROUPS.index(panel) if panel in GROUPS else len(GROUPS)

        return sorted(super().list_commands(ctx), key=place)


def subcommands(command: Command, ctx: typer.Context) -> list[Command]:
    """The commands below one, in the order of its help."""
    if not isinstance(command, typer.core.TyperGroup):
        return []
    found = (command.commands[name] for name in command.list_commands(ctx))
    return [below for below in found if isinstance(below, Command)]


def narrow_help(command: Command, ctx: typer.Context, width: int) -> None:
    """Print the help of a command as a list: each name on a line of its own, what it does indented below."""
    console = Console(width=width, highlight=False)

    def entry(name: str, text: str) -> None:
        console.print(name, style="bold cyan", markup=False, soft_wrap=len(name) > width)
        console.print(Padding(Text.from_markup(text), (0, 0, 0, 2)))

    console.print(f"Usage: {ctx.command_path} {' '.join(command.collect_usage_pieces(ctx))}", markup=False)
    console.print()
    console.print(Text.from_markup(inspect.cleandoc(command.help or "")))
    records = [record for parameter in command.get_params(ctx) if (record := parameter.get_help_record(ctx))]
    console.print("\n[bold]Options[/bold]")
    for name, text in records:
        # Square brackets of typer's own words, such as [required], are no markup.
        entry(name, text.replace("[required", "\\[required").replace("[default", "\\[default"))
    group = ""
    for below in subcommands(command, ctx):
        panel = getattr(below, "rich_help_panel", None)
        title = panel if panel in GROUPS else "Commands"
        if title != group:
            console.print(f"\n[bold]{title}[/bold]")
            group = title
        entry(below.name or "", inspect.cleandoc(below.help or "").splitlines()[0])
    if command.epilog:
        console.print()
        console.print(Text.from_markup(command.epilog))


def any_width(wide: Callable[..., None]) -> Callable[..., None]:
    """What prints the help of a command: typer's tables where there is room for them, else a list."""

    def format_help(command: Command, ctx: typer.Context, formatter: object) -> None:
        width = shutil.get_terminal_size().columns
        if width < NARROW:
            narrow_help(command, ctx, width)
        else:
            wide(command, ctx, formatter)

    return format_help


def fit_help() -> None:
    """From here on typer's help fits the terminal. Its tables are slow to load: that waits until one is asked for."""
    for kind, wide in WIDE_HELP:
        kind.format_help = any_width(wide)  # type: ignore[method-assign]  # typer has no hook for what prints help


def complete_toml(folder: str) -> Callable[[str], list[str]]:
    """Completion of a TOML file's name; nothing typed yet offers those here, else the ones of `folder`."""

    def complete(incomplete: str) -> list[str]:
        typed = incomplete or (f"{folder}/" if Path(folder).is_dir() or not any(Path().glob("*.toml")) else "")
        head, _, beginning = typed.rpartition("/")
        base = shipped(Path(f"{head}/") if head or typed.startswith("/") else Path())
        prefix = typed[: len(typed) - len(beginning)]
        if not base.is_dir():
            return []
        found = [path for path in sorted(base.iterdir()) if path.name.startswith(beginning)]
        folders = [f"{prefix}{path.name}/" for path in found if path.is_dir() and not path.name.startswith(".")]
        return [f"{prefix}{path.name}" for path in found if path.suffix == ".toml"] + folders

    return complete
