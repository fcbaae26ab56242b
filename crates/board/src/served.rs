//! A board for whoever has none: the complete law of a table in this process, or an image in the emulator, at a simulated stage and
//! behind the bytes of a real board.

use crate::host::complete;
use crate::rig::adc;
use crate::{Bench, BoardError, Machine, Session, same_rate, whole_range_um};
use hysteron_core::tracking_law::PLAYS;
use hysteron_firmware::controller::Controller;
use hysteron_firmware::law::Complete;
use hysteron_firmware::parameters::Parameters;
use hysteron_firmware::telemetry::{About, DATAGRAM_BYTES, Requested, Requests, SAMPLES_AN_ABOUT, Sample};
use hysteron_firmware::trajectory::Shape;
use hysteron_firmware::upload::{Answer, Message, Messages, Said, Upload};
use hysteron_firmware::wire::{Frame, Hello, Input, Mode, Order, Setup};
use hysteron_plant::Stage;
use hysteron_slot::model::Flash;
use hysteron_slot::{Image, Numbers, Refusal, Rule, SLOTS, Slots, Verdict, check, most_bytes};
use hysteron_table::Table;
use std::collections::VecDeque;
use std::io::{ErrorKind, Read, Write};
use std::net::{Ipv4Addr, SocketAddr, TcpListener, TcpStream, UdpSocket};
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

/// What it calls itself.
pub const NAME: &str = "simulated";
/// Ticks between two looks at the connection: 5 ms at 50 kHz.
const TICKS_A_LOOK: u32 = 250;
/// An emulator that nobody has ended ends after a day.
const LONGEST: Duration = Duration::from_secs(86_400);
/// Longest table, and the slot that holds it, in whole pages of the flash.
const TABLE_BYTES: usize = most_bytes(PLAYS, true);
const PAGE_BYTES: usize = 2048;
const SLOT_BYTES: usize = TABLE_BYTES.next_multiple_of(PAGE_BYTES);
/// The flash: two slots.
type Chip = Flash<8, PAGE_BYTES, { SLOTS * SLOT_BYTES }>;

/// A simulated board that is listened to; it ends when this is dropped.
#[derive(Debug)]
pub struct Served {
    address: String,
    over: Arc<AtomicBool>,
    thread: Option<JoinHandle<()>>,
}

impl Served {
    /// Starts the law of a table on a port of its own of this machine alone, at its safe level, in real time where the machine is fast
    /// enough.
    ///
    /// # Errors
    /// A table without a complete law or one that its rules refuse, another rate than the stage's, no port.
    ///
    /// # Cost
    /// Some 15 us of one core a tick.
    pub fn start(text: &str, stage: Stage) -> Result<Self, BoardError> {
        let table = Table::parse(text)?;
        let hello = crate::host::hello(&table, text);
        same_rate(1.0 / stage.config().sample_period_s, &hello)?;
        let (stored, parameters) = Stored::new(&table, hello)?;
        let about = About {
            hello,
            adc_um: [table.adc_min_um as f32, table.adc_top_um as f32],
            dac_v: [table.dac_min_v as f32, table.dac_top_v as f32],
            axis: 0,
            ..About::of(NAME)
        };
        let mut front = Front::new(stage, about)?;
        front.stored = Some(stored);
        Self::run(front, move |front| {
            let mut controller = asleep(parameters);
            for number in 0.. {
                let input = front.input(number);
                if front.over() {
                    return;
                }
                if let Some(parameters) = front.started.take() {
                    controller = asleep(parameters);
                }
                front.output(&controller.step(input, false));
            }
        })
    }

    /// Starts an image in the emulator, as slowly as that is: some thousand ticks a second. It has no slots.
    ///
    /// # Errors
    /// As [`Session::start`]; another rate than the stage's, a stage without converters, no port.
    pub fn emulated(machine: Machine, image: &Path, stage: Stage) -> Result<Self, BoardError> {
        let mut session = Session::start(machine, image, LONGEST)?;
        let hello = *session.hello();
        same_rate(1.0 / stage.config().sample_period_s, &hello)?;
        // The highest code lies a step below full scale.
        let range = |ends: Option<[f64; 2]>| {
            ends.map(|[low, full_scale]| [low, full_scale - (full_scale - low) / 65_536.0].map(|end| end as f32))
        };
        let config = stage.config();
        let (Some(adc_um), Some(dac_v)) = (range(config.adc_um()), range(config.dac_v())) else {
            return Err(BoardError::Senseless("converters' ranges"));
        };
        let about = About {
            hello,
            adc_um,
            dac_v,
            axis: 0,
            ..About::of(machine.name())
        };
        // On its own clock: without, an image takes inputs in bulk.
        let setup = Setup {
            ticks: u32::MAX,
            ..asleep_setup(whole_range_um(&hello).map(|um| um as f32))
        };
        let front = Front::new(stage, about)?;
        Self::run(front, move |front| {
            // However it ends, the connection does.
            let _ = session.run(&setup, front, &mut |_| {});
        })
    }

    fn run(mut front: Front, work: impl FnOnce(&mut Front) + Send + 'static) -> Result<Self, BoardError> {
        let address = front.listener.local_addr()?.to_string();
        let over = Arc::clone(&front.over);
        let thread = std::thread::spawn(move || work(&mut front));
        Ok(Self {
            address,
            over,
            thread: Some(thread),
        })
    }

    /// Where it is listened for, `HOST:PORT`.
    pub fn address(&self) -> &str {
        &self.address
    }
}

impl Drop for Served {
    fn drop(&mut self) {
        self.over.store(true, Ordering::Relaxed);
        // A thread that panicked has ended as well.
        let _ = self.thread.take().map(JoinHandle::join);
    }
}

/// The stage, and whoever has connected last.
struct Front {
    listener: TcpListener,
    /// Of the same port.
    datagrams: UdpSocket,
    over: Arc<AtomicBool>,
    host: Option<Host>,
    stage: Stage,
    about: About,
    /// What it is asked for, one a tick.
    orders: VecDeque<Order>,
    /// What is to be sent, and the samples.
    packets: Vec<u8>,
    samples: Vec<u8>,
    mode: Mode,
    /// The sensor's code of this tick.
    adc: u16,
    /// When the next look is due.
    due: Instant,
    stored: Option<Stored>,
    /// The law of a new start.
    started: Option<Parameters<Complete>>,
}

impl Front {
    fn new(stage: Stage, about: About) -> Result<Self, BoardError> {
        let listener = TcpListener::bind((Ipv4Addr::LOCALHOST, 0))?;
        listener.set_nonblocking(true)?;
        let datagrams = UdpSocket::bind(listener.local_addr()?)?;
        datagrams.set_nonblocking(true)?;
        Ok(Self {
            listener,
            datagrams,
            over: Arc::default(),
            host: None,
            stage,
            about,
            orders: VecDeque::new(),
            packets: Vec::new(),
            samples: Vec::new(),
            mode: Mode::Off,
            adc: 0,
            due: Instant::now(),
            stored: None,
            started: None,
        })
    }

    /// Sends what there is, hears what has come, takes whoever connects, and waits until its time has come.
    fn look(&mut self) {
        let mut packets = std::mem::take(&mut self.packets);
        let samples = std::mem::take(&mut self.samples);
        if let Some(mut host) = self.host.take() {
            match host.samples_to {
                Some(to) => self.send_samples(&samples, to),
                None => packets.extend(samples),
            }
            let sent = host.send(&packets);
            // The last that is said before a connection ends, too.
            self.hear(&mut host);
            self.host = sent.is_ok().then_some(host);
        }
        if let Ok((stream, _)) = self.listener.accept() {
            self.host = Host::new(stream);
        }
        self.due += Duration::from_secs_f64(f64::from(TICKS_A_LOOK) * self.stage.config().sample_period_s);
        match self.due.checked_duration_since(Instant::now()) {
            Some(early) => std::thread::sleep(early),
            // Too slow a machine: the board's time goes on from here.
            None => self.due = Instant::now(),
        }
    }

    /// Whole packets; a datagram that does not go out is lost, and its ticks with it.
    fn send_samples(&self, samples: &[u8], to: SocketAddr) {
        for datagram in samples.chunks(DATAGRAM_BYTES) {
            let _ = self.datagrams.send_to(datagram, to);
        }
    }

    fn hear(&mut self, host: &mut Host) {
        let asked = host.heard(&mut self.orders);
        let Some(stored) = &mut self.stored else {
            return;
        };
        for message in asked {
            let answer = stored.say(message, self.mode == Mode::Off);
            match message {
                Message::Ask => stored
                    .verdicts()
                    .for_each(|answer| self.packets.extend(answer.to_packet())),
                _ => self.packets.extend(answer.to_packet()),
            }
            if message == Message::Restart && answer.refused.is_none() {
                let (parameters, hello) = stored.start();
                self.about.hello = hello;
                self.started = Some(parameters);
                self.mode = Mode::Off;
                self.packets.extend(self.about.to_packet());
            }
        }
    }
}

impl Bench for Front {
    fn sample_rate_hz(&self) -> f64 {
        1.0 / self.stage.config().sample_period_s
    }

    fn input(&mut self, number: u32) -> Input {
        if number.is_multiple_of(TICKS_A_LOOK) {
            self.look();
        }
        if number.is_multiple_of(SAMPLES_AN_ABOUT) {
            self.packets.extend(self.about.to_packet());
        }
        self.adc = adc(&self.stage);
        let order = self.orders.pop_front().unwrap_or_default();
        Input { adc: self.adc, order }
    }

    fn output(&mut self, frame: &Frame) {
        self.mode = frame.mode();
        self.stage.step(self.stage.v_from_code(u32::from(frame.dac)));
        let sample = Sample {
            frame: *frame,
            adc: self.adc,
            axis: 0,
        };
        self.samples.extend(sample.to_packet());
    }

    fn over(&self) -> bool {
        self.over.load(Ordering::Relaxed)
    }
}

/// Whoever is connected.
struct Host {
    stream: TcpStream,
    /// Where samples go that it wants by UDP.
    samples_to: Option<SocketAddr>,
    reader: Requests,
    messages: Messages,
}

impl Host {
    fn new(stream: TcpStream) -> Option<Self> {
        stream.set_nonblocking(true).ok()?;
        Some(Self {
            stream,
            samples_to: None,
            reader: Requests::default(),
            messages: Messages::default(),
        })
    }

    /// What has come: orders into their row, and the messages about slots.
    fn heard(&mut self, orders: &mut VecDeque<Order>) -> Vec<Message> {
        let mut asked = Vec::new();
        let mut bytes = [0; 4096];
        while let Ok(length @ 1..) = self.stream.read(&mut bytes) {
            for &byte in bytes.iter().take(length) {
                match self.reader.push(byte) {
                    Some(Requested::Order(order)) => orders.push_back(order),
                    Some(Requested::SamplesTo(port)) => {
                        let peer = self.stream.peer_addr().ok().filter(|_| port > 0);
                        self.samples_to = peer.map(|peer| SocketAddr::new(peer.ip(), port));
                    }
                    None => {}
                }
                asked.extend(self.messages.push(byte));
            }
        }
        asked
    }

    /// Sends packets; those that do not fit where nobody reads are left out as a whole, as a board does.
    fn send(&mut self, packets: &[u8]) -> std::io::Result<()> {
        match self.stream.write(packets) {
            Ok(sent) if sent < packets.len() => {
                // The rest of what was begun, or the next packet would not be found.
                self.stream.set_nonblocking(false)?;
                self.stream.set_write_timeout(Some(Duration::from_secs(1)))?;
                self.stream.write_all(packets.get(sent..).unwrap_or_default())?;
                self.stream.set_nonblocking(true)
            }
            Ok(_) => Ok(()),
            Err(error) if error.kind() == ErrorKind::WouldBlock => Ok(()),
            Err(error) => Err(error),
        }
    }
}

/// The slots of a flash, and the table that the board was made with.
struct Stored {
    first: (Parameters<Complete>, Hello),
    image: Image,
    numbers: Numbers<PLAYS>,
    slots: Slots<Chip>,
    upload: Box<Upload<TABLE_BYTES>>,
    verdicts: [Verdict; SLOTS],
    spare: usize,
    last: Option<u32>,
    taken: Option<(usize, u32)>,
}

impl Stored {
    fn new(table: &Table, hello: Hello) -> Result<(Self, Parameters<Complete>), BoardError> {
        let numbers = table.numbers::<PLAYS>();
        let mut stored = Self {
            first: (complete(table)?, hello),
            image: Image::of(&numbers),
            numbers,
            slots: Slots::new(Chip::default(), [0, SLOT_BYTES as u32], SLOT_BYTES as u32),
            upload: Box::new(Upload::new()),
            verdicts: [Err(Refusal::new(Rule::Erased, "slot", 0.0)); SLOTS],
            spare: 0,
            last: None,
            taken: None,
        };
        let (parameters, _) = stored.start();
        Ok((stored, parameters))
    }

    /// A new start: the newest table of a slot, or the first.
    fn start(&mut self) -> (Parameters<Complete>, Hello) {
        let mut made = None;
        let (image, numbers) = (&self.image, &mut self.numbers);
        let mut take = |bytes: &[u8]| {
            let (header, sweep) = check(bytes, image, numbers)?;
            let law = Complete::of(numbers, &sweep).and_then(|law| Parameters::of(law, numbers, &sweep));
            let law = law.map_err(|error| Refusal::of_core("", error))?;
            made = Some((law, Hello::of(numbers, header.hash, 0, 1)));
            Ok(())
        };
        let chosen = self.slots.choose(&mut take, self.upload.room(), None, &mut |_| {});
        self.verdicts = chosen.verdicts;
        self.last = chosen.last;
        self.spare = chosen.spare;
        made.filter(|_| chosen.found.is_some()).unwrap_or(self.first)
    }

    /// What the last start found in each slot.
    fn verdicts(&self) -> impl Iterator<Item = Answer<'static>> + use<> {
        (0..).zip(self.verdicts).map(|(slot, verdict)| Answer {
            to: Said::Slot(slot),
            number: verdict.unwrap_or(0),
            refused: verdict.err(),
        })
    }

    fn say(&mut self, message: Message, at_rest: bool) -> Answer<'static> {
        let running = || Refusal::new(Rule::Running, "mode", 1.0);
        let (to, said) = match message {
            Message::Ask => (Said::Due, Ok(0)),
            Message::Begin { length, sum } => {
                self.taken = None;
                (Said::Due, self.upload.begin(length, sum))
            }
            Message::Piece { place, bytes } => (Said::Due, Ok(self.upload.piece(place, &bytes))),
            Message::Commit => match self.commit(at_rest) {
                Ok((slot, sequence)) => (Said::Taken(slot as u8), Ok(sequence)),
                Err(refused) => (Said::Taken(0), Err(refused)),
            },
            Message::Restart => (Said::Restarting, at_rest.then_some(0).ok_or_else(running)),
        };
        Answer {
            to,
            number: said.unwrap_or(0),
            refused: said.err(),
        }
    }

    /// The table that came, by every check of a start, to the slot that is not in use.
    fn commit(&mut self, at_rest: bool) -> Result<(usize, u32), Refusal<'static>> {
        if let Some(taken) = self.taken {
            return Ok(taken);
        }
        let bytes = self.upload.whole()?;
        check(bytes, &self.image, &mut self.numbers)?;
        if !at_rest {
            return Err(Refusal::new(Rule::Running, "mode", 1.0));
        }
        let taken = (self.spare, self.slots.write(bytes, self.spare, self.last)?);
        self.last = Some(taken.1);
        self.taken = Some(taken);
        Ok(taken)
    }
}

/// At its safe level.
fn asleep(parameters: Parameters<Complete>) -> Controller<Complete> {
    let setup = asleep_setup(parameters.range_um);
    Controller::new(parameters, &setup)
}

fn asleep_setup([low_um, high_um]: [f32; 2]) -> Setup {
    Setup {
        ticks: 0,
        shape: Shape::Sine,
        // 12 Hz at 50 kHz.
        phase_step: 1 << 20,
        low_um,
        high_um,
        feedforward: true,
        feedback: true,
        clocked: true,
    }
}
