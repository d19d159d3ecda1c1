// Compares every unit of units.v with this computer's float, bit by bit, on random numbers.
//
//     units COUNT SEED      prints a line for each unit: vectors, differences, subnormal results; fails where one
//                           differs
//
//    An eighth of the numbers each is subnormal, special, near the other operand, a few bits long, near the ends of the
//    range; the others are any bits. Any NaN is as good as another.
#include "Vbench.h"
#include "verilated.h"

#include <bit>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <deque>
#include <random>

namespace {

struct Vector {
    std::uint32_t a, b, what;
};

class Numbers {
public:
    explicit Numbers(std::uint64_t seed) : random_(seed) {}
    Vector next() {
        const std::uint32_t a = one(0x3F800000U), what = static_cast<std::uint32_t>(random_() % 4);
        if (what < 2) {
            return {a, one(a), what};
        }
        // Operands that are decomposed, and results that are assembled, are positive and normal.
        const std::uint32_t bits = a & 0x7FFFFFFFU, exponent = 1 + (bits >> 23) % 254;
        const auto n = static_cast<std::uint32_t>(random_() % 254) + 1 - exponent;
        return {exponent << 23 | (bits & 0x7FFFFFU), what == 3 ? 0x4B400000U + n : one(a), what};
    }

private:
    std::mt19937_64 random_;
    std::uint32_t one(std::uint32_t other) {
        static constexpr std::uint32_t special[] = {0x00000000U, 0x3F800000U, 0x7F800000U, 0x7FC00000U,
                                                    0x00000001U, 0x007FFFFFU, 0x00800000U, 0x7F7FFFFFU,
                                                    0x3F7FFFFFU, 0x3F800001U, 0x40000000U, 0x4B400000U};
        const auto bits = static_cast<std::uint32_t>(random_());
        const std::uint32_t sign = bits & 0x80000000U;
        switch (random_() % 8) {
            case 0:
                return bits & 0x807FFFFFU;
            case 1:
                return sign | special[random_() % 12];
            case 2:
                return (other ^ sign) + static_cast<std::uint32_t>(random_() % 5) - 2;
            case 3:
                return bits & 0xFFF00000U;  // ties
            case 4:
                return sign | ((0x3F800000U + (bits & 0x07FFFFFFU)) - 0x04000000U);  // similar size
            case 5:
                return sign | (0x7E000000U + (bits & 0x017FFFFFU));  // near overflow
            case 6:
                return sign | (bits & 0x02FFFFFFU);  // near underflow
            default:
                return bits;
        }
    }
};

float number(std::uint32_t bits) { return std::bit_cast<float>(bits); }
std::uint32_t bits(float value) { return std::bit_cast<std::uint32_t>(value); }
bool same(std::uint32_t found, float expected) {
    return std::isnan(expected) ? std::isnan(number(found)) : found == bits(expected);
}

struct Unit {
    const char* name;
    std::size_t stages;
    float (*expected)(const Vector&);
    std::uint32_t (*found)(const Vbench&);
    std::uint64_t every = 1;
    bool apart = false;  // only for decomposed operands
    std::uint64_t vectors = 0, differences = 0, subnormal = 0;
};

constexpr std::uint32_t origin = 0x3F3504F3U;  // sqrt(1/2)

float exponent(const Vector& v) { return static_cast<float>(static_cast<std::int32_t>(v.a - origin) >> 23); }

float chosen(const Vector& v) {
    const float a = number(v.a), b = number(v.b);
    switch (v.what) {
        case 0:
            return a < b ? b : a;
        case 1:
            return std::copysign(b, std::isnan(a) ? 1.0F : a);  // the one NaN has no sign
        case 2:
            return number(((v.a - origin) & 0x7FFFFFU) + origin);
        default:
            return number(v.a + (v.b << 23));
    }
}

}  // namespace

int main(int count, char** words) {
    if (count != 3) {
        return 2;
    }
    const std::uint64_t vectors = std::strtoull(words[1], nullptr, 10);
    Numbers numbers(std::strtoull(words[2], nullptr, 10));
    constexpr std::uint64_t of_div = 10, of_sqrt = 14;  // cycles from load to load
    Unit units[] = {
        {"add", 5, [](const Vector& v) { return number(v.a) + number(v.b); }, [](const Vbench& t) { return t.sum; }},
        {"multiply", 4, [](const Vector& v) { return number(v.a) * number(v.b); },
         [](const Vbench& t) { return t.product; }},
        {"divide", 12, [](const Vector& v) { return number(v.a) / number(v.b); },
         [](const Vbench& t) { return t.quotient; }, of_div},
        {"square root", 16, [](const Vector& v) { return std::sqrt(number(v.a)); },
         [](const Vbench& t) { return t.root; }, of_sqrt},
        {"exponent", 3, exponent, [](const Vbench& t) { return t.exponent; }, 1, true},
        {"choose", 1, chosen, [](const Vbench& t) { return t.chosen; }},
        {"less", 1, [](const Vector& v) { return number(v.a) < number(v.b) ? 1.0F : 0.0F; },
         [](const Vbench& t) { return bits(t.less ? 1.0F : 0.0F); }},
        {"from integer", 4, [](const Vector& v) { return static_cast<float>(static_cast<std::int32_t>(v.a)); },
         [](const Vbench& t) { return t.converted; }},
    };
    Vbench top;
    std::deque<Vector> given;  // the newest first
    for (std::uint64_t n = 0; n < vectors; ++n) {
        given.push_front(numbers.next());
        top.a = given.front().a;
        top.b = given.front().b;
        top.what = given.front().what;
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
            if (unit.apart && v.what < 2) {
                continue;
            }
            const float expected = unit.expected(v);
            const std::uint32_t found = unit.found(top);
            ++unit.vectors;
            unit.subnormal += std::fpclassify(expected) == FP_SUBNORMAL;
            if (!same(found, expected) && unit.differences++ == 0) {
                std::printf("%s(%08x, %08x, %u): %08x, not %08x\n", unit.name, v.a, v.b, v.what, found, bits(expected));
            }
        }
        if (given.size() > 16) {
            given.pop_back();
        }
    }
    bool differs = false;
    for (const Unit& unit : units) {
        std::printf("%s: %llu vectors, %llu differ, %llu subnormal\n", unit.name,
                    static_cast<unsigned long long>(unit.vectors), static_cast<unsigned long long>(unit.differences),
                    static_cast<unsigned long long>(unit.subnormal));
        differs = differs || unit.differences > 0;
    }
    return differs ? 1 : 0;
}
