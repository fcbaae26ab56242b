//! Whoever listens and asks: by the debug probe's memory (RTT), and by the cable of a board that has one.

use crate::board::CHIP;
#[cfg(feature = "h743zi")]
use crate::ethernet::Link;
use crate::image::{self, AXES};
use crate::{ORDERS, Tick};
use hysteron_firmware::telemetry::{Requested, Requests, SAMPLE_BYTES, SAMPLES_AN_ABOUT, Sample};
#[cfg(not(feature = "two-axes"))]
use hysteron_firmware::upload::{Message, Messages};
use hysteron_firmware::wire::{Hello, Order};
use rtt_target::{DownChannel, UpChannel};

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
    ticks: u32,
    /// Nothing is sent to the probe until its buffer is empty: what gets through is in one piece of the buffer's size, not in shreds.
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
            waiting: false,
        }
    }

    /// Sends a tick, all axes or none: a gap is one of both.
    pub fn send(&mut self, tick: &Tick) {
        let due = self.ticks.is_multiple_of(SAMPLES_AN_ABOUT);
        self.ticks = self.ticks.wrapping_add(1);
        if due {
            for about in self.abouts {
                self.say(&about.to_packet());
            }
        }
        let packets: [[u8; SAMPLE_BYTES]; AXES] = tick.map(|sample: Sample| sample.to_packet());
        #[cfg(feature = "h743zi")]
        if let Some(link) = &mut self.link {
            link.network().sample(packets.as_flattened());
        }
        self.write(packets.as_flattened());
    }

    /// Says a packet to all.
    pub fn say(&mut self, packet: &[u8]) {
        #[cfg(feature = "h743zi")]
        if let Some(link) = &mut self.link {
            link.network().say(packet);
        }
        self.write(packet);
    }

    /// To the probe: packets as a whole, or nothing of them and no other until there is room.
    fn write(&mut self, packets: &[u8]) {
        if self.waiting && !self.to_probe.is_empty() {
            return;
        }
        self.waiting = self.to_probe.write(packets) < packets.len();
    }

    /// Frames of the cable to and fro.
    #[cfg(feature = "h743zi")]
    pub fn poll(&mut self, now_us: i64) {
        if let Some(link) = &mut self.link {
            link.poll(now_us);
        }
    }

    /// Hears orders, one a tick at most, and comes back with the first message about slots.
    #[cfg(not(feature = "two-axes"))]
    pub fn hear(&mut self) -> Option<Message> {
        while ORDERS.is_empty() {
            match self.asked()? {
                Asked::Message(message) => return Some(message),
                other => self.take(other),
            }
        }
        None
    }

    /// Hears orders, one a tick at most.
    #[cfg(feature = "two-axes")]
    pub fn hear(&mut self) {
        while ORDERS.is_empty()
            && let Some(asked) = self.asked()
        {
            self.take(asked);
        }
    }

    fn take(&mut self, asked: Asked) {
        match asked {
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
            Asked::Message(_) => {}
        }
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
