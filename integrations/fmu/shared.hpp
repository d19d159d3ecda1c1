// Code shared by the functions of both FMI versions. A Component is an instance with its importer's logger: `failed`
// logs a reason and returns the version's error code; `status` converts success or failure to the version's status.
#pragma once

#include "instance.hpp"

#include <cstddef>
#include <type_traits>

namespace fracgyro {

template <class Component, class Reference, class Value>
auto get_values(Component& c, const Reference* references, std::size_t count, Value* values) {
    if (count > 0 && (references == nullptr || values == nullptr)) {
        return c.failed("there are no references or no values");
    }
    for (std::size_t i = 0; i < count; ++i) {
        double value = 0.0;
        if (!c.instance.get(references[i], std::is_integral_v<Value>, value)) {
            return c.status(false);
        }
        values[i] = static_cast<Value>(value);
    }
    return c.status(true);
}

template <class Component, class Reference, class Value>
auto set_values(Component& c, const Reference* references, std::size_t count, const Value* values) {
    if (count > 0 && (references == nullptr || values == nullptr)) {
        return c.failed("there are no references or no values");
    }
    for (std::size_t i = 0; i < count; ++i) {
        if (!c.instance.set(references[i], std::is_integral_v<Value>, static_cast<double>(values[i]))) {
            return c.status(false);
        }
    }
    return c.status(true);
}

// Copies the state for the importer, into a new one or over the one it passes.
template <class Component>
auto get_state(Component& c, void** state) {
    if (*state == nullptr) {
        *state = make<Instance::State>(c.instance.state());
    } else {
        *static_cast<Instance::State*>(*state) = c.instance.state();
    }
    return *state == nullptr ? c.failed("no memory is left for a state") : c.status(true);
}

template <class Component>
auto set_state(Component& c, const void* state) {
    if (state == nullptr) {
        return c.failed("no state was given");
    }
    c.instance.restore(*static_cast<const Instance::State*>(state));
    return c.status(true);
}

// With an instance or without.
inline void free_state(void** state) {
    if (state != nullptr) {
        destroy(static_cast<Instance::State*>(*state));
        *state = nullptr;
    }
}

template <class Component, class Byte>
auto serialize(Component& c, const void* state, Byte* bytes, std::size_t size) {
    if (state == nullptr || bytes == nullptr || size < Instance::saved_size) {
        return c.failed("no state was given, or too little room for it");
    }
    Instance::write(*static_cast<const Instance::State*>(state), reinterpret_cast<unsigned char*>(bytes));
    return c.status(true);
}

template <class Component, class Byte>
auto deserialize(Component& c, const Byte* bytes, std::size_t size, void** state) {
    auto* const read = make<Instance::State>();
    if (read == nullptr) {
        return c.failed("no memory is left for a state");
    }
    if (!c.instance.read(reinterpret_cast<const unsigned char*>(bytes), size, *read)) {
        destroy(read);
        return c.status(false);
    }
    *state = read;
    return c.status(true);
}

}  // namespace fracgyro
