"""Tests of the PWM chain."""
