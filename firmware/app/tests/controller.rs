//! The controller around a law of three lines: what it does on each order and fault, by literal numbers.

use hysteron_core::codes::Converter;
use hysteron_core::limiter::Limiter;
use hysteron_core::pi_controller::PiController;
use hysteron_firmware::controller::{Beside, Controller};
use hysteron_firmware::law::{Law, Now, Start, Step};
use hysteron_firmware::monitor::{Fault, Scales};
use hysteron_firmware::parameters::Parameters;
use hysteron_firmware::trajectory::Shape;
use hysteron_firmware::wire::{ACCEPTED, Frame, Input, LIMITED, Mode, Order, REFUSED, Setup};

/// 10 V a micrometre. Gains of a micrometre tell how often the law was started, parts what was set.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Lines {
    v_per_um: f32,
    parts: [bool; 2],
    weight: f32,
    gains: Option<PiController<f32>>,
    departure_v: f32,
    comes_down: bool,
    rest_um: f32,
    /// Stays with the table: what only a start needs.
    own: u32,
}

/// What the law has been through.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Seen {
    command_v: f32,
    first_um: f32,
    measured_um: f32,
    share: f32,
    starts: u32,
    restarts: u32,
    followed: u32,
    held_over: u32,
    own_of_table: u32,
}

impl Law for Lines {
    type State = Seen;

    fn set_parts(&mut self, feedforward: bool, feedback: bool, weight: f32) {
        (self.parts, self.weight) = ([feedforward, feedback], weight);
    }

    fn set_gains(&mut self, gains: PiController<f32>) {
        self.gains = Some(gains);
    }

    fn adopt(&mut self, other: &Self) {
        *self = Self {
            own: self.own,
            ..*other
        };
    }

    fn start(&self, start: &Start, table: &Self) -> Seen {
        Seen {
            command_v: start.command_v,
            first_um: start.first_um,
            measured_um: start.measured_um,
            share: 0.0,
            starts: 1,
            restarts: 0,
            followed: 0,
            held_over: 0,
            own_of_table: table.own,
        }
    }

    fn restart(&self, state: &mut Seen, start: &Start) {
        state.restarts += 1;
        state.command_v = start.command_v;
        state.first_um = start.first_um;
    }

    fn follow(&self, state: &mut Seen, share: f32, command_v: f32, _: Now) {
        state.followed += 1;
        (state.share, state.command_v) = (share, command_v);
    }

    fn hold_reading_over(&self, state: &mut Seen) {
        state.held_over += 1;
    }

    fn comes_down_itself(&self) -> bool {
        self.comes_down
    }

    fn expected_um(&self, _: &Seen, coming_um: f32) -> f32 {
        coming_um
    }

    fn rise(&self, state: &mut Seen, ramp: &Limiter<f32>, now: Now) -> (Step, bool) {
        let mut limiter = ramp.start_at(state.command_v);
        state.command_v = ramp.step(&mut limiter, self.v_per_um * state.first_um);
        state.measured_um = now.measured_um;
        let step = Step {
            reference_um: state.first_um,
            command_v: state.command_v,
            limited: limiter.limited(),
            departure_v: self.departure_v,
        };
        (step, !limiter.limited())
    }

    fn run(&self, state: &mut Seen, trajectory_um: f32, now: Now) -> Step {
        state.command_v = self.v_per_um * trajectory_um;
        state.measured_um = now.measured_um;
        Step {
            reference_um: trajectory_um,
            command_v: state.command_v,
            limited: false,
            departure_v: self.departure_v,
        }
    }

    fn coming_um(&self, state: &Seen) -> f32 {
        state.first_um
    }

    fn rest_um(&self) -> f32 {
        self.rest_um
    }
}

const LINES: Lines = Lines {
    v_per_um: 10.0,
    parts: [false; 2],
    weight: 0.0,
    gains: None,
    departure_v: 0.0,
    comes_down: false,
    rest_um: 0.0,
    own: 0,
};

/// 0 to 10 um, 0 to 100 V, safe at 5 V, 0.5 V a sample on the ramp; a code of the sensor is 1 nm less 10 um.
fn parameters(law: Lines) -> Parameters<Lines> {
    Parameters {
        law,
        ramp: Limiter::new(0.0, 100.0, 25e3, 50e3).unwrap(),
        rise_um: 0.05,
        scales: Scales {
            range_um: 10.0,
            um_per_code: 1e-3,
            slopes_v_per_um: [10.0, 10.0],
            span_v: 100.0,
            departure_v: 4.0,
            overshoot: 2.0,
        },
        dac: Converter::new(0.0, 131.07).unwrap(),
        adc: Converter::new(-10.0, 55.535).unwrap(),
        range_um: [0.0, 10.0],
        sample_rate_hz: 50e3,
        feedback_up_to_hz: 100.0,
        safe_v: 5.0,
    }
}

/// A triangle between 2 and 4 um, of 1000 ticks.
const SETUP: Setup = Setup {
    ticks: u32::MAX,
    shape: Shape::Triangle,
    phase_step: 4_294_967,
    low_um: 2.0,
    high_um: 4.0,
    feedforward: true,
    feedback: true,
    clocked: true,
};

fn code(position_um: f32) -> u16 {
    ((position_um + 10.0) * 1000.0).round() as u16
}

/// The controller with a platform that is where the last command puts it, and what the sensor makes of that.
struct Rig {
    controller: Controller<Lines>,
    command_v: f32,
}

impl Rig {
    fn new(law: Lines) -> Self {
        Self {
            controller: Controller::new(parameters(law), &SETUP),
            command_v: 5.0,
        }
    }

    fn order(&mut self, order: Order) -> Frame {
        self.reading(order, |um| um)
    }

    fn reading(&mut self, order: Order, sensor: impl Fn(f32) -> f32) -> Frame {
        let input = Input {
            adc: code(sensor(self.command_v / 10.0)),
            order,
        };
        let frame = self.controller.step(input, false);
        self.command_v = frame.command_v;
        frame
    }

    fn ticks(&mut self, ticks: u32) -> Frame {
        (0..ticks).map(|_| self.order(Order::None)).last().unwrap()
    }

    fn running() -> Self {
        let mut rig = Self::new(LINES);
        rig.order(Order::Start);
        rig.ticks(60);
        rig
    }
}

/// From 5 V to the 20 V of 2 um: 30 ticks of 0.5 V, and one that is not limited any more.
#[test]
fn val_rises_runs_falls_and_rests() {
    let mut rig = Rig::new(LINES);
    assert_eq!(rig.ticks(3).mode(), Mode::Off);
    assert_eq!(rig.command_v, 5.0);
    let first = rig.order(Order::Start);
    assert_eq!(
        (first.mode(), first.command_v, first.reference_um),
        (Mode::Rising, 5.5, 2.0)
    );
    let last_limited = rig.ticks(28);
    assert_eq!((last_limited.mode(), last_limited.command_v), (Mode::Rising, 19.5));
    assert_ne!(last_limited.flags & LIMITED, 0);
    let there = rig.ticks(1);
    assert_eq!((there.mode(), there.command_v), (Mode::Running, 20.0));
    assert_eq!(there.flags & LIMITED, 0);
    let run = rig.ticks(501);
    assert_eq!(run.mode(), Mode::Running);
    assert!(
        (run.reference_um - 4.0).abs() < 0.005 && (run.command_v - 40.0).abs() < 0.05,
        "{run:?}"
    );
    assert_eq!(run.dac, (run.command_v / 0.002).round() as u16);
    // 70 ticks of 0.5 V from 40 V, of a stop on the first of them.
    let top_v = run.command_v;
    let falling = rig.order(Order::Stop);
    assert_eq!(falling.mode(), Mode::Falling);
    assert!((falling.command_v - (top_v - 0.5)).abs() < 1e-4);
    let off = rig.ticks(((top_v - 5.0) / 0.5) as u32 + 1);
    assert_eq!((off.mode(), off.command_v, off.fault()), (Mode::Off, 5.0, None));
    assert_eq!(rig.ticks(100).command_v, 5.0);
}

/// A fault is latched, the first one stays, the command comes down on the ramp; neither a start nor a clear on the way counts.
#[test]
fn val_a_fault_is_latched() {
    let mut rig = Rig::running();
    let before_v = rig.command_v;
    // The sensor at an end of its range.
    let found: Vec<_> = (0..5).map(|_| rig.reading(Order::None, |_| -10.0)).collect();
    let faults: Vec<_> = found.iter().map(|frame| frame.fault()).collect();
    let range = Some(Fault::SensorRange);
    assert_eq!(faults, [None, None, range, range, range]);
    assert_eq!(found[2].mode(), Mode::Falling);
    assert!(found[2].command_v < found[1].command_v && found[1].command_v < before_v + 0.2);
    rig.controller.trip(Fault::Overrun);
    for order in [Order::Start, Order::Clear, Order::Start] {
        let frame = rig.order(order);
        assert_eq!((frame.fault(), frame.mode()), (range, Mode::Falling), "{order:?}");
    }
    let off = rig.ticks(100);
    assert_eq!((off.mode(), off.command_v, off.fault()), (Mode::Off, 5.0, range));
    assert_eq!(rig.order(Order::Start).mode(), Mode::Off);
    assert_eq!(rig.order(Order::Clear).fault(), None);
    assert_eq!(rig.order(Order::Start).mode(), Mode::Rising);
}

/// A law that can stop a platform does: its reference shrinks to the rest over 1000 ticks, with the trajectory in it, and a sensor in doubt
/// is not asked; where the clock or the stage is in doubt, it is the ramp.
#[test]
fn val_a_law_may_come_down_itself() {
    let law = Lines {
        comes_down: true,
        ..LINES
    };
    let begun = || {
        let mut rig = Rig::new(law);
        rig.order(Order::Start);
        rig.ticks(360);
        rig
    };
    let mut rig = begun();
    let at_um = rig.command_v / 10.0;
    let first = rig.order(Order::Stop);
    assert_eq!(first.mode(), Mode::Falling);
    assert!((first.reference_um - at_um - 0.004).abs() < 1e-4, "{first:?}");
    // Half of the time is half of the way: the triangle is 500 ticks further, as far from its other end.
    let half = rig.ticks(500);
    let triangle_um = 6.0 - at_um;
    assert!(
        (half.reference_um - 0.5 * triangle_um).abs() < 0.02,
        "{half:?} {triangle_um}"
    );
    assert!((half.command_v - 10.0 * half.reference_um).abs() < 1e-4);
    let last = rig.ticks(499);
    assert!(last.mode() == Mode::Falling && last.command_v.abs() < 0.01, "{last:?}");
    // From below the safe level up to it.
    let off = rig.ticks(12);
    assert_eq!((off.mode(), off.command_v), (Mode::Off, 5.0));
    let measured = |rig: &Rig| format!("{:?}", rig.controller).contains("measured_um: NaN");
    let mut rig = begun();
    for _ in 0..3 {
        rig.reading(Order::None, |_| -10.0);
    }
    assert!(measured(&rig));
    assert_eq!(rig.ticks(500).fault(), Some(Fault::SensorRange));
    assert!((rig.command_v - 0.5 * 10.0 * triangle_um).abs() < 0.5);
    let mut rig = begun();
    let before_v = rig.command_v;
    rig.controller.trip(Fault::Overrun);
    assert!(!measured(&rig));
    assert!((rig.ticks(10).command_v - (before_v - 5.0)).abs() < 1e-3);
}

/// A hung interrupt may hang again.
#[test]
fn val_only_a_reset_clears_the_watchdog() {
    let mut rig = Rig::running();
    rig.controller.trip(Fault::Watchdog);
    assert_eq!(rig.ticks(200).mode(), Mode::Off);
    assert_eq!(rig.order(Order::Clear).fault(), Some(Fault::Watchdog));
    assert_eq!(rig.order(Order::Start).mode(), Mode::Off);
}

/// The law gets what the last good reading leads to, not the bad one; and a good one as it is.
#[test]
fn val_bad_readings_do_not_reach_the_law() {
    let mut rig = Rig::running();
    let state = |rig: &Rig| format!("{:?}", rig.controller);
    let frame = rig.reading(Order::None, |um| um + 2.0);
    assert_eq!(frame.fault(), None);
    let measured = |text: &str| -> f32 {
        let at = text.find("measured_um: ").unwrap() + 13;
        let end = text[at..].find(',').unwrap() + at;
        text[at..end].parse().unwrap()
    };
    assert!(
        (measured(&state(&rig)) - frame.reference_um).abs() < 0.05,
        "{}",
        state(&rig)
    );
    let frame = rig.reading(Order::None, |um| um + 0.02);
    assert_eq!(frame.fault(), None);
    // A tick ago, 0.004 um each, and 0.02.
    assert!((measured(&state(&rig)) - frame.reference_um - 0.016).abs() < 0.002);
}

/// The law is told of each reading that is held over, and of no other.
#[test]
fn bva_the_law_is_told_of_readings_that_are_held_over() {
    let mut rig = Rig::running();
    let told = |rig: &Rig| -> u32 {
        let text = format!("{:?}", rig.controller);
        let (_, after) = text.split_once("held_over: ").unwrap();
        after
            .chars()
            .take_while(char::is_ascii_digit)
            .collect::<String>()
            .parse()
            .unwrap()
    };
    assert_eq!(told(&rig), 0);
    for (off_um, count) in [(2.0, 1), (0.0, 1), (0.02, 1), (2.0, 2), (-2.0, 3), (0.0, 3)] {
        assert_eq!(rig.reading(Order::None, |um| um + off_um).fault(), None);
        assert_eq!(told(&rig), count, "{off_um} um off");
    }
}

/// Three in a row of the clock; what a law departs by, running and rising alike.
#[test]
fn val_clock_and_departure_trip() {
    let mut rig = Rig::running();
    let mut late = |late| {
        let adc = code(rig.command_v / 10.0);
        let frame = rig.controller.step(
            Input {
                adc,
                order: Order::None,
            },
            late,
        );
        rig.command_v = frame.command_v;
        frame.fault()
    };
    assert_eq!([true, true, true].map(&mut late), [None, None, Some(Fault::Overrun)]);
    let mut rig = Rig::new(Lines {
        departure_v: 4.1,
        ..LINES
    });
    assert_eq!(rig.order(Order::Start).fault(), None);
    let frame = rig.ticks(2);
    assert_eq!(frame.fault(), Some(Fault::Disagreement));
    // Three steps up, and down again: 1.5 V of a platform that is not where it should be.
    assert_eq!((frame.mode(), frame.command_v), (Mode::Falling, 6.5));
    assert_eq!(rig.ticks(4).command_v, 5.0);
}

/// Beside another axis that is 2 um from its rest, a tenth of which is 2 V: 6 V of departure and not 4.
#[test]
fn bva_departures_beside_another_axis() {
    for (away_um, departure_v, fault) in [
        (2.0, 5.9, None),
        (-2.0, -5.9, None),
        (2.0, 6.1, Some(Fault::Disagreement)),
        (0.0, 4.1, Some(Fault::Disagreement)),
    ] {
        let mut rig = Rig::new(Lines { departure_v, ..LINES });
        rig.controller.set_beside(Beside {
            away_um,
            ..Beside::default()
        });
        rig.order(Order::Start);
        let rising = rig.ticks(2);
        let running = rig.ticks(60);
        assert_eq!(
            [rising, running].map(|frame| frame.fault()),
            [fault; 2],
            "{away_um} {departure_v}"
        );
    }
}

/// What another axis is told: where this one is on the trajectory and was on the tick before, from 0 on where the law has its rest.
#[test]
fn val_what_another_axis_is_told() {
    let mut rig = Rig::new(LINES);
    assert_eq!(
        rig.controller.beside(),
        Beside {
            command_v: 5.0,
            ..Beside::default()
        }
    );
    rig.order(Order::Start);
    rig.ticks(60);
    let (told, frame) = (rig.controller.beside(), rig.ticks(1));
    assert_eq!(told.coming_um, frame.reference_um);
    // The triangle's 2 um in 500 ticks.
    assert!((told.away_um - (told.coming_um - 0.004)).abs() < 1e-5, "{told:?}");
    assert!((told.command_v - 10.0 * told.away_um).abs() < 1e-4, "{told:?}");
}

/// A stage that rests at 0.5 um, on the way to 2 um, at 2 um of the triangle's beginning and on: another axis is told of what is above the
/// rest. On a plain ramp down it is told of nothing, since the law takes nothing in.
#[test]
fn val_another_axis_is_told_of_what_is_above_the_rest() {
    let rest_um = 0.5;
    let mut rig = Rig::new(Lines { rest_um, ..LINES });
    rig.order(Order::Start);
    assert_eq!(rig.ticks(9).mode(), Mode::Rising);
    assert_eq!(rig.controller.beside().coming_um, 1.5);
    rig.ticks(60);
    let (told, frame) = (rig.controller.beside(), rig.ticks(1));
    assert_eq!(frame.mode(), Mode::Running);
    assert_eq!(told.coming_um, frame.reference_um - 0.5);
    assert!((told.away_um - (told.coming_um - 0.004)).abs() < 1e-5, "{told:?}");
    let frame = rig.order(Order::Stop);
    assert_eq!(frame.mode(), Mode::Falling);
    assert_eq!(rig.controller.beside().coming_um, 0.0);
    // One that comes down along its reference takes it in: half of the way from about 2.2 um to the rest after 500 of 1000 ticks.
    let comes_down = true;
    let mut rig = Rig::new(Lines {
        rest_um,
        comes_down,
        ..LINES
    });
    rig.order(Order::Start);
    rig.ticks(60);
    rig.order(Order::Stop);
    let frame = rig.ticks(499);
    assert_eq!(frame.mode(), Mode::Falling);
    assert_eq!(rig.controller.beside().coming_um, frame.reference_um - 0.5);
    assert!(frame.reference_um > 0.9, "{frame:?}");
}

/// After a change of table its state is made on the first tick without an order, or on the one that starts.
#[test]
fn val_a_tables_state_is_made_before_the_start() {
    use hysteron_firmware::tuning::Change;
    let banks: &'static [Parameters<Lines>] = Box::leak(Box::new([parameters(LINES); 2]));
    for idle in [0, 1, 7] {
        let mut rig = Rig::new(LINES);
        rig.controller = Controller::new(banks[0], &SETUP).with_banks(banks);
        let restarts = |rig: &Rig, n: u32| format!("{:?}", rig.controller).contains(&format!("restarts: {n},"));
        rig.order(Order::Start);
        rig.order(Order::Stop);
        rig.ticks(10);
        assert!(restarts(&rig, 1));
        for order in Change::Bank(1).orders() {
            rig.order(order);
        }
        assert!(restarts(&rig, 1));
        if idle > 0 {
            rig.ticks(idle);
            assert!(restarts(&rig, 0));
        }
        let first = rig.order(Order::Start);
        assert!(restarts(&rig, 1));
        assert_eq!((first.mode(), first.command_v, first.bank()), (Mode::Rising, 5.5, 1));
    }
}

/// The law's state is made once, before the first start, and goes along on the way down and at rest; share by share.
#[test]
fn val_the_state_is_kept() {
    let mut rig = Rig::running();
    let text = |rig: &Rig| format!("{:?}", rig.controller);
    assert!(text(&rig).contains("starts: 1, restarts: 1, followed: 0"));
    rig.order(Order::Stop);
    let share = |text: &str| -> f32 {
        let at = text.find("share: ").unwrap() + 7;
        let end = text[at..].find(',').unwrap() + at;
        text[at..end].parse().unwrap()
    };
    let way_v = rig.command_v + 0.5 - 5.0;
    assert!((share(&text(&rig)) - (rig.command_v - 5.0) / way_v).abs() < 1e-5);
    rig.ticks(200);
    assert_eq!(share(&text(&rig)), 0.0);
    assert!(
        text(&rig).contains("starts: 1, restarts: 1, followed: 201"),
        "{}",
        text(&rig)
    );
    rig.order(Order::Start);
    assert!(text(&rig).contains("starts: 1, restarts: 2, followed: 201"));
}

/// A change is in force or refused, in the frame of its tick; all but gains at the safe level alone.
#[test]
fn bva_changes() {
    use hysteron_firmware::tuning::Change;
    let with = |rig: &mut Rig, change: Change| {
        let mut last = None;
        for order in change.orders() {
            last = Some(rig.order(order));
        }
        let flags = last.unwrap().flags & (ACCEPTED | REFUSED);
        assert!(flags == ACCEPTED || flags == REFUSED);
        flags == ACCEPTED
    };
    let trajectory = |low_um, high_um, phase_step| Change::Trajectory {
        shape: Shape::Sine,
        phase_step,
        low_um,
        high_um,
    };
    let tenth = u32::MAX / 10;
    let cases = [
        (trajectory(0.0, 10.0, 1000), true),
        (trajectory(-0.1, 10.0, 1000), false),
        (trajectory(0.0, 10.1, 1000), false),
        (trajectory(5.0, 5.0, 1000), false),
        (trajectory(6.0, 5.0, 1000), false),
        (trajectory(f32::NAN, 5.0, 1000), false),
        (trajectory(0.0, 5.0, tenth), true),
        (trajectory(0.0, 5.0, tenth + 1), false),
        (
            Change::Parts {
                feedforward: true,
                feedback: false,
            },
            true,
        ),
        (Change::Bank(0), false),
        (
            Change::Gains {
                proportional_v_per_um: 1.0,
                integral_v_per_um_s: 100.0,
            },
            true,
        ),
        (
            Change::Gains {
                proportional_v_per_um: -1.0,
                integral_v_per_um_s: 100.0,
            },
            false,
        ),
    ];
    for (change, accepted) in cases {
        assert_eq!(with(&mut Rig::new(LINES), change), accepted, "{change:?}");
        let gains = matches!(change, Change::Gains { .. });
        assert_eq!(
            with(&mut Rig::running(), change),
            accepted && gains,
            "running, {change:?}"
        );
    }
}

/// The order whose frame answers a change, at the safe level.
fn change(rig: &mut Rig, change: hysteron_firmware::tuning::Change) -> u16 {
    let last = change.orders().map(|order| rig.order(order)).last();
    last.unwrap().flags & (ACCEPTED | REFUSED)
}

/// The references of the first ticks of a run, of every 125th.
fn eighths(rig: &mut Rig) -> [f32; 8] {
    rig.order(Order::Start);
    // At most the 100 V, 0.5 V a tick.
    let running = (0..200).find(|_| rig.order(Order::None).mode() == Mode::Running);
    assert!(running.is_some());
    std::array::from_fn(|_| {
        let reference_um = rig.ticks(1).reference_um;
        rig.ticks(124);
        reference_um
    })
}

fn assert_close(found: [f32; 8], wanted: [f32; 8]) {
    for (found_um, wanted_um) in found.into_iter().zip(wanted) {
        assert!((found_um - wanted_um).abs() < 0.01, "{found:?} instead of {wanted:?}");
    }
}

/// A sine from 1 to 5 um of 1000 ticks: `3 - 2 cos`. The first triangle was from 2 to 4.
#[test]
fn val_a_changed_trajectory_runs() {
    use hysteron_firmware::tuning::Change;
    let triangle = [2.0, 2.5, 3.0, 3.5, 4.0, 3.5, 3.0, 2.5];
    assert_close(eighths(&mut Rig::new(LINES)), triangle);
    let mut rig = Rig::new(LINES);
    let sine = Change::Trajectory {
        shape: Shape::Sine,
        phase_step: 4_294_967,
        low_um: 1.0,
        high_um: 5.0,
    };
    assert_eq!(change(&mut rig, sine), ACCEPTED);
    let wanted = [1.0, 1.5858, 3.0, 4.4142, 5.0, 4.4142, 3.0, 1.5858];
    assert_close(eighths(&mut rig), wanted);
    // Twice as fast.
    let mut rig = Rig::new(LINES);
    let faster = Change::Trajectory {
        shape: Shape::Triangle,
        phase_step: 8_589_935,
        low_um: 2.0,
        high_um: 4.0,
    };
    assert_eq!(change(&mut rig, faster), ACCEPTED);
    assert_close(eighths(&mut rig), [2.0, 3.0, 4.0, 3.0, 2.0, 3.0, 4.0, 3.0]);
}

#[test]
fn val_changed_parts_are_in_the_law() {
    use hysteron_firmware::tuning::Change;
    for (feedforward, feedback) in [(true, false), (false, true), (false, false), (true, true)] {
        let mut rig = Rig::new(LINES);
        assert_eq!(change(&mut rig, Change::Parts { feedforward, feedback }), ACCEPTED);
        let text = format!("{:?}", rig.controller);
        assert!(text.contains(&format!("parts: [{feedforward}, {feedback}]")), "{text}");
    }
}

/// Points of a reference: taken at the safe level and where there is a place for them, and the reference begins with the first of them.
#[test]
fn bva_points_of_a_reference() {
    use hysteron_firmware::tuning::Change;
    let points = |chunk| Change::Chunk {
        chunk,
        shares: [u16::MAX; hysteron_firmware::trajectory::CHUNK_POINTS],
    };
    assert_eq!(change(&mut Rig::running(), points(0)), REFUSED);
    let mut rig = Rig::new(LINES);
    assert_eq!(change(&mut rig, points(255)), REFUSED);
    let table = Change::Trajectory {
        shape: Shape::Table,
        phase_step: 4_294_967,
        low_um: 2.0,
        high_um: 4.0,
    };
    assert_eq!(change(&mut rig, table), ACCEPTED);
    assert_eq!(rig.ticks(1).reference_um, 2.0);
    assert_eq!(change(&mut rig, points(0)), ACCEPTED);
    assert!((rig.ticks(1).reference_um - 4.0).abs() < 1e-3);
}

/// Table 1 is not taken where the reference, up to 4 um, leaves its range; table 2 is, and its state is made with what only it has.
#[test]
fn bva_a_bank_whose_range_the_reference_leaves() {
    use hysteron_firmware::tuning::Change;
    let of = |highest_um, own| Parameters {
        range_um: [0.0, highest_um],
        ..parameters(Lines { own, ..LINES })
    };
    let banks: &'static [Parameters<Lines>] = Box::leak(Box::new([of(10.0, 0), of(3.9, 7), of(4.0, 9)]));
    for (bank, answer, selected, own) in [(1, REFUSED, 0, 0), (2, ACCEPTED, 2, 9), (3, REFUSED, 0, 0)] {
        let mut rig = Rig::new(LINES);
        rig.controller = Controller::new(banks[0], &SETUP).with_banks(banks);
        assert_eq!(change(&mut rig, Change::Bank(bank)), answer, "{bank}");
        assert_eq!(rig.ticks(1).bank(), selected);
        let text = format!("{:?}", rig.controller);
        assert!(text.contains(&format!("own_of_table: {own} ")), "{bank}: {text}");
    }
}

/// Another table is what runs from then on, 20 V a micrometre in place of 10, and none is taken while the loop runs.
#[test]
fn val_a_bank_that_is_selected_runs() {
    use hysteron_firmware::tuning::Change;
    let of = |v_per_um| parameters(Lines { v_per_um, ..LINES });
    let banks: &'static [Parameters<Lines>] = Box::leak(Box::new([of(10.0), of(20.0)]));
    for (bank, volts) in [(0, 20.0), (1, 40.0)] {
        let mut rig = Rig::new(LINES);
        rig.controller = Controller::new(banks[0], &SETUP).with_banks(banks);
        assert_eq!(change(&mut rig, Change::Bank(bank)), ACCEPTED);
        rig.order(Order::Start);
        let frame = (0..200)
            .map(|_| rig.order(Order::None))
            .find(|frame| frame.mode() == Mode::Running);
        assert_eq!(frame.map(|frame| frame.command_v), Some(volts), "{bank}");
        assert_eq!(change(&mut rig, Change::Bank(1 - bank)), REFUSED);
        assert_eq!(rig.ticks(1).bank(), bank);
    }
}

/// The fault is to be had without a frame, too.
#[test]
fn val_the_latched_fault() {
    let mut rig = Rig::running();
    assert_eq!(rig.controller.fault(), None);
    rig.controller.trip(Fault::Supply);
    assert_eq!(rig.controller.fault(), Some(Fault::Supply));
}

/// Stopped on the way up, a law that comes down itself does so from the first value, 2 um, and the trajectory waits: half of the way to the
/// rest after 500 ticks.
#[test]
fn val_stopped_on_the_way_up() {
    for (rest_um, half_um) in [(0.0, 1.0), (0.5, 1.25)] {
        let mut rig = Rig::new(Lines {
            comes_down: true,
            rest_um,
            ..LINES
        });
        rig.order(Order::Start);
        assert_eq!(rig.ticks(9).mode(), Mode::Rising);
        assert_eq!(rig.order(Order::Stop).reference_um, 2.0);
        let half = rig.ticks(500);
        assert_eq!((half.mode(), half.reference_um), (Mode::Falling, half_um));
    }
}

/// Feedback is whole up to a frequency, here 100 Hz, half at half as much again, none from twice it; 10 Hz is 859 993 steps of a phase.
#[test]
fn bva_the_feedbacks_share() {
    for (hz, weight) in [(10.0, 1.9), (100.0, 1.0), (150.0, 0.5), (200.0, 0.0), (400.0, -2.0)] {
        let phase_step = (hz / 50e3 * 4_294_967_296.0_f64).round() as u32;
        let setup = Setup { phase_step, ..SETUP };
        let controller = Controller::new(parameters(LINES), &setup);
        let text = format!("{controller:?}");
        let at = text.find("weight: ").unwrap() + 8;
        let end = text[at..].find(',').unwrap() + at;
        let found: f32 = text[at..end].parse().unwrap();
        assert!((found - weight).abs() < 1e-3, "{hz}: {found}");
        assert!(text.contains("parts: [true, true]"));
    }
}

/// Whatever comes, and in whatever order: within the limits, and never faster than the ramp but while the law runs.
#[test]
fn prop_total() {
    let mut rig = Rig::new(LINES);
    let mut seed = 1_u32;
    let mut last_v = 5.0_f32;
    for _ in 0..200_000 {
        seed = seed.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        let order = match seed >> 22 {
            0..40 => Order::Start,
            40..44 => Order::Stop,
            44..60 => Order::Clear,
            60..70 => Order::Apply((seed >> 8) as u8),
            70..90 => Order::Byte((seed >> 8) as u8),
            _ => Order::None,
        };
        let wild = seed >> 28 == 0;
        let adc = if wild {
            (seed >> 4) as u16
        } else {
            code(rig.command_v / 10.0)
        };
        let frame = rig.controller.step(Input { adc, order }, seed >> 30 == 3);
        assert!((0.0..=100.0).contains(&frame.command_v));
        let most_v = if frame.mode() == Mode::Running {
            100.0
        } else {
            0.5 + 1e-4
        };
        assert!((frame.command_v - last_v).abs() <= most_v, "{frame:?}");
        (rig.command_v, last_v) = (frame.command_v, frame.command_v);
    }
}
