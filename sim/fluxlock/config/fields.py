# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Base model and field kinds of the input files: strict types, unknown keys refused, ranges with units.

A range is stated once, in the field. It gives the check, the message and the line of the schema page.
"""

from __future__ import annotations

from collections.abc import Sequence
from inspect import cleandoc
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, Literal, Unpack

from pydantic import (
    BaseModel,
    BeforeValidator,
    ConfigDict,
    Field,
    JsonValue,
    ValidationError,
    ValidationInfo,
    WithJsonSchema,
    field_validator,
)
from pydantic_core import PydanticCustomError

from fluxlock.config.errors import ConfigError, Problem
from fluxlock.config.wording import refusal
from fluxlock.interface.settings import Setting, load_settings

PHASE_NAMES = ("A", "B", "C")


class Model(BaseModel):
    """Base of all models: immutable, strict, no unknown keys, ranges of `quantity` fields checked.

    Code that makes one of bad values, or assigns to a key, gets a ConfigError. `model_validate` raises pydantic's
    error, from which the loader tells the file.
    """

    model_config = ConfigDict(extra="forbid", strict=True, frozen=True)
    OF_A_FILE: ClassVar[bool] = False  # a file of its own, which a scenario names

    if not TYPE_CHECKING:  # checkers know a model's keys, and that they are frozen

        def __init__(self, **keys: object) -> None:
            try:
                super().__init__(**keys)
            except ValidationError as error:
                raise refusal(type(self), error) from None

        # pydantic takes this for its own: a model within another one is made without it, and told with the outer one.
        __init__.__pydantic_base_init__ = True

        def __setattr__(self, key: str, value: object) -> None:
            try:
                super().__setattr__(key, value)
            except ValidationError:
                text = "cannot be assigned: `fluxlock.scenario_of(scenario, {key: value})` makes a changed one"
                raise ConfigError([Problem(type(self).__name__, key, text)]) from None

    def __init_subclass__(cls, settings: str | None = None, **options: Unpack[ConfigDict]) -> None:
        """Add the keys that the drive's table of settings has. settings: their table below [drive], "": [drive]."""
        super().__init_subclass__(**options)
        for setting in load_settings() if settings is not None else ():
            table, _, key = setting.file.rpartition(".")
            if setting.file and table == settings and setting.default is not None:
                cls.__annotations__[key] = _kind_of(setting)
                setattr(cls, key, _field_of(setting))

    @field_validator("*")
    @classmethod
    def _check_range(cls, value: object, info: ValidationInfo) -> object:
        extra = cls.model_fields[info.field_name or ""].json_schema_extra
        if value is None or not isinstance(extra, dict) or "minimum" not in extra:
            return value
        low, high, unit = extra["minimum"], extra["maximum"], str(extra["unit"])
        assert isinstance(low, (int, float)) and isinstance(high, (int, float))
        elements = value if isinstance(value, tuple) else (value,)
        for index, element in enumerate(elements):
            # Written so that a NaN is refused too.
            if not low <= element <= high:
                hint = f"; {extra['below']}" if element < low and extra["below"] else ""
                raise PydanticCustomError(
                    "range",
                    "{value} is out of range, permitted {range}{hint}",
                    {
                        "value": with_unit(element, unit),
                        "range": range_text(low, high, unit),
                        "hint": hint,
                        # Which element, if not all of them are the one number that the file states.
                        "index": index if len(set(elements)) > 1 else -1,
                    },
                )
        return value


def words_of(docstring: str | None) -> str:
    """A model's docstring for pages and editors: without the example in Python."""
    return cleandoc(docstring or "").partition("\n\n>>> ")[0]  # Python 3.12 and older keep the indentation


def _kind_of(setting: Setting) -> object:
    """Type of a setting's key."""
    return Literal[setting.choices] if setting.choices else bool if setting.kind == "switch" else int


def _field_of(setting: Setting) -> object:
    """Field of a setting's key."""
    if setting.kind == "number":
        return quantity(setting.text, setting.unit, *setting.range, default=setting.default)
    return Field(default=setting.default, description=setting.text)


def conflict(key: str, message: str) -> PydanticCustomError:
    """Error of a key that does not fit another one; for model validators, which have no key of their own."""
    return PydanticCustomError("conflict", "{message}", {"key": key, "message": message})


PhaseOrder = Literal["ABC", "ACB", "BAC", "BCA", "CAB", "CBA"]


def check_once(key: str, names: Sequence[str]) -> None:
    """Raise the error of a key that names something twice; for model validators."""
    for name in names:
        if names.count(name) > 1:
            raise conflict(key, f"names {name} twice")


def plain(value: float) -> str:
    """Number as messages and tables print it: no exponent for whole numbers of readable length."""
    return f"{value:.0f}" if abs(value) < 1e10 and float(value).is_integer() else f"{value:g}"


def with_unit(value: float, unit: str) -> str:
    """Value with unit as messages and tables print it."""
    return f"{plain(value)} {unit}".rstrip()


def range_text(low: float, high: float, unit: str) -> str:
    """Inclusive range as messages and tables print it."""
    return f"{plain(low)} to {with_unit(high, unit)}"


def quantity(
    description: str,
    unit: str,
    minimum: float,
    maximum: float,
    *,
    default: Any = ...,  # noqa: ANN401
    absent: str = "",
    below: str = "",
) -> Any:  # noqa: ANN401
    """Field for a number (or numbers per phase) with its unit and inclusive range.

    absent: what happens when an optional key without a plain default is left out, for the schema page. below: what to
    do instead, for the message of a value below the range.
    """
    extra: dict[str, JsonValue] = {
        "unit": unit,
        "minimum": minimum,
        "maximum": maximum,
        "absent": absent,
        "below": below,
    }
    return Field(default, description=description, json_schema_extra=extra)


def _expand(count: int, value: object) -> object:
    """One number becomes `count` equal ones; a list of the right length becomes a tuple."""
    if isinstance(value, (int, float)) and not isinstance(value, bool):
        return (value,) * count
    if isinstance(value, (list, tuple)) and len(value) == count:
        return tuple(value)
    raise PydanticCustomError("per_phase", "must be a number or an array of {count} numbers", {"count": count})


def _pair(value: object) -> object:
    """A list of two becomes a tuple."""
    if isinstance(value, (list, tuple)) and len(value) == 2:
        return tuple(value)
    raise PydanticCustomError("pair", "must be a pair of numbers [time in s, speed in r/min]")


def _powers(value: object) -> object:
    """A list of up to four coefficients becomes a tuple of four."""
    if isinstance(value, (list, tuple)) and 1 <= len(value) <= 4:
        return (*value, *(0.0,) * (4 - len(value)))
    raise PydanticCustomError("powers", "must be an array of one to four numbers, the powers 0 to 3")


def _numbers(low: int, high: int, one: bool = False) -> WithJsonSchema:
    """JSON schema of what a file states for a tuple. one: a single number stands for equal ones."""
    array: dict[str, Any] = {"type": "array", "items": {"type": "number"}, "minItems": low, "maxItems": high}
    return WithJsonSchema({"anyOf": [{"type": "number"}, array]} if one else array)


ProfilePoint = Annotated[tuple[float, float], BeforeValidator(_pair), _numbers(2, 2)]
PhaseValues = Annotated[tuple[float, float, float], BeforeValidator(lambda v: _expand(3, v)), _numbers(3, 3, True)]
Powers = Annotated[tuple[float, float, float, float], BeforeValidator(_powers), _numbers(1, 4)]
SectorValues = Annotated[
    tuple[float, float, float, float, float, float], BeforeValidator(lambda v: _expand(6, v)), _numbers(6, 6, True)
]
