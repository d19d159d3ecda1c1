// Design of the internal model (internal_model.hpp): its gains, computed once in double precision. Those of its filter
// are in hardware/filter_design.hpp, for z = [e, ė].
#pragma once

#include "fracgyro/control/smooth_feedback.hpp"
#include "fracgyro/hardware/filter_design.hpp"

namespace fracgyro {

struct InternalModelParams {
    SmoothFeedbackParams feedback{};
    double learning_bandwidth = 1.0;  // oscillators
    Datasheet datasheet{};

    static constexpr auto fields() {
        using P = InternalModelParams;
        return Fields{
            Inner{"controller", &P::feedback},
            field("learning_bandwidth", &P::learning_bandwidth, "omega0", above_0,
                  "Unit omega0, > 0: bandwidth at which forces that the nominal plant lacks are estimated at each "
                  "frequency of the reference."),
            Inner{"datasheet", &P::datasheet},
        };
    }
};

struct InternalModelDesign {
    static constexpr std::size_t max_frequencies = filter_design::max_frequencies;
    using Columns = std::array<Vec2<double>, 2>;

    double step = 0.0;
    std::array<double, max_frequencies> frequencies{};
    std::size_t count = 0;
    Matrix<6> map{};  // for z and a held force, both axes
    std::array<filter_design::Gains, 2> filter{};
    std::array<Columns, 3> feedforward{};  // matrices of r, ṙ, r̈
    Columns ripple{};                      // and of the velocity that u_r leaves at the samples, of ṙ

    [[gnu::noinline]] static InternalModelDesign prepare(const InternalModelParams& p, const Common& common,
                                                         bool velocity_measured) {
        InternalModelDesign c{.step = common.step};
        const double h = common.step;
        c.map = held_plant::both_axes(common.nominal, h);
        c.find_frequencies(common.reference, 1e-4 * p.learning_bandwidth);
        const auto delay = static_cast<double>(p.datasheet.delay);
        filter_design::Oscillators known{.count = c.count};
        for (std::size_t n = 0; n < c.count; ++n) {
            known.angle[n] = c.frequencies[n] * h;
            known.ripple[n] = c.ripple_of(n) / h;
        }
        for (std::size_t axis = 0; axis < 2; ++axis) {
            c.filter[axis] =
                filter_design::gains(held_plant::one_axis(common.nominal, h, axis), h, common.nominal.stiffness,
                                     p.datasheet, p.learning_bandwidth, known, velocity_measured);
            c.design_feedforward(common, axis, delay);
        }
        return c;
    }

    // A force that is a sine, and the held force against it that leaves no error at the samples, leave a velocity
    // there: this factor times the sine of the held force.
    double ripple_of(std::size_t n) const {
        const auto half = sine_cosine<double>(phase_of(0.5 * frequencies[n] * step));
        const double inverse_tangent = half.cosine / half.sine;
        return 0.5 * step * inverse_tangent * (1.0 - 0.5 * frequencies[n] * step * inverse_tangent);
    }

private:
    static double of(const Vec2<double>& v, std::size_t axis) { return held_plant::of(v, axis); }
    static bool is_sine(const ReferenceParams& r, std::size_t axis) {
        return r.course == nullptr || r.kind[axis] == ReferenceKind::sine;
    }
    // Frequencies that samples show.
    bool sampled(double frequency) const { return absolute(frequency) * step < 3.0; }

    // Distinct frequencies, and if they are too many those of the largest amplitudes.
    void find_frequencies(const ReferenceParams& r, double apart) {
        std::array<double, max_frequencies> amplitudes{};
        const auto add = [&](double amplitude, double signed_frequency) {
            const double frequency = absolute(signed_frequency), size = absolute(amplitude);
            if (!(size > 0.0 && frequency > apart && sampled(frequency))) {
                return;
            }
            std::size_t place = count, smallest = 0;
            for (std::size_t i = 0; i < count; ++i) {
                if (absolute(frequencies[i] - frequency) <= apart) {
                    place = i;
                }
                smallest = amplitudes[i] < amplitudes[smallest] ? i : smallest;
            }
            if (place < count) {
                amplitudes[place] = maximum(amplitudes[place], size);
                return;
            }
            if (count < max_frequencies) {
                ++count;
            } else if (size > amplitudes[smallest]) {
                place = smallest;
            } else {
                return;
            }
            frequencies[place] = frequency;
            amplitudes[place] = size;
        };
        for (std::size_t axis = 0; axis < 2; ++axis) {
            if (is_sine(r, axis)) {
                add(of(r.amplitude, axis), of(r.frequency, axis));
            } else if (r.kind[axis] == ReferenceKind::sines) {
                for (const SineTerm& term : r.course->terms) {
                    add(term.amplitude[axis], term.frequency[axis]);
                }
            }
        }
    }

    // The held force that keeps the nominal plant on the reference of one axis, after a delay. For a sine the regulator
    // equations X S = F X + G U, with the positions of X on the reference and S the turn of p = [r, ṙ/ω] in a step, are
    // exact. Otherwise it is the force in the middle of the coming step, without the third derivative.
    void design_feedforward(const Common& common, std::size_t axis, double delay) {
        const double h = step, w = of(common.reference.frequency, axis);
        if (!is_sine(common.reference, axis) || w == 0.0 || !sampled(w)) {
            const PlantModel<double>& n = common.nominal;
            const Vec2<double> unit{axis == 0 ? 1.0 : 0.0, axis == 0 ? 0.0 : 1.0};
            const double ahead = (delay + 0.5) * h;
            const Vec2<double> stiff = n.stiffness * unit;
            const Vec2<double> damped = n.damping * unit + 2.0 * n.rate * turned(unit);
            feedforward[0][axis] = stiff;
            feedforward[1][axis] = damped + ahead * stiff;
            feedforward[2][axis] = unit + ahead * damped + (0.5 * ahead * ahead) * stiff;
            ripple[axis] = (-h * h / 12.0) * stiff;
            return;
        }
        const auto turn = sine_cosine<double>(phase_of(w * h));
        const double s[2][2] = {{turn.cosine, turn.sine}, {-turn.sine, turn.cosine}};
        LeadingMatrix<8> a{.size = 8};
        Table<8, 1> x{};  // velocities of X, then U, row by row
        for (std::size_t i = 0; i < 4; ++i) {
            for (std::size_t c = 0; c < 2; ++c) {
                auto& equation = a[2 * i + c];
                for (std::size_t n = 0; n < 2; ++n) {
                    if (i >= 2) {
                        equation[2 * (i - 2) + n] += s[n][c];
                    }
                    equation[2 * n + c] -= map[i][2 + n];
                    equation[4 + 2 * n + c] -= map[i][4 + n];
                }
                x[2 * i + c][0] = (c == 0 ? map[i][axis] : 0.0) - (i == axis ? s[0][c] : 0.0);
            }
        }
        solve(a, x);
        const auto ahead = sine_cosine<double>(phase_of(delay * w * h));
        const auto column = [&](std::size_t first, double of_first, double of_second) {
            return Vec2<double>{of_first * x[first][0] + of_second * x[first + 1][0],
                                of_first * x[first + 2][0] + of_second * x[first + 3][0]};
        };
        feedforward[0][axis] = (1.0 / (h * h)) * column(4, ahead.cosine, -ahead.sine);
        feedforward[1][axis] = (1.0 / (h * h * w)) * column(4, ahead.sine, ahead.cosine);
        const Vec2<double> own{axis == 0 ? 1.0 : 0.0, axis == 0 ? 0.0 : 1.0};
        ripple[axis] = (1.0 / (h * w)) * column(0, 0.0, 1.0) - own;
    }
};

}  // namespace fracgyro
