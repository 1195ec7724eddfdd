"""Tests of the safety blocks."""
