//! An identified stage as C99 in `f64`: from rest at 0 V, a command a sample, the position that a free simulation gives.
//!
//! Each effect adds its memory, the value that it rests at, and its step, in the order of the chain: command, hysteresis, position. Its
//! numbers are those of the core's blocks.

use crate::FmuError;
use hysteron_core::effects::lag::Lag;
use hysteron_core::effects::resonance::Mode;
use hysteron_identify::effects::Acts;
use hysteron_identify::family::FADING_STEP;
use hysteron_identify::{Direction, EffectId, Family, FittedEffect, Model};
use hysteron_table::CCode;
use std::f64::consts::TAU;
use std::fmt::Write;

/// Longest delay, samples: that of the host's ring.
const LONGEST_DELAY: usize = 4092;
/// Elements of creep, each a decade slower than the one before.
const CREEP_ELEMENTS: i32 = 4;
/// A play as wide as the range hardly moves: least width of what its polynomial holds on, as a share of the input's.
const LEAST_WINDOW: f64 = 0.05;

/// Texts beside this file: blocks with memory, each with its name; only those that a model has are in its C.
const HELPERS: [(&str, &str); 7] = [
    ("larger(", include_str!("../c/limits.c")),
    ("delayed(", include_str!("../c/delayed.c")),
    ("lagged(", include_str!("../c/lagged.c")),
    ("grown(", include_str!("../c/grown.c")),
    ("swung(", include_str!("../c/swung.c")),
    ("straight(", include_str!("../c/straight.c")),
    ("faded(", include_str!("../c/fading.c")),
];

/// The parts of a model's C.
#[derive(Debug, Default)]
struct Parts {
    /// Members of the state.
    members: String,
    /// Statements on `v` before the hysteresis, and on `y` behind it: of rest at 0 V, and of a step.
    on_voltage: [String; 2],
    on_position: [String; 2],
}

/// Writing to a String does not fail.
macro_rules! line {
    ($to:expr, $($words:tt)*) => {{ let _ = writeln!($to, "    {}", format_args!($($words)*)); }};
}

/// The model's C; every name begins with `name`.
pub(crate) fn code(model: &Model, name: &str, rate_hz: f64) -> Result<CCode, FmuError> {
    if model.direction != Direction::Forward {
        return Err(FmuError::Inverse);
    }
    if !(1.0..=1e7).contains(&rate_hz) {
        return Err(FmuError::Value {
            field: "rate",
            value: format!("{rate_hz} Hz"),
            allowed: "1 Hz to 10 MHz",
        });
    }
    let mut parts = Parts::default();
    parts.effects(model, rate_hz)?;
    let [rest_v, step_v] = &parts.on_voltage;
    let [rest_y, step_y] = &parts.on_position;
    let body = format!(
        "{hysteresis}\ndouble {name}_reset({name}_state *s) {{\n    {name}_state fresh = {{0}};\n    double v = 0.0, y;\n    int i;\n    \
         *s = fresh;\n{rest_v}    for (i = 0; i < {states}; i++) {{\n        s->plays[i] = {rest};\n    }}\n    s->input = v;\n    \
         y = hysteresis(s, v);\n{rest_y}    return y;\n}}\n\n\
         double {name}_step({name}_state *s, double v) {{\n    double y;\n    v = fabs(v) <= 1e30 ? v : s->asked;\n    s->asked = v;\n\
         {step_v}    y = hysteresis(s, v);\n{step_y}    return y;\n}}\n",
        hysteresis = hysteresis(model, name, rate_hz),
        states = states(model),
        rest = if model.family == Family::Duhem { "REST[i]" } else { "v" },
    );
    let mut source = format!("/* {name}: see {name}.h. */\n#include \"{name}.h\"\n\n#include <math.h>\n\n");
    for (call, text) in HELPERS {
        // One helper may call another that stands before it.
        let called = HELPERS
            .iter()
            .any(|(other, text)| *other != call && body.contains(other) && text.contains(call));
        if body.contains(call) || called {
            source += &text.replace("@name@", name);
            source.push('\n');
        }
    }
    source += &body;
    Ok(CCode {
        header: header(model, name, rate_hz, &parts.members.replace("@name@", name)),
        source,
    })
}

fn header(model: &Model, name: &str, rate_hz: f64, members: &str) -> String {
    let upper = name.to_ascii_uppercase();
    let effects: Vec<&str> = model.effects.iter().map(|fitted| fitted.name.as_str()).collect();
    let [low, high] = [model.input_min, model.input_max];
    format!(
        "/* {name}: an identified stage, made by `hysteron export --format fmu`. C99, no allocation.\n *\n \
         * {} with {} {}, fitted on {low:?} to {high:?} V; effects: {}.\n \
         * Compile without -ffast-math, and with -ffp-contract=off for the same bits everywhere.\n */\n\
         #ifndef {upper}_H\n#define {upper}_H\n\n#define {upper}_SAMPLE_RATE_HZ {rate_hz:?}\n\n\
         typedef struct {{\n    double output, input;\n}} {name}_lag;\n\n\
         typedef struct {{\n    double position, rate, input;\n}} {name}_mode;\n\n\
         /* Not for reading. */\ntypedef struct {{\n    double asked, input, plays[{}];\n{members}}} {name}_state;\n\n\
         /* Rest at 0 V after a cycle; the position there, micrometres. */\ndouble {name}_reset({name}_state *state);\n\n\
         /* One sample: a command, volts at the actuator; the position, micrometres. */\n\
         double {name}_step({name}_state *state, double voltage_v);\n\n#endif\n",
        model.family,
        model.thresholds.len(),
        model.family.elements(),
        if effects.is_empty() {
            "none".to_owned()
        } else {
            effects.join(", ")
        },
        states(model).max(1),
    )
}

/// Middle and half of the voltages that a model was fitted on.
fn window(model: &Model) -> (f64, f64) {
    let half = 0.5 * (model.input_max - model.input_min);
    let middle = 0.5 * (model.input_min + model.input_max);
    (middle, if half > 0.0 { half } else { 1.0 })
}

/// Numbers that a hysteresis remembers.
fn states(model: &Model) -> usize {
    match model.family {
        Family::Duhem => 3 * model.thresholds.len(),
        _ => model.thresholds.len(),
    }
}

impl Parts {
    fn effects(&mut self, model: &Model, rate_hz: f64) -> Result<(), FmuError> {
        let mut links = Vec::new();
        for fitted in &model.effects {
            let refused = || FmuError::Effect {
                effect: fitted.name.clone(),
            };
            let effect = fitted.effect().ok_or_else(refused)?;
            let id = fitted.name.id().ok_or_else(refused)?;
            links.push((
                effect.description().place,
                effect.acts() == Acts::Nonlinearly,
                id,
                fitted,
            ));
        }
        links.sort_by_key(|(place, ..)| *place);
        for nonlinear in [false, true] {
            for (number, (_, _, id, fitted)) in links.iter().enumerate().filter(|(_, link)| link.1 == nonlinear) {
                self.effect(*id, fitted, number, rate_hz)?;
            }
            if !nonlinear {
                let offset = model.coefficients.first().copied().unwrap_or(0.0);
                self.on_position
                    .iter_mut()
                    .for_each(|text| line!(text, "y += {offset:?};"));
            }
        }
        Ok(())
    }

    /// One effect; `n` tells it from the others.
    fn effect(&mut self, id: EffectId, fitted: &FittedEffect, n: usize, rate_hz: f64) -> Result<(), FmuError> {
        let values: Vec<f64> = fitted.parameters.iter().map(|parameter| parameter.value).collect();
        let value = |k: usize| values.get(k).copied().unwrap_or(0.0);
        match id {
            EffectId::Delay => self.delay(value(0) * rate_hz, n),
            EffectId::FirstOrderLag => {
                if value(2) == 0.0 {
                    self.lag(value(0), n, rate_hz, true)?;
                } else {
                    self.growing_lag([value(0) * rate_hz, value(2) * rate_hz, value(3)], n);
                }
                self.lag(value(1), n, rate_hz, false)?;
            }
            EffectId::SlewLimit => {
                let rise = value(0) / rate_hz;
                let fall = if value(1) == 0.0 { rise } else { value(1) / rate_hz };
                line!(self.members, "double slewed{n};");
                line!(self.on_voltage[0], "s->slewed{n} = v;");
                line!(
                    self.on_voltage[1],
                    "v = s->slewed{n} += smaller(larger(-{fall:?}, v - s->slewed{n}), {rise:?});"
                );
            }
            EffectId::Saturation => {
                for text in &mut self.on_voltage {
                    line!(text, "v = smaller(larger({:?}, v), {:?});", value(0), value(1));
                }
                let (low, high, gives) = (value(2), value(3), value(4));
                let stopped = format!("smaller(larger({low:?}, y), {high:?})");
                for text in &mut self.on_position {
                    line!(text, "y = {stopped} + {gives:?} * (y - {stopped});");
                }
            }
            // In the hysteresis.
            EffectId::RateDependence | EffectId::AmplitudeGain | EffectId::HysteresisShape => {}
            EffectId::Asymmetry => {
                let (middle, quadratic, cubic) = (value(0), value(1), value(2));
                let u = format!("(v - {middle:?})");
                for text in &mut self.on_position {
                    line!(text, "y += {u} * {u} * ({quadratic:?} + {cubic:?} * {u});");
                }
            }
            EffectId::Creep => self.creep(&values, n, rate_hz)?,
            EffectId::Resonance => self.resonance(&values, n, rate_hz)?,
            EffectId::Backlash => {
                let half = 0.5 * value(0);
                line!(self.members, "double lost{n};");
                line!(self.on_position[0], "y = s->lost{n} = y + {half:?};");
                line!(
                    self.on_position[1],
                    "y = s->lost{n} = larger(y - {half:?}, smaller(y + {half:?}, s->lost{n}));"
                );
            }
            EffectId::SensorNonlinearity => {
                let (middle, quadratic, cubic) = (value(0), value(1), value(2));
                let u = format!("(y - {middle:?})");
                for text in &mut self.on_position {
                    line!(
                        text,
                        "y = {middle:?} + {u} * (1.0 + {u} * ({quadratic:?} + {u} * {cubic:?}));"
                    );
                }
            }
            EffectId::CrossCoupling
            | EffectId::ThermalDrift
            | EffectId::MainsHum
            | EffectId::NonlinearStiffness
            | EffectId::Friction
            | EffectId::ModeHysteresis => {
                return Err(FmuError::Effect {
                    effect: fitted.name.clone(),
                });
            }
        }
        Ok(())
    }

    fn delay(&mut self, samples: f64, n: usize) {
        let samples = samples.clamp(0.0, LONGEST_DELAY as f64);
        let whole = samples as usize;
        let (fraction, length) = (samples - whole as f64, whole + 4);
        line!(self.members, "double late{n}[{length}];");
        line!(self.members, "int newest{n};");
        line!(
            self.on_voltage[1],
            "s->newest{n} = s->newest{n} + 1 < {length} ? s->newest{n} + 1 : 0;"
        );
        line!(self.on_voltage[1], "s->late{n}[s->newest{n}] = v;");
        line!(
            self.on_voltage[1],
            "v = delayed(s->late{n}, {length}, s->newest{n}, {whole}, {fraction:?});"
        );
    }

    fn lag(&mut self, tau_s: f64, n: usize, rate_hz: f64, before: bool) -> Result<(), FmuError> {
        if tau_s <= 0.0 {
            return Ok(());
        }
        let [approach, through] = Lag::<f64>::new(tau_s, rate_hz)?.coefficients();
        let (texts, signal, member) = if before {
            (&mut self.on_voltage, "v", format!("amplifier{n}"))
        } else {
            (&mut self.on_position, "y", format!("sensor{n}"))
        };
        let [rest, step] = texts;
        let _ = writeln!(self.members, "    @name@_lag {member};");
        line!(rest, "s->{member}.output = s->{member}.input = {signal};");
        line!(
            step,
            "{signal} = lagged(&s->{member}, {approach:?}, {through:?}, {signal});"
        );
        Ok(())
    }

    fn growing_lag(&mut self, [tau, per_v, from]: [f64; 3], n: usize) {
        let [rest, step] = &mut self.on_voltage;
        line!(self.members, "@name@_lag amplifier{n};");
        line!(rest, "s->amplifier{n}.output = s->amplifier{n}.input = v;");
        line!(step, "v = grown(&s->amplifier{n}, {tau:?}, {per_v:?}, {from:?}, v);");
    }

    fn creep(&mut self, values: &[f64], n: usize, rate_hz: f64) -> Result<(), FmuError> {
        let Some((first_s, shares)) = values.split_first() else {
            return Ok(());
        };
        let mut added = [String::new(), String::new()];
        for (i, share) in (0..CREEP_ELEMENTS).zip(shares).filter(|(_, share)| **share != 0.0) {
            let [approach, through] = Lag::<f64>::new(first_s * 10_f64.powi(i), rate_hz)?.coefficients();
            let member = format!("creep{n}_{i}");
            line!(self.members, "@name@_lag {member};");
            line!(self.on_position[0], "s->{member}.output = s->{member}.input = y;");
            let _ = write!(added[0], " + {share:?} * y");
            let _ = write!(
                added[1],
                " + {share:?} * lagged(&s->{member}, {approach:?}, {through:?}, y)"
            );
        }
        for (text, added) in self
            .on_position
            .iter_mut()
            .zip(added)
            .filter(|(_, added)| !added.is_empty())
        {
            line!(text, "y +={};", added.trim_start_matches(" +"));
        }
        Ok(())
    }

    fn resonance(&mut self, values: &[f64], n: usize, rate_hz: f64) -> Result<(), FmuError> {
        let &[frequency_hz, damping, frequency_2_hz, damping_2, share] = values else {
            return Ok(());
        };
        let modes = [(frequency_hz, damping, "y"), (frequency_2_hz, damping_2, "other")];
        let count = if share == 0.0 { 1 } else { 2 };
        let [rest, step] = &mut self.on_position;
        if count == 2 {
            line!(step, "{{");
            line!(step, "double other = y;");
        }
        for (i, (hz, damping, signal)) in modes.into_iter().enumerate().take(count) {
            let [[a, b], [c, d]] = Mode::<f64>::new(hz, damping, rate_hz)?.free_motion();
            let (twice, radian) = (2.0 * damping, 1.0 / (TAU * hz / rate_hz));
            line!(self.members, "@name@_mode mode{n}_{i};");
            line!(rest, "s->mode{n}_{i}.position = s->mode{n}_{i}.input = y;");
            line!(
                step,
                "static const double c{i}[6] = {{{a:?}, {b:?}, {c:?}, {d:?}, {twice:?}, {radian:?}}};"
            );
            line!(step, "{signal} = swung(&s->mode{n}_{i}, c{i}, {signal});");
        }
        if count == 2 {
            line!(step, "y += {share:?} * (other - y);");
            line!(step, "}}");
        }
        Ok(())
    }
}

/// The hysteresis without its offset, which is the sensor's.
fn hysteresis(model: &Model, name: &str, rate_hz: f64) -> String {
    let powers = model.family.input_powers();
    let plays = model.thresholds.len();
    let of_input: Vec<f64> = (1..=powers.last().copied().unwrap_or(1))
        .map(|power| {
            let place = powers.iter().position(|own| *own == power);
            place
                .and_then(|place| model.coefficients.get(1 + place))
                .copied()
                .unwrap_or(0.0)
        })
        .collect();
    let of_plays = model.coefficients.get(1 + powers.len()..).unwrap_or_default();
    let functions = model.family.coefficients_a_play();
    let rows: Vec<Vec<f64>> = (0..plays)
        .map(|i| {
            (0..functions)
                .map(|f| of_plays.get(f * plays + i).copied().unwrap_or(0.0))
                .collect()
        })
        .collect();
    let mut text = format!(
        "static const double INPUT[{}] = {};\nstatic const double THRESHOLDS[{plays}] = {};\n\
         static const double WEIGHTS[{plays}][{functions}] = {{\n",
        of_input.len(),
        braced(&of_input),
        braced(&model.thresholds)
    );
    for row in &rows {
        let _ = writeln!(text, "    {},", braced(row));
    }
    if model.family == Family::Duhem {
        return text + "};\n" + &fading(model, name, of_input.len());
    }
    let free = model.family.is_free();
    let (left, right, speed) = envelope(model);
    let _ = write!(
        text,
        "}};\n\n/* The hysteresis: plays between two bounds of the command, and what they weigh. */\n\
         static double hysteresis({name}_state *s, double v) {{\n    double rate = (v - s->input) * {rate_hz:?};\n{speed}    \
         double left = {left}, right = {right}, y;\n    int i;\n    s->input = v;\n"
    );
    let (middle, half) = window(model);
    if free {
        line!(
            text,
            "y = straight(INPUT, {}, {middle:?}, {half:?}, v);",
            of_input.len()
        );
    } else {
        line!(text, "y = 0.0;");
        line!(text, "for (i = {}; i >= 0; i--) {{", of_input.len() - 1);
        line!(text, "    y = (y + INPUT[i]) * v;");
        line!(text, "}}");
    }
    line!(text, "for (i = 0; i < {plays}; i++) {{");
    line!(text, "    double w = s->plays[i];");
    line!(text, "    w = w > right ? right : w;");
    line!(text, "    w = w < left - THRESHOLDS[i] ? left - THRESHOLDS[i] : w;");
    line!(text, "    s->plays[i] = w;");
    match model.family {
        Family::Pi | Family::Mpi | Family::Mrpi => line!(text, "    y += WEIGHTS[i][0] * w;"),
        Family::Wrpi => line!(text, "    y += (WEIGHTS[i][0] + WEIGHTS[i][1] * rate) * w;"),
        Family::PlayPolynomial | Family::Duhem => {
            line!(
                text,
                "    y += straight(WEIGHTS[i], 3, {middle:?} - 0.5 * THRESHOLDS[i],"
            );
            line!(
                text,
                "                  larger({half:?} - 0.5 * THRESHOLDS[i], {:?}), w);",
                LEAST_WINDOW * half
            );
        }
    }
    text + "    }\n    (void)rate;\n    return y;\n}\n"
}

/// Elements whose memory fades along the path of the command: what they hold of its powers, and what that weighs.
fn fading(model: &Model, name: &str, inputs: usize) -> String {
    let n = model.thresholds.len();
    let rest: Vec<f64> = model.fading_at_rest().into_iter().flatten().collect();
    let (middle, half) = window(model);
    let longest = FADING_STEP * half;
    format!(
        "static const double REST[{states}] = {rest};\n\
         static const double POWERS[3][3] = {{{{1, 0, 0}}, {{0, 1, 0}}, {{0, 0, 1}}}};\n\n\
         static double power(int k, double v) {{\n    return straight(POWERS[k], 3, {middle:?}, {half:?}, v);\n}}\n\n\
         /* The hysteresis: dz = |dv| (v^k - z) / L. */\n\
         static double hysteresis({name}_state *s, double v) {{\n    \
         double from = s->input, parts = smaller(1000.0, larger(1.0, ceil(fabs(v - from) / {longest:?}))), step = (v - from) / parts;\n    \
         double y = straight(INPUT, {inputs}, {middle:?}, {half:?}, v);\n    int i, j, k;\n    \
         for (j = 1; step != 0.0 && j <= (int)parts; j++) {{\n        \
         double to = s->input + step * j;\n        \
         for (k = 0; k < 3; k++) {{\n            double was = power(k, from), is = power(k, to);\n            \
         for (i = 0; i < {n}; i++) {{\n                \
         s->plays[3 * i + k] = faded(s->plays[3 * i + k], was, is, fabs(step) / THRESHOLDS[i]);\n            }}\n        }}\n        \
         from = to;\n    }}\n    \
         for (i = 0; i < {n}; i++) {{\n        for (k = 0; k < 3; k++) {{\n            \
         y += WEIGHTS[i][k] * s->plays[3 * i + k];\n        }}\n    }}\n    \
         s->input = v;\n    return y;\n}}\n",
        states = 3 * n,
        rest = braced(&rest),
    )
}

/// Bounds of the plays, and the statement that they need.
fn envelope(model: &Model) -> (String, String, String) {
    let of_effect = model.effects.iter().find_map(|fitted| {
        let values: Vec<f64> = fitted.parameters.iter().map(|parameter| parameter.value).collect();
        let effect = fitted.effect()?;
        Some((effect.envelope(&values)?, effect.rate_law(&values)))
    });
    let (envelope, power) = match (of_effect, model.envelope) {
        (Some((envelope, law)), _) => (Some(envelope), (law.exponent != 1.0).then_some(law)),
        (None, own) => (own, None),
    };
    let Some(envelope) = envelope else {
        return ("v".to_owned(), "v".to_owned(), String::new());
    };
    let speed = match power {
        None => "fabs(rate)".to_owned(),
        Some(law) => format!(
            "{reference:?} * pow(fabs(rate) / {reference:?}, {:?})",
            law.exponent,
            reference = law.reference_v_per_s
        ),
    };
    (
        format!("v - {:?} * speed", envelope.alpha_s),
        format!("v + {:?} * speed", envelope.beta_s),
        format!("    double speed = {speed};\n"),
    )
}

fn braced(values: &[f64]) -> String {
    let lines: Vec<String> = values
        .chunks(5)
        .map(|chunk| {
            chunk
                .iter()
                .map(|value| format!("{value:?}"))
                .collect::<Vec<_>>()
                .join(", ")
        })
        .collect();
    format!("{{{}}}", lines.join(",\n    "))
}
