"""All tests, of `tests` and of `cocotb_tests`: processor time of each, and the longest files first."""

pytest_plugins = ["tests.times"]
