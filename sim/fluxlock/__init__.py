"""Fluxlock."""
