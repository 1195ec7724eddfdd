"""Stored objects: 0x1010 and 0x1011, power-ups, broken and torn images in the non-volatile memory."""

from __future__ import annotations

import random
import struct
import zlib
from collections.abc import Callable

import pytest

from tests.canopen.node_bench import NODE, Aborted, NodeBench

SAVE, LOAD = 0x65766173, 0x64616F6C
# Words of an image, as sw/canopen/store.h lists them.
LAYOUT, CRC, SEQUENCE, NODE_ID, VALUES = 1, 2, 3, 4, 5
WINDOW_DEFAULT = 300


def save(bench: NodeBench) -> None:
    bench.write("store_parameters_save_all", SAVE)


def power_up(bench: NodeBench) -> None:
    """Off and on; the memory stays."""
    bench.bench.fw.boot()
    bench.node.boot(bench.now_us)
    assert bench.until("disabled", 0.1)
    bench.frames.clear()


def slots(bench: NodeBench) -> list[list[int]]:
    """Both images as words."""
    memory = bench.node.memory
    words = struct.unpack(f"<{len(memory) // 4}I", memory)
    half = len(words) // 2
    return [list(words[:half]), list(words[half:])]


def put_slots(bench: NodeBench, images: list[list[int]]) -> None:
    bench.node.memory = b"".join(struct.pack(f"<{len(image)}I", *image) for image in images)


def sealed(image: list[int], change: Callable[[list[int]], None]) -> list[int]:
    """An image with a change and the checksum that belongs to it."""
    image = list(image)
    change(image)
    image[CRC] = zlib.crc32(struct.pack(f"<{len(image) - SEQUENCE}I", *image[SEQUENCE:]))
    return image


def place(bench: NodeBench, name: str) -> int:
    """Word of a stored object in an image."""
    return VALUES + [e.name for e in bench.node.dictionary.stored].index(name)


def saved_windows(bench: NodeBench, *windows: int) -> None:
    """Save the velocity window with one value after the other."""
    for window in windows:
        bench.write("velocity_window", window)
        save(bench)


def window_after_power_up(bench: NodeBench) -> int:
    power_up(bench)
    return bench.read("velocity_window")


def test_every_stored_object_survives(bench: NodeBench) -> None:
    """What is marked stored comes back after a power-up, the rest has its default; `load` and a reset bring all back.

    Verifies: CO-15
    """
    seed = random.SystemRandom().getrandbits(32)
    print(f"seed {seed}")
    rng = random.Random(seed)
    entries = [e for e in bench.node.dictionary.entries if e.access == "rw" and e.bytes and not e.live]
    defaults = {e.name: bench.read(e.name) for e in entries}
    written = {}
    for e in entries:
        if e.name.startswith(("rpdo", "tpdo", "store", "restore", "error_field", "device_node", "controlword")):
            continue
        value = rng.choice(e.choices) if e.choices else rng.randint(e.min, e.max)
        try:
            bench.write(e.name, value)
            written[e.name] = value
        except Aborted:
            assert e.name.startswith(("sync_", "emcy_cob", "heartbeat_consumer", "modes")), e.name
    bench.download(0x2000, 3, b"spindle 7, left")
    bench.write("tpdo2_cob_id", 1 << 31 | 0x280 + NODE)
    bench.write("tpdo2_mapping_count", 0)
    bench.write("tpdo2_mapping_object_1", bench.entry("dc_link_voltage").mapping)
    bench.write("tpdo2_mapping_count", 1)
    bench.write("tpdo2_cob_id", 0x280 + NODE)
    save(bench)
    power_up(bench)
    for e in entries:
        if e.name in written:
            expected = written[e.name] if e.store else defaults[e.name]
            assert bench.read(e.name) == expected, e.name
    assert bench.upload(0x2000, 3) == b"spindle 7, left"
    bench.nmt(1)
    bench.run(0.02)
    (told, *_) = bench.taken(0x280 + NODE)
    assert struct.unpack("<I", told)[0] == pytest.approx(25_000, rel=0.01)
    bench.write("restore_defaults_restore_all", LOAD)
    assert bench.upload(0x2000, 3) == b"spindle 7, left", "only the next reset brings the defaults"
    bench.nmt(129)
    bench.idle(0.002)
    assert {e.name: bench.read(e.name) for e in entries} == defaults
    assert bench.upload(0x2000, 3) == b""


def test_reset_of_communication_loads_what_is_stored_below_0x2000(bench: NodeBench) -> None:
    """The rest keeps the values of now.

    Verifies: CO-15
    """
    bench.write("heartbeat_producer", 50)
    bench.write("velocity_window", 7)
    save(bench)
    bench.write("heartbeat_producer", 60)
    bench.write("velocity_window", 8)
    bench.nmt(130)
    bench.idle(0.002)
    assert (bench.read("heartbeat_producer"), bench.read("velocity_window")) == (50, 8)


def test_node_id(bench: NodeBench) -> None:
    """A stored node-ID holds from the next reset on; COB-IDs that were stored under the old one are not taken.

    Verifies: CO-15
    """
    bench.write("emcy_cob_id", 0x90)
    bench.write("emcy_inhibit_time", 33)
    bench.write("device_node_id", 9)
    save(bench)
    assert bench.read("device_node_id") == 9
    bench.nmt(129)
    bench.idle(0.002)
    assert bench.taken(0x709)[0] == b"\0"
    bench.send(0x600 + NODE, bytes.fromhex("4041600000000000"))
    bench.send(0x609, bytes.fromhex("4041600000000000"))
    assert [f.id for f in bench.frames if f.id >= 0x580] == [0x589]
    assert bench.node.value("emcy_cob_id") == 0x89
    assert bench.node.value("emcy_inhibit_time") == 33


def test_refused(bench: NodeBench) -> None:
    """Not while the operation is enabled, not without the signature; a failing memory is told and the old image holds.

    Verifies: CO-15, CO-03
    """
    saved_windows(bench, 11)

    def refuse(name: str, value: int, code: int) -> None:
        with pytest.raises(Aborted) as refused:
            bench.write(name, value)
        assert refused.value.args[0] == code

    refuse("store_parameters_save_all", LOAD, 0x08000020)
    refuse("restore_defaults_restore_all", SAVE, 0x08000020)
    bench.node.fail_memory(True)
    bench.write("velocity_window", 12)
    refuse("store_parameters_save_all", SAVE, 0x06060000)
    refuse("restore_defaults_restore_all", LOAD, 0x06060000)
    bench.node.fail_memory(False)
    bench.enable()
    refuse("store_parameters_save_all", SAVE, 0x08000022)
    refuse("restore_defaults_restore_all", LOAD, 0x08000022)
    assert window_after_power_up(bench) == 11


def test_every_broken_bit(bench: NodeBench) -> None:
    """With any one bit of the newest image wrong the older image is taken, with both broken the defaults.

    Verifies: CO-15
    """
    saved_windows(bench, 11, 12)
    whole = bench.node.memory
    old, new = slots(bench)
    assert (old[SEQUENCE], new[SEQUENCE]) == (0, 1)
    half = len(whole) // 2
    for bit in range(8 * half):
        memory = bytearray(whole)
        memory[half + bit // 8] ^= 1 << bit % 8
        bench.node.memory = bytes(memory)
        bench.node.boot(bench.now_us)
        assert bench.node.value("velocity_window") == 11, bit
    memory[half // 2] ^= 1
    bench.node.memory = bytes(memory)
    assert window_after_power_up(bench) == WINDOW_DEFAULT


def test_torn_write(bench: NodeBench) -> None:
    """A save that power cuts off after any number of words leaves the image before it.

    Verifies: CO-15
    """
    saved_windows(bench, 11, 12)
    first, second = slots(bench)
    saved_windows(bench, 13)
    third, _ = slots(bench)
    assert third[SEQUENCE] == 2
    for words in range(len(first)):
        put_slots(bench, [third[:words] + first[words:], second])
        bench.node.boot(bench.now_us)
        # Behind the last word that differs it is whole.
        expected = 13 if third[words:] == first[words:] else 12
        assert bench.node.value("velocity_window") == expected, words


def test_images_of_others(bench: NodeBench) -> None:
    """Another layout, values out of range and an overlong label are not taken, with a right checksum either.

    Verifies: CO-15
    """
    saved_windows(bench, 11)
    image, empty = slots(bench)
    assert image[LAYOUT] == bench.node.dictionary.store_word

    def loaded(change: Callable[[list[int]], None]) -> tuple[int, int]:
        put_slots(bench, [sealed(image, change), empty])
        bench.node.boot(bench.now_us)
        return bench.node.value("velocity_window"), bench.node.value("quick_stop_option")

    def setting(word: int, value: int) -> Callable[[list[int]], None]:
        return lambda words: words.__setitem__(word, value)

    assert loaded(setting(SEQUENCE, 77)) == (11, 2)
    assert loaded(setting(LAYOUT, image[LAYOUT] ^ 1 << 16)) == (WINDOW_DEFAULT, 2)
    assert loaded(setting(place(bench, "quick_stop_option"), 3)) == (11, 2)
    assert loaded(setting(place(bench, "velocity_window"), 65_536)) == (WINDOW_DEFAULT, 2)
    assert loaded(setting(-9, 33)) == (WINDOW_DEFAULT, 2)
    for node_id in (0, 128):
        assert loaded(setting(place(bench, "device_node_id"), node_id)) == (11, 2)
        assert bench.node.value("device_node_id") == NODE


def test_sequence_wraps(bench: NodeBench) -> None:
    """The newer of two images is found across the end of the sequence numbers, and the older one is replaced.

    Verifies: CO-15
    """
    saved_windows(bench, 11, 12)
    old, new = slots(bench)
    put_slots(
        bench,
        [
            sealed(old, lambda words: words.__setitem__(SEQUENCE, 0xFFFFFFFF)),
            sealed(new, lambda words: words.__setitem__(SEQUENCE, 0)),
        ],
    )
    assert window_after_power_up(bench) == 12
    saved_windows(bench, 13)
    assert [image[SEQUENCE] for image in slots(bench)] == [1, 0]
    assert window_after_power_up(bench) == 13
