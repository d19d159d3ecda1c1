// Functions of the C++ library that std::vector calls, in terms of C. GNU's own throw: linked in, they bring code that
// unwinds and prints exceptions, which needs a C library of the year of the compiler. LLVM's library would be compiled
// for each system that zig links for, which takes minutes. Nothing here is compiled to catch any exception.
#pragma once

#include <cstddef>
#include <cstdlib>
#include <new>
#include <vector>

#if defined(__GLIBCXX__) || defined(_LIBCPP_VERSION)
void* operator new(std::size_t size) {
    if (void* found = std::malloc(size == 0 ? 1 : size)) {
        return found;
    }
    std::abort();
}
void operator delete(void* place) noexcept { std::free(place); }
void operator delete(void* place, std::size_t) noexcept { std::free(place); }
#endif

#if defined(__GLIBCXX__)
namespace std {
void __throw_length_error(const char*) { abort(); }
void __throw_bad_array_new_length() { abort(); }
}  // namespace std
#elif defined(_LIBCPP_VERSION)
_LIBCPP_BEGIN_NAMESPACE_STD
void __libcpp_verbose_abort(const char*, ...) noexcept { abort(); }
_LIBCPP_END_NAMESPACE_STD
#endif
