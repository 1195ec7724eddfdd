"""Block tests of zero-crossing detection and commutation timer."""
