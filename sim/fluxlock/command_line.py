# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""What the commands `fluxlock` and `fluxverify` share: exit codes, the seed, and how bad input is said.

Exit codes:

* 0: done and passed
* 1: the run failed (`fluxlock.results.verdict`), or the simulation broke off
* 2: bad input
* 130: interrupted
* 141: the reader of the output is gone (`| head`)
* 143: terminated
"""

from __future__ import annotations

import signal
import sys
from typing import Annotated, NoReturn

import typer

from fluxlock.base.interrupts import EXIT_INTERRUPTED, EXIT_TERMINATED
from fluxlock.base.writable import EXIT_BAD_INPUT, EXIT_READER_GONE, reader_gone, refusal
from fluxlock.config import ConfigError, Problem
from fluxlock.config.scenario import SEED_MAX
from fluxlock.generated import SourceError
from fluxlock.help import fit_help
from fluxlock.workers import WorkerLost

EXIT_FAILED = 1


def read_seed(text: str) -> int:
    """Value of `--seed`."""
    if not (text.isascii() and text.isdigit() and int(text) <= SEED_MAX):
        raise ConfigError([Problem("--seed", "", f"must be a whole number from 0 to {SEED_MAX}, not {text!r}")])
    return int(text)


SeedOption = Annotated[int | None, typer.Option(parser=read_seed, metavar="NUMBER", help="Seed of the noise.")]
SchedulerOption = Annotated[
    str | None, typer.Option(metavar="ADDRESS", help="Dask scheduler in place of this machine, tcp://host:8786.")
]
SetOption = Annotated[
    list[str] | None,
    typer.Option("--set", metavar="KEY=VALUE", help="Override a key, also motor.KEY and inverter.KEY. Repeatable."),
]


def no_scheduler(address: str | None, option: str) -> None:
    """ConfigError where an option runs nothing that a scheduler could take."""
    if address is not None:
        raise ConfigError([Problem("--scheduler", address, f"{option} runs nothing; leave one of them out")])


def _report_usage(error: typer.TyperException, program: str) -> None:
    """Wrong usage in one line; without any argument the help text is the answer."""
    context = getattr(error, "ctx", None)
    command = context.command_path if context else program
    text = error.format_message().rstrip(".")
    if text:
        print(f"error: {command}: {text[:1].lower()}{text[1:]}; see {command} --help", file=sys.stderr)


# What to do about problems that do not say it themselves, by the end of their message.
ADVICE = {
    "file not found": "; see `ls scenarios motors inverters`",
    "required key is missing": "; add it: docs/reference/files.md explains every key",
    "is a folder, not a file": "; name a file in it",
}


def _advice(problem: Problem) -> str:
    return next((advice for end, advice in ADVICE.items() if problem.message.endswith(end)), "")


def _terminate(*_: object) -> NoReturn:
    """SIGTERM unwinds like Ctrl-C: the simulator's process ends with this one."""
    sys.exit(EXIT_TERMINATED)


def run_command_line(app: typer.Typer, program: str) -> NoReturn:
    """Run what was typed and leave with its exit code: bad input is one line a problem and code 2, never a traceback.

    Args:
        app: the commands.
        program: the word that they are called by.
    """
    before = signal.signal(signal.SIGTERM, _terminate)
    fit_help()
    try:
        code = app(prog_name=program, standalone_mode=False) or 0
        sys.stdout.flush()
    except ConfigError as error:
        for problem in error.problems:
            print(f"error: {problem}{_advice(problem)}", file=sys.stderr)
        code = EXIT_BAD_INPUT
    except (SourceError, WorkerLost) as error:
        print(f"error: {error}", file=sys.stderr)
        code = EXIT_BAD_INPUT
    except typer.TyperException as error:
        _report_usage(error, program)
        code = EXIT_BAD_INPUT
    except BrokenPipeError:
        code = reader_gone()
    except OSError as error:
        text = refusal(error)
        if text is None:
            raise
        print(f"error: {text}", file=sys.stderr)
        code = EXIT_BAD_INPUT
    except KeyboardInterrupt:
        code = EXIT_INTERRUPTED
    except SystemExit as error:
        # Rich ends the program itself when the reader is gone.
        gone = isinstance(error.__context__, BrokenPipeError)
        code = EXIT_READER_GONE if gone else error.code if isinstance(error.code, int) else EXIT_FAILED
    finally:
        signal.signal(signal.SIGTERM, before)
    if code in (EXIT_INTERRUPTED, EXIT_TERMINATED):
        print("interrupted" if code == EXIT_INTERRUPTED else "terminated", file=sys.stderr)
    sys.exit(code)
