// One run as Python has it.
#pragma once

#include "fracgyro/sim/any_plant.hpp"

namespace fracgyro::bindings {

// It owns its plant, if that is not the gyroscope.
struct RunSetup : PlantSetup {
    std::shared_ptr<AnyPlant> owner;

    void set_model(std::shared_ptr<AnyPlant> plant) {
        owner = std::move(plant);
        model = owner.get();
    }
};

}  // namespace fracgyro::bindings
