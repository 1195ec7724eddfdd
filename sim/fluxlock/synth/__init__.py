"""Synthesis: `python -m fluxlock.synth [NAME...]` takes configurations and blocks through Yosys and nextpnr."""
