# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Stored objects: 0x1010 and 0x1011, power-ups, broken and torn images in the non-volatile memory."""

from __future__ import annotations

import random
import struct
import zlib
from collections.abc import Callable, Iterator

import pytest

from fluxlock.firmware.binding import new, types
from fluxlock.flash.image import pack_can_setup
from fluxlock.generate.memory import FLASH_BLOCK, FLASH_CAN_SETUP, FLASH_SECTOR_BYTES
from tests.canopen.node_bench import NODE, Aborted, NodeBench

SAVE, LOAD = 0x65766173, 0x64616F6C
# Words of an image, as sw/canopen/store.h lists them.
LAYOUT, CRC, SEQUENCE, NODE_ID, VALUES = 1, 2, 3, 4, 5
LABEL_WORDS = 8
WINDOW_DEFAULT = 300
SILENT = 4  # what an emergency says of a sector that does not answer


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
    memory, count = bench.node.memory, image_words(bench)
    return [list(struct.unpack_from(f"<{count}I", memory, at)) for at in (0, FLASH_SECTOR_BYTES)]


def image_words(bench: NodeBench) -> int:
    """Words of an image: header, values, length of the label, label."""
    return VALUES + len(bench.node.dictionary.stored) + 1 + LABEL_WORDS


def put_slots(bench: NodeBench, images: list[list[int]]) -> None:
    sectors = (struct.pack(f"<{len(image)}I", *image) for image in images)
    bench.node.memory = b"".join(sector.ljust(FLASH_SECTOR_BYTES, b"\xff") for sector in sectors)


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
            assert e.name.startswith(("sync_", "emcy_cob", "heartbeat_consumer", "modes", "device_bit_rate")), e.name
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
    bench.write("emcy_cob_id", 1 << 31)
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
    # A motor that the console has started turns too.
    bench.bench.fw.command("set speed_rpm 20000")
    assert bench.bench.fw.command("start") == ["ok"]
    bench.run(0.05)
    assert bench.state == "disabled"
    bench.write("velocity_window", 12)
    refuse("store_parameters_save_all", SAVE, 0x08000022)
    refuse("restore_defaults_restore_all", LOAD, 0x08000022)
    assert window_after_power_up(bench) == 11


def condition(bench: NodeBench) -> tuple[int, int]:
    """Error register and newest entry of the error list."""
    return bench.node.value("error_register"), bench.node.value("error_field_error_1")


WHOLE, COPY, LOST = (0, 0), (0x81, 0x5530), (0x81, 0x6310)


def assert_refuses_to_run(bench: NodeBench) -> None:
    """Lost settings are told, the limits are at their least, no fault reset ends it; a save does."""
    assert condition(bench) == LOST
    assert bench.until("fault", 0.1)
    assert (bench.read("max_current"), bench.read("max_torque"), bench.read("max_profile_velocity")) == (1, 0, 0)
    assert bench.read("error_code") == 0x6310
    told = [struct.unpack_from("<HB", frame) for frame in bench.taken(0x80 + NODE)]
    assert told == [(0x6310, 0x81)]
    for word in (0x80, 6, 7, 15, 0x80):
        bench.write("controlword", word)
        bench.run(0.005)
        assert bench.state == "fault"
    bench.write("max_current", 200)
    save(bench)
    bench.write("controlword", 0)
    bench.write("controlword", 0x80)
    assert bench.until("disabled", 0.1)
    assert bench.node.value("error_register") == 0
    power_up(bench)
    assert (bench.read("max_current"), bench.read("max_profile_velocity")) == (200, 0)
    assert condition(bench) == WHOLE


def test_every_broken_bit(bench: NodeBench) -> None:
    """With any one bit of a copy wrong the other copy holds and EMCY tells it; the next save makes both whole.

    Verifies: CO-15
    """
    bench.write("max_current", 300)
    saved_windows(bench, 11, 12)
    whole = bench.node.memory
    first, second = slots(bench)
    assert first == second and first[SEQUENCE] == 1
    for slot in range(2):
        for bit in range(32 * len(first)):
            memory = bytearray(whole)
            memory[slot * FLASH_SECTOR_BYTES + bit // 8] ^= 1 << bit % 8
            bench.node.memory = bytes(memory)
            bench.node.boot(bench.now_us)
            assert bench.node.value("velocity_window") == 12, (slot, bit)
            assert bench.node.value("max_current") == 300, (slot, bit)
            assert condition(bench) == COPY, (slot, bit)
    bench.frames.clear()
    bench.node.boot(bench.now_us)
    bench.run(0.02)
    assert [frame[:3] for frame in bench.taken(0x80 + NODE)] == [struct.pack("<HB", 0x5530, 0x81)]
    saved_windows(bench, 13)
    bench.run(0.02)
    assert bench.taken(0x80 + NODE) == [struct.pack("<4xI", 0x5530)]
    assert window_after_power_up(bench) == 13
    assert condition(bench) == WHOLE


@pytest.mark.parametrize("layout", [False, True])
def test_lost(bench: NodeBench, layout: bool) -> None:
    """Both copies broken, or of another layout as an upgrade leaves them: no default in silence, no operation.

    Verifies: CO-15
    """
    bench.write("max_current", 300)
    saved_windows(bench, 11)
    memory = bytearray(bench.node.memory)
    for slot in range(2):
        memory[slot * FLASH_SECTOR_BYTES + (4 * LAYOUT + 2 if layout else 4 * place(bench, "max_current"))] ^= 1
    bench.node.memory = bytes(memory)
    bench.bench.fw.boot()
    bench.node.boot(bench.now_us)
    assert bench.node.value("velocity_window") == WINDOW_DEFAULT
    assert_refuses_to_run(bench)


def test_restore_ends_a_loss(bench: NodeBench) -> None:
    """A master that restores the defaults has chosen them: they hold from the next reset on.

    Verifies: CO-15
    """
    saved_windows(bench, 11)
    image, _ = slots(bench)
    put_slots(bench, [[*image[:-1], 1], [*image[:-1], 2]])
    bench.node.boot(bench.now_us)
    assert bench.until("fault", 0.1) and condition(bench) == LOST
    bench.write("restore_defaults_restore_all", LOAD)
    bench.nmt(129)
    assert bench.until("disabled", 0.1)
    assert bench.read("max_current") == 10_000 and condition(bench) == WHOLE


def test_torn_write(bench: NodeBench) -> None:
    """A save that power cuts off after any number of words leaves the image before it, or the new one.

    Verifies: CO-15
    """
    saved_windows(bench, 11, 12)
    old, _ = slots(bench)
    saved_windows(bench, 13)
    new, _ = slots(bench)
    assert (old[SEQUENCE], new[SEQUENCE]) == (1, 2)
    # Its first word goes first and comes last.
    for words in range(1, len(old) + 1):
        torn = [0xFFFFFFFF if words > 1 else 0, *new[1:words], *old[words:]]
        for images, expected in (([old, torn], 13 if torn[1:] == new[1:] else 12), ([torn, new], 13)):
            put_slots(bench, images)
            bench.node.boot(bench.now_us)
            assert bench.node.value("velocity_window") == expected, words
            assert condition(bench) == COPY, words


def worse(newest: list[int], older: list[int]) -> Iterator[tuple[str, list[int]]]:
    """What may become of the newest of two different images: each bit, another layout, two bits of its number."""
    for bit in range(32 * len(newest)):
        broken = list(newest)
        broken[bit // 32] ^= 1 << bit % 32
        yield f"bit {bit}", broken
    yield "layout", [newest[0], newest[1] ^ 0xFFFF, *newest[2:]]
    yield "number", [*newest[:SEQUENCE], newest[SEQUENCE] ^ 0x11, *newest[SEQUENCE + 1 :]]


def test_an_older_image_does_not_stand_for_a_damaged_newer_one(bench: NodeBench) -> None:
    """Power went between the two copies of a save, and the new one, which was in force, is damaged later.

    What it holds is used where all of it can be read; else it is lost: the older limit, a higher one, does not come
    back, and nothing runs.

    Verifies: CO-15
    """
    bench.write("max_current", 900)
    save(bench)
    older, _ = slots(bench)
    bench.write("max_current", 300)
    save(bench)
    newest, _ = slots(bench)
    put_slots(bench, [newest, older])
    power_up(bench)
    assert (bench.read("max_current"), condition(bench)) == (300, COPY)
    used = 0
    for what, broken in worse(newest, older):
        for images in ([broken, older], [older, broken]):
            put_slots(bench, images)
            bench.node.boot(bench.now_us)
            used += condition(bench) == COPY
            assert (bench.node.value("max_current"), condition(bench)) in ((300, COPY), (1, LOST)), what
    assert used == 2 * 32, "a bit of the magic alone leaves an image that can be read"
    bench.node.boot(bench.now_us)
    assert bench.until("fault", 0.1) and condition(bench) == LOST
    bench.write("max_current", 200)
    save(bench)
    power_up(bench)
    assert (bench.read("max_current"), condition(bench)) == (200, WHOLE)


def test_stored_ids_that_are_taken(bench: NodeBench) -> None:
    """Two objects that have come to one CAN-ID, by a new node-ID, or an ID that is reserved: lost by name, no PDO dies.

    Verifies: CO-15, CO-05
    """
    bench.write("sync_cob_id", 0x200 + NODE + 1)
    bench.write("device_node_id", NODE + 1)
    save(bench)
    bench.node.boot(bench.now_us)
    assert bench.until("fault", 0.1)
    told = bench.taken(0x80 + NODE + 1)[0]
    assert told == struct.pack("<HBxBBH", 0x6310, 0x81, 1, 1, 0x1005)
    assert (bench.node.value("sync_cob_id"), bench.node.value("rpdo1_cob_id") & 0x7FF) == (0x80, 0x200 + NODE + 1)
    bench.node.boot(bench.now_us)
    image, _ = slots(bench)
    at = {name: place(bench, name) for name in ("sync_cob_id", "emcy_cob_id", "tpdo1_cob_id", "rpdo1_cob_id")}
    good = sealed(image, lambda words: words.__setitem__(at["sync_cob_id"], 0x80))
    for name, value in (
        ("emcy_cob_id", 0x80),
        ("tpdo1_cob_id", 0x605),
        ("rpdo1_cob_id", 0),
        ("sync_cob_id", 0x80 + NODE),
    ):
        moved = [*good[:4], NODE + 1, *good[5:]]
        put_slots(bench, 2 * [sealed(moved, lambda words, name=name, value=value: words.__setitem__(at[name], value))])
        bench.node.boot(bench.now_us)
        assert condition(bench) == LOST, name
        assert bench.node.value(name) & 0x7FF != value, name


def test_bit_rate_beside_the_parameters(bench: NodeBench) -> None:
    """One that the controller cannot make, or that cannot be read, is told; the stored one or the default holds.

    Verifies: CO-28, CO-15
    """
    default = bench.node.value("device_bit_rate")
    for rate in (800, 333, 0xFFFFFFFF):
        bench.node.lib.fl_can_setup_rate(rate)
        bench.node.boot(bench.now_us)
        assert condition(bench) == LOST and bench.node.value("device_bit_rate") == default, rate
        assert bench.until("fault", 0.1)
        assert bench.taken(0x80 + NODE)[-1] == struct.pack("<HBxBBH", 0x6310, 0x81, 0, 0, 0x2000)
        bench.nmt(130)
        assert condition(bench) == LOST, "a reset of the communication alone ends nothing"
    bench.write("device_bit_rate", 250)
    save(bench)
    bench.node.boot(bench.now_us)
    assert condition(bench) == COPY and bench.node.value("device_bit_rate") == 250
    bench.node.lib.fl_can_setup_rate(500)
    bench.node.boot(bench.now_us)
    assert condition(bench) == WHOLE and bench.node.value("device_bit_rate") == 250
    bench.node.lib.fl_can_setup_rate(0)


def test_images_of_others(bench: NodeBench) -> None:
    """Another layout, a value out of range and an overlong label are lost settings, with a right checksum too.

    Verifies: CO-15
    """
    bench.write("max_current", 300)
    saved_windows(bench, 11)
    image, _ = slots(bench)
    assert image[LAYOUT] == bench.node.dictionary.store_word

    def loaded(change: Callable[[list[int]], None]) -> tuple[int, int, int]:
        put_slots(bench, 2 * [sealed(image, change)])
        bench.node.boot(bench.now_us)
        lost = condition(bench) == LOST
        assert lost or condition(bench) == WHOLE
        assert bench.node.value("max_current") == (1 if lost else 300)
        return bench.node.value("velocity_window"), bench.node.value("quick_stop_option"), int(lost)

    def setting(word: int, value: int) -> Callable[[list[int]], None]:
        return lambda words: words.__setitem__(word, value)

    assert loaded(setting(SEQUENCE, 77)) == (11, 2, 0)
    assert loaded(setting(LAYOUT, image[LAYOUT] ^ 1 << 16)) == (WINDOW_DEFAULT, 2, 1)
    assert loaded(setting(place(bench, "quick_stop_option"), 3)) == (11, 2, 1)
    assert loaded(setting(place(bench, "velocity_window"), 65_536)) == (WINDOW_DEFAULT, 2, 1)
    assert loaded(setting(place(bench, "device_bit_rate"), 333)) == (11, 2, 1)
    assert loaded(setting(-9, 33)) == (WINDOW_DEFAULT, 2, 1)
    for node_id in (0, 128):
        assert loaded(setting(place(bench, "device_node_id"), node_id)) == (11, 2, 1)
        assert bench.node.value("device_node_id") == NODE


def test_sequence_wraps(bench: NodeBench) -> None:
    """The newer of two images is found across the end of the sequence numbers, and the older one is replaced first.

    Verifies: CO-15
    """
    saved_windows(bench, 11)
    old, _ = slots(bench)
    saved_windows(bench, 12)
    new, _ = slots(bench)
    put_slots(
        bench,
        [
            sealed(old, lambda words: words.__setitem__(SEQUENCE, 0xFFFFFFFF)),
            sealed(new, lambda words: words.__setitem__(SEQUENCE, 0)),
        ],
    )
    assert window_after_power_up(bench) == 12
    saved_windows(bench, 13)
    assert [image[SEQUENCE] for image in slots(bench)] == [1, 1]
    assert window_after_power_up(bench) == 13


def objects_after_power_up(bench: NodeBench) -> tuple[int, int]:
    """Two stored objects, one early and one late in the image."""
    bench.node.restore_power()
    bench.node.boot(bench.now_us)
    return bench.node.value("emcy_inhibit_time"), bench.node.value("velocity_window")


def test_power_cut_in_a_save(bench: NodeBench) -> None:
    """Power that goes in the erase or in a page of a save leaves the older or the new objects, all of one image.

    The cells that are cut off hold anything; the flash does not answer any more, so that the write is refused if the
    drive still lives. The next save works.

    Verifies: CO-15
    """
    seed = random.SystemRandom().getrandbits(32)
    print(f"seed {seed}")
    rng = random.Random(seed)
    for value in (11, 12):
        bench.write("emcy_inhibit_time", value)
        bench.write("velocity_window", value)
        save(bench)
    whole = bench.node.memory
    # The first word away, the sector erased, the image, at last its first word.
    bytes_of_slot = 4 + FLASH_SECTOR_BYTES + 4 * image_words(bench)
    ends = [*range(5), FLASH_SECTOR_BYTES + 3, FLASH_SECTOR_BYTES + 4, *range(bytes_of_slot - 5, bytes_of_slot)]
    cuts = sorted(
        {*ends, *(bytes_of_slot + end for end in ends), 2 * bytes_of_slot, *rng.sample(range(2 * bytes_of_slot), 500)}
    )
    seen = set()
    for cut in cuts:
        bench.node.memory = whole
        assert objects_after_power_up(bench) == (12, 12)
        bench.write("emcy_inhibit_time", 13)
        bench.write("velocity_window", 13)
        bench.node.cut_power(cut, rng.getrandbits(32))
        try:
            save(bench)
            done = True
        except Aborted as error:
            assert error.args[0] == 0x06060000
            done = False
        found = objects_after_power_up(bench)
        assert found in ((12, 12), (13, 13)), cut
        assert not done or found == (13, 13), cut
        assert condition(bench) in (WHOLE, COPY), cut
        seen.add((done, found))
    assert seen == {(False, (12, 12)), (False, (13, 13)), (True, (13, 13))}
    bench.write("velocity_window", 14)
    save(bench)
    assert objects_after_power_up(bench)[1] == 14


def test_power_cut_in_a_restore(bench: NodeBench) -> None:
    """Power that goes while the images are forgotten leaves the newest objects or the defaults, never those before.

    Verifies: CO-15
    """
    seed = random.SystemRandom().getrandbits(32)
    print(f"seed {seed}")
    rng = random.Random(seed)
    saved_windows(bench, 10)
    for newest in (11, 12):
        saved_windows(bench, newest)
        whole = bench.node.memory
        seen = set()
        for cut in rng.sample(range(2 * FLASH_SECTOR_BYTES + 8 * image_words(bench)), 200):
            bench.node.memory = whole
            assert objects_after_power_up(bench)[1] == newest
            bench.node.cut_power(cut, rng.getrandbits(32))
            try:
                bench.write("restore_defaults_restore_all", LOAD)
            except Aborted as error:
                assert error.args[0] == 0x06060000
            found = objects_after_power_up(bench)[1]
            assert condition(bench) in ((WHOLE, COPY) if found == newest else (WHOLE, LOST)), cut
            seen.add(found)
        assert seen == {newest, WINDOW_DEFAULT}
        bench.node.memory = whole


@pytest.mark.parametrize("at_boot", [True, False])
def test_flash_that_does_not_answer(bench: NodeBench, at_boot: bool) -> None:
    """A flash that is silent is no blank one: told by its own number, nothing runs, no limit above the stored one.

    A save is refused. When the flash answers again what it holds is
    taken at the next reset.

    Verifies: CO-15
    """
    bench.write("max_current", 300)
    saved_windows(bench, 11)
    bench.node.cut_power(0, 1)
    with pytest.raises(Aborted):
        save(bench)
    bench.frames.clear()
    if at_boot:
        bench.bench.fw.boot()
        bench.node.boot(bench.now_us)
    else:
        bench.nmt(129)
    assert bench.until("fault", 0.1) and condition(bench) == LOST
    assert bench.taken(0x80 + NODE)[0] == struct.pack("<HBxBBH", 0x6310, 0x81, SILENT, SILENT, 0)
    assert bench.read("error_register") == 0x81
    assert bench.read("error_field_error_1") & 0xFFFF == 0x6310
    assert bench.read("max_current") == 1
    assert bench.node.value("velocity_window") == WINDOW_DEFAULT
    for name, word in (("store_parameters_save_all", SAVE), ("restore_defaults_restore_all", LOAD)):
        with pytest.raises(Aborted) as refused:
            bench.write(name, word)
        assert refused.value.args[0] == 0x06060000
    bench.write("controlword", 0x80)
    bench.run(0.05)
    assert bench.state == "fault"
    bench.node.restore_power()
    assert window_after_power_up(bench) == 11
    assert bench.read("max_current") == 300


def test_setup_in_the_flash(bench: NodeBench) -> None:
    """Node-ID and bit rate beside the parameter block are taken if their CRC and range are right.

    Verifies: CO-28
    """
    library = bench.node.lib
    place_of_setup = FLASH_CAN_SETUP - FLASH_BLOCK

    def taken(data: bytes) -> tuple[int, int] | None:
        types().memmove(library.fl_flash_contents() + place_of_setup, data, len(data))
        setup = new("uint32_t[2]", 77, 88)
        if library.flash_can_setup(setup):
            return setup[0], setup[1]
        assert list(setup) == [77, 88]
        return None

    good = pack_can_setup(9, 500)
    assert taken(good) == (9, 500)
    for bit in range(8 * len(good)):
        broken = bytearray(good)
        broken[bit // 8] ^= 1 << bit % 8
        assert taken(bytes(broken)) is None, bit
    assert taken(pack_can_setup(0, 500)) is None
    assert taken(pack_can_setup(128, 500)) is None
    assert taken(b"\xff" * len(good)) is None
