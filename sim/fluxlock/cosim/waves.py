"""Save file beside an FST: the chip's signals in groups, for GTKWave (and Surfer, which reads it too)."""

from __future__ import annotations

from pathlib import Path

GROUPS: dict[str, tuple[str, ...]] = {
    "gates": ("gate_h_o[2:0]", "gate_l_o[2:0]", "gate_o[5:0]", "fault_pin_i"),
    "six-step": ("trc_sector_o[2:0]", "trc_comm_valid_o", "trc_comm_sched_o[31:0]", "trc_update_o"),
    "crossing": ("trc_zc_valid_o", "trc_zc_late_o", "trc_zc_sector_o[2:0]", "trc_zc_time_o[31:0]"),
    "sampling": ("adc_strobe_o", "adc_valid_i", "adc_code_i[107:0]"),
    "safety": ("trc_trip_o", "trc_trip_cause_o[6:0]"),
    "console": ("uart_rx_i", "uart_tx_o"),
    "time": ("clk_i", "rst_i", "trc_now_o[31:0]"),
}
WAVE_FILE = "waves.fst"
SAVE_FILE = "waves.gtkw"


def write_save_file(folder: Path, top: str = "TOP") -> Path:
    """Write `waves.gtkw` into the folder of `waves.fst` and return it."""
    lines = [f"[dumpfile] {WAVE_FILE!r}".replace("'", '"'), "[sst_expanded] 1"]
    for group, signals in GROUPS.items():
        lines += ["@200", f"-{group}", "@28"]
        lines += [f"{top}.{signal}" for signal in signals]
    path = folder / SAVE_FILE
    path.write_text("\n".join(lines) + "\n")
    return path
