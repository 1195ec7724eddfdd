# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""The machines of the population: frozen ranges, drawn within them, the same anywhere, files that say the same."""

from __future__ import annotations

import hashlib
import math
from pathlib import Path

import numpy as np
import pytest

from fluxlock.config import load_scenario
from fluxlock.config.vector_design import told_machine
from fluxlock.population.draw import METHODS, Draw, Method, parts
from fluxlock.population.files import write_life
from fluxlock.population.life import life_of, told_scenario
from fluxlock.population.ranges import PATH, ranges

FROZEN = "0e4e63dacb07257dd12ac453699d2ef6926bbeb1c9c4977c7c4742a5691a8e81"
DRAWS = [Draw.of(1, index) for index in range(400)]


def test_ranges_are_frozen() -> None:
    """A drive that fails on a machine is mended, not the ranges.

    Verifies: POP-01
    """
    assert hashlib.sha256(PATH.read_bytes()).hexdigest() == FROZEN


def test_draws_keep_the_ranges_and_reach_their_ends() -> None:
    """Each quantity lies within its range and spreads over nine tenths of it.

    Verifies: POP-01
    """
    for name in ("power_w", "supply_v", "pole_pairs", "base_hz", "resistance_pu", "inductance_pu", "run_up_s"):
        low, high = np.log(getattr(ranges(), name))
        values = np.log([getattr(d, name) for d in DRAWS])
        assert low <= values.min() and values.max() <= high, name
        assert np.ptp(values) > 0.9 * (high - low), name
    assert {d.emf for d in DRAWS} == set(ranges().emf)
    salient = [d.saliency for d in DRAWS if d.saliency > 1.0]
    assert 100 < len(salient) < 300 and max(salient) <= ranges().saliency[1]
    for name, share in ranges().file_error.model_dump().items():
        factors = np.array([getattr(d.error, name) for d in DRAWS])
        assert 0.9 * share < np.abs(factors - 1).max() <= share, name


@pytest.mark.parametrize("method", METHODS)
def test_models_are_the_machine(method: Method) -> None:
    """Per-unit values, run-up time and carriers come out of the motor and inverter models again.

    Verifies: POP-01
    """
    for d in DRAWS:
        p = parts(d, method)
        omega = 2 * math.pi * d.base_hz
        emf_v = np.mean(p.motor.psi_vs) * p.motor.emf_fundamental * omega
        amplitude_a = d.power_w / (1.5 * emf_v)
        ohm = np.mean(p.motor.resistance_ohm) + p.inverter.on_resistance_ohm
        assert ohm * amplitude_a / emf_v == pytest.approx(d.resistance_pu, rel=0.1)
        assert omega * p.motor.mean_inductance_h * amplitude_a / emf_v == pytest.approx(d.inductance_pu, rel=0.1)
        torque_nm = d.power_w * d.pole_pairs / omega
        assert p.motor.inertia_kgm2 * omega / d.pole_pairs / torque_nm == pytest.approx(d.run_up_s, rel=0.001)
        assert p.carrier_hz >= 6 * d.base_hz * ranges().carriers_per_sector_min - 1
        torques = [p.full_factor * p.load.torque_nm(share * p.base_rpm) for share in (0.01, 0.2, 0.6, 1.0)]
        assert min(torques) > 0
        assert max(torques) <= 1.001 * torque_nm


def test_same_number_same_machine() -> None:
    """A machine follows from seed and index alone.

    Verifies: POP-01
    """
    assert Draw.of(1, 7) == DRAWS[7]
    assert Draw.of(2, 7) != DRAWS[7]


@pytest.mark.parametrize("method", METHODS)
def test_files_say_the_same(method: Method, tmp_path: Path) -> None:
    """The written files load as the scenario that the population runs.

    Verifies: POP-01
    """
    for salient in (False, True):
        life = next(life_of(d, method) for d in DRAWS if (d.saliency > 1.0) == salient and d.emf == "trapezoidal")
        assert load_scenario(write_life(life, tmp_path)).model_dump() == life.scenario.model_dump()


def test_told_machine_has_the_file_errors() -> None:
    """The user's file says what the firmware is told.

    Verifies: POP-01
    """
    s = life_of(DRAWS[1], "vector").scenario
    told = told_scenario(s)
    wrong, right = told_machine(s), told_machine(told)
    for name in ("resistance_ohm", "inductance_h", "psi_vs"):
        assert getattr(wrong, name) == pytest.approx(getattr(right, name)), name
    assert told.motor.inertia_kgm2 == pytest.approx(s.motor.inertia_kgm2 * s.drive.motor_error.inertia)
    assert len(set(told.motor.resistance_ohm)) == 1
