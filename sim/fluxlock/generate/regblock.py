# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Makes generated register blocks idle when nobody accesses them.

PeakRDL decodes the address, builds the read data and works out the next value of every field in every clock. Without a
request nobody looks at the first two, and a field that only software writes keeps its value: all three go under the
request. It asks for one address after the other, of which synthesis makes as long a chain: read data become one choice
among the addresses. It keeps all fields in one structure, which Verilator copies as a whole twice a clock: each field
becomes a variable of its own, which Verilator writes in place as long as no process reads it after writing it; hence
the reset at the end. The bus sees the same, and a simulation of the whole chip runs faster.
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
# A field whose only way to change is a write: next value in a process of its own, taken over in another.
FIELD = re.compile(
    r"(?P<i> +)always_comb begin\n"
    r"(?: +automatic [^\n]*\n){2} +next_c = (?P<store>[^\n]*);\n +load_next_c = '0;\n"
    r" +if\((?P<strobe>decoded_reg_strb\S+) && decoded_req_is_wr\) begin // SW write\n"
    r" +next_c = (?P<next>[^\n]*);\n +load_next_c = '1;\n +end\n"
    r"(?: +field_combo[^\n]*\n){2}(?P=i)end\n"
    r" +always_ff @\(posedge clk\) begin\n(?P<reset> +if\(rst\) begin\n[^\n]*\n)"
    r" +end else begin\n +if\(field_combo[^\n]*\n[^\n]*\n +end\n +end\n(?P=i)end\n"
)
READ_REGISTER = re.compile(r"^(?P<i> +)if\(rd_mux_addr == (?P<address>[^\n]*)\) begin$", re.MULTILINE)

STORAGE = re.compile(
    r" +typedef struct \{\n(?P<body>(?: {8}[^\n]*\n)*) +\} field_storage_t;\n +field_storage_t field_storage;\n"
)
ACCESS = re.compile(r"\bfield_storage(?P<path>(?:\.\w+(?:\[\w+\])?)+)\.value\b")
LOOP = re.compile(
    r"(?P<i> +)for\((?:genvar|int) i0=0; i0<(?P<size>\d+); i0\+\+\) begin\n(?P<body>.*?\n)(?P=i)end\n", re.DOTALL
)


def _unrolled(match: re.Match[str]) -> str:
    return "".join(re.sub(r"\bi0\b", str(i), match["body"]) for i in range(int(match["size"])))


def _name(path: str) -> str:
    return "field_storage" + re.sub(r"[.\[]", "_", path.replace("]", ""))


def _storage(match: re.Match[str]) -> str:
    """Declarations in place of the structure of all fields: a variable a field, also of an array of registers."""
    found: list[tuple[str, str]] = []  # type, path from the member on that is open
    open_from: list[int] = []
    for line in match["body"].splitlines():
        words = line.strip()
        if words == "struct {":
            open_from.append(len(found))
        elif words.startswith("}"):
            name, _, size = words.strip("} ];").partition("[")
            members = [f"{name}[{i}]" for i in range(int(size))] if size else [name]
            begin = open_from.pop()
            found[begin:] = [(kind, f".{member}{path}") for member in members for kind, path in found[begin:]]
        else:
            found.append((words.removesuffix(" value;"), ""))
    return "".join(f"    {kind} {_name(path)};\n" for kind, path in found)


def _choice(match: re.Match[str]) -> str:
    """Read data by a choice among the addresses, which all differ, in place of one question after another."""
    body, count = READ_REGISTER.subn(r"\g<i>\g<address>: begin", match["body"])
    if count == 0 or "if(" in body:
        raise ValueError("the register generator's output has changed: read data are not a list of registers")
    case = f"        case (rd_mux_addr)\n{body}            default: ;\n        endcase\n"
    return f"{match['head']}{case}{match['tail']}"


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
    """Text of a register block (`fl_*_regs.sv`) with decoder, read multiplexer and fields under the bus request."""
    text = FIELD.sub(
        r"\g<i>always_ff @(posedge clk) begin\n"
        r"\g<i>    if(decoded_req) begin\n"
        r"\g<i>        if(decoded_req_is_wr & \g<strobe>) \g<store> <= \g<next>;\n"
        r"\g<i>    end\n\g<reset>\g<i>    end\n\g<i>end\n",
        text,
    )
    text = READBACK.sub(_choice, LOOP.sub(_unrolled, text))
    text = _gate(text, DECODE, "cpuif_req_masked", "decoded_reg_strb = '{default: '0};\n")
    # The strobe alone, which also clears the register behind the data: synthesis leaves it out of the data's way.
    text = _gate(text, READBACK, "decoded_req")
    text, count = STORAGE.subn(_storage, text)
    if count != 1:
        raise ValueError(f"the register generator's output has changed: {count} places match {STORAGE.pattern!r}")
    return ACCESS.sub(lambda match: _name(match["path"]), text)
