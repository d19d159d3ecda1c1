// What std::vector calls of GNU's C++ library, in terms of C. The library's own functions throw: linked in, they bring
// what unwinds and prints exceptions, which needs a C library of the year of the compiler. Nothing here is compiled to
// catch any.
#pragma once

#include <cstddef>
#include <cstdlib>
#include <new>
#include <vector>

#ifdef __GLIBCXX__
void* operator new(std::size_t size) {
    if (void* found = std::malloc(size == 0 ? 1 : size)) {
        return found;
    }
    std::abort();
}
void operator delete(void* place) noexcept { std::free(place); }
void operator delete(void* place, std::size_t) noexcept { std::free(place); }

namespace std {
void __throw_length_error(const char*) { abort(); }
void __throw_bad_array_new_length() { abort(); }
}  // namespace std
#endif
