//! A campaign by files from one step to the next: what is asked of a plan, what came back of it, and what is identified from that.

use super::doubts::{Doubt, Doubts, doubts};
use super::drift::{Drift, drifts};
use super::matching::{Returned, each, matched};
use super::skew::Skew;
use super::told::{Remark, Wrong};
use super::{FILE, Pass, Plan, Planned, csv, sequence_csv};
use crate::campaign::{Protocol, TRAINING_PASSES};
use crate::error::ControlError;
use crate::message::{Message, Setting};
use hysteron_acquisition::{Finding, Kind};
use hysteron_data::{Dataset, Known, Record};
use hysteron_identify::control::identify;
use hysteron_table::short;
use std::fmt::Write;
use std::path::Path;

/// Seed of excitations that are random where none is given.
pub const USUAL_SEED: u64 = 1;
/// Lowest and highest top voltage, volts.
pub const TOP_V: [f64; 2] = [1.0, 1e3];
/// Lowest and highest rate of a controller, hertz.
pub const RATE_HZ: [f64; 2] = [1e3, 1e6];
/// Lowest and highest latency, microseconds.
pub const LATENCY_US: [f64; 2] = [0.0, 1e4];
/// Lowest and highest bandwidth of a sensor, hertz.
pub const SENSOR_HZ: [f64; 2] = [1.0, 1e7];

/// Refuses a value of a setting that is out of its range.
///
/// # Errors
/// A value below, above, or no number.
pub fn within(setting: Setting, value: f64, [min, max]: [f64; 2], unit: &str) -> Result<(), ControlError> {
    // A NaN fails both comparisons.
    if value >= min && value <= max {
        return Ok(());
    }
    Err(ControlError::Wish(
        Message::from(setting).and(format!(" {value}: give {min} to {max} {unit}")),
    ))
}

/// What a person says of a campaign.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Given {
    /// Highest voltage, volts at the actuator.
    pub top_v: Option<f64>,
    /// Sample rate of the controller, hertz.
    pub rate_hz: Option<f64>,
    /// Latency of the controller, microseconds.
    pub latency_us: Option<f64>,
    /// Bandwidth of the sensor, hertz.
    pub sensor_bandwidth_hz: Option<f64>,
    /// Seed of excitations that are random.
    pub seed: Option<u64>,
    /// Whether records that began while the stage moved are taken.
    pub short_rests: bool,
}

impl Given {
    /// What commands are made for.
    ///
    /// # Errors
    /// No highest voltage or no rate, or a value out of its range.
    pub fn protocol(&self) -> Result<Protocol, ControlError> {
        let (Some(top_v), Some(rate_hz)) = (self.top_v, self.rate_hz) else {
            return Err(ControlError::Wish(
                Message::from("a plan needs the highest voltage and the sample rate: give ")
                    .naming(Setting::TopV)
                    .and(" and ")
                    .naming(Setting::RateHz),
            ));
        };
        self.check_chain()?;
        within(Setting::TopV, top_v, TOP_V, "V")?;
        within(Setting::RateHz, rate_hz, RATE_HZ, "Hz")?;
        Ok(Protocol {
            period_s: 1.0 / rate_hz,
            top_v,
            seed: self.seed.unwrap_or(USUAL_SEED),
        })
    }

    /// The plan of what is played before anything is known.
    ///
    /// # Errors
    /// As [`Self::protocol`] and [`Plan::new`].
    pub fn plan(&self) -> Result<Plan, ControlError> {
        let protocol = self.protocol()?;
        let rate_hz = self.rate_hz.unwrap_or(1.0 / protocol.period_s);
        Plan::new(&protocol, rate_hz, self.latency_us)
    }

    /// Refuses a latency or a bandwidth out of its range.
    ///
    /// # Errors
    /// As [`within`].
    pub fn check_chain(&self) -> Result<(), ControlError> {
        let chain = [
            (Setting::LatencyUs, self.latency_us, LATENCY_US, "us"),
            (Setting::SensorBandwidthHz, self.sensor_bandwidth_hz, SENSOR_HZ, "Hz"),
        ];
        chain.into_iter().try_for_each(|(setting, value, ends, unit)| {
            value.map_or(Ok(()), |value| within(setting, value, ends, unit))
        })
    }

    /// Settings that say otherwise than the plan are an error.
    fn agrees(&self, plan: &Plan, file: &Path) -> Result<(), ControlError> {
        let check =
            |setting: Setting, given: Option<String>, planned: Option<String>, unit: &str| match (given, planned) {
                (Some(given), Some(planned)) if given != planned => {
                    let differs = format!(
                        " {given}, and {} has {planned}{unit}: leave it out, or name the plan that was recorded with ",
                        file.display()
                    );
                    Err(ControlError::Wish(
                        Message::from(setting).and(differs).naming(Setting::Plan),
                    ))
                }
                _ => Ok(()),
            };
        let text = |value: Option<f64>| value.map(|value| value.to_string());
        let seed = self.seed.map(|seed| seed.to_string());
        check(Setting::TopV, text(self.top_v), text(Some(plan.top_v)), " V")?;
        check(Setting::RateHz, text(self.rate_hz), text(Some(plan.rate_hz)), " Hz")?;
        check(Setting::Seed, seed, Some(plan.seed.to_string()), "")?;
        check(Setting::LatencyUs, text(self.latency_us), text(plan.latency_us), " us")
    }
}

/// Refuses to write a plan over one that recordings may be of.
///
/// # Errors
/// A plan in the folder that is not to be replaced.
pub fn refuse_to_replace(folder: &Path, overwrite: bool) -> Result<(), ControlError> {
    let file = folder.join(FILE);
    if file.exists() && !overwrite {
        let there = format!(
            "{}: there is a plan already, which recordings may be of; choose another place, or give ",
            file.display()
        );
        return Err(ControlError::Wish(Message::from(there).naming(Setting::Overwrite)));
    }
    Ok(())
}

impl Plan {
    /// The files of a pass with their names in the plan's folder, the plan itself last.
    ///
    /// # Errors
    /// As [`Plan::to_toml`].
    pub fn files(&self, number: usize) -> Result<Vec<(String, String)>, ControlError> {
        let mut files = Vec::new();
        if let Some(pass) = self.passes.get(number) {
            files.extend(pass.records.iter().map(|record| (record.file.clone(), csv(record))));
            files.push((pass.sequence.clone(), sequence_csv(self, pass)));
        }
        files.push((FILE.to_owned(), self.to_toml()?));
        Ok(files)
    }

    /// The files of a pass in words, and how they are played; `folder` is that of the plan.
    pub fn words(&self, number: usize, folder: &Path) -> String {
        self.passes
            .get(number)
            .map_or_else(String::new, |pass| words(self, number, pass, folder))
    }
}

fn words(plan: &Plan, number: usize, pass: &Pass, folder: &Path) -> String {
    let mut list = String::new();
    for record in &pass.records {
        // Writing to a String does not fail.
        let _ = writeln!(
            list,
            "{:<40} {:>8} samples  {:>7.3} s  after {:>2} s of rest  {}",
            folder.join(&record.file).display(),
            record.samples,
            record.duration_s(),
            record.rest_before_s,
            record.excitation
        );
    }
    let cycle = match number {
        0 => format!(
            "cycle the stage to {} V and back to {} V, then ",
            short(plan.cycle_to_v),
            short(plan.rest_v)
        ),
        _ => String::new(),
    };
    let _ = write!(
        list,
        "\n{cycle}play each after its rest at {} V, and record voltage and position from its first sample on; names are free\n\
         or all of it at once, rests and all: {}, {} samples at {} Hz, {:.1} s\n\
         {} knows them by their voltages\n",
        short(plan.rest_v),
        folder.join(&pass.sequence).display(),
        pass.samples,
        short(plan.rate_hz),
        pass.samples as f64 / plan.rate_hz,
        folder.join(FILE).display()
    );
    list
}

/// A planned record, and what came back of it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Found<'a> {
    /// Its pass, from 0 on.
    pub pass: usize,
    /// The record.
    pub planned: &'a Planned,
    /// The recording that it was found in; none where it is not there.
    pub from: Option<&'a str>,
}

/// Recordings beside their plan: which is which, and why they cannot be used.
#[derive(Debug, Clone)]
pub struct Checked {
    plan: Plan,
    short_rests: bool,
    dataset: Dataset,
    returned: Returned,
}

impl Checked {
    /// Finds what came back of a plan in a dataset; `file` is the plan's, for the words.
    ///
    /// # Errors
    /// - What is given says otherwise than the plan or than the dataset.
    /// - A latency that nobody gives; a dataset whose voltage the plan leaves.
    pub fn new(mut plan: Plan, given: &Given, file: &Path, recorded: &Dataset) -> Result<Self, ControlError> {
        given.check_chain()?;
        given.agrees(&plan, file)?;
        let dataset = Dataset {
            name: recorded.name.clone(),
            description: format!("campaign for control, seed {}", plan.seed),
            known: known(given, &plan, recorded)?,
            ..Dataset::default()
        };
        plan.latency_us = given.latency_us.or(plan.latency_us);
        Ok(Self {
            returned: matched(&plan, &recorded.records),
            short_rests: given.short_rests,
            plan,
            dataset,
        })
    }

    /// What should be known of the recordings.
    pub fn remarks(&self) -> &[Remark] {
        &self.returned.remarks
    }

    /// The planned records, each with the recording that it was found in.
    pub fn found(&self) -> impl Iterator<Item = Found<'_>> {
        each(&self.plan).map(|(pass, number, planned)| Found {
            pass,
            planned,
            from: self.returned.of((pass, number)).map(|taken| taken.from.as_str()),
        })
    }

    /// Whether every planned record came back whole, from rest.
    ///
    /// # Errors
    /// A sentence for each that did not.
    pub fn complete(self) -> Result<Complete, ControlError> {
        refuse(self.returned.wrong.iter().map(Wrong::message))?;
        let doubts = doubts(&self.plan, &self.returned);
        let unrested: Vec<&Doubt> = doubts.doubts.iter().filter(|doubt| doubt.is_a_short_rest()).collect();
        let begun = unrested.len();
        if !self.short_rests {
            refuse(unrested.iter().map(|doubt| doubt.message()))?;
        }
        let drifts = drifts(&self.plan, &self.returned);
        let mut checked = self;
        if begun > 0 {
            let granted = format!("; {begun} began before the stage was at rest, as was granted");
            checked.dataset.description.push_str(&granted);
        }
        Ok(Complete {
            checked,
            doubts,
            drifts,
        })
    }

    /// Whether a recording is none that can be used: then the reader's own findings may say why.
    pub fn is_wrong(&self) -> bool {
        !self.returned.wrong.is_empty()
    }
}

/// All recordings of a pass.
#[derive(Debug, Clone)]
pub struct Complete {
    checked: Checked,
    doubts: Doubts,
    drifts: Vec<Drift>,
}

impl Complete {
    /// What may spoil the campaign.
    pub fn warnings(&self) -> Vec<Message> {
        let mistakes = self.doubts.mistakes.iter().map(|finding| finding.to_string().into());
        let doubts = self.doubts.doubts.iter().map(Doubt::message);
        let drifted = self.drifts.iter().flat_map(Drift::warnings);
        mistakes.chain(doubts).chain(drifted.map(Message::from)).collect()
    }

    /// Identifies from the passes that came back, and makes the next one until all are there.
    ///
    /// # Errors
    /// - A sign of which no controller can be made: its loop would run away.
    /// - Records that do not tell what a controller needs.
    pub fn identify(self) -> Result<CameBack, ControlError> {
        let Checked {
            mut plan,
            mut dataset,
            mut returned,
            ..
        } = self.checked;
        refuse(self.doubts.signs.iter().map(turned))?;
        let zero_um = self.doubts.zero_um.unwrap_or(0.0);
        returned.count_from(zero_um);
        // The converter's ends count from the same zero.
        let ends_um = dataset.known.adc_um;
        dataset.known.adc_um = ends_um.map(|ends_um| ends_um.map(|end_um| end_um - zero_um));
        for pass in 0..returned.passes {
            let records = returned.of_pass(pass).map(|taken| taken.record.clone());
            dataset.records.extend(records.collect::<Vec<Record>>());
        }
        let model = identify(&dataset)?;
        let next = Some(returned.passes).filter(|next| *next <= TRAINING_PASSES);
        if let Some(next) = next {
            let commands = plan.protocol().training(&model, next)?;
            plan.set_pass(next, commands);
        }
        Ok(CameBack {
            skew: Skew::of(&model),
            misfit_percent: model.misfit_percent,
            rig: rig(&self.doubts, &self.drifts),
            dataset,
            plan,
            next,
        })
    }
}

/// What was identified from the recordings of a plan.
#[derive(Debug, Clone)]
pub struct CameBack {
    /// The records that count, under their planned names.
    pub dataset: Dataset,
    /// How well what is identified explains the commands, percent of their range.
    pub misfit_percent: f64,
    /// A lag that may be a skew of the channels.
    pub skew: Option<Skew>,
    /// What is known of the rig, and what its records cannot tell.
    pub rig: String,
    /// The plan, with its next pass where there is one.
    pub plan: Plan,
    /// The number of the pass that is to be recorded as well; none once all are there.
    pub next: Option<usize>,
}

fn refuse(reasons: impl Iterator<Item = Message>) -> Result<(), ControlError> {
    let wrong: Vec<Message> = reasons.collect();
    if wrong.is_empty() {
        return Ok(());
    }
    Err(ControlError::Recordings { wrong })
}

/// A sign of which no controller can be made.
fn turned(finding: &Finding) -> Message {
    match finding.kind {
        Kind::NegativeGain => Message::from(format!(
            "the position falls where the voltage rises, by {:.4} um/V: turn the sensor's sign, or import it with ",
            finding.figure.value.abs()
        ))
        .naming(Setting::TurnedPosition),
        _ => finding.to_string().into(),
    }
}

/// What is known of the measuring chain.
fn known(given: &Given, plan: &Plan, recorded: &Dataset) -> Result<Known, ControlError> {
    let mut known = recorded.known;
    let latency_us = given.latency_us.or(plan.latency_us);
    let delay_s = latency_us.map(|us| plan.known_delay_s(us));
    if let (Some(latency_us), Some(given_s), Some(said_s)) = (latency_us, delay_s, known.delay_s)
        // A hundredth of a microsecond is rounding.
        && (given_s - said_s).abs() > 1e-8
    {
        let differs = format!(
            "a latency of {latency_us} us and half a sample of hold are a known delay of {:.2} us, and dataset.toml has delay_s = {said_s} \
             ({:.2} us): correct one of them",
            1e6 * given_s,
            1e6 * said_s
        );
        return Err(ControlError::Wish(differs.into()));
    }
    known.delay_s = delay_s.or(known.delay_s);
    if known.delay_s.is_none() {
        return Err(ControlError::Wish(
            Message::from("the latency of your controller, from reading to command, is not known: give ")
                .naming(Setting::LatencyUs)
                .and(", or delay_s under [known] in dataset.toml, which has half a sample of hold in it"),
        ));
    }
    if let Some(max_v) = known.voltage_max_v.filter(|max_v| *max_v < plan.cycle_to_v) {
        let above = format!(
            "the plan goes to {} V, and dataset.toml has voltage_max_v = {max_v}: correct it, or plan with a lower ",
            short(plan.cycle_to_v)
        );
        return Err(ControlError::Wish(Message::from(above).naming(Setting::TopV)));
    }
    known.sensor_bandwidth_hz = given.sensor_bandwidth_hz.or(known.sensor_bandwidth_hz);
    known.voltage_min_v = known.voltage_min_v.or(Some(plan.rest_v));
    known.voltage_max_v = known.voltage_max_v.or(Some(plan.top_v));
    Ok(known)
}

fn rig(doubts: &Doubts, drifts: &[Drift]) -> String {
    let mut text = String::new();
    // Writing to a String does not fail.
    for drift in drifts {
        let _ = writeln!(text, "{drift}");
    }
    if let Some(zero_um) = doubts.zero_um {
        let _ = writeln!(
            text,
            "zero: the sensor reads {zero_um:.4} um at rest; positions in the records, of the controller and in adc_um count from there. What of \
             it the stage remembers cannot be told"
        );
    }
    let _ = writeln!(text, "noise {}", doubts.noise);
    if let Some(following) = &doubts.following {
        let _ = writeln!(text, "{following}");
    }
    text
}
