// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0

// A CAN 2.0B node, bit by bit (ISO 11898-1): what joins the simulated bus to the world outside. Levels: 0 dominant.
//
// level() is what the node sends in the present bit; step() tells it what the bus showed at the sample point and goes on
// to the next bit. Frames in the queue are sent in order, each until it has been acknowledged.
#pragma once
#include <cstddef>
#include <cstdint>
#include <deque>
#include <vector>

struct can_frame_t {
    uint32_t id = 0;  // 11 bits, 29 if ext
    uint8_t ext = 0, rtr = 0;
    uint8_t dlc = 0;  // as on the wire; above 8 there are 8 bytes
    uint8_t data[8] = {};
    int bytes() const { return rtr ? 0 : dlc > 8 ? 8 : dlc; }
};

class can_node_t {
  public:
    std::deque<can_frame_t> queue, received;
    int64_t sent = 0, errors = 0;  // frames acknowledged; errors found
    int tec = 0, rec = 0;
    bool bus_off = false;
    bool between = true;  // an edge before the next bit may restart it: all but the first bit of the space between frames

    int level() const { return level_; }
    bool passive() const { return tec > 127 || rec > 127; }

    void step(int seen) {
        level_ = 1;
        switch (state_) {
            case QUIET: quiet(seen); break;
            case IDLE:
                if (!seen) begin(false, true);
                else if (!queue.empty()) begin(true, false);
                break;
            case BODY: body(seen); break;
            case TAIL: tail(seen); break;
            case FLAG:
                if (seen) fail(8);
                else if (++count_ == 6) enter(WAIT);
                else level_ = 0;
                break;
            case PASSIVE_FLAG: passive_flag(seen); break;
            case WAIT:
                if (seen) enter(DELIMITER);
                else if (++count_ % 8 == 0 || (count_ == 1 && after_error_ && !transmitter_)) punish(8);
                break;
            case DELIMITER:
                if (++count_ == 7) seen ? enter(INTERMISSION) : overload();
                else if (!seen) fail(1);
                break;
            case INTERMISSION: intermission(seen); break;
            case SUSPENDED:
                if (!seen) begin(false, true);
                else if (++count_ == 8) rest();
                break;
        }
    }

  private:
    enum state_t { QUIET, IDLE, BODY, TAIL, FLAG, PASSIVE_FLAG, WAIT, DELIMITER, INTERMISSION, SUSPENDED };
    struct wire_bit_t {
        bool level, arbitration, stuff;
    };
    static constexpr int CRC_BITS = 15;

    state_t state_ = QUIET;
    int level_ = 1;
    int count_ = 0;         // bits of this state so far
    int quiet_runs_ = 0;    // of eleven recessive bits, in bus-off
    bool transmitter_ = false;
    bool after_error_ = false;
    bool unheard_ = false;  // a missing acknowledgement that is not counted yet
    bool good_ = false;     // the checksum was right
    std::vector<wire_bit_t> wire_;  // what the transmitter sends
    size_t at_ = 0;
    std::vector<bool> bits_;  // of the frame so far, without stuff bits
    int run_ = 0;
    bool last_ = true;

    void enter(state_t state) { state_ = state, count_ = 0; }

    static uint32_t checksum(const std::vector<bool>& bits, size_t length) {
        uint32_t crc = 0;
        for (size_t i = 0; i < length; i++) crc = (crc << 1 ^ (((crc >> 14 & 1) != bits[i]) ? 0x4599u : 0u)) & 0x7FFFu;
        return crc;
    }

    uint32_t number(size_t from, size_t count) const {
        uint32_t value = 0;
        for (size_t i = 0; i < count; i++) value = value << 1 | bits_[from + i];
        return value;
    }

    static std::vector<wire_bit_t> encode(const can_frame_t& frame) {
        std::vector<bool> plain, arbitration;
        const auto put = [&](uint32_t value, int count, bool fights) {
            for (int i = count - 1; i >= 0; i--) plain.push_back(value >> i & 1), arbitration.push_back(fights);
        };
        put(0, 1, false);
        if (frame.ext) put(frame.id >> 18, 11, true), put(3, 2, true), put(frame.id & 0x3FFFF, 18, true);
        else put(frame.id, 11, true);
        put(frame.rtr, 1, true);
        put(0, 2, false);
        put(frame.dlc, 4, false);
        for (int i = 0; i < frame.bytes(); i++) put(frame.data[i], 8, false);
        put(checksum(plain, plain.size()), CRC_BITS, false);
        std::vector<wire_bit_t> wire;
        int run = 0;
        for (size_t i = 0; i < plain.size(); i++) {
            run = (!wire.empty() && wire.back().level == plain[i]) ? run + 1 : 1;
            wire.push_back({plain[i], arbitration[i], false});
            if (run == 5) {
                wire.push_back({!plain[i], i + 1 < plain.size() && arbitration[i + 1], true});
                run = 1;
            }
        }
        return wire;
    }

    // Bits from start of frame to checksum, 0 while the frame has not told yet.
    size_t length() const {
        if (bits_.size() < 14) return 0;
        const bool ext = bits_[13];
        const size_t top = ext ? 39 : 19;
        if (bits_.size() < top) return 0;
        const uint32_t dlc = number(top - 4, 4);
        return top + 8 * (bits_[ext ? 32 : 12] ? 0 : dlc > 8 ? 8 : dlc) + CRC_BITS;
    }

    can_frame_t frame() const {
        can_frame_t frame;
        frame.ext = bits_[13];
        const size_t top = frame.ext ? 39 : 19;
        frame.id = frame.ext ? number(1, 11) << 18 | number(14, 18) : number(1, 11);
        frame.rtr = bits_[frame.ext ? 32 : 12];
        frame.dlc = static_cast<uint8_t>(number(top - 4, 4));
        for (int i = 0; i < frame.bytes(); i++) frame.data[i] = static_cast<uint8_t>(number(top + 8 * i, 8));
        return frame;
    }

    // The space between frames goes on with the next own frame or with nothing.
    void rest() {
        if (queue.empty()) transmitter_ = false, enter(IDLE);
        else begin(true, false);
    }

    // A frame begins; `seen`: its start of frame has been on the bus.
    void begin(bool own, bool seen) {
        enter(BODY);
        transmitter_ = own;
        between = false;
        bits_.clear();
        run_ = 0;
        if (own) wire_ = encode(queue.front()), at_ = 0;
        if (seen) take(0), at_ = 1;
        if (own) level_ = wire_[at_].level;
    }

    // A bit of the frame, stuff bits too; false: there was an error.
    bool take(bool seen) {
        if (run_ == 5) {
            if (seen == last_) return fail(1), false;
            run_ = 1;
        } else {
            run_ = (seen == last_ && run_) ? run_ + 1 : 1;
            bits_.push_back(seen);
        }
        last_ = seen;
        return true;
    }

    void body(int seen) {
        if (transmitter_ && seen != wire_[at_].level) {
            const wire_bit_t bit = wire_[at_];
            if (!(bit.arbitration && bit.level)) return fail(1);
            if (bit.stuff) return fail(0);
            transmitter_ = false;
        }
        at_++;
        if (!take(seen)) return;
        const size_t all = length();
        if (all && bits_.size() == all && run_ != 5) {
            good_ = checksum(bits_, all - CRC_BITS) == number(all - CRC_BITS, CRC_BITS);
            enter(TAIL);
        } else if (transmitter_) {
            level_ = wire_[at_].level;
        }
    }

    // Delimiter, acknowledgement, delimiter, end of frame.
    void tail(int seen) {
        const int place = count_++;
        if (place == 1) {
            if (transmitter_) {
                // Passive, it counts only if somebody else is heard during the flag.
                unheard_ = seen && passive();
                if (seen) fail(unheard_ ? 0 : 1);
            } else if (good_) {
                if (seen) fail(1);
                else rec = rec > 127 ? 119 : rec > 0 ? rec - 1 : 0;
            }
            return;
        }
        if (!seen) {
            if (place == 9 && !transmitter_) overload();
            else fail(1);
            return;
        }
        if (place == 0 && !transmitter_ && good_) level_ = 0;
        if (place == 2 && !transmitter_ && !good_) return fail(1);
        if (place == 8 && !transmitter_) received.push_back(frame());
        if (place == 9) {
            if (transmitter_) {
                tec = tec > 0 ? tec - 1 : 0;
                sent++;
                queue.pop_front();
            }
            enter(INTERMISSION);
        }
    }

    void intermission(int seen) {
        const int place = count_++;
        if (place < 2) {
            between = seen;
            if (!seen) overload();
            return;
        }
        const bool suspended = transmitter_ && passive();
        if (!seen) begin(!queue.empty() && !suspended, true);
        else if (suspended) enter(SUSPENDED);
        else rest();
    }

    void quiet(int seen) {
        count_ = seen ? count_ + 1 : 0;
        if (count_ < 11) return;
        count_ = 0;
        if (bus_off && ++quiet_runs_ < 128) return;
        if (bus_off) bus_off = false, tec = rec = 0;
        between = true;
        transmitter_ = false;
        enter(IDLE);
    }

    void passive_flag(int seen) {
        count_ = (count_ && seen == last_) ? count_ + 1 : 1;
        last_ = seen;
        if (unheard_ && !seen) {
            unheard_ = false;
            if (!punish(8)) return;
        }
        if (count_ == 6) unheard_ = false, enter(WAIT);
    }

    void overload() {
        after_error_ = between = false;
        enter(FLAG);
        level_ = 0;
    }

    // Points to the counter that the role says; false: bus-off.
    bool punish(int points) {
        if (!transmitter_) {
            rec = rec + points > 255 ? 255 : rec + points;
        } else if (tec + 8 > 255) {
            bus_off = between = true;
            quiet_runs_ = 0;
            transmitter_ = false;
            level_ = 1;
            enter(QUIET);
            return false;
        } else {
            tec += 8;
        }
        return true;
    }

    // An error; points: for a receiver, 0: nobody's counter moves.
    void fail(int points) {
        errors++;
        const bool silent = passive();
        if (points && !punish(points)) return;
        after_error_ = true;
        between = false;
        enter(silent ? PASSIVE_FLAG : FLAG);
        if (!silent) level_ = 0;
    }
};
