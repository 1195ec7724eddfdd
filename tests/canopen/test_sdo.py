# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""The SDO server against a client of its own: reading, writing, segments, abort codes."""

from __future__ import annotations

import random
import re
import struct

import numpy as np
import pytest

from fluxlock.canopen.dictionary import Entry
from fluxlock.canopen.eds import eds
from fluxlock.firmware.binding import view
from fluxlock.native.node import Frame
from tests.canopen.node_bench import NODE, Aborted, NodeBench

# Objects whose writes act, or need more than their range.
SPECIAL = ("store_parameters", "restore_defaults", "error_field", "rpdo", "tpdo", "heartbeat_consumer", "setting")
SPECIAL_NAMES = (
    "sync_cob_id",
    "emcy_cob_id",
    "device_bit_rate",
    "capture_control",
    "capture_lanes",
    "modes_of_operation",
)


def test_every_object_reads_its_default(bench: NodeBench) -> None:
    """Type and default of the source, by SDO.

    Verifies: CO-02
    """
    for e in bench.node.dictionary.entries:
        if e.type == "domain":
            continue
        data = bench.upload(e.index, e.sub)
        if e.bytes:
            assert len(data) == e.bytes, e.name
        default = e.value(NODE)
        if isinstance(default, str):
            assert data.decode() == default, e.name
        elif default is not None and e.access != "ro":
            assert int.from_bytes(data, "little", signed=e.signed) == default, e.name
    assert bench.read("device_node_id") == NODE
    assert bench.read("profile_acceleration") == 400_000
    assert bench.read("rated_current") == 22_500
    assert bench.read("max_motor_speed") == 100_000
    assert bench.read("error_field_count") == 0


def plain(e: Entry) -> bool:
    """A number that keeps what is written."""
    return e.access == "rw" and bool(e.bytes) and not e.name.startswith(SPECIAL) and e.name not in SPECIAL_NAMES


def test_ranges(bench: NodeBench) -> None:
    """Ends of the range and random values within are kept; beyond it the abort code says on which side.

    Verifies: CO-02, CO-03
    """
    seed = random.SystemRandom().getrandbits(32)
    print(f"seed {seed}")
    rng = random.Random(seed)
    tried = [e for e in bench.node.dictionary.entries if plain(e)]
    assert len(tried) > 25
    for e in tried:
        values = e.choices or (e.min, e.max, rng.randint(e.min, e.max))
        for value in values:
            bench.write(e.name, value)
            assert bench.read(e.name) == value, e.name
        low, high = (-(1 << 8 * e.bytes - 1), (1 << 8 * e.bytes - 1) - 1) if e.signed else (0, (1 << 8 * e.bytes) - 1)
        wrong = [(value, 0x06090030) for value in range(16) if e.choices and value not in e.choices]
        wrong += [(e.max + 1, 0x06090031), (high, 0x06090031)] if e.max < high else []
        wrong += [(e.min - 1, 0x06090032), (low, 0x06090032)] if e.min > low else []
        for value, code in wrong:
            with pytest.raises(Aborted) as refused:
                bench.write(e.name, value)
            assert refused.value.args[0] == code, (e.name, value)
            assert bench.read(e.name) == values[-1], e.name


@pytest.mark.parametrize(
    ("request_hex", "code"),
    [
        ("40 00 50 00", 0x06020000),  # no such object
        ("40 FF FF 00", 0x06020000),
        ("40 00 00 00", 0x06020000),
        ("40 18 10 05", 0x06090011),  # no such sub-index
        ("40 40 60 01", 0x06090011),
        ("2B 01 50 00 01 00", 0x06020000),
        ("2B 41 60 00 01 00", 0x06010002),  # read only
        ("23 00 10 00 01 00 00 00", 0x06010002),  # constant
        ("2F 40 60 00 06", 0x06070013),  # one byte for two
        ("23 40 60 00 06 00 00 00", 0x06070012),  # four bytes for two
        ("27 FF 60 00 06 00 00", 0x06070013),  # three for four
        ("21 40 60 00 03 00 00 00", 0x06070012),  # announced in segments
        ("21 FF 60 00 02 00 00 00", 0x06070013),
        ("21 00 20 03 21 00 00 00", 0x06070012),  # 33 bytes of label
        ("23 10 10 01 73 61 76 66", 0x08000020),  # "save" misspelt
        ("23 11 10 01 73 61 76 65", 0x08000020),
        ("2F 60 60 00 0A", 0x08000022),  # torque without the current loop
        ("2F 60 60 00 FF", 0x06090030),
        ("2F 03 10 00 01", 0x06090031),
        ("23 16 10 01 64 00 00 00", 0x06090030),  # consumer of node 0
        ("23 05 10 00 05 06 00 00", 0x06090030),  # a reserved CAN-ID for SYNC
        ("23 14 10 00 00 00 00 20", 0x06090030),  # extended EMCY
        ("40 30 20 04", 0x08000024),  # nothing captured
        ("2F 20 20 01 03", 0x06090030),  # no such commutation
        ("A0 40 60 00", 0x05040001),  # block upload
        ("C2 40 60 00", 0x05040001),  # block download
        ("E0 00 00 00", 0x05040001),
        ("60", 0x05040001),  # a segment of nothing
        ("00", 0x05040001),
    ],
)
def test_aborts(bench: NodeBench, request_hex: str, code: int) -> None:
    """Each wrong request has its abort code at the place that it named, and nothing has changed.

    Verifies: CO-03
    """
    request = bytes.fromhex(request_hex).ljust(8, b"\0")
    before = [bench.node.value(e.name) for e in bench.node.dictionary.entries if not e.name.startswith("counter")]
    bench.send(0x600 + NODE, request)
    (reply,) = bench.taken(0x580 + NODE)
    assert reply == b"\x80" + request[1:4] + struct.pack("<I", code)
    assert before == [
        bench.node.value(e.name) for e in bench.node.dictionary.entries if not e.name.startswith("counter")
    ]
    assert bench.read("counter_sdo_aborts") == 1


@pytest.mark.parametrize("length", range(8))
def test_short_frames(bench: NodeBench, length: int) -> None:
    """A request of less than eight bytes is aborted, at the place as far as it came.

    Verifies: CO-03
    """
    request = bytes.fromhex("2B40600006000000")
    bench.send(0x600 + NODE, request[:length])
    (reply,) = bench.taken(0x580 + NODE)
    assert reply == b"\x80" + request[1:4][: max(0, length - 1)].ljust(3, b"\0") + struct.pack("<I", 0x05040001)
    assert bench.read("controlword") == 0


@pytest.mark.parametrize("sized", [False, True])
@pytest.mark.parametrize("text", ["", "a", "abcd", "abcdefg", "abcdefgh", "x" * 32])
def test_segments(bench: NodeBench, text: str, sized: bool) -> None:
    """The label is written and read in segments.

    Verifies: CO-04
    """
    bench.download(0x2000, 3, text.encode(), segmented=True, sized=sized)
    assert bench.upload(0x2000, 3).decode() == text
    assert bench.upload(0x1008).decode() == "Fluxlock"


def test_numbers_in_segments(bench: NodeBench) -> None:
    """A number may come in a segment, and expedited without its size.

    Verifies: CO-04
    """
    bench.download(0x60FF, 0, struct.pack("<i", -40_000), segmented=True)
    assert bench.read("target_velocity") == -40_000
    bench.download(0x6060, 0, b"\x09", sized=False)
    assert bench.read("modes_of_operation") == 9


def test_broken_segments(bench: NodeBench) -> None:
    """Wrong toggle bit, more or less than announced, more than the object holds: aborted, the label as it was.

    Verifies: CO-03
    """
    bench.download(0x2000, 3, b"before")

    def broken(length: int | None, segments: list[str], code: int) -> None:
        head = struct.pack("<BHBI", 0x21 if length is not None else 0x20, 0x2000, 3, length or 0)
        assert bench.exchange(head)[0] == 0x60
        for segment in segments[:-1]:
            bench.exchange(bytes.fromhex(segment).ljust(8, b"a"))
        with pytest.raises(Aborted) as refused:
            bench.exchange(bytes.fromhex(segments[-1]).ljust(8, b"a"))
        assert refused.value.args[0] == code
        assert bench.upload(0x2000, 3) == b"before"

    broken(None, ["10"], 0x05030000)
    broken(None, ["00", "00"], 0x05030000)
    broken(10, ["00", "10"], 0x06070012)
    broken(10, ["01"], 0x06070013)
    broken(None, ["00", "10", "00", "10", "00"], 0x06070012)
    bench.exchange(struct.pack("<BHB4x", 0x40, 0x2000, 3))
    with pytest.raises(Aborted) as refused:
        bench.exchange(bytes([0x70, *bytes(7)]))
    assert refused.value.args[0] == 0x05030000


def test_transfer_left(bench: NodeBench) -> None:
    """A new request, or an abort by the client, ends the transfer before.

    Verifies: CO-04
    """
    bench.exchange(struct.pack("<BHBI", 0x21, 0x2000, 3, 20))
    assert bench.upload(0x1008) == b"Fluxlock"
    with pytest.raises(Aborted):
        bench.exchange(bytes(8))
    bench.exchange(struct.pack("<BHB4x", 0x40, 0x1008, 0))
    bench.send(0x600 + NODE, bytes.fromhex("80 08 10 00 00 00 00 08"))
    assert bench.taken(0x580 + NODE) == []
    with pytest.raises(Aborted):
        bench.exchange(bytes([0x60, *bytes(7)]))


LABEL, OTHER = bytes(range(65, 65 + 32)), b"of the master's next life"


@pytest.mark.parametrize("way", ["download", "upload"])
@pytest.mark.parametrize("byte", range(len(LABEL) + 1))
def test_master_that_restarts_in_a_transfer(bench: NodeBench, way: str, byte: int) -> None:
    """A master dies after each byte of a segmented transfer and begins anew: whole values only, nothing goes on.

    A segment of a download holds one byte here. An upload has whole ones, the restart is in the one with the byte.

    Verifies: CO-04
    """
    bench.download(0x2000, 3, b"before" if way == "download" else LABEL)
    if way == "download":
        assert bench.exchange(struct.pack("<BHBI", 0x21, 0x2000, 3, len(LABEL)))[0] == 0x60
        for k in range(byte):
            bench.exchange(bytes([(k & 1) << 4 | 6 << 1 | (k + 1 == len(LABEL)), LABEL[k], *bytes(6)]))
    else:
        assert bench.exchange(struct.pack("<BHB4x", 0x40, 0x2000, 3))[0] == 0x41
        for k in range(-(-byte // 7)):
            bench.exchange(bytes([0x60 | (k & 1) << 4, *bytes(7)]))
    now = LABEL if way == "upload" or byte == len(LABEL) else b"before"
    bench.node.receive(Frame(0, bytes([1, NODE])))
    assert bench.upload(0x2000, 3) == now
    bench.download(0x2000, 3, OTHER)
    assert bench.upload(0x2000, 3) == OTHER
    for left in (0x00, 0x10, 0x60, 0x70):
        with pytest.raises(Aborted) as refused:
            bench.exchange(bytes([left, *bytes(7)]))
        assert refused.value.args[0] == 0x05040001
    assert bench.read("velocity_window") == 300


@pytest.mark.parametrize("begin", ["c6", "c4", "a0", "a4"])
@pytest.mark.parametrize("frames", [0, 1, 5])
def test_block_transfers_are_refused(bench: NodeBench, begin: str, frames: int) -> None:
    """A master that begins a block transfer, and one that goes on with it, gets an abort at each frame.

    Verifies: CO-03
    """
    bench.download(0x2000, 3, b"before")
    requests = [bytes.fromhex(begin) + struct.pack("<HBI", 0x2000, 3, 21)]
    requests += [bytes([0xA3 if begin[0] == "a" else 0x80 | 0x40 | k, *b"seventh"]) for k in range(1, frames + 1)]
    for request in requests:
        with pytest.raises(Aborted) as refused:
            bench.exchange(request)
        assert refused.value.args[0] == 0x05040001
    assert bench.upload(0x2000, 3) == b"before"


def test_capture_buffer(bench: NodeBench) -> None:
    """Control and lanes reach the registers; a finished capture is uploaded record by record.

    Verifies: CO-04
    """
    hardware = bench.bench
    bench.write("capture_lanes", 0x0C020100)
    bench.write("capture_control", 0x00100205)
    assert hardware.get("capture.lanes") == 0x0C020100
    assert hardware.get("capture.control") == 0x00100205
    records = view(hardware.fw.lib.fl_host_capture(), 3 * 4, np.int32).reshape(3, 4)
    records[:] = -np.arange(1, 13).reshape(3, 4)
    hardware.put("capture.status", 3 << 16 | 2)
    assert bench.upload(0x2030, 4) == records.tobytes()
    assert hardware.get("capture.read_address") == 2


def test_settings(bench: NodeBench) -> None:
    """The console's settings are read from the drive and set in it, with the console's checks.

    Verifies: CO-02
    """
    for name, value, shown in (
        ("setting_commutation", 0, "commutation RSC"),
        ("setting_carrier_hz", 25_000, "carrier_hz 25000"),
        ("setting_advance_q16", -1092, "advance_q16 -1092"),
        ("setting_current_loop", 1, "current_loop 1"),
    ):
        bench.write(name, value)
        assert bench.read(name) == value
        assert bench.bench.fw.command(f"get {shown.split()[0]}")[0] == shown
    with pytest.raises(Aborted) as refused:
        bench.write("setting_carrier_hz", 1)
    assert refused.value.args[0] == 0x06090030


def test_bit_rates(bench: NodeBench) -> None:
    """A bit rate of which the clock has no whole bits is refused and the one before stays; the EDS names what is taken.

    Verifies: CO-20
    """
    sheet = eds(bench.node.dictionary)
    rates = {int(rate): named == "1" for rate, named in re.findall(r"^BaudRate_(\d+)=(\d)$", sheet, re.MULTILINE)}
    assert len(rates) == 8
    for rate, named in (rates | {333: False, 999: False}).items():
        if named:
            bench.write("device_bit_rate", rate)
            assert bench.read("device_bit_rate") == rate
            continue
        before = bench.read("device_bit_rate")
        with pytest.raises(Aborted) as refused:
            bench.write("device_bit_rate", rate)
        assert refused.value.args[0] == 0x06090030, rate
        assert bench.read("device_bit_rate") == before
