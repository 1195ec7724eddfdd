# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Shape of the drive: one writing file per field, no call upward, no circle; what is planted fails by name."""

from __future__ import annotations

import shutil

import pytest

from fluxlock.firmware.toolchain import SW
from fluxverify.c_shape import circles, complaints, read_shape

# Source, the text before which something is planted, what is planted, what the check says.
PLANTED = {
    "second-writer": (
        "six_step/regulate.c",
        "HOT void regulate_step(",
        "void spoil_writer(measured_t *m) { m->speed_rpm_q8 = 0; }\n",
        "measured_t.speed_rpm_q8 is written by drive/six_step/measure.c and drive/six_step/regulate.c",
    ),
    "second-writer-through-a-pointer": (
        "six_step/six_step.c",
        "HOT bool six_step_measure(",
        "void spoil_pointer(start_t *s) { int32_t *at = &s->accel_rpm_q20; *at = 0; }\n",
        "start_t.accel_rpm_q20 is written by drive/six_step/six_step.c and drive/six_step/start.c",
    ),
    "second-writer-of-the-report": (
        "vector/injected.c",
        "COLD void vector_injection_off(",
        "void spoil_report(vector_t *v) { v->report.limit = LIMIT_NONE; }\n",
        "report_t.limit is written by drive/vector/injected.c and drive/vector/vector.c",
    ),
    "second-writer-of-the-vector-drive": (
        "vector/frame.c",
        "COLD outcome_t vector_catch(",
        "void spoil_vector(vector_t *v) { v->direction = 0; }\n",
        "vector_t.direction is written by drive/vector/frame.c and drive/vector/vector.c",
    ),
    "second-owner-of-a-section": (
        "six_step/hall.c",
        "HOT hall_advice_t hall_step(",
        "void spoil_owner(sequence_command_t *c) { c->fresh = true; }\n",
        "sequence_command_t.fresh is written by drive/six_step/hall.c and drive/six_step/sequence.c",
    ),
    "upward-call": (
        "six_step/pwm.c",
        "void pwm_off(",
        "const char *drive_state_name(drive_state_t state);\n"
        "const char *spoil_upward(void) { return drive_state_name(STATE_FAULT); }\n",
        "drive/six_step/pwm.c calls drive/drive.c, which is not below it",
    ),
    "upward-include": (
        "../control/ramp.c",
        "void ramp_preset(",
        '#include "drive/drive.h"\n',
        "control/ramp.c includes drive/drive.h, which is not below it",
    ),
    "call-of-the-other-method": (
        "six_step/pwm.c",
        "void pwm_off(",
        "struct vector;\nvoid vector_frame_off(struct vector *v);\nvoid spoil_other(void) { vector_frame_off(0); }\n",
        "drive/six_step/pwm.c calls drive/vector/frame.c, which is not below it",
    ),
    "circle-beside-the-drive": (
        "../console/console_items.c",
        "bool items_print(",
        "void console_init(void);\nvoid spoil_circle(void) { console_init(); }\n",
        "circle of calls: console/console.c console/console_items.c",
    ),
    "mailbox-written-from-outside": (
        "../console/console.c",
        "static const char *command_help(",
        "void spoil_mailbox(app_t *app) { app->drive.settings_fresh = true; }\n",
        "drive_t.settings_fresh is written by console/console.c and drive/drive.c",
    ),
    "console-knows-the-node": (
        "../console/line.c",
        "bool line_add(",
        '#include "canopen/timer.h"\n',
        "console/line.c includes canopen/timer.h, which is not below it",
    ),
    "node-calls-the-console": (
        "../canopen/send.c",
        "bool canopen_send(",
        "void console_receive(uint32_t word);\nvoid spoil_apart(void) { console_receive(0); }\n",
        "canopen/send.c calls console/console.c, which is not below it",
    ),
    "application-knows-an-image": (
        "../app/cycles.c",
        "void cycles_reset(",
        '#include "images/host_main.h"\n',
        "app/cycles.c includes images/host_main.h, which is not below it",
    ),
    "driver-knows-the-drive": (
        "../hal/capture.c",
        "void capture_configure(",
        '#include "drive/faults.h"\n',
        "hal/capture.c includes drive/faults.h, which is not below it",
    ),
    "register-of-another-driver": (
        "../hal/chip_hall.c",
        "HOT void chip_read_hall(",
        "void spoil_driver(void) { reg_write(REG(pwm.duty), 0); }\n",
        "registers of pwm are named by hal/chip_hall.c and hal/chip_pwm.c",
    ),
    "register-in-the-drive": (
        "coast.h",
        "void coast_begin(",
        '#include "hal/reg.h"\n',
        "drive/coast.h names hal/reg.h, of a register",
    ),
    "register-in-the-console": (
        "../console/format.c",
        "void format_u32(",
        '#include "fluxlock_regs.h"\n',
        "console/format.c names fluxlock_regs.h, of a register",
    ),
    "name-of-the-drive": (
        "coast.c",
        "void coast_begin(",
        "typedef struct drive drive_t;\n",
        "drive/coast.c names drive_t",
    ),
    "state-assigned": (
        "drive.c",
        "static void off(",
        "void spoil_assign(drive_t *drive) { drive->order.state = STATE_READY; }\n",
        "spoil_assign assigns order_t.state",
    ),
    "fault-logged": (
        "drive.c",
        "static void off(",
        "void spoil_log(drive_t *drive) { fault_log_add(&drive->log, FAULT_CHIP, 0); }\n",
        "spoil_log calls fault_log_add",
    ),
}


def test_drive_has_the_shape() -> None:
    """The sources as they are.

    Verifies: FW-60
    """
    assert list(complaints(read_shape())) == []


@pytest.fixture(scope="module")
def said(tmp_path_factory: pytest.TempPathFactory) -> list[str]:
    """What the check says of a copy of the sources in which all of it is planted."""
    sw = tmp_path_factory.mktemp("shape") / "sw"
    shutil.copytree(SW, sw)
    for name, before, planted, _ in PLANTED.values():
        source = sw / "drive" / name
        text = source.read_text()
        assert text.count(before) == 1, name
        source.write_text(text.replace(before, planted + before))
    return list(complaints(read_shape(sw), sw))


@pytest.mark.parametrize("case", PLANTED)
def test_planted_fault_is_named(case: str, said: list[str]) -> None:
    """Each is reported by its name.

    Verifies: FW-60
    """
    assert PLANTED[case][3] in said


def test_circles_are_found() -> None:
    """Two that reach each other by a third, one beside them, and one that reaches itself, which is none.

    Verifies: FW-60
    """
    graph = {"a": frozenset("b"), "b": frozenset("c"), "c": frozenset("ad"), "d": frozenset("d")}
    assert circles(graph) == [["a", "b", "c"]]
