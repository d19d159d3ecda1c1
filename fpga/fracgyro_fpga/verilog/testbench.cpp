// Answers every motion in the file "motion" (x, y and their rates, one sample after another) with a row in the file
// "answer": status, force x, y, and what the controller reported before it. Numbers are float32 or, with a fixed point,
// int64: times 2^28. Prints how many cycles that took.
#include "Vfracgyro_controller.h"
#include "controller.h"
#include "verilated.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cstdint>
#include <cstdio>

namespace {

struct Range {
    std::uint64_t least = ~std::uint64_t{}, most = 0, sum = 0, count = 0;
    void add(std::uint64_t cycles) {
        least = std::min(least, cycles);
        most = std::max(most, cycles);
        sum += cycles;
        ++count;
    }
    void print(const char* what) const {
        std::printf("%s: %llu to %llu cycles, %.1f on average\n", what, static_cast<unsigned long long>(least),
                    static_cast<unsigned long long>(most), static_cast<double>(sum) / static_cast<double>(count));
    }
};

#if FRACGYRO_FRACTION
using Word = std::int64_t;
constexpr int unused = 64 - FRACGYRO_WORD;  // bits of it
std::uint64_t handed(Word word) { return static_cast<std::uint64_t>(word) << unused >> unused; }
Word taken(std::uint64_t bits) { return static_cast<Word>(bits << unused) >> unused; }
Word number(int whole) { return Word{whole} << FRACGYRO_FRACTION; }
#else
using Word = std::uint32_t;
Word handed(Word word) { return word; }
Word taken(std::uint32_t bits) { return bits; }
Word number(int whole) { return std::bit_cast<Word>(static_cast<float>(whole)); }
#endif

Vfracgyro_controller top;
std::uint64_t cycle = 0;

void tick() {
    top.clk = 1;
    top.eval();
    top.clk = 0;
    top.eval();
    ++cycle;
}

int hung() {
    std::fprintf(stderr, "the controller did not answer\n");
    return 2;
}

}  // namespace

int main() {
    constexpr std::uint64_t most_cycles = 100'000;  // limit for one step
    std::FILE* const in = std::fopen("motion", "rb");
    std::FILE* const out = std::fopen("answer", "wb");
    if (in == nullptr || out == nullptr) {
        std::fprintf(stderr, in == nullptr ? "the file motion is missing: x, y and their rates, one sample after "
                                             "another\n"
                                           : "the file answer cannot be written\n");
        return 1;
    }
    std::array<Word, 4> motion{};
    std::fseek(in, 0, SEEK_END);
    const long bytes = std::ftell(in);
    if (bytes <= 0 || bytes % static_cast<long>(sizeof motion) != 0) {
        std::fprintf(stderr, "the file motion has %ld bytes: a sample has %zu\n", bytes, sizeof motion);
        return 1;
    }
    std::rewind(in);
    top.reset = 1;
    tick();
    tick();
    top.reset = 0;
    Range force, step;
    std::array<Word, 3 + FRACGYRO_REPORTED> row{};
    while (std::fread(motion.data(), sizeof motion, 1, in) == 1) {
        for (const std::uint64_t from = cycle; !top.ready; tick()) {
            if (cycle - from > most_cycles) {
                return hung();
            }
        }
        for (std::uint32_t k = 0; k < 4; ++k) {
            top.in_write = 1;
            top.in_index = k;
            top.in_word = handed(motion[k]);
            top.start = k == 3;
            if (k < 3) {
                tick();
            }
        }
        const std::uint64_t started = cycle;
        tick();
        top.in_write = top.start = 0;
        for (bool there = false; !top.ready; tick()) {
            if (top.force_valid) {
                if (there) {
                    return hung();  // two forces
                }
                force.add(cycle - started);
                there = true;
            }
            if (top.done && !there) {
                return hung();
            }
            if (cycle - started > most_cycles) {
                return hung();
            }
        }
        step.add(cycle - started);
        row[0] = number(top.status);
        row[1] = taken(top.force_x);
        row[2] = taken(top.force_y);
        for (std::uint32_t k = 0; k < FRACGYRO_REPORTED; ++k) {
            top.out_index = k;
            for (int cycles = 0; cycles < 4; ++cycles) {
                tick();
            }
            row[3 + k] = taken(top.out_word);
        }
        if (std::fwrite(row.data(), sizeof row, 1, out) != 1) {
            return 1;
        }
    }
    force.print("from start to force");
    step.print("from start to ready");
    return std::fclose(out) == 0 ? 0 : 1;
}
