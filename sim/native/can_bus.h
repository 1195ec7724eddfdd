// The CAN bus at the chip's pins: wired-AND of the chip and of nodes of our own, in clocks of the chip, without delays.
//
// Nothing polls: `chip` is called when the chip's pin changes, `run` at `next`. Within a clock the chip's change comes first.
#pragma once
#include <algorithm>
#include <cstdint>
#include <memory>
#include <vector>

#include "can_node.h"

struct can_timing_t {
    int64_t brp = 1;  // clocks a quantum
    int64_t prop = 1, ps1 = 1, ps2 = 1, sjw = 1;  // quanta
};

class can_bus_t {
  public:
    static constexpr int64_t NEVER = INT64_MAX;
    int level = 1;         // 0: dominant
    int64_t next = NEVER;  // run() is due

    // A node whose first bit begins now.
    can_node_t* open(int64_t now, const can_timing_t& timing) {
        members_.push_back(std::make_unique<member_t>());
        member_t& m = *members_.back();
        m.timing = timing;
        m.begin = now;
        m.plan();
        plan();
        return &m.node;
    }

    void chip(int64_t now, int sent) {
        chip_ = sent;
        settle(now);
        plan();
    }

    void run(int64_t now) {
        while (next <= now) {
            member_t* due = first();
            if (due->before_sample) {
                due->node.step(level);
                due->before_sample = false;
                due->armed = level == 1;
            } else {
                start(*due, due->end_at);
            }
            plan();
        }
    }

  private:
    struct member_t {
        can_node_t node;
        can_timing_t timing;
        int sent = 1;
        int64_t begin = 0, sample_at = 0, end_at = 0;  // of the bit
        bool before_sample = true;
        bool hard = true;   // a falling edge restarts the bit
        bool armed = true;  // the last sample was recessive, no synchronisation since
        void plan() {
            sample_at = begin + (1 + timing.prop + timing.ps1) * timing.brp;
            end_at = sample_at + timing.ps2 * timing.brp;
        }
        int64_t due() const { return before_sample ? sample_at : end_at; }
    };
    std::vector<std::unique_ptr<member_t>> members_;
    int chip_ = 1;

    member_t* first() const {
        member_t* found = nullptr;
        for (const auto& m : members_)
            if (!found || m->due() < found->due()) found = m.get();
        return found;
    }

    void plan() {
        const member_t* due = first();
        next = due ? due->due() : NEVER;
    }

    // The next bit begins, at end_at.
    void start(member_t& m, int64_t now) {
        m.begin = m.end_at;
        m.before_sample = true;
        m.hard = m.node.between;
        m.plan();
        m.sent = m.node.level();
        settle(now);
    }

    void settle(int64_t now) {
        const int before = level;
        level = chip_;
        for (const auto& m : members_) level &= m->sent;
        if (before && !level)
            for (const auto& m : members_)
                if (falls(*m, now)) start(*m, now);
    }

    // A node sees a falling edge; true: its bit ends with it.
    static bool falls(member_t& m, int64_t now) {
        if (!m.armed) return false;
        m.armed = false;
        const int64_t place = (now - m.begin) / m.timing.brp;  // quantum of the bit
        if (m.hard) {
            m.end_at = m.begin + place * m.timing.brp;
            return true;
        }
        if (m.before_sample) {
            if (place > 0 && m.sent) m.begin += std::min(place, m.timing.sjw) * m.timing.brp, m.plan();
            return false;
        }
        m.end_at -= std::min((m.end_at - m.begin) / m.timing.brp - place, m.timing.sjw) * m.timing.brp;
        return m.end_at <= now;
    }
};
