//! A board's end of a cable and a host's, both by the same network stack: ticks here, samples there.

use hysteron_board::host::complete;
use hysteron_board::two_axes::coupled;
use hysteron_firmware::controller::Controller;
use hysteron_firmware::law::Complete;
use hysteron_firmware::network::{Buffers, Network, PORT, Place, Places};
use hysteron_firmware::telemetry::{About, Found, Requested, Requests, Sample, find, order_packet, samples_to_packet};
use hysteron_firmware::trajectory::Shape;
use hysteron_firmware::two_axes::TwoAxes;
use hysteron_firmware::wire::{Frame, Input, Order, Setup};
use hysteron_plant::{Stage, preset};
use hysteron_table::Table;
use smoltcp::iface::{Config, Interface, SocketHandle, SocketSet};
use smoltcp::phy::{Device, DeviceCapabilities, Medium, RxToken, TxToken};
use smoltcp::socket::{tcp, udp};
use smoltcp::storage::RingBuffer;
use smoltcp::time::Instant;
use smoltcp::wire::{EthernetAddress, IpCidr, IpEndpoint, Ipv4Address};
use std::cell::RefCell;
use std::collections::VecDeque;
use std::error::Error;
use std::rc::Rc;

/// The second axis' table, the first one's, and their stages.
const TABLES: [&str; 2] = [
    include_str!("../../../../firmware/tables/tracking-x.toml"),
    include_str!("../../../../firmware/tables/tracking-y.toml"),
];
const SHARES: [f64; 2] = [0.01, -0.006];
const SEED: u64 = 7;

const BOARD: [u8; 4] = [192, 168, 7, 2];
const HOST: [u8; 4] = [192, 168, 7, 1];
const HARDWARE: [[u8; 6]; 2] = [[2, 0, 0, 0, 0, 2], [2, 0, 0, 0, 0, 1]];
const PREFIX: u8 = 24;
/// The host's ports.
const SAMPLES_PORT: u16 = 40_000;
const CONNECTION_PORT: u16 = 40_001;
/// Ticks of a round of main's.
const TICKS_A_ROUND: u32 = 32;
/// Samples of either axis from a description to the next.
const TICKS_AN_ABOUT: u32 = 8192;
/// Frames that a cable holds.
const ON_THE_WAY: usize = 64;
/// Protocol of UDP in an IP header, and the place of it in a frame.
const UDP: (usize, u8) = (23, 17);

/// Whatever stops a run.
pub(crate) type Failure = Box<dyn Error>;

/// Frames on their way to one end.
type Way = Rc<RefCell<VecDeque<Vec<u8>>>>;

/// One end of a cable.
pub(crate) struct End {
    here: Way,
    there: Way,
    /// Of the datagrams that leave here, each of this number is lost; 0 none.
    loses: u64,
    datagrams: u64,
    /// Those that were lost.
    pub(crate) lost: u64,
}

impl End {
    fn pair() -> [Self; 2] {
        let ways: [Way; 2] = Default::default();
        [(0, 1), (1, 0)].map(|(here, there)| Self {
            here: Rc::clone(&ways[here]),
            there: Rc::clone(&ways[there]),
            loses: 0,
            datagrams: 0,
            lost: 0,
        })
    }

    /// A frame that nobody here has sent.
    #[allow(dead_code, reason = "a test's")]
    pub(crate) fn inject(&self, frame: Vec<u8>) {
        self.here.borrow_mut().push_back(frame);
    }
}

/// A frame that has come.
pub(crate) struct Came(Vec<u8>);

/// Room for a frame.
pub(crate) struct Room<'e>(&'e mut End);

impl RxToken for Came {
    fn consume<R, F: FnOnce(&[u8]) -> R>(self, f: F) -> R {
        f(&self.0)
    }
}

impl TxToken for Room<'_> {
    fn consume<R, F: FnOnce(&mut [u8]) -> R>(self, length: usize, f: F) -> R {
        let mut frame = vec![0; length];
        let made = f(&mut frame);
        if frame.get(UDP.0) == Some(&UDP.1) {
            self.0.datagrams += 1;
            if self.0.loses > 0 && self.0.datagrams.is_multiple_of(self.0.loses) {
                self.0.lost += 1;
                return made;
            }
        }
        self.0.there.borrow_mut().push_back(frame);
        made
    }
}

impl Device for End {
    type RxToken<'a> = Came;
    type TxToken<'a> = Room<'a>;

    fn receive(&mut self, _: Instant) -> Option<(Came, Room<'_>)> {
        let frame = self.here.borrow_mut().pop_front()?;
        Some((Came(frame), Room(self)))
    }

    fn transmit(&mut self, _: Instant) -> Option<Room<'_>> {
        let has_room = self.there.borrow().len() < ON_THE_WAY;
        has_room.then(|| Room(self))
    }

    fn capabilities(&self) -> DeviceCapabilities {
        let mut capabilities = DeviceCapabilities::default();
        capabilities.medium = Medium::Ethernet;
        capabilities.max_transmission_unit = 1514;
        capabilities
    }
}

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
        let controller = |table: &Table| {
            let (min_um, max_um) = (table.input_min_um as f32, table.input_max_um as f32);
            let inset_um = 0.02 * (max_um - min_um);
            let setup = Setup {
                ticks: u32::MAX,
                shape: Shape::Sine,
                phase_step: (10.0 / table.sample_rate_hz as f32 * 4_294_967_296.0) as u32,
                low_um: min_um + inset_um,
                high_um: max_um - inset_um,
                feedforward: true,
                feedback: true,
                clocked: true,
            };
            complete(table).map(|parameters| Controller::new(parameters, &setup))
        };
        let configs = [preset::tracking_8k(), preset::tracking_739()];
        let place = Place {
            hardware: HARDWARE[0],
            address: BOARD,
            prefix: PREFIX,
        };
        let room = (Box::leak(Box::new(Buffers::new())), Box::leak(Box::new(Places::new())));
        Ok(Self {
            axes: TwoAxes::new(controller(&x)?, controller(&y)?),
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
        if self.ticks.is_multiple_of(TICKS_AN_ABOUT) {
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

/// Whoever listens.
pub(crate) struct Host {
    interface: Interface,
    sockets: SocketSet<'static>,
    connection: SocketHandle,
    samples: SocketHandle,
    /// Its end.
    pub(crate) end: End,
}

/// What came to the host.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub(crate) struct Heard {
    /// Samples, and those that the board has not sent.
    pub(crate) samples: u64,
    pub(crate) wrong: u64,
    /// Ticks of the first axis that are missing, by the numbers of its frames.
    pub(crate) missing: u64,
    /// Times that some are.
    pub(crate) gaps: u64,
    last: Option<u32>,
}

impl Host {
    fn new(mut end: End) -> Self {
        let mut interface = Interface::new(
            Config::new(EthernetAddress(HARDWARE[1]).into()),
            &mut end,
            Instant::ZERO,
        );
        interface.update_ip_addrs(|addresses| {
            let _ = addresses.push(IpCidr::new(Ipv4Address::from(HOST).into(), PREFIX));
        });
        let room = |bytes: usize| -> &'static mut [u8] { vec![0; bytes].leak() };
        let connection = tcp::Socket::new(RingBuffer::new(room(65_536)), RingBuffer::new(room(65_536)));
        let packets = |packets: usize| {
            udp::PacketBuffer::new(
                &mut *vec![udp::PacketMetadata::EMPTY; packets].leak(),
                room(2048 * packets),
            )
        };
        let mut samples = udp::Socket::new(packets(256), packets(1));
        // A port above 0, once.
        let _ = samples.bind(SAMPLES_PORT);
        let mut sockets = SocketSet::new(&mut *Vec::from([const { smoltcp::iface::SocketStorage::EMPTY }; 2]).leak());
        Self {
            connection: sockets.add(connection),
            samples: sockets.add(samples),
            interface,
            sockets,
            end,
        }
    }

    fn poll(&mut self, now_us: i64) {
        self.interface
            .poll(Instant::from_micros(now_us), &mut self.end, &mut self.sockets);
    }

    fn connection(&mut self) -> &mut tcp::Socket<'static> {
        self.sockets.get_mut(self.connection)
    }

    /// What came over the connection.
    #[allow(dead_code, reason = "a test's")]
    pub(crate) fn said(&mut self) -> Vec<u8> {
        let mut bytes = Vec::new();
        let _ = self.connection().recv(|there| {
            bytes.extend_from_slice(there);
            (there.len(), ())
        });
        bytes
    }

    /// Sends bytes over the connection.
    pub(crate) fn say(&mut self, bytes: &[u8]) -> Result<(), Failure> {
        let sent = self
            .connection()
            .send_slice(bytes)
            .map_err(|error| format!("{error:?}"))?;
        if sent < bytes.len() {
            return Err("the connection has no room".into());
        }
        Ok(())
    }

    /// The next datagram.
    pub(crate) fn datagram(&mut self) -> Option<Vec<u8>> {
        let samples = self.sockets.get_mut::<udp::Socket<'_>>(self.samples);
        samples.recv().ok().map(|(bytes, _)| bytes.to_vec())
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
    #[allow(dead_code, reason = "a test's")]
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
        let to = IpEndpoint::new(Ipv4Address::from(BOARD).into(), PORT);
        let here = self.host.interface.context();
        let connection = self.host.sockets.get_mut::<tcp::Socket<'_>>(self.host.connection);
        connection
            .connect(here, to, CONNECTION_PORT)
            .map_err(|error| format!("{error:?}"))?;
        for _ in 0..1000 {
            self.round();
            if self.host.connection().may_send() {
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
                self.hear(&datagram, heard);
            }
        }
    }

    fn hear(&self, datagram: &[u8], heard: &mut Heard) {
        let mut at = 0;
        while let Some(left) = datagram.get(at..).filter(|left| !left.is_empty()) {
            let found = find(left);
            if let Found::Sample(sample) = found {
                heard.samples += 1;
                heard.wrong += u64::from(!self.board.has_sent(&sample));
                if sample.axis == 0 {
                    let step = heard.last.map_or(1, |last| sample.frame.number.wrapping_sub(last));
                    heard.missing += u64::from(step) - 1;
                    heard.gaps += u64::from(step > 1);
                    heard.last = Some(sample.frame.number);
                }
            } else {
                // A datagram holds samples and nothing else.
                heard.wrong += 1;
            }
            // One that has not ended is no packet either.
            at += found.length().max(1);
        }
    }
}
