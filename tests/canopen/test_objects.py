# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""The object dictionary: what is made from its one source agrees, as read by programs that are not ours."""

from __future__ import annotations

import io
import random
from pathlib import Path
from types import ModuleType
from typing import Any

import canopen
import cantools
import pytest

from fluxlock.canopen import __main__ as command
from fluxlock.canopen.accessors import accessors
from fluxlock.canopen.c_tables import READER, check_reads
from fluxlock.canopen.dbc import PDOS, dbc
from fluxlock.canopen.dictionary import OBJECTS_FILE, Dictionary, DictionaryError, Entry, load_dictionary
from fluxlock.canopen.eds import eds
from fluxlock.interface.names import load_faults

NODE = 5


@pytest.fixture(scope="module")
def dictionary() -> Dictionary:
    return load_dictionary()


@pytest.fixture(scope="module")
def sheet(dictionary: Dictionary) -> canopen.ObjectDictionary:
    file = io.StringIO(eds(dictionary))
    file.name = "fluxlock.eds"
    return canopen.import_od(file, node_id=NODE)


def variable(sheet: canopen.ObjectDictionary, entry: Entry) -> Any:
    found = sheet[entry.index]
    return found if isinstance(found, canopen.objectdictionary.ODVariable) else found[entry.sub]


def test_eds(dictionary: Dictionary, sheet: canopen.ObjectDictionary) -> None:
    """`canopen` reads every entry of the EDS with the type, access, range and default of the source.

    Verifies: CO-01
    """
    assert [i for i in sorted(sheet.indices) if i >= 0x1000] == [item.index for item in dictionary.objects]
    for entry in dictionary.entries:
        read = variable(sheet, entry)
        assert (read.data_type, read.access_type) == (entry.type_code, entry.access), entry.name
        assert read.pdo_mappable == bool(entry.map), entry.name
        if entry.bytes:
            assert len(read) == 8 * entry.bytes, entry.name
            assert (read.min, read.max) == (entry.min, entry.max), entry.name
        given = entry.value(NODE)
        assert (read.default or None if given is None else read.default) == given, entry.name
    assert variable(sheet, dictionary["rpdo3_cob_id"]).default == 0x400 + NODE
    assert variable(sheet, dictionary["tpdo2_cob_id"]).default == 0x40000280 + NODE


def test_dbc(dictionary: Dictionary) -> None:
    """`cantools` decodes each PDO, filled at random by the mapping of the source, to the values put in.

    Verifies: CO-01
    """
    seed = random.SystemRandom().getrandbits(32)
    print(f"seed {seed}")
    rng = random.Random(seed)
    database = cantools.database.load_string(dbc(dictionary, NODE), "dbc")
    for pdo in PDOS:
        words = [dictionary[f"{pdo}_mapping_object_{i}"].default for i in range(1, 9)]
        entries = [dictionary.at(int(w) >> 16, int(w) >> 8 & 0xFF) for w in words if w]
        raw = [rng.randint(entry.min, entry.max) for entry in entries]
        data = b"".join(v.to_bytes(e.bytes, "little", signed=e.signed) for v, e in zip(raw, entries, strict=True))
        frame = int(dictionary[f"{pdo}_cob_id"].value(NODE)) & 0x7FF
        message = database.get_message_by_frame_id(frame)
        assert (message.name, message.length) == (pdo.upper(), len(data))
        decoded = database.decode_message(frame, data)
        assert decoded == {e.name: pytest.approx(v * e.scale) for v, e in zip(raw, entries, strict=True)}


def test_dbc_services(dictionary: Dictionary) -> None:
    """The DBC also names NMT, SYNC, EMCY, SDO and heartbeat of the node.

    Verifies: CO-01
    """
    database = cantools.database.load_string(dbc(dictionary, NODE), "dbc")
    found = {message.frame_id: message.name for message in database.messages}
    services = {0: "NMT", 0x80: "SYNC", 0x80 + NODE: "EMCY", 0x700 + NODE: "heartbeat"}
    services |= {0x600 + NODE: "SDO_request", 0x580 + NODE: "SDO_response"}
    assert services.items() <= found.items()
    emcy = database.decode_message(0x80 + NODE, bytes([0x10, 0x23, 0x03, 8, 1, 0, 0, 0]))
    assert emcy == {"code": 0x2310, "register": 3, "fault": 8, "detail": 1}


def test_accessors(dictionary: Dictionary) -> None:
    """A property reads and writes the bytes of its object, in its unit.

    Verifies: CO-01
    """
    module = ModuleType("fluxlock_objects")
    exec(accessors(dictionary), module.__dict__)
    memory: dict[tuple[int, int], bytes] = {}
    objects = module.Objects(lambda i, s: memory[i, s], lambda i, s, data: memory.update({(i, s): data}))
    objects.target_velocity = -60_000
    objects.tpdo1_inhibit_time = 2.5
    objects.device_label = "spindle"
    assert memory == {
        (0x60FF, 0): (-60_000).to_bytes(4, "little", signed=True),
        (0x1800, 3): (25).to_bytes(2, "little"),
        (0x2000, 3): b"spindle",
    }
    assert (objects.target_velocity, objects.tpdo1_inhibit_time, objects.device_label) == (-60_000, 2.5, "spindle")
    for entry in dictionary.entries:
        held = getattr(module.Objects, entry.name)
        assert (held.fset is not None) == (entry.access == "rw"), entry.name


def test_every_fault_has_a_code() -> None:
    """Each fault of the drive has an EMCY code of the standard's classes.

    Verifies: CO-13
    """
    assert len(load_faults()) > 30
    assert all(0x1000 <= fault.emcy < 0x10000 and 1 <= fault.bit <= 7 for fault in load_faults())


def test_page_and_files(tmp_path: Path) -> None:
    """The reference page is the source's, and the command writes EDS, DBC and accessors.

    Verifies: CO-01
    """
    assert command.main(["--check"]) == 0
    names = [path.name for path in command.write_files(tmp_path, 7)]
    assert names == ["fluxlock.eds", "fluxlock-7.dbc", "fluxlock_objects.py"]
    assert all((tmp_path / name).stat().st_size for name in names)


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ('name = "controlword"', 'name = "statusword"', "not unique"),
        ("index = 0x603F", "index = 0x6040", "order"),
        ("default = 10000\nmax = 10000", "default = 10001\nmax = 10000", "default out of range"),
        ("choices = [0, 3, 9, 10]", "choices = [0, 3, 9, 16]", "choice"),
        ('[["controlword"],', '[["controlwort"],', "not there: controlwort"),
        ('type = "i16"', 'type = "i24"', "unknown type i24"),
        ("max = 0x7FFFFF", "max = 0x7FFFFFFFF", "beyond its type"),
    ],
)
def test_contradictions(tmp_path: Path, old: str, new: str, message: str) -> None:
    """A source that contradicts itself is refused with its reason.

    Verifies: CO-01
    """
    text = OBJECTS_FILE.read_text(encoding="utf-8")
    assert old in text
    broken = tmp_path / "objects.toml"
    broken.write_text(text.replace(old, new, 1), encoding="utf-8")
    with pytest.raises(DictionaryError, match=message):
        load_dictionary(broken)


@pytest.mark.parametrize(
    ("line", "name"),
    [
        ("    case OD_OBSERVER_ANGLE:\n", "observer_angle"),
        ("    case OD_CAPTURE_LANES:\n", "capture_lanes"),  # which link_write names too
        ("  if (number == OD_FAULT_TOTAL) {\n", "fault_total"),
        ("number <= OD_RESTART_VALUE", "restart_number, restart_reason, restart_cause, restart_address, restart_value"),
    ],
)
def test_a_live_object_that_nothing_reads_is_named(dictionary: Dictionary, line: str, name: str) -> None:
    """Of a case, of a comparison, of a range: the build says which object would always answer 0.

    Verifies: CO-01
    """
    reader = READER.read_text(encoding="utf-8")
    check_reads(dictionary, reader)
    assert reader.count(line) == 1
    with pytest.raises(DictionaryError, match=f"link_read does not read the object {name}$"):
        check_reads(dictionary, reader.replace(line, ""))
