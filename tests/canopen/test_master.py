# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""A master that is not ours, the package `canopen`, on a bus of python-can; of the drive it knows the EDS only.

The same tests on the native program and on the chip; with FLUXLOCK_SOCKETCAN=vcan0 over the kernel's bus.
"""

from __future__ import annotations

import itertools
import os
import struct
import threading
import time
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import can
import canopen
import cantools
import pytest
from canopen.profiles.p402 import BaseNode402

from fluxlock.base.paths import BUILD, ROOT
from fluxlock.canopen.dbc import dbc
from fluxlock.canopen.dictionary import load_dictionary
from fluxlock.canopen.eds import eds
from fluxlock.config import load_scenario
from fluxlock.cosim.can_bridge import Bridge, run_on_bus
from fluxlock.cosim.outcome import write_outcome
from fluxlock.firmware import build_canopen_library
from fluxlock.native.drive import NativeDrive
from fluxlock.native.serve import serve
from tests.canopen.node_bench import DRIVE, NODE
from tests.firmware.firmware_bench import Bench

# Real time: a loaded machine may be slow, and the chip is.
PATIENCE_S = 600.0
SOCKETCAN = os.environ.get("FLUXLOCK_SOCKETCAN", "")
CHANNELS = itertools.count()
NATIVE_NODE = NODE + 1  # on a real vcan0 the chip hears all that the native program is sent, and answers late
CHIP_S = 30.0  # simulated, at most
CHIP_RPM = 24_000  # its rotor turns and is caught: a start from rest is another quarter of a second
FAULT_RESET_S = 0.1  # the master waits for it in any case, while the chip runs on
PLOTS = BUILD / "canopen" / "chip"


@dataclass(frozen=True)
class Target:
    """A drive that runs on a bus of python-can, its motor driven by nothing."""

    interface: str
    channel: str
    node: int
    timeout_ms: int  # of what a test waits for in vain, in the drive's time, which is fast or slow beside the master's
    speeds_rpm: tuple[int, int]


def bus_of(name: str) -> tuple[str, str]:
    """Interface and channel of a target."""
    return ("socketcan", SOCKETCAN) if SOCKETCAN else ("virtual", f"{name}-{next(CHANNELS)}")


@pytest.fixture(scope="module")
def native() -> Iterator[Target]:
    """The native program in a thread, as fast as it goes; over before the chip's tests."""
    found = Target(*bus_of("native"), NATIVE_NODE, 100, (20_000, 30_000))
    drive = NativeDrive(Bench(drive=DRIVE, library=build_canopen_library()), NATIVE_NODE)
    end = threading.Event()
    with can.Bus(interface=found.interface, channel=found.channel) as bus:
        thread = threading.Thread(target=serve, args=(drive, bus, end.is_set, None))
        thread.start()
        yield found
        end.set()
        thread.join()


@pytest.fixture(scope="module")
def chip(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Target]:
    """The chip with its bridge, one run for all tests."""
    found = Target(*bus_of("chip"), NODE, 20, (18_000, 20_000))
    scenario = load_scenario(ROOT / "scenarios" / "can.toml", [f"initial.speed_rpm={CHIP_RPM}"])
    folder = tmp_path_factory.mktemp("chip")
    bridges: list[Bridge] = []
    ready = threading.Event()

    def show(bridge: Bridge) -> None:
        bridges.append(bridge)
        ready.set()

    with can.Bus(interface=found.interface, channel=found.channel) as bus, ThreadPoolExecutor(1) as pool:
        run = pool.submit(run_on_bus, scenario, bus, folder, 1, CHIP_S, None, show)
        run.add_done_callback(lambda _: ready.set())
        ready.wait()
        yield found
        if bridges:
            bridges[0].stop()
        data, traffic = run.result()
        print(traffic.text)
        PLOTS.mkdir(parents=True, exist_ok=True)
        write_outcome(data, scenario.model_copy(update={"duration_s": traffic.simulated_s}), PLOTS)
    assert data.overruns == 0
    assert traffic.from_chip > 10  # one test of this file alone has 12


@pytest.fixture(scope="module", params=["native", "chip"])
def target(request: pytest.FixtureRequest) -> Target:
    found: Target = request.getfixturevalue(request.param)
    return found


@pytest.fixture
def network(target: Target) -> Iterator[canopen.Network]:
    net = canopen.Network()
    net.connect(interface=target.interface, channel=target.channel)
    yield net
    net.disconnect()


@pytest.fixture
def node(network: canopen.Network, target: Target, tmp_path: Path) -> BaseNode402:
    """The drive after a reset, in pre-operational."""
    sheet = tmp_path / "fluxlock.eds"
    sheet.write_text(eds(load_dictionary()), encoding="utf-8")
    found = BaseNode402(target.node, canopen.import_od(str(sheet), node_id=target.node))
    network.add_node(found)
    found.sdo.RESPONSE_TIMEOUT = PATIENCE_S
    for name in ("RESET_FAULT", "SWITCH_OP_MODE", "SWITCH_STATE_FINAL", "SWITCH_STATE_SINGLE", "CHECK_TPDO"):
        setattr(found, f"TIMEOUT_{name}", PATIENCE_S if name != "RESET_FAULT" else FAULT_RESET_S)
    reset(found)
    return found


def reset(node: BaseNode402) -> None:
    """Reset of the node, up to its boot-up frame."""
    booted = threading.Event()

    def heard(_: int, data: bytearray, __: float) -> None:
        if data == b"\0":
            booted.set()

    node.network.subscribe(0x700 + node.id, heard)
    node.nmt.state = "RESET"
    assert booted.wait(PATIENCE_S)
    node.network.unsubscribe(0x700 + node.id, heard)


def told(node: BaseNode402, code: int) -> int:
    """Error register of the EMCY with a code, once it has come."""
    wait(lambda: any(error.code == code for error in node.emcy.log), f"EMCY {code:#06x}")
    return next(int(error.register) for error in node.emcy.log if error.code == code)


def wait(condition: Callable[[], Any], what: str) -> None:
    """Until it holds."""
    end = time.monotonic() + PATIENCE_S
    while not condition():
        assert time.monotonic() < end, what
        time.sleep(0.002)


def enable(node: BaseNode402) -> None:
    """To operation enabled by the master's own state machine, which wants the statusword again and again.

    The master of these tests waits for TPDOs in silence, at another pace than the drive's time.
    """
    node.sdo["command_timeout"]["time"].raw = 0
    node.sdo["tpdo1"]["event_timer"].raw = 20
    node.setup_402_state_machine()
    node.nmt.state = "OPERATIONAL"
    wait(lambda: node.nmt.state == "OPERATIONAL", "heartbeat tells operational")
    node.state = "OPERATION ENABLED"
    assert node.state == "OPERATION ENABLED"


def velocity(node: BaseNode402) -> int:
    """Speed that the last TPDO3 has brought, r/min."""
    return int(node.tpdo[3]["velocity_actual"].raw)


def test_from_boot_up_to_a_turning_motor(network: canopen.Network, node: BaseNode402, target: Target) -> None:
    """Boot-up, operation enabled, target by RPDO, speed by TPDO, stop; the DBC decodes every frame that passed.

    Verifies: CO-17
    """
    database = cantools.database.load_string(dbc(load_dictionary(), target.node), "dbc")
    with can.Bus(interface=target.interface, channel=target.channel) as bus:
        recorder = can.BufferedReader()
        notifier = can.Notifier(bus, [recorder])
        assert node.sdo["device_name"].raw == "Fluxlock"
        enable(node)
        node.rpdo[3]["controlword"].raw = 0x0F
        for rpm in target.speeds_rpm:
            node.rpdo[3]["target_velocity"].raw = rpm
            node.rpdo[3].transmit()
            wait(lambda rpm=rpm: abs(velocity(node) - rpm) < 0.01 * rpm, f"{rpm} r/min")
        wait(lambda: node.tpdo[4]["torque_actual"].raw > 0, "torque after the ramp's overshoot")
        assert node.sdo["velocity_actual"].raw == pytest.approx(target.speeds_rpm[1], rel=0.02)
        node.rpdo[3]["target_velocity"].raw = 0
        node.rpdo[3].transmit()
        wait(lambda: velocity(node) == 0, "stop")
        node.state = "SWITCHED ON"
        node.state = "SWITCH ON DISABLED"
        notifier.stop()
    names = set()
    while (message := recorder.get_message(timeout=0)) is not None:
        decoded = database.decode_message(message.arbitration_id, bytes(message.data))
        names.add(database.get_message_by_frame_id(message.arbitration_id).name)
        if message.arbitration_id == 0x380 + target.node:
            assert decoded["velocity_actual"] == struct.unpack_from("<i", message.data, 2)[0]
    assert names >= {"NMT", "SDO_request", "SDO_response", "RPDO3", "TPDO1", "TPDO3", "TPDO4"}


def test_mapping_and_sync(network: canopen.Network, node: BaseNode402) -> None:
    """The master maps a TPDO anew and gets it at its SYNC, with the values that SDO reads.

    Verifies: CO-17
    """
    node.tpdo.read()
    pdo = node.tpdo[2]
    pdo.clear()
    pdo.add_variable("dc_link_voltage")
    pdo.add_variable("fault", "present")
    pdo.add_variable(0x6061)
    pdo.trans_type = 2
    pdo.enabled = True
    pdo.save()
    count = itertools.count()
    pdo.add_callback(lambda _: next(count))
    node.nmt.state = "OPERATIONAL"
    for _ in range(6):
        network.sync.transmit()
    wait(lambda: pdo.timestamp is not None and node.sdo["modes_of_operation"].raw == 3, "TPDO2")
    assert next(count) == 3
    assert len(pdo.data) == 6
    assert pdo[0].raw == pytest.approx(25_000, rel=0.01)
    assert (pdo[1].raw, pdo[2].raw) == (0, 3)


def test_abort_codes(node: BaseNode402) -> None:
    """What the drive refuses comes to the master as the standard's abort codes; strings go in segments.

    Verifies: CO-17
    """

    def refused(code: int, action: Callable[[], Any]) -> None:
        with pytest.raises(canopen.SdoAbortedError) as error:
            action()
        assert error.value.code == code

    refused(0x06020000, lambda: node.sdo.upload(0x5000, 0))
    refused(0x06090011, lambda: node.sdo.upload(0x6041, 3))
    refused(0x06010002, lambda: node.sdo.download(0x6041, 0, b"\0\0"))
    refused(0x06070012, lambda: node.sdo.download(0x6040, 0, b"\0\0\0\0"))
    refused(0x06070013, lambda: node.sdo.download(0x60FF, 0, b"\0"))
    refused(0x06090031, lambda: node.sdo.download(0x60FF, 0, struct.pack("<i", 1_000_001)))
    refused(0x06090032, lambda: node.sdo.download(0x60FF, 0, struct.pack("<i", -1_000_001)))
    refused(0x08000022, lambda: node.sdo.download(0x6060, 0, b"\x0a"))
    text = "axis 3, on the left of the frame"
    node.sdo["device"]["label"].raw = text
    assert node.sdo["device"]["label"].raw == text


def test_fault_and_reset(node: BaseNode402, target: Target) -> None:
    """A master that falls silent: fault by the command timeout, told by EMCY, cleared by the fault reset.

    Verifies: CO-17
    """
    node.sdo["command_timeout"]["reaction"].raw = 1
    enable(node)
    node.sdo["command_timeout"]["time"].raw = target.timeout_ms
    assert told(node, 0x8100) == 0x11
    wait(lambda: node.state == "FAULT", "fault")
    assert node.sdo["error_code"].raw == 0x8100
    node.sdo["command_timeout"]["time"].raw = 0
    node.reset_from_fault()
    assert node.state == "OPERATION ENABLED"
    # The cause ended with the next command, told before or after the reset: until that the state is a fault, bit 0.
    assert told(node, 0) in (0, 1)
    assert node.sdo["error_code"].raw == 0 and node.sdo["error_register"].raw == 0


def test_master_is_watched(network: canopen.Network, node: BaseNode402, target: Target) -> None:
    """The drive watches a heartbeat of the master; when it ends, the drive leaves operational with a fault.

    Verifies: CO-17
    """
    master = 0x7E
    node.sdo["heartbeat_consumer"]["node_1"].raw = master << 16 | 2 * target.timeout_ms
    enable(node)
    for _ in range(5):
        network.send_message(0x700 + master, b"\x05")
        time.sleep(0.001)
    assert told(node, 0x8130) == 0x11
    wait(lambda: node.nmt.state == "PRE-OPERATIONAL", "pre-operational")
    assert node.sdo["error_code"].raw == 0x8130
    assert node.sdo["statusword"].raw & 0x4F == 0x08


def test_store_and_restore(node: BaseNode402) -> None:
    """The master's own commands for 0x1010 and 0x1011.

    Verifies: CO-17
    """
    node.sdo["velocity_window"].raw = 77
    reset(node)
    assert node.sdo["velocity_window"].raw == 300
    node.sdo["velocity_window"].raw = 77
    node.store()
    reset(node)
    assert node.sdo["velocity_window"].raw == 77
    node.restore()
    reset(node)
    assert node.sdo["velocity_window"].raw == 300
