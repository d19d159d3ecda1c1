// Operations of a step of each controller, by a number type that counts them: flops.py writes the output. First with
// the default gains; then of each line that it reads: a name, a kind's place, the bandwidth of the observer, and lists,
// each after its length: the settings, and poles and weights of the exponentials.
#include "fracgyro/controllers/registry.hpp"
#include "fracgyro/hardware/motion_filter.hpp"
#include "fracgyro/sim/settings.hpp"

#include <cmath>
#include <cstdio>
#include <iostream>
#include <string>
#include <vector>

namespace fracgyro {
namespace {

struct Counts {
    double additions = 0.0, multiplications = 0.0, divisions = 0.0, comparisons = 0.0, roots = 0.0, powers = 0.0;
};
Counts counts;

// A sign is not counted: it takes no extra time.
class Counted {
public:
    Counted() = default;
    explicit Counted(double value) : value_(value) {}
    explicit operator double() const { return value_; }

    friend Counted operator+(Counted a, Counted b) { return counted(counts.additions, a.value_ + b.value_); }
    friend Counted operator-(Counted a, Counted b) { return counted(counts.additions, a.value_ - b.value_); }
    friend Counted operator*(Counted a, Counted b) { return counted(counts.multiplications, a.value_ * b.value_); }
    friend Counted operator/(Counted a, Counted b) { return counted(counts.divisions, a.value_ / b.value_); }
    friend Counted operator-(Counted a) { return Counted(-a.value_); }
    friend bool operator<(Counted a, Counted b) {
        ++counts.comparisons;
        return a.value_ < b.value_;
    }
    friend Counted square_root(Counted a) { return counted(counts.roots, std::sqrt(a.value_)); }
    friend Counted power(Counted base, Counted exponent) {
        return counted(counts.powers, std::pow(base.value_, exponent.value_));
    }
    friend Counted exponential(Counted a) { return counted(counts.powers, std::exp(a.value_)); }
    friend Counted logarithm(Counted a) { return counted(counts.powers, std::log(a.value_)); }

private:
    static Counted counted(double& count, double value) {
        ++count;
        return Counted(value);
    }
    double value_ = 0.0;
};

constexpr std::size_t kernel_terms = 10;  // the number of the paper's run
constexpr int steps = 1000;

template <class C, class Params>
void count(std::string_view kind, std::size_t adaptation, std::string_view sensing, const Params& params,
           const Common& common) {
    const auto coefficients = prepare<C>(params, common);
    typename C::State state{};
    counts = {};
    for (int n = 0; n < steps; ++n) {  // near the reference, as if noisy
        const double t = n * common.step, off = 1e-4 * std::sin(1e3 * t + n % 3);
        const double wx = common.reference.frequency.x(), wy = common.reference.frequency.y();
        const Motion<Counted> motion{
            .position = {Counted(std::sin(wx * t) + off), Counted(std::cos(wy * t) - off)},
            .velocity = {Counted(wx * std::cos(wx * t) + off), Counted(-wy * std::sin(wy * t) - off)}};
        C::step(state, coefficients, motion);
    }
    std::printf("%.*s %zu %.*s", static_cast<int>(kind.size()), kind.data(), adaptation,
                static_cast<int>(sensing.size()), sensing.data());
    for (const double each : {counts.additions, counts.multiplications, counts.divisions, counts.comparisons,
                              counts.roots, counts.powers}) {
        std::printf(" %.1f", each / steps);
    }
    std::printf("\n");
}

template <class Family, class... Types>
void count_all(std::string_view kind, const Common& common, List<Types...>) {
    typename Family::Params params{};
    if constexpr (requires { params.surface.kernel; }) {
        fill_up(params.surface.kernel, kernel_terms);
        params.surface.terminal_exponent = 0.6;  // 0.5 is a root
    }
    std::size_t adaptation = 0;
    const auto both = [&]<class C>(const C*) {
        if constexpr (measures_velocity<C>) {
            count<C>(kind, adaptation, "full", params, common);
        }
        count<typename FromPositions<C>::Type>(kind, adaptation, "position", params, common);
        if constexpr (takes_filter<C>) {
            count<Filtered<C, true>>(kind, adaptation, "full_filtered", params, common);
            count<Filtered<C, false>>(kind, adaptation, "position_filtered", params, common);
        }
        ++adaptation;
    };
    (both(static_cast<const Types*>(nullptr)), ...);
}

std::vector<double> list(std::istream& from) {
    std::size_t length = 0;
    from >> length;
    std::vector<double> numbers(length);
    std::string word;  // >> takes no infinity
    for (double& each : numbers) {
        from >> word;
        each = std::stod(word);
    }
    return numbers;
}

void count_read(std::istream& from) {
    std::string name;
    std::size_t kind = 0;
    double bandwidth = 0.0;
    while (from >> name >> kind >> bandwidth) {
        const std::vector<double> numbers = list(from), poles = list(from), weights = list(from);
        const Setup setup = setup_from(kind, numbers, bandwidth, poles, weights);
        const bool observed = bandwidth > 0.0;
        with_controller<Counted>(setup.controller, observed, [&]<class C>() {
            count<C>(name, 0, observed ? "position" : "full", setup.controller, setup.common);
        });
    }
}

}  // namespace
}  // namespace fracgyro

int main() {
    using namespace fracgyro;
    constexpr double pi = 3.14159265358979323846;
    Common common;
    common.reference = {.frequency = {pi, pi / 2}, .phase = {0.0, pi / 2}};
    common.nominal = {.damping = {0.01, 0.002, 0.01}, .stiffness = {355.0, 71.0, 533.0}, .rate = 0.1};
    common.force_limit = 1000.0;
    common.observer_bandwidth = 300.0;
    common.filter = {.bandwidth = 100.0,
                     .assumed = {.force_noise = 1.0, .position_noise = 7e-5, .velocity_noise = 7e-5}};
    [&]<class... Entries>(const std::tuple<Entries...>*) {
        (count_all<typename Entries::Type>(Entries::kind, common, typename Entries::Type::template Types<Counted>{}),
         ...);
    }(static_cast<const Registry*>(nullptr));
    std::printf("-\n");
    count_read(std::cin);
}
