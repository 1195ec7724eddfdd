# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Shape of the firmware's drive: who writes which field, who includes and calls whom: `python -m fluxverify.c_shape`.

The compiler reads the sources and hands over its syntax tree, so a pointer of its type or a macro hides no write; one
through `void *` is not seen. Rules that
`make lint` keeps:

- one file writes a field of a record; a section of the command is cleared by the hardware layer besides;
- a file of the drive calls and includes its own layer and those below it only; nowhere is there a circle;
- folders include and call what is in `FOLDERS` below them, console and node not each other, `control/` itself alone;
- `hal/` and `images/` alone name a register; in `hal/` one source names those of a peripheral, but for the clock's;
- below drive.c nothing names drive_t;
- `enter` alone assigns the state; `follow`, and the boot, alone call it and the fault log.
"""

from __future__ import annotations

import argparse
import json
import re
import subprocess
import sys
from collections import defaultdict
from collections.abc import Iterable, Iterator, Mapping
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field
from functools import cached_property
from importlib import resources
from pathlib import Path
from typing import Any, Final, TypeVar

from fluxlock.base.paths import GENERATED
from fluxlock.base.writable import guarded
from fluxlock.firmware.toolchain import SW, generate_canopen, generate_headers
from fluxlock.generate.registers import generate_registers

K = TypeVar("K")
Node = dict[str, Any]
DRIVE: Final = "drive/"
# The records whose fields are counted: the drive's, and what it says to the hardware layer.
RECORDS: Final = (DRIVE, "hal/chip_io.h")
# The sources that are read: whoever may write them.
READ: Final = (DRIVE, "hal/", "app/", "console/", "canopen/", "images/main.c", "images/host_main.c")
NOT_READ: Final = ("hal/host/", "hal/soc/")


class ShapeError(RuntimeError):
    """The compiler refused a source."""


def _tree(source: Path, sw: Path) -> Node:
    """Syntax tree of a source, as the compiler for the soft core sees it."""
    clang = [sys.executable, "-m", "ziglang", "clang", "-target", "riscv32-freestanding-none", "-std=c11"]
    system = resources.files("ziglang") / "lib" / "include"
    includes = [f"-isystem{system}", "-Ihal/include", "-I.", f"-I{GENERATED}"]
    command = [*clang, "-fsyntax-only", "-Xclang", "-ast-dump=json", *includes, str(source.relative_to(sw))]
    done = subprocess.run(command, cwd=sw, capture_output=True, text=True, check=False)
    if done.returncode:
        raise ShapeError(f"{source.name} does not compile:\n{done.stderr}")
    return dict(json.loads(done.stdout))


def _children(node: Node) -> list[Node]:
    return [child for child in node.get("inner", []) if child]


@dataclass
class Unit:
    """What one source and the headers that it includes define, write and call; names of files relative to `sw`."""

    tree: Node
    fields: dict[str, tuple[str, str, str]] = field(default_factory=dict)  # id: record, field, file of the record
    functions: dict[str, str] = field(default_factory=dict)  # defined: name, file
    writes: set[tuple[str, str, str, str]] = field(default_factory=set)  # record, field, file, function
    named: set[tuple[str, str, str]] = field(default_factory=set)  # file, calling function, called name
    own: set[str] = field(default_factory=set)  # static functions of the source

    def __post_init__(self) -> None:
        self._file = ""
        self._records: dict[str, str] = {}  # id of a record that has no tag, its typedef
        self._of_record: dict[str, list[tuple[str, str, str]]] = defaultdict(list)  # name, its fields
        for node in _children(self.tree):
            self._declaration(node)
        self.calls = {call for call in self.named if call[2] not in self.own}

    def _place(self, node: Node) -> str:
        """The dump names a file only where it changes."""
        for part in ("loc", "range"):
            place = node.get(part, {})
            place = place.get("begin", place)
            for spot in (place.get("spellingLoc", {}), place.get("expansionLoc", {}), place):
                if "file" in spot:
                    self._file = spot["file"]
        return self._file.removeprefix("./")

    def _declaration(self, node: Node) -> None:
        kind, file = node["kind"], self._place(node)
        if kind == "RecordDecl":
            self._record(node, file, node.get("name", ""))
        elif kind == "TypedefDecl":
            self._typedef(node)
            self._skim(node)
        elif kind == "FunctionDecl" and any(child["kind"] == "CompoundStmt" for child in _children(node)):
            # A static function of a source is its own business; one of a header is the header's.
            if node.get("storageClass") != "static" or file.endswith(".h"):
                self.functions[node["name"]] = file
            else:
                self.own.add(node["name"])
            self._walk(node, (), file, node["name"])
        elif kind == "VarDecl":
            self._walk(node, (), file, "")
        else:
            self._skim(node)

    def _skim(self, node: Node) -> None:
        """Files that a node names count for what follows it."""
        for child in _children(node):
            self._place(child)
            self._skim(child)

    def _record(self, node: Node, file: str, name: str) -> None:
        for child in _children(node):
            self._place(child)
            if child["kind"] == "RecordDecl":
                self._record(child, file, f"{name}.")
            elif child["kind"] == "FieldDecl":
                self.fields[child["id"]] = (name or node["id"], child.get("name", ""), file)
                self._skim(child)
        self._records[node["id"]] = name or node["id"]

    def _typedef(self, node: Node) -> None:
        """The name of a record that has none of its own."""

        def owned(inner: Node) -> Iterator[str]:
            if "decl" in inner and inner["decl"].get("kind") == "RecordDecl":
                yield inner["decl"]["id"]
            for child in _children(inner):
                yield from owned(child)

        for record in owned(node):
            if record in self._records and self._records[record] in (record, node["name"].removesuffix("_t")):
                before = self._records[record]
                self._records[record] = node["name"]
                for key, (name, fld, file) in self.fields.items():
                    if name == before or name == f"{before}.":
                        self.fields[key] = (node["name"], fld, file)

    @cached_property
    def record_types(self) -> dict[str, list[tuple[str, str, str]]]:
        """Fields of every record, by its name."""
        result = defaultdict(list)
        for entry in self.fields.values():
            result[entry[0]].append(entry)
        return result

    def _walk(self, node: Node, above: tuple[Node, ...], file: str, function: str) -> None:
        self._place(node)
        kind = node["kind"]
        inner = _children(node)
        if kind == "UnaryExprOrTypeTraitExpr":
            return
        if kind == "DeclRefExpr" and node["referencedDecl"]["kind"] == "FunctionDecl":
            self.named.add((file, function, node["referencedDecl"]["name"]))
        written = (
            (kind == "BinaryOperator" and node.get("opcode") == "=")
            or kind == "CompoundAssignOperator"
            or (kind == "UnaryOperator" and node.get("opcode") in ("++", "--"))
        )
        if written:
            self._write(inner[0], file, function)
        address = kind == "UnaryOperator" and node.get("opcode") == "&"
        decay = kind == "ImplicitCastExpr" and node.get("castKind") == "ArrayToPointerDecay"
        if (address or decay) and self._lends(node, above):
            self._write(inner[0], file, function)
        for child in inner:
            self._walk(child, (*above, node), file, function)

    def _lends(self, node: Node, above: tuple[Node, ...]) -> bool:
        """Whether someone may write through this address: it is not of something constant, nor only read here."""
        of = node["type"]["qualType"].removesuffix("*").strip()
        record = self.record_types.get(of, [])
        if of.startswith("const ") or (record and record[0][2].startswith(RECORDS)):
            return False  # a record that counts is written where its fields are
        parent = above[-1]
        if parent["kind"] in ("ArraySubscriptExpr", "MemberExpr") or parent.get("opcode") == "*":
            return False
        while parent["kind"] in ("ParenExpr", "ImplicitCastExpr"):
            if parent["type"]["qualType"].startswith("const "):
                return False
            above = above[:-1]
            parent = above[-1]
        return True

    def _write(self, target: Node, file: str, function: str) -> None:
        """The field of the innermost record that counts; an assignment of a record writes all of its fields."""
        whole = target["type"].get("desugaredQualType", ""), target["type"]["qualType"]
        if self._is_local(target):
            return
        for name in whole:
            for record, fld, where in self.record_types.get(name, []):
                if where.startswith(RECORDS):
                    self.writes.add((record, fld, file, function))
        node: Node | None = target
        while node is not None:
            if node["kind"] == "MemberExpr":
                record, fld, where = self.fields.get(node["referencedMemberDecl"], ("", "", ""))
                if where.startswith(RECORDS):
                    self.writes.add((record, fld, file, function))
                    return
            inner = _children(node)
            node = inner[0] if inner else None

    def _is_local(self, target: Node) -> bool:
        """A variable of the function itself, by value."""
        node = target
        while True:
            if node["kind"] == "MemberExpr" and node.get("isArrow"):
                return False
            if node["kind"] == "UnaryOperator" and node.get("opcode") == "*":
                return False
            if node["kind"] == "DeclRefExpr":
                return (
                    node["referencedDecl"]["kind"] in ("VarDecl", "ParmVarDecl")
                    and "*" not in (node["referencedDecl"]["type"]["qualType"])
                )
            inner = _children(node)
            if not inner:
                return False
            node = inner[0]


@dataclass(frozen=True)
class Shape:
    """The whole of it."""

    writers: dict[tuple[str, str], frozenset[str]]  # record and field: files
    assigners: dict[tuple[str, str], frozenset[str]]  # the same: functions
    includes: dict[str, frozenset[str]]
    calls: dict[str, frozenset[str]]  # file: files in which what it names is defined
    callers: dict[str, frozenset[str]]  # function: functions of the drive that name it

    @property
    def several(self) -> dict[tuple[str, str], frozenset[str]]:
        """Fields with more than one writing file."""
        return {key: files for key, files in self.writers.items() if len(files) > 1}


def includes_of(sw: Path = SW) -> dict[str, frozenset[str]]:
    """Our own headers that each file below `sw` includes."""
    result = {}
    for path in sorted(p for p in sw.rglob("*") if p.suffix in {".c", ".h"}):
        found = re.findall(r'^#include "([^"]+)"', path.read_text(), re.MULTILINE)
        result[path.relative_to(sw).as_posix()] = frozenset(name for name in found if (sw / name).exists())
    return result


def circles(graph: dict[str, frozenset[str]]) -> list[list[str]]:
    """Sets of more than one node that all reach each other (Tarjan)."""
    index: dict[str, int] = {}
    low: dict[str, int] = {}
    stack: list[str] = []
    found: list[list[str]] = []

    def visit(node: str) -> None:
        index[node] = low[node] = len(index)
        stack.append(node)
        for other in sorted(graph.get(node, ())):
            if other not in index:
                visit(other)
                low[node] = min(low[node], low[other])
            elif other in stack:
                low[node] = min(low[node], index[other])
        if low[node] == index[node]:
            at = stack.index(node)
            if len(stack) - at > 1:
                found.append(sorted(stack[at:]))
            del stack[at:]

    for node in sorted(graph):
        if node not in index:
            visit(node)
    return found


def read_shape(sw: Path = SW) -> Shape:
    """Read all sources below `sw` that may write the drive's records."""
    generate_registers()
    generate_headers()
    generate_canopen()
    names = (p for p in sorted(sw.rglob("*.c")) if p.relative_to(sw).as_posix().startswith(READ))
    sources = [p for p in names if not p.relative_to(sw).as_posix().startswith(NOT_READ)]
    with ThreadPoolExecutor(2) as pool:
        units = list(pool.map(lambda source: Unit(_tree(source, sw)), sources))
    writers: dict[tuple[str, str], set[str]] = defaultdict(set)
    assigners: dict[tuple[str, str], set[str]] = defaultdict(set)
    functions: dict[str, str] = {}
    for unit in units:
        functions |= unit.functions
        for record, fld, file, function in unit.writes:
            writers[record, fld].add(file)
            assigners[record, fld].add(function)
    calls: dict[str, set[str]] = defaultdict(set)
    callers: dict[str, set[str]] = defaultdict(set)
    for unit in units:
        for file, function, name in unit.named:
            if file.startswith(DRIVE):
                callers[name].add(function)
        for file, _, name in unit.calls:
            if name in functions and functions[name] != file:
                calls[file].add(functions[name])

    return Shape(_frozen(writers), _frozen(assigners), includes_of(sw), _frozen(calls), _frozen(callers))


def _frozen(table: Mapping[K, set[str]]) -> dict[K, frozenset[str]]:
    return {key: frozenset(values) for key, values in table.items()}


def within(graph: dict[str, frozenset[str]], folder: str) -> dict[str, frozenset[str]]:
    """The part of a graph inside a folder."""
    return {
        name: frozenset(other for other in others if other.startswith(folder))
        for name, others in graph.items()
        if name.startswith(folder)
    }


# From the bottom up; the methods do not know each other.
LAYERS: Final = (
    ("drive/faults", "drive/parameters", "drive/settings"),
    ("drive/method", "drive/coast", "drive/wiring", "drive/supervise", "drive/protect"),
    ("drive/six_step/", "drive/vector/"),
    ("drive/drive",),
)
FOLDERS: Final = (
    ("control/",),
    ("hal/",),
    (DRIVE,),
    ("app/", "console/", "canopen/"),
    ("images/",),
)  # from the bottom up
APART: Final = {"console/", "canopen/"}
CLOCK: Final = "sys"  # the peripheral of the clock that all may read
REGISTER: Final = re.compile(r"\b(?:reg_read|reg_write|REG|FL_\w+_REGS__\w+)\b|hal/reg\.h|fluxlock_regs\.h")
HARDWARE: Final = "hal/"
CLEARED: Final = (
    "fresh",
    "clear",
    "clear_trips",
    "start_auto_zero",
)  # by the hardware layer, in a section of the command
SIX_STEP: Final = "drive/six_step/six_step.c"
EITHER: Final = ("report_t", "six_step_report_t")  # by the method that drives


def _upward(verb: str, graph: Mapping[str, frozenset[str]]) -> Iterator[str]:
    for number, level in enumerate(FOLDERS):
        above = tuple(folder for part in FOLDERS[number + 1 :] for folder in part)
        for folder in level:
            beside = tuple(APART - {folder}) if folder in APART else ()
            for name in sorted(name for name in graph if name.startswith(folder)):
                for it in sorted(graph[name]):
                    if it.startswith((*above, *beside)):
                        yield f"{name} {verb} {it}, which is not below it"


def _layer(name: str) -> tuple[int, str]:
    """Number of a file's layer, and the part of it that the file is in."""
    for number, parts in enumerate(LAYERS):
        for part in parts:
            if name.startswith(part):
                return number, part
    return -1, ""


def _owners(record: str, fld: str, files: frozenset[str]) -> frozenset[str]:
    """The files that count as writers of a field."""
    owners = {file for file in files if file.startswith(DRIVE)}
    if fld in CLEARED and record.endswith("_command_t"):
        files = frozenset(file for file in files if not file.startswith(HARDWARE))
    if not owners:
        return frozenset()
    if record in EITHER:
        files = files - {SIX_STEP}
    return files


def complaints(shape: Shape, sw: Path = SW) -> Iterator[str]:
    """What breaks the rules, by name."""
    for (record, fld), files in sorted(shape.writers.items()):
        owners = _owners(record, fld, files)
        if len(owners) > 1:
            yield f"{record}.{fld} is written by {' and '.join(sorted(owners))}"
    for verb, graph in (("includes", shape.includes), ("calls", shape.calls)):
        for circle in circles(graph):
            yield f"circle of {verb}: {' '.join(circle)}"
        for name, others in sorted(within(graph, DRIVE).items()):
            for other in sorted(others):
                (layer, part), (below, its) = _layer(name), _layer(other)
                if below > layer or (below == layer == 2 and part != its):
                    yield f"{name} {verb} {other}, which is not below it"
        yield from _upward(verb, graph)
    for path in sorted(
        p for p in sw.rglob("*.[ch]") if not p.relative_to(sw).as_posix().startswith(("hal/", "images/"))
    ):
        for found in sorted(set(REGISTER.findall(_without_comments(path.read_text())))):
            yield f"{path.relative_to(sw).as_posix()} names {found}, of a register"
    drivers: defaultdict[str, set[str]] = defaultdict(set)
    for path in sw.glob("hal/*.[ch]"):
        for peripheral in re.findall(r"\bREG\((\w+)\.", _without_comments(path.read_text())):
            drivers[peripheral].add(path.relative_to(sw).as_posix())
    for peripheral, sources in sorted(drivers.items()):
        if len(sources) > 1 and peripheral != CLOCK:
            yield f"registers of {peripheral} are named by {' and '.join(sorted(sources))}"
    for path in sorted(sw.glob("drive/**/*.[ch]")):
        name = path.relative_to(sw).as_posix()
        if not name.startswith("drive/drive.") and re.search(r"\bdrive_t\b", _without_comments(path.read_text())):
            yield f"{name} names drive_t"
    for function in sorted(shape.assigners.get(("order_t", "state"), frozenset()) - {"enter"}):
        yield f"{function} assigns order_t.state"
    for name, allowed in (("enter", {"follow", "start", "drive_init"}), ("fault_log_add", {"follow", "drive_init"})):
        for function in sorted(shape.callers.get(name, frozenset()) - allowed):
            yield f"{function} calls {name}"


def _without_comments(text: str) -> str:
    return re.sub(r"//.*|/\*.*?\*/", "", text)


def _table(shape: Shape) -> Iterable[str]:
    yield f"written fields: {len(shape.writers)}, with several writing files: {len(shape.several)}"
    for (record, fld), files in sorted(shape.several.items(), key=lambda item: (-len(item[1]), item[0])):
        yield f"  {record}.{fld}: {' '.join(sorted(files))}"
    for name, graph in (("includes", shape.includes), ("calls", shape.calls)):
        for circle in circles(graph):
            yield f"circle of {name}: {' '.join(circle)}"


def check() -> str:
    """What breaks the rules, for `make lint`."""
    try:
        return "\n".join(complaints(read_shape()))
    except ShapeError as error:
        return str(error)


def main() -> int:
    """Command line of this module."""
    argparse.ArgumentParser(description="Who writes, includes and calls whom in the firmware's drive.").parse_args()
    shape = read_shape()
    print("\n".join([*_table(shape), *complaints(shape)]))
    return 0


if __name__ == "__main__":
    sys.exit(guarded(main))
