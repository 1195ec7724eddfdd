# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Electronic data sheet (CiA 306) of the object dictionary."""

from __future__ import annotations

from collections.abc import Iterable

from fluxlock.canopen.dictionary import NODE_PREFIX, Dictionary, Entry, Object
from fluxlock.config.can import BIT_RATES

OBJECT_TYPES = {"var": 0x7, "array": 0x8, "record": 0x9}
DOMAIN_OBJECT = 0x2
MANDATORY = (0x1000, 0x1001, 0x1018)
MANUFACTURER = range(0x2000, 0x6000)
BIT_RATES_KBIT = (10, 20, 50, 125, 250, 500, 800, 1000)  # that a data sheet names


def _default(entry: Entry) -> str:
    if entry.default is None:
        return ""
    if isinstance(entry.default, str):
        return entry.default
    return f"{NODE_PREFIX}0x{entry.default:X}" if entry.node_relative else str(entry.default)


def _keys(entry: Entry, name: str) -> list[str]:
    lines = [
        f"ParameterName={name}",
        f"ObjectType=0x{DOMAIN_OBJECT if entry.type == 'domain' else OBJECT_TYPES['var']:X}",
        f"DataType=0x{entry.type_code:04X}",
        f"AccessType={entry.access}",
        f"DefaultValue={_default(entry)}",
        f"PDOMapping={int(bool(entry.map))}",
    ]
    if entry.bytes:
        lines += [f"LowLimit={entry.min}", f"HighLimit={entry.max}"]
    return lines


def _object(item: Object) -> list[str]:
    if item.kind == "var":
        return [f"[{item.index:04X}]", *_keys(item.entries[0], item.name), ""]
    lines = [f"[{item.index:04X}]", f"ParameterName={item.name}", f"ObjectType=0x{OBJECT_TYPES[item.kind]:X}"]
    lines += [f"SubNumber=0x{len(item.entries):X}", ""]
    for entry in item.entries:
        lines += [f"[{item.index:04X}sub{entry.sub:X}]", *_keys(entry, entry.sub_name), ""]
    return lines


def _list(name: str, items: Iterable[Object]) -> list[str]:
    found = list(items)
    lines = [f"[{name}]", f"SupportedObjects={len(found)}"]
    return [*lines, *(f"{i}=0x{item.index:04X}" for i, item in enumerate(found, 1)), ""]


def eds(dictionary: Dictionary) -> str:
    """Text of the EDS file."""
    identity = {entry.sub_name: entry.default for entry in dictionary.entries if entry.index == 0x1018}
    receive = sum(0x1400 <= item.index < 0x1600 for item in dictionary.objects)
    send = sum(0x1800 <= item.index < 0x1A00 for item in dictionary.objects)
    lines = [
        "[FileInfo]",
        "FileName=fluxlock.eds",
        f"FileVersion={dictionary.version}",
        "FileRevision=0",
        "EDSVersion=4.0",
        "Description=Made from sw/canopen/objects.toml",
        "",
        "[DeviceInfo]",
        f"VendorName={dictionary.vendor}",
        f"VendorNumber={identity['vendor_id']}",
        f"ProductName={dictionary.product}",
        f"ProductNumber={identity['product_code']}",
        f"RevisionNumber={identity['revision']}",
        *(f"BaudRate_{rate}={int(rate in BIT_RATES)}" for rate in BIT_RATES_KBIT),
        "SimpleBootUpMaster=0",
        "SimpleBootUpSlave=1",
        "Granularity=8",
        "DynamicChannelsSupported=0",
        "GroupMessaging=0",
        f"NrOfRXPDO={receive}",
        f"NrOfTXPDO={send}",
        "LSS_Supported=0",
        "",
        "[DummyUsage]",
        *(f"Dummy{code:04X}={int(code in (5, 6, 7))}" for code in range(1, 8)),
        "",
    ]
    rest = [item for item in dictionary.objects if item.index not in MANDATORY]
    lines += _list("MandatoryObjects", (item for item in dictionary.objects if item.index in MANDATORY))
    lines += _list("OptionalObjects", (item for item in rest if item.index not in MANUFACTURER))
    lines += _list("ManufacturerObjects", (item for item in rest if item.index in MANUFACTURER))
    for item in dictionary.objects:
        lines += _object(item)
    return "\n".join(lines)
