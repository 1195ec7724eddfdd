// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0

// The core as a programmer sees it, for a debugger and a trace. Reads the model between two clock edges, writes nothing
// into it: a run that is looked at is the same run, bit for bit.
//
// The core retires its instructions in order, from its last stage. When an instruction arrives there, all before it have
// written their registers, and it has written nothing: there the program stands in front of it. A stop waits in that clock;
// neither chip nor motor goes on meanwhile. Stores pass a pipe of two commands on their way to the memory, so the last ones
// are kept here and laid over what the memory holds.
#pragma once
#include <cstdint>
#include <cstdio>
#include <unordered_set>
#include <vector>

class core_probe_t {
  public:
    core_stop_t stop{};

    void attach(Vtop___024root* model, const uint32_t* ram) { root = model, memory = ram; }
    void debug(core_stop_fn fn) { on_stop = fn, halt = fn != nullptr; }
    void resume(int64_t steps) { left = steps; }
    void request() { halt = true; }
    void set_break(uint32_t address, bool on) {
        if (on) breaks.insert(address);
        else breaks.erase(address);
    }
    void set_watch(const core_watch_t& w, bool on) {
        for (size_t i = 0; i < watches.size(); i++)
            if (watches[i].address == w.address && watches[i].size == w.size && watches[i].kinds == w.kinds) {
                watches.erase(watches.begin() + static_cast<ptrdiff_t>(i));
                break;
            }
        if (on) watches.push_back(w);
    }

    // Memory as the program sees it now.
    int32_t read(uint32_t address, uint8_t* bytes, int32_t count) const {
        const int64_t last = static_cast<int64_t>(address) + count;
        if (count < 0 || last > 4ll * COSIM_MEMORY_WORDS) return -1;
        for (int64_t a = address; a < last; a++) bytes[a - address] = byte_of(memory[a / 4], static_cast<uint32_t>(a) & 3);
        for (int i = 0; i < PIPE; i++) {
            const store_t& s = stores[(newest + 1 + i) % PIPE];  // the oldest first
            for (uint32_t k = 0; k < s.size; k++)
                if (s.address + k >= address && s.address + k < last) bytes[s.address + k - address] = byte_of(s.value, k);
        }
        return 0;
    }

    bool trace_into(const char* path, int64_t from, int64_t to) {
        trace_from = from, trace_to = to;
        file = fopen(path, "wb");
        return file != nullptr;
    }
    bool trace_end() {
        if (!file) return true;
        if (row.count) put_row();
        const bool good = !ferror(file), closed = !fclose(file);
        file = nullptr;
        return good && closed;
    }
    core_stack_t deepest{0, UINT32_MAX};

    // After every rising edge.
    void step(int64_t cycle) {
        const bool valid = root->fl_soc__DOT__u_cpu__DOT__u_core__DOT__lastStageIsValid;
        const bool leaves = root->fl_soc__DOT__u_cpu__DOT__u_core__DOT__lastStageIsFiring;
        const uint32_t pc = root->fl_soc__DOT__u_cpu__DOT__u_core__DOT__lastStagePc;
        const bool arrives = valid && (!stays || pc != last_pc);
        stays = valid && !leaves;
        // The data cache sends an instruction back that it could not serve: it comes again, and is the same one.
        const bool again = arrives && !retired && pc == last_pc;
        last_pc = valid ? pc : last_pc;
        retired = valid ? leaves : retired;
        if (on_stop && arrives && !again) arrive(cycle, pc);
        if (leaves) retire(cycle, pc);
    }

  private:
    static constexpr int PIPE = 4;
    struct store_t {
        uint32_t address, value, size;
    };

    Vtop___024root* root = nullptr;
    const uint32_t* memory = nullptr;
    bool stays = false, retired = true;
    uint32_t last_pc = 0;
    // debugger
    core_stop_fn on_stop = nullptr;
    bool halt = false;     // at the next instruction
    int64_t left = 0;      // instructions up to a stop, 0: no end
    bool touched = false;  // the instruction before this one met a watchpoint
    std::unordered_set<uint32_t> breaks;
    std::vector<core_watch_t> watches;
    store_t stores[PIPE] = {};
    int newest = 0;
    // trace
    FILE* file = nullptr;
    core_row_t row{};
    int64_t trace_from = 0, trace_to = INT64_MAX;

    static uint8_t byte_of(uint32_t word, uint32_t k) { return static_cast<uint8_t>(word >> 8 * k); }
    uint32_t x(uint32_t n) const { return n ? root->fl_soc__DOT__u_cpu__DOT__u_core__DOT__RegFilePlugin_regFile[n] : 0; }

    void arrive(int64_t cycle, uint32_t pc) {
        const bool stepped = left && !--left;
        if (halt || stepped || touched || breaks.count(pc)) {
            stop.reason = touched ? CORE_WATCH : breaks.count(pc) ? CORE_BREAK : stepped ? CORE_STEP : CORE_HALT;
            stop.cycle = cycle, stop.pc = pc;
            for (uint32_t n = 0; n < 32; n++) stop.x[n] = x(n);
            halt = touched = false;
            left = 0;
            on_stop();
        }
        if (pc / 4 < COSIM_MEMORY_WORDS) access(memory[pc / 4]);
    }

    // What the instruction that stands at its last stage will read or write.
    void access(uint32_t code) {
        const uint32_t opcode = code & 0x7F, size = 1u << (code >> 12 & 3);
        const bool writes = opcode == 0x23;
        if (!writes && opcode != 0x03) return;
        const int32_t high = static_cast<int32_t>(code) >> 20;
        const uint32_t offset = writes ? static_cast<uint32_t>((high & ~31) | (code >> 7 & 31)) : static_cast<uint32_t>(high);
        const uint32_t address = x(code >> 15 & 31) + offset;
        if (writes) {
            newest = (newest + 1) % PIPE;
            stores[newest] = {address, x(code >> 20 & 31), size};
        }
        for (const core_watch_t& w : watches) {
            if (!(w.kinds & (writes ? CORE_WRITES : CORE_READS)) || address >= w.address + w.size || w.address >= address + size) continue;
            touched = true;
            stop.touched = w.address > address ? w.address : address;
            stop.kinds = w.kinds;
        }
    }

    void retire(int64_t cycle, uint32_t pc) {
        if (!file || cycle < trace_from || cycle > trace_to) return;
        if (const uint32_t sp = x(2); sp && sp < deepest.sp) deepest = {cycle, sp};
        if (row.count && pc == row.pc + 4 * row.count && cycle == row.cycle + static_cast<int64_t>(row.count)) {
            row.count++;
            return;
        }
        if (row.count) put_row();
        row = {cycle, pc, 1};
    }

    void put_row() { fwrite(&row, sizeof row, 1, file); }
};
