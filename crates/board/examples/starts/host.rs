//! The same application on the host: what the image must answer, tick by tick.

use crate::processor::Failure;
use hysteron_board::Parameters;
use hysteron_core::codes::DacCode;
use hysteron_firmware::axes::Axes;
use hysteron_firmware::controller::Controller;
use hysteron_firmware::kept::ramp_codes;
use hysteron_firmware::law::Complete;
use hysteron_firmware::monitor::Fault;
use hysteron_firmware::trajectory::Shape;
use hysteron_firmware::two_axes::TwoAxes;
use hysteron_firmware::watch::Watch;
use hysteron_firmware::wire::{Frame, Input, Order, Setup};
use hysteron_table::{Table, TableError};

/// What a tick finds beside the sensors' codes.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Around {
    /// What waits for it.
    pub(crate) order: Order,
    /// Main's rounds.
    pub(crate) rounds: u32,
    /// Whether the tick before ended after this one's edge.
    pub(crate) late: bool,
    /// Whether the supply is low.
    pub(crate) low_supply: bool,
}

/// The interrupt's work, of one axis or both.
pub(crate) trait Host: Send {
    /// One tick; a frame an axis.
    fn tick(&mut self, codes: &[u16], around: Around) -> Vec<Frame>;
}

struct Mirror<A, const N: usize> {
    axes: A,
    watch: Watch,
}

impl<A: Axes<N> + Send, const N: usize> Host for Mirror<A, N> {
    fn tick(&mut self, codes: &[u16], around: Around) -> Vec<Frame> {
        self.watch.look(around.rounds, &mut self.axes);
        if around.low_supply {
            self.axes.trip(Fault::Supply);
        }
        let inputs = std::array::from_fn(|axis| Input {
            adc: codes.get(axis).copied().unwrap_or_default(),
            order: around.order,
        });
        self.axes.step(inputs, around.late).to_vec()
    }
}

/// One table, as the image of it has it.
pub(crate) struct Axis {
    table: Table,
    parameters: Parameters<Complete>,
}

impl Axis {
    /// Of a table with a complete law.
    pub(crate) fn new(text: &str) -> Result<Self, TableError> {
        let table = Table::parse(text)?;
        let parameters = hysteron_board::host::complete(&table)?;
        Ok(Self { table, parameters })
    }

    /// The code of the safe level.
    pub(crate) fn safe(&self) -> u16 {
        let DacCode(code) = self.parameters.dac.code(self.parameters.safe_v);
        code
    }

    /// Volts from a code to the next.
    pub(crate) fn volts_a_code(&self) -> f64 {
        (self.table.dac_top_v - self.table.dac_min_v) / 65_535.0
    }

    /// Codes that the ramp goes a sample.
    pub(crate) fn ramp(&self) -> u16 {
        self.codes_a_sample(self.table.ramp_v_per_s)
    }

    /// Codes that the law may go a sample.
    pub(crate) fn slew(&self) -> u16 {
        self.codes_a_sample(self.table.slew_v_per_s)
    }

    fn codes_a_sample(&self, v_per_s: f64) -> u16 {
        let range_v = (self.table.dac_top_v - self.table.dac_min_v) as f32;
        ramp_codes(v_per_s as f32, self.table.sample_rate_hz as f32, range_v)
    }

    /// What the button's runs do: a sine of 10 Hz, 2 % of the range free at either end (`firmware/nucleo/src/main.rs`).
    fn setup(&self) -> Setup {
        let (min_um, max_um) = (self.table.input_min_um as f32, self.table.input_max_um as f32);
        let inset_um = 0.02 * (max_um - min_um);
        Setup {
            ticks: u32::MAX,
            shape: Shape::Sine,
            phase_step: (10.0 / self.table.sample_rate_hz as f32 * 4_294_967_296.0) as u32,
            low_um: min_um + inset_um,
            high_um: max_um - inset_um,
            feedforward: true,
            feedback: true,
            clocked: true,
        }
    }

    fn controller(&self) -> Controller<Complete> {
        Controller::new(self.parameters, &self.setup())
    }
}

/// The application after a start, with what the start has latched.
pub(crate) fn started(axes: &[Axis], fault: Option<Fault>) -> Result<Box<dyn Host>, Failure> {
    fn mirror<A: Axes<N> + Send + 'static, const N: usize>(mut axes: A, fault: Option<Fault>) -> Box<dyn Host> {
        if let Some(fault) = fault {
            axes.trip(fault);
        }
        Box::new(Mirror {
            axes,
            watch: Watch::default(),
        })
    }
    match axes {
        [x] => Ok(mirror(x.controller(), fault)),
        [x, y] => Ok(mirror(TwoAxes::new(x.controller(), y.controller()), fault)),
        other => Err(format!("an image has one axis or two, not {}", other.len()).into()),
    }
}
