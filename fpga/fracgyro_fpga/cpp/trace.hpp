// A number that records the operations on it. The core, run on it once for each path through its decisions, leaves a
// graph of operations: the computation of the exported hardware.
//
//    Equal operations are recorded once. Constants are computed immediately, in the number type of the hardware: float
//    or, if FRACGYRO_FIXED is 1, fixed point. A change of sign costs nothing: it is part of an operand. Integers and
//    switches of a state (`Kept` in core/scalar.hpp) are recorded as a word of the state plus the amount added to it. A
//    comparison of numbers or words that becomes a bool is a decision, which is answered according to the present path.
#pragma once

#include "fixed.hpp"

#include <cstdint>
#include <algorithm>
#include <map>
#include <tuple>
#include <vector>

namespace fracgyro::trace {

#if FRACGYRO_FIXED
using Number = HardwareFixed;
#else
using Number = float;
#endif
constexpr bool is_fixed = FRACGYRO_FIXED;
constexpr std::int64_t bits_of(float a) { return std::bit_cast<std::uint32_t>(a); }
constexpr std::int64_t bits_of(HardwareFixed a) { return a.places; }

enum class Op {
    constant,
    state,
    input,
    add,
    multiply,
    divide,
    square_root,
    select,
    copy_sign,
    less,
    exponent,
    mantissa,
    scale
};

// Operands: 4 times the number of a node, plus 1 if its sign is changed, plus 2 if the sign is dropped before.
struct Node {
    Op op{};
    std::array<int, 4> operands{-1, -1, -1, -1};
    std::int64_t bits = 0;  // bits of a constant, or the place among words or inputs
    auto operator<=>(const Node&) const = default;
};

// Parts of a phase, start + increment·steps, that the hardware computes.
enum class OfPhase { remainder, odd_quadrant, negative_sine, negative_cosine };
struct Input {
    int measured = -1;  // the place in the motion, or:
    OfPhase what{};
    std::uint64_t start = 0, increment = 0;
    int word = -1;
    auto operator<=>(const Input&) const = default;
};

// less: a node of that name is true. at_least: an integer word is >= limit. multiple: it is one of `limit`.
enum class Question { less, at_least, multiple };
struct Predicate {
    Question question{};
    int of = 0;
    std::int64_t limit = 0;
    auto operator<=>(const Predicate&) const = default;
};

// Things by number, each kept once.
template <class Thing>
struct Numbered {
    std::vector<Thing> things;
    std::map<Thing, int> known;
    int of(const Thing& thing) {
        const auto [at, added] = known.try_emplace(thing, static_cast<int>(things.size()));
        if (added) {
            things.push_back(thing);
        }
        return at->second;
    }
};

struct Bounds {
    std::int64_t low = 0, high = std::numeric_limits<std::int64_t>::max();
};
struct Answer {
    int predicate = 0;
    bool yes = true;
};

struct Recorder {
    Numbered<Node> nodes;
    Numbered<Input> inputs;
    Numbered<Predicate> predicates;
    // The present path: its answers so far, those that are prescribed, and what they say of integer words.
    std::vector<Answer> path;
    std::size_t place = 0;
    std::map<int, bool> answered;
    std::vector<Bounds> bounds;
    bool powers = false;  // there was one, an exponential or a logarithm

    bool decide(const Predicate& predicate) {
        const int number = predicates.of(predicate);
        if (const auto known = answered.find(number); known != answered.end()) {
            return known->second;
        }
        if (predicate.question == Question::multiple && bounds[static_cast<std::size_t>(predicate.of)].high == 0) {
            return true;
        }
        if (place == path.size()) {
            path.push_back({number, true});
        }
        const bool yes = path[place++].yes;
        answered[number] = yes;
        return yes;
    }
    bool at_least(int word, std::int64_t limit) {
        Bounds& b = bounds[static_cast<std::size_t>(word)];
        if (limit <= b.low || b.high < limit) {
            return limit <= b.low;
        }
        const bool yes = decide({Question::at_least, word, limit});
        (yes ? b.low : b.high) = yes ? limit : limit - 1;
        return yes;
    }
};
inline Recorder& recorder() {
    static Recorder one;
    return one;
}

// A number: a constant, or a node with what becomes of its sign.
struct Traced {
    int node = -1;
    Number value{};
    bool negative = false, magnitude = false;

    constexpr Traced() = default;
    template <class One>
        requires(std::is_arithmetic_v<One> || std::same_as<One, Number>)
    constexpr explicit Traced(One a) : value(static_cast<Number>(a)) {}
    static Traced of(const Node& recorded) {
        Traced traced;
        traced.node = recorder().nodes.of(recorded);
        return traced;
    }

    bool constant() const { return node < 0; }
    int operand() const {
        const int number = constant() ? recorder().nodes.of({.op = Op::constant, .bits = bits_of(value)}) : node;
        return 4 * number + (magnitude ? 2 : 0) + (negative ? 1 : 0);
    }
    constexpr Traced operator-() const {
        Traced result = *this;
        result.value = -value;
        result.negative = node >= 0 && !negative;
        return result;
    }
    friend Traced absolute(Traced a) {
        a.value = fracgyro::absolute(a.value);
        a.negative = false;
        a.magnitude = !a.constant();
        return a;
    }
    friend Traced operator+(Traced a, Traced b) {
        if (a.constant() && b.constant()) {
            return Traced(a.value + b.value);
        }
        return a.is_zero() && b.keeps_its_bits()   ? b
               : b.is_zero() && a.keeps_its_bits() ? a
                                                   : either_way(Op::add, a, b);
    }
    friend Traced operator-(Traced a, Traced b) { return a + -b; }
    friend Traced operator*(Traced a, Traced b) {
        if (a.constant() && b.constant()) {
            return Traced(a.value * b.value);
        }
        const bool changed = take_sign(a) != take_sign(b);
        if (is_fixed && (a.is_zero() || b.is_zero())) {  // nothing is not a number
            return Traced(0.0);
        }
        const Traced product = a.is_one() ? b : b.is_one() ? a : either_way(Op::multiply, a, b);
        return changed ? -product : product;
    }
    friend Traced operator/(Traced a, Traced b) {
        if (a.constant() && b.constant()) {
            return Traced(a.value / b.value);
        }
        const bool changed = take_sign(a) != take_sign(b);
        const Traced quotient = b.is_one() ? a : of({.op = Op::divide, .operands = {a.operand(), b.operand(), -1, -1}});
        return changed ? -quotient : quotient;
    }
    friend Traced square_root(Traced a) {
        return a.constant() ? Traced(square_root(a.value))
                            : of({.op = Op::square_root, .operands = {a.operand(), -1, -1, -1}});
    }
    friend Traced if_less(Traced a, Traced b, Traced yes, Traced no) {
        if (a.constant() && b.constant()) {
            return a.value < b.value ? yes : no;
        }
        const std::array<int, 4> operands{a.operand(), b.operand(), yes.operand(), no.operand()};
        return operands[2] == operands[3] ? yes : of({.op = Op::select, .operands = operands});
    }
    friend Traced with_sign_of(Traced sign, Traced magnitude) {
        if (sign.constant() && magnitude.constant()) {
            return Traced(with_sign_of(sign.value, magnitude.value));
        }
        return of({.op = Op::copy_sign, .operands = {sign.operand(), magnitude.operand(), -1, -1}});
    }
    friend bool operator<(Traced a, Traced b) {
        if (a.constant() && b.constant()) {
            return a.value < b.value;
        }
        const Traced less = of({.op = Op::less, .operands = {a.operand(), b.operand(), -1, -1}});
        return recorder().decide({Question::less, less.node});
    }

private:
    bool is_one() const { return constant() && value == Number(1.0); }
    bool is_zero() const { return constant() && value == Number(0.0); }
    // That adding 0 leaves its bits: a magnitude or a sum of two, which are not -0, or of a fixed point without a -0.
    bool keeps_its_bits() const {
        if (is_fixed || constant() || negative || magnitude) {
            return is_fixed || (magnitude && !negative);
        }
        const Node& made = recorder().nodes.things[static_cast<std::size_t>(node)];
        return made.op == Op::add && (made.operands[0] & 3) == 2 && (made.operands[1] & 3) == 2;
    }
    // The sign of a product or a quotient depends only on the operands' signs, not on their sizes.
    static bool take_sign(Traced& a) {
        const bool taken = a.constant() ? is_negative(a.value) : a.negative;
        a = taken ? -a : a;
        return taken;
    }
    static bool is_negative(float a) { return std::signbit(a); }
    static bool is_negative(HardwareFixed a) { return a.places < 0; }
    static Traced either_way(Op op, const Traced& a, const Traced& b) {
        const int first = a.operand(), second = b.operand();
        return of({.op = op, .operands = {std::min(first, second), std::max(first, second), -1, -1}});
    }
};

// An integer of a state: a word of it plus an offset, or the offset only.
struct Count {
    int word = -1;
    std::int64_t offset = 0;

    constexpr Count() = default;
    template <std::integral Built>
    constexpr Count(Built value) : offset(static_cast<std::int64_t>(value)) {}

    // A conversion to a built-in number decides its value. For a number without bounds the only possible question is
    // whether it is 0: a guard asks it to find out if time has started.
    template <std::same_as<std::uint64_t> Built>
    operator Built() const {
        std::int64_t value = word < 0 ? 0 : recorder().bounds[static_cast<std::size_t>(word)].low;
        const bool bounded = word < 0 || recorder().bounds[static_cast<std::size_t>(word)].high < 1 << 16;
        while (word >= 0 && recorder().at_least(word, value + 1)) {
            ++value;
            if (!bounded) {
                break;
            }
        }
        return static_cast<Built>(value + offset);
    }
    friend Count operator+(Count a, std::int64_t b) {
        a.offset += b;
        return a;
    }
    friend Count operator-(Count a, std::int64_t b) { return a + -b; }
    Count& operator++() { return *this = *this + 1; }
    Count& operator--() { return *this = *this - 1; }

    bool at_least(std::int64_t limit) const {
        return word < 0 ? offset >= limit : recorder().at_least(word, limit - offset);
    }
    template <std::integral Built>
    friend bool operator<(const Count& a, Built b) {
        return !a.at_least(static_cast<std::int64_t>(b));
    }
    template <std::integral Built>
    friend bool operator<(Built a, const Count& b) {
        return b.at_least(static_cast<std::int64_t>(a) + 1);
    }
    template <std::integral Built>
    friend bool operator>(const Count& a, Built b) {
        return b < a;
    }
    template <std::integral Built>
    friend bool operator==(const Count& a, Built b) {
        const auto limit = static_cast<std::int64_t>(b);
        return a.at_least(limit) && !a.at_least(limit + 1);
    }
    friend Count minimum(const Count& a, std::uint32_t b) { return a < b ? a : Count(b); }
};

// A word modulo a number, of which only whether it is 0 can be asked.
struct Rest {
    Count count;
    std::uint64_t modulus;
    friend bool operator==(const Rest& a, int /*zero*/) {
        return recorder().decide({Question::multiple, a.count.word, static_cast<std::int64_t>(a.modulus)});
    }
};
inline Rest operator%(const Count& a, std::uint64_t modulus) { return {a, modulus}; }

// A count of `size` bits.
template <int size>
struct CountOf : Count {
    static constexpr int bits = size;
    using Count::Count;
    constexpr CountOf(const Count& count) : Count(count) {}
};

struct Flag {
    static constexpr int bits = 1;
    Count count{};
    constexpr Flag() = default;
    constexpr Flag(bool yes) : count(yes ? 1 : 0) {}
    operator bool() const { return count.at_least(1); }
};

// The factor from a remainder to radians. A fixed-point remainder is in the last places of its word.
constexpr double radians = is_fixed ? HardwareFixed::radians_of_remainder : 6.28318530717958647693 / 0x1p32;

// Hardware with a fixed point does not compute powers, exponentials and logarithms.
template <std::same_as<Traced> T>
    requires is_fixed
T power(T base, T /*exponent*/) {
    recorder().powers = true;
    return base;
}
template <std::same_as<Traced> T>
    requires is_fixed
T exponential(T a) {
    recorder().powers = true;
    return a;
}
template <std::same_as<Traced> T>
    requires is_fixed
T logarithm(T a) {
    recorder().powers = true;
    return a;
}

// A phase of the reference: start + increment·word, modulo 2^64.
struct Phase {
    std::uint64_t start = 0, increment = 0;
    int word = -1;
    friend Phase operator+(Phase a, std::uint64_t b) {
        a.start += b;
        return a;
    }
    friend Phase operator+(const Phase& a, const Phase& b) { return {a.start + b.start, b.increment, b.word}; }
    friend Phase operator*(const Count& steps, const Phase& increment) {
        return {static_cast<std::uint64_t>(steps.offset) * increment.start, increment.start, steps.word};
    }
};

}  // namespace fracgyro::trace

namespace fracgyro {

#if !FRACGYRO_FIXED
template <>
struct detail::Bits<trace::Traced> : detail::Bits<float> {};
#endif

template <>
struct KeptBy<trace::Traced, bool> {
    using Type = trace::Flag;
};
template <std::integral Built>
struct KeptBy<trace::Traced, Built> {
    using Type = trace::CountOf<std::numeric_limits<Built>::digits>;
};

// Numbers taken apart and put together.
template <>
inline trace::Traced detail::mantissa_split(trace::Traced x, trace::Traced& exponent) {
    exponent = trace::Traced::of({.op = trace::Op::exponent, .operands = {x.operand(), -1, -1, -1}});
    return trace::Traced::of({.op = trace::Op::mantissa, .operands = {x.operand(), -1, -1, -1}});
}
template <>
inline trace::Traced detail::times_two_to_the(trace::Traced mantissa, trace::Traced placed) {
    return trace::Traced::of({.op = trace::Op::scale, .operands = {mantissa.operand(), placed.operand(), -1, -1}});
}

template <>
inline trace::Traced angle(detail::Built<trace::Traced> radians) {
    const trace::Traced* const known = angle_of_integer<trace::Traced>();
    return known != nullptr ? *known : trace::Traced(radians);
}

// The hardware's integers compute the integer part of sine and cosine; operations on the result are recorded.
template <>
struct PhaseOf<trace::Traced> {
    using Type = trace::Phase;
    // A phase in a state is not traced: the tracer refuses the controller.
    static Type after(const Type& phase, trace::Traced) { return phase; }
    static trace::Traced turns(const Type&) { return trace::Traced(0.0); }
    static SineCosine<trace::Traced> sine_cosine(const Type& phase) {
        using trace::OfPhase;
        const auto input = [&](OfPhase what) {
            const trace::Input found{-1, what, phase.start, phase.increment, phase.word};
            return trace::Traced::of({.op = trace::Op::input, .bits = trace::recorder().inputs.of(found)});
        };
        return sine_cosine_of(input(OfPhase::remainder), trace::Traced(trace::radians), input(OfPhase::odd_quadrant),
                              input(OfPhase::negative_sine), input(OfPhase::negative_cosine));
    }
};

}  // namespace fracgyro
