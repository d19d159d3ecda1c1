// A value that several copies of a setup share, freed with the last of them. Unlike std::shared_ptr it needs no C++
// library, which an FMU and a browser do not have.
#pragma once

#include <atomic>
#include <cstddef>
#include <utility>

namespace fracgyro {

template <class T>
class Shared {
public:
    constexpr Shared() = default;
    explicit Shared(T value) : held_(new Held{std::move(value)}) {}
    constexpr Shared(const Shared& other) : held_(other.held_) {
        if (held_ != nullptr) {
            ++held_->owners;
        }
    }
    constexpr Shared(Shared&& other) noexcept : held_(std::exchange(other.held_, nullptr)) {}
    constexpr Shared& operator=(Shared other) noexcept {
        std::swap(held_, other.held_);
        return *this;
    }
    constexpr ~Shared() {
        if (held_ != nullptr && --held_->owners == 0) {
            delete held_;
        }
    }

    constexpr const T* get() const { return held_ == nullptr ? nullptr : &held_->value; }

private:
    struct Held {
        T value;
        std::atomic<std::size_t> owners{1};
    };
    Held* held_ = nullptr;
};

}  // namespace fracgyro
