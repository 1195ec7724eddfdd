# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""A CAN bus in continuous time: wired-AND of nodes with delays, clock errors and disturbances.

Events are worked off in order of time, up to a time that the caller gives; nothing polls. Times in ns.
"""

from __future__ import annotations

import heapq
from collections.abc import Callable
from math import inf

from .mac import Mac
from .timing import BitClock, BitTiming


class Port:
    """Where a node meets the bus; `delay_ns` lies between the node and the middle of the bus, each way."""

    def __init__(self, bus: Bus, delay_ns: float, changed: Callable[[float, int], None]) -> None:
        self.bus, self.delay_ns, self.changed = bus, delay_ns, changed
        self.arrived = 1  # the node's level as the middle of the bus has it
        self.sent = 1
        self.seen = 1  # the bus as the node sees it

    def drive(self, now: float, level: int) -> None:
        """The node changes its level."""
        if level != self.sent:
            self.sent = level
            self.bus.at(now + self.delay_ns, lambda time: self._arrive(time, level))

    def _arrive(self, now: float, level: int) -> None:
        self.arrived = level
        self.bus.settle(now)

    def see(self, now: float, level: int) -> None:
        """The bus changes at the node."""
        self.seen = level
        self.changed(now, level)


class Node:
    """A protocol with a clock of its own on the bus."""

    def __init__(self, bus: Bus, timing: BitTiming, quantum_ns: float, delay_ns: float, start_ns: float = 0.0) -> None:
        self.mac = Mac()
        self.clock = BitClock(timing, quantum_ns, start_ns)
        self.port = Port(bus, delay_ns, self._changed)

    @property
    def next_at(self) -> float:
        """Time of its next own event."""
        return self.clock.sample_at if self.clock.before_sample else self.clock.end_at

    def act(self) -> None:
        """Do what is due at `next_at`."""
        clock = self.clock
        if clock.before_sample:
            self.mac.step(self.port.seen)
            clock.sampled(self.port.seen)
        else:
            self._begin(clock.end_at)

    def _begin(self, now: float) -> None:
        self.clock.ended(self.mac.between)
        self.port.drive(now, self.mac.level)

    def _changed(self, now: float, level: int) -> None:
        if level == 0 and self.clock.edge(now, self.port.sent == 0):
            self._begin(now)


class Bus:
    """The wired-AND of all ports, and the order of events."""

    def __init__(self) -> None:
        self.ports: list[Port] = []
        self.nodes: list[Node] = []
        self.level = 1  # in the middle
        self.forced: int | None = None
        self._events: list[tuple[float, int, Callable[[float], None]]] = []
        self._count = 0

    def node(self, timing: BitTiming, quantum_ns: float, delay_ns: float = 0.0, start_ns: float = 0.0) -> Node:
        """A node with its own protocol and clock."""
        node = Node(self, timing, quantum_ns, delay_ns, start_ns)
        self.nodes.append(node)
        self.ports.append(node.port)
        return node

    def port(self, delay_ns: float, changed: Callable[[float, int], None]) -> Port:
        """A port for a node from elsewhere; `changed` is called with time and level."""
        port = Port(self, delay_ns, changed)
        self.ports.append(port)
        return port

    def at(self, time: float, event: Callable[[float], None]) -> None:
        """Have something done at a time."""
        heapq.heappush(self._events, (time, self._count, event))
        self._count += 1

    def force(self, start: float, end: float, level: int) -> None:
        """A disturbance: the middle of the bus has this level, whatever is sent."""

        def set_to(now: float, forced: int | None) -> None:
            self.forced = forced
            self.settle(now)

        self.at(start, lambda now: set_to(now, level))
        self.at(end, lambda now: set_to(now, None))

    def settle(self, now: float) -> None:
        """Work out the level in the middle anew, and tell everybody after their delays."""
        level = min(port.arrived for port in self.ports) if self.forced is None else self.forced
        if level != self.level:
            self.level = level
            for port in self.ports:
                self.at(now + port.delay_ns, lambda time, port=port: port.see(time, level))  # type: ignore[misc]

    def run(self, until: float) -> None:
        """Work off everything up to and with a time."""
        while True:
            event = self._events[0][0] if self._events else inf
            node = min(self.nodes, key=lambda n: n.next_at, default=None)
            own = node.next_at if node else inf
            if min(event, own) > until:
                return
            # What the bus shows at the instant of a sample counts.
            if event <= own:
                time, _, action = heapq.heappop(self._events)
                action(time)
            elif node:
                node.act()

    @property
    def wake_at(self) -> float:
        """When `run` must be called next: by then something may have to change outside.

        Samples need no call of their own, since a node changes its level at the ends of bits.
        """
        ends = min((node.clock.end_at for node in self.nodes), default=inf)
        return min(ends, self._events[0][0]) if self._events else ends
