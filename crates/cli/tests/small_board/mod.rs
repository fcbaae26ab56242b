//! A board that is none: the firmware's own application, at a stage of a few lines, behind a connection.
#![allow(dead_code, reason = "each test asks it for a part")]

use hysteron_firmware::controller::Controller;
use hysteron_firmware::small_stage::SmallStage;
use hysteron_firmware::table;
use hysteron_firmware::telemetry::{About, Orders, SAMPLE_BYTES, Sample};
use hysteron_firmware::trajectory::Shape;
use hysteron_firmware::wire::{Input, Mode, Order, Setup};
use std::io::{Read, Write};
use std::net::TcpListener;

/// The firmware's own application at a small stage behind a connection.
pub(crate) struct SmallBoard {
    server: TcpListener,
    controller: Controller<table::Law>,
    stage: SmallStage,
    /// What it was asked for.
    pub(crate) asked: Vec<Order>,
    /// The reference it ran.
    pub(crate) played: Vec<f32>,
}

impl SmallBoard {
    /// At its safe level.
    pub(crate) fn new() -> Self {
        let parameters = table::parameters().unwrap();
        let asleep = Setup {
            ticks: 0,
            shape: Shape::Sine,
            phase_step: 1 << 20,
            low_um: table::INPUT_MIN_UM,
            high_um: table::INPUT_MAX_UM,
            feedforward: true,
            feedback: true,
            clocked: true,
        };
        Self {
            server: TcpListener::bind("127.0.0.1:0").unwrap(),
            stage: SmallStage::new(&parameters, 1),
            controller: Controller::new(parameters, &asleep),
            asked: Vec::new(),
            played: Vec::new(),
        }
    }

    /// Where it is listened for.
    pub(crate) fn address(&self) -> String {
        self.server.local_addr().unwrap().to_string()
    }

    /// One tick, and what it sends.
    pub(crate) fn tick(&mut self, order: Order) -> [u8; SAMPLE_BYTES] {
        let adc = self.stage.input(1, u32::MAX).adc;
        let frame = self.controller.step(Input { adc, order }, false);
        self.stage.output(frame.dac);
        if frame.mode() == Mode::Running {
            self.played.push(frame.reference_um);
        }
        Sample { frame, adc }.to_packet()
    }

    /// One connection: it ticks while it is told something, and `ticks` times once it has been started; then it waits for the stop.
    pub(crate) fn serve(&mut self, ticks: u32) {
        let (mut connection, _) = self.server.accept().unwrap();
        for about in About::all("nucleo-h743zi") {
            connection.write_all(&about.to_packet()).unwrap();
        }
        let (mut orders, mut left) = (Orders::default(), 0);
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
                let Some(order) = orders.push(byte[0]) else { continue };
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
