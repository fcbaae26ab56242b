//! Main that hangs: the command comes down first, then the watchdog is left alone.

use hysteron_firmware::axes::Axes;
use hysteron_firmware::axes::one;
use hysteron_firmware::monitor::Fault;
use hysteron_firmware::small_stage::SmallStage;
use hysteron_firmware::trajectory::Shape;
use hysteron_firmware::watch::{MAIN_TICKS, Watch};
use hysteron_firmware::wire::{Frame, Input, Mode, Order, Setup};

/// One axis with the built-in table on a small stage, and whether its last tick fed the watchdog.
struct Run {
    watch: Watch,
    axes: one::Control,
    stage: SmallStage,
    fed: bool,
}

impl Run {
    fn new() -> Self {
        let banks: &'static one::Banks = Box::leak(Box::new(one::banks().unwrap()));
        let setup = Setup {
            ticks: u32::MAX,
            shape: Shape::Sine,
            // 10 Hz at 50 kHz.
            phase_step: 858_993,
            low_um: 1.5,
            high_um: 2.0,
            feedforward: true,
            feedback: false,
            clocked: true,
        };
        Self {
            watch: Watch::default(),
            axes: one::control(banks, &[setup]),
            stage: SmallStage::new(&banks[0], 1),
            fed: true,
        }
    }

    /// As the board's interrupt does it.
    fn tick(&mut self, k: u32, round: u32, order: Order) -> Frame {
        self.watch.look(round, &mut self.axes);
        let adc = self.stage.input(k, u32::MAX).adc;
        let [frame] = Axes::step(&mut self.axes, [Input { adc, order }], false);
        self.stage.output(frame.dac);
        self.fed = self.watch.feeds(frame.mode() == Mode::Off);
        frame
    }
}

/// One round in `MAIN_TICKS` is enough, and the count may wrap.
#[test]
fn bva_a_slow_main_is_let_go_on() {
    let mut run = Run::new();
    for k in 0..6 * MAIN_TICKS {
        let round = (u32::MAX - 2).wrapping_add(k / MAIN_TICKS);
        let frame = run.tick(k, round, Order::None);
        assert_eq!((frame.fault(), run.fed), (None, true), "tick {k}");
    }
}

/// At the safe level there is nothing to bring down: the fault and the end of the feeding are of one tick.
#[test]
fn val_a_main_that_hangs_at_rest_is_reset() {
    let mut run = Run::new();
    for k in 0..MAIN_TICKS - 1 {
        run.tick(k, 0, Order::None);
        assert!(run.fed, "tick {k}");
    }
    let frame = run.tick(MAIN_TICKS - 1, 0, Order::None);
    assert_eq!((frame.fault(), run.fed), (Some(Fault::Watchdog), false));
}

/// The loop runs; main makes its last round on the tick of the start. The way down takes at most 20 ms, and no step of it is more than
/// the table's ramp of 0.2 V a sample.
#[test]
fn val_a_main_that_hangs_while_the_loop_runs_ends_safe() {
    let mut run = Run::new();
    let mut before = run.tick(0, 1, Order::Start);
    let mut highest_v = 0.0_f32;
    for k in 1..MAIN_TICKS {
        before = run.tick(k, 1, Order::None);
        highest_v = highest_v.max(before.command_v);
        assert_eq!((before.fault(), run.fed), (None, true), "tick {k}");
    }
    assert_eq!(before.mode(), Mode::Running);
    assert!(highest_v > 10.0, "{highest_v} V");
    for k in 0..=1000 {
        let frame = run.tick(MAIN_TICKS + k, 1, Order::None);
        assert_eq!(frame.fault(), Some(Fault::Watchdog));
        assert!(before.command_v - frame.command_v < 0.2001, "tick {k}");
        assert_eq!(run.fed, frame.mode() != Mode::Off, "tick {k}");
        before = frame;
    }
    assert_eq!((before.mode(), before.command_v, run.fed), (Mode::Off, 0.0, false));
}

/// Main was only slow: what is latched stays, and the chip is not reset.
#[test]
fn val_a_main_that_comes_back_is_not_reset() {
    let mut run = Run::new();
    for k in 0..MAIN_TICKS {
        run.tick(k, 0, Order::None);
    }
    let frame = run.tick(MAIN_TICKS, 1, Order::Clear);
    assert_eq!((frame.fault(), run.fed), (Some(Fault::Watchdog), true));
}
