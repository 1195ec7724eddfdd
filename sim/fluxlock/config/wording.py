# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""What is wrong with a key, in our words: of a file that is read, and of a model that code makes."""

from __future__ import annotations

import datetime
import re
from collections.abc import Iterable, Iterator, Sequence
from typing import Any, get_args, get_origin

from pydantic import BaseModel, ValidationError
from pydantic_core import ErrorDetails

from fluxlock.config.errors import ConfigError, Problem, did_you_mean

_TYPE_WORDS = {
    "float_type": "a number",
    "int_type": "a whole number",
    "int_from_float": "a whole number",
    "string_type": "a string",
    "bool_type": "true or false",
    "list_type": "an array",
    "tuple_type": "an array",
    "model_type": "a table",
    "model_attributes_type": "a table",
    "dict_type": "a table",
}
_MESSAGES = {
    "string_too_short": "must not be empty",
    "too_short": "must not be empty",
    "too_long": "has too many entries, permitted {max_length}",
    # The names of windows are the only strings with a pattern.
    "string_pattern_mismatch": "may hold only letters, digits, _ and -, not {shown}",
}


def dotted(parts: Iterable[str | int]) -> str:
    """Key as messages write it: `event[2].at_s`."""
    text = ""
    for part in parts:
        text += f"[{part}]" if isinstance(part, int) else f".{part}" if text else part
    return text


def model_in(annotation: object) -> type[BaseModel] | None:
    """The model that an annotation holds, directly or in an optional or a list."""
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        return annotation
    return next((m for a in get_args(annotation) if (m := model_in(a)) is not None), None)


def _of_a_file(model: type[BaseModel]) -> bool:
    return bool(getattr(model, "OF_A_FILE", False))


def keys_of(model: type[BaseModel], prefix: str = "") -> Iterator[str]:
    """All dotted keys of a model; the files that a scenario names are one key each."""
    for name, info in model.model_fields.items():
        yield prefix + name
        inner = model_in(info.annotation)
        if inner is not None and not _of_a_file(inner):
            yield from keys_of(inner, f"{prefix}{name}.")


def _owner(model: type[BaseModel], loc: Sequence[str | int]) -> type[BaseModel]:
    """The model below another one that a place lies in."""
    for part in loc:
        if isinstance(part, str) and part in model.model_fields:
            model = model_in(model.model_fields[part].annotation) or model
    return model


def _unknown_key(model: type[BaseModel], loc: Sequence[str | int]) -> str:
    owner = _owner(model, loc[:-1])
    key = str(loc[-1])
    hint = did_you_mean(key, owner.model_fields)
    if not hint:
        elsewhere = [k for k in keys_of(model) if k.rpartition(".")[2] == key]
        hint = f', did you mean "{elsewhere[0]}"?' if elsewhere else f", permitted: {', '.join(owner.model_fields)}"
    return f"unknown key{hint}"


def quoted(value: object) -> str:
    """Value for a message as TOML would state it, cut to a readable length."""
    if isinstance(value, (datetime.date, datetime.time)):
        text = value.isoformat()
    else:
        text = str(value).lower() if isinstance(value, bool) else repr(value)
    return text if len(text) <= 60 else text[:57] + "..."


def is_array_of_tables(model: type[BaseModel], path: Sequence[str | int]) -> bool:
    """Whether a path is one of the model's own arrays of tables."""
    info = model.model_fields.get(str(path[0]))
    if len(path) > 1 or info is None:
        return False
    return get_origin(info.annotation) is list and model_in(info.annotation) is not None


def describe(model: type[BaseModel], error: ErrorDetails) -> tuple[str, str]:
    """Key and message of one pydantic error in our words."""
    loc, kind = list(error["loc"]), error["type"]
    context: dict[str, Any] = error.get("ctx", {})
    message = error["msg"]
    if kind == "conflict":
        loc += [part for part in str(context["key"]).split(".") if part]
    elif kind == "range":
        loc += [context["index"]] if context["index"] >= 0 else []
    elif kind == "extra_forbidden":
        message = _unknown_key(model, loc)
    elif kind == "missing":
        message = "required key is missing"
    elif kind == "literal_error":
        permitted = re.findall(r"'([^']*)'", str(context["expected"]))
        hint = did_you_mean(str(error["input"]), permitted)
        message = f"{quoted(error['input'])} is not permitted, permitted: {', '.join(permitted)}{hint}"
    elif kind == "list_type" and isinstance(error["input"], dict) and is_array_of_tables(model, loc):
        message = f"must be an array of tables, [[{loc[-1]}]] in a file, not {quoted(error['input'])}"
    elif kind == "model_type" and _of_a_file(part := _owner(model, loc)):
        message = (
            f"must be {'an' if part.__name__[0] in 'AEIOU' else 'a'} {part.__name__}, not {quoted(error['input'])}"
        )
    elif kind in _TYPE_WORDS:
        message = f"must be {_TYPE_WORDS[kind]}, not {quoted(error['input'])}"
    elif kind in _MESSAGES:
        message = _MESSAGES[kind].format(shown=quoted(error["input"]), **context)
    else:
        message = f"{message[:1].lower()}{message[1:]} ({quoted(error['input'])})"
    return dotted(loc), message


def refusal(model: type[BaseModel], error: ValidationError) -> ConfigError:
    """What code gets that makes a model of bad values: a line a key, with the model's name in the place of a file's."""
    found = [Problem(model.__name__, *describe(model, e)) for e in error.errors(include_url=False)]
    return ConfigError(dict.fromkeys(found))
