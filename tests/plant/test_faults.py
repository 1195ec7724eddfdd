# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Injected faults."""

from __future__ import annotations

import math

import pytest

from fluxlock.plant import Plant
from fluxlock.plant import layout as L
from tests.plant.drives import drive, motor_1

A_AND_C_HIGH, B_LOW = 0b010001, 0b001000


def steepest(phases: tuple[int, ...] | None) -> float:
    """Greatest phase current within 500 us after the fault, in a running drive."""
    plant = Plant(motor_1(), seed=1, mode="jit")
    drive(plant, 500)
    plant.configure_recording(1)
    begin = len(plant.records())
    if phases is not None:
        plant.inject_fault("shorted_winding", phases=phases, turns_fraction=0.05)
    drive(plant, 500)
    rows = plant.records()[begin:]
    return float(max(abs(rows[name]).max() for name in ("ia", "ib", "ic")))


def test_shorted_winding_is_an_over_current() -> None:
    """One winding: well above the healthy current; two: far above full scale.

    Verifies: PLANT-12
    """
    healthy, one, two = steepest(None), steepest((0,)), steepest((0, 1))
    print(f"healthy {healthy:.0f} A, one winding {one:.0f} A, two windings {two:.0f} A")
    assert healthy < 30.0  # of 50 A full scale
    assert one > 50.0
    assert two > 200.0


def test_shorted_winding_clears() -> None:
    """The winding is whole again after "clear"; currents are continuous through both changes.

    Verifies: PLANT-12
    """
    plant = Plant(motor_1(), seed=1, mode="jit")
    drive(plant, 500)
    matrix = plant.state[L.LM : L.LM + 9].copy()
    for kind in ("shorted_winding", "clear"):
        before = plant.currents_a
        plant.inject_fault(kind, phases=(0, 1))
        assert (plant.currents_a == before).all()
    assert (plant.state[L.LM : L.LM + 9] == matrix).all()


@pytest.mark.parametrize("omega", [0.0, 2.4e-19, 1e-12, 1e-6])
@pytest.mark.parametrize("turns_fraction", [0.05, 0.2, 1.0])
def test_two_legs_at_one_rail_beside_a_rotor_that_hardly_turns(turns_fraction: float, omega: float) -> None:
    """Equal voltages at two legs drive no current, a rounding of them at most; a third leg then drives one.

    Verifies: PLANT-12
    """
    plant = Plant(motor_1(), seed=1, mode="jit")
    plant.inject_fault("shorted_winding", phases=(0, 1), turns_fraction=turns_fraction)
    plant.state[L.OMEGA] = omega
    for cycle in range(10, 10_000, 50):
        plant.step(cycle, A_AND_C_HIGH)
    assert abs(plant.currents_a).max() < 1e-6
    plant.step(10_000, A_AND_C_HIGH | B_LOW)
    plant.step(10_050, A_AND_C_HIGH)
    assert abs(plant.currents_a).max() > 0.1


def test_supply_dip() -> None:
    """The link follows the supply with its time constant, and back.

    Verifies: PLANT-12
    """
    plant = Plant(motor_1(inverter__dc_link_c_f=1e-3, mechanics__omega_m_rad_s=0.0), seed=1, mode="jit")
    plant.inject_fault("supply", supply_v=12.0)
    plant.advance(1000)
    assert plant.state[L.VDC] == pytest.approx(12.0 + 13.0 * math.exp(-1.0), rel=1e-3)
    plant.inject_fault("supply", supply_v=25.0)
    plant.advance(20_000)
    assert plant.state[L.VDC] == pytest.approx(25.0, rel=1e-6)


def test_supply_diode_and_chopper() -> None:
    """With a diode regenerated energy stays in the link, until the chopper takes it.

    Verifies: PLANT-02, PLANT-12
    """
    link = {
        "inverter__dc_link_c_f": 20e-6,
        "inverter__supply_diode": True,
        "mechanics__omega_m_rad_s": 20_000.0,
    }
    plant = Plant(motor_1(**link), seed=1, mode="jit")
    plant.advance(100_000)
    assert plant.state[L.VDC] > 32.0
    chopper = {"inverter__chopper_on_v": 28.0, "inverter__chopper_off_v": 26.0, "inverter__chopper_ohm": 0.5}
    plant = Plant(motor_1(**link, **chopper), seed=1, mode="jit")
    plant.configure_recording(1)
    for k in range(1, 2001):
        plant.sample(50 * k)
    vdc = plant.records()["vdc"]
    assert 27.9 < vdc.max() <= 28.0 + 1e-6
    assert (vdc[:-1] > vdc[1:]).any() and (vdc[:-1] < vdc[1:]).any()


@pytest.mark.parametrize("mode", ["py", "jit"])
def test_driven_chopper(mode: str) -> None:
    """It is on when its switch is, whatever the link: the capacitor follows the divider of both resistors.

    Verifies: PLANT-24
    """
    link = {"inverter__dc_link_c_f": 20e-6, "inverter__supply_r_ohm": 2.0}
    plant = Plant(motor_1(**link, inverter__chopper_driven=True, inverter__chopper_ohm=3.0), seed=1, mode=mode)
    plant.advance(1000)
    assert plant.state[L.VDC] == pytest.approx(25.0, rel=1e-12)
    plant.set_brake(True)
    tau_s = 20e-6 * 2.0 * 3.0 / 5.0
    plant.advance(1500)
    plant.set_gates(0)
    plant.sample(2000)
    reached = 15.0 + 10.0 * math.exp(-20e-6 / tau_s)
    assert plant.state[L.VDC] == pytest.approx(reached, rel=1e-6)
    plant.set_brake(False)
    plant.advance(3000)
    assert plant.state[L.VDC] == pytest.approx(25.0 - (25.0 - reached) * math.exp(-20e-6 / 40e-6), rel=1e-6)


def test_fault_pin() -> None:
    """The pin shows at once, stays through events, and clears.

    Verifies: PLANT-12
    """
    plant = Plant(motor_1(), seed=1, mode="py")
    plant.advance(10)
    assert plant.io[L.IO_PINS] == 0
    plant.inject_fault("fault_pin")
    assert plant.io[L.IO_PINS] == 1
    plant.advance(20)
    assert plant.io[L.IO_PINS] == 1
    plant.inject_fault("fault_pin", level=False)
    plant.advance(30)
    assert plant.io[L.IO_PINS] == 0


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"kind": "lightning"}, "kind"),
        ({"kind": "shorted_winding", "turns_fraction": 0.0}, "turns_fraction"),
        ({"kind": "shorted_winding", "phases": (3,)}, "phases"),
        ({"kind": "stuck_channel", "channel": "vd"}, "channel"),
        ({"kind": "stuck_channel", "channel": "va", "code": 4096}, "code"),
        ({"kind": "supply", "supply_v": -1.0}, "supply_v"),
    ],
)
def test_wrong_arguments(arguments: dict[str, object], message: str) -> None:
    """Wrong arguments are named, with the permitted range.

    Verifies: PLANT-13
    """
    with pytest.raises(ValueError, match=rf"{message} = .* must be"):
        Plant(motor_1(), seed=1, mode="py").inject_fault(**arguments)  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("key", "value"),
    [
        ("machine__pole_pairs", 0),
        ("machine__r_ohm", (0.1, -0.1, 0.1)),
        ("machine__m_h", (22e-6, 22e-6, 22e-6)),
        ("machine__phases", 5),
        ("inverter__supply_v", math.nan),
        ("inverter__supply_diode", True),
        ("inverter__chopper_ohm", 1.0),
        ("sensing__bits", 2),
        ("sensing__offset_lsb", (0.0,)),
        ("mechanics__inertia_kgm2", 0.0),
        ("mechanics__mode", "flying"),
        ("mechanics__profile", ((1.0, 0.0), (0.5, 0.0))),
        ("recording__wave_rows", 0),
    ],
)
def test_wrong_parameters(key: str, value: object) -> None:
    """Parameters are checked when they are made.

    Verifies: PLANT-13
    """
    with pytest.raises(ValueError, match="must be"):
        motor_1(**{key: value})


def test_stuck_rotor_and_noise_clear() -> None:
    """The rotor stands at once and turns again after "clear"; so ends the noise.

    Verifies: PLANT-12
    """
    plant = Plant(motor_1(), seed=1, mode="jit")
    drive(plant, 500)
    noise = plant.state[L.NOISE_LSB]
    mode = plant.state[L.MECHANICS]
    plant.inject_fault("stuck_rotor")
    plant.inject_fault("noisy_channels", noise_lsb=40.0)
    drive(plant, 100)
    assert plant.speed_rpm == 0.0 and plant.state[L.NOISE_LSB] == 40.0
    plant.inject_fault("clear")
    assert plant.state[L.NOISE_LSB] == noise and plant.state[L.MECHANICS] == mode
