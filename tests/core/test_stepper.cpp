#include "paper.hpp"

#include "fracgyro/settings.hpp"
#include "fracgyro/stepper.hpp"

#include <gtest/gtest.h>

#include <set>

namespace fracgyro::testing {
namespace {

using Proposed = SlidingModeController<double, FractionalFastTerminalSurface>;

TEST(Stepper, ItsSamplesAreThoseOfTheLoopEvenAfterACopy) {
    const auto setup = paper(2'000);
    const auto c = Stepper<Proposed>::prepare(setup);
    Disturbance disturbance(setup.disturbance, setup.controller.step);
    auto state = Stepper<Proposed>::start(setup, c, disturbance);
    run_loop<Proposed>(setup, [&](const Snapshot<double>& at) {
        ASSERT_EQ(state.step, at.step);
        ASSERT_EQ(state.motion.position, at.motion.position);
        ASSERT_EQ(state.motion.velocity, at.motion.velocity);
        ASSERT_EQ(state.signals.force, at.signals.force);
        ASSERT_EQ(state.disturbance, at.disturbance);
        if (at.step == 1'000) {
            const auto copy = state;
            disturbance = Disturbance(setup.disturbance, setup.controller.step);
            state = copy;
        }
        ASSERT_TRUE(Stepper<Proposed>::advance(state, c, disturbance));
    });
    EXPECT_EQ(state.step, 2'001);
}

TEST(Stepper, ItSaysWhenTheMotionDiverges) {
    auto setup = paper(2'000);
    setup.controller.step = 0.05;
    const auto c = Stepper<Proposed>::prepare(setup);
    Disturbance disturbance(setup.disturbance, setup.controller.step);
    auto state = Stepper<Proposed>::start(setup, c, disturbance);
    const std::int64_t lasted = run_loop<Proposed>(setup, [](const Snapshot<double>&) {});
    ASSERT_LT(lasted, setup.steps);
    while (Stepper<Proposed>::advance(state, c, disturbance)) {
    }
    EXPECT_EQ(state.step + 1, lasted);
}

TEST(Settings, EachHasANameOfItsOwn) {
    EXPECT_EQ(std::set(setting_names.begin(), setting_names.end()).size(), setting_names.size());
}

TEST(Settings, TakenFromNumbersTheyMakeTheSameRun) {
    const auto setup = paper(100);
    std::array<double, setting_names.size()> numbers{};
    std::size_t at = 0;
    for_each_setting(setup, [&](std::string_view, const auto& number) { numbers[at++] = static_cast<double>(number); });
    fracgyro::Setup taken;
    take_settings(taken, numbers.data());
    taken.controller.surface.modes.rates = setup.controller.surface.modes.rates;
    taken.controller.surface.modes.weights = setup.controller.surface.modes.weights;
    std::array<Vec2<double>, 2> last{};
    const auto run = [](const fracgyro::Setup& s, Vec2<double>& force) {
        run_loop<Proposed>(s, [&](const Snapshot<double>& snapshot) { force = snapshot.signals.force; });
    };
    run(setup, last[0]);
    run(taken, last[1]);
    EXPECT_EQ(last[0], last[1]);
    EXPECT_NE(last[0], Vec2<double>{});
}

}  // namespace
}  // namespace fracgyro::testing
