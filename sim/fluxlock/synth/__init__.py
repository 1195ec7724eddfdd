# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Synthesis: `python -m fluxlock.synth [NAME...]` takes configurations and blocks through Yosys and nextpnr."""
