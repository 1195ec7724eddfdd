# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Values of constants, from the code: parameters of modules, `localparam`, `#define` and `enum`, Python, registers.

A page names the constant that it quotes in a comment behind the number: `8<!--sw/drive/drive.c:LOOK_TICKS-->`. What is
before the colon: a file, or the name of a module or package of `rtl`. Behind the name there may be arithmetic with
numbers and further constants of the same file: `<!--sw/images/boot/main.c:LISTEN_MS / 1000-->`. A row of a table may
name the constant as code instead: `fl_sense::Latency`. A text is taken as the value that it prints: "0.3" is right
for 0.26 to 0.34.
"""

from __future__ import annotations

import ast
import json
import re
import subprocess
import tempfile
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from pathlib import Path

from fluxlock.base.paths import ROOT, RTL, tool_environment
from fluxlock.file_lists import chip_files
from fluxlock.generate.registers import generate_registers

MARK = re.compile(r"<!--\s*([\w./]+)\s*:\s*([A-Za-z_][^>]*?)\s*-->")
MARKED = re.compile(r"(0x[0-9A-F]+|[−-]?\d[\d  ]*(?:\.\d+)?)\s*" + MARK.pattern)
NAMED = re.compile(r"`(fl_\w+)::(\w+)`")
NUMBER = re.compile(r"(?<![\w.#])\d[\d  ]*(?:\.\d+)?(?![\w^])")
BASED = {"b": 2, "d": 10, "h": 16, "o": 8}


class Unknown(Exception):
    """No such constant."""


@dataclass(frozen=True)
class Parameter:
    """A parameter of a module's header: derived ones are `localparam`."""

    derived: bool
    text: str


@dataclass(frozen=True)
class Port:
    """A port of a module: direction and type as written, `logic` left out before a range."""

    direction: str
    type: str


def source_of(module: str) -> Path:
    """The file of a module or package."""
    found = list(RTL.rglob(f"{module}.sv"))
    if len(found) != 1:
        raise Unknown(f"{module}: no module or package of rtl/")
    return found[0]


def uncommented(text: str) -> str:
    """C or SystemVerilog without comments."""
    return re.sub(r"//[^\n]*|/\*.*?\*/", "", text, flags=re.DOTALL)


def header_of(module: str, text: str) -> tuple[str, str]:
    """Texts between the brackets of a module's parameters and ports."""
    head = re.search(rf"^module {module}\b(.*?)^\);", uncommented(text), re.DOTALL | re.MULTILINE)
    assert head, f"{module}: no module header"
    parts = re.fullmatch(r"[^(]*?(?:#\((.*?)^\)\s*)?\(\n(.*)", head.group(1), re.DOTALL | re.MULTILINE)
    assert parts, f"{module}: header not understood"
    return parts.group(1) or "", parts.group(2)


def at_commas(text: str) -> list[str]:
    """Pieces between the commas that stand in no bracket and no string."""
    pieces, depth, quoted, begin = [], 0, False, 0
    for k, character in enumerate(text):
        quoted ^= character == '"'
        depth += 0 if quoted else (character in "([{") - (character in ")]}")
        if character == "," and not depth and not quoted:
            pieces.append(text[begin:k])
            begin = k + 1
    return [piece.strip() for piece in (*pieces, text[begin:]) if piece.strip()]


def parameters_of(module: str, text: str | None = None) -> dict[str, Parameter]:
    """Parameters of a module's header with their defaults. text: of the file, default the file's."""
    found = {}
    derived = False
    for piece in at_commas(header_of(module, text or source_of(module).read_text())[0]):
        left, _, value = piece.partition("=")
        derived = {"parameter": False, "localparam": True}.get(left.split()[0], derived)
        found[left.split()[-1]] = Parameter(derived, " ".join(value.split()))
    return found


def ports_of(module: str, text: str | None = None) -> dict[str, Port]:
    """Ports of a module."""
    found = {}
    for piece in at_commas(header_of(module, text or source_of(module).read_text())[1]):
        match = re.fullmatch(r"(in|out)put\s+(?:wire\s+)?(.*?)\s*(\w+)", " ".join(piece.split()))
        assert match, f"{module}: port not understood: {piece}"
        found[match.group(3)] = Port(match.group(1), plain_type(match.group(2)))
    return found


def plain_type(text: str) -> str:
    """A type without blanks, and without `logic` where it has a range."""
    text = re.sub(r"\s*([\[\]:*+-])\s*", r"\1", text.strip())
    text = re.sub(r"^\w+::", "", text)
    return re.sub(r"^logic\s*(?=\[|signed)", "", text)


def literals(text: str) -> str:
    """SystemVerilog's or C's numbers as Python's."""
    text = re.sub(r"(\d*)'s?([bdho])([0-9a-fA-F_]+)", lambda m: str(int(m.group(3), BASED[m.group(2)])), text)
    text = re.sub(r"\b(0[xX][0-9a-fA-F]+|\d[\d_]*(?:\.\d+)?(?:[eE][+-]?\d+)?)(?:[uUlLfF]+)\b", r"\1", text)
    return re.sub(r"\b\w+'(?=\()", "", text)


def evaluate(text: str, name: Callable[[str], float], exact: bool = False) -> float:
    """Value of an expression of numbers, names, + - * / << >> and brackets; division of integers is C's, or exact."""

    def value(node: ast.expr) -> float:
        match node:
            case ast.Constant(value=int() | float() as number):
                return number
            case ast.Name(id=word):
                return name(word)
            case ast.Subscript(value=ast.Name(id=word), slice=ast.Constant(value=int() as key)):
                return name(f"{word}[{key}]")
            case ast.UnaryOp(op=ast.USub(), operand=inner):
                return -value(inner)
            case ast.BinOp(left=a, op=op, right=b):
                x, y = value(a), value(b)
                whole = isinstance(x, int) and isinstance(y, int)
                match op:
                    case ast.Add():
                        return x + y
                    case ast.Sub():
                        return x - y
                    case ast.Mult():
                        return x * y
                    case ast.Div():
                        return x // y if whole and not exact else x / y
                    case ast.FloorDiv():
                        return x // y
                    case ast.Pow():
                        return float(x**y) if y < 0 else x**y
                    case ast.LShift() if whole:
                        return int(x) << int(y)
                    case ast.RShift() if whole:
                        return int(x) >> int(y)
        raise Unknown(f"not understood: {text}")

    try:
        return value(ast.parse(literals(text).strip(), mode="eval").body)
    except SyntaxError:
        raise Unknown(f"not understood: {text}") from None


@cache
def elaborated(module: str, phases: int | None) -> dict[str, int]:
    """Parameters of a module as Verilator elaborates them, functions too. phases: another number of them."""
    source = source_of(module)
    generate_registers()
    with tempfile.TemporaryDirectory() as folder:
        tree = Path(folder) / "tree.json"
        command = ["verilator", "--json-only", "-Wno-fatal", "-Wno-lint", "--top-module", module]
        command += [f"-GPhases={phases}"] if phases is not None else []
        command += ["--json-only-output", str(tree), "--json-only-meta-output", str(tree.with_suffix(".meta"))]
        packages = [path for path in chip_files() if path.stem.endswith("_pkg")]
        command += [*map(str, packages), str(source)]
        command += [word for folder in sorted(RTL.iterdir()) if folder.is_dir() for word in ("-y", str(folder))]
        done = subprocess.run(command, env=tool_environment(), capture_output=True, text=True, check=False)
        assert tree.exists(), done.stderr
        document = json.loads(tree.read_text())
    top = next(m for m in document["modulesp"] if m["origName"] == module)
    values = {}
    for item in top["stmtsp"]:
        if item["type"] == "VAR" and item.get("isParam") and (given := item.get("valuep")):
            values[item["name"]] = int(evaluate(given[0]["name"].replace("'sh", "'h"), lambda word: 0))
    return values


def parameter_value(module: str, name: str, phases: int | None = None, text: str | None = None) -> float:
    """Value of a parameter by the defaults of the others. phases: with another number of phases."""
    parameters = parameters_of(module, text)

    def value(word: str) -> float:
        if word == "Phases" and phases is not None and not parameters[word].derived:
            return phases
        if word not in parameters:
            raise Unknown(f"{module}: no parameter {word}")
        expression = parameters[word].text
        if re.search(r"[a-z]\w*\(", expression):
            return elaborated(module, phases)[word]
        return evaluate(expression, value)

    return value(name)


def assignments(path: str, text: str) -> dict[str, str]:
    """Named constants of a file, as expressions."""
    if path.endswith(".py"):
        tree = ast.parse(text)
        plain = [n for n in ast.walk(tree) if isinstance(n, ast.Assign) and isinstance(n.targets[0], ast.Name)]
        named = {n.targets[0].id: n.value for n in plain if isinstance(n.targets[0], ast.Name)}
        inner = {
            f"{word}[{ast.literal_eval(key)}]": ast.unparse(item)
            for word, value in named.items() if isinstance(value, ast.Dict)
            for key, item in zip(value.keys, value.values, strict=True) if isinstance(key, ast.Constant)
        }  # fmt: skip
        return {**{word: ast.unparse(value) for word, value in named.items()}, **inner}
    text = uncommented(text)
    if path.endswith(".sv"):
        found = re.findall(r"\b(?:localparam|parameter)\b[^=;]*?(\w+)\s*=\s*([^;,]+?)\s*(?=[;,\n])", text)
    else:
        found = re.findall(r"^[ \t]*#define[ \t]+(\w+)[ \t]+(.+?)[ \t]*$", text, re.MULTILINE)
        found += re.findall(r"\b([A-Z]\w+)\s*=\s*([^,;={}]+?)\s*(?=[,;}])", text)
    return dict(found)


@cache
def register_resets() -> dict[str, int]:
    """Reset values of the registers' fields: `block.register.field`."""
    from systemrdl.compiler import RDLCompiler
    from systemrdl.node import FieldNode

    compiler = RDLCompiler()
    compiler.compile_file(str(RTL / "regs" / "fluxlock_regs.rdl"), incl_search_paths=[str(RTL / "regs")])
    found = {}
    for node in compiler.elaborate().top.descendants(unroll=False):
        if isinstance(node, FieldNode) and isinstance(reset := node.get_property("reset"), int):
            found[".".join(node.get_path(empty_array_suffix="").split(".")[1:])] = reset
    return found


def constant(where: str, expression: str, read: Callable[[Path], str] = Path.read_text) -> float:
    """Value of a constant, or of arithmetic with constants, of a file, module or package. read: gives a file's text."""
    if where == "registers":
        resets = register_resets()
        if expression not in resets:
            raise Unknown(f"no field {expression} with a reset value")
        return resets[expression]
    path = ROOT / where if "/" in where else source_of(where)
    if not path.exists():
        raise Unknown(f"{where}: no such file")
    text = read(path)
    names = assignments(path.name, text)
    for header in re.findall(r'^#include "(\S+)"', text, re.MULTILINE):
        if (ROOT / "sw" / header).exists():  # not a generated one
            names = {**assignments(header, (ROOT / "sw" / header).read_text()), **names}

    def value(word: str) -> float:
        if word not in names:
            raise Unknown(f"{where}: no constant {word}")
        if path.suffix == ".sv" and re.search(r"[a-z]\w*\(", names[word]):
            return elaborated(path.stem, None)[word]
        return evaluate(names[word], value)

    return evaluate(expression, value, exact=True)


def printed(text: str) -> tuple[float, float]:
    """The number that a text prints, and half a unit of its last place."""
    plain = re.sub(r"[  _]", "", text).replace("−", "-")
    if plain.startswith("0x"):
        return int(plain, 16), 0.0
    return float(plain), (0.5 * 10 ** -len(plain.partition(".")[2]) if "." in plain else 0.0)


def agrees(text: str, value: float) -> bool:
    """Whether a text prints a value."""
    number, half = printed(text)
    return abs(number - value) <= half * (1 + 1e-9) + 1e-9 * abs(value)
