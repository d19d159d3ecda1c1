// Records a controller with its guard and writes the operations that exported hardware computes, as JSON.
//
//     trace NUMBERS OBSERVER POLES WEIGHTS      the numbers that chosen.hpp describes
//
//    Compiled with FRACGYRO_FIXED 0, for float, or 1, for a fixed point.
//
//    A step is run once for each path through its decisions, each path with an unknown state. Words that never change
//    are constants. They are found by iteration: at first all words are constant; words found to change are made
//    variable, until no more change. The next value of each word is a diagram: decisions lead to its leaves; equal
//    diagrams are kept once.
#include "trace.hpp"

#include "chosen.hpp"
#include "fracgyro/sim/aggregate.hpp"

#include <cinttypes>
#include <cstdio>
#include <optional>

namespace fracgyro::trace {
namespace {

using Guarded = ChosenController<Traced>;

constexpr std::size_t most_paths = 200'000;

template <class Value>
concept Whole = std::derived_from<Value, Count> || std::same_as<Value, Flag>;

// Calls visit(leaf) for the numbers, integers and switches of a state, in order.
template <class Value, class Visit>
void walk(Value& value, Visit&& visit) {
    using Bare = std::remove_const_t<Value>;
    if constexpr (std::same_as<Bare, Traced> || Whole<Bare> || !std::is_class_v<Bare>) {
        visit(value);
    } else if constexpr (requires { value.size(); }) {
        for (auto& one : value) {
            walk(one, visit);
        }
    } else if constexpr (requires { value.off_diagonal; }) {  // its constructors hide its members
        walk(value.diagonal, visit);
        visit(value.off_diagonal);
    } else {
        with_members(value, [&](auto&... members) { (walk(members, visit), ...); });
    }
}

// The next value of a word: a number of the graph, or an integer.
struct Became {
    int operand = -1, word = -1;
    std::int64_t offset = 0;
    auto operator<=>(const Became&) const = default;
};
Became became(const Traced& number) { return {.operand = number.operand()}; }
Became became(const Count& count) { return {.word = count.word, .offset = count.offset}; }

struct Word {
    int bits = 0;  // width of an integer
    bool varies = false;
    Number initial{};
    Bounds bounds{};
};

struct Result {
    std::vector<Answer> path;
    std::vector<int> leaves;  // by number: of the words, the reported numbers, the status
};

struct Tracer {
    Guarded::Coefficients coefficients{};
    std::vector<Word> words;
    std::vector<std::size_t> force;  // the words that are the force
    Numbered<Became> leaves;
    std::vector<Result> results;
    bool traceable = true;

    explicit Tracer(const Guarded::Coefficients& c) : coefficients(c) {
        Guarded::State state{};
        walk(state, [&]<class Value>(Value& value) {
            if constexpr (std::same_as<Value, Traced>) {
                if (&value == &state.force.first || &value == &state.force.second) {
                    force.push_back(words.size());
                }
                words.push_back({.initial = value.value});
            } else if constexpr (std::same_as<Value, Flag>) {
                words.push_back({.bits = 1, .bounds = {value.count.offset, value.count.offset}});
            } else if constexpr (Whole<Value>) {
                words.push_back({.bits = Value::bits, .bounds = {value.offset, value.offset}});
            } else if constexpr (!std::same_as<Value, Status>) {  // which every step sets before anything asks
                traceable = false;
            }
        });
    }

    void step() {
        Guarded::State state{};
        std::size_t at = 0;
        Recorder& r = recorder();
        r.place = 0;
        r.answered.clear();
        r.bounds.clear();
        const auto next = [&](auto& count) {
            r.bounds.push_back(words[at].bounds);
            count.word = static_cast<int>(at++);
            count.offset = 0;
        };
        walk(state, [&]<class Value>(Value& value) {
            if constexpr (std::same_as<Value, Traced>) {
                if (words[at].varies) {
                    value = Traced::of({.op = Op::state, .bits = static_cast<std::int64_t>(at)});
                }
                ++at;
                r.bounds.push_back({});
            } else if constexpr (std::same_as<Value, Flag>) {
                next(value.count);
            } else if constexpr (Whole<Value>) {
                next(value);
            }
        });
        const auto measured = [&](int place) {
            return Traced::of({.op = Op::input, .bits = r.inputs.of({.measured = place})});
        };
        const auto report = Guarded::report(state, coefficients);
        Guarded::step(state, coefficients,
                      {.position = {measured(0), measured(1)}, .velocity = {measured(2), measured(3)}});
        Result result{};
        const auto put = [&](const auto& value) { result.leaves.push_back(leaves.of(became(value))); };
        walk(state, [&]<class Value>(Value& value) {
            if constexpr (std::same_as<Value, Flag>) {
                put(value.count);
            } else if constexpr (!std::same_as<Value, Status>) {
                put(value);
            }
        });
        for_each_number<Reported::between_steps>(report, put);
        put(Count(static_cast<int>(state.status)));
        result.path.assign(r.path.begin(), r.path.begin() + static_cast<std::ptrdiff_t>(r.place));
        results.push_back(result);
    }

    // Every path. Whether what the words were taken for held; if not, they are taken for more.
    bool trace(bool widen) {
        Recorder& r = recorder();
        r.nodes = {};
        r.inputs = {};
        r.predicates = {};
        r.path.clear();
        leaves = {};
        results.clear();
        std::vector<Word> found = words;
        do {
            step();
            for (std::size_t k = 0; k < words.size(); ++k) {
                const Became& leaf = leaves.things[static_cast<std::size_t>(results.back().leaves[k])];
                if (words[k].bits > 0) {
                    extend(found[k].bounds, leaf, widen);
                } else {
                    found[k].varies = found[k].varies || leaf != became(Traced(words[k].initial));
                }
            }
            r.path.resize(r.place);
            while (!r.path.empty() && !r.path.back().yes) {
                r.path.pop_back();
            }
            if (!r.path.empty()) {
                r.path.back().yes = false;
            }
        } while (!r.path.empty() && results.size() < most_paths);
        bool held = true;
        for (std::size_t k = 0; k < words.size(); ++k) {
            held = held && found[k].varies == words[k].varies && found[k].bounds.low == words[k].bounds.low &&
                   found[k].bounds.high == words[k].bounds.high;
        }
        words = found;
        return held;
    }
    static void extend(Bounds& bounds, const Became& leaf, bool widen) {
        Bounds reached{leaf.offset, leaf.offset};
        if (leaf.word >= 0) {
            const Bounds& from = recorder().bounds[static_cast<std::size_t>(leaf.word)];
            reached = {from.low + leaf.offset, from.high == Bounds{}.high ? from.high : from.high + leaf.offset};
        }
        if (reached.high > bounds.high) {
            bounds.high = widen ? Bounds{}.high : reached.high;
        }
        bounds.low = std::min(bounds.low, reached.low);
    }
};

// Decisions to leaves: a predicate with two diagrams, or a leaf.
struct Diagram {
    int predicate = -1, yes = 0, no = 0;  // in a leaf, yes is its number
    auto operator<=>(const Diagram&) const = default;
};

struct Diagrams {
    Numbered<Diagram> all;
    // The diagrams of each leaf of these results, which agree on their first `depth` answers.
    std::vector<int> build(std::span<const Result> results, std::size_t depth) {
        std::vector<int> found;
        if (results.front().path.size() == depth) {
            for (const int leaf : results.front().leaves) {
                found.push_back(all.of({-1, leaf, 0}));
            }
            return found;
        }
        std::size_t split = 0;
        while (split < results.size() && results[split].path[depth].yes) {
            ++split;
        }
        const auto yes = build(results.first(split), depth + 1), no = build(results.subspan(split), depth + 1);
        for (std::size_t k = 0; k < yes.size(); ++k) {
            found.push_back(yes[k] == no[k] ? yes[k] : all.of({results.front().path[depth].predicate, yes[k], no[k]}));
        }
        return found;
    }
};

template <class Things, class Print>
void list(const char* name, const Things& things, const char* end, Print&& print) {
    std::printf("\"%s\": [", name);
    const char* comma = "";
    for (const auto& thing : things) {
        std::printf("%s", comma);
        print(thing);
        comma = ",\n";
    }
    std::printf("]%s\n", end);
}

// A program is what all numbers become; its diagram comes last.
void write(Tracer& t) {
    const std::size_t status = t.results.front().leaves.size() - 1;
    const auto integer = [&](std::size_t k) { return k == status || (k < t.words.size() && t.words[k].bits > 0); };
    Numbered<std::vector<int>> programs;
    std::vector<std::vector<int>> asked;  // by program: the predicates on all paths to it
    for (Result& result : t.results) {
        std::vector<int> operands;
        for (std::size_t k = 0; k <= status; ++k) {
            if (!integer(k)) {
                operands.push_back(t.leaves.things[static_cast<std::size_t>(result.leaves[k])].operand);
            }
        }
        const auto program = static_cast<std::size_t>(programs.of(operands));
        result.leaves.push_back(static_cast<int>(program));
        asked.resize(programs.things.size());
        for (const Answer& answer : result.path) {
            asked[program].push_back(answer.predicate);
        }
    }
    for (auto& predicates : asked) {
        std::sort(predicates.begin(), predicates.end());
        predicates.erase(std::unique(predicates.begin(), predicates.end()), predicates.end());
    }
    for (const Word& word : t.words) {
        if (word.bits == 0 && word.varies) {
            Traced(word.initial).operand();  // a constant that the start needs
        }
    }
    Diagrams diagrams;
    const auto roots = diagrams.build(t.results, 0);
    const Recorder& r = recorder();
    std::printf("{\n\"paths\": %zu,\n", t.results.size());
    list("nodes", r.nodes.things, ",", [](const Node& n) {
        const auto& o = n.operands;
        std::printf("[%d,%" PRId64 ",%d,%d,%d,%d]", static_cast<int>(n.op), n.bits, o[0], o[1], o[2], o[3]);
    });
    list("inputs", r.inputs.things, ",", [](const Input& i) {
        std::printf("[%d,%d,%" PRIu64 ",%" PRIu64 ",%d]", i.measured, static_cast<int>(i.what), i.start, i.increment,
                    i.word);
    });
    list("predicates", r.predicates.things, ",",
         [](const Predicate& p) { std::printf("[%d,%d,%" PRId64 "]", static_cast<int>(p.question), p.of, p.limit); });
    list("words", t.words, ",", [](const Word& w) {
        std::printf("[%d,%d,%" PRId64 ",%" PRId64 ",%" PRId64 "]", w.bits,
                    static_cast<int>(w.bits > 0 ? w.bounds.low != w.bounds.high : w.varies), bits_of(w.initial),
                    w.bounds.low, w.bounds.high);
    });
    list("force", t.force, ",", [](std::size_t word) { std::printf("%zu", word); });
    list("leaves", t.leaves.things, ",",
         [](const Became& leaf) { std::printf("[%d,%d,%" PRId64 "]", leaf.operand, leaf.word, leaf.offset); });
    list("diagrams", diagrams.all.things, ",",
         [](const Diagram& d) { std::printf("[%d,%d,%d]", d.predicate, d.yes, d.no); });
    const auto row = [](const std::vector<int>& numbers) {
        std::printf("[");
        for (std::size_t k = 0; k < numbers.size(); ++k) {
            std::printf("%s%d", k == 0 ? "" : ",", numbers[k]);
        }
        std::printf("]");
    };
    list("programs", programs.things, ",", row);
    list("asked", asked, ",", row);
    list("roots", roots, "}", [](int root) { std::printf("%d", root); });
}

}  // namespace
}  // namespace fracgyro::trace

int main(int count, char** words) {
    using namespace fracgyro::trace;
    if (count != 5) {
        return 1;
    }
    Tracer tracer(fracgyro::chosen_coefficients<Guarded>(words));
    if (!tracer.traceable) {
        std::fprintf(stderr, "counters in its state choose what is computed, which is not traced\n");
        return 2;
    }
    constexpr int few = 3;
    for (int round = 0; !tracer.trace(round >= few); ++round) {
        if (tracer.results.size() == most_paths) {
            std::fprintf(stderr, "a step has more than %zu ways through it\n", most_paths);
            return 2;
        }
    }
    if (recorder().powers) {
        std::fprintf(
            stderr,
            "powers other than the square root, exponentials and logarithms are not computed with a fixed point\n");
        return 2;
    }
    write(tracer);
    return 0;
}
