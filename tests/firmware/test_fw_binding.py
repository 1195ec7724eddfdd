# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""The binding of the firmware's headers: a name that C does not have fails by its name."""

from __future__ import annotations

import re
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import get_args

import pytest

from fluxlock.config.injection import InjectionMethod, Sequence
from fluxlock.config.vector import InversePark, Regulator
from fluxlock.cosim import branches, native
from fluxlock.firmware import build_host_library
from fluxlock.firmware.binding import names, new, open_library, types
from fluxlock.firmware.toolchain import SW
from fluxlock.firmware.vector_formats import Complex
from fluxlock.generate.memory import PUBLISHED_ADDRESS, TELEMETRY_ADDRESS
from fluxlock.headers import CData, HeaderError, bind
from fluxlock.native.node import EXTENDED, REMOTE
from fluxlock.plant import layout
from fluxlock.results.rundata import LogKind
from fluxlock.results.verdict import STATES

Bound = Callable[[str, str], CData]


@pytest.fixture
def bound(tmp_path: Path) -> Bound:
    """Types of a copy of control/ramp.h in which a text is another one."""

    def changed(before: str, after: str) -> CData:
        shutil.copytree(SW / "control", tmp_path / "control")
        header = tmp_path / "control" / "ramp.h"
        assert before in header.read_text()
        header.write_text(header.read_text().replace(before, after))
        return bind([header], tmp_path, tmp_path)

    return changed


def test_renamed_field_fails_by_name(bound: Bound) -> None:
    """A field that C calls otherwise is neither read nor written, and the others stay where C has them."""
    ramp = bound("value_rpm_q8", "speed_rpm_q8").new("ramp_t *", (3, 4))
    assert (ramp.speed_rpm_q8, ramp.carry_q12) == (3, 4)
    with pytest.raises(AttributeError, match=r"ramp_t.*value_rpm_q8"):
        print(ramp.value_rpm_q8)
    with pytest.raises(AttributeError, match=r"ramp_t.*value_rpm_q8"):
        ramp.value_rpm_q8 = 1
    with pytest.raises(AttributeError, match=r"ramp_t.*nothing"):
        new("ramp_t", nothing=1)


def test_added_field_moves_the_others(bound: Bound) -> None:
    """What C puts before a field moves it in Python too."""
    changed = bound("int32_t value_rpm_q8;", "uint8_t added[3];\nint32_t value_rpm_q8;")
    assert (changed.offsetof("ramp_t", "value_rpm_q8"), changed.sizeof("ramp_t")) == (4, 12)


def test_changed_function_fails_by_name(bound: Bound) -> None:
    """A function that the library does not have, and one with other parameters."""
    library = bound("ramp_step(", "ramp_next(").dlopen(str(build_host_library()))
    with pytest.raises(types().error, match="ramp_next"):
        library.ramp_next()
    with pytest.raises(TypeError, match="2 arguments, got 1"):
        open_library().ramp_preset(new("ramp_t"))
    with pytest.raises(TypeError, match=r"ramp_t \*"):
        open_library().ramp_preset(new("pi_state_t"), 1)
    with pytest.raises(OverflowError):
        open_library().ramp_preset(new("ramp_t"), 2**31)


@pytest.mark.parametrize("text", ["int32_t value_rpm_q8 = 3;", "int32_t 4;"])
def test_unreadable_header_is_named(bound: Bound, text: str) -> None:
    """What the compiler or cffi does not read: header and line."""
    line = (SW / "control" / "ramp.h").read_text().splitlines().index("  int32_t value_rpm_q8;") + 1
    with pytest.raises(HeaderError, match=rf"control/ramp\.h:{line}"):
        bound("int32_t value_rpm_q8;", text)


def test_layout_that_cffi_does_not_know(bound: Bound) -> None:
    """An attribute moves the fields: the compiler refuses the offset that cffi has, by name."""
    with pytest.raises(HeaderError, match=re.escape("ramp_t.carry_q12")):
        bound("  uint32_t carry_q12;", "  __attribute__((aligned(16))) uint32_t carry_q12;")


def test_names_of_constants() -> None:
    """Constants of an enum by their order."""
    assert names("drive_state_t") == STATES
    for choice, enum in (
        (Sequence, "angle_sequence_t"),
        (Regulator, "regulator_order_t"),
        (InversePark, "park_t"),
        (InjectionMethod, "injection_method_t"),
    ):
        assert names(enum) == tuple(word.lower().replace("-", "_") for word in get_args(choice)), enum
    with pytest.raises(types().error, match="nothing_t"):
        names("nothing_t")


def test_numbers_that_python_has_of_c() -> None:
    """What Python and the simulator's main must know without a compiler is as the headers have it."""
    firmware, library, cosim = types(), open_library(), native.types().dlopen(None)
    assert (EXTENDED, REMOTE) == (library.CAN_EXTENDED, library.CAN_REMOTE)
    assert (branches.STATE_STARTING, branches.STATE_FAULT) == (library.STATE_STARTING, library.STATE_FAULT)
    assert firmware.offsetof("telemetry_t", "state") == branches.STATE_ADDRESS - TELEMETRY_ADDRESS
    assert firmware.offsetof("telemetry_t", "published_q32") == PUBLISHED_ADDRESS - TELEMETRY_ADDRESS
    assert {kind.name: kind.value for kind in LogKind} == {
        name.removeprefix("LOG_"): getattr(cosim, name) for name in dir(cosim) if name.startswith("LOG_")
    }
    for name in (name for name in dir(cosim) if name.startswith("IO_")):
        assert getattr(layout, name) == getattr(cosim, name), name
    assert tuple(name for name, _ in firmware.typeof("complex_t").fields) == Complex._fields
    words = {
        **{"STATE": "state", "FAULT": "fault", "LIMIT": "limit", "SPEED": "speed_rpm_q8"},
        **{"REFERENCE": "reference_rpm_q8", "TARGET": "target_rpm", "LOST_LOCKS": "lost_locks"},
    }
    main = (native.HEADER.parent / "cosim_main.cpp").read_text()
    taken = re.search(r"enum \{ (STATE = [^}]*) \};", main)
    assert taken is not None
    places = {name: int(place) for name, place in re.findall(r"(\w+) = (\d+)", taken[1])}
    assert places == {name: firmware.offsetof("telemetry_t", field) // 4 for name, field in words.items()}
