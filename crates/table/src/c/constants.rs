//! The numbers of a law as C constants, from the core's own blocks.

use crate::{Family, Table, TableError};
use hysteron_core::bank::PlayBank;
use hysteron_core::codes::Converter;
use hysteron_core::corner_mrpi::CornerMrpi;
use hysteron_core::corner_polynomial::CornerPolynomial;
use hysteron_core::effects::creep::CreepInverseCoefficients;
use hysteron_core::envelope::Envelope;
use hysteron_core::limiter::Limiter;
use hysteron_core::mpi::MpiCoefficients;
use hysteron_core::pi_controller::PiController;
use hysteron_core::surroundings::{ChainLaw, CompleteLaw, HARMONICS, Surroundings};
use hysteron_core::thresholds::Thresholds;
use hysteron_core::tracking_law::{CREEP_FAST, CREEP_SLOW, Feedback, Feedforward, PLAYS, TAPS, TrackingLaw};
use std::fmt::Write;

/// The shortest decimal that gives the same `f32`, as a C constant.
pub(super) fn number(value: f32) -> String {
    format!("{value:?}f")
}

/// Constants written so far.
#[derive(Debug, Default)]
pub(super) struct Constants {
    text: String,
}

impl Constants {
    pub(super) fn text(&self) -> &str {
        &self.text
    }

    fn scalar(&mut self, name: &str, value: f32) {
        // Writing to a String does not fail.
        let _ = writeln!(self.text, "static const float {name} = {};", number(value));
    }

    fn count(&mut self, name: &str, value: impl std::fmt::Display) {
        let _ = writeln!(self.text, "#define {name} {value}");
    }

    fn list(&mut self, name: &str, values: &[f32]) {
        let _ = writeln!(
            self.text,
            "static const float {name}[{}] = {};",
            values.len(),
            braced(values)
        );
    }

    fn rows<const N: usize>(&mut self, name: &str, rows: &[[f32; N]]) {
        let _ = writeln!(self.text, "static const float {name}[{}][{N}] = {{", rows.len());
        for row in rows {
            let _ = writeln!(self.text, "    {},", braced(row));
        }
        self.text.push_str("};\n");
    }

    fn limiter(&mut self, limiter: &Limiter<f32>) {
        let [min, max, change] = limiter.limits();
        self.scalar("COMMAND_MIN_V", min);
        self.scalar("COMMAND_MAX_V", max);
        self.scalar("LARGEST_CHANGE_V", change);
    }

    fn gains(&mut self, controller: &PiController<f32>) {
        let [proportional, integral] = controller.gains();
        self.scalar("PROPORTIONAL", proportional);
        self.scalar("INTEGRAL_A_SAMPLE", integral);
    }

    /// What both laws have.
    pub(super) fn of_table(&mut self, table: &Table) -> Result<(), TableError> {
        let dac = Converter::new(table.dac_min_v as f32, table.dac_top_v as f32)?;
        let adc = Converter::new(table.adc_min_um as f32, table.adc_top_um as f32)?;
        self.list("DAC", &dac.coefficients());
        self.list("ADC", &adc.coefficients());
        self.count("PLAYS", table.thresholds_um.len());
        Ok(())
    }

    /// The paper's law.
    pub(super) fn of_paper(&mut self, table: &Table) -> Result<(), TableError> {
        let rate_hz = table.sample_rate_hz as f32;
        self.gains(&PiController::new(
            table.proportional_v_per_um as f32,
            table.integral_v_per_um_s as f32,
            rate_hz,
        )?);
        self.limiter(&Limiter::new(
            table.output_min_v as f32,
            table.output_max_v as f32,
            table.slew_v_per_s as f32,
            rate_hz,
        )?);
        self.scalar("SAFE_V", table.safe_v as f32);
        self.scalar("INPUT_MIN", table.input_min_um as f32);
        self.scalar("INPUT_MAX", table.input_max_um as f32);
        self.list("THRESHOLDS", &single(&table.thresholds_um));
        self.scalar("OFFSET", table.offset_v as f32);
        if table.family == Family::PlayPolynomial {
            self.list("INPUT_FUNCTION", &single(&table.input_function()));
            self.list("WEIGHTS", &single(&table.weights_v_per_um));
            self.list("WEIGHTS_QUADRATIC", &single(&table.weights_quadratic_v_per_um2));
            self.list("WEIGHTS_CUBIC", &single(&table.weights_cubic_v_per_um3));
            return Ok(());
        }
        self.scalar("CUBIC", table.cubic_v_per_um3 as f32);
        self.scalar("LINEAR", table.linear_v_per_um as f32);
        if table.by_corners() {
            return self.corners(table);
        }
        self.list("WEIGHTS", &single(&table.weights_v_per_um));
        if table.family == Family::Wrpi {
            self.scalar("SAMPLE_RATE_HZ", rate_hz);
            self.list("RATE_WEIGHTS", &single(&table.rate_weights_v_s_per_um2));
        }
        if table.family == Family::Mrpi {
            self.envelope([table.alpha_s as f32 * rate_hz, table.beta_s as f32 * rate_hz]);
        }
        Ok(())
    }

    fn envelope(&mut self, [alpha, beta]: [f32; 2]) {
        self.scalar("ALPHA", alpha);
        self.scalar("BETA", beta);
    }

    /// Plays that weigh nothing stand behind the table's: the sums up to its last are those of the chip.
    fn corners(&mut self, table: &Table) -> Result<(), TableError> {
        const MOST: usize = crate::MOST_PLAYS;
        let mut last = 0.0_f32;
        let thresholds: [f32; MOST] = core::array::from_fn(|i| {
            last = table.thresholds_um.get(i).map_or(last.next_up(), |&value| value as f32);
            last
        });
        let bank = PlayBank::new(
            Thresholds::new(thresholds)?,
            table.input_min_um as f32,
            table.input_max_um as f32,
            table.sample_rate_hz as f32,
        )?;
        let coefficients = MpiCoefficients {
            offset: table.offset_v as f32,
            cubic: table.cubic_v_per_um3 as f32,
            linear: table.linear_v_per_um as f32,
            weights: core::array::from_fn::<f32, MOST, _>(|i| table.weights_v_per_um.get(i).map_or(0.0, |&v| v as f32)),
        };
        let envelope = Envelope {
            alpha_s: table.alpha_s as f32,
            beta_s: table.beta_s as f32,
        };
        let model = CornerMrpi::new(bank, coefficients, envelope)?;
        let sums = model.sums();
        self.rows("SUMS", sums.get(..table.thresholds_um.len()).unwrap_or(&sums));
        self.envelope(model.envelope_a_sample());
        Ok(())
    }

    /// The complete law. Its parts by name: one more is an error here.
    pub(super) fn of_law(&mut self, law: &CompleteLaw<f32>) {
        let ChainLaw { tracking, surroundings } = law;
        let TrackingLaw {
            feedforward,
            feedback,
            limiter,
        } = tracking;
        self.limiter(limiter);
        self.feedforward(feedforward);
        if let Some(Feedback {
            integral,
            series,
            damping,
            trust,
        }) = feedback
        {
            self.gains(integral);
            self.rows("SERIES", &series.map(|section| section_of(section.coefficients())));
            self.list("DAMPING", &section_of(damping.coefficients()));
            if let Some(trust) = trust {
                self.list("TRUST", &trust.sizes());
            }
        }
        self.surroundings(surroundings);
    }

    fn feedforward(&mut self, feedforward: &Feedforward<f32, TAPS, PLAYS, CREEP_FAST, CREEP_SLOW>) {
        let Feedforward {
            preview,
            second_mode,
            creep,
            hysteresis,
            lead,
        } = feedforward;
        let (total, tails) = preview.coefficients();
        self.count("TAPS", TAPS);
        self.scalar("TOTAL", total);
        self.list("TAILS", tails);
        self.list("SECOND_MODE", &section_of(second_mode.coefficients()));
        let CreepInverseCoefficients {
            at_once,
            fast_shares,
            fast_approach,
            slow_shares,
            slow_approach,
            divider,
            share_of_a_sample,
        } = creep.coefficients();
        self.count("CREEP_FAST", CREEP_FAST);
        self.count("CREEP_SLOW", format_args!("{CREEP_SLOW}u"));
        self.count("CREEP_DIVIDER", format_args!("{divider}u"));
        self.scalar("AT_ONCE", at_once);
        self.list("FAST_SHARES", &fast_shares);
        self.list("FAST_APPROACH", &fast_approach);
        self.list("SLOW_SHARES", &slow_shares);
        self.list("SLOW_APPROACH", &slow_approach);
        self.scalar("SHARE_OF_A_SAMPLE", share_of_a_sample);
        self.hysteresis(hysteresis);
        let [at_zero, half_change] = lead.lead();
        self.scalar("LEAD", at_zero);
        self.scalar("LEAD_HALF_CHANGE", half_change);
    }

    fn hysteresis(&mut self, hysteresis: &CornerPolynomial<f32, PLAYS>) {
        let [min, max] = hysteresis.bank().range();
        let (offset, input_function) = hysteresis.input_function();
        self.scalar("INPUT_MIN", min);
        self.scalar("INPUT_MAX", max);
        self.list("THRESHOLDS", hysteresis.bank().thresholds().values());
        self.scalar("OFFSET", offset);
        self.list("INPUT_FUNCTION", input_function);
        self.rows("RIGHT_SUMS", &hysteresis.sums().map(|(right, _)| right));
        self.rows("LEFT_SUMS", &hysteresis.sums().map(|(_, left)| left));
    }

    fn surroundings(&mut self, surroundings: &Surroundings<f32>) {
        let Surroundings {
            rest,
            coupling,
            cross,
            hum,
            heat,
            sensor,
            sensor_lag,
            adaptation,
        } = surroundings;
        self.scalar("REST_UM", *rest);
        if let Some(coupling) = coupling {
            self.list("COUPLING", &coupling.coefficients());
        }
        if let Some(cross) = cross {
            self.scalar("CROSS", *cross);
        }
        if let Some(hum) = hum {
            let (turns, rates, largest) = hum.coefficients();
            self.count("HARMONICS", HARMONICS);
            self.rows("HUM_TURNS", turns);
            self.rows("HUM_RATES", rates);
            self.scalar("HUM_LARGEST", largest);
        }
        if let Some(heat) = heat {
            self.list("HEAT", &heat.coefficients());
        }
        if let Some(sensor) = sensor {
            self.list("SENSOR", &sensor.coefficients());
        }
        if let Some(sensor_lag) = sensor_lag {
            self.list("SENSOR_LAG", &sensor_lag.coefficients());
        }
        if let Some(adaptation) = adaptation {
            let (numbers, samples) = adaptation.coefficients();
            self.list("ADAPTATION", &numbers);
            self.count("ADAPTATION_SAMPLES", format_args!("{samples}u"));
        }
    }
}

/// b0, b1, b2, a1, a2.
fn section_of(([b0, b1, b2], [a1, a2]): ([f32; 3], [f32; 2])) -> [f32; 5] {
    [b0, b1, b2, a1, a2]
}

fn single(values: &[f64]) -> Vec<f32> {
    values.iter().map(|&value| value as f32).collect()
}

fn braced(values: &[f32]) -> String {
    let lines: Vec<String> = values
        .chunks(6)
        .map(|chunk| chunk.iter().map(|&value| number(value)).collect::<Vec<_>>().join(", "))
        .collect();
    format!("{{{}}}", lines.join(",\n    "))
}
