// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0

// Simulator main: native clock, native plant. Python (cocotb) sleeps between the events of its scenario.
//
// Two ways of running the same model:
//   cocotb   (default)            the plant kernel is called at gate edges and sample strobes
//   replay   --replay FILE        no Python, no plant: the converter codes, console bytes and pins recorded by an
//                                 earlier run are fed back; prints the time it took as JSON, writes the gate log
#include <algorithm>
#include <cstddef>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <ctime>
#include <memory>
#include <string>
#include <vector>

#include "Vtop.h"
#include "Vtop___024root.h"
#if VM_TRACE
#include "verilated_fst_c.h"
#endif
#include "can_bus.h"
#include "cosim.h"
#include "cosim_chip.h"
#include "verilated.h"
#include "verilated_vpi.h"
#ifdef COSIM_CPU_HOST
#include "cpu_host.h"
#endif
#ifdef COSIM_CORE_PROBE
#include "core_probe.h"
#endif

void Vtop___024root___eval_nba(Vtop___024root*);  // Verilator's: everything that follows from an edge

namespace {

constexpr int64_t NEVER = INT64_MAX;
constexpr int CHANNELS = COSIM_CHANNELS;
constexpr int PHASES = (CHANNELS - 3) / 2;
constexpr int64_t RESET_CYCLES = 10;
constexpr uint64_t HALF_PERIOD = 10;  // time units (ns) in half a clock

uint64_t main_time = 0;

// Single inputs of the chip, all but clock and reset; a force takes them by these names. On a board the codes come by wire,
// and the clocks are among them: one that is forced stands. At which level is all the same to flip-flops.
#ifdef COSIM_BOARD
constexpr bool BOARD = true;
constexpr const char* PIN_NAMES[] = {"fault_pin_i",  "hall_i[0]", "hall_i[1]", "hall_i[2]",  "encoder_i[0]", "encoder_i[1]",
                                     "encoder_i[2]", "uart_rx_i", "can_rx_i",  "spi_miso_i", "-", "locked_i", "clk_i", "osc_i"};
#else
constexpr bool BOARD = false;
constexpr const char* PIN_NAMES[] = {"fault_pin_i",  "hall_i[0]",    "hall_i[1]", "hall_i[2]", "encoder_i[0]", "encoder_i[1]",
                                     "encoder_i[2]", "uart_rx_i",    "can_rx_i",  "spi_miso_i", "adc_valid_i",
                                     "adc_fault_i",  "clock_fault_i"};
#endif
constexpr int PIN_COUNT = sizeof PIN_NAMES / sizeof PIN_NAMES[0];
constexpr int PIN_HALL = 1, PIN_ENCODER = 4, PIN_UART = 7, PIN_CAN = 8, PIN_MISO = 9, PIN_VALID = 10;
constexpr int PIN_ADC_FAULT = 11, PIN_CLOCK_FAULT = 12;           // of the chip
constexpr int PIN_LOCKED = 11, PIN_CLOCK = 12, PIN_OSCILLATOR = 13;  // of a board
constexpr uint32_t PLANT_PINS = 0x7F;  // levels that the plant gives
constexpr uint32_t LOGGED_PINS = 0xF;  // of these, without the encoder's
constexpr uint32_t IDLE_PINS = 1u << PIN_UART | 1u << PIN_CAN | (BOARD ? 1u << PIN_LOCKED : 0);

// A disturbance: a pin has this level, or with level -1 the opposite one, from a cycle up to another.
struct force_t {
    int64_t start, end;
    int pin, level;
};

// Input of the chip that does not come from the plant kernel, as recorded for replay.
struct input_t {
    int64_t cycle;
    int64_t kind;  // 0: console byte starts, 1: pins
    int64_t value;
};

struct recorder_t {
    std::vector<uint16_t> codes;  // CHANNELS a strobe
    std::vector<input_t> inputs;
    bool on = false;
};

struct cosim_t {
    plant_fn fn = nullptr;
    double* state = nullptr;
    int32_t* io = nullptr;
    int64_t* log = nullptr;
    int64_t log_capacity = 0;
    cosim_status_t st{};
    bool log_strobes = false;
    bool log_can = false;
    int32_t gates = 0;
    uint32_t levels = 0;    // of the gate pins: upper ones in bits 0.., lower ones in bits 8..
    uint32_t polarity = 0;  // levels at which all switches are off
    int brake = 0;
    uint32_t driven = IDLE_PINS;  // levels that are driven, a bit a pin
    uint32_t pins = IDLE_PINS;    // and those at the chip
    std::vector<force_t> forces;
    int64_t force_at = NEVER;  // the next start or end of one
    bool clock_held = false, oscillator_held = false;  // clocks of a board that stand
    int enable = 0;        // level of a board's driver enable
    int64_t conversion = 35;
    int64_t valid_at = NEVER;  // adc_valid_i rises after this edge
    int64_t valid_low_at = NEVER;  // and falls after this one
    uint16_t codes[CHANNELS] = {};
    // console
    int64_t bit_time = 50;
    std::string to_chip, from_chip;
    size_t to_chip_pos = 0;
    int rx_bit = -1;  // -1 idle, 0 start, 1..8 data, 9 stop
    int64_t rx_next = NEVER;
    int tx_bit = -1;
    int64_t tx_next = NEVER;
    uint8_t tx_byte = 0;
    int64_t plant_at = NEVER;  // call of the plant kernel for the encoder
    can_bus_t can;
    std::vector<can_node_t*> can_nodes;
    int can_sent = 1;      // by the chip
    int can_pins = 3;      // as last logged
    int64_t next = NEVER;  // earliest of valid_at, valid_low_at, rx_next, tx_next, plant_at, can.next, force_at
    recorder_t rec;
    bool stop = false;
    bool changed = true;  // an input of the chip, or one of its registers from outside, since the model was last settled
};
cosim_t C;
uint32_t* memory = nullptr;  // of the soft core, for cosim_peek
char* model = nullptr;       // the chip's state, for cosim_upset
#ifdef COSIM_CORE_PROBE
core_probe_t probe;
#endif

// Registers of the chip, made from the Verilated model's header by fluxlock/cosim/upsets.py.
struct upset_t {
    const char* name;
    size_t offset;  // in the model, bytes
    int32_t bits;
};
#pragma GCC diagnostic ignored "-Winvalid-offsetof"
#define UPSET(member, bits) {#member, offsetof(Vtop___024root, member), bits},
const upset_t upsets[] = {
#include "upsets.inc"
};

// Replay source: what an earlier run fed into the chip.
struct replay_t {
    std::vector<uint16_t> codes;
    std::vector<input_t> bytes, pins;
    std::vector<int64_t> gate_rows;  // cycle, gates
    size_t code = 0, pin = 0;
    bool on = false;
};
replay_t R;

void plan() {
    C.next = C.valid_at;
    if (C.valid_low_at < C.next) C.next = C.valid_low_at;
    if (C.rx_next < C.next) C.next = C.rx_next;
    if (C.tx_next < C.next) C.next = C.tx_next;
    if (C.plant_at < C.next) C.next = C.plant_at;
    if (C.can.next < C.next) C.next = C.can.next;
    if (C.force_at < C.next) C.next = C.force_at;
    if (R.pin < R.pins.size() && R.pins[R.pin].cycle < C.next) C.next = R.pins[R.pin].cycle;
}

void log_row(int64_t kind, int64_t a, int64_t b) {
    if (!C.log || C.st.log_count >= C.log_capacity) {
        C.st.log_lost += C.log != nullptr;
        return;
    }
    int64_t* row = C.log + 4 * C.st.log_count++;
    row[0] = C.st.cycle;
    row[1] = kind;
    row[2] = a;
    row[3] = b;
}

// Chip time stamp (32 bit, since reset) -> cycle of this log.
int64_t unwrap(const Vtop* t, uint32_t stamp) { return C.st.cycle - static_cast<int32_t>(t->trc_now_o - stamp); }

void put_codes(Vtop* t) {
    auto* words = reinterpret_cast<uint32_t*>(&t->adc_code_i);
    uint64_t acc = 0;
    int bits = 0, w = 0;
    for (int i = 0; i < CHANNELS; i++) {
        acc |= static_cast<uint64_t>(C.codes[i] & 0xFFF) << bits;
        bits += 12;
        if (bits >= 32) {
            words[w++] = static_cast<uint32_t>(acc);
            acc >>= 32;
            bits -= 32;
        }
    }
    if (bits) words[w] = static_cast<uint32_t>(acc);
    C.changed = true;
}

// Levels as driven, with the forces, to the chip.
void put_pins(Vtop* t) {
    uint32_t pins = C.driven;
    for (const force_t& f : C.forces) {
        if (C.st.cycle < f.start) continue;
        const uint32_t bit = 1u << f.pin;
        pins = f.level < 0 ? pins ^ bit : (pins & ~bit) | static_cast<uint32_t>(f.level) << f.pin;
    }
    const uint32_t changed = pins ^ C.pins;
    C.pins = pins;
    C.changed = true;
    t->fault_pin_i = pins & 1;
    t->hall_i = pins >> PIN_HALL & 7;
    t->encoder_i = pins >> PIN_ENCODER & 7;
    t->uart_rx_i = pins >> PIN_UART & 1;
    t->can_rx_i = pins >> PIN_CAN & 1;
    t->spi_miso_i = pins >> PIN_MISO & 1;
#ifdef COSIM_BOARD
    t->locked_i = pins >> PIN_LOCKED & 1;
#else
    t->adc_valid_i = pins >> PIN_VALID & 1;
    t->adc_fault_i = pins >> PIN_ADC_FAULT & 1;
    t->clock_fault_i = pins >> PIN_CLOCK_FAULT & 1;
#endif
    if (changed & LOGGED_PINS) log_row(LOG_PINS, pins & LOGGED_PINS, 0);
    if (C.rec.on && changed & PLANT_PINS) C.rec.inputs.push_back({C.st.cycle, 1, pins & PLANT_PINS});
}

void drive_pins(Vtop* t, uint32_t mask, uint32_t levels) {
    const uint32_t driven = (C.driven & ~mask) | (levels & mask);
    if (driven == C.driven) return;
    C.driven = driven;
    put_pins(t);
}

void drive_pin(Vtop* t, int pin, int level) { drive_pins(t, 1u << pin, static_cast<uint32_t>(level) << pin); }

// Forces that begin and end now.
void force_step(Vtop* t) {
    const auto over = [](const force_t& f) { return f.end <= C.st.cycle; };
    C.forces.erase(std::remove_if(C.forces.begin(), C.forces.end(), over), C.forces.end());
    C.force_at = NEVER;
    C.clock_held = C.oscillator_held = false;
    for (const force_t& f : C.forces) {
        C.force_at = std::min(C.force_at, f.start > C.st.cycle ? f.start : f.end);
        if (!BOARD || f.start > C.st.cycle) continue;
        C.clock_held |= f.pin == PIN_CLOCK;
        C.oscillator_held |= f.pin == PIN_OSCILLATOR;
    }
    put_pins(t);
}

void console_step(Vtop* t) {
    if (C.tx_next <= C.st.cycle) {  // middle of a bit of the chip's transmitter
        const int level = t->uart_tx_o;
        if (C.tx_bit == 0) {
            if (level) C.tx_bit = -1, C.tx_next = NEVER;  // a glitch, not a start bit
            else C.tx_bit = 1, C.tx_next += C.bit_time, C.tx_byte = 0;
        } else if (C.tx_bit <= 8) {
            C.tx_byte = static_cast<uint8_t>(C.tx_byte | level << (C.tx_bit - 1));
            C.tx_bit++;
            C.tx_next += C.bit_time;
        } else {
            if (C.from_chip.size() < (1u << 20)) C.from_chip.push_back(static_cast<char>(C.tx_byte));
            else C.st.uart_lost++;
            C.tx_bit = -1;
            C.tx_next = NEVER;
        }
    }
    if (C.rx_next <= C.st.cycle) {
        if (C.rx_bit < 0 || C.rx_bit > 9) {
            if (R.on && C.to_chip_pos < R.bytes.size() && C.st.cycle < R.bytes[C.to_chip_pos].cycle) {
                C.rx_bit = -1;
                C.rx_next = R.bytes[C.to_chip_pos].cycle;
                return;
            }
            if (C.to_chip_pos < C.to_chip.size()) {
                if (C.rec.on) C.rec.inputs.push_back({C.st.cycle, 0, static_cast<uint8_t>(C.to_chip[C.to_chip_pos])});
                C.rx_bit = 0;
            } else {
                C.to_chip.clear();
                C.to_chip_pos = 0;
                C.rx_bit = -1;
                C.rx_next = NEVER;
            }
        }
        if (C.rx_bit >= 0) {
            const uint8_t byte = static_cast<uint8_t>(C.to_chip[C.to_chip_pos]);
            drive_pin(t, PIN_UART, C.rx_bit == 0 ? 0 : C.rx_bit == 9 ? 1 : (byte >> (C.rx_bit - 1)) & 1);
            if (C.rx_bit == 9) C.to_chip_pos++;
            C.rx_bit++;
            C.rx_next = C.st.cycle + C.bit_time;
        }
    }
}

void can_step(Vtop* t) {
    if (t->can_tx_o != C.can_sent) C.can_sent = t->can_tx_o, C.can.chip(C.st.cycle, C.can_sent);
    C.can.run(C.st.cycle);
    drive_pin(t, PIN_CAN, C.can.level);
    const int pins = C.can_sent | C.can.level << 1;
    if (C.log_can && pins != C.can_pins) C.can_pins = pins, log_row(LOG_CAN, pins, 0);
    plan();
}

void plant_event(Vtop* t, int32_t flags) {
    C.st.events++;
    C.st.edges += flags >> 1 & 1;
    C.st.strobes += flags & 1;
    if (R.on) {
        if (flags & 1) {
            if (R.code + CHANNELS > R.codes.size()) {
                C.stop = true;
                return;
            }
            memcpy(C.codes, &R.codes[R.code], sizeof C.codes);
            R.code += CHANNELS;
        }
    } else if (C.fn) {
        const int32_t before = C.io[IO_HEARTBEAT];
        const int32_t r = C.fn(C.st.cycle, C.gates, flags, C.state, C.io);
        if (r || C.io[IO_HEARTBEAT] != before + 1) {
            C.st.fault = r ? r : -2;
            C.st.t_fault = C.st.cycle;
            C.fn = nullptr;
            C.plant_at = NEVER;
            return;
        }
        if (flags & 1) {
            for (int i = 0; i < CHANNELS; i++) C.codes[i] = static_cast<uint16_t>(C.io[i]);
            if (C.rec.on) C.rec.codes.insert(C.rec.codes.end(), C.codes, C.codes + CHANNELS);
        }
        drive_pins(t, PLANT_PINS, static_cast<uint32_t>(C.io[IO_PINS] | C.io[IO_ENCODER] << PIN_ENCODER));
        C.plant_at = C.io[IO_ENCODER_WAIT] > 0 ? C.st.cycle + C.io[IO_ENCODER_WAIT] : NEVER;
        plan();
    }
    if (flags & 1) C.valid_at = C.st.cycle + C.conversion, plan();
}

inline uint32_t gate_levels(Vtop* t) { return t->gate_h_o | static_cast<uint32_t>(t->gate_l_o) << 8; }

// What the inverter makes of the levels at its pins: bit 2X upper, 2X+1 lower switch of leg X.
int32_t switches(uint32_t levels) {
    const uint32_t on = levels ^ C.polarity;
    int32_t gates = 0;
    for (int x = 0; x < PHASES; x++) gates |= static_cast<int32_t>((on >> x & 1) | (on >> (8 + x) & 1) << 1) << 2 * x;
    return gates;
}

// What the firmware publishes of the drive (telemetry_t, words), as it stands when committed settings take effect.
void log_update() {
    enum { STATE = 4, FAULT = 6, LIMIT = 7, SPEED = 8, REFERENCE = 9, TARGET = 10, LOST_LOCKS = 19 };
    const uint32_t* w = memory + COSIM_TELEMETRY_WORD;
    const uint32_t drive = (w[STATE] & 0xFF) | (w[FAULT] & 0xFF) << 8 | (w[LIMIT] & 0xF) << 16 | (w[LOST_LOCKS] & 0xFFF) << 20;
    const auto pair = [](uint32_t high, uint32_t low) { return static_cast<int64_t>(static_cast<uint64_t>(high) << 32 | low); };
    log_row(LOG_UPDATE, pair(w[SPEED], drive), pair(w[TARGET], w[REFERENCE]));
}

void slow_step(Vtop* t) {
    const bool runs = !C.clock_held;  // a pulse that a clock left standing is no second one
    int32_t flags = t->adc_strobe_o && runs ? 1 : 0;
    C.levels = gate_levels(t);
    if (const int32_t gates = switches(C.levels); gates != C.gates) {
        C.gates = gates;
        flags |= 2;
        log_row(LOG_GATES, C.gates, 0);
        if (R.on) {
            R.gate_rows.push_back(C.st.cycle);
            R.gate_rows.push_back(C.gates);
        }
    }
    const bool brake = t->brake_o != C.brake;
    C.brake = t->brake_o;
    if (flags || brake || C.st.cycle >= C.plant_at) plant_event(t, flags | C.brake << 2);
    if ((flags & 1) && C.log_strobes) log_row(LOG_STROBE, 0, 0);
#ifdef COSIM_BOARD
    if (t->driver_enable_o != C.enable) C.enable = t->driver_enable_o, log_row(LOG_ENABLE, C.enable, 0);
#endif
    if (t->trc_valid_o && runs) {
        if (t->trc_comm_valid_o) log_row(LOG_COMMUTATION, t->trc_sector_o, unwrap(t, t->trc_comm_sched_o));
        if (t->trc_zc_valid_o) log_row(LOG_CROSSING, t->trc_zc_sector_o | t->trc_zc_late_o << 4, unwrap(t, t->trc_zc_time_o));
        if (t->trc_trip_o) log_row(LOG_TRIP, t->trc_trip_cause_o, 0);
        if (t->trc_update_o) log_update();
        if (t->trc_angle_valid_o) log_row(LOG_ANGLE, t->trc_angle_o, memory[COSIM_PUBLISHED_WORD]);
    }
    if (t->can_tx_o != C.can_sent || C.st.cycle >= C.can.next) can_step(t);
    if (C.tx_bit < 0 && !t->uart_tx_o) {
        C.tx_bit = 0;
        C.tx_next = C.st.cycle + C.bit_time / 2;
        plan();
    }
    if (C.st.cycle >= C.next) {
        if (C.st.cycle >= C.valid_low_at) drive_pin(t, PIN_VALID, 0), C.valid_low_at = NEVER;
        if (C.st.cycle >= C.valid_at) {
            put_codes(t);
            drive_pin(t, PIN_VALID, 1);
            C.valid_at = NEVER;
            C.valid_low_at = C.st.cycle + 1;
        }
        while (R.pin < R.pins.size() && R.pins[R.pin].cycle <= C.st.cycle)
            drive_pins(t, PLANT_PINS, static_cast<uint32_t>(R.pins[R.pin++].value));
        console_step(t);
        if (C.st.cycle >= C.force_at) force_step(t);
        plan();
    }
}

// After every rising edge.
inline void after_edge(Vtop* t) {
    C.st.cycle++;
    if (__builtin_expect((gate_levels(t) != C.levels) | (t->brake_o != C.brake) | t->adc_strobe_o | t->trc_valid_o | (C.st.cycle >= C.next) |
                             (t->can_tx_o != C.can_sent) | ((C.tx_bit < 0) & !t->uart_tx_o) |
                             (BOARD && t->driver_enable_o != C.enable), 0))
        slow_step(t);
    if (__builtin_expect(C.st.cycle == RESET_CYCLES, 0)) t->rst_i = 0, C.changed = true;
#ifdef COSIM_CORE_PROBE
    probe.step(C.st.cycle);
#endif
}

// Verilator's eval() works out what depends on inputs in both halves of every clock, and looks for the edges of all clocks
// again after each. This chip has one clock, and its inputs change seldom: here they are looked at when one has changed, and
// the rising edge is what eval() makes of it, alone. plain: as eval() does it, for a debugger that wants to see the clock.
inline void rising_edge(Vtop* t, bool plain) {
    if (BOARD && C.clock_held) return;
    if (plain) {
        t->clk_i = 1;
        t->eval();
        return;
    }
    Vtop___024root* const root = t->rootp;
    root->__VnbaTriggered[0] = 1;
    Vtop___024root___eval_nba(root);
    root->__VnbaTriggered[0] = 0;
}

inline void falling_edge(Vtop* t, bool plain) {
    if (!(plain | C.changed | t->clk_i)) return;
    C.changed = false;
    t->clk_i = 0;
    t->eval();
}

// The rising edges of a board's oscillator up to now, each on its own: it knows nothing of the chip's clock. What clears
// without a clock follows here as well, if the edge before was the chip's.
inline void oscillate(Vtop* t) {
#ifdef COSIM_BOARD
    static int64_t edges = 0;
    constexpr int64_t PERIOD_NS = 1'000'000;  // by its frequency in kHz
    for (; edges * PERIOD_NS < static_cast<int64_t>(main_time) * COSIM_OSCILLATOR_KHZ; edges++) {
        t->rootp->__Vtrigprevexpr___TOP__osc_i__0 = t->osc_i = C.oscillator_held;
        t->osc_i = 1;
        t->eval();
    }
#else
    (void)t;
#endif
}

void power_up(Vtop* t) {
    model = reinterpret_cast<char*>(t->rootp);
    memory = &t->rootp->COSIM_MEMORY[0];
#ifdef COSIM_CORE_PROBE
    probe.attach(t->rootp, memory);
#endif
    t->clk_i = 0;
    t->rst_i = 1;
    put_pins(t);
    put_codes(t);
    t->eval();
}

}  // namespace

double sc_time_stamp() { return static_cast<double>(main_time); }

#define API extern "C" __attribute__((visibility("default"), used))
API void cosim_attach(plant_fn fn, double* state, int32_t* io) {
    C.fn = fn, C.state = state, C.io = io;
    if (io[IO_ENCODER_WAIT] > 0) C.plant_at = C.st.cycle + io[IO_ENCODER_WAIT], plan();
}
API const cosim_status_t* cosim_status() { return &C.st; }
API void cosim_log(int64_t* rows, int64_t capacity) { C.log = rows, C.log_capacity = capacity, C.st.log_count = 0; }
API void cosim_configure(int64_t conversion_cycles, int64_t bit_cycles, int32_t log_strobes, int32_t polarity) {
    constexpr uint32_t legs = (1u << PHASES) - 1;
    C.polarity = (polarity & 1 ? legs : 0) | (polarity & 2 ? legs << 8 : 0);
    C.levels = ~0u;  // looked at anew in the next clock
    C.conversion = conversion_cycles;
    C.bit_time = bit_cycles;
    C.log_strobes = log_strobes != 0;
}
API void cosim_console_send(const char* text, int64_t size) {
    C.to_chip.append(text, static_cast<size_t>(size));
    if (C.rx_next == NEVER) C.rx_next = C.st.cycle + 1, plan();
}
API int64_t cosim_console_take(char* buffer, int64_t size) {
    const int64_t n = std::min<int64_t>(size, static_cast<int64_t>(C.from_chip.size()));
    memcpy(buffer, C.from_chip.data(), static_cast<size_t>(n));
    C.from_chip.erase(0, static_cast<size_t>(n));
    return n;
}
API int32_t cosim_peek(uint32_t address, uint32_t* words, int32_t count) {
    if (!memory || (address & 3) || count < 0 || address / 4 + static_cast<uint32_t>(count) > COSIM_MEMORY_WORDS) return -1;
    memcpy(words, memory + address / 4, 4u * static_cast<uint32_t>(count));
    return 0;
}
API int32_t cosim_upset_memory(uint32_t address, int32_t bit) {
    if (!memory || (address & 3) || address / 4 >= COSIM_MEMORY_WORDS || bit < 0 || bit > 31) return -1;
    memory[address / 4] ^= 1u << bit;
    C.changed = true;
    return 0;
}
API int32_t cosim_upset_count() { return static_cast<int32_t>(sizeof upsets / sizeof upsets[0]); }
API const char* cosim_upset_name(int32_t n) { return upsets[n].name; }
API int32_t cosim_upset_bits(int32_t n) { return upsets[n].bits; }
API int32_t cosim_upset(int32_t n, int32_t bit) {
    if (n < 0 || n >= cosim_upset_count() || bit < 0 || bit >= upsets[n].bits) return -1;
    model[upsets[n].offset + static_cast<size_t>(bit) / 8] ^= static_cast<char>(1 << bit % 8);
    C.changed = true;
    return 0;
}
API uint64_t cosim_upset_value(int32_t n) {
    uint64_t value = 0;
    memcpy(&value, model + upsets[n].offset, std::min<size_t>(sizeof value, static_cast<size_t>(upsets[n].bits + 7) / 8));
    return value;
}
API int32_t cosim_can_open(int32_t brp, int32_t prop, int32_t ps1, int32_t ps2, int32_t sjw, double error, double delay) {
    C.can_nodes.push_back(C.can.open(C.st.cycle, {brp, prop, ps1, ps2, sjw, error, delay}));
    plan();
    return static_cast<int32_t>(C.can_nodes.size()) - 1;
}
API void cosim_can_send(int32_t node, const uint32_t* head, const uint8_t* data) {
    can_frame_t frame;
    frame.id = head[0];
    frame.ext = head[1] != 0, frame.rtr = head[2] != 0;
    frame.dlc = static_cast<uint8_t>(head[3]);
    memcpy(frame.data, data, sizeof frame.data);
    C.can_nodes[static_cast<size_t>(node)]->queue.push_back(frame);
}
API int32_t cosim_can_take(int32_t node, uint32_t* head, uint8_t* data) {
    auto& received = C.can_nodes[static_cast<size_t>(node)]->received;
    if (received.empty()) return 0;
    const can_frame_t frame = received.front();
    received.pop_front();
    head[0] = frame.id, head[1] = frame.ext, head[2] = frame.rtr, head[3] = frame.dlc;
    memcpy(data, frame.data, sizeof frame.data);
    return 1;
}
API void cosim_can_state(int32_t node, can_state_t* state) {
    const can_node_t& n = *C.can_nodes[static_cast<size_t>(node)];
    *state = {static_cast<int64_t>(n.queue.size()), n.sent, n.errors, n.tec, n.rec, n.bus_off};
}
API void cosim_can_force(int64_t start, int64_t end, int32_t level) { C.can.force(start, end, level), plan(); }
API int32_t cosim_pin_count() { return PIN_COUNT; }
API const char* cosim_pin_name(int32_t n) { return PIN_NAMES[n]; }
API int32_t cosim_force_pin(int32_t pin, int32_t level, int64_t cycles) {
    if (pin < 0 || pin >= PIN_COUNT || level < -1 || level > 1 || cycles < 1) return -1;
    const int64_t start = C.st.cycle + 1;
    C.forces.push_back({start, start + cycles, pin, level});
    C.force_at = std::min(C.force_at, start);
    plan();
    return 0;
}
API void cosim_can_log(int32_t on) { C.log_can = on != 0; }
#ifdef COSIM_CORE_PROBE
API void cosim_core_debug(core_stop_fn fn) { probe.debug(fn); }
API const core_stop_t* cosim_core_stop() { return &probe.stop; }
API void cosim_core_break(uint32_t address, int32_t on) { probe.set_break(address, on != 0); }
API void cosim_core_watch(const core_watch_t* watch, int32_t on) { probe.set_watch(*watch, on != 0); }
API void cosim_core_resume(int64_t steps) { probe.resume(steps); }
API void cosim_core_request() { probe.request(); }
API int32_t cosim_core_read(uint32_t address, uint8_t* bytes, int32_t count) { return probe.read(address, bytes, count); }
API int32_t cosim_core_trace(const char* path, int64_t from, int64_t to) { return probe.trace_into(path, from, to) ? 0 : -1; }
API int32_t cosim_core_trace_end(core_stack_t* deepest) {
    *deepest = probe.deepest;
    return probe.trace_end() ? 0 : -1;
}
#endif
API void cosim_record(int32_t on) { C.rec.on = on != 0; }
API int32_t cosim_record_save(const char* path) {
    FILE* f = fopen(path, "wb");
    if (!f) return -1;
    const int64_t head[2] = {static_cast<int64_t>(C.rec.inputs.size()), static_cast<int64_t>(C.rec.codes.size())};
    fwrite(head, sizeof head, 1, f);
    fwrite(C.rec.inputs.data(), sizeof(input_t), C.rec.inputs.size(), f);
    fwrite(C.rec.codes.data(), sizeof(uint16_t), C.rec.codes.size(), f);
    return fclose(f) ? -1 : 0;
}

extern "C" void vlog_startup_routines_bootstrap(void);

namespace {

// Value that follows `name` on the command line.
std::string argument(int argc, char** argv, const char* name, const char* preset) {
    for (int i = 1; i + 1 < argc; i++)
        if (!strcmp(argv[i], name)) return argv[i + 1];
    return preset;
}

// --replay FILE --cycles N --from M --conversion K --bit-time B --gates OUT [--plain 1]: run N cycles, time those after
// cycle M, write the gate log (int64 cycle, gates) to OUT.
int replay(int argc, char** argv) {
    const auto option = [&](const char* name, const char* preset) { return argument(argc, argv, name, preset); };
    FILE* f = fopen(option("--replay", "").c_str(), "rb");
    int64_t head[2];
    if (!f || fread(head, sizeof head, 1, f) != 1) {
        fprintf(stderr, "error: cannot read the recording\n");
        return 2;
    }
    std::vector<input_t> inputs(static_cast<size_t>(head[0]));
    R.codes.resize(static_cast<size_t>(head[1]));
    const bool whole = fread(inputs.data(), sizeof(input_t), inputs.size(), f) == inputs.size() &&
                       fread(R.codes.data(), sizeof(uint16_t), R.codes.size(), f) == R.codes.size();
    fclose(f);
    if (!whole) {
        fprintf(stderr, "error: the recording is cut short\n");
        return 2;
    }
    for (const input_t& in : inputs) (in.kind == 0 ? R.bytes : R.pins).push_back(in);
    for (const input_t& in : R.bytes) C.to_chip.push_back(static_cast<char>(in.value));
    if (!R.bytes.empty()) C.rx_next = R.bytes[0].cycle;
    R.on = true;
    const int64_t cycles = atoll(option("--cycles", "0").c_str()), from = atoll(option("--from", "0").c_str());
    C.conversion = atoll(option("--conversion", "35").c_str());
    C.bit_time = atoll(option("--bit-time", "50").c_str());
    const bool plain = option("--plain", "0") == "1";
    plan();
    Verilated::commandArgs(argc, argv);
    const std::unique_ptr<Vtop> top(new Vtop(""));
    Vtop* t = top.get();
    power_up(t);
    clock_t begin = clock();  // processor time: others may be at work on the machine
    while (C.st.cycle < cycles && !C.stop) {
        rising_edge(t, plain);
        after_edge(t);
        if (__builtin_expect(C.st.cycle == from, 0)) begin = clock();
        falling_edge(t, plain);
    }
    const double cpu = static_cast<double>(clock() - begin) / CLOCKS_PER_SEC;
    const int64_t done = C.st.cycle;
    t->final();
    FILE* out = fopen(option("--gates", "gates.bin").c_str(), "wb");
    if (!out || fwrite(R.gate_rows.data(), sizeof(int64_t), R.gate_rows.size(), out) != R.gate_rows.size() || fclose(out)) {
        fprintf(stderr, "error: cannot write the gate log\n");
        return 2;
    }
    printf("{\"cycles\": %lld, \"from\": %lld, \"cpu_s\": %.6f}\n", static_cast<long long>(done),
           static_cast<long long>(from), cpu);
    return done == cycles ? 0 : 3;
}

bool settle() {
    bool changed, again;
    changed = again = VerilatedVpi::callValueCbs();
    while (again) again = VerilatedVpi::callValueCbs();
    return changed;
}

// The clock, native, and cocotb, woken when it has asked for it. The pin of the clock moves only when cocotb wants to see
// more than the passing of time, or waveforms are written.
struct loop_t {
    Vtop* t;
#if VM_TRACE
    // --waves-from M --waves-to N: waves.fst holds every clock edge of these cycles, and is complete when they are over.
    VerilatedFstC fst;
    int64_t waves_from = 0, waves_to = 0;
#endif
    uint64_t next_edge = HALF_PERIOD, deadline = 0;
    bool rising = true;  // the next edge
    bool woken = true, watch = false, step = false;

    // On to the end of the simulation, `one`: to the next rising edge. false: it is the end.
    bool run(bool one) {
        for (;;) {
            while (next_edge <= deadline && !woken && !Verilated::gotFinish()) {  // edges at the deadline come before Python
                main_time = next_edge;
                next_edge += HALF_PERIOD;
                if (step) VerilatedVpi::callCbs(cbNextSimTime), woken = true;
                const bool risen = rising, plain = VM_TRACE | watch | step;
                rising = !rising;
                oscillate(t);
                if (risen) {
                    rising_edge(t, plain);
                    after_edge(t);
                    if (watch) woken |= VerilatedVpi::callValueCbs();
                } else {
                    falling_edge(t, plain);
                }
#if VM_TRACE
                if (C.st.cycle >= waves_from && C.st.cycle <= waves_to) {
                    if (!fst.isOpen()) fst.open("waves.fst");
                    fst.dump(main_time);
                } else if (fst.isOpen()) {
                    fst.close();
                }
#endif
                if (one && risen) return true;
            }
            if (!woken) {
                if (main_time != deadline) VerilatedVpi::callCbs(cbNextSimTime);
                main_time = deadline;
                settle();
                VerilatedVpi::callTimedCbs();
            }
            settle();
            if (Verilated::gotFinish() || !wait()) return false;
        }
    }

    // What Python has changed, and when it wants to be woken. false: never again.
    bool wait() {
        do {
            do {
                t->eval_step();
                VerilatedVpi::clearEvalNeeded();
                VerilatedVpi::doInertialPuts();
                settle();
            } while (VerilatedVpi::evalNeeded());
            VerilatedVpi::callCbs(cbReadWriteSynch);
            VerilatedVpi::doInertialPuts();
            settle();
        } while (VerilatedVpi::evalNeeded());
        t->eval_end_step();
        VerilatedVpi::callCbs(cbReadOnlySynch);
        deadline = VerilatedVpi::cbNextDeadline();
        watch = VerilatedVpi::hasCbs(cbValueChange), step = VerilatedVpi::hasCbs(cbNextSimTime);
        woken = false;
        return deadline != ~0ULL || watch || step;
    }

    int finish() {
        C.fn = nullptr;
        t->final();
#if VM_TRACE
        if (fst.isOpen()) fst.close();
#endif
        VerilatedVpi::callCbs(cbEndOfSimulation);
        return Verilated::threadContextp()->errorCount() > 0;
    }
};

}  // namespace

int main(int argc, char** argv) {
    for (int i = 1; i < argc; i++)
        if (!strcmp(argv[i], "--replay")) return replay(argc, argv);
    Verilated::commandArgs(argc, argv);
#if VM_TRACE
    Verilated::traceEverOn(true);
#endif
    const std::unique_ptr<Vtop> top(new Vtop(""));
    static loop_t loop;
    loop.t = top.get();
    Verilated::fatalOnVpiError(false);
    vlog_startup_routines_bootstrap();
    Verilated::addExitCb([](void*) { VerilatedVpi::callCbs(cbEndOfSimulation); }, nullptr);
#if VM_TRACE
    loop.t->trace(&loop.fst, 99);
    loop.waves_from = atoll(argument(argc, argv, "--waves-from", "0").c_str());
    loop.waves_to = atoll(argument(argc, argv, "--waves-to", "0").c_str());
#endif
    power_up(loop.t);
    VerilatedVpi::callCbs(cbStartOfSimulation);
#ifdef COSIM_CPU_HOST
    // --firmware FILE: what runs in place of the core.
    cpu_host.chip = loop.t->rootp;
    cpu_host.memory = memory;
    cpu_host.clock = [] {
        C.changed = true;  // what stands in the core's place
        if (!loop.run(true)) exit(loop.finish());
    };
    while (loop.t->rst_i) cpu_host.clock();
    cpu_host.run(argument(argc, argv, "--firmware", "").c_str());
#else
    loop.run(false);
    return loop.finish();
#endif
}
