//! A board that is none: the firmware's own application, at a stage of a few lines or a simulated one, behind a connection.
#![allow(dead_code, reason = "each test asks it for a part")]

use hysteron_firmware::controller::Controller;
use hysteron_firmware::law::Law;
use hysteron_firmware::parameters::Parameters;
use hysteron_firmware::small_stage::SmallStage;
use hysteron_firmware::stored::{Next, Pause, Stored};
use hysteron_firmware::table;
use hysteron_firmware::telemetry::{About, Requested, Requests, Sample};
use hysteron_firmware::trajectory::Shape;
use hysteron_firmware::two_axes::TwoAxes;
use hysteron_firmware::upload::{Message, Messages};
use hysteron_firmware::wire::{Frame, Input, Mode, Order, Setup};
use hysteron_plant::Stage;
use hysteron_slot::Slots;
use hysteron_slot::model::Flash;
use std::io::{Read, Write};
use std::net::TcpListener;

/// What the converters of a board are wired to.
pub(crate) trait Wired: Send {
    /// The sensor's code.
    fn adc(&mut self) -> u16;
    /// Takes the code of a tick, and of the other axis where there is one.
    fn dac(&mut self, code: u16, beside: Option<u16>);
}

impl Wired for SmallStage {
    fn adc(&mut self) -> u16 {
        self.input(1, u32::MAX).adc
    }

    fn dac(&mut self, code: u16, _: Option<u16>) {
        self.output(code);
    }
}

impl Wired for Stage {
    fn adc(&mut self) -> u16 {
        u16::try_from(self.sample().position_code).unwrap()
    }

    fn dac(&mut self, code: u16, beside: Option<u16>) {
        let voltage_v = self.v_from_code(u32::from(code));
        match beside {
            Some(code) => self.step_two_axes(voltage_v, self.v_from_code(u32::from(code))),
            None => self.step(voltage_v),
        };
    }
}

/// One axis or both, with the same table.
enum Axes {
    One(Box<Controller<table::Law>>),
    Two(Box<TwoAxes<table::Law, table::Law>>),
}

/// The firmware's own application at a stage behind a connection.
pub(crate) struct SmallBoard {
    server: TcpListener,
    axes: Axes,
    /// One an axis.
    stages: Vec<Box<dyn Wired>>,
    /// What it was asked for.
    pub(crate) asked: Vec<Order>,
    /// The reference it ran.
    pub(crate) played: Vec<f32>,
    /// What each tick's converters had.
    pub(crate) codes: Vec<[u16; 2]>,
    /// The slots of its flash, which a new start leaves alone.
    pub(crate) stored: Stored<Chip>,
    /// What it says of its first table.
    about: About,
    mode: Mode,
}

/// A flash of two slots of two pages.
pub(crate) type Chip = Flash<8, 2048, 8192>;

/// A process has no sample clock to stop.
struct Resting(bool);

impl Pause for Resting {
    fn at_rest(&self) -> bool {
        self.0
    }

    fn stop(&mut self) {}

    fn go_on(&mut self) {}
}

impl SmallBoard {
    /// At its safe level, at the stage of a few lines.
    pub(crate) fn new() -> Self {
        Self::at(Box::new(SmallStage::new(&table::parameters().unwrap(), 1)))
    }

    /// At its safe level.
    pub(crate) fn at(stage: Box<dyn Wired>) -> Self {
        let axes = Axes::One(Box::new(controller(table::parameters().unwrap())));
        Self::of(axes, vec![stage])
    }

    /// A new start: with the table of a slot, if there is one that passes every check.
    pub(crate) fn start(&mut self) {
        let mut parameters = table::parameters().unwrap();
        let about = About::of("nucleo-h743zi");
        self.about = match self.stored.choose(&mut parameters, None, &mut |_| {}) {
            Some(hello) => about.with(hello),
            None => about,
        };
        self.axes = Axes::One(Box::new(controller(parameters)));
        self.mode = Mode::Off;
    }

    /// What it says to a message.
    fn say(&mut self, message: Message) -> Vec<u8> {
        match self.stored.take(message, &mut Resting(self.mode == Mode::Off)) {
            Next::Say(answer) => answer.to_packet().to_vec(),
            Next::SaySlots => self.stored.answers().map(|answer| answer.to_packet()).concat(),
            Next::Restart(answer) => {
                self.start();
                [answer.to_packet().to_vec(), self.about.to_packet().to_vec()].concat()
            }
        }
    }

    /// Of both axes, at their safe levels.
    pub(crate) fn at_both(stages: [Box<dyn Wired>; 2]) -> Self {
        let axes = || controller(table::parameters().unwrap());
        let axes = TwoAxes::new(axes(), axes());
        Self::of(Axes::Two(Box::new(axes)), stages.into())
    }

    fn of(axes: Axes, stages: Vec<Box<dyn Wired>>) -> Self {
        Self {
            server: TcpListener::bind("127.0.0.1:0").unwrap(),
            axes,
            stages,
            asked: Vec::new(),
            played: Vec::new(),
            codes: Vec::new(),
            stored: Stored::new(Slots::new(Chip::default(), [0, 4096], 4096)),
            about: About::of("nucleo-h743zi"),
            mode: Mode::Off,
        }
    }

    /// Where it is listened for.
    pub(crate) fn address(&self) -> String {
        self.server.local_addr().unwrap().to_string()
    }

    /// One tick, and what it sends.
    pub(crate) fn tick(&mut self, order: Order) -> Vec<u8> {
        let codes: Vec<u16> = self.stages.iter_mut().map(|stage| stage.adc()).collect();
        let input = |axis: usize| Input {
            adc: codes[axis],
            order,
        };
        let frames: Vec<Frame> = match &mut self.axes {
            Axes::One(controller) => vec![controller.step(input(0), false)],
            Axes::Two(axes) => axes.step([input(0), input(1)], false).to_vec(),
        };
        self.mode = frames[0].mode();
        self.codes.push([codes[0], frames[0].dac]);
        if frames[0].mode() == Mode::Running {
            self.played.push(frames[0].reference_um);
        }
        let mut packets = Vec::new();
        // Each with the other's command.
        let beside: Vec<Option<u16>> = match frames.as_slice() {
            [x, y] => vec![Some(y.dac), Some(x.dac)],
            _ => vec![None],
        };
        let wired = self.stages.iter_mut().zip(beside);
        for (axis, (((stage, beside), frame), adc)) in (0..).zip(wired.zip(frames).zip(codes)) {
            stage.dac(frame.dac, beside);
            packets.extend(Sample { frame, adc, axis }.to_packet());
        }
        packets
    }

    /// One connection: it ticks while it is told something, and `ticks` times once it has been started; then it waits for the stop.
    pub(crate) fn serve(&mut self, ticks: u32) {
        self.serve_after(0, ticks);
    }

    /// As [`Self::serve`], with so many ticks at its safe level before it is told anything.
    pub(crate) fn serve_after(&mut self, at_rest: u32, ticks: u32) {
        let (mut connection, _) = self.server.accept().unwrap();
        let abouts = match &self.axes {
            Axes::One(_) => vec![self.about],
            Axes::Two(_) => About::of_both("nucleo-h743zi").to_vec(),
        };
        for about in abouts {
            connection.write_all(&about.to_packet()).unwrap();
        }
        for _ in 0..at_rest {
            let packet = self.tick(Order::None);
            if connection.write_all(&packet).is_err() {
                return;
            }
        }
        let (mut orders, mut messages, mut left) = (Requests::default(), Messages::default(), 0);
        loop {
            let order = if left > 0 {
                left -= 1;
                Order::None
            } else {
                let mut byte = [0];
                // The host closes when it has been told what it wants to know.
                if connection.read(&mut byte).unwrap_or(0) == 0 {
                    return;
                }
                if let Some(message) = messages.push(byte[0]) {
                    let said = self.say(message);
                    if connection.write_all(&said).is_err() {
                        return;
                    }
                }
                let Some(Requested::Order(order)) = orders.push(byte[0]) else {
                    continue;
                };
                self.asked.push(order);
                order
            };
            if order == Order::Start {
                left = ticks;
            }
            let packet = self.tick(order);
            if connection.write_all(&packet).is_err() {
                return;
            }
        }
    }
}

/// At its safe level.
pub(crate) fn controller<L: Law>(parameters: Parameters<L>) -> Controller<L> {
    let [low_um, high_um] = parameters.range_um;
    let asleep = Setup {
        ticks: 0,
        shape: Shape::Sine,
        phase_step: 1 << 20,
        low_um,
        high_um,
        feedforward: true,
        feedback: true,
        clocked: true,
    };
    Controller::new(parameters, &asleep)
}
