#include "paper.hpp"

#include "fracgyro/sim/settings.hpp"
#include "fracgyro/sim/stepper.hpp"

#include <gtest/gtest.h>

#include <set>
#include <string>
#include <vector>

namespace fracgyro::testing {
namespace {

using Proposed = SlidingModeController<double, FractionalFastTerminalSurface>;

TEST(Stepper, ItsSamplesAreThoseOfTheLoopEvenAfterACopy) {
    const auto setup = paper(2'000);
    const auto c = Stepper<Proposed>::prepare(setup);
    Disturbance disturbance(setup.disturbance, setup.common.step);
    auto state = Stepper<Proposed>::start(setup, c, disturbance);
    run_loop<Proposed>(setup, [&](const auto& at) {
        ASSERT_EQ(state.step, at.step);
        ASSERT_EQ(state.motion.position, at.motion.position);
        ASSERT_EQ(state.motion.velocity, at.motion.velocity);
        ASSERT_EQ(state.signals.force, at.signals.force);
        ASSERT_EQ(state.disturbance, at.disturbance);
        if (at.step == 1'000) {
            const auto copy = state;
            disturbance = Disturbance(setup.disturbance, setup.common.step);
            state = copy;
        }
        ASSERT_TRUE(Stepper<Proposed>::advance(state, c, disturbance));
    });
    EXPECT_EQ(state.step, 2'001);
}

TEST(Stepper, ItSaysWhenTheMotionDiverges) {
    auto setup = paper(2'000);
    setup.common.step = 0.05;
    const auto c = Stepper<Proposed>::prepare(setup);
    Disturbance disturbance(setup.disturbance, setup.common.step);
    auto state = Stepper<Proposed>::start(setup, c, disturbance);
    const std::int64_t lasted = run_loop<Proposed>(setup, [](const auto&) {});
    ASSERT_LT(lasted, setup.steps);
    while (Stepper<Proposed>::advance(state, c, disturbance)) {
    }
    EXPECT_EQ(state.step + 1, lasted);
}

TEST(Settings, OfEveryKindEachHasANameOfItsOwn) {
    for (std::size_t kind = 0; kind < controller_kinds.size(); ++kind) {
        const fracgyro::Setup setup{.controller = params_of_kind(kind)};
        std::set<std::string> names;
        for_each_setting(setup, [&](std::string_view table, const auto& field, std::string_view part, const auto&) {
            names.insert(std::string(table) + '.' + std::string(field.name) + std::string(part));
        });
        EXPECT_EQ(names.size(), setting_count(setup)) << controller_kinds[kind];
        EXPECT_TRUE(names.contains("run.step") && names.contains("plant.stiffness.xy"));
    }
}

TEST(Settings, TakenFromNumbersTheyMakeTheSameRun) {
    const auto setup = paper(100);
    std::vector<double> numbers;
    for_each_setting(setup, [&](std::string_view, const auto&, std::string_view, const auto& number) {
        numbers.push_back(static_cast<double>(number));
    });
    ASSERT_EQ(numbers.size(), setting_count(setup));
    fracgyro::Setup taken{.controller = params_of_kind(setup.controller.index())};
    take_settings(taken, numbers.data());
    kernel_of(taken.controller)->poles = kernel_of(setup.controller)->poles;
    kernel_of(taken.controller)->weights = kernel_of(setup.controller)->weights;
    std::array<Vec2<double>, 2> last{};
    const auto run = [](const fracgyro::Setup& s, Vec2<double>& force) {
        run_loop<Proposed>(s, [&](const auto& snapshot) { force = snapshot.signals.force; });
    };
    run(setup, last[0]);
    run(taken, last[1]);
    EXPECT_EQ(last[0], last[1]);
    EXPECT_NE(last[0], Vec2<double>{});
}

}  // namespace
}  // namespace fracgyro::testing
