"""What the figures of vector control share. Runs of the chip are drawn beside the exact model by the same functions."""

from __future__ import annotations

from functools import cache

from fluxlock.analysis.plots import PHASE_COLOURS
from fluxlock.analysis.vector.controllers import Kind
from fluxlock.analysis.vector.model import SmoothMachine
from fluxlock.analysis.vector.study import Bench
from fluxlock.config import load_motor
from fluxlock.paths import ROOT

FAMILY = "blac"
MOTOR_1 = ROOT / "motors" / "motor-1.toml"
FS_HZ = 15e3
CURRENT_A = 10.0
CONTROLLER_COLOURS: dict[Kind, str] = dict(zip(("A", "B", "C"), PHASE_COLOURS, strict=True))
# Ends the condition of a figure without a run of the chip.
ANALYTIC = "Only the analytic curve: exact discrete model, no run of the chip."
THETA = "The thesis shows θ − θ̂, here θ̂ − θ"


@cache
def bench() -> Bench:
    """Motor-I at 15 kHz."""
    return Bench(SmoothMachine.from_motor(load_motor(MOTOR_1)), FS_HZ)


def percent(speed: float) -> str:
    """`f_e = 0.05 f_s (750 Hz)`."""
    return f"$f_e$ = {speed:g} $f_s$ ({speed * FS_HZ:g} Hz)"
