"""The pure algorithms of the firmware against independent models in floating point or exact arithmetic."""

from __future__ import annotations

import ctypes
import math
import zlib
from random import Random

import pytest

from fluxlock.firmware import gain
from fluxlock.firmware.toolchain import build_host_library

PRODUCT_MAX = 2**29 - 1


class Gain(ctypes.Structure):
    """gain_t."""

    _fields_ = [("mant", ctypes.c_int32), ("shift", ctypes.c_int32)]


class PiGains(ctypes.Structure):
    """pi_gains_t."""

    _fields_ = [("kp", Gain), ("ki", Gain)]


class PiState(ctypes.Structure):
    """pi_state_t."""

    _fields_ = [("integral_q5", ctypes.c_int32)]


class PiResult(ctypes.Structure):
    """pi_result_t."""

    _fields_ = [("output", ctypes.c_int32), ("unlimited", ctypes.c_int32)]


class Ramp(ctypes.Structure):
    """ramp_t."""

    _fields_ = [("value_rpm_q8", ctypes.c_int32), ("carry_q12", ctypes.c_uint32)]


class Limiter(ctypes.Structure):
    """limiter_t."""

    _fields_ = [("trim_v_q25", ctypes.c_int32)]


class Linearity(ctypes.Structure):
    """csc_linearity_t."""

    _fields_ = [("first_q16", ctypes.c_uint32), ("second_q16", ctypes.c_uint32), ("rest_q16", ctypes.c_uint32)]


class Balance(ctypes.Structure):
    """balance_t."""

    _fields_ = [("vertical_q25", ctypes.c_int32 * 3), ("horizontal_q25", ctypes.c_int32 * 3)]


class Catch(ctypes.Structure):
    """catch_t."""

    _fields_ = [
        ("angle", ctypes.c_uint32),
        ("step", ctypes.c_int32),
        ("travel", ctypes.c_int32),
        ("agreeing", ctypes.c_uint32),
        ("seen", ctypes.c_uint32),
    ]


class Handover(ctypes.Structure):
    """handover_t."""

    _fields_ = [
        ("crossings", ctypes.c_uint16),
        ("late", ctypes.c_uint8),
        ("clean", ctypes.c_uint16),
        ("plausible", ctypes.c_uint16),
    ]


@pytest.fixture(scope="module")
def lib() -> ctypes.CDLL:
    """The host library with the prototypes of the pure functions."""
    library = ctypes.CDLL(str(build_host_library()))
    i32, u32, u64 = ctypes.c_int32, ctypes.c_uint32, ctypes.c_uint64
    for name, result, arguments in (
        ("gain_apply", i32, [i32, Gain]),
        ("mul_q16", i32, [i32, i32]),
        ("div_sat_u32", u32, [u64, u32]),
        ("div_u64", u64, [u64, u32]),
        ("sqrt_u32", u32, [u32]),
        ("crc32", u32, [ctypes.c_char_p, ctypes.c_size_t]),
        ("pi_step", PiResult, [ctypes.c_void_p, ctypes.c_void_p, i32, i32, i32, i32]),
        ("pi_preset", None, [ctypes.c_void_p, Gain, i32, i32, i32]),
        ("ramp_step", i32, [ctypes.c_void_p, i32, i32, i32, i32]),
        ("ramp_preset", None, [ctypes.c_void_p, i32]),
        ("speed_numerator_q8", u64, [u32, u32]),
        ("speed_from_period_rpm_q8", i32, [u64, u32]),
        ("limiter_bound", i32, [ctypes.c_void_p, ctypes.c_void_p, i32, i32, i32]),
        ("limiter_update", None, [ctypes.c_void_p, ctypes.c_void_p, i32, i32, ctypes.c_bool]),
        ("duty_from_voltage_q30", i32, [i32, i32, i32]),
        ("voltage_from_duty_v_q25", i32, [i32, i32, i32]),
        ("carrier_period_cycles", u32, [i32, u32, u32, u32]),
        ("pulse_cycles_q8", u32, [i32, u32, u32]),
        ("line_current_ratio_q16", i32, [i32, i32, i32, i32, i32]),
        ("line_current", i32, [i32, i32]),
        ("line_current_limit_q25", i32, [i32, i32]),
        ("torque_reference", i32, [i32, Gain, i32, i32, i32, i32, i32]),
        ("csc_linearity", Linearity, [u32, u32, u32]),
        ("csc_linear_duty_q30", i32, [ctypes.c_void_p, i32]),
        ("balance_errors", None, [ctypes.c_void_p, ctypes.c_bool, ctypes.c_void_p]),
        ("balance_step", None, [ctypes.c_void_p, ctypes.c_int, ctypes.c_void_p, Gain, i32]),
        ("balance_threshold_q17", i32, [ctypes.c_void_p, u32, i32]),
        ("advance_added_q16", i32, [i32, i32, i32, i32]),
        ("advance_total_q16", i32, [i32, i32]),
        ("vector_angle", u32, [i32, i32]),
        ("catch_step", ctypes.c_bool, [ctypes.c_void_p, ctypes.c_void_p, ctypes.c_void_p]),
        ("catch_restore", i32, [ctypes.c_void_p, i32, ctypes.c_void_p]),
        ("catch_sector", u32, [u32, ctypes.c_bool]),
        ("stuck_reset", None, [ctypes.c_void_p]),
        ("stuck_step", ctypes.c_bool, [ctypes.c_void_p, ctypes.c_void_p, ctypes.c_bool, u32]),
        ("catch_sector_cycles", u32, [i32, u32]),
        ("brake_current", i32, [i32, i32, i32, i32, Gain]),
        ("start_sector", u32, [u32, ctypes.c_bool]),
        ("forced_interval_cycles", u32, [u32, u32]),
        ("handover_reset", None, [ctypes.c_void_p, ctypes.c_uint16, ctypes.c_uint8]),
        ("handover_step", None, [ctypes.c_void_p, ctypes.c_uint16, ctypes.c_uint8, u32, u32, u32]),
    ):
        function = getattr(library, name)
        function.restype, function.argtypes = result, arguments
    return library


def some_ints(rng: Random, bits: int, count: int) -> list[int]:
    """Integers of all magnitudes below 2^bits, with the corners."""
    corners = [0, 1, 2, 3, 2**bits - 1, 2 ** (bits - 1), 2 ** (bits // 2), 2 ** (bits // 2) - 1]
    return corners + [rng.getrandbits(rng.randint(1, bits)) for _ in range(count)]


def test_division_and_root_are_exact(lib: ctypes.CDLL) -> None:
    """Division saturates and is exact, also where a trial digit has to be corrected; the root is the floor.

    Verifies: FW-02
    """
    rng = Random(1)
    for n in some_ints(rng, 64, 150):
        assert lib.sqrt_u32(n >> 32) == math.isqrt(n >> 32), n
        for d in some_ints(rng, 32, 20):
            wanted = 2**32 - 1 if d == 0 else min(n // d, 2**32 - 1)
            assert lib.div_sat_u32(n, d) == wanted, (n, d)
            if d:
                assert lib.div_u64(n, d) == n // d, (n, d)


def test_gain_rounds_and_saturates(lib: ctypes.CDLL) -> None:
    """X * mant / 2^shift rounded half up and limited, over all shifts.

    Verifies: FW-02
    """
    rng = Random(2)
    for shift in range(4, 63):
        for _ in range(60):
            x = rng.choice([-1, 1]) * rng.choice(some_ints(rng, 31, 4))
            mant = rng.choice([-1, 1]) * rng.choice(some_ints(rng, 31, 4))
            exact = (x * mant + (1 << (shift - 1))) >> shift
            wanted = max(-PRODUCT_MAX, min(PRODUCT_MAX, exact))
            assert lib.gain_apply(x, Gain(mant, shift)) == wanted, (x, mant, shift)
    for value in (1e-6, 0.37, 1.0, 4000.0):
        mant, shift = gain(value)
        assert mant * 2.0**-shift == pytest.approx(value, rel=2**-29)
        assert lib.gain_apply(1000, Gain(mant, shift)) == pytest.approx(1000 * value, abs=0.51)


def test_crc_is_the_ieee_one(lib: ctypes.CDLL) -> None:
    """Same checksums as zlib.

    Verifies: FW-03
    """
    rng = Random(3)
    assert lib.crc32(b"123456789", 9) == 0xCBF43926
    for length in (0, 1, 3, 64, 500):
        data = rng.randbytes(length)
        assert lib.crc32(data, length) == zlib.crc32(data)


def test_pi_follows_its_float_model(lib: ctypes.CDLL) -> None:
    """Random errors and moving limits: output within 4 units of a float PI with the same back-calculation.

    Verifies: FW-04
    """
    rng = Random(4)
    kp, ki = 37.2, 5.3 * 32
    gains = PiGains(Gain(*gain(kp)), Gain(*gain(ki)))
    state, integral, error = PiState(0), 0.0, 0
    for k in range(4000):
        error = rng.randint(-20000, 20000) if k % 50 == 0 else error + rng.randint(-200, 200)
        feed_forward = 2_000_000 + 1000 * (k % 300)
        high = 2_500_000 if (k // 500) % 2 else 30_000_000
        result = lib.pi_step(ctypes.byref(state), ctypes.byref(gains), error, feed_forward, 100_000, high)
        u = feed_forward + kp * error + integral
        out = min(max(u, 100_000), high)
        integral += ki / 32 * error + (out - u) / 8
        assert abs(result.output - out) < 4 + 1e-5 * abs(out), k
        assert (result.output < result.unlimited) == (out < u) or abs(out - u) < 4


def test_pi_leaves_a_limit_without_windup(lib: ctypes.CDLL) -> None:
    """After a second at the limit the output leaves it within 40 steps of the sign change of the error.

    Verifies: FW-04
    """
    gains = PiGains(Gain(*gain(10.0)), Gain(*gain(2.0 * 32)))
    state = PiState(0)
    for _ in range(10_000):
        result = lib.pi_step(ctypes.byref(state), ctypes.byref(gains), 50_000, 0, 0, 1_000_000)
    assert result.output == 1_000_000
    steps = 0
    while result.output == 1_000_000:
        result = lib.pi_step(ctypes.byref(state), ctypes.byref(gains), -2_000, 0, 0, 1_000_000)
        steps += 1
        assert steps < 40
    lib.pi_preset(ctypes.byref(state), gains.kp, 1234, 5678, 400_000)
    assert lib.pi_step(ctypes.byref(state), ctypes.byref(gains), 1234, 5678, 0, 10**8).output == pytest.approx(
        400_000, abs=1
    )


def test_ramp_slope_window_and_fractions(lib: ctypes.CDLL) -> None:
    """Slopes far below 1/256 r/min a step are kept exactly; the window holds the reference; both directions alike.

    Verifies: FW-05
    """
    for sign in (1, -1):
        ramp = Ramp()
        lib.ramp_preset(ctypes.byref(ramp), sign * 256_000)
        target, step = sign * 2_560_000, 1_301
        for k in range(1, 50_000):
            assert lib.ramp_step(ctypes.byref(ramp), target, step, target, 10**6) == sign
            assert abs(sign * ramp.value_rpm_q8 - (256_000 + k * step / 4096)) <= 1
        lib.ramp_preset(ctypes.byref(ramp), 0)
        for _ in range(1000):
            lib.ramp_step(ctypes.byref(ramp), sign * 100_000, 2**31 - 1, 0, 5_000)
        assert ramp.value_rpm_q8 == sign * 5_000
        assert lib.ramp_step(ctypes.byref(ramp), sign * 100_000, 4096, sign * -9_000, 5_000) == sign
        assert ramp.value_rpm_q8 == sign * 5_000
        for _ in range(1000):
            lib.ramp_step(ctypes.byref(ramp), sign * 5_100, 4096, sign * 5_000, 5_000)
        assert ramp.value_rpm_q8 == sign * 5_100
        assert lib.ramp_step(ctypes.byref(ramp), sign * 5_100, 4096, 0, 5_000) == 0


def test_speed_from_period(lib: ctypes.CDLL) -> None:
    """r/min of a period to 1/256 r/min, for pole pairs and clocks.

    Verifies: FW-06
    """
    for clock, pole_pairs in ((50_000_000, 1), (50_000_000, 7), (100_000_000, 4)):
        numerator = lib.speed_numerator_q8(clock, pole_pairs)
        for period in (1, 600, 50_000, 51_237, 7_000_001, 2**27 - 1):
            wanted = 60 * clock / (pole_pairs * period) * 256
            got = lib.speed_from_period_rpm_q8(numerator, period)
            assert got == (2**31 - 1 if wanted > 2**31 - 1 else pytest.approx(wanted, abs=1.01)), (
                clock,
                period,
            )
    assert lib.speed_from_period_rpm_q8(numerator, 0) == 2**31 - 1


def test_duty_and_voltage_are_inverse(lib: ctypes.CDLL) -> None:
    """Duty of a voltage with and without a diode drop; voltage_from_duty inverts it; limits at 0 and 1.

    Verifies: FW-07
    """
    rng = Random(5)
    for _ in range(2000):
        vdc = rng.randint(2**20, 2**25)
        diode = rng.choice([0, rng.randint(0, 2**20)])
        u = rng.randint(-(2**21), vdc + 2**20)
        duty = lib.duty_from_voltage_q30(u, vdc, diode) / 2**30
        wanted = min(1.0, max(0.0, (u + diode) / (vdc + diode)))
        assert duty == pytest.approx(wanted, abs=2**-21 + 256 / vdc), (u, vdc, diode)
        if 0.0 < wanted < 1.0:
            back = lib.voltage_from_duty_v_q25(round(wanted * 2**30), vdc, diode)
            assert back == pytest.approx(u, abs=2)
    assert lib.duty_from_voltage_q30(1000, 0, 0) == 0


def test_carrier_period_and_pulse(lib: ctypes.CDLL) -> None:
    """The carrier is stretched just so far that the pulse keeps its floor, within its limits; the dead time is added.

    Verifies: FW-08
    """
    for duty in (0.0, 0.01, 0.03, 0.05, 0.1, 0.2239, 0.2241, 0.5, 1.0):
        period = lib.carrier_period_cycles(round(duty * 2**30), 1250, 6250, 280)
        wanted = 6250 if duty == 0 else min(6250, max(1250, 280 / duty))
        assert period == pytest.approx(wanted, abs=1.01), duty
        pulse = lib.pulse_cycles_q8(round(duty * 2**30), period, 10) / 256
        assert pulse == pytest.approx(0 if duty == 0 else duty * period + 10, abs=0.005)


def test_start_sector_pulls_by_90_degrees(lib: ctypes.CDLL) -> None:
    """The field of the start sector leads the aligned rotor by 90 degrees in the direction of rotation.

    Verifies: FW-09
    """
    high, low = (0, 0, 1, 1, 2, 2), (1, 2, 2, 0, 0, 1)
    for leg in range(3):
        for reverse in (False, True):
            sector = lib.start_sector(leg, reverse)
            field = sum(s * complex(math.cos(a), math.sin(a)) for s, a in (
                (1, 2 * math.pi / 3 * high[sector]), (-1, 2 * math.pi / 3 * low[sector])))  # fmt: skip
            ahead = math.degrees(math.atan2(field.imag, field.real)) - 120 * leg
            assert (ahead - (-90 if reverse else 90) + 180) % 360 - 180 == pytest.approx(0, abs=1e-9)


def test_forced_intervals_accelerate_evenly(lib: ctypes.CDLL) -> None:
    """The sum of the intervals is the time that a constant acceleration needs: to 5e-4 of it.

    Verifies: FW-09
    """
    first = 500_000
    total = first
    for n in range(400):
        total += lib.forced_interval_cycles(first, n)
        wanted = first * math.sqrt(2 * n + 3)
        assert total == pytest.approx(wanted, rel=5e-4), n


def test_limiter_bounds_by_model_and_trim(lib: ctypes.CDLL) -> None:
    """Bound = EMF + R*I + kp*margin; the trim moves only while it binds, within half of R*I, and decays after.

    Verifies: FW-10
    """
    gains = PiGains(Gain(*gain(20.0)), Gain(*gain(2.0)))
    limiter = Limiter(0)
    bound = lib.limiter_bound(ctypes.byref(limiter), ctypes.byref(gains), 10_000_000, 400_000, -500)
    assert bound == pytest.approx(10_000_000 + 400_000 - 20 * 500, abs=2)
    for _ in range(1000):
        lib.limiter_update(ctypes.byref(limiter), ctypes.byref(gains), 400_000, -500, True)
    assert limiter.trim_v_q25 == -200_000
    for _ in range(1000):
        lib.limiter_update(ctypes.byref(limiter), ctypes.byref(gains), 400_000, -500, False)
    assert abs(limiter.trim_v_q25) < 64


def test_handover_counts_plausible_crossings(lib: ctypes.CDLL) -> None:
    """Late crossings are plausible but not clean; a wrong interval starts both counts anew; counters wrap.

    Verifies: FW-11
    """
    h = Handover()
    lib.handover_reset(ctypes.byref(h), 65_534, 255)
    count, late = 65_534, 255

    def step(fresh: int, more_late: int, interval: int) -> tuple[int, int]:
        nonlocal count, late
        count, late = (count + fresh) & 0xFFFF, (late + more_late) & 0xFF
        lib.handover_step(ctypes.byref(h), count, late, interval, 100_000, 16_384)
        return h.clean, h.plausible

    assert step(1, 0, 100_000) == (1, 1)
    assert step(2, 0, 124_999) == (3, 3)
    assert step(0, 0, 500_000) == (3, 3)
    assert step(1, 1, 100_000) == (0, 4)
    assert step(1, 0, 75_001) == (1, 5)
    assert step(1, 0, 74_000) == (0, 0)
    assert step(1, 0, 126_000) == (0, 0)


def test_line_current_balances_the_power(lib: ctypes.CDLL) -> None:
    """The current whose power behind the link is what the link gives, with R and diode; bounded near standstill.

    Verifies: FW-25
    """
    rng = Random(6)
    volt, ampere = 2**25 / 30.0, 2**25 / 50.0
    for _ in range(2000):
        vdc, emf, r = rng.uniform(10, 28), rng.uniform(1.0, 12.0), rng.uniform(0.01, 0.2)
        current, duty = rng.uniform(-20, 20), rng.uniform(0.1, 0.95)
        if emf + r * current < 1.0:
            continue
        diode = rng.choice([0.0, 0.7])
        idc = current * (emf + r * current + (1 - duty) * diode) / vdc
        ratio = lib.line_current_ratio_q16(
            round(vdc * volt), round(emf * volt), round(r * current * volt), round(diode * volt), round(duty * 2**30)
        )
        assert lib.line_current(round(idc * ampere), ratio) / ampere == pytest.approx(current, rel=1e-3, abs=1e-3)
        wanted = min(50.0, 7.0 * ratio / 65536)
        assert lib.line_current_limit_q25(round(7.0 / 50 * 2**17), ratio) / ampere == pytest.approx(wanted, rel=1e-3)
    assert lib.line_current_ratio_q16(round(25 * volt), 0, 0, 0, 2**20) == 32 << 16
    assert lib.line_current_ratio_q16(round(25 * volt), -1000, 0, 0, 2**20) == 32 << 16
    assert lib.line_current_ratio_q16(0, 1000, 0, 0, 2**20) == 0


def test_torque_reference_between_its_limits(lib: ctypes.CDLL) -> None:
    """Target inside; a falling line toward the upper speed, a rising one toward the lower; current limits last.

    Verifies: FW-26
    """
    kp = 3.0
    for target in (-50_000, 0, 4_000, 90_000):
        for speed in (0, 900, 1_000, 5_000, 9_000, 10_000, 12_000, 40_000):
            wanted = min(max(target, kp * (1_000 - speed)), kp * (10_000 - speed))
            wanted = min(max(wanted, -20_000), 25_000)
            got = lib.torque_reference(target, Gain(*gain(kp)), speed, 1_000, 10_000, -20_000, 25_000)
            assert got == pytest.approx(wanted, abs=1), (target, speed)


def linear_duty(lib: ctypes.CDLL, sector: int, period: int, mean: float, tolerance: int = 655) -> float:
    """Duty that the firmware makes of a wanted mean."""
    factors = lib.csc_linearity(sector, period, tolerance)
    return float(lib.csc_linear_duty_q30(ctypes.byref(factors), round(mean * 2**30))) / 2**30


def cut_mean(sector: int, period: int, duty: float) -> float:
    """Mean of a train of pulses that starts with the sector and is cut at its end."""
    return sum(min(duty * period, sector - start) for start in range(0, sector, period)) / sector


def test_csc_linearity_gives_the_wanted_mean(lib: ctypes.CDLL) -> None:
    """N 0.8 to 8, M 0.02 to 1: the mean of the cut train is the wanted one within 1e-3, also at and about integers.

    Verifies: FW-27
    """
    period = 1250
    sectors = [round(period * (0.8 + 0.01 * k)) for k in range(721)]
    sectors += [n * period + d for n in range(1, 9) for d in (-2, -1, 0, 1, 2)]
    for sector in sectors:
        last = -1.0
        for mean in [0.02 * k for k in range(1, 51)]:
            duty = linear_duty(lib, sector, period, mean, 0)
            assert 0.0 <= duty <= 1.0
            assert duty >= last
            last = duty
            error = cut_mean(sector, period, duty) - mean
            assert abs(error) < 1e-3, (sector / period, mean)
    # Without the correction it is far off.
    assert max(abs(cut_mean(s, period, m) - m) for s in sectors[:100] for m in (0.2, 0.5, 0.8)) > 0.15


def test_csc_linearity_tolerates_jitter_about_integers(lib: ctypes.CDLL) -> None:
    """Within the tolerance below an integer the duty is the mean; it is continuous there within 1 %.

    Verifies: FW-27
    """
    for n in range(1, 9):
        for mean in (0.02, 0.3, 0.7, 0.99):
            at = linear_duty(lib, n * 1250, 1250, mean)
            assert at == pytest.approx(mean, abs=1e-4)
            assert linear_duty(lib, n * 1250 - 12, 1250, mean) == pytest.approx(mean, abs=1e-4)
            assert linear_duty(lib, n * 1250 + 12, 1250, mean) == pytest.approx(mean, abs=0.011)
            assert linear_duty(lib, n * 1250 - 14, 1250, mean) == pytest.approx(mean, abs=0.013)
    # Very many carriers, and an interval that is not measured yet: nothing to correct.
    assert linear_duty(lib, 0xFFFFFF, 1250, 0.37) == pytest.approx(0.37, abs=1e-6)


def carried_mean(sector: int, period: int, duty: float, min_pulse: int, sectors: int = 400) -> float:
    """Mean with whole clocks, the minimum-pulse rule and the carrier's account of volt-seconds, as fl_carrier states.

    A carrier of n clocks owes min(duty, n); what a pulse gave more or less goes into the next one.
    """
    carry, on = 0.0, 0
    for _ in range(sectors):
        for start in range(0, sector, period):
            n = min(period, sector - start)
            want = duty * period + carry
            width = 0 if want < min_pulse else min(int(want), n)
            if n - width < min_pulse:
                width = n
            # The commutation would cut the pulse too short: it is not started.
            width = 0 if n < min_pulse else width
            carry += min(duty * period, n) - width
            carry = max(-period, min(period, carry))
            on += width
    return on / (sectors * sector)


def test_csc_linearity_with_minimum_pulses(lib: ctypes.CDLL) -> None:
    """Vanishing pulses and gaps return through the carrier's account: the mean holds within 0.4 %.

    Verifies: FW-27
    """
    rng = Random(7)
    for _ in range(1500):
        sector, mean = rng.randint(1000, 10_000), rng.uniform(0.02, 0.98)
        duty = linear_duty(lib, sector, 1250, mean)
        got = carried_mean(sector, 1250, duty, 20)
        tolerance = 0.004 if (sector + 12) % 1250 > 12 else 0.015
        assert got == pytest.approx(mean, abs=tolerance), (sector / 1250, mean, duty)


def crossing_lag_rad(threshold: float, divider: float, asymmetry: float, emf: float, rises: bool) -> float:
    """How late a crossing comes: v = K (1/2 + 3/2 psi w sin + dv) in fractions of vdc meets the threshold."""
    level = (threshold / divider - 0.5 - asymmetry) / (1.5 * emf)
    return math.asin(level) if rises else -math.asin(level)


@pytest.mark.parametrize("backward", [False, True])
@pytest.mark.parametrize("mode", [1, 2])
def test_balance_evens_out_the_crossings(lib: ctypes.CDLL, mode: int, backward: bool) -> None:
    """Divider gains 1.10, 1.00, 0.90 end at thresholds of 0.550, 0.500, 0.450; inductances are seen in `both` only.

    Verifies: FW-28
    """
    turn, emf, bandwidth = 150_000, 0.1775, 280.0  # psi w over vdc: Motor-II at 20 000 r/min, 15 V
    dividers, inductances = (1.10, 1.00, 0.90), (27.5, 27.2, 28.6)
    high, low, opened = (0, 0, 1, 1, 2, 2), (1, 2, 2, 0, 0, 1), (2, 1, 0, 2, 1, 0)
    dv = [-0.5 * (1 - math.sqrt(3) * emf) * (inductances[h] - inductances[k]) / (inductances[h] + inductances[k])
          for h, k in zip(high, low, strict=True)]  # fmt: skip
    if mode == 1:
        dv = [0.0] * 6
    step = Gain(*gain(bandwidth * 2 * math.pi / 50e6 * 1.5 * emf * 2**25 / 6))
    balance = Balance()
    intervals, errors = (ctypes.c_uint32 * 6)(), (ctypes.c_int32 * 6)()
    history = []
    for _ in range(100):
        thresholds = [lib.balance_threshold_q17(ctypes.byref(balance), s, 65536) / 2**17 for s in range(6)]
        lag = [
            crossing_lag_rad(thresholds[s], dividers[opened[s]], dv[s], emf, (s % 2 == 1) != backward) for s in range(6)
        ]
        for s in range(6):
            before = lag[(s + 1) % 6] if backward else lag[s - 1]
            intervals[s] = round(turn / 6 + (lag[s] - before) / (2 * math.pi) * turn)
        history.append(max(abs(6 * t / turn - 1) * 60 for t in intervals))
        lib.balance_errors(intervals, backward, errors)
        lib.balance_step(ctypes.byref(balance), mode, errors, step, round(0.15 * 2**25))
    assert history[0] > 10.0
    assert history[-1] < 0.05
    # First order: w T_turn of the rest in a turn.
    assert history[5] < history[0] * (1 - bandwidth * turn / 50e6) ** 5 * 2.0 + 0.1
    for s in range(6):
        assert thresholds[s] == pytest.approx(dividers[opened[s]] * (0.5 + dv[s]), abs=1.5e-3), s
    # What is excluded returns to zero.
    lib.balance_step(ctypes.byref(balance), 0, errors, step, round(0.15 * 2**25))
    assert [lib.balance_threshold_q17(ctypes.byref(balance), s, 60000 + s) for s in range(6)] == [
        60000 + s for s in range(6)
    ]


def test_balance_is_limited_and_blind_to_a_common_lag(lib: ctypes.CDLL) -> None:
    """A lag in all sectors changes nothing; an absurd one is limited.

    Verifies: FW-28
    """
    balance, errors = Balance(), (ctypes.c_int32 * 6)()
    lib.balance_errors((ctypes.c_uint32 * 6)(*[20_000] * 6), False, errors)
    assert list(errors) == [0] * 6
    lib.balance_errors((ctypes.c_uint32 * 6)(30_000, 10_000, 30_000, 10_000, 30_000, 10_000), False, errors)
    for _ in range(1000):
        lib.balance_step(ctypes.byref(balance), 2, errors, Gain(*gain(5.0)), 1_000_000)
    assert all(abs(abs(v) - 1_000_000) < 2 for v in balance.vertical_q25)


def test_advance_is_linear_and_limited(lib: ctypes.CDLL) -> None:
    """Two products, rounded; the sum within 30 degrees.

    Verifies: FW-29
    """
    rng = Random(8)
    for _ in range(300):
        speed, current = rng.randint(-32768, 32767), rng.randint(-32768, 32767)
        a, b = rng.randint(0, 65536), rng.randint(0, 131072)
        added = lib.advance_added_q16(speed, a, current, b)
        assert added == pytest.approx(speed * a / 65536 + current * b / 65536, abs=1.01)
        base = rng.randint(-32768, 32767)
        assert lib.advance_total_q16(base, added) == max(-32767, min(32767, base + added))


def turn_difference_deg(a: int, b_deg: float) -> float:
    """Angle a (2^32 = one turn) less b in degrees, -180..180."""
    return (a / 2**32 * 360.0 - b_deg + 180.0) % 360.0 - 180.0


def test_vector_angle(lib: ctypes.CDLL) -> None:
    """All directions and lengths: within 0.1 degrees plus the resolution of the components.

    Verifies: FW-30
    """
    rng = Random(9)
    for _ in range(5000):
        length, angle = 2 ** rng.uniform(8, 18), rng.uniform(0, 360)
        x = round(length * math.cos(math.radians(angle)))
        y = round(length * math.sin(math.radians(angle)))
        exact = math.degrees(math.atan2(y, x))
        assert abs(turn_difference_deg(lib.vector_angle(x, y), exact)) < 0.1 + 5e-3
    for x, y, wanted in ((0, 0, 0), (5, 0, 0), (0, 5, 90), (-5, 0, 180), (0, -5, 270), (7, 7, 45)):
        assert abs(turn_difference_deg(lib.vector_angle(x, y), wanted)) < 0.01


class Stuck(ctypes.Structure):
    _fields_ = (("last_q17", ctypes.c_int32 * 3), ("same_ticks", ctypes.c_uint32 * 3), ("quiet_ticks", ctypes.c_uint32))


@pytest.mark.parametrize("channels", [(), (0,), (2,), (0, 1), (0, 1, 2)])
def test_stuck_channels(lib: ctypes.CDLL, channels: tuple[int, ...]) -> None:
    """One or two channels that never change are found after exactly the limit; none, or all of a dead rotor, are not.

    Verifies: FW-34
    """
    stuck, limit = Stuck(), 100
    lib.stuck_reset(ctypes.byref(stuck))
    found = []
    for tick in range(2 * limit):
        v = [5000 if x in channels else round(8000 * math.sin(0.3 * tick + 2.1 * x)) for x in range(3)]
        if tick < 5:
            v = [tick + x for x in range(3)]
        # The EMF may vanish for some ticks of a turn.
        found.append(lib.stuck_step(ctypes.byref(stuck), (ctypes.c_int32 * 3)(*v), tick % 21 != 0, limit))
    assert any(found) == (len(channels) in (1, 2))
    if any(found):
        assert found.index(True) == 5 + limit, "the first of equal values begins the count"
    rest = (ctypes.c_int32 * 3)(5000, 0, 0)
    lib.stuck_reset(ctypes.byref(stuck))
    assert not any(lib.stuck_step(ctypes.byref(stuck), rest, False, limit) for _ in range(4 * limit)), "no EMF"


def shown_voltages(theta: float, amplitude: float, diode: float, rng: Random) -> ctypes.Array[ctypes.c_int32]:
    """Terminal voltages of a coasting rotor as a converter that knows no negative ones shows them."""
    e = [-amplitude * math.sin(math.radians(theta - 120 * x)) for x in range(3)]
    lift = max(0.0, -min(e) - diode)
    return (ctypes.c_int32 * 3)(*(max(0, round(v + lift + rng.gauss(0, 20))) for v in e))


@pytest.mark.parametrize("degrees_a_tick", [3.0, -3.0, 17.3, -36.0, 56.4, 60.0, -60.0, 100.0, -118.0])
def test_catch_measures_and_chooses_the_sector(lib: ctypes.CDLL, degrees_a_tick: float) -> None:
    """Noisy terminal voltages: step within 1.6 degrees; the entered sector's crossing is 5 to 85 degrees ahead.

    Verifies: FW-30
    """
    rng = Random(10)
    for _ in range(60):
        rotor, mean = Catch(), ctypes.c_int32()
        theta, done = rng.uniform(0, 360), False
        amplitude, diode = rng.uniform(3_000, 40_000), rng.choice([0.0, 0.2, 0.38])
        sign = 1 if degrees_a_tick > 0 else -1
        for _ in range(40):
            theta += degrees_a_tick
            v, line = (ctypes.c_int32 * 3)(), amplitude * math.sqrt(3)
            shown = shown_voltages(theta, sign * amplitude, diode * amplitude, rng)
            spread = lib.catch_restore(shown, round(diode * amplitude), v)
            assert 0.7 * line < spread < 1.1 * line
            done = lib.catch_step(ctypes.byref(rotor), v, ctypes.byref(mean))
            if done:
                break
        assert done
        assert mean.value / 2**32 * 360 == pytest.approx(degrees_a_tick, abs=1.6)
        update = theta + degrees_a_tick
        sector = lib.catch_sector((rotor.angle + mean.value) % 2**32, degrees_a_tick < 0)
        # theta' = theta + 180; the crossing of sector index s at 60 + 60 s forward, 240 + 60 s backward.
        crossing = 60 + 60 * sector if sign > 0 else 240 + 60 * sector
        ahead = sign * (crossing - (update + 180)) % 360
        assert 5.0 < ahead < 85.0, (sector, update)
        cycles = lib.catch_sector_cycles(mean.value, 5000)
        assert cycles == pytest.approx(5000 * 60 / abs(degrees_a_tick), rel=0.6 if abs(degrees_a_tick) < 5 else 0.08)


def test_catch_refuses_what_does_not_turn_evenly(lib: ctypes.CDLL) -> None:
    """Noise, a stuck channel at speed, or more than a third of a turn a tick are not caught.

    Verifies: FW-30
    """
    rng = Random(11)
    for case in ("noise", "stuck", "fast"):
        rotor, mean, caught = Catch(), ctypes.c_int32(), 0
        for k in range(200):
            angle = math.radians(k * (30.0 if case == "stuck" else 130.0))
            v = [20_000 * math.sin(angle - 2 * math.pi / 3 * x) for x in range(3)]
            if case == "noise":
                v = [rng.gauss(0, 50) for _ in range(3)]
            elif case == "stuck":
                v[1] = 9_000.0
            caught += lib.catch_step(ctypes.byref(rotor), (ctypes.c_int32 * 3)(*map(round, v)), ctypes.byref(mean))
        assert caught == 0, case


def test_braking_current_falls_at_once_and_rises_slowly(lib: ctypes.CDLL) -> None:
    """Full far below the limit voltage, none at it, linear between; upward at most a 64th of the limit a step.

    Verifies: FW-31
    """
    share = Gain(*gain(65536 / 1_000_000))
    for vdc, wanted in ((10_000_000, 640_000), (19_500_000, 320_000), (20_000_000, 0), (25_000_000, 0)):
        assert lib.brake_current(640_000, 640_000, vdc, 20_000_000, share) == pytest.approx(wanted, abs=20)
    current, steps = 0, 0
    while current < 640_000:
        current = lib.brake_current(current, 640_000, 10_000_000, 20_000_000, share)
        steps += 1
    assert 62 <= steps <= 65
