"""Whole-chip tests: RTL, firmware on the soft core, and plant. They judge physics."""
