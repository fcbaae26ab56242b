//! An effect: what it is, how it acts on the signals of a record, how a controller undoes it.

use crate::compensator::Compensation;
use crate::effect_file::EffectFile;
use crate::family::Family;
use crate::id::{EffectId, EffectName};
use hysteron_core::envelope::Envelope;
use std::sync::Arc;

/// Where an effect stands between the commanded voltage and the recorded position.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Place {
    /// Between command and amplifier.
    Delay,
    /// The high-voltage amplifier with the stack as its load.
    Amplifier,
    /// The stack's hysteresis.
    Hysteresis,
    /// What the stack goes on doing at rest.
    Creep,
    /// The moving masses.
    Structure,
    /// Other axes and heat.
    Coupling,
    /// Contacts, stops and the sensor.
    Sensor,
}

impl Place {
    /// The chain in words, with this place in it.
    pub fn name(self) -> &'static str {
        match self {
            Self::Delay => "delay",
            Self::Amplifier => "amplifier",
            Self::Hysteresis => "hysteresis",
            Self::Creep => "creep",
            Self::Structure => "structure",
            Self::Coupling => "coupling and heat",
            Self::Sensor => "sensor",
        }
    }
}

/// A parameter of an effect, for people.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Named {
    /// Name as in `model.toml`.
    pub name: &'static str,
    /// Unit; empty for a pure number.
    pub unit: &'static str,
    /// What it is, and what is physical.
    pub what: &'static str,
}

/// An effect in words.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Description {
    /// Name on the command line and in files.
    pub name: &'static str,
    /// Where it stands in the chain.
    pub place: Place,
    /// What it is, one sentence.
    pub summary: &'static str,
    /// Its equation.
    pub equation: &'static str,
    /// Where the equation comes from.
    pub source: &'static str,
    /// Its parameters, in the order of the file.
    pub parameters: &'static [Named],
    /// How it shows in records.
    pub shows: &'static str,
    /// What it is mistaken for.
    pub mistaken_for: &'static str,
    /// Which record separates it from those.
    pub separated_by: &'static str,
    /// How it is compensated.
    pub compensated_by: &'static str,
    /// The kind of record that shows it best.
    pub scene: Scene,
}

/// A kind of record on which an effect is shown; an imagined stage plays it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Scene {
    /// A sine of 503 Hz over the full range.
    FastSine,
    /// A sine of 11 Hz over the full range.
    SlowSine,
    /// A step within 0.1 ms, and what follows within 20 ms.
    Edge,
    /// A step up and a step down, each held for a minute, while the room warms up.
    Hold,
    /// Sines of 11 Hz about the middle from 2 % of the range up to all of it.
    Ladder,
    /// This axis at rest while the other one moves.
    OtherAxis,
}

/// What a search may do with one parameter.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Bounds {
    /// Smallest physical value.
    pub min: f64,
    /// Largest physical value.
    pub max: f64,
    /// A change that matters: the unit of the search.
    pub scale: f64,
    /// The value at which the effect does nothing, or where a search begins.
    pub neutral: f64,
    /// Whether it is fitted; a fixed one stays at `neutral`.
    pub fitted: bool,
}

impl Bounds {
    /// A fitted parameter.
    pub const fn new(min: f64, max: f64, scale: f64, neutral: f64) -> Self {
        Self {
            min,
            max,
            scale,
            neutral,
            fitted: true,
        }
    }

    /// A parameter that is set once.
    pub fn fixed(value: f64) -> Self {
        Self {
            min: value,
            max: value,
            scale: 1.0,
            neutral: value,
            fitted: false,
        }
    }
}

/// What an effect may know of the records before it is fitted.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Facts {
    /// Lowest and highest voltage, volts.
    pub voltage_v: [f64; 2],
    /// Lowest and highest position, micrometres.
    pub position_um: [f64; 2],
    /// Shortest sample period, seconds.
    pub finest_period_s: f64,
    /// Shortest step of the grids on which chains run, seconds: finer than the samples where the drive between them is known.
    pub finest_grid_s: f64,
    /// Longest record, seconds.
    pub longest_s: f64,
    /// Largest rate of the command, volts per second.
    pub peak_rate_v_per_s: f64,
    /// Lowest, mean and highest temperature, where every record has one.
    pub temperature_c: Option<[f64; 3]>,
    /// Lowest and highest voltage of the other axis, where any record has one that moves.
    pub voltage2_v: Option<[f64; 2]>,
    /// Whether any record that moves begins at rest, where its zero shows.
    pub rests: bool,
    /// The hysteresis model it is added to.
    pub family: Family,
}

impl Facts {
    /// Span of the voltages, volts.
    pub fn span_v(&self) -> f64 {
        self.voltage_v[1] - self.voltage_v[0]
    }

    /// Stroke, micrometres.
    pub fn stroke_um(&self) -> f64 {
        self.position_um[1] - self.position_um[0]
    }

    /// Stroke, micrometres, where the position moves at all.
    ///
    /// # Errors
    /// A position that stands still in every record.
    pub(crate) fn moving_stroke_um(&self) -> Result<f64, String> {
        let stroke = self.stroke_um();
        if stroke <= 0.0 {
            return Err("the position stands still in every record".to_owned());
        }
        Ok(stroke)
    }
}

/// How a dynamic envelope grows with the rate of the voltage: as a power of it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RateLaw {
    /// 1: in proportion, as in the paper's eq. 9; 1/2: as excess loss; towards 0: as a logarithm.
    pub exponent: f64,
    /// Rate at which all exponents give the same, volts per second.
    pub reference_v_per_s: f64,
}

impl RateLaw {
    /// In proportion to the rate.
    pub const LINEAR: Self = Self {
        exponent: 1.0,
        reference_v_per_s: 1.0,
    };

    /// What stands in the envelope in place of the speed, volts per second.
    #[inline(always)]
    pub fn of(&self, speed_v_per_s: f64) -> f64 {
        if self.exponent == 1.0 {
            speed_v_per_s
        } else {
            self.reference_v_per_s * (speed_v_per_s / self.reference_v_per_s).powf(self.exponent)
        }
    }
}

/// What the error of a model without an effect goes with, first of all.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Mark {
    /// The rate of the drive, in proportion to the amplitude: the phase turns.
    Phase,
    /// The rate of the drive, otherwise than in proportion.
    Rate,
    /// The rate of the drive where it is above a limit.
    Slew,
    /// The position.
    Position,
    /// The ends of the position.
    Ends,
    /// The time since the drive moved.
    Time,
    /// The temperature, or the order of the records.
    Temperature,
    /// The mains.
    Mains,
    /// The voltage of another axis.
    OtherAxis,
}

impl Mark {
    /// Whether records of one sine alone can tell it: a sine that repeats does not bring it.
    pub fn shows_in_one_sine(self) -> bool {
        matches!(self, Self::Time | Self::Temperature | Self::Mains | Self::OtherAxis)
    }

    /// Whether a skew between the channels of voltage and position hides it.
    pub fn hidden_by_skew(self) -> bool {
        matches!(self, Self::Phase | Self::Rate)
    }
}

/// Takes small changes of a position through an effect, in place.
pub type Changes<'a> = Box<dyn Fn(&mut [Vec<f64>]) + Sync + 'a>;

/// One record as effects see it. All series have the length of the command; where the record is periodic, one period of
/// run-in stands before it.
#[derive(Debug, Clone, Copy)]
pub struct Signals<'a> {
    /// Sample period, seconds.
    pub period_s: f64,
    /// Samples of run-in, one period of the record; 0 where it does not start periodically (it then starts at rest).
    pub run_in: usize,
    /// Whether the stage rested before the run-in's period, for what remembers longer than a record lasts.
    pub rested: bool,
    /// Where in its play everything with a play stands before the first sample: 0 after coming down from above, 1 after
    /// coming up from below.
    pub fraction: f64,
    /// Voltage at the stack, volts: after all effects that act on the command.
    pub at_stack_v: &'a [f64],
    /// Stage temperature, degrees Celsius.
    pub temperature_c: Option<&'a [f64]>,
    /// Voltage commanded on the other axis, volts.
    pub voltage2_v: Option<&'a [f64]>,
    /// Numbers of this record alone, from [`Effect::settle`].
    pub own: &'a [f64],
}

/// How an effect acts on the position.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Acts {
    /// Not at all: it acts on the command or inside the hysteresis.
    Not,
    /// Adds something that does not depend on the position.
    Adds,
    /// A linear operation, the same for every part of the position.
    Linearly,
    /// Any other; it comes after the linear ones.
    Nonlinearly,
}

/// A change of the hysteresis family that an effect stands for.
#[derive(Debug, Clone, PartialEq)]
pub struct Shape {
    /// The family.
    pub family: Family,
    /// Thresholds, ascending, volts.
    pub thresholds: Vec<f64>,
}

/// A physical effect: what it is, what may be fitted, what it does to the signals.
///
/// The parameters of [`Description::parameters`], [`Effect::bounds`] and every `values` are the same list in the same order.
pub trait Effect: Send + Sync {
    /// Its name.
    fn name(&self) -> EffectName;

    /// The effect in words.
    fn description(&self) -> &'static Description;

    /// Bounds of the parameters on these records.
    ///
    /// # Errors
    /// In words, why these records or this model cannot have the effect.
    fn bounds(&self, facts: &Facts) -> Result<Vec<Bounds>, String>;

    /// Where searches start: more than one where the error has several valleys.
    fn starts(&self, facts: &Facts, bounds: &[Bounds]) -> Vec<Vec<f64>> {
        let _ = facts;
        vec![bounds.iter().map(|b| b.neutral).collect()]
    }

    /// Frees bounds that [`Effect::bounds`] keeps fixed, where `values` make use of them.
    fn free(&self, values: &[f64], bounds: &mut [Bounds]) {
        let _ = (values, bounds);
    }

    /// Where searches start when the effect is added once more, such as a second mode; `None` where it cannot be.
    fn once_more(&self, values: &[f64], bounds: &[Bounds]) -> Option<Vec<Vec<f64>>> {
        let _ = (values, bounds);
        None
    }

    /// The effect that it is a wider form of: in a chain it takes the place of that, and a search for it begins there.
    fn widens(&self) -> Option<EffectId> {
        None
    }

    /// Where searches start from the values of the narrower effect.
    fn widened(&self, narrower: &[f64], facts: &Facts, bounds: &[Bounds]) -> Vec<Vec<f64>> {
        let _ = (narrower, facts, bounds);
        Vec::new()
    }

    /// Whether it is looked for where the narrower effect takes little as well.
    fn hides_the_narrower(&self) -> bool {
        false
    }

    /// What it does to the command, in place.
    fn on_voltage(&self, values: &[f64], signals: &Signals<'_>, voltage_v: &mut [f64]) {
        let _ = (values, signals, voltage_v);
    }

    /// The dynamic envelope it gives the plays.
    fn envelope(&self, values: &[f64]) -> Option<Envelope<f64>> {
        let _ = values;
        None
    }

    /// The law by which that envelope grows with the rate.
    fn rate_law(&self, values: &[f64]) -> RateLaw {
        let _ = values;
        RateLaw::LINEAR
    }

    /// Whether it is a part of the hysteresis' family that is fitted with the effects, and no effect of its own: then the effect
    /// that it becomes in a family without that part.
    fn outside_family(&self) -> Option<Arc<dyn Effect>> {
        None
    }

    /// How it acts on the position.
    fn acts(&self) -> Acts {
        Acts::Not
    }

    /// What it does to the position, in place.
    fn on_position(&self, values: &[f64], signals: &Signals<'_>, position_um: &mut [f64]) {
        let _ = (values, signals, position_um);
    }

    /// [`Effect::on_position`] of many positions of one length.
    fn on_positions(&self, values: &[f64], signals: &Signals<'_>, positions_um: &mut [Vec<f64>]) {
        for position_um in positions_um {
            self.on_position(values, signals, position_um);
        }
    }

    /// What a small change of the position before a nonlinear effect is behind it, in place.
    fn on_change(&self, values: &[f64], signals: &Signals<'_>, position_um: &[f64], change: &mut [f64]) {
        let _ = (values, signals, position_um, change);
    }

    /// [`Effect::on_change`] of many changes of one position, with what they share made once.
    fn on_changes<'a>(&'a self, values: &'a [f64], signals: Signals<'a>, position_um: &'a [f64]) -> Changes<'a> {
        Box::new(move |columns| {
            for column in columns {
                self.on_change(values, &signals, position_um, column);
            }
        })
    }

    /// Unit of one of its parameters where no temperature was recorded.
    fn unit_without_temperature(&self, named: &Named) -> &'static str {
        named.unit
    }

    /// Whether numbers of it belong to one record alone.
    fn has_own_numbers(&self) -> bool {
        false
    }

    /// Numbers that belong to one record alone (phases of the mains), from what the rest leaves unexplained of it.
    /// `unexplained` has one value a recorded sample, which are `every` samples of the signals apart.
    fn settle(&self, values: &[f64], signals: &Signals<'_>, unexplained: &[f64], every: usize) -> Vec<f64> {
        let _ = (values, signals, unexplained, every);
        Vec::new()
    }

    /// What is left at each of some samples of a micrometre that its slow states held beyond the first position before a record;
    /// none for an effect that forgets within a record.
    fn remembered(&self, values: &[f64], period_s: f64, samples: usize) -> Option<Vec<f64>> {
        let _ = (values, period_s, samples);
        None
    }

    /// Whether it adds lines to the spectrum of a record that do not come from the drive.
    fn adds_line_spectrum(&self) -> bool {
        false
    }

    /// Whether it is a matter of the hysteresis, which a free shape has or stands for.
    fn of_the_shape(&self) -> bool {
        false
    }

    /// Whether it bends the loops, as far as loops alone show: a free shape absorbs it.
    fn bends_the_loops(&self) -> bool {
        false
    }

    /// By how much it moves the low end of these positions with the temperature, micrometres a kelvin; `None` where it does not, or does
    /// so to the high end above all.
    fn zero_um_per_k(&self, values: &[f64], position_um: [f64; 2]) -> Option<f64> {
        let _ = (values, position_um);
        None
    }

    /// What its error goes with; `None` for equations that say nothing of it.
    fn mark(&self) -> Option<Mark> {
        None
    }

    /// Whether a parameter on its physical bound speaks against the effect: it imitates another one there.
    fn refuted_on_bound(&self, parameter: &str) -> bool {
        let _ = parameter;
        false
    }

    /// Voltages below and above which the position stands still, volts; `None` where nothing does.
    fn rails_v(&self, values: &[f64]) -> Option<[f64; 2]> {
        let _ = values;
        None
    }

    /// Whether it moves signals in time, so that the shape between the samples matters.
    fn dynamic(&self) -> bool {
        false
    }

    /// Whether it remembers longer than records usually last, so that a response that repeats need not be the steady one.
    fn outlasts_records(&self) -> bool {
        false
    }

    /// Whether it needs more of a record than its voltage: heat, another axis.
    fn needs_columns(&self) -> bool {
        self.description().place == Place::Coupling
    }

    /// The effect file that it comes from; none for those of the catalogue.
    fn file(&self) -> Option<&EffectFile> {
        None
    }

    /// The hysteresis family it stands for, where it is a matter of the family; `place` puts so many thresholds where the
    /// records exercise them.
    fn reshape(&self, shape: &Shape, facts: &Facts, place: &dyn Fn(usize) -> Vec<f64>) -> Option<Shape> {
        let _ = (shape, facts, place);
        None
    }

    /// How a controller undoes it at these values.
    fn compensation(&self, values: &[f64]) -> Compensation;
}
