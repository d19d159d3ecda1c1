// Answers every motion in the file "motion" through the ports, as testbench.cpp does, with registers that begin at
// random; but every third sample is written in another order and started later, and after each fifth one the state is
// read, one word a cycle, the hardware is reset, and the state is written back as soon as `ready` allows.
#include "Vfracgyro_controller.h"
#include "controller.h"
#include "verilated.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <vector>

namespace {

using Word = std::uint32_t;

Vfracgyro_controller* top;

void tick(int cycles = 1) {
    for (int k = 0; k < cycles; ++k) {
        top->clk = 1;
        top->eval();
        top->clk = 0;
        top->eval();
    }
}

void until_ready() {
    for (int k = 0; !top->ready; ++k) {
        if (k == 10'000) {
            std::printf("it hangs\n");
            std::exit(2);
        }
        tick();
    }
}

void put(std::uint32_t index, Word word, bool start) {
    top->in_write = 1;
    top->in_index = index;
    top->in_word = word;
    top->start = start;
    tick();
    top->in_write = top->start = 0;
}

void reset() {
    top->reset = 1;
    tick(2);
    top->reset = 0;
    until_ready();
}

void restart() {
    constexpr std::uint32_t latency = 4;
    std::vector<Word> state(FRACGYRO_STATE);
    for (std::uint32_t k = 0; k < FRACGYRO_STATE + latency; ++k) {
        top->out_index = FRACGYRO_REPORTED + std::min(k, FRACGYRO_STATE - 1U);
        if (k >= latency) {
            state[k - latency] = top->out_word;
        }
        tick();
    }
    reset();
    for (std::uint32_t k = 0; k < FRACGYRO_STATE; ++k) {
        put(4 + k, state[k], k % 2 == 0);  // no step begins with a word of the state
        until_ready();
    }
}

}  // namespace

int main(int count, char** words) {
    std::FILE* const in = std::fopen("motion", "rb");
    std::FILE* const out = std::fopen("answer", "wb");
    if (in == nullptr || out == nullptr) {
        return 1;
    }
    Verilated::commandArgs(count, words);
    Verilated::randReset(2);
    top = new Vfracgyro_controller;
    top->in_write = top->start = 0;
    reset();
    std::array<Word, 4> motion{};
    std::array<Word, 3 + FRACGYRO_REPORTED> row{};
    for (long n = 0; std::fread(motion.data(), sizeof motion, 1, in) == 1; ++n) {
        if (n % 5 == 4) {
            restart();
        }
        const bool reversed = n % 3 == 1;
        for (std::uint32_t k = 0; k < 4; ++k) {
            const std::uint32_t index = reversed ? 3 - k : k;
            put(index, motion[index], k == 3 && !reversed);
        }
        if (reversed) {
            tick(2);
            top->start = 1;
            tick();
        }
        top->start = top->in_write = n % 2;  // ignored
        top->in_index = 0;
        tick(5);
        top->start = top->in_write = 0;
        until_ready();
        row = {std::bit_cast<Word>(static_cast<float>(top->status)), top->force_x, top->force_y};
        for (std::uint32_t k = 0; k < FRACGYRO_REPORTED; ++k) {
            top->out_index = k;
            tick(4);
            row[3 + k] = top->out_word;
        }
        std::fwrite(row.data(), sizeof row, 1, out);
    }
    return std::fclose(out) == 0 ? 0 : 1;
}
