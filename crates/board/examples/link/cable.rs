//! Both ends of a cable in this process, and the host that listens at one of them by the board's own network stack.

use hysteron_firmware::network::PORT;
use hysteron_firmware::telemetry::{Found, Sample, all};
use smoltcp::iface::{Config, Interface, SocketHandle, SocketSet};
use smoltcp::phy::{Device, DeviceCapabilities, Medium, RxToken, TxToken};
use smoltcp::socket::{tcp, udp};
use smoltcp::storage::RingBuffer;
use smoltcp::time::Instant;
use smoltcp::wire::{EthernetAddress, IpCidr, IpEndpoint, Ipv4Address};
use std::cell::RefCell;
use std::collections::VecDeque;
use std::rc::Rc;

/// The board's address, as an image has it unless it is told another, and the host's.
pub(crate) const BOARD: [u8; 4] = [192, 168, 7, 2];
const HOST: [u8; 4] = [192, 168, 7, 1];
const HARDWARE: [u8; 6] = [2, 0, 0, 0, 0, 1];
pub(crate) const PREFIX: u8 = 24;
/// The host's ports.
pub(crate) const SAMPLES_PORT: u16 = 40_000;
const CONNECTION_PORT: u16 = 40_001;
/// Frames that a cable holds.
const ON_THE_WAY: usize = 64;
/// Protocol of UDP in an IP header, and the place of it in a frame.
const UDP: (usize, u8) = (23, 17);

/// Whatever stops a run.
type Failure = Box<dyn std::error::Error + Send + Sync>;

/// Frames on their way to one end.
type Way = Rc<RefCell<VecDeque<Vec<u8>>>>;

/// One end of a cable.
pub(crate) struct End {
    pub(crate) here: Way,
    pub(crate) there: Way,
    /// Of the datagrams that leave here, each of this number is lost; 0 none.
    pub(crate) loses: u64,
    datagrams: u64,
    /// Those that were lost.
    pub(crate) lost: u64,
}

impl End {
    pub(crate) fn pair() -> [Self; 2] {
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
        has_room.then_some(Room(self))
    }

    fn capabilities(&self) -> DeviceCapabilities {
        let mut capabilities = DeviceCapabilities::default();
        capabilities.medium = Medium::Ethernet;
        capabilities.max_transmission_unit = 1514;
        capabilities
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

impl Host {
    pub(crate) fn new(mut end: End) -> Self {
        let mut interface = Interface::new(Config::new(EthernetAddress(HARDWARE).into()), &mut end, Instant::ZERO);
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

    pub(crate) fn poll(&mut self, now_us: i64) {
        self.interface
            .poll(Instant::from_micros(now_us), &mut self.end, &mut self.sockets);
    }

    /// Calls the board.
    pub(crate) fn call(&mut self) -> Result<(), Failure> {
        let to = IpEndpoint::new(Ipv4Address::from(BOARD).into(), PORT);
        let here = self.interface.context();
        let connection = self.sockets.get_mut::<tcp::Socket<'_>>(self.connection);
        let called = connection.connect(here, to, CONNECTION_PORT);
        called.map_err(|error| format!("{error:?}").into())
    }

    /// Whether the board has answered.
    pub(crate) fn is_connected(&mut self) -> bool {
        self.connection().may_send()
    }

    fn connection(&mut self) -> &mut tcp::Socket<'static> {
        self.sockets.get_mut(self.connection)
    }

    /// What came over the connection.
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

/// What came to the host by UDP.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub(crate) struct Heard {
    /// Samples.
    pub(crate) samples: u64,
    /// Of them, those that the board has not sent, and what is no sample.
    pub(crate) wrong: u64,
    /// Ticks of the first axis that are missing, by the numbers of its frames.
    pub(crate) missing: u64,
    /// Times that some are.
    pub(crate) gaps: u64,
    last: Option<u32>,
}

impl Heard {
    /// Takes a datagram, which holds whole samples and nothing else.
    pub(crate) fn hear(&mut self, datagram: &[u8], is_sent: impl Fn(&Sample) -> bool) {
        for found in all(datagram) {
            let Found::Sample(sample) = found else {
                self.wrong += 1;
                continue;
            };
            self.samples += 1;
            self.wrong += u64::from(!is_sent(&sample));
            if sample.axis == 0 {
                let number = sample.frame.number;
                let between = self.last.map_or(0, |last| number.wrapping_sub(last).wrapping_sub(1));
                self.missing += u64::from(between);
                self.gaps += u64::from(between > 0);
                self.last = Some(number);
            }
        }
    }
}
