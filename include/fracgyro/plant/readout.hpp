// From the position to its samples, and from a force to the time at which it acts: amplifiers, feedthrough, delays.
//
//    s = p(q) + β u       the reading of a pick-off, and the feedthrough of the drive
//    ẇ = ω_h (s - w)      the high-pass of a charge amplifier, 1/(R_f C_f); it passes s - w
//    l̇ = λ β u - ω_h l    what the drive leaks through resistances, after the high-pass
//    ż = ω_p (s - w + l - z)  its low-pass; z is its output, or s - w + l without a pole, times a gain
//    y                    z at t - τ_s, or its mean over τ_a before; the force u acts from t + τ_u on
//
// A transimpedance amplifier reads ṡ/ω at the resonance ω, with a pole: jω/(1 + jω/ω_p)/ω is a high-pass of ω_p with
// the gain ω_p/ω.
//
// All of it is linear but p(q) - q. Rows of matrix exponentials are therefore exact for a gyroscope with a held force,
// whatever the pole. p(q) - q is taken as a line over the step, and the motion of a varying gyroscope less that of the
// linear one as a parabola: their errors are h³ a step, of a small part of the signal.
#pragma once

#include "fracgyro/plant/gyroscope.hpp"
#include "fracgyro/core/phase.hpp"

#include <algorithm>

namespace fracgyro {

// Nondimensional.
struct ReadoutParams {
    static constexpr double off = std::numeric_limits<double>::infinity();
    Vec2<double> pole{off, off}, high_pass{};  // ω_p, ω_h
    Matrix2<double> feedthrough{};             // β
    double leak = 0.0;                         // λ
    Vec2<double> gain{1.0, 1.0};
    double sample_delay = 0.0, update_delay = 0.0, aperture = 0.0;  // τ_s, τ_u, τ_a; τ_s + τ_a and τ_u below a step

    bool on() const {
        const Matrix2<double>& b = feedthrough;
        return pole.x() < off || pole.y() < off || high_pass.x() > 0.0 || high_pass.y() > 0.0 ||
               squared_norm(b.first) + squared_norm(b.second) > 0.0 || sample_delay > 0.0 || update_delay > 0.0 ||
               aperture > 0.0;
    }
};

struct Readout {
    // q, q̇, w, z, ∫ of the output, u before and after τ_u, d, p(q) - q with its first and second derivative, l: x, y.
    static constexpr std::size_t size = 24;
    static constexpr std::size_t w = 4, z = 6, sum = 8, before = 10, after = 12, d = 14, rest = 16, leak = 22;
    using Row = std::array<double, size>;
    using Input = Row;
    struct Coefficients {
        std::array<Row, 4> inside{};                                   // w, z at the end
        std::array<Row, 2> leaks{};                                    // l
        std::array<Row, 2> output{}, position{};                       // y; q at the end, of the linear gyroscope
        std::array<Vec2<double>, 2> late_position{}, late_velocity{};  // effect of a force over τ_u: by x, by y
        std::array<std::array<double, 2>, 6> at_rest{};  // w, z, y of a motion at the resonance, from q and q̇
        double step = 0.0;
        bool on = false;
    };
    struct State {
        std::array<double, 4> inside{};
        Vec2<double> leaked{};
        Vec2<double> force{}, reading{};  // force of the step before; the coming sample
    };

    static Coefficients prepare(const ReadoutParams& p, const GyroscopeParams& plant, double step) {
        Coefficients c;
        c.on = p.on();
        c.step = step;
        const Matrix<size> early = system(p, plant, before), late = system(p, plant, after);
        const auto until = [&](double t) {
            return t <= p.update_delay ? expm(early, t)
                                       : product(expm(late, t - p.update_delay), expm(early, p.update_delay));
        };
        const Matrix<size> whole = until(step), sampled = until(step - p.sample_delay);
        for (std::size_t i = 0; i < 4; ++i) {
            c.inside[i] = whole[w + i];
        }
        // The output right before a force that changes at this very time.
        const Matrix<size>& then = step - p.sample_delay <= p.update_delay ? early : late;
        for (std::size_t i = 0; i < 2; ++i) {
            c.position[i] = whole[i];
            c.leaks[i] = whole[leak + i];
            if (p.aperture > 0.0) {
                const Matrix<size> begun = until(step - p.sample_delay - p.aperture);
                for (std::size_t j = 0; j < size; ++j) {
                    c.output[i][j] = (sampled[sum + i][j] - begun[sum + i][j]) / p.aperture;
                }
            } else {
                for (std::size_t j = 0; j < size; ++j) {
                    for (std::size_t k = 0; k < size; ++k) {
                        c.output[i][j] += then[sum + i][k] * sampled[k][j];
                    }
                }
            }
            c.late_position[i] = {whole[0][before + i], whole[1][before + i]};
            c.late_velocity[i] = {whole[2][before + i], whole[3][before + i]};
        }
        start_rows(c, p, plant);
        return c;
    }

    static State start(const Coefficients& c, const Motion<double>& at, const Vec2<double>& rest_of_reading) {
        State state;
        const std::array<double, 2> q{at.position.x(), at.position.y()}, v{at.velocity.x(), at.velocity.y()};
        std::array<double, 6> found{};
        for (std::size_t i = 0; i < 6; ++i) {
            found[i] = c.at_rest[i][0] * q[i % 2] + c.at_rest[i][1] * v[i % 2];
        }
        std::copy_n(found.begin(), 4, state.inside.begin());
        state.reading = Vec2<double>{found[4], found[5]} + rest_of_reading;
        return state;
    }

    // Adds the part that a step with this force over all of it leaves out: the one before acts until τ_u.
    static void delay(Motion<double>& next, const State& state, const Coefficients& c, const Vec2<double>& force) {
        const Vec2<double> more = state.force - force;
        next.position = next.position + (more.x() * c.late_position[0] + more.y() * c.late_position[1]);
        next.velocity = next.velocity + (more.x() * c.late_velocity[0] + more.y() * c.late_velocity[1]);
    }

    // The reading after a step from `from` to `to`, between which p(q) - q went from `bent` to `bends`.
    static void step(State& state, const Coefficients& c, const Motion<double>& from, const Motion<double>& to,
                     const Vec2<double>& force, const Vec2<double>& disturbance, const Vec2<double>& bent,
                     const Vec2<double>& bends) {
        const double per_step = 1.0 / c.step;
        Vec2<double> slope = per_step * (bends - bent);
        Input in{from.position.x(),
                 from.position.y(),
                 from.velocity.x(),
                 from.velocity.y(),
                 state.inside[0],
                 state.inside[1],
                 state.inside[2],
                 state.inside[3],
                 0.0,
                 0.0,
                 state.force.x(),
                 state.force.y(),
                 force.x(),
                 force.y(),
                 disturbance.x(),
                 disturbance.y(),
                 bent.x(),
                 bent.y(),
                 slope.x(),
                 slope.y(),
                 0.0,
                 0.0,
                 state.leaked.x(),
                 state.leaked.y()};
        const Vec2<double> linear{times(c.position[0], in), times(c.position[1], in)};
        const Vec2<double> curve = (2.0 * per_step * per_step) * (to.position - linear);
        in[rest + 4] = curve.x(), in[rest + 5] = curve.y();
        for (std::size_t i = 0; i < 4; ++i) {
            state.inside[i] = times(c.inside[i], in);
        }
        state.leaked = {times(c.leaks[0], in), times(c.leaks[1], in)};
        state.reading = {times(c.output[0], in), times(c.output[1], in)};
        state.force = force;
    }

private:
    // `acting`: where the force is among the states.
    static Matrix<size> system(const ReadoutParams& p, const GyroscopeParams& plant, std::size_t acting) {
        const Matrix<6> mass = Gyroscope<double>::system(plant);
        Matrix<size> a{};
        const std::array<double, 2> pole{p.pole.x(), p.pole.y()}, high{p.high_pass.x(), p.high_pass.y()},
            gain{p.gain.x(), p.gain.y()};
        const std::array<std::array<double, 2>, 2> beta{
            {{p.feedthrough.first.x(), p.feedthrough.second.x()}, {p.feedthrough.first.y(), p.feedthrough.second.y()}}};
        for (std::size_t i = 0; i < 4; ++i) {
            for (std::size_t j = 0; j < 4; ++j) {
                a[i][j] = mass[i][j];
            }
        }
        for (std::size_t i = 0; i < 2; ++i) {
            a[2 + i][acting + i] = a[2 + i][d + i] = 1.0;
            a[rest + i][rest + 2 + i] = a[rest + 2 + i][rest + 4 + i] = 1.0;
            Row passed{};  // s - w
            passed[i] = passed[rest + i] = 1.0;
            passed[w + i] = -1.0;
            passed[acting] = beta[i][0], passed[acting + 1] = beta[i][1];
            for (std::size_t j = 0; j < size; ++j) {
                a[w + i][j] = high[i] * passed[j];
            }
            if (p.leak > 0.0) {
                a[leak + i][leak + i] = -high[i];
                a[leak + i][acting] = p.leak * beta[i][0], a[leak + i][acting + 1] = p.leak * beta[i][1];
                passed[leak + i] = 1.0;
            }
            const bool filters = pole[i] < ReadoutParams::off;
            for (std::size_t j = 0; j < size; ++j) {
                a[z + i][j] = filters ? pole[i] * (passed[j] - (j == z + i ? 1.0 : 0.0)) : 0.0;
                a[sum + i][j] = gain[i] * (filters ? (j == z + i ? 1.0 : 0.0) : passed[j]);
            }
        }
        return a;
    }

    // For a free motion at the resonance of each axis: w, z and y as Re G q + Im G q̇/ω.
    static void start_rows(Coefficients& c, const ReadoutParams& p, const GyroscopeParams& plant) {
        const Vec2<double> k = (plant.stiffness + plant.stiffness_deviation).diagonal;
        for (std::size_t i = 0; i < 2; ++i) {
            const double stiffness = i == 0 ? k.x() : k.y(), omega = square_root(maximum(stiffness, 1e-12));
            const double high = (i == 0 ? p.high_pass.x() : p.high_pass.y()) / omega;
            const double low = omega / (i == 0 ? p.pole.x() : p.pole.y());
            // W = high/(j + high), and (1 - W)/(1 + j low), by its real and imaginary parts.
            const Vec2<double> held = (high / (1.0 + high * high)) * Vec2<double>{high, -1.0};
            const Vec2<double> passed = Vec2<double>{1.0, 0.0} - held;
            const Vec2<double> lag = (1.0 / (1.0 + low * low)) * Vec2<double>{1.0, -low};
            const Vec2<double> out = times(passed, lag);
            const Vec2<double> back = turn_of<double>(omega * (p.sample_delay + 0.5 * p.aperture));
            const Vec2<double> sampled = (i == 0 ? p.gain.x() : p.gain.y()) * times(out, {back.x(), -back.y()});
            const std::array<Vec2<double>, 3> rows{
                held, p.pole.x() < ReadoutParams::off || p.pole.y() < ReadoutParams::off ? out : Vec2<double>{},
                sampled};
            for (std::size_t row = 0; row < 3; ++row) {
                c.at_rest[2 * row + i] = {rows[row].x(), rows[row].y() / omega};
            }
        }
    }
    static Vec2<double> times(const Vec2<double>& a, const Vec2<double>& b) {
        return {a.x() * b.x() - a.y() * b.y(), a.x() * b.y() + a.y() * b.x()};
    }
    static double times(const Row& row, const Input& in) {
        double even = 0.0, odd = 0.0;
        for (std::size_t j = 0; j < size; j += 2) {
            even += row[j] * in[j];
            odd += row[j + 1] * in[j + 1];
        }
        return even + odd;
    }
};

}  // namespace fracgyro
