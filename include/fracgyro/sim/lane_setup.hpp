// Preparation of the runs of a block. Its code exists for every controller and number of lanes and is not critical at
// run time, so the module compiles it in files of its own.
#pragma once

#include "fracgyro/sim/batch.hpp"

namespace fracgyro {

template <Controller C, class T = typename C::Value>
inline constexpr BlockType<T> block_type{
    .place = detail::KernelsFor<T, Registry>::template place<C>,
    .make = [] { return HeldBlock<T>(new Block<C>, [](BlockOf<T>* block) { delete static_cast<Block<C>*>(block); }); },
    .prepare =
        [](BlockOf<T>& block, const ControllerParams& params, const Common& common, std::size_t lane) {
            auto& controller = static_cast<Block<C>&>(block).controller;
            const auto coefficients = fracgyro::prepare<C>(params, common);
            if (lane == 0) {
                controller = coefficients;
            }
            detail::set_lane<T>(controller, coefficients, lane);
        },
    .report =
        [](const BlockOf<T>& block) {
            const auto& of_type = static_cast<const Block<C>&>(block);
            const auto report = C::report(of_type.state, of_type.controller);
            std::vector<CommonReport> found;
            for (std::size_t k = 0; k < T::count; ++k) {
                found.push_back(CommonReport::of(report, [k](const T& a) { return static_cast<double>(a.lane[k]); }));
            }
            return found;
        }};

template <class T>
const BlockType<T>& block_type_of(const ControllerParams& controller) {
    const BlockType<T>* type = nullptr;
    with_controller<T>(controller, [&]<class C>() { type = &block_type<C>; });
    return *type;
}

}  // namespace fracgyro
