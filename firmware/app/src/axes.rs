//! What an image controls: one axis, or both axes of a stage, each with what its tables are and how it begins. An image is made for one
//! of them; all of it that is not here is the same source.

use crate::controller::Controller;
use crate::law::Law;
use crate::monitor::Fault;
use crate::two_axes::TwoAxes;
use crate::wire::{Frame, Input};

/// One tick of `N` axes.
pub trait Axes<const N: usize> {
    /// Total, as [`Controller::step`].
    fn step(&mut self, inputs: [Input; N], late: bool) -> [Frame; N];
    /// Latches a fault of all axes and begins to fall.
    fn trip(&mut self, fault: Fault);
}

impl<L: Law> Axes<1> for Controller<L> {
    #[inline(always)]
    fn step(&mut self, [input]: [Input; 1], late: bool) -> [Frame; 1] {
        [Self::step(self, input, late)]
    }

    fn trip(&mut self, fault: Fault) {
        Self::trip(self, fault);
    }
}

impl<X: Law, Y: Law> Axes<2> for TwoAxes<X, Y> {
    fn step(&mut self, inputs: [Input; 2], late: bool) -> [Frame; 2] {
        Self::step(self, inputs, late)
    }

    fn trip(&mut self, fault: Fault) {
        Self::trip(self, fault);
    }
}

/// The image of one axis.
pub mod one {
    use crate::controller::Controller;
    use crate::kept::ramp_codes;
    use crate::parameters::Parameters;
    use crate::table;
    use crate::telemetry::About;
    use crate::wire::{Hello, Setup};
    use hysteron_core::codes::DacCode;
    use hysteron_core::error::ParamError;

    /// How many.
    pub const AXES: usize = 1;
    /// A description of each of their tables.
    pub type Abouts = [About; table::BANKS];
    /// Their tables, as compiled in.
    pub type Banks = [Parameters<table::Law>; table::BANKS];
    /// What the interrupt steps.
    pub type Control = Controller<table::Law>;

    /// The tables; the build has seen to it that they are none that is refused.
    ///
    /// # Errors
    /// A table that is refused.
    #[inline(always)]
    pub fn banks() -> Result<Banks, ParamError> {
        table::banks()
    }

    /// What there is to say of every table.
    pub fn hellos() -> impl Iterator<Item = Hello> {
        table::hellos().into_iter()
    }

    /// The same, with the converters.
    pub fn abouts(board: &str) -> Abouts {
        About::all(board)
    }

    /// Where the outputs are safe, and the codes that each goes a sample on its way there.
    #[cold]
    pub fn ways_to_safe(banks: &Banks) -> [(DacCode, u16); AXES] {
        let range_v = table::DAC_TOP_V - table::DAC_MIN_V;
        let safe = banks[0].dac.code(banks[0].safe_v);
        [(safe, ramp_codes(table::RAMP_V_PER_S, table::SAMPLE_RATE_HZ, range_v))]
    }

    /// Lowest and highest reference of each first table, micrometres.
    pub fn ranges_um(banks: &Banks) -> [[f32; 2]; AXES] {
        [banks[0].range_um]
    }

    /// At the safe level.
    #[inline(always)]
    pub fn control(banks: &'static Banks, [setup]: &[Setup; AXES]) -> Control {
        Controller::new(banks[0], setup).with_banks(banks)
    }
}

/// The image of both axes.
pub mod two {
    use crate::controller::Controller;
    use crate::kept::ramp_codes;
    use crate::parameters::Parameters;
    use crate::telemetry::About;
    use crate::two_axes::TwoAxes;
    use crate::wire::{Hello, Setup};
    use crate::{table, table_y};
    use hysteron_core::codes::DacCode;
    use hysteron_core::error::ParamError;

    /// How many.
    pub const AXES: usize = 2;
    /// A description of each of their tables.
    pub type Abouts = [About; table::BANKS + table_y::BANKS];
    /// Their tables, as compiled in.
    pub struct Banks {
        x: [Parameters<table::Law>; table::BANKS],
        y: [Parameters<table_y::Law>; table_y::BANKS],
    }
    /// What the interrupt steps.
    pub type Control = TwoAxes<table::Law, table_y::Law>;

    /// As of one axis.
    ///
    /// # Errors
    /// A table that is refused.
    #[inline(always)]
    pub fn banks() -> Result<Banks, ParamError> {
        Ok(Banks {
            x: table::banks()?,
            y: table_y::banks()?,
        })
    }

    /// What there is to say of every table: all of the first axis, then all of the second.
    pub fn hellos() -> impl Iterator<Item = Hello> {
        let all = table::hellos().into_iter().chain(table_y::hellos());
        all.map(|hello| hello.of_both(table::COMPLETE || table_y::COMPLETE))
    }

    /// The same, with the converters.
    pub fn abouts(board: &str) -> Abouts {
        About::of_both(board)
    }

    /// Where the outputs are safe, and the codes that each goes a sample on its way there.
    #[cold]
    pub fn ways_to_safe(banks: &Banks) -> [(DacCode, u16); AXES] {
        let of_x = ramp_codes(
            table::RAMP_V_PER_S,
            table::SAMPLE_RATE_HZ,
            table::DAC_TOP_V - table::DAC_MIN_V,
        );
        let of_y = ramp_codes(
            table_y::RAMP_V_PER_S,
            table_y::SAMPLE_RATE_HZ,
            table_y::DAC_TOP_V - table_y::DAC_MIN_V,
        );
        let (x, y) = (&banks.x[0], &banks.y[0]);
        [(x.dac.code(x.safe_v), of_x), (y.dac.code(y.safe_v), of_y)]
    }

    /// Lowest and highest reference of each first table, micrometres.
    pub fn ranges_um(banks: &Banks) -> [[f32; 2]; AXES] {
        [banks.x[0].range_um, banks.y[0].range_um]
    }

    /// Both at the safe level.
    #[inline(always)]
    pub fn control(banks: &'static Banks, [x, y]: &[Setup; AXES]) -> Control {
        TwoAxes::new(
            Controller::new(banks.x[0], x).with_banks(&banks.x),
            Controller::new(banks.y[0], y).with_banks(&banks.y),
        )
    }
}
