// Plants by name. A new one is its own file and one line here.
#pragma once

#include "fracgyro/core/entry.hpp"
#include "fracgyro/plant/duffing.hpp"
#include "fracgyro/plant/general.hpp"
#include "fracgyro/plant/gyroscope.hpp"
#include "fracgyro/plant/resonator.hpp"

#include <tuple>

namespace fracgyro {

using PlantRegistry = std::tuple<Entry<"gyroscope", Gyroscope<double>, "the linear gyroscope, eq. (9)">,
                                 Entry<"resonator", Resonator, "one axis: only x moves, y stays 0">,
                                 Entry<"duffing", Duffing, "the gyroscope with cubic springs that couple the axes">,
                                 Entry<"general", General, "linear, with a mass per axis and nonsymmetric matrices">>;

inline constexpr std::size_t plant_count = std::tuple_size_v<PlantRegistry>;

// Calls visit.template operator()<Entry>(kind) for each line of the registry, in order; its index is the kind.
template <class Visit>
constexpr void for_each_plant(Visit&& visit) {
    [&]<std::size_t... I>(std::index_sequence<I...>) {
        (visit.template operator()<std::tuple_element_t<I, PlantRegistry>>(I), ...);
    }(std::make_index_sequence<plant_count>{});
}

// Parameters that a plant has in addition to those of the linear gyroscope, which every scenario has.
template <class Params>
inline constexpr bool has_own_fields = !std::is_same_v<Params, GyroscopeParams>;

}  // namespace fracgyro
