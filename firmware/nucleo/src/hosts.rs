//! Whoever listens and asks: by the debug probe's memory (RTT), and by the cable of a board that has one.

use crate::board::CHIP;
#[cfg(feature = "h743zi")]
use crate::ethernet::Link;
use crate::image::{self, AXES};
use crate::{ORDERS, Tick};
#[cfg(feature = "h743zi")]
use hysteron_firmware::table;
use hysteron_firmware::telemetry::{Requested, Requests, SAMPLE_BYTES, SAMPLES_AN_ABOUT, Sample};
#[cfg(not(feature = "two-axes"))]
use hysteron_firmware::upload::{Message, Messages};
use hysteron_firmware::wire::{Hello, Order};
use rtt_target::{DownChannel, UpChannel};

/// Of an image of both axes, which has no slots.
#[cfg(feature = "two-axes")]
pub type Message = core::convert::Infallible;

/// Microseconds of a tick.
#[cfg(feature = "h743zi")]
const TICK_US: i64 = (1e6 / table::SAMPLE_RATE_HZ) as i64;

/// What one way brings.
#[derive(Default)]
struct Asking {
    requests: Requests,
    #[cfg(not(feature = "two-axes"))]
    messages: Messages,
}

/// What somebody asks for.
enum Asked {
    Order(Order),
    #[cfg(feature = "h743zi")]
    SamplesTo(u16),
    #[cfg(not(feature = "two-axes"))]
    Message(Message),
}

impl Asking {
    fn push(&mut self, byte: u8) -> Option<Asked> {
        #[cfg(not(feature = "two-axes"))]
        if let Some(message) = self.messages.push(byte) {
            return Some(Asked::Message(message));
        }
        match self.requests.push(byte)? {
            Requested::Order(order) => Some(Asked::Order(order)),
            #[cfg(feature = "h743zi")]
            Requested::SamplesTo(port) => Some(Asked::SamplesTo(port)),
            #[cfg(not(feature = "h743zi"))]
            Requested::SamplesTo(_) => None,
        }
    }
}

/// Both ways.
pub struct Hosts {
    to_probe: UpChannel,
    from_probe: DownChannel,
    by_probe: Asking,
    #[cfg(feature = "h743zi")]
    link: Option<Link>,
    #[cfg(feature = "h743zi")]
    by_link: Asking,
    abouts: image::Abouts,
    /// Ticks so far, and those that went to the probe.
    ticks: u64,
    sent: u32,
    /// No tick is sent to the probe until its buffer is empty: what gets through is in one piece of the buffer's size, not in shreds.
    waiting: bool,
}

impl Hosts {
    /// `hello` is that of a table in flash.
    pub fn new(
        (to_probe, from_probe): (UpChannel, DownChannel),
        #[cfg(feature = "h743zi")] link: Option<Link>,
        hello: Option<Hello>,
    ) -> Self {
        let mut abouts = image::abouts(CHIP.board);
        if let (Some(first), Some(hello)) = (abouts.first_mut(), hello) {
            *first = first.with(hello);
        }
        Self {
            to_probe,
            from_probe,
            by_probe: Asking::default(),
            #[cfg(feature = "h743zi")]
            link,
            #[cfg(feature = "h743zi")]
            by_link: Asking::default(),
            abouts,
            ticks: 0,
            sent: 0,
            waiting: false,
        }
    }

    /// Sends a tick, all axes or none: a gap is one of both.
    pub fn send(&mut self, tick: &Tick) {
        let packets: [[u8; SAMPLE_BYTES]; AXES] = tick.map(|sample: Sample| sample.to_packet());
        #[cfg(feature = "h743zi")]
        if let Some(link) = &mut self.link {
            let network = link.network();
            if self.ticks.is_multiple_of(SAMPLES_AN_ABOUT.into()) {
                self.abouts.iter().for_each(|about| network.say(&about.to_packet()));
            }
            network.sample(packets.as_flattened());
        }
        self.ticks += 1;
        if self.waiting && !self.to_probe.is_empty() {
            return;
        }
        self.waiting = false;
        if self.sent.is_multiple_of(SAMPLES_AN_ABOUT) {
            for about in self.abouts {
                self.write(&about.to_packet());
            }
        }
        self.write(packets.as_flattened());
        self.sent = self.sent.wrapping_add(1);
    }

    /// Says a packet to all.
    #[cfg(not(feature = "two-axes"))]
    pub fn say(&mut self, packet: &[u8]) {
        #[cfg(feature = "h743zi")]
        if let Some(link) = &mut self.link {
            link.network().say(packet);
        }
        self.write(packet);
    }

    /// To the probe: packets as a whole, or nothing of them and no tick until there is room.
    fn write(&mut self, packets: &[u8]) {
        self.waiting |= self.to_probe.write(packets) < packets.len();
    }

    /// Frames of the cable to and fro, in the time that the ticks tell.
    #[cfg(feature = "h743zi")]
    pub fn poll(&mut self) {
        if let Some(link) = &mut self.link {
            link.poll(self.ticks as i64 * TICK_US);
        }
    }

    /// Does what is asked of loop and network, an order a tick at most, and comes back with the first message about slots.
    pub fn hear(&mut self) -> Option<Message> {
        while ORDERS.is_empty() {
            match self.asked()? {
                Asked::Order(order) => {
                    // The slot is empty.
                    ORDERS.offer(order);
                }
                #[cfg(feature = "h743zi")]
                Asked::SamplesTo(port) => {
                    if let Some(link) = &mut self.link {
                        link.network().samples_to(port);
                    }
                }
                #[cfg(not(feature = "two-axes"))]
                Asked::Message(message) => return Some(message),
            }
        }
        None
    }

    /// The next that somebody asks for, in the bytes that have come.
    fn asked(&mut self) -> Option<Asked> {
        let mut byte = [0];
        while self.from_probe.read(&mut byte) == 1 {
            if let Some(asked) = self.by_probe.push(byte[0]) {
                return Some(asked);
            }
        }
        #[cfg(feature = "h743zi")]
        if let Some(link) = &mut self.link {
            while let Some(byte) = link.network().read() {
                if let Some(asked) = self.by_link.push(byte) {
                    return Some(asked);
                }
            }
        }
        None
    }
}
