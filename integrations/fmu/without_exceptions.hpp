// The functions of the C++ library that std::vector calls, written in C. GNU's functions throw: linking them adds the
// code that unwinds and prints exceptions, which needs a C library as new as the compiler. zig would compile LLVM's
// library for each target system, which takes minutes. No code here catches exceptions.
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
void __throw_bad_alloc() { abort(); }
}  // namespace std
#elif defined(_LIBCPP_VERSION)
_LIBCPP_BEGIN_NAMESPACE_STD
void __libcpp_verbose_abort(const char*, ...) noexcept { abort(); }
_LIBCPP_END_NAMESPACE_STD
#endif
