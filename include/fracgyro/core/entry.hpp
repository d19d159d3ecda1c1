// A line of a registry: a name, a type and a meaning.
#pragma once

#include <cstddef>
#include <string_view>

namespace fracgyro {

template <std::size_t Size>
struct Name {
    char text[Size]{};
    consteval Name(const char (&characters)[Size]) {
        for (std::size_t i = 0; i < Size; ++i) {
            text[i] = characters[i];
        }
    }
    constexpr std::string_view view() const { return {text, Size - 1}; }
};

template <Name name, class Family, Name what>
struct Entry {
    static constexpr std::string_view kind = name.view(), meaning = what.view();
    using Type = Family;
};

}  // namespace fracgyro
