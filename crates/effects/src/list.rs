//! The one list of effects.

/// Calls `$then!` with a line an effect: its module, its type (also its [`crate::EffectId`]), its name.
macro_rules! every_effect {
    ($then:ident) => {
        $then! {
            delay::Delay = "delay",
            first_order_lag::FirstOrderLag = "first-order-lag",
            slew_limit::SlewLimit = "slew-limit",
            saturation::Saturation = "saturation",
            rate_dependence::RateDependence = "rate-dependence",
            asymmetry::Asymmetry = "asymmetry",
            amplitude_gain::AmplitudeGain = "amplitude-gain",
            hysteresis_shape::HysteresisShape = "hysteresis-shape",
            creep::Creep = "creep",
            resonance::Resonance = "resonance",
            cross_coupling::CrossCoupling = "cross-coupling",
            thermal_drift::ThermalDrift = "thermal-drift",
            mains_hum::MainsHum = "mains-hum",
            backlash::Backlash = "backlash",
            sensor_nonlinearity::SensorNonlinearity = "sensor-nonlinearity",
            nonlinear_stiffness::NonlinearStiffness = "nonlinear-stiffness",
            friction::Friction = "friction",
            mode_hysteresis::ModeHysteresis = "mode-hysteresis",
        }
    };
}
