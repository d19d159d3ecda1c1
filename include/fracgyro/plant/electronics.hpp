// Amplifiers, feedthrough and timing of a device in volts, in SI; the noise of the position, and the position that a
// volt of the drive pretends.
//
//    n_q = sqrt((e_n C_Σ)² + (4 k_B T/R_f + i_n²)/ω_c²)/(V_b C′)        m/√Hz, one-sided
//
//    with ω_c that of the resonance, for a constant bias V_b, or of a carrier, whose rms amplitude is then V_b, and
//    C_Σ = C_s + C_p + C_f. A volt of the drive through C_ij puts a charge C_ij v on the amplifier, as does a
//    displacement of C_ij v/(V_b C′).
#pragma once

#include "fracgyro/plant/electrodes.hpp"
#include "fracgyro/plant/readout.hpp"

namespace fracgyro {

enum class AmplifierKind { ideal, charge, transimpedance };

struct ElectronicsParams {
    static constexpr double off = std::numeric_limits<double>::infinity();
    static constexpr double boltzmann = 1.380649e-23, temperature = 300.0;  // J/K, K

    AmplifierKind amplifier = AmplifierKind::ideal;
    double feedback_resistance = off, feedback_capacitance = 0.0, input_capacitance = 0.0;
    double voltage_noise = 0.0, current_noise = 0.0;
    Vec2<double> pole{off, off};
    double carrier_frequency = 0.0, carrier_voltage = 0.0, carrier_flicker = 0.0;
    std::array<double, 4> feedthrough{};
    double feedthrough_lag = 0.0;
    double sample_delay = 0.0, update_delay = 0.0, aperture = 0.0, jitter = 0.0;
    bool linearized = false;

    static constexpr std::string_view amplifiers[] = {"ideal", "charge", "transimpedance"},
                                      switches[] = {"false", "true"};
    static constexpr auto fields() {
        using P = ElectronicsParams;
        return Fields{
            choice("amplifier", &P::amplifier, amplifiers,
                   "charge: a charge amplifier, with noise, and a high-pass of 1/(R_f C_f); transimpedance: reads the "
                   "current and so the velocity, over the frequency of the resonance, up to pole. ideal: off."),
            field("feedback_resistance", &P::feedback_resistance, "ohm", limit, "> 0: R_f of the amplifier. inf: off."),
            field("feedback_capacitance", &P::feedback_capacitance, "F", at_least_0, "C_f of the amplifier."),
            field("input_capacitance", &P::input_capacitance, "F", at_least_0,
                  "what lies at its input, without pick-offs and C_f."),
            field("voltage_noise", &P::voltage_noise, "V/sqrt(Hz)", at_least_0, "e_n of the amplifier. 0.0: off."),
            field("current_noise", &P::current_noise, "A/sqrt(Hz)", at_least_0, "i_n of the amplifier. 0.0: off."),
            field("pole", &P::pole, "Hz", limit, "> 0, [x, y]: low-pass of the amplifier. inf: off."),
            field("carrier_frequency", &P::carrier_frequency, "Hz", at_least_0,
                  "of the carrier on the pick-offs. 0.0: off, a constant bias."),
            field("carrier_voltage", &P::carrier_voltage, "V", at_least_0, "rms amplitude of the carrier."),
            field(
                "carrier_flicker", &P::carrier_flicker, "1", at_least_0,
                "Flicker of the carrier's amplitude as a fraction, and so of the gain of all pick-offs: B of IEEE Std "
                "952, an Allan deviation of 0.664 B. 0.0: off."),
            field(
                "feedthrough", &P::feedthrough, "F", any_number,
                "[xx, xy, yx, yy]: capacitance to the pick-off of the first axis from the drive of the second. Zeros: "
                "off."),
            field("feedthrough_lag", &P::feedthrough_lag, "rad", Range{.low = 0.0, .high = 1.57},
                  "phase by which the feedthrough lags at the resonance of x, as it also leaks through resistances, at "
                  "most 1.57; needs a charge amplifier with R_f. 0.0: off, capacitances only."),
            field("sample_delay", &P::sample_delay, "s", at_least_0,
                  "time before a sample at which the position is taken; with aperture less than a step. 0.0: off."),
            field("update_delay", &P::update_delay, "s", at_least_0,
                  "time after a sample at which the force changes, less than a step. 0.0: off."),
            field("aperture", &P::aperture, "s", at_least_0, "time over which a sample is the mean. 0.0: off."),
            field("jitter", &P::jitter, "s", at_least_0, "standard deviation of the time of a sample. 0.0: off."),
            choice("linearized", &P::linearized, switches,
                   "true: the driver divides by what a pair of plates gains at the measured position. false: off."),
        };
    }
};

// Density of the position's noise, m/√Hz, of an amplifier whose pick-off gives V_b C′ in C/m and has C_s in F.
inline double position_noise_density(const ElectronicsParams& p, double charge_per_length, double pickoff_capacitance,
                                     double resonance) {
    const double omega = p.carrier_frequency > 0.0 ? 6.28318530717958647693 * p.carrier_frequency : resonance;
    const double voltage = p.voltage_noise * (pickoff_capacitance + p.input_capacitance + p.feedback_capacitance);
    const double resistor = 4.0 * ElectronicsParams::boltzmann * ElectronicsParams::temperature / p.feedback_resistance;
    const double current = (resistor + p.current_noise * p.current_noise) / (omega * omega);
    return square_root(voltage * voltage + current) / charge_per_length;
}

}  // namespace fracgyro
