# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""What a page may send: one JSON object per message, checked whole before anything is done.

No message names a path: exports have a word for a name, and the server puts them into its own folder.
"""

from __future__ import annotations

import re
from typing import Annotated, Literal

from pydantic import BaseModel, ConfigDict, Field, TypeAdapter

from fluxlock.config.scenario import Fault

LONGEST = 16_384  # bytes of a message
TRACES_MOST = 64  # in a picture
NAME = r"^[A-Za-z0-9][A-Za-z0-9_-]{0,39}$"
VALUE = r"^(-?\d{0,12}\.?\d{1,12}|[A-Za-z][A-Za-z0-9_-]{0,23})$"  # a number or a word
Seconds = Annotated[float, Field(ge=0.0, le=1e6, allow_inf_nan=False)]
Trace = Annotated[str, Field(pattern=r"^[a-z_]{1,24}$")]


class Message(BaseModel):
    """Base: no other keys, no numbers from texts."""

    model_config = ConfigDict(extra="forbid", strict=True, frozen=True)


class Trigger(Message):
    """A level that a trace passes, or an instant.

    mark: a kind of instant, in place of trace and level; size: of the magnitude; before: part of the span that lies
    before it; after_s: what was before is passed by, s.
    """

    trace: Trace = "state"
    level: float = Field(default=0.0, allow_inf_nan=False, ge=-1e9, le=1e9)
    mark: Literal[
        "", "commutation", "crossing", "crossing late", "trip", "state change", "fault", "crossing masked"
    ] = ""
    rising: bool = True
    size: bool = False
    before: float = Field(default=0.5, ge=0.0, le=1.0)
    after_s: float = Field(default=-1.0, ge=-1.0, le=1e6, allow_inf_nan=False)


class View(Message):
    """A picture is wanted: the last `span_s`, or what ends at `to_s`, or what is around the last trigger."""

    kind: Literal["view"]
    traces: list[Trace] = Field(min_length=1, max_length=TRACES_MOST)
    width: int = Field(ge=16, le=8192)  # pixels
    span_s: float = Field(ge=1e-4, le=3600.0, allow_inf_nan=False)
    to_s: Seconds | None = None
    trigger: Trigger | None = None


class Planes(Message):
    """Currents in the stationary plane and the rotor's, and the angles at the end, of a short span."""

    kind: Literal["planes"]
    span_s: float = Field(ge=1e-5, le=1.0, allow_inf_nan=False)
    to_s: Seconds | None = None


class Drive(Message):
    """A button."""

    kind: Literal["drive"]
    do: Literal["start", "stop", "stop now", "reverse", "clear"]


class Set(Message):
    """A setting of the console, by name."""

    kind: Literal["set"]
    name: str = Field(pattern=r"^[a-z0-9_]{1,40}$")
    value: str = Field(pattern=VALUE)


class LoadFactor(Message):
    """Factor of the scenario's load torque."""

    kind: Literal["load"]
    factor: float = Field(ge=0.0, le=100.0, allow_inf_nan=False)


class Supply(Message):
    """Supply voltage; ramp_s: time in which it gets there."""

    kind: Literal["supply"]
    volt: float = Field(ge=0.0, le=1500.0, allow_inf_nan=False)
    ramp_s: float = Field(default=0.0, ge=0.0, le=10.0, allow_inf_nan=False)


class Break(Message):
    """A fault of the plant, or the end of all."""

    kind: Literal["fault"]
    fault: Fault


class Bus(Message):
    """The other node on the bus falls silent, or is heard again."""

    kind: Literal["bus"]
    silent: bool


class Answer(Message):
    """To the question of a first start with the number `asked`; a no where nothing is asked ends the step."""

    kind: Literal["answer"]
    asked: int = Field(ge=0, le=1000)
    yes: bool


class Pace(Message):
    """Simulated over real time; 0: pause."""

    kind: Literal["pace"]
    factor: float = Field(ge=0.0, le=100.0, allow_inf_nan=False)


class Step(Message):
    """So much simulated time, on a chip no further than to the next `until`; then pause. "end": for its time."""

    kind: Literal["step"]
    seconds: float = Field(gt=0.0, le=10.0, allow_inf_nan=False)
    until: Literal["end", "commutation", "tick"] = "end"


class Restart(Message):
    """Begin anew at time 0."""

    kind: Literal["restart"]


class Export(Message):
    """Write a scenario that repeats what was done until now."""

    kind: Literal["export"]
    name: str = Field(pattern=NAME)


class Table(Message):
    """Write traces of a span as a table."""

    kind: Literal["csv", "parquet"]
    name: str = Field(pattern=NAME)
    traces: list[Trace] = Field(min_length=1, max_length=TRACES_MOST)
    from_s: Seconds
    to_s: Seconds


Action = Drive | Set | LoadFactor | Supply | Break | Bus
Order = Action | Answer | Pace | Step | Restart | Export  # to the source
Received = View | Planes | Table | Order
_ADAPTER: TypeAdapter[Received] = TypeAdapter(Annotated[Received, Field(discriminator="kind")])


def parse(text: str) -> Received:
    """A message, or ValueError with one line that says what is wrong with it."""
    if len(text) > LONGEST:
        raise ValueError(f"a message has at most {LONGEST} characters")
    try:
        return _ADAPTER.validate_json(text)
    except ValueError as error:
        raise ValueError(one_line(error)) from None


def one_line(error: ValueError) -> str:
    """The first problem of a validation in printable ASCII."""
    problems: list[dict[str, object]] = getattr(error, "errors", list)()
    first = problems[0] if problems else {"loc": (), "msg": str(error)}
    loc = first["loc"]
    where = ".".join(str(part) for part in loc) if isinstance(loc, tuple) else ""
    if NAME in str(first["msg"]):
        return f"{where}: a name has 1 to 40 letters, digits, - and _, a letter or digit first"
    if VALUE in str(first["msg"]):
        return f"{where}: a value is a number such as 12.5, or a word"
    text = f"{where}: {first['msg']}" if where else str(first["msg"])
    return re.sub(r"[^ -~]+", "?", text)[:200]
