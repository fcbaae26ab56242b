//! The application of both axes at its stage, its end of a cable, and a host that holds each sample against what was sent.

use crate::cable::{BOARD, End, Heard, Host, PREFIX, SAMPLES_PORT};
use hysteron_board::host::{complete, hello};
use hysteron_board::two_axes::coupled;
use hysteron_board::{Request, Shape};
use hysteron_firmware::controller::Controller;
use hysteron_firmware::law::Complete;
use hysteron_firmware::network::{Buffers, Network, Place, Places};
use hysteron_firmware::telemetry::{
    About, Requested, Requests, SAMPLES_AN_ABOUT, Sample, order_packet, samples_to_packet,
};
use hysteron_firmware::two_axes::TwoAxes;
use hysteron_firmware::wire::{Frame, Input, Order, Setup};
use hysteron_plant::{Stage, preset};
use hysteron_table::Table;
use std::collections::VecDeque;

/// Both axes' tables, and what of the other's motion reaches each.
const TABLES: [&str; 2] = [
    include_str!("../../../../firmware/tables/tracking-x.toml"),
    include_str!("../../../../firmware/tables/tracking-y.toml"),
];
const SHARES: [f64; 2] = [0.01, -0.006];
const SEED: u64 = 7;
const HARDWARE: [u8; 6] = [2, 0, 0, 0, 0, 2];
/// Ticks of a round of main's.
const TICKS_A_ROUND: u32 = 32;

/// Whatever stops a run.
pub(crate) type Failure = Box<dyn std::error::Error + Send + Sync>;

/// The application of both axes with its stage, and its end of the cable.
pub(crate) struct Board {
    axes: TwoAxes<Complete, Complete>,
    abouts: Vec<About>,
    stages: [Stage; 2],
    network: Network,
    requests: Requests,
    orders: VecDeque<Order>,
    /// Its end.
    pub(crate) end: End,
    /// Ticks so far.
    pub(crate) ticks: u32,
    /// What it sent last, a tick each.
    sent: VecDeque<[Sample; 2]>,
    /// Every code, as a sum that depends on their order.
    pub(crate) sum: u64,
}

/// Ticks whose samples the host may still ask about.
const KEPT: usize = 16_384;

impl Board {
    fn new(mut end: End) -> Result<Self, Failure> {
        let [x, y] = [Table::parse(TABLES[0])?, Table::parse(TABLES[1])?];
        let controller = |table: &Table, text| -> Result<_, Failure> {
            let request = Request {
                shape: Shape::Sine,
                frequency_hz: 10.0,
                range_um: None,
                seconds: 1.0,
                feedforward: true,
                feedback: true,
            };
            let setup = Setup {
                ticks: u32::MAX,
                ..request.setup(&hello(table, text))?
            };
            Ok(Controller::new(complete(table)?, &setup))
        };
        let configs = [preset::tracking_8k(), preset::tracking_739()];
        let place = Place {
            hardware: HARDWARE,
            address: BOARD,
            prefix: PREFIX,
        };
        let room = (Box::leak(Box::new(Buffers::new())), Box::leak(Box::new(Places::new())));
        Ok(Self {
            axes: TwoAxes::new(controller(&x, TABLES[0])?, controller(&y, TABLES[1])?),
            abouts: About::of_both("simulated").to_vec(),
            stages: coupled([&configs[0], &configs[1]], SHARES, SEED)?,
            network: Network::new(&mut end, room, place, SEED),
            requests: Requests::default(),
            orders: VecDeque::new(),
            end,
            ticks: 0,
            sent: VecDeque::new(),
            sum: 0,
        })
    }

    fn tick(&mut self) {
        let order = self.orders.pop_front().unwrap_or_default();
        let adc = [0, 1].map(|axis| u16::try_from(self.stages[axis].sample().position_code).unwrap_or(u16::MAX));
        let frames = self.axes.step(adc.map(|adc| Input { adc, order }), false);
        let volts = [0, 1].map(|axis| self.stages[axis].v_from_code(u32::from(frames[axis].dac)));
        self.stages[0].step_two_axes(volts[0], volts[1]);
        self.stages[1].step_two_axes(volts[1], volts[0]);
        let of_axis = |axis: usize, frame: Frame| Sample {
            frame,
            adc: adc[axis],
            axis: axis as u8,
        };
        let [x, y] = frames;
        for frame in frames {
            self.sum = self
                .sum
                .wrapping_mul(0x100_0000_01b3)
                .wrapping_add(u64::from(frame.dac));
        }
        let samples = [of_axis(0, x), of_axis(1, y)];
        if self.ticks.is_multiple_of(SAMPLES_AN_ABOUT) {
            self.abouts
                .iter()
                .for_each(|about| self.network.say(&about.to_packet()));
        }
        self.network
            .sample(samples.map(|sample| sample.to_packet()).as_flattened());
        self.sent.push_back(samples);
        if self.sent.len() > KEPT {
            self.sent.pop_front();
        }
        self.ticks += 1;
    }

    /// A round of main's after its ticks.
    fn round(&mut self) {
        for _ in 0..TICKS_A_ROUND {
            self.tick();
        }
        self.network.poll(&mut self.end, 20 * i64::from(self.ticks));
        while let Some(byte) = self.network.read() {
            match self.requests.push(byte) {
                Some(Requested::Order(order)) => self.orders.push_back(order),
                Some(Requested::SamplesTo(port)) => self.network.samples_to(port),
                None => {}
            }
        }
    }

    /// Whether a sample is one of these.
    fn has_sent(&self, sample: &Sample) -> bool {
        let first = self.sent.front().map_or(0, |[x, _]| x.frame.number);
        let place = sample.frame.number.wrapping_sub(first) as usize;
        let mine = self.sent.get(place).and_then(|both| both.get(usize::from(sample.axis)));
        mine.is_some_and(|mine| mine.to_packet() == sample.to_packet())
    }
}

/// Both ends, and the time.
pub(crate) struct Bench {
    /// The board.
    pub(crate) board: Board,
    /// The host.
    pub(crate) host: Host,
}

impl Bench {
    /// A cable that loses each datagram of this number; 0 none.
    pub(crate) fn new(loses: u64) -> Result<Self, Failure> {
        let [mut of_board, of_host] = End::pair();
        of_board.loses = loses;
        Ok(Self {
            board: Board::new(of_board)?,
            host: Host::new(of_host),
        })
    }

    /// The board goes on with nobody at the other end until it has let its host go; then somebody else is there.
    pub(crate) fn without_its_host(mut self) -> Result<Self, Failure> {
        let seconds = 8;
        for _ in 0..seconds * 50_000 / TICKS_A_ROUND {
            self.board.round();
            self.host.end.here.borrow_mut().clear();
        }
        let [of_board, of_host] = End::pair();
        self.board.end = of_board;
        self.host = Host::new(of_host);
        Ok(self)
    }

    /// A round of main's, and what the host takes of it.
    pub(crate) fn round(&mut self) {
        self.board.round();
        self.host.poll(20 * i64::from(self.board.ticks));
    }

    /// Connects, and asks for samples by UDP and a start where they are wanted.
    pub(crate) fn connect(&mut self, by_udp: bool) -> Result<(), Failure> {
        self.host.call()?;
        for _ in 0..1000 {
            self.round();
            if self.host.is_connected() {
                if by_udp {
                    self.host.say(&samples_to_packet(SAMPLES_PORT))?;
                }
                return self.host.say(&order_packet(Order::Start));
            }
        }
        Err("nobody answers".into())
    }

    /// So many ticks; what came by UDP meanwhile.
    pub(crate) fn run(&mut self, ticks: u32, heard: &mut Heard, each: &mut dyn FnMut(&[u8])) {
        let end = self.board.ticks + ticks;
        while self.board.ticks < end {
            self.round();
            while let Some(datagram) = self.host.datagram() {
                each(&datagram);
                heard.hear(&datagram, |sample| self.board.has_sent(sample));
            }
        }
    }
}
