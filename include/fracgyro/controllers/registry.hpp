// Controllers by name. A new one is its own file plus one line here.
#pragma once

#include "fracgyro/controllers/conventional.hpp"
#include "fracgyro/controllers/disturbance_rejection.hpp"
#include "fracgyro/controllers/dynamic_sliding.hpp"
#include "fracgyro/controllers/fixed_time.hpp"
#include "fracgyro/controllers/integral_sliding.hpp"
#include "fracgyro/controllers/internal_model.hpp"
#include "fracgyro/controllers/least_squares_pid.hpp"
#include "fracgyro/controllers/lock_in.hpp"
#include "fracgyro/controllers/lqg.hpp"
#include "fracgyro/controllers/mode_reversal.hpp"
#include "fracgyro/controllers/network.hpp"
#include "fracgyro/controllers/nonsingular_terminal.hpp"
#include "fracgyro/controllers/park_horowitz.hpp"
#include "fracgyro/controllers/pid.hpp"
#include "fracgyro/controllers/prescribed.hpp"
#include "fracgyro/controllers/resonant.hpp"
#include "fracgyro/controllers/sliding_mode.hpp"
#include "fracgyro/controllers/super_twisting.hpp"
#include "fracgyro/controllers/whole_angle.hpp"
#include "fracgyro/core/entry.hpp"
#include "fracgyro/hardware/observer.hpp"

#include <tuple>
#include <variant>

namespace fracgyro {

template <class... Controllers>
struct List {};

// A controller of one type, for each scalar.
template <template <class> class Of>
struct One {
    using Params = typename Of<double>::Params;
    template <Scalar T>
    using Types = List<Of<T>>;
    static constexpr std::size_t chosen(const Params&) { return 0; }
};

// Sliding mode on this surface, with each adaptation.
template <template <class> class Surface>
struct SlidingMode {
    using Params = SlidingModeParams;
    template <Scalar T>
    using Types = List<SlidingModeController<T, Surface, GradientAdaptation>,
                       SlidingModeController<T, Surface, CompositeAdaptation>,
                       SlidingModeController<T, Surface, JointAdaptation>>;
    static constexpr std::size_t chosen(const Params& p) { return static_cast<std::size_t>(p.adaptation.runs()); }
};

using Registry = std::tuple<
    Entry<"fractional_fast_terminal", SlidingMode<FractionalFastTerminalSurface>, "sliding mode on (16), the paper's">,
    Entry<"fractional", SlidingMode<FractionalSurface>, "sliding mode on (16) with lambda2 = 0">,
    Entry<"fast_terminal", SlidingMode<FastTerminalSurface>, "sliding mode on (15): alpha = 1">,
    Entry<"linear", SlidingMode<LinearSurface>, "sliding mode with alpha = 1, lambda2 = 0">,
    Entry<"pid", One<Pid>, "PID with feedforward of the nominal plant">,
    Entry<"resonant", One<Resonant>, "PID with resonators at the frequencies of the reference">,
    Entry<"integral_sliding", One<IntegralSliding>, "integral sliding mode with a disturbance observer">,
    Entry<"dynamic", One<DynamicSliding>, "adaptive dynamic sliding mode: the rate of the force switches">,
    Entry<"fixed_time", One<FixedTime>, "adaptive fixed-time sliding mode">,
    Entry<"prescribed", One<Prescribed>, "prescribed performance: a barrier at a bound that shrinks">,
    Entry<"network", One<Network>, "sliding mode with a network that learns what the model lacks">,
    Entry<"super_twisting", One<SuperTwisting>, "adaptive super-twisting">,
    Entry<"nonsingular_terminal", One<NonsingularTerminal>, "adaptive nonsingular (fast) terminal sliding mode">,
    Entry<"park_horowitz", One<ParkHorowitz>, "adaptive control of Park and Horowitz">,
    Entry<"disturbance_rejection", One<DisturbanceRejection>, "active disturbance rejection (ADRC)">,
    Entry<"least_squares_pid", One<LeastSquaresPid>, "PID on the plant that least squares find">,
    Entry<"lqg", One<Lqg>, "linear-quadratic feedback on a joint Kalman filter">,
    Entry<"internal_model", One<InternalModel>,
          "oscillators at the reference's frequencies in a constant Kalman filter">,
    Entry<"lock_in", One<LockIn>, "demodulation each step, a joint Kalman filter once in many">,
    Entry<"open_loop", One<OpenLoop>, "conventional gyroscope, sense axis free">,
    Entry<"force_rebalance", One<ForceRebalance>, "conventional gyroscope, sense axis held at rest">,
    Entry<"whole_angle", One<WholeAngle>, "whole-angle gyroscope, a vibration that is free to turn">,
    Entry<"virtual_rotation", One<VirtualRotation>, "whole-angle gyroscope, turned to and fro by forces">,
    Entry<"mode_reversal", One<ModeReversal>, "force rebalance on both axes in turn">>;

namespace detail {

template <class Entries>
struct Listed;
template <class... Entries>
struct Listed<std::tuple<Entries...>> {
    using Params = std::variant<typename Entries::Type::Params...>;
    static constexpr std::array<std::string_view, sizeof...(Entries)> kinds{Entries::kind...},
        meanings{Entries::meaning...};
};

template <std::size_t place, class Types>
struct At;
template <std::size_t place, class... Types>
struct At<place, List<Types...>> {
    using Type = std::tuple_element_t<place, std::tuple<Types...>>;
};

template <class Visit, class... Types>
void visit_chosen(std::size_t chosen, Visit&& visit, List<Types...>) {
    std::size_t at = 0;
    const auto one = [&]<class C>(std::type_identity<C>) {
        static_assert(Resumable<C>);
        if (at++ == chosen) {
            visit.template operator()<C>();
        }
    };
    (one(std::type_identity<Types>{}), ...);
}

}  // namespace detail

// Parameters of any controller. The alternative is its kind: the index of its name in controller_kinds.
using ControllerParams = typename detail::Listed<Registry>::Params;
inline constexpr auto controller_kinds = detail::Listed<Registry>::kinds;
inline constexpr auto controller_meanings = detail::Listed<Registry>::meanings;

// True if the controllers of this line need a sine as the reference of x.
template <class Entry>
inline constexpr bool drives_a_sine = []<class... Types>(List<Types...>) {
    return (requires { Types::drives_a_sine; } || ...);
}(typename Entry::Type::template Types<double>{});

// True if the controllers of this line need a sine as the reference of both axes.
template <class Entry>
inline constexpr bool drives_sines = []<class... Types>(List<Types...>) {
    return (requires { Types::drives_sines; } || ...);
}(typename Entry::Type::template Types<double>{});

// Calls visit(params, family) with the alternative held, and the family of its line in the registry.
template <class Params, class Visit>
constexpr void with_params(Params&& any, Visit&& visit) {
    const auto one = [&]<std::size_t I>(std::integral_constant<std::size_t, I>) {
        if (any.index() == I) {
            visit(*std::get_if<I>(&any), typename std::tuple_element_t<I, Registry>::Type{});
        }
    };
    [&]<std::size_t... I>(std::index_sequence<I...>) {
        (one(std::integral_constant<std::size_t, I>{}), ...);
    }(std::make_index_sequence<controller_kinds.size()>{});
}

// Default parameters of a kind, one of controller_kinds.
inline ControllerParams params_of_kind(std::size_t kind) {
    ControllerParams params;
    [&]<std::size_t... I>(std::index_sequence<I...>) {
        ((kind == I ? static_cast<void>(params.template emplace<I>()) : static_cast<void>(0)), ...);
    }(std::make_index_sequence<controller_kinds.size()>{});
    return params;
}

// Calls visit.template operator()<Controller>() with the controller of these parameters.
template <Scalar T, class Visit>
void with_controller(const ControllerParams& any, Visit&& visit) {
    with_params(any, [&]<class Params, class Family>(const Params& p, Family) {
        detail::visit_chosen(Family::chosen(p), visit, typename Family::template Types<T>{});
    });
}

// The same, behind an observer if there is one.
template <Scalar T, class Visit>
void with_controller(const ControllerParams& any, bool observed, Visit&& visit) {
    with_controller<T>(any, [&]<class C>() {
        if (observed) {
            visit.template operator()<typename FromPositions<C>::Type>();
        } else {
            visit.template operator()<C>();
        }
    });
}

// The type for a line of the registry, and the one that the parameters choose from it.
template <Scalar T, std::size_t kind, std::size_t chosen>
using RegisteredController =
    typename detail::At<chosen, typename std::tuple_element_t<kind, Registry>::Type::template Types<T>>::Type;

// Room for `Capacity` exponentials, if the controller has any.
template <class C, std::size_t>
struct SizedController {
    using Type = C;
};
template <class C, std::size_t Capacity>
    requires requires { typename C::template Sized<Capacity>; }
struct SizedController<C, Capacity> {
    using Type = typename C::template Sized<Capacity>;
};

// The parameters, if they are of this type. Compiled once for each type, of which there are fewer than of controllers.
template <class Own>
const Own* own_params(const ControllerParams& any) {
    const Own* own = nullptr;
    with_params(any, [&]<class Params>(const Params& p, auto) {
        if constexpr (std::is_same_v<Params, Own>) {
            own = &p;
        }
    });
    return own;
}
// Coefficients of a controller from these parameters, if they are its own.
template <class C>
typename C::Coefficients prepare(const ControllerParams& any, const Common& common) {
    const typename C::Params* own = own_params<typename C::Params>(any);
    return own == nullptr ? typename C::Coefficients{} : C::prepare(*own, common);
}
// Coefficients of a controller from its own parameters; it need not be in the registry.
template <class C>
typename C::Coefficients prepare(const typename C::Params& params, const Common& common) {
    return C::prepare(params, common);
}

// Returns true if a controller has a fractional memory, whose exponentials are designed beforehand.
template <class Params>  // so that only a file that calls it compiles it
bool has_memory(const Params& any) {
    bool has = false;
    with_controller<double>(any, [&]<class C>() {
        if constexpr (requires { C::has_memory; }) {
            has = C::has_memory;
        }
    });
    return has;
}

// Exponentials among the parameters; nullptr if there are none.
template <class Params>
constexpr auto* kernel_of(Params&& any) {
    std::conditional_t<std::is_const_v<std::remove_reference_t<Params>>, const ExponentialSum*, ExponentialSum*>
        kernel = nullptr;
    with_params(any, [&](auto& p, auto) {
        if constexpr (requires { p.kernel(); }) {
            kernel = &p.kernel();
        }
    });
    return kernel;
}

}  // namespace fracgyro
