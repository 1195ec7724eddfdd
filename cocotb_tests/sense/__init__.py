"""Block tests of the sample scheduler and of sensing."""
