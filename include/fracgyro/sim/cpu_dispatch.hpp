// Marks a function compiled in two copies: for processors with AVX2 and for all others; the right one is chosen when
// the program starts. Contraction is off, so both compute the same bits. Everything that the function calls is inlined
// into it, since only then is it compiled for the same processor. A third copy for AVX-512 brought nothing
// (docs/decisions/0014).
#pragma once

#include <cstddef>  // detects glibc, which target_clones needs

#if defined(__x86_64__) && defined(__GNUC__) && !defined(__clang__) && defined(__GLIBC__) && !defined(__AVX2__) && \
    !defined(__SANITIZE_ADDRESS__)
#define FRACGYRO_FOR_EACH_PROCESSOR __attribute__((target_clones("avx2", "default"), flatten))
#else
#define FRACGYRO_FOR_EACH_PROCESSOR
#endif

namespace fracgyro {

// True if a run of this controller on an ideal device has such copies: the paper's family, whose memory they speed up.
// A controller that also estimates the motion is several times as much code, and is for non-ideal devices.
template <class C>
inline constexpr bool has_copies = requires { C::has_memory; } && !requires { requires C::estimates_motion; };

}  // namespace fracgyro
