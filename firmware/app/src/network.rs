//! A board on a network: whoever connects by TCP asks and is answered, and has the samples by UDP where that was asked for.
//!
//! One host at a time. Nothing of this waits: main carries frames to and fro in its rounds, and what has no room is left out as a whole
//! and counted by its host, which misses the frames' numbers. By UDP nothing is sent twice; by TCP what was sent arrives, and a
//! connection that stands still loses whole ticks.

use crate::telemetry::DATAGRAM_BYTES;
use smoltcp::iface::{Config, Interface, PollIngressSingleResult, SocketHandle, SocketSet, SocketStorage};
use smoltcp::phy::Device;
use smoltcp::socket::{tcp, udp};
use smoltcp::storage::RingBuffer;
use smoltcp::time::{Duration, Instant};
use smoltcp::wire::{EthernetAddress, HardwareAddress, IpCidr, IpEndpoint, Ipv4Cidr};

/// Port of the connection, and the one that datagrams come from.
pub const PORT: u16 = 9090;

/// Datagrams that wait for the cable: 20 ms of one axis at 50 kHz.
const DATAGRAMS: usize = 16;
/// Bytes of the connection that wait for main, and for the cable: 60 ms of both axes, more than a host keeps an acknowledgement back.
const IN_BYTES: usize = 512;
const OUT_BYTES: usize = 131_072;
/// Frames that a round takes at most: a flood must not keep main from its other work.
const FRAMES_A_ROUND: usize = 4;
/// A host that says nothing for so long has gone, and the next one may connect.
const GONE: Duration = Duration::from_secs(5);
/// How often it is asked whether it is there.
const ASKED: Duration = Duration::from_secs(1);

/// Who the board is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Place {
    /// Its hardware address.
    pub hardware: [u8; 6],
    /// Its address.
    pub address: [u8; 4],
    /// Bits of it that are the network's.
    pub prefix: u8,
}

/// Bytes on their way. All of it is zero at first: where memory begins so, nothing need be copied.
pub struct Buffers {
    from_host: [u8; IN_BYTES],
    to_host: [u8; OUT_BYTES],
    datagrams: [u8; DATAGRAMS * DATAGRAM_BYTES],
}

impl Buffers {
    /// Zeros.
    pub const fn new() -> Self {
        Self {
            from_host: [0; IN_BYTES],
            to_host: [0; OUT_BYTES],
            datagrams: [0; DATAGRAMS * DATAGRAM_BYTES],
        }
    }
}

impl Default for Buffers {
    fn default() -> Self {
        Self::new()
    }
}

/// What the sockets lie in.
pub struct Places {
    sockets: [SocketStorage<'static>; 2],
    lengths: [udp::PacketMetadata; DATAGRAMS],
}

impl Places {
    /// Empty.
    pub const fn new() -> Self {
        Self {
            sockets: [SocketStorage::EMPTY; 2],
            lengths: [udp::PacketMetadata::EMPTY; DATAGRAMS],
        }
    }
}

impl Default for Places {
    fn default() -> Self {
        Self::new()
    }
}

/// The board's end of both ways.
pub struct Network {
    interface: Interface,
    sockets: SocketSet<'static>,
    connection: SocketHandle,
    samples: SocketHandle,
    /// Where the host wants its samples; 0 by the connection.
    port: u16,
    /// The datagram that is being filled.
    datagram: [u8; DATAGRAM_BYTES],
    length: usize,
}

impl Network {
    /// On a device, with nobody connected, at time 0. The seed is another one each time: a board that starts anew is not its former self to
    /// a host that remembers it.
    pub fn new(
        device: &mut (impl Device + ?Sized),
        (buffers, places): (&'static mut Buffers, &'static mut Places),
        place: Place,
        seed: u64,
    ) -> Self {
        let hardware = HardwareAddress::Ethernet(EthernetAddress(place.hardware));
        let mut config = Config::new(hardware);
        config.random_seed = seed;
        let mut interface = Interface::new(config, device, Instant::ZERO);
        interface.update_ip_addrs(|addresses| {
            // There is room for two.
            let _ = addresses.push(IpCidr::Ipv4(Ipv4Cidr::new(place.address.into(), place.prefix)));
        });
        let mut connection = tcp::Socket::new(
            RingBuffer::new(&mut buffers.from_host[..]),
            RingBuffer::new(&mut buffers.to_host[..]),
        );
        connection.set_timeout(Some(GONE));
        connection.set_keep_alive(Some(ASKED));
        connection.set_nagle_enabled(false);
        connection.set_ack_delay(None);
        let mut samples = udp::Socket::new(
            udp::PacketBuffer::new(&mut [][..], &mut [][..]),
            udp::PacketBuffer::new(&mut places.lengths[..], &mut buffers.datagrams[..]),
        );
        // A port above 0, once.
        let _ = samples.bind(PORT);
        let mut sockets = SocketSet::new(&mut places.sockets[..]);
        Self {
            connection: sockets.add(connection),
            samples: sockets.add(samples),
            interface,
            sockets,
            port: 0,
            datagram: [0; DATAGRAM_BYTES],
            length: 0,
        }
    }

    /// Takes frames from the device and gives it those that are due; listens again where the host has gone.
    pub fn poll(&mut self, device: &mut (impl Device + ?Sized), now_us: i64) {
        let now = Instant::from_micros(now_us);
        for _ in 0..FRAMES_A_ROUND {
            let taken = self.interface.poll_ingress_single(now, device, &mut self.sockets);
            if matches!(taken, PollIngressSingleResult::None) {
                break;
            }
        }
        self.interface.poll_egress(now, device, &mut self.sockets);
        let connection = self.sockets.get_mut::<tcp::Socket<'_>>(self.connection);
        // The host has said its last.
        if connection.state() == tcp::State::CloseWait {
            connection.close();
        }
        if !connection.is_active() {
            (self.port, self.length) = (0, 0);
        }
        if !connection.is_open() {
            // Its port is none that is in use, and it is closed.
            let _ = connection.listen(PORT);
        }
    }

    /// A byte that the host has sent.
    pub fn read(&mut self) -> Option<u8> {
        let connection = self.sockets.get_mut::<tcp::Socket<'_>>(self.connection);
        let mut byte = [0];
        match connection.recv_slice(&mut byte) {
            Ok(1) => Some(byte[0]),
            _ => None,
        }
    }

    /// Where the host wants its samples: a port of its own, or 0.
    pub fn samples_to(&mut self, port: u16) {
        (self.port, self.length) = (port, 0);
    }

    /// Sends the packets of a tick, all of them or none.
    pub fn sample(&mut self, packets: &[u8]) {
        if self.port == 0 {
            self.say(packets);
            return;
        }
        if let Some(room) = self.datagram.get_mut(self.length..self.length + packets.len()) {
            room.copy_from_slice(packets);
            self.length += packets.len();
        }
        // The next tick has as many.
        if self.length + packets.len() > DATAGRAM_BYTES {
            self.send_datagram();
        }
    }

    /// Sends a packet over the connection, or leaves it out where there is no room for it.
    pub fn say(&mut self, packet: &[u8]) {
        let connection = self.sockets.get_mut::<tcp::Socket<'_>>(self.connection);
        if connection.may_send() && connection.send_capacity() - connection.send_queue() >= packet.len() {
            // There is room for it.
            let _ = connection.send_slice(packet);
        }
    }

    fn send_datagram(&mut self) {
        let host = self.sockets.get::<tcp::Socket<'_>>(self.connection).remote_endpoint();
        if let Some(host) = host {
            let samples = self.sockets.get_mut::<udp::Socket<'_>>(self.samples);
            // One that has no room is lost, and its ticks with it.
            let _ = samples.send_slice(
                self.datagram.get(..self.length).unwrap_or_default(),
                IpEndpoint::new(host.addr, self.port),
            );
        }
        self.length = 0;
    }
}
