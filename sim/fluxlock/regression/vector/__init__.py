"""Vector cases (Yang 2020, chapter 7). Scenarios: scenarios/vector."""

__all__: list[str] = []
