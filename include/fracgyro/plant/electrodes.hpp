// Electrodes: from voltages to forces. Everything follows from the capacitance C(q): the force at a voltage V is
// ½ V² ∂C/∂q, with ε of the vacuum and a fringe factor f. n is the electrode's direction, n⊥ across it, g the gap,
// X = n·q/g, Y = n⊥·q/g:
//
//    plate     C = f ε a/(g (1 - X)); of a pair, one on each side, at V ± v
//    comb      C = f N ε t (l + g X)/g (1/(1 - Y) + 1/(1 + Y)); of a pair, one on each side, at V ± v
//    skewed    the same with gaps g and λ g: 1/(1 - Y) + 1/(λ + Y); for quadrature four groups, mirrored at both axes,
//              at V ± v, whose static forces cancel
//
// The part that is linear about the mass at rest is kept apart, for the exact step: the softening, which belongs to K,
// and the gain in force per volt. `Electrode::force` is the whole force: sums, products and one or two divisions, so
// that it has the same bits everywhere.
#pragma once

#include "fracgyro/core/fields.hpp"
#include "fracgyro/core/phase.hpp"

#include <algorithm>
#include <vector>

namespace fracgyro {

enum class ElectrodeRole { force, tuning, quadrature, pickoff };
enum class ElectrodeKind { plate, comb, skewed };

// In SI.
struct ElectrodeParams {
    ElectrodeRole role = ElectrodeRole::force;
    ElectrodeKind kind = ElectrodeKind::plate;
    bool pair = true;
    double angle = 0.0;
    double count = 1.0, gap = 2e-6, area = 1e-9;           // a of one plate
    double overlap = 10e-6, thickness = 20e-6, ratio = 2;  // l, t, λ of a comb
    double fringe = 1.0, offset = 0.0;
    double bias = 0.0, nulling = 0.0;  // V, and v of the four groups
    double range = std::numeric_limits<double>::infinity();
    int bits = 0;
    double noise = 0.0;

    static constexpr std::string_view roles[] = {"force", "tuning", "quadrature", "pickoff"},
                                      kinds[] = {"plate", "comb", "skewed"}, switches[] = {"false", "true"};
    static constexpr auto fields() {
        using P = ElectrodeParams;
        constexpr Range whole{.low = 1.0, .high = 1e6, .whole = true}, least_1{.low = 1.0};
        constexpr Range bits{.low = 0.0, .high = 32.0, .whole = true}, above_1{.low = 1.0, .strict = true};
        return Fields{
            choice(
                "role", &P::role, roles,
                "force: its voltage is bias plus that of the driver; tuning: bias; quadrature: four groups of skewed "
                "combs at bias plus and minus nulling; pickoff: bias, or the carrier of [electronics], and its "
                "capacitance is what is measured."),
            choice("kind", &P::kind, kinds,
                   "plate: a gap that closes; comb: fingers that slide along their gaps; skewed: fingers with the gaps "
                   "gap and ratio times gap on their two sides."),
            choice("pair", &P::pair, switches,
                   "true: one on each side of the mass, at bias plus and minus the driver's voltage. false: one."),
            field("angle", &P::angle, "rad", any_number, "direction of the electrode, from x towards y."),
            field("count", &P::count, "1", whole, "Plates or fingers on each side."),
            field("gap", &P::gap, "m", above_0, "> 0: nominal gap at rest; of skewed combs the smaller one."),
            field("area", &P::area, "m^2", above_0, "of one plate. Combs: without effect."),
            field("overlap", &P::overlap, "m", at_least_0, "length over which fingers overlap at rest. Plates: none."),
            field("thickness", &P::thickness, "m", above_0, "of the fingers. Plates: without effect."),
            field("ratio", &P::ratio, "1", above_1, "Larger over smaller gap of skewed combs, > 1. Others: no effect."),
            field("fringe", &P::fringe, "1", least_1,
                  "Factor of the capacitance by fringing fields; no controller knows it. 1.0: off."),
            field("offset", &P::offset, "m", any_number,
                  "displacement towards the electrode that a mass at rest already has, smaller than the gap; no "
                  "controller knows it. 0.0: off."),
            field("bias", &P::bias, "V", any_number, "constant voltage."),
            field("nulling", &P::nulling, "V", any_number, "constant voltage v of role quadrature. 0.0: off."),
            field("range", &P::range, "V", limit,
                  "> 0: largest voltage of the driver of role force, and of those that [trim] sets. inf: off."),
            field("bits", &P::bits, "1", bits,
                  "Role force: bits of its converter, over plus and minus the range. 0: off."),
            field("noise", &P::noise, "V/sqrt(Hz)", at_least_0,
                  "Role force: one-sided density of white noise of its driver, drawn every step. 0.0: off."),
        };
    }
};

// Voltages that change in a run: those of the drivers of x and y, and those that a trim sets, with its share s.
struct Voltages {
    Vec2<double> drive{};
    double tuning = 0.0, nulling = 0.0, share = 0.0;
};

// Units of force and length, in N and m, for nondimensional numbers; voltages stay in V.
struct ElectrodeScales {
    double force = 1.0, length = 1.0;
};

class Electrode {
public:
    static constexpr double permittivity = 8.8541878128e-12;  // F/m

    // `nominal`: as designers and controllers know it, without fringing fields and offset.
    Electrode(const ElectrodeParams& p, const ElectrodeScales& scales, bool nominal)
        : shape_(p.role == ElectrodeRole::quadrature ? Shape::groups
                 : p.kind == ElectrodeKind::plate    ? (p.pair ? Shape::plates : Shape::plate)
                                                     : (p.pair ? Shape::combs : Shape::comb)),
          along_(exactly(turn_of<double>(p.angle))),
          per_length_(scales.length / p.gap),
          ratio_(p.kind == ElectrodeKind::skewed || shape_ == Shape::groups ? p.ratio : 1.0),
          overlap_(p.overlap / p.gap),
          offset_(nominal ? 0.0 : p.offset / p.gap),
          bias_(p.bias),
          nulling_(shape_ == Shape::groups ? p.nulling : 0.0),
          role_(p.role),
          moves_(p.role == ElectrodeRole::force) {
        const double factor = (nominal ? 1.0 : p.fringe) * permittivity * p.count;
        const bool plates = shape_ == Shape::plate || shape_ == Shape::plates;
        per_gap_ = plates ? factor * p.area / p.gap : factor * p.thickness;
        strength_ = 0.5 * per_gap_ / p.gap / scales.force;
    }

    const Vec2<double>& direction() const { return along_; }
    double per_length() const { return per_length_; }
    double bias() const { return bias_; }
    void set_bias(double volts) { bias_ = volts; }
    // From here on a trim sets the bias of role tuning and the nulling of role quadrature.
    void follow_trim() { moves_ = true; }

    // X and Y.
    Vec2<double> place(const Vec2<double>& q) const {
        return {per_length_ * dot(along_, q) + offset_, per_length_ * cross(along_, q)};
    }
    // True if the mass touches it there.
    bool touches(const Vec2<double>& q) const {
        const Vec2<double> at = place(q);
        switch (shape_) {
            case Shape::plate:
                return !(at.x() < 1.0);
            case Shape::plates:
                return !(absolute(at.x()) < 1.0);
            case Shape::groups:
                return !(absolute(at.y()) < 1.0);
            default:
                return !(at.y() < 1.0 && -at.y() < ratio_);
        }
    }

    // The force at q.
    Vec2<double> force(const Vec2<double>& q, const Voltages& volts) const {
        const Vec2<double> at = place(q);
        const double x = at.x(), y = at.y(), s = strength_, b = bias_at(volts), v = added_at(volts);
        const double lambda = ratio_, sum = 1.0 + lambda;
        switch (shape_) {
            case Shape::plate: {
                const double root = (b + v) / (1.0 - x);
                return (s * (root * root)) * along_;
            }
            case Shape::plates: {
                const double d = 1.0 / (1.0 - x * x);
                return (4.0 * s * ((b * b + v * v) * x + b * v * (1.0 + x * x)) * (d * d)) * along_;
            }
            case Shape::comb: {
                const double d = 1.0 / ((1.0 - y) * (lambda + y)), square = s * ((b + v) * (b + v)) * sum * d;
                return square * along_ + (square * (overlap_ + x) * (lambda - 1.0 + 2.0 * y) * d) * turned(along_);
            }
            case Shape::combs: {
                const double d = 1.0 / ((1.0 - y) * (lambda + y)), most = 2.0 * s * sum * d;
                return (2.0 * most * b * v) * along_ +
                       (most * ((b * b + v * v) * overlap_ + 2.0 * b * v * x) * (lambda - 1.0 + 2.0 * y) * d) *
                           turned(along_);
            }
            default: {
                const double one = 1.0 / ((1.0 - y) * (lambda + y)), other = 1.0 / ((1.0 + y) * (lambda - y));
                const double near = (lambda - 1.0 + 2.0 * y) * (one * one);
                const double far = (lambda - 1.0 - 2.0 * y) * (other * other);
                return (4.0 * s * sum * b * v * (one - other)) * along_ +
                       (2.0 * s * sum * ((b * b + v * v) * overlap_ * (near - far) + 2.0 * b * v * x * (near + far))) *
                           turned(along_);
            }
        }
    }

    // k_e: the gradient of the force at q = 0 without a driver's voltage, which softens the springs.
    Sym2<double> softening(const Voltages& volts = {}) const {
        const double b = bias_at(volts), v = added_at(volts), s = strength_ * per_length_, x = offset_, lambda = ratio_;
        const double sum = 1.0 + lambda, across = 2.0 * (1.0 + 1.0 / (lambda * lambda * lambda));
        const double mixed = sum * (lambda - 1.0) / (lambda * lambda);
        switch (shape_) {
            case Shape::plate:
                return turned_back(2.0 * s * b * b / cube(1.0 - x), 0.0, 0.0);
            case Shape::plates:
                return turned_back(2.0 * s * b * b * (1.0 / cube(1.0 - x) + 1.0 / cube(1.0 + x)), 0.0, 0.0);
            case Shape::comb:
                return turned_back(0.0, s * b * b * mixed, s * b * b * (overlap_ + x) * across);
            case Shape::combs:
                return turned_back(0.0, 0.0, 2.0 * s * b * b * overlap_ * across);
            default:
                return turned_back(0.0, 8.0 * s * b * v * mixed, 4.0 * s * (b * b + v * v) * overlap_ * across);
        }
    }
    // Force per volt of the driver at q = 0: along the electrode, and across, of skewed combs only.
    double gain() const {
        const double s = strength_, b = bias_, x = offset_, d = 1.0 / (1.0 - x * x);
        switch (shape_) {
            case Shape::plate:
                return 2.0 * s * b / ((1.0 - x) * (1.0 - x));
            case Shape::plates:
                return 4.0 * s * b * (1.0 + x * x) * (d * d);
            case Shape::comb:
                return 2.0 * s * b * (1.0 + ratio_) / ratio_;
            case Shape::combs:
                return 4.0 * s * b * (1.0 + ratio_) / ratio_;
            default:
                return 0.0;
        }
    }

    // dC/d(n·q) at rest, in F/m; of a pair that of the difference.
    double slope(double gap) const {
        switch (shape_) {
            case Shape::plate:
                return per_gap_ / gap;
            case Shape::plates:
                return 2.0 * per_gap_ / gap;
            case Shape::comb:
                return per_gap_ / gap * (1.0 + ratio_) / ratio_;
            default:
                return 2.0 * per_gap_ / gap * (1.0 + ratio_) / ratio_;
        }
    }
    // Capacitance at rest, in F, of all its parts.
    double capacitance() const {
        switch (shape_) {
            case Shape::plate:
                return per_gap_;
            case Shape::plates:
                return 2.0 * per_gap_;
            case Shape::comb:
                return per_gap_ * overlap_ * (1.0 + ratio_) / ratio_;
            default:
                return 2.0 * per_gap_ * overlap_ * (1.0 + ratio_) / ratio_;
        }
    }
    // Reading of a pick-off at q, in units of length: the change of C, or of the difference of a pair, over its slope.
    double reading(const Vec2<double>& q) const {
        const Vec2<double> at = place(q);
        const double x = at.x(), y = at.y(), from = offset_, lambda = ratio_;
        switch (shape_) {
            case Shape::plate:
                return (1.0 / (1.0 - x) - 1.0 / (1.0 - from)) / per_length_;
            case Shape::plates:
                return (x / (1.0 - x * x) - from / (1.0 - from * from)) / per_length_;
            case Shape::comb:
                return (lambda * (overlap_ + x) / ((1.0 - y) * (lambda + y)) - (overlap_ + from)) / per_length_;
            default:
                return (lambda * x / ((1.0 - y) * (lambda + y)) - from) / per_length_;
        }
    }

private:
    enum class Shape { plate, plates, comb, combs, groups };

    double bias_at(const Voltages& volts) const {
        return moves_ && role_ == ElectrodeRole::tuning ? volts.tuning : bias_;
    }
    // On one side of a pair more than the bias, on the other less.
    double added_at(const Voltages& volts) const {
        if (!moves_ || role_ == ElectrodeRole::tuning) {
            return nulling_;
        }
        return role_ == ElectrodeRole::force ? dot(along_, volts.drive) : volts.nulling;
    }

    // Electrodes on the axes are exactly there.
    static Vec2<double> exactly(const Vec2<double>& n) {
        constexpr double rounding = 1e-15;
        const auto one = [](double a) { return absolute(a) < rounding ? 0.0 : a; };
        const auto full = [](double a) { return absolute(a) > 1.0 - rounding ? with_sign_of(a, 1.0) : a; };
        return {full(one(n.x())), full(one(n.y()))};
    }
    static double cube(double a) { return a * a * a; }
    // From the electrode's axes to x and y.
    Sym2<double> turned_back(double along, double mixed, double across) const {
        const double c = along_.x(), s = along_.y();
        return {c * c * along - 2.0 * c * s * mixed + s * s * across,
                c * s * (along - across) + (c * c - s * s) * mixed,
                s * s * along + 2.0 * c * s * mixed + c * c * across};
    }

    Shape shape_;
    Vec2<double> along_;
    double per_length_, ratio_, overlap_, offset_, bias_, nulling_;
    ElectrodeRole role_;
    bool moves_;             // the voltages of this role change in a run
    double strength_ = 0.0;  // force at X = Y = 0 and 1 V: ½ f ε a/g² of a plate, ½ f N ε t/g of a comb
    double per_gap_ = 0.0;   // f ε a/g of a plate, f N ε t of a comb, F
};

// Factor for the bias at which a plate, or a pair of plates, pulls in on an undriven spring of stiffness k: V² is this
// times k g³/(f ε a). For a step of the voltage it is 27/32 of that, for a single plate without damping.
inline double pull_in_voltage(const ElectrodeParams& p, double stiffness) {
    const double scale = stiffness * p.gap * p.gap * p.gap / (p.fringe * Electrode::permittivity * p.count * p.area);
    return square_root(p.pair ? scale / 2.0 : 8.0 * scale / 27.0);
}

}  // namespace fracgyro
