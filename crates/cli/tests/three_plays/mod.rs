//! A model as `fit` and `add` write it: the smallest that a controller is designed from.

/// A parameter of an effect: name, value, unit.
pub(crate) type Named = (&'static str, f64, &'static str);

/// A model as `fit` and `add` write it: three plays, one effect.
pub(crate) fn model(weights: [f64; 3], effect: &str, parameters: &[Named]) -> String {
    let mut text =
        "format = 1\nhysteron = \"0.1.0\"\ndirection = \"forward\"\ninput_unit = \"V\"\noutput_unit = \"um\"\n\
        [hysteresis]\nfamily = \"pi\"\ninput_min = 0.0\ninput_max = 100.0\nthresholds = [4.0, 15.0, 40.0]\n"
            .to_owned();
    let mut parameter = |table: &str, name: &str, value: f64, unit: &str| {
        text.push_str(&format!(
            "[[{table}]]\nname = \"{name}\"\nvalue = {value:?}\nunit = \"{unit}\"\n"
        ));
    };
    parameter("hysteresis.parameter", "offset", 0.0, "um");
    parameter("hysteresis.parameter", "linear", 0.06, "um/V");
    for (i, weight) in weights.into_iter().enumerate() {
        parameter("hysteresis.parameter", &format!("weight[{}]", i + 1), weight, "um/V");
    }
    if !effect.is_empty() {
        text.push_str(&format!("[[effect]]\nname = \"{effect}\"\n"));
        for (name, value, unit) in parameters {
            text.push_str(&format!(
                "[[effect.parameter]]\nname = \"{name}\"\nvalue = {value:?}\nunit = \"{unit}\"\n"
            ));
        }
    }
    text.push_str(
        "[fitted_on]\ndataset = \"stage\"\nmethod = \"separable\"\nweighting = \"record\"\nplacement = \"data\"\nridge = 0.0\n\
        [[fitted_on.record]]\nfile = \"a.csv\"\nsamples = 1000\nsample_rate_hz = 50000.0\n\
        initial_state = \"at rest from above\"\nfitted_from = 0\nweight = 1.0\n",
    );
    text
}

/// Weights whose loop rises everywhere, um/V.
pub(crate) const RISING: [f64; 3] = [0.02, 0.02, 0.02];

/// Hum of 20 nm with a third harmonic.
pub(crate) const HUM: [Named; 6] = [
    ("frequency", 50.0, "Hz"),
    ("amplitude_1", 0.02, "um"),
    ("amplitude_2", 0.0, "um"),
    ("amplitude_3", 0.01, "um"),
    ("amplitude_4", 0.0, "um"),
    ("amplitude_5", 0.0, "um"),
];
