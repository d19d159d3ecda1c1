// Model of the joint filter (joint.hpp): the nominal plant over a span, noise, prior and drift.
#pragma once

#include "fracgyro/control/common.hpp"
#include "fracgyro/control/datasheet.hpp"
#include "fracgyro/core/expm.hpp"
#include "fracgyro/estimation/adaptation.hpp"
#include "fracgyro/estimation/consistency.hpp"

namespace fracgyro {

template <Scalar T, bool velocity_measured>
struct JointModel {
    static constexpr std::size_t motions = 4, parameters = 8, sensors = velocity_measured ? 4 : 2;
    using Four = std::array<T, motions>;
    using Row = std::array<T, parameters>;

    // Standard deviations before the first sample: of Ωz and D over the natural frequency, of K over its square.
    static constexpr double prior_deviation = 0.05;
    static constexpr double unknown_motion = 100.0;  // in reference amplitudes
    static constexpr int most_terms = 16;
    // Units of time over which the damping drifts in one direction, and over which the drift of the stiffness changes.
    static constexpr double damping_drifts_for = 100.0, stiffness_drifts_for = 1e8;

    struct Noise {
        T variance{};  // variance of a measured position: the unit of those below
        T force{};
        Four measured{}, more{};  // variances of the mean of a span, and the excess of a single number
    };
    struct Prior {
        Four motion{}, unknown{};  // variances relative to a measured position: initial, and of any motion
        Row plant{};
    };

    PlantModel<T> nominal{};
    Sym2<T> detuning{};                // K - ω²
    Vec2<T> square{};                  // ω² of the reference
    std::array<Four, motions> map{};   // A, row by row
    std::array<Four, sensors> mean{};  // mean of the motion over a span, from the motion at its end
    T span{}, half_square{}, share{};  // for P: m h and ½(m h)², which is B; 1/m
    T of_force{};                      // variance of a force of 1, relative to a measured position
    std::array<T, most_terms> over{};  // h/k
    std::int32_t terms = 0, delay = 0, slots = 1;
    Noise noise{};
    Prior prior{};
    Row drift{};                                    // variances added over a span
    std::array<T, 3> ramp{};                        // ramp of K over a span, for a relative drift of 1
    std::array<std::uint32_t, parameters> walks{};  // drifting estimates except the rate
    std::uint32_t walking = 0;                      // their number
    typename Consistency<T, parameters>::Coefficients consistency{};

    [[gnu::noinline]] static JointModel prepare(const AdaptationParams& p, const Datasheet& said,
                                                const Common& common) {
        const double h = common.step, slots = static_cast<double>(p.covariance_steps), span = slots * h;
        const PlantModel<double>& nominal = common.nominal;
        const EquivalentSine r = equivalent_sine(common.reference);
        const Sym2<double>&k = nominal.stiffness, &d = nominal.damping;
        const Vec2<double> square = r.frequency * r.frequency, speed = r.amplitude * r.frequency;
        const double natural = maximum(square_root(0.5 * absolute(k.xx() + k.yy())), 1e-3);

        JointModel c{.nominal = {.damping = cast<T>(d), .stiffness = cast<T>(k), .rate = T(nominal.rate)},
                     .detuning = cast<T>(Sym2<double>{k.diagonal - square, k.off_diagonal}),
                     .square = cast<T>(square),
                     .span = T(span),
                     .half_square = T(0.5 * span * span),
                     .share = T(1.0 / slots),
                     .delay = static_cast<std::int32_t>(said.delay),
                     .slots = static_cast<std::int32_t>(p.covariance_steps)};
        Matrix<motions> unforced{};
        unforced[0][2] = unforced[1][3] = 1.0;
        unforced[2] = {-k.xx(), -k.xy(), -d.xx(), -d.xy() + 2.0 * nominal.rate};
        unforced[3] = {-k.xy(), -k.yy(), -d.xy() - 2.0 * nominal.rate, -d.yy()};
        const Matrix<motions> map = expm(unforced, span);
        Matrix<motions> back = unforced, mean{}, power{};
        for (std::size_t i = 0; i < motions; ++i) {
            for (double& entry : back[i]) {
                entry = -entry;
            }
            power[i][i] = 1.0;
        }
        back = expm(back, h);
        // Variances of the mean of a span, for independent forces of 1 within it: P knows only a held one.
        std::array<double, motions> within{};
        within[0] = within[1] = square_of(h * h) * slots * (slots * slots - 1.0) / 12.0;
        for (std::int64_t n = 0; n < p.covariance_steps; ++n, power = product(power, back)) {
            for (std::size_t i = 0; i < motions; ++i) {
                for (std::size_t j = 0; j < motions; ++j) {
                    mean[i][j] += power[i][j] / slots;
                }
                for (std::size_t j = 0; j < 2 && n + 1 < p.covariance_steps; ++j) {  // the force n + 1 steps earlier
                    within[i] += square_of(h * mean[i][2 + j] - 0.5 * h * h * mean[i][j]);
                }
            }
        }
        for (std::size_t i = 0; i < motions; ++i) {
            for (std::size_t j = 0; j < motions; ++j) {
                c.map[i][j] = T(map[i][j]);
                if (i < sensors) {
                    c.mean[i][j] = T(mean[i][j]);
                }
            }
        }
        for (std::size_t n = 0; n < most_terms; ++n) {
            c.over[n] = T(h / static_cast<double>(n + 1));
        }
        c.terms = terms_for(h * maximum(natural, maximum(absolute(r.frequency.x()), absolute(r.frequency.y()))));

        // A noise below the rounding of a position gains nothing, and stating the rounding costs nothing.
        const double amplitude = maximum(absolute(r.amplitude.x()), absolute(r.amplitude.y()));
        const double fastest = maximum(maximum(absolute(speed.x()), absolute(speed.y())), amplitude * natural);
        const double rounding = always_less(T(1.0), T(1.0) + T(seen_in_double)) ? 0.0 : single_rounding;
        const double unit =
            square_of(maximum(said.position_noise, maximum(least_noise * square_root(h), rounding * amplitude)));
        const double disturbed = square_of(maximum(said.force_noise, least_force));
        const double slip = square_of(maximum(said.velocity_noise,
                                              maximum(least_noise * natural * square_root(h), rounding * fastest))) /
                            unit;
        c.of_force = T(1.0 / unit);
        c.noise = {.variance = T(unit), .force = T(disturbed / unit / slots)};
        for (std::size_t i = 0; i < motions; ++i) {
            const double single = i < 2 ? 1.0 : slip;
            c.noise.measured[i] = T(single / slots + within[i] * disturbed / unit);
            c.noise.more[i] = T(single - single / slots);
        }
        const double velocity = square_of(maximum(fastest, least_noise)) / unit;
        c.prior.motion = {T(1.0), T(1.0), T(velocity_measured ? slip : velocity),
                          T(velocity_measured ? slip : velocity)};
        // After a fault the motion may be far from its reference.
        const double anywhere = square_of(unknown_motion * maximum(amplitude, least_noise)) / unit;
        const double any_speed = square_of(unknown_motion) * velocity;
        c.prior.unknown = {T(anywhere), T(anywhere), T(any_speed), T(any_speed)};
        const double of_rate = square_of(prior_deviation * natural) / unit, of_stiffness = of_rate * natural * natural;
        const double ramp = square_of(said.stiffness_drift) / unit;
        c.prior.plant = {T(of_rate),      T(of_rate),      T(of_rate),      T(of_rate),
                         T(of_stiffness), T(of_stiffness), T(of_stiffness), T(ramp)};
        c.ramp = {T(span * k.xx()), T(span * k.xy()), T(span * k.yy())};
        const Information known{.nominal = nominal,
                                .reference = r,
                                .force = disturbed * h,
                                .position = unit * h,
                                .velocity = velocity_measured ? slip * unit * h : 0.0};
        const double v = p.rate_forgetting, w = p.forgetting;
        const auto forgotten = [&](double information) {
            return information > 0.0 ? w * w * span / information / unit : 0.0;
        };
        const auto wanders = [&](double damping) {
            return square_of(said.damping_drift * damping) * damping_drifts_for * span / unit;
        };
        const double of_rates = 4.0 * (known.of_damping(0, 1, v) + known.of_damping(1, 0, v));
        const std::array<double, parameters> drift{
            of_rates > 0.0 ? v * v * span / of_rates / unit : 0.0,
            forgotten(known.of_damping(0, 0, w)) + wanders(d.xx()),
            forgotten(known.of_damping(0, 1, w) + known.of_damping(1, 0, w)) + wanders(d.xy()),
            forgotten(known.of_damping(1, 1, w)) + wanders(d.yy()),
            forgotten(known.of_stiffness(0, 0, w)),
            forgotten(known.of_stiffness(0, 1, w) + known.of_stiffness(1, 0, w)),
            forgotten(known.of_stiffness(1, 1, w)),
            ramp * span / stiffness_drifts_for};
        for (std::uint32_t k = 0; k < parameters; ++k) {
            c.drift[k] = T(drift[k]);
            if (k > 0 && drift[k] > 0.0) {
                c.walks[c.walking++] = k;
            }
        }
        const double slower = minimum(absolute(r.frequency.x()), absolute(r.frequency.y()));
        const double period = 2.0 * 3.14159265358979323846 / (slower > 0.0 ? slower : natural);
        using Agreement = Consistency<T, parameters>;
        c.consistency = Agreement::prepare(period, h, sensors, 8.0, Agreement::relearning, 16'384.0);
        return c;
    }

private:
    static constexpr double least_noise = 1e-6, least_force = 1e-10;
    static constexpr double single_rounding = 0x1p-22;  // relative to the measured and predicted number
    static constexpr double seen_in_double = 0x1p-40;   // added to 1

    static double square_of(double a) { return a * a; }

    // Information on a parameter that acts as a force, per unit of time of a motion on the reference, if the parameter
    // changes at frequency w: that force has lines at the reference's frequency plus and minus w, where it competes
    // with the disturbance and with the sensing noise over the plant's response to a force. Densities, two-sided.
    struct Information {
        PlantModel<double> nominal;
        EquivalentSine reference;
        double force, position, velocity;  // velocity = 0: not measured

        // Information from the effect of axis `of` on axis `on` through a damping (or twice a rate), or a stiffness.
        double of_damping(std::size_t on, std::size_t of, double w) const {
            return square_of(component(reference.frequency, of)) * of_stiffness(on, of, w);
        }
        double of_stiffness(std::size_t on, std::size_t of, double w) const {
            const double line = component(reference.frequency, of);
            const double mean_square = 0.5 * square_of(component(reference.amplitude, of));
            return 0.5 * mean_square * (1.0 / noise(on, line + w) + 1.0 / noise(on, line - w));
        }
        double noise(std::size_t on, double w) const {
            const double k = component(nominal.stiffness.diagonal, on), d = component(nominal.damping.diagonal, on);
            const double inverse_response = square_of(k - w * w) + square_of(d * w);
            const double precision = 1.0 / position + (velocity > 0.0 ? w * w / velocity : 0.0);
            return force + inverse_response / precision;
        }
        static double component(const Vec2<double>& v, std::size_t i) { return i == 0 ? v.x() : v.y(); }
    };

    // Number of terms in the Taylor series of a motion that turns by `angle` in a step: the remainder is below
    // rounding.
    static std::int32_t terms_for(double angle) {
        const double rounding = always_less(T(1.0), T(1.0) + T(1e-9)) ? 1e-17 : 1e-9;
        double left_out = angle;
        std::int32_t n = 1;
        while (n < most_terms && left_out > rounding) {
            ++n;
            left_out *= angle / n;
        }
        return n;
    }
};

}  // namespace fracgyro
