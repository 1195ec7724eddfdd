"""A bus of python-can by its name on the command line: INTERFACE:CHANNEL, or both by options of their own."""

from __future__ import annotations

import errno
from typing import TYPE_CHECKING

from fluxlock.config import ConfigError, Problem

if TYPE_CHECKING:
    import can

OPTION = "--can"
DEFAULT = "udp_multicast:239.74.163.2"


def open_bus(name: str) -> can.BusABC:
    """The bus; ConfigError with what to do if it is not to be had."""
    interface, _, channel = name.partition(":")
    if not _is_interface(interface) or not channel:
        raise ConfigError([Problem(OPTION, name, "must be INTERFACE:CHANNEL, for instance socketcan:vcan0")])
    return _open(OPTION, name, interface, channel)


def join_bus(interface: str, channel: str) -> can.BusABC:
    """The same for the options --interface and --channel."""
    if not _is_interface(interface):
        text = "is no interface of python-can; socketcan, udp_multicast and virtual need no adapter"
        raise ConfigError([Problem("--interface", interface, text)])
    return _open("--channel", channel, interface, channel)


def _is_interface(name: str) -> bool:
    # Slow to import, and not needed by other commands.
    import can

    return name in can.VALID_INTERFACES


def _open(option: str, shown: str, interface: str, channel: str) -> can.BusABC:
    import can

    try:
        return can.Bus(channel=channel, interface=interface)
    except (can.CanError, OSError, ValueError) as error:
        raise ConfigError([Problem(option, shown, _reason(interface, channel, error))]) from None


def _reason(interface: str, channel: str, error: Exception) -> str:
    number = getattr(error, "errno", None)
    if interface == "socketcan" and number in {errno.EAFNOSUPPORT, errno.EPROTONOSUPPORT}:
        return f"this kernel has no CAN: load its module (modprobe vcan), or use {DEFAULT}"
    if interface == "socketcan" and number in {errno.ENODEV, errno.ENETDOWN}:
        return f"there is no such interface: ip link add {channel} type vcan; ip link set {channel} up"
    return f"cannot be opened: {error}"
