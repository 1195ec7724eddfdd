"""Fault campaign: many faults at many moments of running drives, and how each run ends."""
