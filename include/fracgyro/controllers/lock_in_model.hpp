// Coefficients of the lock-in (lock_in.hpp).
#pragma once

#include "fracgyro/control/saturation.hpp"
#include "fracgyro/controllers/lock_in_design.hpp"
#include "fracgyro/core/covariance.hpp"

namespace fracgyro {

template <Scalar T>
struct LockInModel {
    static constexpr std::size_t motions = 4, parameters = 8, numbers = 4;
    static constexpr std::int32_t shortest = static_cast<std::int32_t>(LockInParams::shortest);
    using Complex = Vec2<T>;                              // real and imaginary part
    using Lines = std::array<std::array<Complex, 2>, 2>;  // axis, line
    using Four = std::array<T, 4>;
    using Row = std::array<T, parameters>;

    static Complex times(const Complex& a, const Complex& b) {
        return {a.x() * b.x() - a.y() * b.y(), a.x() * b.y() + a.y() * b.x()};
    }

    struct Scales {
        Vec2<T> frequency{}, inverse_frequency{}, amplitude{}, inverse_amplitude{}, inverse_speed{};
        Vec2<T> sine{}, cosine{};  // from sums to means of e sin φ and e cos φ
    };
    struct Turns {
        SineCosine2<T> half{}, middle{}, over{};  // by half a step, to the middle of a span, by a span
        SineCosine2<T> begin{};                   // sines of the first step
        std::array<Complex, 2> lead{};            // turn by the delay and half a step, by line
    };
    struct Noise {
        T variance{}, precision{}, force{};  // variance of a measured position, its inverse; that of a force over it
        T left_out{};                        // square of half a span's time: relative error by a change of K
        Four measured{};                     // variances of the statistics
        std::array<Vec2<T>, 4> columns{};    // root of the covariance of z: [e, ė] of x twice, then of y
    };
    struct Prior {
        Four motion{};
        Row plant{}, inverse{}, drift{};  // variances, their inverses, what a span adds
        std::array<T, 3> ramp{};          // change of K over a span, for a relative drift of 1
    };
    // Force P r + Q ṙ, by columns.
    struct Modulation {
        std::array<Vec2<T>, 2> position{}, velocity{};
    };
    struct Force {
        typename Saturation<T>::Coefficients saturation{};
        Vec2<T> feedback{};
        T highest{}, late{};  // the limit, less rounding; share of the last span in a late force
        Lines first{};        // forces of the first spans
        Modulation first_modulation{};
        bool is_late = false;
    };

    typename Reference<T>::Coefficients reference{};
    PlantModel<T> nominal{};
    Vec2<T> detuning{};  // diagonal of K, less ω²
    Scales scales{};
    Turns turns{};
    std::array<Four, motions> map{};                                  // A
    std::array<std::array<std::array<Four, 2>, 2>, 2> change{};       // change of A: axis, other, e or ė
    std::array<std::array<T, 2>, numbers> measured{};                 // H
    std::array<std::array<std::array<Complex, 4>, 2>, 2> response{};  // R a: axis, line
    std::array<Lines, 2> held{};                                      // G: line, to, from
    Force force{};
    Noise noise{};
    Prior prior{};
    std::int32_t steps = 64;

    T frequency_of(std::size_t axis) const { return axis == 0 ? scales.frequency.x() : scales.frequency.y(); }

    // w of a line on both axes, for a plant that differs from the nominal one by x.
    template <std::size_t line>
    std::array<Complex, 2> along(const Row& x) const {
        const T twice = T(2.0) * (nominal.rate + x[0]), w = frequency_of(line);
        const T xy = nominal.damping.xy() + x[2], coupled = nominal.stiffness.xy() + x[5];
        std::array<Complex, 2> pull;
        if constexpr (line == 0) {
            pull = {Complex{detuning.x() + x[4], w * (nominal.damping.xx() + x[1])},
                    Complex{coupled, w * (xy + twice)}};
        } else {
            pull = {Complex{coupled, w * (xy - twice)},
                    Complex{detuning.y() + x[6], w * (nominal.damping.yy() + x[3])}};
        }
        const Lines& g = held[line];
        return {times(g[0][0], pull[0]) + times(g[0][1], pull[1]), times(g[1][0], pull[0]) + times(g[1][1], pull[1])};
    }
    // Scales the forces of an axis until their sum is within the limit.
    void limit(std::array<Complex, 2>& w) const {
        const T sum = scales.amplitude.x() * norm(w[0]) + scales.amplitude.y() * norm(w[1]);
        const T share = minimum(T(1.0), force.highest / maximum(sum, T(1e-30)));
        w = {share * w[0], share * w[1]};
    }
    template <std::size_t line>
    void modulate(Modulation& m, const Lines& w) const {
        const Complex x = times(w[0][line], turns.lead[line]), y = times(w[1][line], turns.lead[line]);
        const T inverse = line == 0 ? scales.inverse_frequency.x() : scales.inverse_frequency.y();
        m.position[line] = {x.x(), y.x()};
        m.velocity[line] = {inverse * x.y(), inverse * y.y()};
    }

    [[gnu::noinline]] static LockInModel prepare(const LockInParams& p, const Common& common) {
        const LockInDesign found = LockInDesign::prepare(p, common);
        const double h = common.step, n = static_cast<double>(p.span), late = static_cast<double>(p.datasheet.delay);
        const ReferenceParams& r = common.reference;
        const Vec2<double> w = r.frequency, square = w * w, turn = h * w;
        AdaptationParams each_step = p.adaptation;
        each_step.covariance_steps = 1;
        const auto joint = JointModel<T, false>::prepare(each_step, p.datasheet, common);
        const auto turned_by = [&](double steps) {
            const auto x = sine_cosine<T>(phase_of(steps * turn.x())), y = sine_cosine<T>(phase_of(steps * turn.y()));
            return SineCosine2<T>{.sine = {x.sine, y.sine}, .cosine = {x.cosine, y.cosine}};
        };
        const Vec2<double> inverse_amplitude = reciprocal(r.amplitude), inverse_frequency = reciprocal(w);
        LockInModel c{
            .reference = Reference<T>::prepare(r, h),
            .nominal = {cast<T>(common.nominal.damping), cast<T>(common.nominal.stiffness), T(common.nominal.rate)},
            .detuning = cast<T>(common.nominal.stiffness.diagonal - square),
            .scales = {.frequency = cast<T>(w),
                       .inverse_frequency = cast<T>(inverse_frequency),
                       .amplitude = cast<T>(absolute(r.amplitude)),
                       .inverse_amplitude = cast<T>(inverse_amplitude),
                       .inverse_speed = cast<T>(inverse_amplitude * inverse_frequency),
                       .sine = cast<T>((1.0 / n) * inverse_amplitude),
                       .cosine = cast<T>((1.0 / n) * (inverse_amplitude * inverse_frequency))},
            .turns = {.half = turned_by(0.5), .middle = turned_by(0.5 * (n - 1.0)), .over = turned_by(n)},
            .force = {.saturation = Saturation<T>::prepare(common.force_limit),
                      .highest = T((1.0 - 1e-5) * common.force_limit),
                      .late = T(late / n),
                      .is_late = p.datasheet.delay > 0},
            .steps = static_cast<std::int32_t>(p.span)};
        c.turns.begin = c.reference.phases.at({});
        const double decay = minimum(p.bandwidth, 0.3 / (n * h));
        c.force.feedback = cast<T>((2.0 * decay) * (w * inverse_amplitude));
        c.noise.variance = joint.noise.variance;
        c.noise.precision = T(1.0) / joint.noise.variance;
        c.noise.force = joint.noise.force;
        c.noise.left_out = T(0.25 * (n * h) * (n * h));
        for (std::size_t a = 0; a < 2; ++a) {
            const LockInDesign::Axis& axis = found.axes[a];
            for (std::size_t s = 0; s < 2; ++s) {
                c.measured[2 * a + s] = {T(axis.measured[s][0]), T(axis.measured[s][1])};
                c.noise.measured[2 * a + s] = T(axis.single[s]) + T(axis.disturbed[s]) * joint.noise.force;
                c.noise.columns[2 * a + s] = {T(axis.noise[s][0]), T(axis.noise[s][1])};
                c.prior.motion[a + 2 * s] = T(1e-4) * joint.prior.unknown[a + 2 * s];
            }
            c.turns.lead[a] = turn_of<T>((late + 0.5) * held_plant::of(turn, a));
            for (std::size_t b = 0; b < 2; ++b) {
                for (std::size_t i = 0; i < 4; ++i) {
                    const auto& force = axis.force[b][i];
                    const double size = held_plant::of(r.amplitude, b);
                    c.response[a][b][i] = {T(size * force.re), T(size * force.im)};
                }
                for (std::size_t m = 0; m < 2; ++m) {
                    const auto& change = found.change[a][b][m];
                    c.change[a][b][m] = {T(change[0][0]), T(change[0][1]), T(change[1][0]), T(change[1][1])};
                    const auto& held = found.held[b][a][m];
                    c.held[b][a][m] = {T(held.re), T(held.im)};
                }
            }
        }
        for (std::size_t i = 0; i < motions; ++i) {
            for (std::size_t j = 0; j < motions; ++j) {
                c.map[i][j] = T(found.map[i][j]);
            }
        }
        for (std::size_t i = 0; i < parameters; ++i) {
            c.prior.plant[i] = joint.prior.plant[i];
            c.prior.inverse[i] = T(1.0) / maximum(joint.prior.plant[i], T(1e-30));
            c.prior.drift[i] = T(i < parameters - 1 ? n : n * n) * joint.drift[i];
        }
        for (std::size_t i = 0; i < c.prior.ramp.size(); ++i) {
            c.prior.ramp[i] = T(n) * joint.ramp[i];
        }
        const auto x = c.template along<0>({}), y = c.template along<1>({});
        c.force.first = {std::array{x[0], y[0]}, std::array{x[1], y[1]}};
        if (c.force.saturation.limited) {
            c.limit(c.force.first[0]);
            c.limit(c.force.first[1]);
        }
        c.template modulate<0>(c.force.first_modulation, c.force.first);
        c.template modulate<1>(c.force.first_modulation, c.force.first);
        return c;
    }
};

}  // namespace fracgyro
