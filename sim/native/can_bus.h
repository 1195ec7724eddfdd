// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0

// The CAN bus at the chip's pins: wired-AND of the chip and of nodes of our own, with delays, clock errors and disturbances.
//
// Times in clocks of the chip; those of nodes lie between two clocks too. Nothing polls: `chip` is called when the chip's
// pin changes, `run` at `next`. What arrives at the instant of a sample counts.
#pragma once
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <memory>
#include <queue>
#include <vector>

#include "can_node.h"

struct can_timing_t {
    int64_t brp = 1;  // clocks a quantum
    int64_t prop = 1, ps1 = 1, ps2 = 1, sjw = 1;  // quanta
    double clock_error = 0.0;  // the node's clock is fast by so much, relative
    double delay = 0.0;        // clocks between the node and the middle of the bus, each way; the chip is in the middle
};

class can_bus_t {
  public:
    static constexpr int64_t NEVER = INT64_MAX;
    int level = 1;         // at the chip's pin; 0: dominant
    int64_t next = NEVER;  // run() is due

    // A node whose first bit begins now.
    can_node_t* open(int64_t now, const can_timing_t& timing) {
        members_.push_back(std::make_unique<member_t>());
        member_t& m = *members_.back();
        m.timing = timing;
        m.quantum = static_cast<double>(timing.brp) / (1.0 + timing.clock_error);
        m.begin = static_cast<double>(now);
        m.plan();
        plan();
        return &m.node;
    }

    void chip(int64_t now, int sent) {
        work(static_cast<double>(now), false);
        chip_ = sent;
        settle(static_cast<double>(now));
        plan();
    }

    // From `start` up to `end`, both to come, the bus has this level whatever is sent.
    void force(int64_t start, int64_t end, int forced) {
        at(static_cast<double>(start), FORCE, nullptr, forced);
        at(static_cast<double>(end), FORCE, nullptr, FREE);
        plan();
    }

    void run(int64_t now) {
        work(static_cast<double>(now), true);
        plan();
    }

  private:
    static constexpr double INF = std::numeric_limits<double>::infinity();
    static constexpr int FREE = -1;
    enum kind_t { ARRIVE, SEE, FORCE };  // a node's level in the middle, the bus's at a node, a disturbance
    struct member_t {
        can_node_t node;
        can_timing_t timing;
        double quantum = 1.0;  // clocks
        int sent = 1;
        int arrived = 1;  // of `sent` in the middle
        int seen = 1;
        double begin = 0, sample_at = 0, end_at = 0;  // of the bit
        bool before_sample = true;
        bool hard = true;   // a falling edge restarts the bit
        bool armed = true;  // the last sample was recessive, no synchronisation since
        void plan() {
            const int64_t before = 1 + timing.prop + timing.ps1;
            sample_at = begin + static_cast<double>(before) * quantum;
            end_at = begin + static_cast<double>(before + timing.ps2) * quantum;
        }
        double due() const { return before_sample ? sample_at : end_at; }
    };
    struct event_t {
        double time;
        int64_t order;
        kind_t kind;
        member_t* member;
        int level;
        bool operator<(const event_t& other) const {  // the queue gives the largest first
            return time != other.time ? time > other.time : order > other.order;
        }
    };
    std::vector<std::unique_ptr<member_t>> members_;
    std::priority_queue<event_t> events_;
    int64_t order_ = 0;
    int chip_ = 1;
    int forced_ = FREE;

    member_t* first() const {
        member_t* found = nullptr;
        for (const auto& m : members_)
            if (!found || m->due() < found->due()) found = m.get();
        return found;
    }

    void at(double time, kind_t kind, member_t* member, int to) { events_.push({time, order_++, kind, member, to}); }

    double due_at() const {
        const member_t* due = first();
        const double own = due ? due->due() : INF;
        return events_.empty() ? own : std::min(own, events_.top().time);
    }

    void plan() {
        const double due = due_at();
        next = due == INF ? NEVER : static_cast<int64_t>(std::ceil(due));
    }

    // Everything before a time, or up to and with it.
    void work(double until, bool with) {
        for (double time = due_at(); time < until || (with && time == until); time = due_at()) {
            if (!events_.empty() && events_.top().time == time) {
                const event_t event = events_.top();
                events_.pop();
                happen(event);
                continue;
            }
            member_t* due = first();
            if (due->before_sample) {
                due->node.step(due->seen);
                due->before_sample = false;
                due->armed = due->seen == 1;
            } else {
                start(*due, due->end_at);
            }
        }
    }

    void happen(const event_t& event) {
        member_t* m = event.member;
        if (event.kind == SEE) {
            m->seen = event.level;
            if (event.level == 0 && falls(*m, event.time)) start(*m, event.time);
            return;
        }
        if (event.kind == ARRIVE) m->arrived = event.level;
        else forced_ = event.level;
        settle(event.time);
    }

    // The next bit begins, at end_at.
    void start(member_t& m, double now) {
        m.begin = m.end_at;
        m.before_sample = true;
        m.hard = m.node.between;
        m.plan();
        if (m.node.level() == m.sent) return;
        m.sent = m.node.level();
        at(now + m.timing.delay, ARRIVE, &m, m.sent);
    }

    void settle(double now) {
        const int before = level;
        level = chip_;
        for (const auto& m : members_) level &= m->arrived;
        if (forced_ != FREE) level = forced_;
        if (level != before)
            for (const auto& m : members_) at(now + m->timing.delay, SEE, m.get(), level);
    }

    // A node sees a falling edge; true: its bit ends with it.
    static bool falls(member_t& m, double now) {
        if (!m.armed) return false;
        m.armed = false;
        const double place = std::floor((now - m.begin) / m.quantum);  // quantum of the bit
        const double jump = static_cast<double>(m.timing.sjw);
        if (m.hard) {
            m.end_at = m.begin + place * m.quantum;
            return true;
        }
        if (m.before_sample) {
            if (place > 0.0 && m.sent) m.begin += std::min(place, jump) * m.quantum, m.plan();
            return false;
        }
        const double early = static_cast<double>(1 + m.timing.prop + m.timing.ps1 + m.timing.ps2) - place;
        m.end_at -= std::min(early, jump) * m.quantum;
        return m.end_at <= now;
    }
};
