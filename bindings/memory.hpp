// Memory of records: in large pages, and reused for the next record of the same size. The system zeroes a page when it
// is first touched, and in pages of 4 KB that takes as long as the run.
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <mutex>
#include <new>
#include <utility>
#include <vector>

#ifdef __linux__
#include <sys/mman.h>
#endif

namespace fracgyro::bindings {

// Shared by all threads. Sizes are whole large pages.
class RecordMemory {
public:
    static constexpr std::size_t page = std::size_t{2} << 20, least = 2 * page, most_kept = 32 * page;

    static RecordMemory& shared() {
        static auto* const memory = new RecordMemory;  // never destroyed: arrays may outlive static objects
        return *memory;
    }

    void* take(std::size_t bytes) {
        {
            const std::lock_guard lock(mutex_);
            for (std::size_t i = count_; i-- > 0;) {
                if (kept_[i].bytes == bytes) {
                    return remove(i);
                }
            }
        }
        void* const memory = ::operator new(bytes, std::align_val_t{page});
#ifdef __linux__
        madvise(memory, bytes, MADV_HUGEPAGE);  // systems without large pages use small ones
#endif
        return memory;
    }
    // The blocks kept longest make room.
    void give_back(void* memory, std::size_t bytes) noexcept {
        const std::lock_guard lock(mutex_);
        while (count_ > 0 && kept_bytes_ + bytes > most_kept) {
            release(remove(0));
        }
        if (bytes > most_kept) {
            release(memory);
            return;
        }
        kept_[count_++] = {memory, bytes};
        kept_bytes_ += bytes;
    }

private:
    struct Kept {
        void* memory = nullptr;
        std::size_t bytes = 0;
    };

    static void release(void* memory) noexcept { ::operator delete(memory, std::align_val_t{page}); }
    void* remove(std::size_t i) noexcept {
        void* const memory = kept_[i].memory;
        kept_bytes_ -= kept_[i].bytes;
        std::move(kept_.begin() + i + 1, kept_.begin() + count_, kept_.begin() + i);
        --count_;
        return memory;
    }

    std::mutex mutex_;
    std::array<Kept, most_kept / least> kept_{};  // oldest first
    std::size_t count_ = 0, kept_bytes_ = 0;
};

// Allocator for numbers that are written before they are read: they are not zeroed.
template <class T>
struct RecordAllocator {
    using value_type = T;

    T* allocate(std::size_t count) {
        const std::size_t bytes = count * sizeof(T);
        return static_cast<T*>(is_large(bytes) ? RecordMemory::shared().take(whole_pages(bytes))
                                               : ::operator new(bytes));
    }
    void deallocate(T* memory, std::size_t count) noexcept {
        const std::size_t bytes = count * sizeof(T);
        if (is_large(bytes)) {
            RecordMemory::shared().give_back(memory, whole_pages(bytes));
        } else {
            ::operator delete(memory);
        }
    }
    void construct(T*) noexcept {}
    void construct(T* place, T value) noexcept { *place = value; }

    friend bool operator==(const RecordAllocator&, const RecordAllocator&) { return true; }

private:
    static bool is_large(std::size_t bytes) { return bytes >= RecordMemory::least; }
    static std::size_t whole_pages(std::size_t bytes) {
        return (bytes + RecordMemory::page - 1) / RecordMemory::page * RecordMemory::page;
    }
};

using Rows = std::vector<double, RecordAllocator<double>>;

}  // namespace fracgyro::bindings
