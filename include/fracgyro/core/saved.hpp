// A state as bytes, and the check of restored bytes: no input may do harm.
//
//    The checksum detects damage. Bytes with a correct checksum may still not be a state, for example from another
//    program or an attacker: sound(state, coefficients), a member of every type with a state, checks that all its
//    indices and switches have permitted values. Numbers may have any value.
#pragma once

#include <cstddef>
#include <cstdint>
#include <type_traits>

namespace fracgyro {

// CRC-32, which detects every burst of up to 32 wrong bits. `sum`: checksum of the preceding bytes.
[[gnu::noinline]] inline std::uint32_t checksum(const void* bytes, std::size_t count, std::uint32_t sum = 0) {
    const auto* at = static_cast<const unsigned char*>(bytes);
    sum = ~sum;
    for (const auto* end = at + count; at < end; ++at) {
        sum ^= *at;
        for (int bit = 0; bit < 8; ++bit) {
            sum = (sum >> 1) ^ ((sum & 1U) != 0 ? 0xEDB88320U : 0U);
        }
    }
    return ~sum;
}

inline void copy_bytes(void* to, const void* from, std::size_t count) {
    auto* out = static_cast<unsigned char*>(to);
    const auto* in = static_cast<const unsigned char*>(from);
    for (std::size_t i = 0; i < count; ++i) {
        out[i] = in[i];
    }
}

// The checksum, then the state.
template <class State>
struct Saved {
    static_assert(std::is_trivially_copyable_v<State>);
    static constexpr std::size_t size = sizeof(std::uint32_t) + sizeof(State);

    static void write(const State& state, unsigned char* bytes) {
        copy_bytes(bytes + sizeof(std::uint32_t), &state, sizeof state);
        const std::uint32_t sum = checksum(bytes + sizeof sum, sizeof state);
        copy_bytes(bytes, &sum, sizeof sum);
    }
    // Returns true if the bytes are as they were written; otherwise `state` stays unchanged.
    static bool read(const unsigned char* bytes, std::size_t count, State& state) {
        std::uint32_t sum = 0;
        if (count != size) {
            return false;
        }
        copy_bytes(&sum, bytes, sizeof sum);
        if (sum != checksum(bytes + sizeof sum, sizeof state)) {
            return false;
        }
        copy_bytes(&state, bytes + sizeof sum, sizeof state);
        return true;
    }
};

// Returns true if the byte of a switch is valid: any byte may come, and reading all but two as a bool is undefined.
inline bool sound(const bool& a) { return reinterpret_cast<const unsigned char&>(a) <= 1; }

}  // namespace fracgyro
