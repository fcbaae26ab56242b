//! The settings of a controller as the command line takes them; the workbench has the same names beside its fields.

use hysteron_control::message::Setting;

/// The option that gives a setting.
pub fn option(setting: Setting) -> &'static str {
    match setting {
        Setting::TopV => "--top-v",
        Setting::RateHz => "--rate-hz",
        Setting::LatencyUs => "--latency-us",
        Setting::SensorBandwidthHz => "--sensor-bandwidth-hz",
        Setting::Seed => "--seed",
        Setting::RestS => "--rest-s",
        Setting::ShortRests => "--short-rests",
        Setting::Overwrite => "--overwrite",
        Setting::Plan => "--plan",
        Setting::Planning => "`hysteron campaign --top-v V --rate-hz HZ -o FOLDER`",
        Setting::TurnedPosition => "--column position=NAME:um*-1",
        Setting::BeyondRecords => "--beyond-records",
        Setting::Volts => "--volts LOW,HIGH",
        Setting::Range => "--range LOW,HIGH",
        Setting::Reference => "another reference",
        Setting::Margin => "--margin",
        Setting::RigidHz => "--rigid",
        Setting::AdaptPercent => "--adapt",
        Setting::Live => "--reference live",
        Setting::Previewed => "--reference previewed",
        Setting::Amplifier => "--amplifier LOW,HIGH",
        Setting::Dac => "--dac LOW,HIGH",
        Setting::Adc => "--adc LOW,HIGH",
        Setting::Inputs => "--input-min and --input-max",
        Setting::TableRate => "--rate",
        Setting::Stage => "--stage",
        Setting::FeedbackBoundUm => "--feedback-bound-um",
        Setting::Timeout => "--timeout",
    }
}
