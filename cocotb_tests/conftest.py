"""Block tests run from the repository root; each starts a simulation of its own."""
