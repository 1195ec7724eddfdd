"""Coverage of RTL, C and Python by the tests, in one report."""
