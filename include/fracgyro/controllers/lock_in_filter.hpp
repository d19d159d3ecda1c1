// The filter of the lock-in (lock_in.hpp): the work of a span, in tasks of at most some hundred
// instructions. All loops are written out (core/unrolled.hpp).
#pragma once

#include "fracgyro/controllers/lock_in_model.hpp"
#include "fracgyro/core/covariance.hpp"
#include "fracgyro/core/saved.hpp"

namespace fracgyro {

template <Scalar T>
struct LockInFilter {
    using Model = LockInModel<T>;
    using Complex = typename Model::Complex;
    using Lines = typename Model::Lines;
    using Four = typename Model::Four;
    using Row = typename Model::Row;
    static constexpr std::size_t motions = Model::motions, parameters = Model::parameters, size = motions + parameters,
                                 numbers = Model::numbers, rate = motions;
    using Covariance = FactoredCovariance<T, size>;

    struct Span {
        SineCosine2<T> phase{};     // at its first sample
        Vec2<T> sine{}, cosine{};   // sums of r and ṙ of an axis times the error of the other
        Kept<T, bool> seen = true;  // every sample was measured
    };
    struct Forces {
        Lines acted{}, acting{}, designed{};  // last span, this one, and the next
        Lines along{};                        // the force that keeps the estimated plant on the reference
        Lines lack{};                         // the force in the span of X, less that
        typename Model::Modulation coming{};  // next span
    };
    struct Agreement {
        T squares = T(1.0), along{}, sensitivity{};  // means of ν²/S, ν g/S, g²/S
        T explained{}, now{};      // part of ν²/S that an error of Ω̂z explains: its slow mean, and that of this span
        T beyond{};                // spans with refused numbers in a row
        T lasting{}, age{};        // spans that were too far off, less others; spans since the start
        T far{}, refused{};        // 1: a number of this span is refused; of the last one
        std::array<T, 3> sum{};    // sums of this span, for the means
        T lag{};                   // variance of Ω̂z by a rate that moves
        T deviation{}, trusted{};  // standard deviation of Ω̂z; 1: trusted
    };
    // Numbers between tasks.
    struct Scratch {
        std::array<T, 7> row{};  // coefficients of the active components
        std::array<T, size> f{}, moved{};
        T alpha{}, innovation{}, product{};
        T unknown{},
            moved_by{};  // squares of relative errors of a span's responses: by errors of K, by K less its nominal
        typename Covariance::Running gain{};
        typename Covariance::Added added{};
        std::array<Four, 8> columns{};
        std::array<T, 8> weight{}, weighted{};
        T inverse{}, off{}, known{}, again{};
        SineCosine2<T> at{};
        Four ahead{};
    };
    struct State {
        Span now{}, last{};
        Forces force{};
        Four motion{};  // z at the start of the last span or of this
        Row plant{};    // θ less the nominal plant
        typename Covariance::State covariance{};
        std::array<std::array<std::array<Complex, 4>, 2>, 2> response{};  // X: axis, line
        std::array<Four, motions> map{};                                  // A
        std::array<Four, parameters - 1> push{};                          // change of z by θ
        std::array<Vec2<T>, 2> seen{};                                    // statistics by line: cosine, sine
        Four difference{};                                                // statistics less those predicted
        Agreement agreement{};
        Scratch scratch{};
        std::int32_t task = 0;
    };

    // Tasks: of the start, of the statistics, of each number, and others.
    static constexpr std::int32_t starts = 8, first_number = starts + 4, parts = 17,
                                  after_numbers = first_number + static_cast<std::int32_t>(numbers) * parts,
                                  first_ahead = after_numbers + 45, tasks = first_ahead + 12;

    // Steps of the shortest span without those that have no task: its first, and three in which sines are made exact.
    static_assert(tasks - starts <= Model::shortest - 1 - 3 * (Model::shortest / 32 + 1));

    static bool sound(const State& state) {
        return fracgyro::sound(state.now.seen) && fracgyro::sound(state.last.seen) && state.task >= 0 &&
               state.task <= tasks;
    }

    // A new span. `fresh`: all before is unknown, except the plant.
    static void begin(State& state, const Model& c, const ReferencePoint<T>& r, bool fresh) {
        state.last.phase = state.now.phase;
        state.last.sine = state.now.sine;
        state.last.cosine = state.now.cosine;
        state.last.seen = state.now.seen;
        state.now.phase = {.sine = c.scales.inverse_amplitude * r.position,
                           .cosine = c.scales.inverse_speed * r.velocity};
        state.now.sine = state.now.cosine = {};
        state.now.seen = true;
        state.task = fresh ? 0 : starts;
    }

    // One task.
    [[gnu::noinline, gnu::flatten]] static void work(State& state, const Model& c) {
        const std::int32_t task = state.task;
        state.task = task + 1;
        if (task < first_number) {
            return prepare(state, c, task);
        }
        if (task < after_numbers) {
            const std::int32_t of_numbers = task - first_number, number = of_numbers / parts;
            const auto part = of_numbers - number * parts;
            return number < 2 ? learn<0>(state, c, number, part) : learn<1>(state, c, number, part);
        }
        follow(state, c, task - after_numbers);
    }

private:
    static Complex times(const Complex& a, const Complex& b) { return Model::times(a, b); }
    static T imaginary(const Complex& a, const Complex& b) { return a.x() * b.y() + a.y() * b.x(); }

    static void prepare(State& state, const Model& c, std::int32_t task) {
        switch (task) {
            case 0:
                return clear<0, 33>(state);
            case 1:
                return clear<33, Covariance::column(size)>(state);
            case 2:
                return reset_motion(state, c);
            case 3:
                return reset_plant(state, c);
            case 4:
                return reset_agreement(state);
            case 5:
                return find_along<0>(state, c);
            case 6:
                return find_along<1>(state, c);
            case 7:
                return begin_ahead(state, c);
            case 8:
                return find_statistics(state, c);
            case 9:
                return find_left_out(state, c);
            case 10:
                return compare<0>(state, c);
            default:
                return compare<1>(state, c);
        }
    }
    template <std::size_t axis>
    static void learn(State& state, const Model& c, std::int32_t number, std::int32_t task) {
        switch (task) {
            case 0:
                return find_row<axis>(state, c, static_cast<std::size_t>(number));
            case 1:
                return weigh<axis, 4, 8>(state);
            case 2:
                return weigh<axis, 8, 10>(state);
            case 3:
                return weigh<axis, 10, 12>(state);
            case 4:
                return surprise<axis>(state, static_cast<std::size_t>(number));
            case 5:
                return judge(state, c, static_cast<std::size_t>(number));
            case 6:
                return absorb<0, 4>(state);
            case 7:
                return absorb<4, 6>(state);
            case 8:
                return absorb<6, 7>(state);
            case 9:
                return absorb<7, 8>(state);
            case 10:
                return absorb<8, 9>(state);
            case 11:
                return absorb<9, 10>(state);
            case 12:
                return absorb_rows<10, 0, 5>(state);
            case 13:
                return absorb_rows<10, 5, 10>(state);
            case 14:
                return absorb_rows<11, 0, 5>(state);
            case 15:
                return absorb_rows<11, 5, 11>(state);
            default:
                return correct(state);
        }
    }
    static void follow(State& state, const Model& c, std::int32_t task) {
        switch (task) {
            case 0:
                return settle(state, c);
            case 1:
                return average(state, c);
            case 2:
                return find_variance(state);
            case 3:
                return explain(state, c);
            case 4:
                return state_deviation(state, c);
            case 5:
                return trust(state, c);
            case 6:
                return forget<0, 22>(state);
            case 7:
                return forget<22, 44>(state);
            case 8:
                return forget<44, Covariance::column(size)>(state);
            case 9:
                return learn_again(state, c);
            case 10:
                return find_along<0>(state, c);
            case 11:
                return find_along<1>(state, c);
            case 12:
                return correct_map<0>(state, c);
            case 13:
                return correct_map<1>(state, c);
            case 14:
                return find_lack(state, state.force.acted);
            case 15:
                return carry(state);
            case 16:
                return advance(state);
            case 17:
                return push<0>(state, c);
            case 18:
                return push<1>(state, c);
            case 19:
                return spread<0>(state, c);
            case 20:
                return spread<1>(state, c);
            case 21:
                return spread<2>(state, c);
            case 22:
                return spread<3>(state, c);
            case 23:
                return spread<4>(state, c);
            case 24:
                return spread<5>(state, c);
            case 25:
                return spread<6>(state, c);
            case 26:
                return move_drift(state);
            case 27:
                return spread<7>(state, c);
            case 28:
                return column<0>(state, c);
            case 29:
                return column<1>(state, c);
            case 30:
                return column<2>(state, c);
            case 31:
                return column<3>(state, c);
            case 32:
                return normalize<3>(state);
            case 33:
                return orthogonalize<3, 0>(state);
            case 34:
                return orthogonalize<3, 1>(state);
            case 35:
                return orthogonalize<3, 2>(state);
            case 36:
                return normalize<2>(state);
            case 37:
                return orthogonalize<2, 0>(state);
            case 38:
                return orthogonalize<2, 1>(state);
            case 39:
                return normalize<1>(state);
            case 40:
                return orthogonalize<1, 0>(state);
            case 41:
                return normalize<0>(state);
            case 42:
                return drift(state, c);
            case 43:
                return drift_rate(state, c);
            case 44:
                return drift_motion(state);
            default:
                return look(state, c, task - (first_ahead - after_numbers));
        }
    }
    static void look(State& state, const Model& c, std::int32_t task) {
        switch (task) {
            case 0:
                return respond<0, 0>(state, c);
            case 1:
                return respond<0, 1>(state, c);
            case 2:
                return respond<1, 0>(state, c);
            case 3:
                return respond<1, 1>(state, c);
            case 4:
                return find_lack(state, state.force.acting);
            case 5:
                return carry(state);
            case 6:
                return look_ahead(state);
            case 7:
                return find_phase(state, c);
            case 8:
                return feed_back(state, c);
            case 9:
                return limit(state, c);
            case 10:
                return modulate<0>(state, c);
            default:
                return modulate<1>(state, c);
        }
    }

    // The start: P of the prior, no motion.
    template <std::size_t begin, std::size_t end>
    static void clear(State& state) {
        unrolled<begin, end>([&](auto i) { state.covariance.u_factor[i] = T(0.0); });
    }
    static void reset_motion(State& state, const Model& c) {
        unrolled<0, motions>([&](auto i) { state.covariance.d_factor[i] = c.prior.motion[i]; });
        state.motion = {};
    }
    static void reset_plant(State& state, const Model& c) {
        unrolled<0, parameters>([&](auto k) { state.covariance.d_factor[motions + k] = c.prior.plant[k]; });
    }
    static void reset_agreement(State& state) { state.agreement = {}; }
    static void begin_ahead(State& state, const Model& c) {
        state.map = c.map;
        state.task = first_ahead;
    }

    // Statistics of the last span: means of e cos and e sin about its middle, by line.
    static void find_statistics(State& state, const Model& c) {
        const SineCosine2<T> middle = state.last.phase * c.turns.middle;
        const Vec2<T> sine = c.scales.sine * state.last.sine, cosine = c.scales.cosine * state.last.cosine;
        state.seen[0] = cosine * middle.cosine + sine * middle.sine;
        state.seen[1] = sine * middle.cosine - cosine * middle.sine;
        Agreement& a = state.agreement;
        a.far = a.sum[0] = a.sum[1] = a.sum[2] = T(0.0);
    }
    // An error of K turns the motion within half a span.
    static void find_left_out(State& state, const Model& c) {
        Scratch& w = state.scratch;
        const T x = state.plant[4], y = state.plant[6];
        const T variance =
            Covariance::variance(state.covariance, motions + 4) + Covariance::variance(state.covariance, motions + 6);
        w.unknown = c.noise.left_out * variance;
        w.moved_by = c.noise.left_out * c.noise.precision * (x * x + y * y);
    }
    template <std::size_t axis>
    static void compare(State& state, const Model& c) {
        unrolled<0, 2>([&](auto s) {
            const auto& h = c.measured[2 * axis + s];
            const auto& x = state.response[axis];
            const T still = h[0] * state.motion[axis] + h[1] * state.motion[2 + axis];
            const T forced =
                imaginary(x[0][2 + s], state.force.lack[axis][0]) + imaginary(x[1][2 + s], state.force.lack[axis][1]);
            state.difference[2 * axis + s] = of_other(state.seen[s], axis) - (still + forced);
        });
        unrolled<axis * size / 2, (axis + 1) * size / 2>([&](auto i) { state.scratch.moved[i] = T(0.0); });
    }
    static T of_other(const Vec2<T>& a, std::size_t axis) { return axis == 0 ? a.y() : a.x(); }

    // Components that a number of an axis depends on.
    template <std::size_t axis>
    static constexpr std::array<std::size_t, 7> active = {axis, 2 + axis, rate, 5 + axis, 6 + axis, 8 + axis, 9 + axis};

    template <std::size_t axis>
    static void find_row(State& state, const Model& c, std::size_t number) {
        const std::size_t s = number % 2;
        auto& row = state.scratch.row;
        const Complex x = state.response[axis][0][2 + s], y = state.response[axis][1][2 + s];
        const T of_x = -(c.scales.frequency.x() * x.x()), of_y = -(c.scales.frequency.y() * y.x());
        row = {c.measured[number][0],
               c.measured[number][1],
               axis == 0 ? T(-2.0) * of_y : T(2.0) * of_x,
               of_x,
               of_y,
               -x.y(),
               -y.y()};
        state.scratch.alpha = c.noise.measured[number];
        weigh<axis, 0, 4>(state);
    }
    template <std::size_t axis, std::size_t begin, std::size_t end>
    static void weigh(State& state) {
        Scratch& w = state.scratch;
        T alpha = w.alpha;
        unrolled<begin, end>([&](auto j) {
            T f = T(0.0);
            unrolled<0, 7>([&](auto n) {
                constexpr std::size_t i = active<axis>[n];
                if constexpr (n == 0 && i < j) {
                    f = w.row[n] * state.covariance.u_factor[Covariance::column(j) + i];
                } else if constexpr (i < j) {
                    f = f + w.row[n] * state.covariance.u_factor[Covariance::column(j) + i];
                } else if constexpr (i == j) {
                    f = n == 0 ? w.row[n] : f + w.row[n];
                }
            });
            w.f[j] = f;
            alpha = alpha + f * f * state.covariance.d_factor[j];
        });
        w.alpha = alpha;
    }
    // The innovation of a number. Products of errors, which the model neglects, count as its noise.
    template <std::size_t axis>
    static void surprise(State& state, std::size_t number) {
        Scratch& w = state.scratch;
        T innovation = state.difference[number];
        unrolled<0, 7>([&](auto n) { innovation = innovation - w.row[n] * w.moved[active<axis>[n]]; });
        const T e = state.motion[axis], v = state.motion[2 + axis];
        w.innovation = innovation;
        const T motion = e * e + v * v;
        w.product = w.unknown * (innovation * innovation + motion) + w.moved_by * motion;
    }
    // Refuses a number that is too far from the predicted one: to a noise beyond all it adds nothing.
    static void judge(State& state, const Model& c, std::size_t number) {
        Scratch& w = state.scratch;
        Agreement& a = state.agreement;
        const T zero = T(0.0), one = T(1.0), square = w.innovation * w.innovation;
        const T g = w.f[rate];
        const T variance = c.noise.variance * (w.alpha + w.product) + a.lag * (g * g);
        const T limit = T(max_innovation * max_innovation) * variance;
        const T inside = if_less(square, limit, one, zero);  // 0 for NaN
        const T learns = state.last.seen ? if_less(a.beyond, T(max_refused), inside, one) : zero;
        a.far = if_less(zero, inside, a.far, one);
        w.innovation = if_less(zero, learns, w.innovation, zero);
        const T noise = if_less(zero, learns, c.noise.measured[number] + w.product, T(beyond_all));
        w.gain.found.variance = noise;
        w.gain.inverse = T(1.0) / noise;
    }
    // Rows of a column, or of all columns from `begin` to `end`.
    template <std::size_t j, std::size_t begin, std::size_t end>
    static void absorb_rows(State& state) {
        Scratch& w = state.scratch;
        if constexpr (begin == 0) {
            Covariance::open_column(state.covariance, w.gain, j, w.f[j]);
        }
        unrolled<begin, end>([&](auto k) { Covariance::absorb_row(state.covariance, w.gain, j, k); });
        if constexpr (end == j) {
            Covariance::close_column(state.covariance, w.gain, j, w.f[j]);
        }
    }
    template <std::size_t begin, std::size_t end>
    static void absorb(State& state) {
        unrolled<begin, end>([&](auto j) { absorb_rows<j, 0, j>(state); });
    }
    static void correct(State& state) {
        Scratch& w = state.scratch;
        const T inverse = w.gain.inverse, scaled = inverse * w.innovation, g = w.f[rate];
        unrolled<0, size>([&](auto k) { w.moved[k] = w.moved[k] + w.gain.found.move[k] * scaled; });
        auto& sum = state.agreement.sum;
        sum[0] = sum[0] + w.innovation * scaled;
        sum[1] = sum[1] + g * scaled;
        sum[2] = sum[2] + g * g * inverse;
    }

    static void settle(State& state, const Model& c) {
        const auto& moved = state.scratch.moved;
        unrolled<0, motions>([&](auto i) { state.motion[i] = state.motion[i] + moved[i]; });
        unrolled<0, parameters>([&](auto k) { state.plant[k] = state.plant[k] + moved[motions + k]; });
        unrolled<0, 3>([&](auto i) {  // K advances by its drift
            state.plant[4 + i] = state.plant[4 + i] + state.plant[parameters - 1] * c.prior.ramp[i];
        });
    }

    // Means over a window, once the motion and the plant are found.
    static void average(State& state, const Model& c) {
        Agreement& a = state.agreement;
        const T zero = T(0.0), one = T(1.0), quarter = T(0.25);
        a.refused = a.far;
        a.beyond = a.far * minimum(a.beyond + one, T(max_refused));
        a.age = minimum(a.age + one, T(oldest));
        const T weight = state.last.seen ? if_less(a.age, T(first_judged), zero, T(1.0 / window)) : zero;
        a.squares = a.squares + weight * (quarter * c.noise.precision * a.sum[0] - a.squares);
        a.along = a.along + weight * (a.sum[1] - a.along);
        a.sensitivity = a.sensitivity + weight * (a.sum[2] - a.sensitivity);
    }
    static void find_variance(State& state) { state.scratch.known = Covariance::variance(state.covariance, rate); }
    static void explain(State& state, const Model& c) {
        Agreement& a = state.agreement;
        Scratch& w = state.scratch;
        const T zero = T(0.0), one = T(1.0);
        w.inverse = c.noise.variance / maximum(a.sensitivity, T(Covariance::vanishing));
        a.now = T(0.25) * c.noise.precision * c.noise.precision * (a.along * a.along) * w.inverse;
        a.explained = a.explained + T(0.125 / window) * (a.now - a.explained);
        const T limit = T(max_excess) + T(max_unexplained) * a.explained;
        w.off = if_less(a.squares - a.now, limit, zero, one);
        a.lasting = maximum(a.lasting + (w.off + w.off - one), zero);
    }
    static void state_deviation(State& state, const Model& c) {
        Agreement& a = state.agreement;
        const Scratch& w = state.scratch;
        constexpr double chance = 0.5 / (4.0 * window);  // share that noise explains
        const T rest = maximum(a.squares - T(max_excess), T(0.0));
        const T lag = maximum(a.now - T(16.0 * chance), a.explained - T(3.0 * chance)), per_rate = T(4.0) * w.inverse;
        a.lag = per_rate * maximum(lag, T(0.0));
        const T excess = maximum(a.squares - a.now, T(1.0));
        a.deviation = square_root(c.noise.variance * w.known * excess + per_rate * maximum(lag, rest));
    }
    static void trust(State& state, const Model& c) {
        Agreement& a = state.agreement;
        const Scratch& w = state.scratch;
        const T zero = T(0.0), one = T(1.0);
        T good = if_less(w.known, T(max_inflation) * state.covariance.d_factor[rate], one, zero);
        good = if_less(w.known, T(max_share) * c.prior.plant[0], good, zero);
        good = if_less(a.age, T(first_trusted), zero, good);
        a.trusted = if_less(w.off + a.far, T(0.5), good, zero);
        state.scratch.again = if_less(a.lasting, T(patience), zero, one);
    }
    // Makes D, K, Ωz and the motion unknown again, in the runs for which `again` is 1.
    template <std::size_t begin, std::size_t end>
    static void forget(State& state) {
        const T again = state.scratch.again, zero = T(0.0);
        if (!always_less(again, T(0.5))) {
            unrolled<begin, end>([&](auto i) {
                T& u = state.covariance.u_factor[i];
                u = if_less(zero, again, zero, u);
            });
        }
    }
    static void learn_again(State& state, const Model& c) {
        const T again = state.scratch.again, zero = T(0.0);
        if (always_less(again, T(0.5))) {
            return;
        }
        const auto instead = [&](T& a, T b) { a = if_less(zero, again, b, a); };
        unrolled<0, motions>([&](auto i) { instead(state.covariance.d_factor[i], c.prior.motion[i]); });
        unrolled<0, parameters>([&](auto k) { instead(state.covariance.d_factor[motions + k], c.prior.plant[k]); });
        Agreement& a = state.agreement;
        instead(a.squares, T(1.0));
        for (T* const other : {&a.along, &a.sensitivity, &a.explained, &a.lasting, &a.age, &a.lag}) {
            instead(*other, zero);
        }
    }

    template <std::size_t line>
    static void find_along(State& state, const Model& c) {
        const auto found = c.template along<line>(state.plant);
        state.force.along[0][line] = found[0];
        state.force.along[1][line] = found[1];
    }

    // A at the estimates, for the rows of one axis.
    template <std::size_t axis>
    static void correct_map(State& state, const Model& c) {
        const Row& x = state.plant;
        const T twice = T(2.0) * x[0];
        const std::array<T, 2> spring{x[4 + axis], x[5 + axis]};
        const std::array<T, 2> damper{axis == 0 ? x[1] : x[2] + twice, axis == 0 ? x[2] - twice : x[3]};
        unrolled<0, 2>([&](auto b) {
            const auto& change = c.change[axis][b];  // by spring, by damper
            unrolled<0, 4>([&](auto k) {
                const std::size_t i = axis + 2 * (k / 2), j = b + 2 * (k % 2);
                state.map[i][j] = c.map[i][j] + (spring[b] * change[0][k] + damper[b] * change[1][k]);
            });
        });
    }

    static Four through(const std::array<Four, motions>& a, const Four& x) {
        Four y;
        unrolled<0, motions>(
            [&](auto i) { y[i] = (a[i][0] * x[0] + a[i][1] * x[1]) + (a[i][2] * x[2] + a[i][3] * x[3]); });
        return y;
    }
    static void find_lack(State& state, const Lines& force) {
        unrolled<0, 2>([&](auto a) {
            unrolled<0, 2>([&](auto b) { state.force.lack[a][b] = force[a][b] - state.force.along[a][b]; });
        });
    }
    // z after the span of X: by A, and by the forces.
    static void carry(State& state) { state.scratch.ahead = through(state.map, state.motion); }
    static Four forced(const State& state) {
        Four next = state.scratch.ahead;
        unrolled<0, motions>([&](auto k) {
            constexpr std::size_t a = k % 2, i = k / 2;
            const auto& x = state.response[a];
            const auto& lack = state.force.lack[a];
            next[k] = next[k] + (imaginary(x[0][i], lack[0]) + imaginary(x[1][i], lack[1]));
        });
        return next;
    }
    static void advance(State& state) { state.motion = forced(state); }
    static void look_ahead(State& state) { state.scratch.ahead = forced(state); }
    // Sensitivity of z of one axis to θ.
    template <std::size_t axis>
    static void push(State& state, const Model& c) {
        unrolled<0, 2>([&](auto i) {
            const Complex x = state.response[axis][0][i], y = state.response[axis][1][i];
            const T of_x = -(c.scales.frequency.x() * x.x()), of_y = -(c.scales.frequency.y() * y.x());
            constexpr std::size_t at = axis + 2 * i;
            state.push[0][at] = axis == 0 ? T(-2.0) * of_y : T(2.0) * of_x;
            state.push[1 + axis][at] = of_x;
            state.push[2 + axis][at] = of_y;
            state.push[4 + axis][at] = -x.y();
            state.push[5 + axis][at] = -y.y();
        });
    }

    // The last column in two tasks.
    static void move_drift(State& state) {
        T* const column = &state.covariance.u_factor[Covariance::column(size - 1)];
        const Four moved = through(state.map, {column[0], column[1], column[2], column[3]});
        unrolled<0, motions>([&](auto i) { column[i] = moved[i]; });
    }
    // Column j of the cross part of U over the span.
    template <std::size_t j>
    static void spread(State& state, const Model& c) {
        T* const column = &state.covariance.u_factor[Covariance::column(motions + j)];
        Four moved{column[0], column[1], column[2], column[3]};
        if constexpr (j + 1 < parameters) {
            moved = through(state.map, moved);
        }
        unrolled<0, (j < parameters - 1 ? j + 1 : parameters - 1)>([&](auto k) {
            const T share = [&] {
                if constexpr (k == j) {
                    return T(1.0);
                } else {
                    return column[motions + k];
                }
            }();
            unrolled<0, motions>([&](auto i) {
                // D and K of one axis push that axis only.
                constexpr bool none = ((k == 1 || k == 4) && i % 2 == 1) || ((k == 3 || k == 6) && i % 2 == 0);
                if constexpr (!none && k == j) {
                    moved[i] = moved[i] + state.push[k][i];
                } else if constexpr (!none) {
                    moved[i] = moved[i] + state.push[k][i] * share;
                }
            });
        });
        unrolled<0, motions>([&](auto i) { column[i] = moved[i]; });
        if constexpr (j + 1 == parameters) {
            unrolled<0, 3>([&](auto i) { column[motions + 4 + i] = column[motions + 4 + i] + c.prior.ramp[i]; });
        }
    }

    // Column j of [A U, noise], the part of z, and that of a noise, with their weights.
    template <std::size_t j>
    static void column(State& state, const Model& c) {
        Scratch& w = state.scratch;
        unrolled<0, motions>([&](auto i) {
            T sum = state.map[i][j];
            unrolled<0, j>(
                [&](auto k) { sum = sum + state.map[i][k] * state.covariance.u_factor[Covariance::column(j) + k]; });
            w.columns[j][i] = sum;
            w.columns[4 + j][i] = i % 2 == j / 2 ? (i < 2 ? c.noise.columns[j].x() : c.noise.columns[j].y()) : T(0.0);
        });
        w.weight[j] = state.covariance.d_factor[j];
        w.weight[4 + j] = state.last.seen ? c.noise.force : c.prior.motion[0];  // the force was another
    }
    // d of row i.
    template <std::size_t i>
    static void normalize(State& state) {
        Scratch& w = state.scratch;
        T sum = T(0.0);
        unrolled<0, 8>([&](auto j) {
            const T weighted = w.weight[j] * w.columns[j][i];
            sum = sum + weighted * w.columns[j][i];
            w.weighted[j] = weighted;
        });
        state.covariance.d_factor[i] = sum;
        w.inverse = T(1.0) / maximum(sum, T(Covariance::vanishing));
    }
    // U of row k and column i, and row k freed of row i.
    template <std::size_t i, std::size_t k>
    static void orthogonalize(State& state) {
        Scratch& w = state.scratch;
        T shared = T(0.0);
        unrolled<0, 8>([&](auto j) { shared = shared + w.weighted[j] * w.columns[j][k]; });
        const T factor = shared * w.inverse;
        state.covariance.u_factor[Covariance::column(i) + k] = factor;
        unrolled<0, 8>([&](auto j) { w.columns[j][k] = w.columns[j][k] - factor * w.columns[j][i]; });
    }

    // Variances grow, at most to the prior.
    static void drift(State& state, const Model& c) {
        unrolled<1, parameters>([&](auto k) {
            T& d = state.covariance.d_factor[motions + k];
            d = d + c.prior.drift[k] * maximum(T(0.0), T(1.0) - d * c.prior.inverse[k]);
        });
    }
    static void drift_rate(State& state, const Model& c) {
        const T one = T(1.0), zero = T(0.0), d = state.covariance.d_factor[rate];
        const T haste = if_less(state.agreement.age, T(first_trusted), T(rate_haste), one);
        auto& added = state.scratch.added;
        added.left = minimum(haste * c.prior.drift[0], c.prior.plant[0]) * maximum(zero, one - d * c.prior.inverse[0]);
        unrolled<0, rate>([&](auto i) { added.share[i] = zero; });
        added.share[rate] = one;
        Covariance::template add_column<rate>(state.covariance, added);
    }
    static void drift_motion(State& state) {
        auto& added = state.scratch.added;
        unrolled<1, rate>([&](auto i) { Covariance::template add_column<rate - i>(state.covariance, added); });
        Covariance::add_first(state.covariance, added);
    }

    // X of this span.
    template <std::size_t axis, std::size_t line>
    static void respond(State& state, const Model& c) {
        const SineCosine2<T> at = state.now.phase * c.turns.half;
        const Complex turn = line == 0 ? Complex{at.cosine.x(), at.sine.x()} : Complex{at.cosine.y(), at.sine.y()};
        unrolled<0, 4>([&](auto i) { state.response[axis][line][i] = times(c.response[axis][line][i], turn); });
    }
    static void find_phase(State& state, const Model& c) { state.scratch.at = state.now.phase * c.turns.over; }
    // The error e = α sin φ + β cos φ at the start of the next span decays.
    static void feed_back(State& state, const Model& c) {
        const SineCosine2<T>& at = state.scratch.at;
        const Four& z = state.scratch.ahead;
        const Vec2<T> e{z[0], z[1]}, v = c.scales.inverse_frequency * Vec2<T>{z[2], z[3]};
        const Vec2<T> alpha = e * at.sine + v * at.cosine, beta = e * at.cosine - v * at.sine;
        const Vec2<T> re = c.force.feedback * beta, im = c.force.feedback * alpha;
        auto& designed = state.force.designed;
        designed = state.force.along;
        designed[0][0] = designed[0][0] + Complex{re.x(), -im.x()};
        designed[1][1] = designed[1][1] + Complex{re.y(), -im.y()};
    }
    static void limit(State& state, const Model& c) {
        if (c.force.saturation.limited) {
            c.limit(state.force.designed[0]);
            c.limit(state.force.designed[1]);
        }
    }
    template <std::size_t line>
    static void modulate(State& state, const Model& c) {
        auto& force = state.force;
        c.template modulate<line>(force.coming, force.designed);
        if (c.force.is_late) {  // the span starts with the last force
            unrolled<0, 2>([&](auto a) {
                Complex& w = force.designed[a][line];
                w = w + c.force.late * (force.acting[a][line] - w);
            });
        }
    }

    static constexpr double max_innovation = 8.0, max_refused = 3.0, beyond_all = 1e18;
    static constexpr double window = 128.0, max_excess = 1.25, max_unexplained = 3.0, patience = 512.0;
    static constexpr double max_inflation = 10.0, max_share = 0.01, rate_haste = 1000.0;
    static constexpr double first_judged = 32.0, first_trusted = 256.0, oldest = 1e6;  // spans
};

}  // namespace fracgyro
