# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Machines whose EMF drives a current to the trip within 50 us are caught on the whole chip."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from fluxlock.population.draw import Draw
from fluxlock.population.files import write_life
from fluxlock.population.life import life_of
from tests.closed_loop.support import drive

MACHINE = 38  # 64 V, 2.7 kHz: its EMF shorted by two switches drives 80 A/ms, the trip is at 3.6 A
SHARES = (0.6, 1.0)
# Instants of a carrier, a tick and a sector.
STARTS_S = (0.003, 0.00304)


@pytest.mark.parametrize("start_s", STARTS_S)
@pytest.mark.parametrize("share", SHARES)
def test_fast_machine_is_caught_within_its_current_limit(share: float, start_s: float, tmp_path: Path) -> None:
    """The first carriers already have the pulses of the EMF when the gates open.

    Verifies: FW-30
    """
    life = life_of(Draw.of(1, MACHINE), "six-step")
    rpm = round(share * life.scenario.motor.max_speed_rpm)
    events = ["{at_s=0.0,load_factor=0}", f"{{at_s=0.002,speed_rpm={rpm}}}", f"{{at_s={start_s},command='start'}}"]
    run = drive(
        write_life(life, tmp_path),
        f"fast-catch-{share}-{start_s}",
        f"initial.speed_rpm={rpm}",
        f"event=[{','.join(events)}]",
        *("window=[]", "expect=[]", "duration_s=0.014"),
    )
    assert run.verdict.failures == []
    records = run.data.records
    assert np.count_nonzero(records["gates"]) > 0
    assert max(float(np.abs(records[name]).max()) for name in ("ia", "ib", "ic")) < life.scenario.current_limit_a
