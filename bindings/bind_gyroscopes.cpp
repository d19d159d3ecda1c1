#include "arrays.hpp"
#include "bindings.hpp"
#include "run_setup.hpp"

#include "fracgyro/control/reference.hpp"
#include "fracgyro/core/saved.hpp"

#include <nanobind/stl/vector.h>

#include <cmath>

namespace fracgyro::bindings {

namespace {

// One gyroscope, at the sample n.
class Tracked {
public:
    static constexpr std::size_t width = 13;

    explicit Tracked(const RunSetup& s)
        : owner_(s.owner),
          plant_(DevicePlant::prepare(s)),
          reference_(Reference<double>::prepare(s.common.reference, s.common.step)),
          course_(s.course),
          draw_(s),
          now_{.state = DevicePlant::start(s)} {
        sense();
    }

    // Advances under the force requested by a controller. A diverged motion stays unchanged.
    void step(const Vec2<double>& asked) {
        if (bounded(now_.state.motion)) {
            DevicePlant::act(now_.state, plant_, asked, now_.n);
            DevicePlant::step(now_.state, plant_, now_.n);
            ++now_.n;
            sense();
        }
    }
    // Writes the measurement and the reference, then the values known only to a simulator: the true error and rate.
    void write(double* row) const {
        const ReferencePoint<double>& point = now_.point;
        const Motion<double>& measured = now_.state.measured;
        const Vec2<double> error = now_.state.motion.position - point.position;
        const std::array<Vec2<double>, 6> vectors{measured.position,  point.position,    point.velocity,
                                                  point.acceleration, measured.velocity, error};
        for (const Vec2<double>& vector : vectors) {
            *row++ = vector.x();
            *row++ = vector.y();
        }
        *row = plant_.rate.at(now_.n);
    }

    // Everything that changes during the motion.
    struct Now {
        DevicePlant::State state{};
        Reference<double>::State turning{};
        ReferencePoint<double> point{};
        std::int64_t n = 0;
    };
    const Now& now() const { return now_; }
    void restore(const Now& saved) { now_ = saved; }

private:
    void sense() {
        DevicePlant::sense(now_.state, plant_, draw_(now_.n));
        now_.point = Reference<double>::update(now_.turning, reference_);
    }

    std::shared_ptr<AnyPlant> owner_;
    DevicePlant::Coefficients plant_;
    Reference<double>::Coefficients reference_;
    Shared<CourseWithLists> course_;  // to which they point
    DeviceGyroscope::Draw draw_;
    Now now_;
};

// Gyroscopes stepped together, one after another: the environments of a learner.
class Gyroscopes {
public:
    explicit Gyroscopes(const std::vector<RunSetup>& setups) {
        for (const RunSetup& s : setups) {
            all_.emplace_back(s);
        }
    }

    nb::ndarray<nb::numpy, double> rows() const {
        std::unique_ptr<double[]> made(new double[all_.size() * Tracked::width]);
        for (std::size_t i = 0; i < all_.size(); ++i) {
            all_[i].write(made.get() + i * Tracked::width);
        }
        return owned<double, 2>(std::move(made), {all_.size(), Tracked::width});
    }
    // Rows after a step. An action has `acted` numbers for each gyroscope; the first two are the force, in units of
    // `limit`, clipped to -1 and 1.
    nb::ndarray<nb::numpy, double> step(const nb::ndarray<const double, nb::c_contig, nb::device::cpu>& actions,
                                        std::size_t acted, double limit) {
        if (actions.size() != acted * all_.size()) {
            throw nb::value_error("action has another size than the action space");
        }
        if (!std::all_of(actions.data(), actions.data() + actions.size(), [](double a) { return std::isfinite(a); })) {
            throw nb::value_error("action is not finite: it must hold numbers from -1 to 1");
        }
        const auto force = [&](double action) { return limit * std::min(std::max(action, -1.0), 1.0); };
        const double* action = actions.data();
        for (Tracked& one : all_) {
            one.step({force(action[0]), force(action[1])});
            action += acted;
        }
        return rows();
    }
    void restart(std::size_t place, const RunSetup& s) { all_.at(place) = Tracked(s); }

    nb::bytes state() const {
        std::vector<unsigned char> bytes(all_.size() * Kept::size);
        for (std::size_t i = 0; i < all_.size(); ++i) {
            Kept::write(all_[i].now(), bytes.data() + i * Kept::size);
        }
        return nb::bytes(bytes.data(), bytes.size());
    }
    void restore(const nb::bytes& saved) {
        const auto* const bytes = static_cast<const unsigned char*>(saved.data());
        std::vector<Tracked::Now> read(all_.size());
        bool sound = saved.size() == all_.size() * Kept::size;
        for (std::size_t i = 0; sound && i < all_.size(); ++i) {
            sound = Kept::read(bytes + i * Kept::size, Kept::size, read[i]) && read[i].n >= 0;
        }
        if (!sound) {
            throw nb::value_error("state is damaged: it is not as it was saved");
        }
        for (std::size_t i = 0; i < all_.size(); ++i) {
            all_[i].restore(read[i]);
        }
    }

private:
    using Kept = Saved<Tracked::Now>;

    std::vector<Tracked> all_;
};

}  // namespace

void bind_gyroscopes(nb::module_& m) {
    nb::class_<Gyroscopes>(m, "Gyroscopes")
        .def(nb::init<const std::vector<RunSetup>&>(), nb::arg("setups"))
        .def("rows", &Gyroscopes::rows)
        .def("step", &Gyroscopes::step, nb::arg("actions"), nb::arg("acted"), nb::arg("limit"))
        .def("restart", &Gyroscopes::restart, nb::arg("place"), nb::arg("setup"))
        .def_prop_rw("state", &Gyroscopes::state, &Gyroscopes::restore);
}

}  // namespace fracgyro::bindings
