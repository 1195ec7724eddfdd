# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Registers of our RTL, read from its text: outputs that are registers, and registers that only assertions look at.

The header of the Verilated model does not tell either: it names an output by the net it drives, and it holds flip-flops
that are in no netlist.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path

_MODULE = re.compile(r"^module (fl_\w+)\b(.*?)^endmodule", re.DOTALL | re.MULTILINE)
_NO_CODE = re.compile(r'//.*|"[^"\n]*"')
_ASSERTION = re.compile(r"\bassert\s*\([^;]*;")
_DECLARATION = re.compile(r"^\s*logic\b[^;]*;", re.MULTILINE)
_WRITTEN = re.compile(r"\b(\w+_[qo])\b(?:\[[^\]]*\]|\.\w+)*\s*<=")
_INSTANCE = re.compile(r"\b(fl_\w+)\s*(?:#\s*\([^;]*?\)\s*)?\b(u_\w+)\s*\(([^;]*?)\);")
_CONNECTED = re.compile(r"\.(\w+_o)\s*(?:\(\s*(\w+)\s*\))?\s*(?=,|$)")


@dataclass(frozen=True)
class Instance:
    """A module in another."""

    module: str
    nets: dict[str, str]  # of outputs that drive a net of its own


@dataclass(frozen=True)
class Module:
    """What a module holds."""

    outputs: frozenset[str]  # ports that are registers
    helpers: frozenset[str]  # registers that nothing but assertions reads
    instances: dict[str, Instance]


def _read_by_assertions_only(name: str, body: str) -> bool:
    """True if a register stands nowhere but in its assignments. body: without assertions and declarations."""
    assignments = rf"\b{name}\b(?:\[[^\]]*\]|\.\w+)*\s*<=[^;]*;"
    return not re.search(rf"\b{name}\b", re.sub(assignments, "", body))


def _module(text: str) -> Module:
    """A module from what stands between its name and its end."""
    body = _NO_CODE.sub("", text)
    written = set(_WRITTEN.findall(body))
    plain = _DECLARATION.sub("", _ASSERTION.sub("", body))
    helpers = {name for name in written if name.endswith("_q") and _read_by_assertions_only(name, plain)}
    instances = {
        name: Instance(module, {port: net or port for port, net in _CONNECTED.findall(ports.strip())})
        for module, name, ports in _INSTANCE.findall(body)
    }
    return Module(frozenset(name for name in written if name.endswith("_o")), frozenset(helpers), instances)


def modules(files: Iterable[Path]) -> dict[str, Module]:
    """Modules of our RTL by name."""
    return {name: _module(body) for file in files for name, body in _MODULE.findall(file.read_text(encoding="utf-8"))}


Place = tuple[str, ...]  # top, instances and name, without generate blocks


def _below(
    known: dict[str, Module], module: str, place: Place, above: list[dict[str, str]]
) -> Iterator[tuple[Place, Module, list[dict[str, str]]]]:
    """A module at its place and all below it, each with the nets of its outputs, those of the module above last."""
    if module not in known:
        return
    yield place, known[module], above
    for name, instance in known[module].instances.items():
        yield from _below(known, instance.module, (*place, name), [*above, instance.nets])


def helper_places(known: dict[str, Module], top: str) -> set[Place]:
    """Registers that only assertions read."""
    return {(*place, name) for place, module, _ in _below(known, top, (top,), []) for name in module.helpers}


def output_places(known: dict[str, Module], top: str) -> list[list[Place]]:
    """For each output that is a register the places where a Verilated model may hold it, the likeliest first."""
    found = []
    for place, module, above in _below(known, top, (top,), []):
        for port in sorted(module.outputs):
            places, name, here = [(*place, port)], port, place
            for nets in reversed(above):
                here, inside = here[:-1], here[-1]
                places.append((*here, f"__Vcellout__{inside}__{name}"))
                if name not in nets:
                    break
                name = nets[name]
                places.append((*here, name))
            found.append(places)
    return found
