"""Firmware and parameter block through the loader into the SPI flash of a board."""
