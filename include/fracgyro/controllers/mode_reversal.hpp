// Mode reversal: a force-rebalance gyroscope whose drive axis changes by 90° in regular intervals, so that the dampers'
// bias changes its sign.
//
// Use it when force rebalance has little enough noise, but too much bias from the dampers.
//
//    All of force rebalance runs in axes turned by ϑ_c, which is ϑ₀ for an interval, ϑ₀ + 90° for the next, and so on:
//
//        q′ = R(-ϑ_c) q        u = R(ϑ_c) u′        s₀ (Ωz + b)        s₉₀ (Ωz - b)        b = p sin 2(ϑ_τ - ϑ₀)
//        Ω̂z = s - b̂ at ϑ₀        Ω̂z = s + b̂ at ϑ₀ + 90°        b̂ = ½(s̄₀ - s̄₉₀)
//
//    s̄ are the means of the last two intervals without their settling times, in which the estimate is held. Over two
//    intervals the mean is ½(s₀ + s₉₀): of b it leaves ½b times the difference of the scale factors. In between, the
//    vibration is swung at a rate, which a high quality factor needs, or it is stopped on one axis and started on
//    the other. A first angle ϑ₀ at the dampers' axis has no bias.
//
// Source: sign reversal of the rate's bias: Microsystems and Nanoengineering 2025, s41378-025-01011-4 (abstract read).
#pragma once

#include "fracgyro/controllers/conventional.hpp"

namespace fracgyro {

struct ModeReversalParams {
    RebalanceParams held{};
    double interval = 20000.0;  // in units of 1/ω₀, as the next but the rate
    double settling = 2000.0;
    double swing_rate = 0.0;
    double start_angle = 0.0;

    static constexpr auto fields() {
        using P = ModeReversalParams;
        return Fields{
            Inner{"controller", &P::held},
            fixed(field("reversal_interval", &P::interval, "1/omega0", above_0,
                        "Unit 1/omega0, > 0: time at each of the two angles.")),
            fixed(field("settling_time", &P::settling, "1/omega0", at_least_0,
                        "Unit 1/omega0: time after each change in which the rate is not read.")),
            fixed(field("swing_rate", &P::swing_rate, "omega0", at_least_0,
                        "Unit omega0: rate at which the vibration is turned from one angle to the other. 0.0: it is "
                        "stopped on one axis and started on the other.")),
            fixed(field("start_angle", &P::start_angle, "rad", any_number,
                        "rad: angle of the vibration's line at the start.")),
        };
    }
};

template <Scalar T>
struct ModeReversalReport : ConventionalReport<T> {
    T angle{}, bias{};

    static constexpr auto fields() {
        using R = ModeReversalReport;
        return joined(
            ConventionalReport<T>::fields(),
            Fields{channel("pattern_angle", &R::angle, "rad", "angle of the vibration's line from x, from -pi to pi"),
                   channel("reversed_bias", &R::bias, "omega0",
                           "bias of the rate at the first angle, minus that at the other")});
    }
};

template <Scalar T>
struct ModeReversal {
    using Value = T;
    using Params = ModeReversalParams;
    using Report = ModeReversalReport<T>;
    using Held = ConventionalGyroscope<T, true>;
    using Phase = PhaseOf<T>;
    static constexpr bool measures_velocity = false;
    static constexpr bool drives_a_sine = true;  // along the angle, at the frequency of the reference of x

    // Steps at an angle, of a swing, and of settling; phases in 2^-64 turns.
    struct Coefficients {
        typename Held::Coefficients held{};
        std::uint64_t interval = 1, swing = 0, settling = 0, per_step = 0;
        typename Phase::Type start{};
    };
    struct State {
        typename Held::State held{};
        std::uint64_t place = 0, read = 0;  // steps in this cycle, and of those that the sum has
        LongSum<T> sum{};
        T first{}, other{}, known{};  // the last means, and how many there are, up to 2
        Vec2<T> kept{};               // detuning and force of the other angle's drive
        T rate{}, bias{};
    };

    static Coefficients prepare(const Params& p, const Common& common) {
        const auto steps = [&](double time) {
            return static_cast<std::uint64_t>(minimum(time / common.step, 1e15) + 0.5);
        };
        constexpr double right_angle = 1.57079632679489661923;
        const std::uint64_t interval = steps(p.interval), most = interval > 0 ? interval : 1;
        const std::uint64_t swings = p.swing_rate > 0.0 ? steps(right_angle / p.swing_rate) : 0;
        const std::uint64_t settling = steps(p.settling);
        auto held = Held::prepare(p.held, common);
        held.drive.least_force = -held.drive.limit;  // it may brake
        return {.held = held,
                .interval = most,
                .swing = swings,
                .settling = settling < most ? settling : most - 1,
                .per_step = swings > 0 ? quarter / swings : 0,
                .start = typename Phase::Type{} + phase_of(p.start_angle)};
    }

    static Report report(const State& state, const Coefficients& c) {
        Report report{};
        static_cast<ConventionalReport<T>&>(report) = Held::report(state.held, c.held);
        report.rate = state.rate;
        report.angle = T(6.28318530717958647693) * Phase::turns(c.start + at(state, c).turned);
        report.bias = state.bias;
        return report;
    }
    static bool sound(const State& state, const Coefficients& c) {
        return state.place < cycle(c) && state.read <= c.interval && Held::sound(state.held, c.held);
    }
    static std::uint64_t steps(const State& state) { return Held::steps(state.held); }
    static void start_over(State& state, bool keep_estimates) {
        State fresh{};
        fresh.held = state.held;
        Held::start_over(fresh.held, keep_estimates);
        fresh.place = state.place;
        if (keep_estimates) {
            fresh.first = state.first;
            fresh.other = state.other;
            fresh.known = state.known;
            fresh.kept = state.kept;
            fresh.rate = state.rate;
            fresh.bias = state.bias;
        }
        state = fresh;
    }

    // Without a measurement the amplitudes keep their values.
    static Signals<T, Report> step(State& state, const Coefficients& c, const Motion<T>& measured,
                                   const Sample<T>* missing = nullptr) {
        const Place here = at(state, c);
        if (c.swing == 0 && here.since == 0 && steps(state) > 0) {
            change_axes(state);
        }
        const SineCosine<T> turn = Phase::sine_cosine(c.start + here.turned);
        const Vec2<T> p{turn.cosine, turn.sine}, n = turned(p);
        const auto into = [&](const Vec2<T>& a) { return Vec2<T>{dot(p, a), dot(n, a)}; };
        const auto back = [&](const Vec2<T>& a) { return a.x() * p + a.y() * n; };
        Signals<T, Report> signals{.report = report(state, c)};
        const Motion<T> seen{.position = into(measured.position), .velocity = {}};
        const auto inner = Held::step(state.held, c.held, seen, missing);
        const ReferencePoint<T>& r = inner.reference;
        signals.reference = {back(r.position), back(r.velocity), back(r.acceleration)};
        signals.error =
            missing == nullptr ? Sample<T>{back(inner.error.value), back(inner.error.derivative)} : *missing;
        const Vec2<T> asked = back(inner.force);
        const T limit = c.held.drive.limit;
        signals.force = clamp(asked, -limit, limit);
        if (c.held.drive.limited) {
            signals.excess = back(inner.excess) + (asked - signals.force);
        }
        read(state, c, here);
        state.place = state.place + 1 < cycle(c) ? state.place + 1 : 0;
        return signals;
    }

private:
    static constexpr std::uint64_t quarter = std::uint64_t{1} << 62;
    static std::uint64_t cycle(const Coefficients& c) { return 2 * (c.interval + c.swing); }
    // The way from the first angle, the steps since this one began, and which it is.
    struct Place {
        std::uint64_t turned = 0, since = 0;
        bool other = false;
    };
    static Place at(const State& state, const Coefficients& c) {
        const std::uint64_t half = c.interval + c.swing;
        const bool other = state.place >= half;
        const std::uint64_t since = other ? state.place - half : state.place;
        const std::uint64_t swung = since < c.interval ? 0 : (since - c.interval) * c.per_step;
        return {other ? quarter - swung : swung, since, other};
    }
    // Turns the axes by 90°, with the states of the loops.
    static void change_axes(State& state) {
        auto& held = state.held;
        const Vec2<T> drive = held.drive, kept = state.kept;
        held.drive = held.sense;
        held.sense = -drive;
        held.rebalance = {};
        state.kept = {held.loop.detuning, held.loop.force};
        held.loop.detuning = held.loop.frequency = kept.x();
        held.loop.force = kept.y();
    }
    static void read(State& state, const Coefficients& c, const Place& here) {
        if (here.since < c.settling || here.since >= c.interval) {
            return;
        }
        const T rate = state.held.rate;
        state.sum = state.sum + rate;
        ++state.read;
        if (here.since + 1 == c.interval) {
            (here.other ? state.other : state.first) = state.sum.value / T(static_cast<double>(state.read));
            state.known = state.known + T(1.0);
            state.bias = if_less(state.known, T(2.0), T(0.0), T(0.5) * (state.first - state.other));
            state.known = minimum(state.known, T(2.0));
            state.sum = {};
            state.read = 0;
        }
        state.rate = here.other ? rate + state.bias : rate - state.bias;
    }
};

}  // namespace fracgyro
