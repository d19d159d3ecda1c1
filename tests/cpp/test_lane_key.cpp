// Runs may share a block if their coefficients differ only in per-lane numbers.
#include "switches.hpp"

#include "fracgyro/sim/lane_setup.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <map>
#include <string>

namespace fracgyro::testing {
namespace {

std::string key_with(const fracgyro::Setup& setup, const std::string& name, double value) {
    return lane_key(with(setup, name, value));
}

const std::map<std::string, Switch> switches_of_composite{
    {"adaptation.forgetting", {0.0, 1.0, 2.0}},
    {"controller.adaptive", {1.0, 0.0, 0.0}},
};

const std::map<std::string, Switch> switches_of_others{
    {"adaptation.forgetting", {0.0, 1.0, 2.0}},
    {"controller.reaching_exponent", {0.5, 0.0, 0.0}},
    {"controller.position_exponent", {1.8, 2.0, 2.5}},
    {"controller.reaching", {1.0, 0.0, 0.0}},
    {"controller.minimal", {0.0, 1.0, 1.0}},
    {"controller.network_inputs", {0.0, 1.0, 1.0}},
    {"controller.weight_leak", {0.0, 1.0, 2.0}},
    {"controller.error_leak", {0.0, 1.0, 2.0}},
    {"controller.prediction_weight", {0.0, 1.0, 2.0}},
    {"controller.basis", {2.0, 0.0, 0.0}},
    {"controller.nodes", {16.0, 8.0, 8.0}},
    {"controller.barrier_shape", {0.0, 1.0, 1.0}},
    {"controller.normalized", {0.0, 1.0, 1.0}},
    {"controller.inner_loop", {0.0, 0.5, 1.0}},
    {"controller.outer_loop", {0.0, 0.5, 1.0}},
    {"controller.gate", {0.0, 0.5, 0.9}},
    {"controller.center_rate", {0.0, 1.0, 2.0}},
    {"controller.width_rate", {0.0, 1.0, 2.0}},
    {"controller.reversal_interval", {20000.0, 10000.0, 10000.0}},
    {"controller.settling_time", {2000.0, 1000.0, 1000.0}},
    {"controller.swing_rate", {0.0, 0.01, 0.01}},
};

const std::map<std::string, Switch> switches_of_the_filter{
    {"datasheet.stiffness_drift", {0.0, 1.0, 2.0}},
    {"datasheet.damping_drift", {0.0, 1.0, 2.0}},
};

// The surface is given a smoother error if positions are noisy.
const std::map<std::string, Switch> switches_of_memory{
    {"datasheet.position_noise", {0.0, 1.0, 2.0}},
};
// Terms that published laws add to the linear one.
const std::map<std::string, Switch> switches_of_linear_terms{
    {"controller.coupling", {0.0, 1.0, 2.0}},
    {"controller.error_integral", {0.0, 1.0, 2.0}},
    {"controller.start_rate", {0.0, 1.0, 2.0}},
    {"controller.surface_filter", {0.0, 1.0, 2.0}},
};
bool remembers(std::string_view kind) { return kind.starts_with("fractional"); }

struct Kind {
    fracgyro::Setup setup;
    std::map<std::string, Switch> switches;  // that it has
};
std::vector<Kind> every_kind() {
    std::vector<Kind> all;
    const auto add = [&](const fracgyro::Setup& setup, std::map<std::string, Switch> some) {
        std::map<std::string, Switch> had;
        for_each_named(setup, [&](const std::string& name, const auto&, const auto&) {
            if (some.contains(name)) {
                had[name] = some[name];
            }
        });
        all.push_back({setup, had});
    };
    for (const std::string_view kind : controller_kinds) {
        auto some = switches;
        if (std::ranges::find(sliding_modes, kind) == std::end(sliding_modes)) {
            some.insert(switches_of_others.begin(), switches_of_others.end());
        }
        const auto& of_surface = remembers(kind) ? switches_of_memory : switches_of_linear_terms;
        some.insert(of_surface.begin(), of_surface.end());
        if (kind == "lqg") {
            some.insert(switches_of_the_filter.begin(), switches_of_the_filter.end());
        }
        if (kind == "lock_in") {  // forgets by an addition whatever the number
            some.erase("adaptation.forgetting");
        }
        add(paper(2000, kind), some);
    }
    for (const std::string_view kind : sliding_modes) {
        EXPECT_EQ(all[kind_of(kind)].switches.size(), switches.size() + (remembers(kind) ? 1 : 4));
        fracgyro::Setup setup = paper(2000, kind);
        law(setup).adaptation.kind = AdaptationKind::composite;
        auto more = switches;
        more.insert(switches_of_composite.begin(), switches_of_composite.end());
        const auto& of_surface = remembers(kind) ? switches_of_memory : switches_of_linear_terms;
        more.insert(of_surface.begin(), of_surface.end());
        add(setup, more);
    }
    EXPECT_EQ(all[kind_of("pid")].switches.size(), 3U);
    return all;
}

TEST(LaneKey, EverySwitchIsInIt) {
    for (const auto& [setup, its] : every_kind()) {
        for (const auto& [name, values] : its) {
            const std::string off = key_with(setup, name, values.off), on = key_with(setup, name, values.on);
            EXPECT_NE(off, on) << name;
            EXPECT_EQ(on, key_with(setup, name, values.also_on)) << name;
        }
    }
}

TEST(LaneKey, NoPlainNumberIsInIt) {
    for (const Kind& kind : every_kind()) {
        const fracgyro::Setup& setup = kind.setup;
        const std::string key = lane_key(setup);
        for_each_named(setup, [&](const std::string& name, const auto& field, const auto& number) {
            // Exponentials are padded; a span is a number of steps.
            if (kind.switches.contains(name) || name == "controller.kernel_terms" || name == "controller.span") {
                return;
            }
            if (field.choices.empty()) {
                EXPECT_EQ(key, key_with(setup, name, 1.5 * static_cast<double>(number) + 0.25)) << name;
            }
            for (std::size_t choice = 0; choice < field.choices.size(); ++choice) {
                EXPECT_EQ(key, key_with(setup, name, static_cast<double>(choice))) << name << ' ' << choice;
            }
        });
    }
}

TEST(LaneKey, OfWhatIsSwitchedOnTheValueIsANumberOfEachLane) {
    fracgyro::Setup setup = paper(2000);
    setup.common.force_limit = 100.0;
    setup.disturbance = {};
    const std::string key = lane_key(setup);
    setup.common.force_limit = 200.0;
    setup.common.reference.frequency = {0.0, 12.0};
    setup.common.nominal.rate = -3.0;
    setup.plant.rate = 7.0;
    setup.disturbance = {.kind = DisturbanceKind::sine, .amplitude = {1.0, 1.0}};
    EXPECT_EQ(key, lane_key(setup));
}

TEST(LaneKey, IsAnotherForEveryKind) {
    std::map<std::string, int> keys;
    const auto all = every_kind();
    for (const Kind& kind : all) {
        ++keys[lane_key(kind.setup)];
    }
    EXPECT_EQ(keys.size(), all.size());
    fracgyro::Setup known = paper(2000), composite = known;
    law(known).adaptation.adaptive = false;
    law(composite).adaptation = {.kind = AdaptationKind::composite, .adaptive = false};
    EXPECT_EQ(lane_key(known), lane_key(composite)) << "without adaptation no least squares run";
}

TEST(LaneKey, IsOneForOrdersOfAnyNumberOfModesAndAnotherForNone) {
    const auto of_order = [](double order, double spacing = 0.5) {
        fracgyro::Setup setup = paper(2000);
        law(setup).surface.kernel = log_trapezoid(order, 1e-3, 2.0, spacing);
        return setup;
    };
    const fracgyro::Setup many = of_order(0.9), few = of_order(0.5, 0.8);
    ASSERT_NE(kernel_terms(many), kernel_terms(few));
    EXPECT_EQ(lane_key(many), lane_key(few));
    EXPECT_NE(lane_key(many), lane_key(of_order(1.0)));
    EXPECT_EQ(lane_key(of_order(0.0)), lane_key(of_order(1.0)));
}

// -- Coefficients that are in no list

template <class T>
struct MadeUp {
    enum class Shape : std::uint8_t { round, square };
    struct Inner {
        std::array<T, 3> gains{};
        bool on = false;
        std::size_t count = 0;
    };
    T gain{};
    Vec2<T> pair{};
    typename PhaseOf<T>::Type phase{};
    Inner inner{};
    std::array<Inner, 2> each{};
    Shape shape = Shape::round;
};

template <class T>
class Switches : public ::testing::Test {};
using Several = ::testing::Types<Lanes<double, 2>, Lanes<float, 4>>;
TYPED_TEST_SUITE(Switches, Several);

TYPED_TEST(Switches, AreFoundInCoefficientsWhereverTheyAre) {
    using T = TypeParam;
    using Coefficients = MadeUp<T>;
    const auto key = [](auto&& change) {
        Coefficients c;
        change(c);
        std::string found;
        detail::append_switches<T>(found, c);
        return found;
    };
    const std::string plain = key([](Coefficients&) {});
    EXPECT_EQ(plain.size(), 3 * (sizeof(bool) + sizeof(std::size_t)) + 1);
    EXPECT_EQ(plain, key([](Coefficients& c) { c.gain = T(2.0); }));
    EXPECT_EQ(plain, key([](Coefficients& c) { c.pair = {T(1.0), T(2.0)}; }));
    EXPECT_EQ(plain, key([](Coefficients& c) { c.inner.gains[2] = T(2.0); }));
    EXPECT_EQ(plain, key([](Coefficients& c) { c.phase = c.phase + 77; }));
    EXPECT_NE(plain, key([](Coefficients& c) { c.inner.on = true; }));
    EXPECT_NE(plain, key([](Coefficients& c) { c.inner.count = 1; }));
    EXPECT_NE(plain, key([](Coefficients& c) { c.each[1].on = true; }));
    EXPECT_NE(plain, key([](Coefficients& c) { c.shape = Coefficients::Shape::square; }));
    EXPECT_NE(key([](Coefficients& c) { c.each[0].on = true; }), key([](Coefficients& c) { c.each[1].on = true; }));
}

TEST(Members, AreCountedAndVisitedInTheirOrder) {
    struct Five {
        int a = 1;
        double b = 2.0;
        std::array<int, 3> c{};
        Vec2<double> d{};
        bool e = true;
    };
    struct Twenty {
        int a, b, c, d, e, f, g, h, i, j, k, l, m, n, o, p, q, r, s, t;
    };
    struct None {};
    struct Nested {
        None none;
        Five five;
    };
    static_assert(count_members<None>() == 0 && count_members<Nested>() == 2);
    static_assert(count_members<Five>() == 5 && count_members<Twenty>() == 20);
    const Twenty twenty{1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15, 16, 17, 18, 19, 20};
    int wanted = 0;
    EXPECT_TRUE(with_members(twenty, [&](const auto&... members) { return ((members == ++wanted) && ...); }));
    EXPECT_EQ(wanted, 20);
    const Five five;
    EXPECT_EQ(with_members(five, [](int a, double b, const auto&, const auto&, bool e) { return a + b + (e ? 4 : 0); }),
              7.0);
}

}  // namespace
}  // namespace fracgyro::testing
