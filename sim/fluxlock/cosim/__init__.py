"""Joins Verilated RTL, firmware and plant. `block` runs block tests, `chip` builds the chip, `run` runs scenarios."""
