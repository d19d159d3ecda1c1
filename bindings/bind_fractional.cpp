#include "arrays.hpp"
#include "bindings.hpp"

#include "fracgyro/core/kernel_design.hpp"
#include "fracgyro/core/sampled.hpp"
#include "fracgyro/sim/cpu_dispatch.hpp"

#include <nanobind/stl/vector.h>

#include <vector>

namespace fracgyro::bindings {

namespace {

template <class T>
using Input = nb::ndarray<const T, nb::ndim<2>, nb::c_contig, nb::device::cpu>;

// values, rates, integral, derivative: (samples, channels).
template <class T>
inline void operate(const ExponentialSum& kernel, double step, std::size_t samples, std::size_t channels,
                    const T* values, const T* rates, T* integral, T* derivative) {
    using Operator = Fractional<T>;
    const auto coefficients = Operator::prepare(kernel, step, false);
    // The operator carries two channels at a time, as the controller's two axes.
    for (std::size_t first = 0; first < channels; first += 2) {
        const std::size_t second = first + 1 < channels ? first + 1 : first;
        typename Operator::State state{};
        for (std::size_t n = 0; n < samples; ++n) {
            const std::size_t a = n * channels + first;
            const std::size_t b = n * channels + second;
            const auto result = Operator::update(state, coefficients,
                                                 {.value = {values[a], values[b]}, .derivative = {rates[a], rates[b]}});
            integral[a] = result.integral.x();
            integral[b] = result.integral.y();
            derivative[a] = result.derivative.x();
            derivative[b] = result.derivative.y();
        }
    }
}

FRACGYRO_FOR_EACH_PROCESSOR
void operate_double(const ExponentialSum& kernel, double step, std::size_t samples, std::size_t channels,
                    const double* values, const double* rates, double* integral, double* derivative) {
    operate<double>(kernel, step, samples, channels, values, rates, integral, derivative);
}

FRACGYRO_FOR_EACH_PROCESSOR
void operate_single(const ExponentialSum& kernel, double step, std::size_t samples, std::size_t channels,
                    const float* values, const float* rates, float* integral, float* derivative) {
    operate<float>(kernel, step, samples, channels, values, rates, integral, derivative);
}

// values, rates: (samples, channels). Returns (2, samples, channels): integral, derivative.
template <class T>
nb::ndarray<nb::numpy, T> apply_operator(const Input<T>& values, const Input<T>& rates, const ExponentialSum& kernel,
                                         double step) {
    const std::size_t samples = values.shape(0);
    const std::size_t channels = values.shape(1);
    auto out = std::make_unique<T[]>(2 * samples * channels);
    T* derivative = out.get() + samples * channels;
    {
        nb::gil_scoped_release unlocked;
        if constexpr (std::is_same_v<T, float>) {
            operate_single(kernel, step, samples, channels, values.data(), rates.data(), out.get(), derivative);
        } else {
            operate_double(kernel, step, samples, channels, values.data(), rates.data(), out.get(), derivative);
        }
    }
    return owned<T, 3>(std::move(out), {2, samples, channels});
}

using Doubles = nb::ndarray<const double, nb::ndim<1>, nb::c_contig, nb::device::cpu>;

// Rates, weights and certified error of a design; no rates if it failed.
nb::tuple design_kernel(double order, double shortest, double longest, double tolerance) {
    const auto found = std::make_unique<KernelDesign>();
    found->design(order, shortest, longest, tolerance);
    const auto copied = [&](const auto& all) {
        auto some = std::make_unique<double[]>(found->count);
        std::copy_n(all.begin(), found->count, some.get());
        return owned<double, 1>(std::move(some), {found->count});
    };
    return nb::make_tuple(copied(found->poles), copied(found->weights), found->error);
}

// t^(-order)/Γ(1-order), 0 < order < 1.
nb::ndarray<nb::numpy, double> kernel(const Doubles& times, double order) {
    auto values = std::make_unique<double[]>(times.shape(0));
    for (std::size_t i = 0; i < times.shape(0); ++i) {
        values[i] = (1.0 - order) / (gamma_from_one_to_two(2.0 - order) * power(times.data()[i], order));
    }
    return owned<double, 1>(std::move(values), {times.shape(0)});
}

using Terms = nb::ndarray<const double, nb::shape<-1, 2>, nb::c_contig, nb::device::cpu>;

using Gains4 = std::array<double, 4>;  // weights of this sample, the last, the change, the last change

// Terms as rows of decay and weight, then the gains.
nb::tuple sampled(const Doubles& poles, const Doubles& weights, double order, double shortest, double step,
                  bool derivative, bool parabolas) {
    const std::size_t count = poles.shape(0);
    if (weights.shape(0) != count) {
        throw nb::value_error("poles and weights must be equally many");
    }
    std::vector<SampledTerm> terms(count);
    const SampledGains gains = sampled_operator({poles.data(), count}, weights.data(), order, shortest, step,
                                                {.derivative = derivative, .parabolas = parabolas}, terms.data());
    auto rows = std::make_unique<double[]>(2 * count);
    for (std::size_t j = 0; j < count; ++j) {
        rows[2 * j] = terms[j].decay;
        rows[2 * j + 1] = terms[j].weight;
    }
    return nb::make_tuple(owned<double, 2>(std::move(rows), {count, 2}),
                          Gains4{gains.now, gains.past, gains.change, gains.past_change});
}

template <class Number, class Gains, class Term, class Past>
class Recursion {
public:
    Recursion(const Terms& of_values, const Terms& of_changes, const Gains4& gains)
        : gains_{.of_values = static_cast<int>(of_values.shape(0)),
                 .of_changes = static_cast<int>(of_changes.shape(0)),
                 .now = static_cast<Number>(gains[0]),
                 .past = static_cast<Number>(gains[1]),
                 .change = static_cast<Number>(gains[2]),
                 .past_change = static_cast<Number>(gains[3]),
                 .trace = static_cast<Number>(detail::vanishing<Number>)} {
        for (const Terms* const some : {&of_values, &of_changes}) {
            for (std::size_t j = 0; j < some->shape(0); ++j) {
                const double* const row = some->data() + 2 * j;
                terms_.push_back({.decay = static_cast<Number>(row[0]), .weight = static_cast<Number>(row[1])});
            }
        }
        reset();
    }
    void reset() {
        memory_.assign(terms_.size(), Number{});
        past_ = Past{};
    }
    Number step(Number sample) { return fracgyro_step_sample(&gains_, terms_.data(), memory_.data(), &past_, sample); }
    nb::ndarray<nb::numpy, Number> run(const nb::ndarray<const Number, nb::ndim<1>, nb::device::cpu>& samples) {
        auto found = std::make_unique<Number[]>(samples.shape(0));
        for (std::size_t n = 0; n < samples.shape(0); ++n) {
            found[n] = step(samples(n));
        }
        return owned<Number, 1>(std::move(found), {samples.shape(0)});
    }
    // The memory, then the last sample and the last change.
    std::vector<Number> state() const {
        std::vector<Number> all = memory_;
        all.push_back(past_.sample);
        all.push_back(past_.change);
        return all;
    }
    void restore(const std::vector<Number>& saved) {
        if (saved.size() != memory_.size() + 2) {
            throw nb::value_error("state is damaged: it is not as it was saved");
        }
        std::copy_n(saved.begin(), memory_.size(), memory_.begin());
        past_ = Past{saved[memory_.size()], saved[memory_.size() + 1]};
    }

private:
    Gains gains_;
    std::vector<Term> terms_;
    std::vector<Number> memory_;
    Past past_{};
};

template <class R>
void bind_recursion(nb::module_& m, const char* name) {
    nb::class_<R>(m, name, "A sum of first-order recursions: sampled_step.h.")
        .def(nb::init<const Terms&, const Terms&, const Gains4&>(), nb::arg("of_values"), nb::arg("of_changes"),
             nb::arg("gains"))
        .def("reset", &R::reset)
        .def("step", &R::step, nb::arg("sample"))
        .def("run", &R::run, nb::arg("samples"))
        .def_prop_rw("state", &R::state, &R::restore);
}

}  // namespace

void bind_fractional(nb::module_& m) {
    nb::class_<ExponentialSum>(m, "ExponentialSum", "Exponentials of the kernel t^(-order)/Gamma(1-order).")
        .def(
            "__init__",
            [](ExponentialSum* self, double order, double gamma, const Doubles& poles, const Doubles& weights,
               double error) {
                if (poles.shape(0) != weights.shape(0) || poles.shape(0) > ExponentialSum::capacity) {
                    throw nb::value_error("poles and weights must be equally many, at most 64");
                }
                new (self) ExponentialSum{.count = poles.shape(0), .order = order, .gamma = gamma, .error = error};
                std::copy_n(poles.data(), poles.shape(0), self->poles.begin());
                std::copy_n(weights.data(), weights.shape(0), self->weights.begin());
            },
            nb::arg("order"), nb::arg("gamma"), nb::arg("poles"), nb::arg("weights"), nb::arg("error") = 0.0)
        .def_ro("count", &ExponentialSum::count)
        .def_ro("order", &ExponentialSum::order);
    m.attr("kernel_capacity") = ExponentialSum::capacity;
    m.attr("earliest") = KernelDesign::earliest;
    m.attr("latest") = KernelDesign::latest;
    m.attr("largest_ratio") = KernelDesign::largest_ratio;
    m.attr("smallest_tolerance") = KernelDesign::smallest_tolerance;
    m.attr("largest_tolerance") = KernelDesign::largest_tolerance;
    m.def("design_kernel", &design_kernel, nb::arg("order"), nb::arg("shortest"), nb::arg("longest"),
          nb::arg("tolerance"));
    m.def(
        "designed_kernel",
        [](double order, double step, double duration, double tolerance) {
            return designed_kernel(*std::make_unique<KernelDesign>(), order, step, duration, tolerance);
        },
        nb::arg("order"), nb::arg("step"), nb::arg("duration"), nb::arg("tolerance"));
    m.def("kernel", &kernel, nb::arg("times"), nb::arg("order"));
    m.def("apply_operator", &apply_operator<double>, nb::arg("values"), nb::arg("rates"), nb::arg("kernel"),
          nb::arg("step"));
    m.def("apply_operator_single", &apply_operator<float>, nb::arg("values"), nb::arg("rates"), nb::arg("kernel"),
          nb::arg("step"));
    m.def("sampled_operator", &sampled, nb::arg("poles"), nb::arg("weights"), nb::arg("order"), nb::arg("shortest"),
          nb::arg("step"), nb::arg("derivative"), nb::arg("parabolas"));
    bind_recursion<Recursion<double, in_double::fracgyro_gains, in_double::fracgyro_term, in_double::fracgyro_past>>(
        m, "Recursion");
    bind_recursion<Recursion<float, in_single::fracgyro_gains, in_single::fracgyro_term, in_single::fracgyro_past>>(
        m, "RecursionSingle");
    m.attr("trace") = detail::vanishing<double>;
    m.attr("trace_single") = detail::vanishing<float>;
    m.def("power", &power<double>, nb::arg("base"), nb::arg("exponent"), "base^exponent by the core's own log2/exp2.");
}

}  // namespace fracgyro::bindings
