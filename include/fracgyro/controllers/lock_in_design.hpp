// Design of the lock-in (lock_in.hpp): the effect of n steps of one axis on z = [e, ė] and on its two statistics,
// computed once in double precision.
#pragma once

#include "fracgyro/control/held_plant.hpp"
#include "fracgyro/core/phase.hpp"
#include "fracgyro/core/riccati.hpp"
#include "fracgyro/estimation/joint_model.hpp"

namespace fracgyro {

struct LockInParams {
    static constexpr double shortest = 160.0, longest = 256.0;

    double bandwidth = 0.02;
    std::int64_t span = 160;
    AdaptationParams adaptation{};  // only forgetting is used
    Datasheet datasheet{};

    static constexpr auto fields() {
        using P = LockInParams;
        return Fields{
            field("bandwidth", &P::bandwidth, "omega0", above_0,
                  "Unit omega0, > 0: rate at which errors of amplitude and phase decay; at most 0.3 per span."),
            settable(Settable::beforehand,
                     field("span", &P::span, "h", Range{.low = shortest, .high = longest, .whole = true},
                           "Steps after which the filter computes once, 160 to 256.")),
            Inner{"adaptation", &P::adaptation, AdaptationParams::forgetting_fields()},
            Inner{"datasheet", &P::datasheet},
        };
    }
};

struct LockInDesign {
    struct Complex {
        double re = 0.0, im = 0.0;
        friend Complex operator+(Complex a, Complex b) { return {a.re + b.re, a.im + b.im}; }
        friend Complex operator*(Complex a, Complex b) {
            return {a.re * b.re - a.im * b.im, a.re * b.im + a.im * b.re};
        }
        friend Complex operator*(double a, Complex b) { return {a * b.re, a * b.im}; }
        friend Complex operator/(Complex a, Complex b) {
            const double square = b.re * b.re + b.im * b.im;
            return {(a.re * b.re + a.im * b.im) / square, (a.im * b.re - a.re * b.im) / square};
        }
    };
    static Complex turn(double angle) {
        const auto found = sine_cosine<double>(phase_of(angle));
        return {found.cosine, found.sine};
    }

    using Two = std::array<double, 2>;
    // One axis with the nominal plant, without coupling.
    struct Axis {
        std::array<Two, 2> measured{};                  // statistics (cosine, sine) of z at the start
        std::array<std::array<Complex, 4>, 2> force{};  // [z, statistics] of the force Im(e^(iωhj)), for both lines
        std::array<Two, 2> noise{};                     // root of the covariance of z under forces of variance 1
        Two disturbed{};                                // variances of the statistics under such forces
        Two single{};                                   // and under a noise of variance 1 of every position
        std::array<Matrix<2>, 256> before{};            // map of z over the first j + ½ steps
    };
    std::array<Axis, 2> axes{};
    Matrix<4> map{};  // map of z over the span, with coupling
    // Change of the map by a force on `axis` from e or ė of axis `of`.
    std::array<std::array<std::array<Matrix<2>, 2>, 2>, 2> change{};
    // Held forces on x and y that act as a continuous force Im(e^(iωt)) on x or y does, for both lines.
    std::array<std::array<std::array<Complex, 2>, 2>, 2> held{};

    [[gnu::noinline]] static LockInDesign prepare(const LockInParams& p, const Common& common) {
        LockInDesign c;
        const double h = common.step;
        const auto n = static_cast<std::size_t>(p.span);
        const Two w{common.reference.frequency.x(), common.reference.frequency.y()};
        const Matrix<6> step = held_plant::without_units(held_plant::both_axes(common.nominal, h), h);
        Matrix<4> one{};
        for (std::size_t i = 0; i < 4; ++i) {
            for (std::size_t j = 0; j < 4; ++j) {
                one[i][j] = step[i][j];
            }
            c.map[i][i] = 1.0;
        }
        for (std::size_t j = 0; j < n; ++j) {
            c.map = product(one, c.map);
        }
        for (std::size_t b = 0; b < 2; ++b) {
            c.find_held(common.nominal, step, b, w[b], h);
        }
        std::array<Matrix<2>, 2> single{};
        std::array<Two, 2> push{};
        for (std::size_t a = 0; a < 2; ++a) {
            const Matrix<3> m = held_plant::one_axis(common.nominal, h, a);
            single[a] = {Two{m[0][0], m[0][1] * h}, Two{m[1][0] / h, m[1][1]}};
            push[a] = {m[0][2] * h * h, m[1][2] * h};
            c.axes[a] = follow(single[a], push[a], w, a, h, n);
        }
        for (std::size_t a = 0; a < 2; ++a) {
            for (std::size_t b = 0; b < 2; ++b) {
                for (std::size_t m = 0; m < 2; ++m) {
                    Matrix<2>& sum = c.change[a][b][m];
                    for (std::size_t j = 0; j < n; ++j) {
                        sum = product(single[a], sum);
                        for (std::size_t k = 0; k < 2; ++k) {
                            sum[0][k] -= push[a][0] * c.axes[b].before[j][m][k];
                            sum[1][k] -= push[a][1] * c.axes[b].before[j][m][k];
                        }
                    }
                }
            }
        }
        return c;
    }

private:
    static Axis follow(const Matrix<2>& map, const Two& push, const Two& w, std::size_t axis, double h, std::size_t n) {
        Axis c;
        Matrix<2> power{Two{1.0, 0.0}, Two{0.0, 1.0}};
        Matrix<4> spread{};  // covariance of [z, statistics]
        for (std::size_t j = 0; j < n; ++j) {
            const double middle = 0.5 * (static_cast<double>(n) - 1.0);
            const Complex at = turn(w[1 - axis] * h * (static_cast<double>(j) - middle));
            const Two weight{at.re / static_cast<double>(n), at.im / static_cast<double>(n)};
            Matrix<4> grow{};
            for (std::size_t s = 0; s < 2; ++s) {
                grow[s] = {map[s][0], map[s][1], 0.0, 0.0};
                grow[2 + s][0] = weight[s];
                grow[2 + s][2 + s] = 1.0;
                c.single[s] += weight[s] * weight[s];
                for (std::size_t k = 0; k < 2; ++k) {
                    c.measured[s][k] += weight[s] * power[0][k];
                }
            }
            const Matrix<2> next = product(map, power);
            for (std::size_t i = 0; i < 2; ++i) {
                for (std::size_t k = 0; k < 2; ++k) {
                    c.before[j][i][k] = 0.5 * (power[i][k] + next[i][k]);
                }
            }
            power = next;
            Matrix<4> transposed{};
            for (std::size_t i = 0; i < 4; ++i) {
                for (std::size_t k = 0; k < 4; ++k) {
                    transposed[i][k] = grow[k][i];
                }
            }
            spread = product(product(grow, spread), transposed);
            for (std::size_t i = 0; i < 2; ++i) {
                for (std::size_t k = 0; k < 2; ++k) {
                    spread[i][k] += push[i] * push[k];
                }
            }
            for (std::size_t b = 0; b < 2; ++b) {
                auto& found = c.force[b];
                const std::array<Complex, 4> old = found;
                for (std::size_t i = 0; i < 4; ++i) {
                    found[i] = {};
                    for (std::size_t k = 0; k < 4; ++k) {
                        found[i] = found[i] + grow[i][k] * old[k];
                    }
                    if (i < 2) {
                        found[i] = found[i] + push[i] * turn(w[b] * h * static_cast<double>(j));
                    }
                }
            }
        }
        c.disturbed = {spread[2][2], spread[3][3]};
        const double root = square_root(spread[0][0]), across = spread[0][1] / root;
        c.noise = {Two{root, across}, Two{0.0, square_root(maximum(spread[1][1] - across * across, 0.0))}};
        return c;
    }

    // H_d⁻¹ H_c of line b, with H_d the response of the sampled positions to held forces and H_c that to continuous
    // ones, without half a step of delay.
    void find_held(const PlantModel<double>& p, const Matrix<6>& step, std::size_t b, double w, double h) {
        const Sym2<double>&k = p.stiffness, &d = p.damping;
        w *= 1.0 + 1e-6;  // a response without damping is infinite at resonance
        const Complex xx{k.xx() - w * w, w * d.xx()}, yy{k.yy() - w * w, w * d.yy()};
        const Complex xy{k.xy(), w * (d.xy() - 2.0 * p.rate)}, yx{k.xy(), w * (d.xy() + 2.0 * p.rate)};
        const Complex determinant = xx * yy + -1.0 * (xy * yx), ahead = turn(w * h), half = turn(-0.5 * w * h);
        // e^(iwh) X = A X + G U with the positions of X known: four complex equations for two velocities and U.
        LeadingMatrix<8> equations{.size = 8};
        std::array<std::array<double, 2>, 8> found{};
        for (std::size_t i = 0; i < 4; ++i) {
            for (std::size_t part = 0; part < 2; ++part) {
                auto& row = equations[2 * i + part];
                for (std::size_t v = 0; v < 2; ++v) {
                    row[2 * v + part] -= step[i][2 + v];
                    row[4 + 2 * v + part] -= step[i][4 + v];
                    if (i == 2 + v) {
                        row[2 * v] += part == 0 ? ahead.re : ahead.im;
                        row[2 * v + 1] += part == 0 ? -ahead.im : ahead.re;
                    }
                }
            }
        }
        for (std::size_t column = 0; column < 2; ++column) {
            const std::array<Complex, 2> position = column == 0
                                                        ? std::array{yy / determinant, (-1.0 * yx) / determinant}
                                                        : std::array{(-1.0 * xy) / determinant, xx / determinant};
            for (std::size_t i = 0; i < 4; ++i) {
                Complex known{};
                for (std::size_t v = 0; v < 2; ++v) {
                    known = known + step[i][v] * position[v];
                }
                if (i < 2) {
                    known = known + -1.0 * (ahead * position[i]);
                }
                found[2 * i][column] = known.re;
                found[2 * i + 1][column] = known.im;
            }
        }
        solve(equations, found);
        for (std::size_t i = 0; i < 2; ++i) {
            for (std::size_t column = 0; column < 2; ++column) {
                held[b][i][column] = half * Complex{found[4 + 2 * i][column], found[5 + 2 * i][column]};
            }
        }
    }
};

}  // namespace fracgyro
