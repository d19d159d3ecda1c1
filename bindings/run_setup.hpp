// One run as Python has it.
#pragma once

#include "fracgyro/sim/any_plant.hpp"

namespace fracgyro::bindings {

// It owns its plant, if that is not the gyroscope, and knows which electrode ended its last run.
struct RunSetup : PlantSetup {
    std::shared_ptr<AnyPlant> owner;
    std::int64_t touched_last = 0;

    RunSetup() { touched = &touched_last; }
    RunSetup(const RunSetup& other) : PlantSetup(other), owner(other.owner) { touched = &touched_last; }
    RunSetup& operator=(const RunSetup&) = delete;

    void set_model(std::shared_ptr<AnyPlant> plant) {
        owner = std::move(plant);
        model = owner.get();
    }
};

}  // namespace fracgyro::bindings
