// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0

// The firmware as part of the simulator, in place of the soft core: the C sources as a shared library of this machine.
//
// The firmware is on top: its main() runs on the simulator's stack, and the chip's clock runs inside of each of its register
// accesses, until the bus of the chip has answered, and in cpu_idle. No clock passes elsewhere. Lines that are up at the end
// of an access call their handlers before it returns, nested as trap.S does it; at that place the core would take them too.
// What the library leaves undefined is defined here: reg.h, trap.h and the host's side of cpu.h.
#pragma once
#include <dlfcn.h>

#include <cstdint>
#include <cstdio>
#include <cstdlib>

struct cpu_host_t {
    enum : uint32_t { CURRENT = 1, CONTROL = 2, DEFERRED = 4 };  // core_irq of fl_cpu
    Vtop___024root* chip = nullptr;
    uint32_t* memory = nullptr;  // of the chip, words
    void (*clock)() = nullptr;   // to the next rising edge; does not return at the end of the simulation
    void (*trap_current)() = nullptr;
    void (*trap_control)() = nullptr;
    void (*trap_deferred)() = nullptr;
    bool interruptible = false;  // mstatus.MIE
    uint32_t enabled = 0;        // mie

    uint32_t access(uint32_t address, bool write, uint32_t value) {
        chip->fl_soc__DOT__u_cpu__DOT__host_we = write;
        chip->fl_soc__DOT__u_cpu__DOT__host_adr = (address & 0x7FFFFFFFu) >> 2;
        chip->fl_soc__DOT__u_cpu__DOT__host_wdat = value;
        chip->fl_soc__DOT__u_cpu__DOT__host_stb = 1;
        do {
            clock();
        } while (!chip->fl_soc__DOT__u_cpu__DOT__core_done);
        chip->fl_soc__DOT__u_cpu__DOT__host_stb = 0;
        const uint32_t found = chip->fl_soc__DOT__u_cpu__DOT__core_rdat;
        interrupt();
        return found;
    }

    // The core takes a deferred interrupt before a control one that waits as well, and is interrupted by it at once.
    void interrupt() {
        while (interruptible) {
            const uint32_t before = enabled, up = chip->fl_soc__DOT__u_cpu__DOT__core_irq & enabled;
            if (up == 0) return;
            if (up & CURRENT) {
                interruptible = false;
                trap_current();
            } else if (up & CONTROL) {
                enabled = before & CURRENT;
                trap_control();
            } else {
                enabled = before & ~DEFERRED;
                trap_deferred();
            }
            enabled = before;
            interruptible = true;
        }
    }

    // Boot the firmware of a library and run it to the end of the simulation.
    [[noreturn]] void run(const char* path) {
        void* library = dlopen(path, RTLD_NOW | RTLD_LOCAL);
        if (!library) {
            fprintf(stderr, "error: %s\n", dlerror());
            exit(2);
        }
        const auto symbol = [&](const char* name) { return reinterpret_cast<void (*)()>(dlsym(library, name)); };
        trap_current = symbol("trap_current");
        trap_control = symbol("trap_control");
        trap_deferred = symbol("trap_deferred");
        const auto entry = symbol("main");
        if (!trap_current || !trap_control || !trap_deferred || !entry) {
            fprintf(stderr, "error: %s is no firmware for the chip's bus\n", path);
            exit(2);
        }
        entry();
        fprintf(stderr, "error: the firmware's main has ended\n");
        exit(2);
    }
};

inline cpu_host_t cpu_host;

#define FIRMWARE extern "C" __attribute__((visibility("default"), used))
FIRMWARE uint32_t reg_read(uint32_t address) { return cpu_host.access(address, false, 0); }
FIRMWARE void reg_write(uint32_t address, uint32_t value) { cpu_host.access(address, true, value); }
FIRMWARE uint32_t critical_enter() {
    const uint32_t state = cpu_host.interruptible;
    cpu_host.interruptible = false;
    return state;
}
FIRMWARE void critical_leave(uint32_t state) {
    cpu_host.interruptible = state != 0;
    cpu_host.interrupt();
}
FIRMWARE void trap_enable() {
    cpu_host.enabled = cpu_host_t::CURRENT | cpu_host_t::CONTROL | cpu_host_t::DEFERRED;
    critical_leave(1);
}
FIRMWARE void cpu_idle() {
    cpu_host.clock();
    cpu_host.interrupt();
}
FIRMWARE void* cpu_parameter_block() { return cpu_host.memory + COSIM_BLOCK_WORD; }
FIRMWARE void* cpu_telemetry() { return cpu_host.memory + COSIM_TELEMETRY_WORD; }
FIRMWARE void* cpu_can_setup() { return cpu_host.memory + COSIM_CAN_SETUP_WORD; }
