# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""A bus of python-can by its name on the command line: INTERFACE:CHANNEL."""

from __future__ import annotations

import errno
import ipaddress
from typing import TYPE_CHECKING, Any

from fluxlock.config import ConfigError, Problem, Scenario

if TYPE_CHECKING:
    import can

OPTION = "--can"
DEFAULT = "udp_multicast:239.74.163.2"
# Error numbers of a sender that must wait.
FULL = (errno.ENOBUFS, errno.EAGAIN)


def open_bus(name: str, kbit_per_s: int | None = None) -> can.BusABC:
    """The bus; ConfigError with what to do if it is not to be had.

    kbit_per_s: for adapters; a kernel's interface has its own bit rate.
    """
    interface, _, channel = name.partition(":")
    if not interface or not channel:
        raise ConfigError([Problem(OPTION, name, "must be INTERFACE:CHANNEL, for instance socketcan:vcan0")])
    _check(name, interface, channel)
    settings = {} if kbit_per_s is None else {"bitrate": 1000 * kbit_per_s}
    return _open(name, interface, channel, settings)


def bus_of(scenario: Scenario, name: str) -> tuple[can.BusABC, int]:
    """The bus on which a scenario's board is, and its node-ID; ConfigError."""
    if scenario.can is None:
        text = "with node-ID and bit rate of the board's bus is missing: --set 'can={node_id=5}'"
        raise ConfigError([scenario.sources.problem("can", text)])
    return open_bus(name, scenario.can.bit_rate_kbit_per_s), scenario.can.node_id


def has_taken(bus: can.BusABC, message: can.Message) -> bool:
    """Hand a message to the interface; False: it has no room now."""
    import can

    try:
        bus.send(message, timeout=1.0)
    except can.CanOperationError as error:
        if error.error_code not in FULL:
            raise
        return False
    return True


def _is_multicast(address: str) -> bool:
    try:
        return ipaddress.ip_address(address).is_multicast
    except ValueError:
        return False


def _check(shown: str, interface: str, channel: str) -> None:
    # Slow to import, and not needed by other commands.
    import can

    if interface not in can.VALID_INTERFACES:
        text = f"{interface} is no interface of python-can; socketcan, udp_multicast and virtual need no adapter"
        raise ConfigError([Problem(OPTION, shown, text)])
    # python-can opens it and says of the failure no more than that the socket cannot be configured.
    if interface == "udp_multicast" and not _is_multicast(channel):
        text = f"{channel} is no multicast address, as {DEFAULT.partition(':')[2]}"
        raise ConfigError([Problem(OPTION, shown, text)])


def _open(shown: str, interface: str, channel: str, settings: dict[str, Any]) -> can.BusABC:
    import can

    try:
        return can.Bus(channel=channel, interface=interface, **settings)
    except (can.CanError, OSError, ValueError) as error:
        raise ConfigError([Problem(OPTION, shown, _reason(interface, channel, error))]) from None


def _reason(interface: str, channel: str, error: Exception) -> str:
    number = getattr(error, "errno", None)
    if interface == "socketcan" and number in {errno.EAFNOSUPPORT, errno.EPROTONOSUPPORT}:
        return f"this kernel has no CAN: load its module (modprobe vcan), or use {DEFAULT}"
    if interface == "socketcan" and number in {errno.ENODEV, errno.ENETDOWN}:
        return f"there is no such interface: ip link add {channel} type vcan; ip link set {channel} up"
    return f"cannot be opened: {error}"
