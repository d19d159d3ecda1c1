// Answers every motion in the file "motion" over SPI, with the rows that testbench.cpp writes. After the number of
// samples in the first argument it reads the state, resets the hardware, and writes the state back.
#include "Vfracgyro_spi.h"
#include "controller.h"
#include "verilated.h"

#include <array>
#include <bit>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <vector>

namespace {

#if FRACGYRO_FRACTION
using Word = std::int64_t;
Word number(std::uint32_t whole) { return Word{whole} << FRACGYRO_FRACTION; }
#else
using Word = std::uint32_t;
Word number(std::uint32_t whole) { return std::bit_cast<Word>(static_cast<float>(whole)); }
#endif
constexpr int unused = 64 - FRACGYRO_WORD;  // bits of a transfer's word

Vfracgyro_spi top;

void tick(int cycles) {
    for (int k = 0; k < cycles; ++k) {
        top.clk = 1;
        top.eval();
        top.clk = 0;
        top.eval();
    }
}

Word transfer(std::uint64_t command, std::uint64_t index, Word word = 0) {
    const std::uint64_t first = command << 20 | index << 8, rest = static_cast<std::uint64_t>(word);
    std::uint64_t read = 0;
    top.cs_n = 0;
    tick(4);
    for (int k = FRACGYRO_WORD + 23; k >= 0; --k) {
        top.mosi = (k < FRACGYRO_WORD ? rest >> k : first >> (k - FRACGYRO_WORD)) & 1;
        tick(4);
        top.sck = 1;
        read = read << 1 | top.miso;
        tick(4);
        top.sck = 0;
    }
    tick(4);
    top.cs_n = 1;
    tick(4);
    return static_cast<Word>(static_cast<std::int64_t>(read << unused) >> unused);
}

std::uint32_t ready_status() {
    Word found = 0;
    while (((found = transfer(0, 0)) & 1) == 0) {
    }
    return static_cast<std::uint32_t>(found >> 1);
}

void reset() {
    top.reset = 1;
    tick(2);
    top.reset = 0;
    ready_status();
}

void restart() {
    std::vector<Word> state(FRACGYRO_STATE);
    for (std::uint32_t k = 0; k < FRACGYRO_STATE; ++k) {
        state[k] = transfer(3, FRACGYRO_REPORTED + k);
    }
    const Word x = transfer(4, 0), y = transfer(4, 1);
    reset();
    for (std::uint32_t k = 0; k < FRACGYRO_STATE; ++k) {
        transfer(1, 4 + k, state[k]);
    }
    ready_status();
    for (std::uint32_t k = 0; k < FRACGYRO_STATE; ++k) {
        if (transfer(3, FRACGYRO_REPORTED + k) != state[k]) {
            std::printf("word %u of the state is not what was written\n", k);
        }
    }
    if (transfer(4, 0) != x || transfer(4, 1) != y) {
        std::printf("the force is not what it was\n");
    }
}

}  // namespace

int main(int count, char** words) {
    std::FILE* const in = std::fopen("motion", "rb");
    std::FILE* const out = std::fopen("answer", "wb");
    if (count != 2 || in == nullptr || out == nullptr) {
        return 1;
    }
    const long saved_after = std::strtol(words[1], nullptr, 10);
    top.cs_n = 1;
    reset();
    std::array<Word, 4> motion{};
    std::array<Word, 3 + FRACGYRO_REPORTED> row{};
    for (long n = 0; std::fread(motion.data(), sizeof motion, 1, in) == 1; ++n) {
        if (n == saved_after) {
            restart();
        }
        for (std::uint32_t k = 0; k < 4; ++k) {
            transfer(k == 3 ? 2 : 1, k, motion[k]);
        }
        row[0] = number(ready_status());
        row[1] = transfer(4, 0);
        row[2] = transfer(4, 1);
        for (std::uint32_t k = 0; k < FRACGYRO_REPORTED; ++k) {
            row[3 + k] = transfer(3, k);
        }
        std::fwrite(row.data(), sizeof row, 1, out);
    }
    return std::fclose(out) == 0 ? 0 : 1;
}
