// Compares every unit of fixed_units.v with HardwareFixed on this computer, bit by bit, on random numbers.
//
//     fixed_units COUNT SEED      prints a line for each unit: vectors, differences, results at the end of the range;
//                                 fails where one differs
//
//    Numbers have all sizes; an eighth each are 0, at an end of the range, near the other operand, or a power of 2.
#include "Vbench.h"
#include "verilated.h"

#include "fixed.hpp"

#include <cstdio>
#include <cstdlib>
#include <deque>
#include <random>

namespace {

using fracgyro::HardwareFixed;

struct Vector {
    HardwareFixed a, b;
    bool signs;  // choose takes the sign of a, else the larger one
};

class Numbers {
public:
    explicit Numbers(std::uint64_t seed) : random_(seed) {}
    Vector next() {
        const HardwareFixed a = one({});
        return {a, one(a), random_() % 2 == 0};
    }

private:
    std::mt19937_64 random_;
    HardwareFixed one(HardwareFixed other) {
        const auto bits = static_cast<std::int64_t>(random_() >> 1);
        const auto near = HardwareFixed::of(bits % 5 - 2);
        const int size = static_cast<int>(random_() % 48);
        const HardwareFixed any = HardwareFixed::of(bits & ((std::int64_t{1} << size) - 1)),
                            power = HardwareFixed::of(std::int64_t{1} << size);
        const HardwareFixed ends = HardwareFixed::of(HardwareFixed::most) - HardwareFixed::of(bits % 3);
        HardwareFixed found = any;
        switch (random_() % 8) {
            case 0:
                found = HardwareFixed{};
                break;
            case 1:
                found = ends;
                break;
            case 2:
                found = other + near;
                break;
            case 3:
                found = power;
                break;
            default:
                break;
        }
        return random_() % 2 == 0 ? found : -found;
    }
};

std::uint64_t bits(HardwareFixed a) { return static_cast<std::uint64_t>(a.places) & ((std::uint64_t{1} << 48) - 1); }

struct Unit {
    const char* name;
    std::size_t stages;
    std::uint64_t (*expected)(const Vector&);
    std::uint64_t (*found)(const Vbench&);
    std::uint64_t every = 1;
    std::uint64_t vectors = 0, differences = 0, ends = 0;
};

}  // namespace

int main(int count, char** words) {
    if (count != 3) {
        return 2;
    }
    const std::uint64_t vectors = std::strtoull(words[1], nullptr, 10);
    Numbers numbers(std::strtoull(words[2], nullptr, 10));
    using V = Vector;
    constexpr std::uint64_t of_div = 17, of_sqrt = 20;  // cycles from load to load
    Unit units[] = {
        {"add", 1, [](const V& v) { return bits(v.a + v.b); }, [](const Vbench& t) { return t.sum; }},
        {"multiply", 3, [](const V& v) { return bits(v.a * v.b); }, [](const Vbench& t) { return t.product; }},
        {"divide", 17, [](const V& v) { return bits(v.a / v.b); }, [](const Vbench& t) { return t.quotient; }, of_div},
        {"square root", 20, [](const V& v) { return bits(square_root(v.a)); }, [](const Vbench& t) { return t.root; },
         of_sqrt},
        {"choose", 1, [](const V& v) { return bits(v.signs ? with_sign_of(v.a, absolute(v.b)) : maximum(v.a, v.b)); },
         [](const Vbench& t) { return t.chosen; }},
        {"less", 1, [](const V& v) { return std::uint64_t{v.a < v.b}; },
         [](const Vbench& t) { return std::uint64_t{t.less}; }},
        {"from integer", 1, [](const V& v) { return bits(v.a); }, [](const Vbench& t) { return t.converted; }},
    };
    Vbench top;
    std::deque<Vector> given;  // the newest first
    for (std::uint64_t n = 0; n < vectors; ++n) {
        given.push_front(numbers.next());
        top.a = bits(given.front().a);
        top.b = bits(given.front().b);
        top.what = given.front().signs;
        top.load_div = n % of_div == 0;
        top.load_sqrt = n % of_sqrt == 0;
        top.clk = 0;
        top.eval();
        top.clk = 1;
        top.eval();
        for (Unit& unit : units) {
            if (given.size() < unit.stages || (n + 1 - unit.stages) % unit.every != 0) {
                continue;
            }
            const Vector& v = given[unit.stages - 1];
            const std::uint64_t expected = unit.expected(v), found = unit.found(top);
            ++unit.vectors;
            unit.ends += expected == bits(HardwareFixed::of(HardwareFixed::most)) ||
                         expected == bits(-HardwareFixed::of(HardwareFixed::most));
            if (found != expected && unit.differences++ == 0) {
                std::printf("%s(%012llx, %012llx, %d): %012llx, not %012llx\n", unit.name,
                            static_cast<unsigned long long>(bits(v.a)), static_cast<unsigned long long>(bits(v.b)),
                            v.signs, static_cast<unsigned long long>(found), static_cast<unsigned long long>(expected));
            }
        }
        if (given.size() > 24) {
            given.pop_back();
        }
    }
    bool differs = false;
    for (const Unit& unit : units) {
        std::printf("%s: %llu vectors, %llu differ, %llu at an end\n", unit.name,
                    static_cast<unsigned long long>(unit.vectors), static_cast<unsigned long long>(unit.differences),
                    static_cast<unsigned long long>(unit.ends));
        differs = differs || unit.differences > 0;
    }
    return differs ? 1 : 0;
}
