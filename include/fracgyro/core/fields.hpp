// Descriptions of the numbers of a struct, listed once, next to it: name, unit, range and meaning of each. From such a
// list come the scenario's tables, the recorded channels, the variables of an FMU, the JavaScript interface and the
// reference pages. Firmware never uses it, so it costs no byte there.
//
//     static constexpr auto fields() {
//         return Fields{field("bandwidth", &P::bandwidth, "omega0", positive, "Bandwidth of the loop."), …};
//     }
#pragma once

#include "fracgyro/core/scalar.hpp"

#include <cstdint>
#include <span>
#include <string_view>
#include <utility>

namespace fracgyro {

struct Range {
    double low = -std::numeric_limits<double>::infinity(), high = std::numeric_limits<double>::infinity();
    bool strict = false;    // low < value < high
    bool infinite = false;  // infinity is allowed, and disables
    bool whole = false;     // an integer
};
inline constexpr Range any_number{}, at_least_0{.low = 0.0}, above_0{.low = 0.0, .strict = true};
inline constexpr Range limit{.low = 0.0, .strict = true, .infinite = true};
inline constexpr Range strictly_between_0_and_1{.low = 0.0, .high = 1.0, .strict = true};

using Choices = std::span<const std::string_view>;

// When a number may be set.
enum class Settable {
    any_time,
    at_start,    // meaningful only there
    beforehand,  // others are designed for it
    never,       // it follows from others
};

template <class Member>
struct Field {
    std::string_view name;
    Member member;
    std::string_view unit;  // nondimensional; "a, b, c": of each part
    Range range;
    std::string_view meaning;
    Choices choices;  // names of an enum or a switch, by number
    Settable settable = Settable::any_time;
    bool momentary = false;       // a report's number, known only while a step is computed
    std::string_view table = {};  // if it is not the table of its struct
    Choices kinds = {};           // kinds of the struct, if only some of them have this number: those of the mask
    std::uint32_t mask = 0;
};
template <class Member>
constexpr Field<Member> field(std::string_view name, Member member, std::string_view unit, Range range,
                              std::string_view meaning) {
    return {name, member, unit, range, meaning, {}};
}
template <class Member>
constexpr Field<Member> choice(std::string_view name, Member member, Choices choices, std::string_view meaning) {
    return {name, member, "1", {}, meaning, choices};
}
// A recorded number of a report.
template <class Member>
constexpr Field<Member> channel(std::string_view name, Member member, std::string_view unit, std::string_view meaning) {
    return {name, member, unit, {}, meaning, {}};
}
template <class Member>
constexpr Field<Member> momentary(Field<Member> field) {
    field.momentary = true;
    return field;
}
template <class Member>
constexpr Field<Member> settable(Settable when, Field<Member> field) {
    field.settable = when;
    return field;
}
template <class Member>
constexpr Field<Member> fixed(Field<Member> field) {
    return settable(Settable::at_start, field);
}
template <class Member>
constexpr Field<Member> in_table(std::string_view table, Field<Member> field) {
    field.table = table;
    return field;
}

// Kinds, and a number that only these have.
template <class... Kind>
constexpr std::uint32_t kinds(Kind... kind) {
    return ((std::uint32_t{1} << static_cast<std::uint32_t>(kind)) | ...);
}
template <class Member>
constexpr Field<Member> for_kinds(Choices names, std::uint32_t mask, Field<Member> field) {
    field.kinds = names;
    field.mask = mask;
    return field;
}

// A member of a member.
template <class Outer, class Member>
struct Within {
    Outer outer;
    Member inner;
};
template <class Struct, class Member>
constexpr auto& member_of(Struct& of, const Member& member) {
    if constexpr (requires { of.*member; }) {
        return of.*member;
    } else {
        return member_of(member_of(of, member.outer), member.inner);
    }
}

template <class Outer, class Member>
Within(Outer, Member) -> Within<Outer, Member>;

namespace detail {
template <std::size_t, class Listed>
struct FieldAt {
    Listed listed;
};
template <class, class...>
struct FieldsAt;
template <std::size_t... at, class... Listed>
struct FieldsAt<std::index_sequence<at...>, Listed...> : FieldAt<at, Listed>... {
    constexpr FieldsAt(const Listed&... listed) : FieldAt<at, Listed>{listed}... {}

    template <class Visit>
    constexpr void each(const Visit& visit) const {
        (visit(static_cast<const FieldAt<at, Listed>&>(*this).listed), ...);
    }
};
}  // namespace detail

// A list of fields. A std::tuple would take three times as long to compile.
template <class... Listed>
struct Fields : detail::FieldsAt<std::index_sequence_for<Listed...>, Listed...> {
    using detail::FieldsAt<std::index_sequence_for<Listed...>, Listed...>::FieldsAt;
};
template <class... Listed>
Fields(const Listed&...) -> Fields<Listed...>;

template <class Only>
constexpr Only joined(const Only& only) {
    return only;
}
template <class... A, class... B, class... More>
constexpr auto joined(const Fields<A...>& a, const Fields<B...>& b, const More&... more) {
    const auto both = [&]<std::size_t... i, std::size_t... j>(
                          const detail::FieldsAt<std::index_sequence<i...>, A...>& a,
                          const detail::FieldsAt<std::index_sequence<j...>, B...>& b) {
        return Fields<A..., B...>{static_cast<const detail::FieldAt<i, A>&>(a).listed...,
                                  static_cast<const detail::FieldAt<j, B>&>(b).listed...};
    };
    return joined(both(a, b), more...);
}

// Fields of a member, in a table of their own: all, or those of a list.
struct AllFields {};
template <class Member, class List = AllFields>
struct Inner {
    std::string_view inner_table;
    Member member;
    List list{};
};
template <class Member>
Inner(std::string_view, Member) -> Inner<Member>;
template <class Member, class List>
Inner(std::string_view, Member, List) -> Inner<Member, List>;

// A constant, so firmware contains nothing of it that it does not use.
template <class Struct>
inline constexpr auto fields_of = Struct::fields();

// Calls visit(table, field, value) for each field of a list, by default all.
template <class Struct, class Visit, class List = AllFields>
constexpr void for_each_field(std::string_view table, Struct& of, Visit&& visit, const List& list = {}) {
    const auto one = [&]<class Listed>(const Listed& listed) {
        if constexpr (requires { listed.inner_table; }) {
            for_each_field(listed.inner_table, member_of(of, listed.member), visit, listed.list);
        } else {
            visit(listed.table.empty() ? table : listed.table, listed, member_of(of, listed.member));
        }
    };
    if constexpr (std::is_same_v<List, AllFields>) {
        fields_of<std::remove_const_t<Struct>>.each(one);
    } else {
        list.each(one);
    }
}

// Calls visit(part, number) for the numbers of a field's value: part is "", ".x", ".xy" or "[0]".
template <class Value, class Visit>
constexpr void for_each_part(Value& value, Visit&& visit) {
    // Members in a register are visited as copies.
    const auto put_back = [&](const auto&... parts) {
        if constexpr (!std::is_const_v<Value>) {
            value = Value{parts...};
        }
    };
    if constexpr (requires { value.xx(); }) {
        auto xx = value.xx(), xy = value.xy(), yy = value.yy();
        visit(std::string_view(".xx"), xx);
        visit(std::string_view(".xy"), xy);
        visit(std::string_view(".yy"), yy);
        put_back(xx, xy, yy);
    } else if constexpr (requires { value.x(); }) {
        auto x = value.x(), y = value.y();
        visit(std::string_view(".x"), x);
        visit(std::string_view(".y"), y);
        put_back(x, y);
    } else if constexpr (requires { value.size(); }) {
        constexpr std::string_view places[] = {"[0]", "[1]", "[2]", "[3]", "[4]", "[5]", "[6]", "[7]"};
        for (std::size_t i = 0; i < value.size(); ++i) {
            visit(places[i], value[i]);
        }
    } else {
        visit(std::string_view(""), value);
    }
}

template <class Value>
constexpr std::size_t count_parts(const Value& value) {
    if constexpr (requires { value.xx(); }) {
        return 3;
    } else if constexpr (requires { value.x(); }) {
        return 2;
    } else if constexpr (requires { value.size(); }) {
        return value.size();
    } else {
        return 1;
    }
}

// Numbers of a report, in order: all numbers of a step, or only those also known between steps.
enum class Reported { in_step, between_steps };
template <Reported when = Reported::in_step, class Report, class Put>
constexpr void for_each_number(const Report& report, Put&& put) {
    for_each_field("", report, [&](std::string_view, const auto& field, const auto& value) {
        if (when == Reported::in_step || !field.momentary) {
            for_each_part(value, [&](std::string_view, const auto& number) { put(number); });
        }
    });
}
template <class Report, Reported when = Reported::in_step>
constexpr std::size_t width_of() {
    std::size_t width = 0;
    const Report report{};
    for_each_field("", report, [&](std::string_view, const auto& field, const auto& value) {
        width += when == Reported::in_step || !field.momentary ? count_parts(value) : 0;
    });
    return width;
}

}  // namespace fracgyro
