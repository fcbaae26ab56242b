//! The starts and faults: what happens, and how it must end.

use crate::processor::{Failure, Hang, Line, Reset};
use crate::rig::{Rig, Sensor};
use hysteron_board::{Fault, Mode};
use hysteron_firmware::chips::H743;
use hysteron_firmware::telemetry::order_packet;
use hysteron_firmware::wire::Order;

/// Volts at the stack from which on an output counts as high.
const HIGH_V: f64 = 87.0;
/// What a start may take before the way down: clocks, converters' calibration and tables (`firmware/app/src/chips.rs`).
const START_MS: f64 = 20.0;
/// The same on the oscillator that a reset starts: down to a tenth of the processor's clock.
const SLOW_START_MS: f64 = 40.0;
/// The ramp over the whole range, and a fall along the reference, as `hysteron export` and the controller have them.
const RAMP_MS: f64 = 20.0;
/// Without a tick, until the watchdog resets the chip.
const WATCHDOG_MS: f64 = 2.0;
/// Main's silence until a fault is latched.
const HUNG_MS: f64 = 100.0;
/// Where the cycle counter stands still, a wait of a sample counts looks at it instead of cycles; a look takes ten cycles at most.
const LOCKED: f64 = 10.0;
/// Periods of a press: steady for more than 10 ms.
const PRESS: u64 = 520;

/// How a scenario has to end.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum End {
    /// The loop waits at its safe level, with this latched.
    Waiting(Option<Fault>),
    /// The same, with some fault of the sensor.
    WaitingForSensor,
    /// The chip resets again and again, its outputs safe.
    Resetting,
}

/// What is not as it must be.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Wrong {
    /// An output is away from its safe level at the end.
    Unsafe,
    /// It came there too late.
    Late,
    /// An output went too far at once.
    Step,
    /// The chip is at something else.
    End,
    /// Codes or fault pin other than the host's, or none.
    Codes,
    /// Memory was read after a loss of power, before it was written.
    Memory,
    /// Something else than the reset's cause was touched before the watchdog ran.
    Unguarded,
    /// It did not happen so on the way; the reason is printed.
    Way,
}

/// How far an output may go at once.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Steps {
    /// A sample of the ramp.
    Ramp,
    /// The same once the law no longer runs.
    RampAfterLaw,
    /// The same, and the law's step of a late tick, whose code has not counted yet.
    RampAfterLate,
    /// What the law may: the slew of the table.
    Law,
}

/// One row.
pub(crate) struct Scenario {
    /// What happens.
    pub(crate) name: &'static str,
    /// The outputs are safe so long after it, milliseconds.
    pub(crate) at_most_ms: f64,
    /// How far an output may go at once.
    pub(crate) steps: Steps,
    /// How it ends.
    pub(crate) end: End,
    /// Of this board alone.
    pub(crate) board: Option<&'static str>,
    /// What of that is not so today, and why.
    pub(crate) open: Option<(&'static [Wrong], &'static str)>,
    /// Makes it happen; [`Rig::mark`] where the time begins to count.
    pub(crate) run: fn(&mut Rig) -> Result<(), Failure>,
}

impl Scenario {
    const fn new(name: &'static str, at_most_ms: f64, end: End, run: fn(&mut Rig) -> Result<(), Failure>) -> Self {
        Self {
            name,
            at_most_ms,
            steps: Steps::Ramp,
            end,
            board: None,
            open: None,
            run,
        }
    }

    const fn steps(self, steps: Steps) -> Self {
        Self { steps, ..self }
    }

    const fn of(self, board: &'static str) -> Self {
        Self {
            board: Some(board),
            ..self
        }
    }

    const fn open(self, wrong: &'static [Wrong], why: &'static str) -> Self {
        Self {
            open: Some((wrong, why)),
            ..self
        }
    }
}

const READY: End = End::Waiting(None);
const BITTEN: End = End::Waiting(Some(Fault::Watchdog));

/// All of both boards, in the table's order.
pub(crate) const SCENARIOS: [Scenario; 28] = [
    Scenario::new("power comes", START_MS, READY, |rig| {
        rig.until("the loop", 1000, Rig::is_looping)
    }),
    Scenario::new("watchdog's reset at a high output", START_MS + RAMP_MS, BITTEN, |rig| {
        high(rig)?;
        bite(rig)?;
        back(rig)
    }),
    Scenario::new(
        "the same, cycle counter locked",
        START_MS + LOCKED * RAMP_MS,
        BITTEN,
        |rig| {
            high(rig)?;
            rig.set(Line::CounterLocked, true)?;
            bite(rig)?;
            back(rig)
        },
    ),
    Scenario::new(
        "the same, ADC's calibration never ends",
        START_MS + RAMP_MS,
        End::Resetting,
        |rig| {
            high(rig)?;
            rig.set(Line::NoAdc, true)?;
            bite(rig)?;
            twice(rig)
        },
    ),
    Scenario::new(
        "the same, no clock from outside",
        START_MS + RAMP_MS,
        End::Resetting,
        |rig| {
            high(rig)?;
            rig.set(Line::NoOuterClock, true)?;
            bite(rig)?;
            twice(rig)
        },
    )
    .of(H743.board),
    Scenario::new(
        "the same, no PLL locks",
        SLOW_START_MS + RAMP_MS,
        End::Resetting,
        |rig| {
            high(rig)?;
            rig.set(Line::NoPll, true)?;
            bite(rig)?;
            twice(rig)
        },
    ),
    Scenario::new(
        "the same, no clock from the cable's chip",
        START_MS + RAMP_MS,
        BITTEN,
        |rig| {
            high(rig)?;
            rig.set(Line::NoCable, true)?;
            bite(rig)?;
            back(rig)
        },
    )
    .of(H743.board),
    Scenario::new(
        "watchdog's reset, DAC's SDO not connected",
        START_MS + RAMP_MS,
        BITTEN,
        |rig| {
            high(rig)?;
            rig.set(Line::NoSdo, true)?;
            bite(rig)?;
            back(rig)
        },
    ),
    Scenario::new("reset button at a high output", START_MS + RAMP_MS, READY, |rig| {
        high(rig)?;
        rig.mark();
        rig.reset(Reset::Pin)?;
        back(rig)
    }),
    Scenario::new("brown-out of the whole board", START_MS, READY, |rig| {
        high(rig)?;
        rig.lose_converters()?;
        rig.mark();
        rig.reset(Reset::BrownOut)?;
        back(rig)
    }),
    Scenario::new("brown-out of the chip alone", START_MS + RAMP_MS, READY, |rig| {
        high(rig)?;
        rig.mark();
        rig.reset(Reset::BrownOut)?;
        back(rig)
    }),
    Scenario::new(
        "brown-out of the chip alone, SDO not connected",
        START_MS + RAMP_MS,
        READY,
        |rig| {
            high(rig)?;
            rig.set(Line::NoSdo, true)?;
            rig.mark();
            rig.reset(Reset::BrownOut)?;
            back(rig)
        },
    )
    .open(&[Wrong::Step], "nothing says what the DAC holds"),
    Scenario::new(
        "supply low while the loop runs",
        RAMP_MS + 1.0,
        End::Waiting(Some(Fault::Supply)),
        |rig| {
            high(rig)?;
            rig.mark();
            rig.set(Line::LowSupply, true)?;
            down(rig)
        },
    )
    .steps(Steps::RampAfterLaw),
    Scenario::new("DAC off for a moment", RAMP_MS + 1.0, READY, |rig| {
        high(rig)?;
        rig.lose_converters()?;
        rig.mark();
        rig.go(3000)
    })
    .open(&[Wrong::Unsafe, Wrong::Step, Wrong::End], "nothing tells the chip"),
    Scenario::new("DAC off during a watchdog's reset", START_MS + RAMP_MS, BITTEN, |rig| {
        high(rig)?;
        rig.lose_converters()?;
        bite(rig)?;
        back(rig)
    }),
    Scenario::new(
        "DAC off during a reset, SDO not connected",
        START_MS + RAMP_MS,
        BITTEN,
        |rig| {
            high(rig)?;
            rig.set(Line::NoSdo, true)?;
            rig.lose_converters()?;
            bite(rig)?;
            back(rig)
        },
    )
    .open(&[Wrong::Step], "the DAC does not hold the kept code"),
    Scenario::new(
        "LDAC's wire off while the loop runs",
        2.0 * RAMP_MS + 25.0,
        READY,
        |rig| {
            high(rig)?;
            rig.set(Line::NoLdac, true)?;
            rig.go(500)?;
            if rig.mode() != Mode::Running {
                return Err("the run has ended".into());
            }
            rig.mark();
            press(rig)?;
            rig.until("the safe level", 3000, |rig| rig.mode() == Mode::Off)
        },
    )
    .steps(Steps::Law),
    Scenario::new("main hangs", HUNG_MS + RAMP_MS + WATCHDOG_MS, BITTEN, |rig| {
        high(rig)?;
        rig.mark();
        rig.processor().hang(Hang::Main)?;
        rig.until("the way down", 5500, |rig| rig.mode() == Mode::Falling)?;
        rig.until("a reset", 5000, |rig| rig.counts.bites > 0)?;
        back(rig)
    })
    .steps(Steps::RampAfterLaw),
    Scenario::new("the interrupt hangs", WATCHDOG_MS + START_MS + RAMP_MS, BITTEN, |rig| {
        high(rig)?;
        rig.mark();
        rig.processor().hang(Hang::Interrupt)?;
        rig.until("a reset", 200, |rig| rig.counts.bites > 0)?;
        back(rig)
    }),
    Scenario::new("hard fault in main", WATCHDOG_MS + START_MS + RAMP_MS, BITTEN, |rig| {
        high(rig)?;
        rig.mark();
        rig.processor().hang(Hang::Fault)?;
        rig.until("a reset", 200, |rig| rig.counts.bites > 0)?;
        back(rig)
    }),
    Scenario::new(
        "conversions stop",
        WATCHDOG_MS + START_MS + RAMP_MS,
        End::Resetting,
        |rig| {
            high(rig)?;
            rig.mark();
            rig.sensor = Sensor::Silent;
            twice(rig)
        },
    ),
    Scenario::new(
        "the sensor's code stands still",
        5.0 + 2.0 * RAMP_MS,
        End::WaitingForSensor,
        |rig| {
            high(rig)?;
            rig.mark();
            rig.sensor = Sensor::Stuck(rig.code());
            down(rig)
        },
    )
    .steps(Steps::Law),
    Scenario::new(
        "the sensor at the end of its range",
        1.0 + 2.0 * RAMP_MS,
        End::Waiting(Some(Fault::SensorRange)),
        |rig| {
            high(rig)?;
            rig.mark();
            rig.sensor = Sensor::Stuck(u16::MAX);
            down(rig)
        },
    )
    .steps(Steps::Law),
    Scenario::new(
        "three ticks late in a row",
        1.0 + RAMP_MS,
        End::Waiting(Some(Fault::Overrun)),
        |rig| {
            high(rig)?;
            // Two are none too many.
            late(rig, 2)?;
            rig.go(10)?;
            if rig.mode() != Mode::Running {
                return Err("two late ticks have ended the run".into());
            }
            rig.mark();
            late(rig, 3)?;
            down(rig)
        },
    )
    .steps(Steps::RampAfterLate),
    Scenario::new("the button bounces for 5 ms", 2.0 * RAMP_MS + 25.0, READY, |rig| {
        looping(rig)?;
        for (start, periods) in [(true, 1500), (false, 3000)] {
            if !start {
                rig.mark();
            }
            bounce(rig)?;
            rig.go(PRESS)?;
            rig.set(Line::Button, false)?;
            rig.go(periods)?;
            let orders: Vec<Order> = rig.taken.drain(..).map(|(_, order)| order).collect();
            let wanted = if start { Order::Start } else { Order::Stop };
            if orders != [wanted] {
                return Err(format!("a press gave {orders:?}, not one {wanted:?}").into());
            }
        }
        Ok(())
    })
    .steps(Steps::Law),
    Scenario::new("bounces without a press", 1.0, READY, |rig| {
        looping(rig)?;
        rig.mark();
        bounce(rig)?;
        rig.set(Line::Button, false)?;
        rig.go(1500)?;
        match rig.taken.is_empty() {
            true => Ok(()),
            false => Err(format!("bounces gave {:?}", rig.taken).into()),
        }
    }),
    Scenario::new(
        "host's order while the button asks",
        2.0 * RAMP_MS + 25.0,
        READY,
        |rig| {
            looping(rig)?;
            press(rig)?;
            rig.until("the run", 3000, |rig| rig.mode() == Mode::Running)?;
            rig.taken.clear();
            rig.mark();
            // A change of many orders, on whose way the press counts.
            let change: Vec<Order> = (0..60).map(Order::Byte).collect();
            rig.set(Line::Button, true)?;
            rig.go(480)?;
            for orders in change.chunks(30) {
                let bytes: Vec<u8> = orders.iter().flat_map(|&order| order_packet(order)).collect();
                rig.processor().orders(&bytes)?;
                rig.go(40)?;
            }
            rig.set(Line::Button, false)?;
            down(rig)?;
            let orders: Vec<Order> = rig.taken.iter().map(|&(_, order)| order).collect();
            let of_host: Vec<Order> = orders.iter().copied().filter(|&order| order != Order::Stop).collect();
            let place = orders.iter().position(|&order| order == Order::Stop);
            let between = place.is_some_and(|place| place > 0 && place + 1 < orders.len());
            match of_host == change && orders.len() == change.len() + 1 && between {
                true => Ok(()),
                false => Err(format!("the ticks have taken {orders:?}").into()),
            }
        },
    )
    .steps(Steps::Law),
    Scenario::new("a fault, a press, a press", 2.0 * RAMP_MS + 60.0, READY, |rig| {
        high(rig)?;
        rig.mark();
        late(rig, 3)?;
        down(rig)?;
        if rig.fault() != Some(Fault::Overrun) {
            return Err("no fault was latched".into());
        }
        // Clears it and starts nothing.
        press(rig)?;
        rig.go(50)
    })
    .steps(Steps::RampAfterLaw),
];

/// From power to the loop, at its safe level.
fn looping(rig: &mut Rig) -> Result<(), Failure> {
    rig.until("the loop", 5000, Rig::is_looping)?;
    rig.go(100)
}

/// A press, and the button let go.
pub(crate) fn press(rig: &mut Rig) -> Result<(), Failure> {
    rig.set(Line::Button, true)?;
    rig.go(PRESS)?;
    rig.set(Line::Button, false)?;
    rig.go(PRESS)
}

/// To a run, by the host's order, with every output at [`HIGH_V`] and more.
fn high(rig: &mut Rig) -> Result<(), Failure> {
    looping(rig)?;
    rig.processor().orders(&order_packet(Order::Start))?;
    rig.until("a high output", 10_000, |rig| {
        let mut outputs = rig.outputs.iter().zip(&rig.axes);
        rig.mode() == Mode::Running && outputs.all(|(&code, axis)| f64::from(code) * axis.volts_a_code() >= HIGH_V)
    })
}

/// A reset by the watchdog.
fn bite(rig: &mut Rig) -> Result<(), Failure> {
    rig.mark();
    rig.reset(Reset::Watchdog)
}

/// The way from a reset to the next loop, which waits.
fn back(rig: &mut Rig) -> Result<(), Failure> {
    rig.until("the loop", 15_000, Rig::is_looping)?;
    rig.go(50)
}

/// Two starts that the watchdog ends.
fn twice(rig: &mut Rig) -> Result<(), Failure> {
    rig.until("the watchdog", 30_000, |rig| rig.counts.bites == 2)
}

/// The way down of the loop, which waits then.
fn down(rig: &mut Rig) -> Result<(), Failure> {
    rig.until("the way down", 500, |rig| rig.mode() != Mode::Running)?;
    rig.until("the safe level", 3000, |rig| rig.mode() == Mode::Off)?;
    rig.go(50)
}

/// So many ticks that the next conversion overtakes.
fn late(rig: &mut Rig, ticks: u64) -> Result<(), Failure> {
    rig.hold_up = true;
    rig.go(ticks)?;
    rig.hold_up = false;
    Ok(())
}

/// 5 ms of a contact that closes and opens at uneven times, closed at the end.
fn bounce(rig: &mut Rig) -> Result<(), Failure> {
    let mut closed = true;
    for periods in [7, 3, 21, 11, 40, 2, 60, 5, 90, 11] {
        rig.set(Line::Button, closed)?;
        rig.go(periods)?;
        closed = !closed;
    }
    rig.set(Line::Button, true)
}
