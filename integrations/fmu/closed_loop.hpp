// The loop that an FMU steps: with an ideal device in any precision, with any other in double.
#pragma once

#include "exported.hpp"
#include "without_exceptions.hpp"

#include "fracgyro/sim/settings.hpp"

namespace fracgyro {

template <Controller C>
struct IdealLoop : Stepper<C> {
    using RunSetup = SetupOf<typename C::Params>;
    using Draw = Disturbance;
    static constexpr std::size_t width = row_width<typename C::Report>;

    static void take_device(RunSetup&, const double*) {}
    static Draw draw(const RunSetup& setup) { return {setup.disturbance, setup.common.step}; }
    static void write(const typename Stepper<C>::State& state, const typename Stepper<C>::Coefficients&, double* row) {
        write_row(state.snapshot(), row);
    }
};

template <Controller C>
struct DeviceLoop : Stepper<C, DeviceGyroscope> {
    using RunSetup = DeviceSetupOf<typename C::Params>;
    using Draw = DeviceGyroscope::Draw;
    using Loop = Stepper<C, DeviceGyroscope>;
    static constexpr std::size_t device_columns = device_width + (exported::has_electrodes ? volts_width : 0);
    static constexpr std::size_t width = row_width<typename C::Report> + device_columns;

    static void take_device(RunSetup& setup, const double* numbers) {
        const auto list = [](const auto& values) { return std::vector<double>(values.begin(), values.end()); };
        take_device_settings(setup, numbers);
        setup.rate.table = {list(exported::rate_times), list(exported::rate_values)};
        setup.device.temperature = {list(exported::temperature_times), list(exported::temperature_values)};
        take_transverse(setup.rate, exported::transverse);
        if constexpr (!exported::volts.empty()) {
            take_volts(setup, exported::volts);
        }
    }
    static Draw draw(const RunSetup& setup) { return Draw(setup); }
    static void write(const typename Loop::State& state, const typename Loop::Coefficients& c, double* row) {
        const auto at = DeviceGyroscope::snapshot(state, c.gyroscope, state.signals);
        write_device_row(at, row);
        if constexpr (exported::has_electrodes) {
            const auto volts = volts_row(at.volts);
            std::copy(volts.begin(), volts.end(), row + (width - volts_width));
        }
    }
};

}  // namespace fracgyro
