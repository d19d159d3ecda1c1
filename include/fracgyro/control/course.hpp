// 1  References of every kind, evaluated at any step from closed forms, in double precision.
//
//    A step, a ramp or a staircase passes the filter 1/(1 + s T)^n. With x = t/T and E = e^-x, the response to a unit
//    step at t = 0 is
//        S = 1 - E Σ_{k<n} x^k/k!,       S' = E x^(n-1)/((n-1)! T),       ∫ S = t - n T + T E Σ_{k<n} (n - k) x^k/k!
//    and without a filter S = 1 and ∫ S = t.
//
//    A chirp is amplitude·sin(phase + (f + ½ g t) t), g = (final frequency - f)/(end - start), t from start on; after
//    its end it continues at its final frequency.
//
//    A table has a row for each of its times. Before the first and after the last row, r rests there.
#pragma once

#include "fracgyro/control/reference.hpp"

namespace fracgyro {

namespace detail {

struct AxisPoint {
    double position = 0.0, velocity = 0.0, acceleration = 0.0;

    friend constexpr AxisPoint operator+(const AxisPoint& a, const AxisPoint& b) {
        return {a.position + b.position, a.velocity + b.velocity, a.acceleration + b.acceleration};
    }
    friend constexpr AxisPoint operator*(double a, const AxisPoint& b) {
        return {a * b.position, a * b.velocity, a * b.acceleration};
    }
};

inline AxisPoint sine_at(double amplitude, double frequency, const SineCosine<double>& at) {
    const double position = amplitude * at.sine;
    return {position, amplitude * frequency * at.cosine, -frequency * frequency * position};
}

// Response of the filter to a unit step at t = 0, and to a unit ramp.
struct Smoothed {
    AxisPoint step{}, ramp{};

    Smoothed(double t, double constant, int order) {
        if (t < 0.0) {
            return;
        }
        if (constant == 0.0) {
            step.position = 1.0;
            ramp = {t, 1.0, 0.0};
            return;
        }
        const double x = t / constant, decayed = exponential(-x);
        double term = decayed, before = 0.0, sum = 0.0, weighted = 0.0;  // E x^k/k!, and the one before
        double last = 0.0;
        for (int k = 0; k < order; ++k) {
            sum = sum + term;
            weighted = weighted + static_cast<double>(order - k) * term;
            before = last;
            last = term;
            term = term * x / static_cast<double>(k + 1);
        }
        step = {1.0 - sum, last / constant, (before - last) / (constant * constant)};
        ramp = {t - static_cast<double>(order) * constant + constant * weighted, step.position, step.velocity};
    }
};

inline AxisPoint staircase_at(const ReferenceParams& p, double amplitude, double t) {
    if (t < 0.0) {
        return {};
    }
    // Older steps are complete: for a filter constant of at most the hold, to within rounding.
    constexpr std::int64_t recent = 64;
    const double passed = minimum(t / p.hold + 1.0, p.levels);
    const auto climbed = static_cast<std::int64_t>(passed);
    const std::int64_t complete = climbed > recent ? climbed - recent : 0;
    AxisPoint sum{static_cast<double>(complete), 0.0, 0.0};
    for (std::int64_t level = complete; level < climbed; ++level) {
        sum = sum +
              Smoothed(t - static_cast<double>(level) * p.hold, p.smoothing, static_cast<int>(p.smoothing_order)).step;
    }
    return amplitude * sum;
}

inline AxisPoint chirp_at(double amplitude, double from, double to, double phase, double t, double length) {
    const double growth = (to - from) / length, within = clamp(t, 0.0, length), after = t - within;
    const double frequency = from + growth * within;
    const double angle = phase + (from + 0.5 * growth * within) * within + to * after;
    const SineCosine<double> at = sine_cosine<double>(phase_of(angle));
    AxisPoint point = sine_at(amplitude, frequency, at);
    if (t < length) {
        point.acceleration = point.acceleration + amplitude * growth * at.cosine;
    }
    return point;
}

// The polynomial of fifth degree between two rows, at the fraction s of the time between them.
inline AxisPoint between(const TableRow& a, const TableRow& b, std::size_t axis, double s, double length) {
    const double p0 = a.position[axis], p1 = b.position[axis];
    const double v0 = length * a.velocity[axis], v1 = length * b.velocity[axis];
    const double a0 = length * length * a.acceleration[axis], a1 = length * length * b.acceleration[axis];
    const double rise = p1 - p0;
    const double c3 = 10.0 * rise - 6.0 * v0 - 4.0 * v1 - 1.5 * a0 + 0.5 * a1;
    const double c4 = -15.0 * rise + 8.0 * v0 + 7.0 * v1 + 1.5 * a0 - a1;
    const double c5 = 6.0 * rise - 3.0 * (v0 + v1) - 0.5 * (a0 - a1);
    const double position = p0 + s * (v0 + s * (0.5 * a0 + s * (c3 + s * (c4 + s * c5))));
    const double velocity = v0 + s * (a0 + s * (3.0 * c3 + s * (4.0 * c4 + s * (5.0 * c5))));
    const double acceleration = a0 + s * (6.0 * c3 + s * (12.0 * c4 + s * (20.0 * c5)));
    return {position, velocity / length, acceleration / (length * length)};
}

// The place of a time among the rows of a table: from row `row` on, by `share` of the time to the next.
struct Place {
    std::size_t row = 0;
    double share = 0.0, length = 1.0;
    bool rests = false;  // before the first row, or after the last
};
inline Place place_of(std::span<const TableRow> rows, double t) {
    const double first = rows.front().time, last = rows.back().time;
    if (!(first < t && t < last)) {
        return {.row = t < last ? 0 : rows.size() - 1, .rests = t != first && t != last};
    }
    // Rows of equal distance are found at once, others by bisection.
    auto low = static_cast<std::size_t>((t - first) / (last - first) * static_cast<double>(rows.size() - 1));
    if (!(low + 1 < rows.size() && rows[low].time <= t && t < rows[low + 1].time)) {
        low = 0;
        for (std::size_t high = rows.size() - 1; high - low > 1;) {
            const std::size_t middle = low + (high - low) / 2;
            (rows[middle].time <= t ? low : high) = middle;
        }
    }
    const double length = rows[low + 1].time - rows[low].time;
    return {.row = low, .share = (t - rows[low].time) / length, .length = length};
}
inline AxisPoint table_at(std::span<const TableRow> rows, std::size_t axis, const Place& at) {
    const TableRow& row = rows[at.row];
    if (at.rests) {
        return {row.position[axis], 0.0, 0.0};
    }
    if (at.share == 0.0) {
        return {row.position[axis], row.velocity[axis], row.acceleration[axis]};
    }
    return between(row, rows[at.row + 1], axis, at.share, at.length);
}

// `lead`: 0, or that of the held point.
inline AxisPoint axis_at(const Course& c, std::size_t axis, std::uint64_t n, double lead) {
    const ReferenceParams& p = c.params;
    const auto of = [&](const Vec2<double>& both) { return axis == 0 ? both.x() : both.y(); };
    const double time = (static_cast<double>(n) + lead) * c.step, t = time - p.start;
    const auto sine = [&](double amplitude, double frequency, double phase) {
        const double angle = frequency * c.step;
        const auto at = sine_cosine<double>(phase_of(phase) + n * phase_of(angle) + phase_of(lead * angle));
        return sine_at(lead > 0.0 ? amplitude / held_share(angle) : amplitude, frequency, at);
    };
    const auto smoothed = [&](double since) {
        return Smoothed(since, p.smoothing, static_cast<int>(p.smoothing_order));
    };
    const double length = p.end - p.start;  // infinity if there is no end
    switch (p.kind[axis]) {
        case ReferenceKind::sine:
            return sine(of(p.amplitude), of(p.frequency), of(p.phase));
        case ReferenceKind::sines: {
            AxisPoint sum{};
            for (const SineTerm& term : c.terms) {
                sum = sum + sine(term.amplitude[axis], term.frequency[axis], term.phase[axis]);
            }
            return sum;
        }
        case ReferenceKind::step:
            return of(p.amplitude) * (smoothed(t).step + -1.0 * smoothed(t - length).step);
        case ReferenceKind::ramp:
            return of(p.slope) * (smoothed(t).ramp + -1.0 * smoothed(t - length).ramp);
        case ReferenceKind::chirp:
            return t < 0.0 ? AxisPoint{}
                           : chirp_at(of(p.amplitude), of(p.frequency), of(p.final_frequency), of(p.phase), t, length);
        case ReferenceKind::staircase:
            return staircase_at(p, of(p.amplitude), t);
        case ReferenceKind::table:
            return c.rows.empty() ? AxisPoint{} : table_at(c.rows, axis, place_of(c.rows, time));
        case ReferenceKind::rest:
            break;
    }
    return {};
}

// Mean squares of position, without the offset, and velocity of an axis that does not rest in the end.
struct MeanSquares {
    double position = 0.0, velocity = 0.0;
};
inline MeanSquares mean_squares(const Course& c, std::size_t axis) {
    const ReferenceParams& p = c.params;
    const auto of = [&](const Vec2<double>& both) { return axis == 0 ? both.x() : both.y(); };
    const auto line = [](double amplitude, double square) {
        return MeanSquares{0.5 * amplitude * amplitude, 0.5 * amplitude * amplitude * square};
    };
    MeanSquares sum{};
    switch (p.kind[axis]) {
        case ReferenceKind::sine:
            return line(of(p.amplitude), of(p.frequency) * of(p.frequency));
        case ReferenceKind::chirp: {
            const double from = of(p.frequency), to = of(p.final_frequency);
            return line(of(p.amplitude), (from * from + from * to + to * to) / 3.0);
        }
        case ReferenceKind::sines:
            for (const SineTerm& term : c.terms) {
                const MeanSquares one = line(term.amplitude[axis], term.frequency[axis] * term.frequency[axis]);
                sum = {sum.position + one.position, sum.velocity + one.velocity};
            }
            return sum;
        case ReferenceKind::table: {
            const auto count = static_cast<double>(c.rows.size());
            double mean = 0.0;
            for (const TableRow& row : c.rows) {
                mean = mean + row.position[axis] / count;
                sum.velocity = sum.velocity + row.velocity[axis] * row.velocity[axis] / count;
            }
            for (const TableRow& row : c.rows) {
                sum.position = sum.position + (row.position[axis] - mean) * (row.position[axis] - mean) / count;
            }
            return sum;
        }
        default:
            return sum;
    }
}

}  // namespace detail

inline ReferencePoint<double> course_at(const Course& c, std::uint64_t n, double lead) {
    const detail::AxisPoint x = detail::axis_at(c, 0, n, lead), y = detail::axis_at(c, 1, n, lead);
    return {.position = c.params.offset + Vec2<double>{x.position, y.position},
            .velocity = {x.velocity, y.velocity},
            .acceleration = {x.acceleration, y.acceleration}};
}

// True if the reference is not only a sine about 0 on each axis.
inline bool needs_course(const ReferenceParams& p) {
    const bool sines = p.kind[0] == ReferenceKind::sine && p.kind[1] == ReferenceKind::sine;
    return !sines || p.offset.x() != 0.0 || p.offset.y() != 0.0;
}

// Terms and rows stay with the caller.
inline Course make_course(const ReferenceParams& p, double step, std::span<const SineTerm> terms,
                          std::span<const TableRow> rows) {
    Course c{.at = &course_at, .params = p, .step = step, .terms = terms, .rows = rows};
    c.params.course = nullptr;
    const detail::MeanSquares x = detail::mean_squares(c, 0), y = detail::mean_squares(c, 1);
    const auto amplitude = [](const detail::MeanSquares& m) { return square_root(2.0 * m.position); };
    const auto frequency = [](const detail::MeanSquares& m) {
        return m.position > 0.0 ? square_root(m.velocity / m.position) : 0.0;
    };
    c.equivalent = {.amplitude = {amplitude(x), amplitude(y)}, .frequency = {frequency(x), frequency(y)}};
    return c;
}

}  // namespace fracgyro
