# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Read motor, inverter and scenario files with `--set` overrides; all problems in one ConfigError."""

from __future__ import annotations

import os
import re
import tomllib
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from pydantic import ValidationError

from fluxlock.base.paths import shipped
from fluxlock.config.checks import check_scenario
from fluxlock.config.errors import SET_OPTION, ConfigError, Problem, closest
from fluxlock.config.fields import Model
from fluxlock.config.inverter import Inverter
from fluxlock.config.motor import Motor
from fluxlock.config.scenario import Accept, Scenario, Sources
from fluxlock.config.wording import describe, dotted, is_array_of_tables, quoted

_KINDS: dict[type[Model], str] = {Motor: "a motor file", Inverter: "an inverter file", Scenario: "a scenario"}


@dataclass(frozen=True)
class Override:
    """One `--set key=value`: key split at the dots, value as TOML reads it, else as a plain string."""

    key: tuple[str, ...]
    value: Any

    @staticmethod
    def parse(text: str) -> Override:
        """Read `key=value`; raise ConfigError if it is not of that form."""
        key, equals, value = text.partition("=")
        parts = tuple(re.sub(r"\[([^\]]*)\]", r".\1", key.strip()).split("."))
        if not equals or not all(parts):
            raise ConfigError(
                [Problem(SET_OPTION, text, "must have the form key=value, such as drive.commutation=CSC")]
            )
        value = value.strip()
        try:
            table = tomllib.loads(f"value = {value}")
        except tomllib.TOMLDecodeError as error:
            # A plain word needs no quotes; what opens or closes a TOML value must be one.
            if value.startswith(('"', "'", "[", "{")) or value.endswith('"'):
                text = f"{value} is not valid TOML ({error}); close quotes and brackets, or leave the quotes out"
                raise ConfigError([Problem(SET_OPTION, key.strip(), text)]) from None
            return Override(parts, value)
        if len(table) > 1:
            raise ConfigError([Problem(SET_OPTION, key.strip(), "holds several lines; give each key its own --set")])
        return Override(parts, table["value"])


def _is_kind(path: Path, model: type[Model]) -> bool:
    """Whether a file holds at least half of the keys that the model requires."""
    try:
        table = tomllib.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return False
    required = [name for name, info in model.model_fields.items() if info.is_required()]
    return 2 * sum(name in table for name in required) >= len(required)


def _alike(path: Path, model: type[Model]) -> str:
    """Hint at a file of like name and of the same kind beside one that does not exist."""
    stem = closest(path.name.removesuffix(".toml"), [p.stem for p in path.parent.glob("*.toml") if _is_kind(p, model)])
    return f', did you mean "{stem}.toml"?' if stem else ""


def _kind(table: dict[str, Any]) -> type[Model] | None:
    """The kind of file that a table is by the keys that no other kind has; None if that is not clear."""
    scores = {}
    for model in _KINDS:
        others = {key for other in _KINDS if other is not model for key in other.model_fields}
        scores[model] = len(table.keys() & (model.model_fields.keys() - others))
    found = [model for model, score in scores.items() if score]
    return found[0] if len(found) == 1 and scores[found[0]] > 1 else None


def _read_toml(path: Path, shown: str, model: type[Model], referrer: Problem | None = None) -> dict[str, Any]:
    """Read one file. referrer: file and key that name it, for the message if it does not exist."""
    try:
        table = tomllib.loads(path.read_text(encoding="utf-8"))
        kind = _kind(table)
        if kind in (None, model):
            return table
        problem = Problem(shown, "", f"is {_KINDS[kind]}, not {_KINDS[model]}")
    except (FileNotFoundError, NotADirectoryError):
        hint = _alike(path, model)
        if referrer is not None:
            problem = Problem(referrer.file, referrer.key, f"file not found ({shown}){hint}")
        else:
            problem = Problem(shown, "", f"file not found{hint}")
    except IsADirectoryError:
        problem = Problem(shown, "", "is a folder, not a file")
    except (PermissionError, UnicodeDecodeError) as error:
        problem = Problem(shown, "", f"cannot be read ({error})")
    except tomllib.TOMLDecodeError as error:
        problem = Problem(shown, "", f"is not valid TOML: {error}")
    raise ConfigError([problem])


def _apply(table: dict[str, Any], override: Override) -> str:
    """Put one override into a table; return its key as messages write it.

    Entries of arrays are named by index from 0, windows also by name.
    """
    here: Any = table
    path: list[str | int] = []
    for position, part in enumerate(override.key):
        last = position == len(override.key) - 1
        if isinstance(here, list):
            index = int(part) if part.isdigit() else -1
            names = [e.get("name") for e in here if isinstance(e, dict)]
            if index < 0 and part in names:
                index = names.index(part)
            if not 0 <= index < len(here):
                text = f'has no entry "{part}", {_entries(len(here), [n for n in names if isinstance(n, str)])}'
                raise ConfigError([Problem(SET_OPTION, dotted(path), text)])
            path.append(index)
            if last:
                here[index] = override.value
            else:
                here = here[index]
        elif isinstance(here, dict):
            path.append(part)
            if last:
                here[part] = override.value
            else:
                here = here.setdefault(part, {})
        else:
            raise ConfigError([Problem(SET_OPTION, dotted([*path, part]), f"{dotted(path)} is not a table")])
    return dotted(path)


def _entries(count: int, names: Sequence[str]) -> str:
    """What an entry of an array may be called."""
    return f"permitted: {', '.join([f'0 to {count - 1}', *names])}" if count else "the array is empty"


class _Source:
    """One file on its way to a model: raw table, how messages name it, which keys come from `--set`."""

    def __init__(self, model: type[Model], shown: str, table: dict[str, Any], prefix: str) -> None:
        self.model = model
        self.shown = shown
        self.table = table
        self.prefix = prefix
        self.touched: list[str] = []

    def override(self, overrides: Iterable[Override]) -> None:
        for override in overrides:
            first, *rest = override.key
            if rest and first not in self.table and is_array_of_tables(self.model, [first]):
                give = f"give whole entries with {SET_OPTION} '{first}=[{{...}}]'"
                text = f'has no entry "{rest[0]}", the scenario has no [[{first}]]; {give}'
                raise ConfigError([Problem(SET_OPTION, self.prefix + first, text)])
            self.touched.append(_apply(self.table, override))

    def problem(self, key: str, message: str) -> Problem:
        """Problem of a key, charged to `--set` if that is where its value comes from."""
        for touched in self.touched:
            below, above = (f"{touched}.", f"{touched}["), (f"{key}.", f"{key}[")
            if key == touched or key.startswith(below) or (key and touched.startswith(above)):
                return Problem(SET_OPTION, self.prefix + key, message)
        return Problem(self.shown, key, message)

    def problems(self, error: ValidationError) -> list[Problem]:
        found = [self.problem(*describe(self.model, e)) for e in error.errors(include_url=False)]
        return list(dict.fromkeys(found))


def _load_plain(source: _Source) -> Model:
    try:
        return source.model.model_validate(source.table)
    except ValidationError as error:
        raise ConfigError(source.problems(error)) from None


def _path(given: object, model: type[Model]) -> Path:
    """Where a file is that a caller has named."""
    if not isinstance(given, (str, os.PathLike)):
        raise ConfigError([Problem("", "", f"must be the path of {_KINDS[model]}, not {quoted(given)}")])
    return shipped(Path(given))


def load_motor(path: Path | str) -> Motor:
    """Read and check a motor file: SI units, arrays of one value per phase. Raises ConfigError with all problems.

    path: a file, or a shipped one by its name.

    >>> load_motor("motors/spindle-2pp.toml").mean_inductance_h  # H
    0.00012
    """
    path = _path(path, Motor)
    motor = _load_plain(_Source(Motor, str(path), _read_toml(path, str(path), Motor), ""))
    assert isinstance(motor, Motor)
    return motor


def load_inverter(path: Path | str) -> Inverter:
    """Read and check an inverter file, in SI units. Raises ConfigError with all problems.

    path: a file, or a shipped one by its name.

    >>> load_inverter("inverters/drive-48v.toml").supply_v  # V
    48.0
    """
    path = _path(path, Inverter)
    inverter = _load_plain(_Source(Inverter, str(path), _read_toml(path, str(path), Inverter), ""))
    assert isinstance(inverter, Inverter)
    return inverter


def _load_part(
    name: str,
    model: type[Model],
    scenario: _Source,
    folder: Path,
    overrides: Sequence[Override],
    problems: list[Problem],
) -> tuple[Model | None, str]:
    """Motor or inverter of a scenario; problems are added to the list."""
    replaced = [o.value for o in overrides if o.key == (name,)]
    reference = replaced[-1] if replaced else scenario.table.get(name)
    referrer = Problem(SET_OPTION if replaced else scenario.shown, name, "")
    if reference is None:
        problems.append(Problem(scenario.shown, name, f"required key is missing: path of the {name} file"))
        return None, name
    if not isinstance(reference, str):
        text = f"must be the path of a {name} file, not {quoted(reference)}"
        problems.append(Problem(referrer.file, name, text))
        return None, name
    # A path on the command line starts where the command runs, one in the file where the file is.
    path = Path(os.path.normpath(shipped(Path(reference)) if replaced else folder / reference))
    try:
        source = _Source(model, str(path), _read_toml(path, str(path), model, referrer), f"{name}.")
        source.override(Override(o.key[1:], o.value) for o in overrides if o.key[0] == name and len(o.key) > 1)
        return _load_plain(source), str(path)
    except ConfigError as error:
        problems += error.problems
        return None, str(path)


ALLOW_OVERLOAD = "--allow-overload"


def load_scenario(
    path: Path | str, overrides: Iterable[str | Override] = (), *, allow_overload: bool = False
) -> Scenario:
    """Read a scenario with its motor and inverter, apply overrides (`key=value` or objects), check everything.

    path: a file, or a shipped one by its name. allow_overload: the limit of the current may keep the drive from its
    speeds, as `[[accept]]` would say.

    Override keys are those of the scenario file; `motor.x` and `inverter.x` reach into those files,
    `motor=FILE` and `inverter=FILE` replace them. Raises ConfigError with all problems that were found.

    >>> load_scenario("scenarios/own-spindle.toml", ["drive.carrier_hz=40_000"]).drive.carrier_hz  # Hz
    40000.0
    """
    path = _path(path, Scenario)
    source = _Source(Scenario, str(path), _read_toml(path, str(path), Scenario), "")
    parsed: list[Override] = []
    problems: list[Problem] = []
    for override in overrides:
        try:
            parsed.append(override if isinstance(override, Override) else Override.parse(override))
        except ConfigError as error:
            problems += error.problems
    motor, motor_file = _load_part("motor", Motor, source, path.parent, parsed, problems)
    inverter, inverter_file = _load_part("inverter", Inverter, source, path.parent, parsed, problems)
    # Instances pass as they are; a part with problems is left out and its absence not reported a second time.
    source.table = {k: v for k, v in source.table.items() if k not in ("motor", "inverter")}
    source.table |= {k: v for k, v in (("motor", motor), ("inverter", inverter)) if v is not None}
    files = Sources(str(path), motor_file, inverter_file, tuple(o.key for o in parsed))
    return _checked(source, parsed, files, problems, allow_overload)


def _whole(name: str, model: type[Model], value: object, file: str) -> tuple[Model, str]:
    """Motor or inverter that takes the place of a scenario's, and its file: a model, which has none, or a path."""
    if isinstance(value, model):
        return value, file
    if not isinstance(value, str):
        text = f"must be a {model.__name__} or the path of its file, not {quoted(value)}"
        raise ConfigError([Problem(SET_OPTION, name, text)])
    path = Path(os.path.normpath(shipped(Path(value))))
    table = _read_toml(path, str(path), model, Problem(SET_OPTION, name, ""))
    return _load_plain(_Source(model, str(path), table, "")), str(path)


def _table(model: Model) -> dict[str, Any]:
    """What a file of a model would state; of a copy that code has changed, unknown keys too."""
    unknown = model.model_fields_set - type(model).model_fields.keys()
    return model.model_dump(exclude_unset=True, warnings=False) | {key: getattr(model, key) for key in unknown}


def changed(scenario: Scenario, overrides: Iterable[Override]) -> Scenario:
    """A scenario with keys changed, checked like one that is read; `motor` and `inverter` by a whole model or a path.

    Raises ConfigError with all problems.
    """
    parsed, problems = list(overrides), list[Problem]()
    files = scenario.sources
    source = _Source(Scenario, files.scenario, _table(scenario), "")
    places = {"motor": files.motor, "inverter": files.inverter}
    for name, model in (("motor", Motor), ("inverter", Inverter)):
        whole = [getattr(scenario, name), *(o.value for o in parsed if o.key == (name,))][-1]
        try:
            base, places[name] = _whole(name, model, whole, places[name])
            part = _Source(model, places[name], _table(base), f"{name}.")
            part.override(Override(o.key[1:], o.value) for o in parsed if o.key[0] == name and len(o.key) > 1)
            source.table[name] = _load_plain(part)
        except ConfigError as error:
            problems += error.problems
            del source.table[name]  # its absence is not reported a second time
    files = replace(files, **places, overrides=(*files.overrides, *(o.key for o in parsed)))
    return _checked(source, parsed, files, problems)


def _checked(
    source: _Source,
    overrides: Sequence[Override],
    files: Sources,
    problems: list[Problem],
    allow_overload: bool = False,
) -> Scenario:
    """The scenario of a table with motor and inverter in it; problems: what was found on the way here."""
    for override in overrides:
        if override.key[0] not in ("motor", "inverter"):
            try:
                source.override([override])
            except ConfigError as error:
                problems += error.problems
    try:
        scenario = Scenario.model_validate(source.table)
    except ValidationError as error:
        problems += [p for p in source.problems(error) if p.key not in ("motor", "inverter")]
        raise ConfigError(problems) from None
    if allow_overload:
        scenario.accept.append(Accept(what="current", why=ALLOW_OVERLOAD))
        scenario.model_fields_set.add("accept")  # as the file would state it
    scenario._sources = files
    for p in check_scenario(scenario):
        problems.append(source.problem(p.key, p.message) if p.file == files.scenario else scenario.sources.charged(p))
    if problems:
        raise ConfigError(problems)
    return scenario
