//! A board on the bench: the image in the processor model, its converters, the simulated stage behind them, and the host's law beside it.

use crate::cable::{End, Heard, Host as Listener, SAMPLES_PORT};
use crate::host::{Around, Axis, Host, started};
use crate::processor::{Failure, Line, Processor, Reset, Seen, State, Word};
use hysteron_board::Fault;
use hysteron_firmware::chips::Chip;
use hysteron_firmware::telemetry::{Found, Sample, all, samples_to_packet};
use hysteron_firmware::wire::{Frame, Mode, Order};
use hysteron_plant::Stage;

/// Instructions of main between two looks of the bench while the chip starts.
const STARTING: u32 = 2000;
/// The same in a period of the loop, an axis: what packing a sample takes, its share of a datagram, and a round.
const LOOPING: u32 = 1000;
/// Ticks between two looks at the telemetry, which the board keeps for 25 ms at least.
const TELEMETRY_TICKS: u32 = 500;
/// Ticks between two looks at the cable: a datagram has 32 of two axes.
const CABLE_TICKS: u32 = 25;
/// Frames that find room at the board at once.
const FRAMES_AT_ONCE: usize = 3;

/// What the sensor's converter gives.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Sensor {
    /// The stage's position.
    Stage,
    /// The same code for ever.
    Stuck(u16),
    /// No conversion ends.
    Silent,
}

/// How the outputs have moved since an event.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct Way {
    /// The event, processor cycles.
    pub(crate) since: u64,
    /// The last time that an output came to or left its safe level.
    pub(crate) settled: u64,
    /// Largest step of an output, codes.
    pub(crate) largest_step: u16,
    /// The same while the law runs, and once it no longer does.
    pub(crate) largest_of_law: u16,
    pub(crate) largest_after_law: u16,
}

/// How many ticks the image and the host have answered alike.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct Counts {
    /// Ticks on which the interrupt ran.
    pub(crate) ticks: u32,
    /// Of them, those on which an output was told another code than the host's, or the fault's pin another level.
    pub(crate) different: u32,
    /// Changes of an output at another instant than the latch, while the loop runs.
    pub(crate) beside_latch: u32,
    /// Ticks without a word since the last reset, though a conversion has ended.
    pub(crate) silent: u32,
    /// Frames of the telemetry that were held against the host's.
    pub(crate) telemetry: u32,
    /// Of them, those that are not the host's.
    pub(crate) telemetry_different: u32,
    /// What came by the cable.
    pub(crate) by_cable: Heard,
    /// Resets by the watchdog.
    pub(crate) bites: u32,
}

/// All of it.
pub(crate) struct Rig {
    processor: Processor,
    chip: Chip,
    /// The tables.
    pub(crate) axes: Vec<Axis>,
    stages: Vec<Stage>,
    fresh: Vec<Stage>,
    host: Option<Box<dyn Host>>,
    /// Causes of a reset that the image has not forgotten.
    watchdog: bool,
    low_supply: bool,
    late: bool,
    state: State,
    now: u64,
    /// Up to when the stages were stepped.
    stepped: u64,
    /// What the outputs' converters hold.
    pub(crate) outputs: Vec<u16>,
    /// What the sensors' converters give.
    pub(crate) sensor: Sensor,
    /// The next tick is held up until the next conversion has ended.
    pub(crate) hold_up: bool,
    /// The host's frames since the loop began, and the codes that they answer.
    frames: Vec<(Vec<Frame>, Vec<u16>)>,
    /// Telemetry that is no packet yet.
    sent: Vec<u8>,
    /// Whoever listens on the cable, and the board's end of it.
    cable: Option<(Listener, End)>,
    /// Orders that ticks have taken, with the ticks' numbers.
    pub(crate) taken: Vec<(u32, Order)>,
    /// How the outputs have moved.
    pub(crate) way: Way,
    /// What was compared.
    pub(crate) counts: Counts,
    /// As [`Seen::unwritten_read`], of any start.
    pub(crate) unwritten_read: bool,
    /// As [`Seen::unguarded`], of any start.
    pub(crate) unguarded: bool,
}

impl Rig {
    /// A board without power, a stage at rest.
    pub(crate) fn new(processor: Processor, chip: Chip, axes: Vec<Axis>, stages: Vec<Stage>) -> Self {
        Self {
            outputs: axes.iter().map(Axis::safe).collect(),
            processor,
            chip,
            axes,
            fresh: stages.clone(),
            stages,
            host: None,
            watchdog: false,
            low_supply: false,
            late: false,
            state: State::Starting,
            now: 0,
            stepped: 0,
            sensor: Sensor::Stage,
            hold_up: false,
            frames: Vec::new(),
            sent: Vec::new(),
            cable: None,
            taken: Vec::new(),
            way: Way::default(),
            counts: Counts::default(),
            unwritten_read: false,
            unguarded: false,
        }
    }

    /// Cycles of a period of the loop.
    pub(crate) fn period(&self) -> u64 {
        (f64::from(self.chip.processor_hz()) * 20e-6).round() as u64
    }

    /// Cycles from a trigger to the new outputs.
    pub(crate) fn latch(&self) -> u64 {
        // All images have complete laws.
        let latch_ns = self.chip.latch_ns(self.axes.len(), true).unwrap_or_default();
        u64::from(latch_ns) * u64::from(self.chip.processor_hz()) / 1_000_000_000
    }

    /// Milliseconds of some processor cycles.
    pub(crate) fn ms(&self, cycles: u64) -> f64 {
        1e3 * cycles as f64 / f64::from(self.chip.processor_hz())
    }

    /// What happens from here on is measured.
    pub(crate) fn mark(&mut self) {
        self.way = Way {
            since: self.now,
            settled: self.now,
            ..Way::default()
        };
    }

    /// Whether the loop runs.
    pub(crate) fn is_looping(&self) -> bool {
        self.state == State::Looping
    }

    /// Whether every output is at its safe level.
    pub(crate) fn is_safe(&self) -> bool {
        self.outputs
            .iter()
            .zip(&self.axes)
            .all(|(&code, axis)| code == axis.safe())
    }

    /// The host's last frame of the first axis.
    pub(crate) fn frame(&self) -> Option<Frame> {
        let (frames, _) = self.frames.last()?;
        frames.first().copied()
    }

    /// Whether all axes are away from their safe levels, without a fault.
    fn runs(&self) -> bool {
        let frames = self.frames.last().map(|(frames, _)| frames);
        frames.is_some_and(|frames| {
            frames
                .iter()
                .all(|frame| frame.mode() != Mode::Off && frame.fault().is_none())
        })
    }

    /// What the loop is at; off before it begins.
    pub(crate) fn mode(&self) -> Mode {
        self.frame().map_or(Mode::Off, |frame| frame.mode())
    }

    /// The code of the first axis' sensor now.
    pub(crate) fn code(&self) -> u16 {
        let code = self.stages.first().map(|stage| stage.sample().position_code);
        code.and_then(|code| u16::try_from(code).ok()).unwrap_or(u16::MAX)
    }

    /// What is latched.
    pub(crate) fn fault(&self) -> Option<Fault> {
        self.frame().and_then(|frame| frame.fault())
    }

    /// Everything is switched on: the stage at rest, every line as it should be.
    pub(crate) fn power_on(&mut self) -> Result<(), Failure> {
        for line in [
            Line::Button,
            Line::LowSupply,
            Line::CounterLocked,
            Line::NoPll,
            Line::NoOuterClock,
            Line::NoAdc,
            Line::NoSdo,
            Line::NoLdac,
            Line::NoCable,
        ] {
            self.set(line, false)?;
        }
        self.stages = self.fresh.clone();
        self.sensor = Sensor::Stage;
        self.hold_up = false;
        self.outputs.fill(0);
        self.reset(Reset::Power)?;
        (self.unwritten_read, self.unguarded) = (false, false);
        self.counts = Counts::default();
        self.mark();
        Ok(())
    }

    /// Resets the chip; the converters keep what they hold.
    pub(crate) fn reset(&mut self, cause: Reset) -> Result<(), Failure> {
        self.watchdog = cause == Reset::Watchdog || (self.watchdog && cause == Reset::Pin);
        self.processor.reset(cause)?;
        self.state = State::Starting;
        self.counts.silent = 0;
        self.host = None;
        self.frames.clear();
        self.sent.clear();
        self.taken.clear();
        self.late = false;
        Ok(())
    }

    /// The converters of the outputs lose their power for a moment, and hold their own zero again.
    pub(crate) fn lose_converters(&mut self) -> Result<(), Failure> {
        self.outputs.fill(0);
        self.processor.lose_converters()
    }

    /// Sets a line.
    pub(crate) fn set(&mut self, line: Line, on: bool) -> Result<(), Failure> {
        if line == Line::LowSupply {
            self.low_supply = on;
        }
        self.processor.set(line, on)
    }

    /// The processor, for what has no other way.
    pub(crate) fn processor(&mut self) -> &mut Processor {
        &mut self.processor
    }

    /// So many periods go by, whatever the chip does in them: after a bite of the watchdog it begins anew.
    pub(crate) fn go(&mut self, periods: u64) -> Result<(), Failure> {
        let until = self.now + periods * self.period();
        while self.now < until {
            self.step()?;
        }
        Ok(())
    }

    /// Goes on until something is so, for at most so many periods.
    pub(crate) fn until(&mut self, what: &str, periods: u64, is_so: impl Fn(&Self) -> bool) -> Result<(), Failure> {
        let end = self.now + periods * self.period();
        while !is_so(self) {
            if self.now >= end {
                return Err(format!("{what} did not come within {:.0} ms", self.ms(periods * self.period())).into());
            }
            self.step()?;
        }
        Ok(())
    }

    /// The chip's next piece: main's, a period's, or a reset.
    fn step(&mut self) -> Result<(), Failure> {
        match self.state {
            State::Starting => {
                let seen = self.processor.main(STARTING)?;
                self.take(seen)?;
                if self.state == State::Looping {
                    self.begin()?;
                }
                Ok(())
            }
            State::Looping => self.tick(),
            State::Bitten => {
                self.counts.bites += 1;
                self.reset(Reset::Watchdog)
            }
        }
    }

    /// The host begins where the image does.
    fn begin(&mut self) -> Result<(), Failure> {
        let fault = match (self.low_supply, self.watchdog) {
            (true, _) => Some(Fault::Supply),
            (false, true) => Some(Fault::Watchdog),
            (false, false) => None,
        };
        self.host = Some(started(&self.axes, fault)?);
        self.watchdog = false;
        Ok(())
    }

    fn tick(&mut self) -> Result<(), Failure> {
        let unused = 16 - self.chip.adc_bits;
        let codes: Vec<u16> = match self.sensor {
            Sensor::Silent => Vec::new(),
            Sensor::Stuck(code) => vec![code >> unused << unused; self.axes.len()],
            Sensor::Stage => {
                let code = |stage: &Stage| u16::try_from(stage.sample().position_code).unwrap_or(u16::MAX);
                let codes = self.stages.iter().map(code);
                codes.map(|code| code >> unused << unused).collect()
            }
        };
        let instructions = LOOPING * self.axes.len() as u32;
        let latch = self.now + self.latch();
        let period = self.processor.tick(&codes, instructions, self.hold_up)?;
        let words = period.seen.words.clone();
        // An interrupt that hangs writes nothing, and leaves the rest to the watchdog.
        if words.is_empty() {
            self.counts.silent += u32::from(!codes.is_empty());
        } else {
            let around = Around {
                order: period.order,
                rounds: period.rounds,
                late: self.late,
                low_supply: self.low_supply,
            };
            self.compare(&words, period.seen.fault_pin, codes, around);
            self.late = self.hold_up;
            if self.runs() {
                let beside = period.seen.changes.iter().filter(|change| change.cycles != latch);
                self.counts.beside_latch += beside.count() as u32;
            }
        }
        self.take(period.seen)?;
        if self.counts.ticks.is_multiple_of(TELEMETRY_TICKS) {
            self.read_telemetry()?;
        }
        if self.counts.ticks.is_multiple_of(CABLE_TICKS) {
            self.exchange()?;
        }
        Ok(())
    }

    /// Somebody calls by the cable, and asks for samples by UDP.
    pub(crate) fn connect(&mut self) -> Result<(), Failure> {
        let [of_board, of_host] = End::pair();
        let mut host = Listener::new(of_host);
        host.call()?;
        self.cable = Some((host, of_board));
        for _ in 0..500 {
            self.go(u64::from(CABLE_TICKS))?;
            if let Some((host, _)) = &mut self.cable
                && host.is_connected()
            {
                return host.say(&samples_to_packet(SAMPLES_PORT));
            }
        }
        Err("nobody answers on the cable".into())
    }

    /// The cable is pulled.
    pub(crate) fn disconnect(&mut self) {
        self.cable = None;
    }

    /// Frames to and fro, and what came by UDP against the host's.
    fn exchange(&mut self) -> Result<(), Failure> {
        let Some((mut host, end)) = self.cable.take() else {
            return Ok(());
        };
        end.there.borrow_mut().extend(self.processor.frames()?);
        host.poll((1e3 * self.ms(self.now)) as i64);
        for _ in 0..FRAMES_AT_ONCE {
            let frame = end.here.borrow_mut().pop_front();
            let Some(frame) = frame else { break };
            self.processor.frame(&frame)?;
        }
        let mut heard = self.counts.by_cable;
        while let Some(datagram) = host.datagram() {
            heard.hear(&datagram, |sample| self.is_mine(sample));
        }
        self.counts.by_cable = heard;
        self.cable = Some((host, end));
        Ok(())
    }

    /// Whether the host has this frame of that tick, for that code.
    fn is_mine(&self, sample: &Sample) -> bool {
        let mine = self.frames.get(sample.frame.number as usize);
        let mine = mine.and_then(|(frames, codes)| {
            let axis = usize::from(sample.axis);
            Some((frames.get(axis)?.to_bytes(), *codes.get(axis)?))
        });
        mine == Some((sample.frame.to_bytes(), sample.adc))
    }

    fn compare(&mut self, words: &[Word], fault_pin: bool, codes: Vec<u16>, around: Around) {
        let Some(host) = &mut self.host else { return };
        let frames = host.tick(&codes, around);
        let told = words.iter().map(|word| (word.axis, word.code));
        let wanted = frames.iter().enumerate().map(|(axis, frame)| (axis, frame.dac));
        self.counts.ticks += 1;
        let fault = frames.first().is_some_and(|frame| frame.fault().is_some());
        self.counts.different += u32::from(!told.eq(wanted) || fault_pin != fault);
        if around.order != Order::None {
            let number = frames.first().map_or(0, |frame| frame.number);
            self.taken.push((number, around.order));
        }
        self.frames.push((frames, codes));
    }

    /// What the outside saw: the outputs move, and the stages with them.
    fn take(&mut self, seen: Seen) -> Result<(), Failure> {
        let runs = self.mode() == Mode::Running;
        for change in &seen.changes {
            self.step_stages(change.cycles);
            let safe = self.is_safe();
            let output = self
                .outputs
                .get_mut(change.axis)
                .ok_or("an output of an axis that is none")?;
            let step = output.abs_diff(change.code);
            self.way.largest_step = self.way.largest_step.max(step);
            let part = match runs {
                true => &mut self.way.largest_of_law,
                false => &mut self.way.largest_after_law,
            };
            *part = step.max(*part);
            *output = change.code;
            if self.is_safe() != safe {
                self.way.settled = change.cycles;
            }
        }
        self.step_stages(seen.cycles);
        self.state = seen.state;
        self.now = seen.cycles;
        self.unwritten_read |= seen.unwritten_read;
        self.unguarded |= seen.unguarded;
        Ok(())
    }

    /// The stages follow what the outputs hold, a period at a time.
    fn step_stages(&mut self, until: u64) {
        let period = self.period();
        while self.stepped + period <= until {
            self.stepped += period;
            let volts: Vec<f64> = (self.stages.iter().zip(&self.outputs))
                .map(|(stage, &code)| stage.v_from_code(u32::from(code)))
                .collect();
            match (self.stages.as_mut_slice(), volts.as_slice()) {
                ([x, y], &[x_v, y_v]) => {
                    x.step_two_axes(x_v, y_v);
                    y.step_two_axes(y_v, x_v);
                }
                (stages, volts) => {
                    for (stage, &v) in stages.iter_mut().zip(volts) {
                        stage.step(v);
                    }
                }
            }
        }
    }

    /// Every frame that the board has sent is the host's.
    fn read_telemetry(&mut self) -> Result<(), Failure> {
        self.sent.extend(self.processor.telemetry()?);
        let mut at = 0;
        for found in all(&self.sent) {
            match found {
                Found::Sample(sample) => {
                    self.counts.telemetry += 1;
                    self.counts.telemetry_different += u32::from(!self.is_mine(&sample));
                }
                Found::About(_) | Found::Answer | Found::Incomplete => {}
                Found::Order(_) | Found::SamplesTo(_) | Found::Nothing => {
                    return Err("the telemetry holds what is no packet of a board's".into());
                }
            }
            at += found.length();
        }
        self.sent.drain(..at);
        Ok(())
    }
}
