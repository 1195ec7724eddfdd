# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Groups of the command line's help, the examples below each command, and file names for the shell's completion."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import typer
import typer.core

RUN, MOTOR, LIVE, BOARD, THEORY, VERIFY = "Run", "Motor", "Live bus", "Board", "Theory", "Verify"
GROUPS = (RUN, MOTOR, LIVE, BOARD, THEORY, VERIFY)


def example(*lines: str) -> str:
    """Text below a command's help: what a user types."""
    return "\n".join(["[bold]Example[/bold]" if len(lines) == 1 else "[bold]Examples[/bold]", *lines])


class Grouped(typer.core.TyperGroup):
    """A command whose help lists its groups in the order of GROUPS."""

    def list_commands(self, ctx: typer.Context) -> list[str]:  # type: ignore[override]  # typer's own class of context
        """Names of the commands, group by group, as they were added within one."""

        def place(name: str) -> int:
            panel = getattr(self.commands[name], "rich_help_panel", None)
            return GROUPS.index(panel) if panel in GROUPS else len(GROUPS)

        return sorted(super().list_commands(ctx), key=place)


def complete_toml(folder: str) -> Callable[[str], list[str]]:
    """Completion of a TOML file's name; nothing typed yet offers the files of `folder` where there are any."""

    def complete(incomplete: str) -> list[str]:
        typed = incomplete or (f"{folder}/" if Path(folder).is_dir() else "")
        head, _, beginning = typed.rpartition("/")
        base = Path(f"{head}/") if head or typed.startswith("/") else Path()
        prefix = typed[: len(typed) - len(beginning)]
        if not base.is_dir():
            return []
        found = [path for path in sorted(base.iterdir()) if path.name.startswith(beginning)]
        folders = [f"{prefix}{path.name}/" for path in found if path.is_dir() and not path.name.startswith(".")]
        return [f"{prefix}{path.name}" for path in found if path.suffix == ".toml"] + folders

    return complete
