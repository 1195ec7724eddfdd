# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""A mechanical load that a user wrote in Python: asked once a period, its torque stands until the next call.

The function sees speed, angle and time of the period's middle: speed goes on as it grew in the period before, the angle
at that speed. So the held torque is that of a continuous load, but for terms of the second order in the period. What
jumps with the speed, as dry friction does at standstill, swings there by up to 1.5 times a period's change of speed.
"""

from __future__ import annotations

import inspect
import math
import pickle
import sys
from collections.abc import Callable
from importlib import import_module
from numbers import Real
from pathlib import Path
from traceback import extract_tb
from typing import TYPE_CHECKING, Any

import numpy as np

from fluxlock.results.rundata import SimulationFault

if TYPE_CHECKING:  # slow to load: the simulator's process, whose plans name PythonLoad, needs nothing of it
    from fluxlock.config import Scenario

NAME = "load_nm"
PERIOD_CYCLES = 1_000  # of the chip's clock, 20 us
LARGEST_NM = 1e4  # as in a motor file
LoadFunction = Callable[[float, float, float], float]


class PythonLoad:
    """A user's function of speed (mechanical, rad/s), angle (mechanical, rad, unwrapped) and time (s), in N m.

    A positive torque brakes a positive speed. Raises ConfigError for what is no function of three numbers.
    """

    def __init__(self, function: LoadFunction) -> None:
        if not callable(function):
            _refuse(f"must be a function, not {function!r}")
        try:
            inspect.signature(function).bind(0.0, 0.0, 0.0)
        except ValueError:  # a built-in one does not say what it takes
            pass
        except TypeError as error:
            _refuse(f"must take speed_rad_s, angle_rad and time_s ({error})")
        self.function = function
        self._before: tuple[float, float] | None = None  # time and speed of the last call

    def __reduce__(self) -> tuple[Callable[[bytes], PythonLoad], tuple[bytes]]:
        return _unpacked, (_packed(self.function),)

    def torque_nm(self, time_s: float, speed_rad_s: float, angle_rad: float, period_s: float) -> float:
        """Torque to hold from a time on for a period, by what the shaft does then.

        Raises SimulationFault where the function raises, or returns no finite number.
        """
        before, self._before = self._before, (time_s, speed_rad_s)
        half_s, middle = 0.5 * period_s, speed_rad_s
        if before is not None and time_s > before[0]:
            middle += half_s * (speed_rad_s - before[1]) / (time_s - before[0])
        seen = (middle, angle_rad + half_s * speed_rad_s, time_s + half_s)
        try:
            value = self.function(*seen)
        except Exception as error:  # of the user's code, whatever it is
            frame = extract_tb(error.__traceback__)[-1]
            place = f"{Path(frame.filename).name}, line {frame.lineno}"
            raise SimulationFault(_at(f"raised {type(error).__name__}: {error} ({place})", seen)) from error
        if isinstance(value, np.ndarray) and value.ndim == 0:
            value = value.item()
        if isinstance(value, bool) or not isinstance(value, Real):
            raise SimulationFault(_at(f"must return a number, N m, not {value!r}", seen))
        if not (math.isfinite(value) and abs(value) <= LARGEST_NM):
            raise SimulationFault(_at(f"returned {value} N m, permitted -{LARGEST_NM:g} to {LARGEST_NM:g}", seen))
        return float(value)


def check_rotor(scenario: Scenario) -> None:
    """ConfigError where no load acts: the rotor is not free."""
    from fluxlock.config import ConfigError

    if scenario.mechanics.mode != "free":
        text = f'a rotor that is "{scenario.mechanics.mode}" has no load: leave {NAME} out'
        raise ConfigError([scenario.sources.problem("mechanics.mode", text)])


def _refuse(text: str) -> None:
    from fluxlock.config import ConfigError, Problem

    raise ConfigError([Problem(NAME, "", text)])


def _at(text: str, seen: tuple[float, float, float]) -> str:
    speed, angle, time_s = seen
    return f"{NAME} {text}; called with speed_rad_s={speed:.6g}, angle_rad={angle:.6g}, time_s={time_s:.6g}"


def _packed(function: LoadFunction) -> bytes:
    """The function itself, not its module's name: another process may not find the file that it stands in."""
    cloudpickle: Any = import_module("cloudpickle")  # without types
    name = getattr(function, "__module__", None) or "__main__"
    by_value = hasattr(sys.modules.get(name), "__file__") and name != "__main__"
    by_value = by_value and name not in cloudpickle.list_registry_pickle_by_value()
    if by_value:
        cloudpickle.register_pickle_by_value(sys.modules[name])
    try:
        packed: bytes = cloudpickle.dumps(function)
    except (TypeError, pickle.PicklingError) as error:
        _refuse(f"cannot go to another process ({error}): make open files, locks and the like inside the function")
        raise
    finally:
        if by_value:
            cloudpickle.unregister_pickle_by_value(sys.modules[name])
    return packed


def _unpacked(packed: bytes) -> PythonLoad:
    return PythonLoad(pickle.loads(packed))
