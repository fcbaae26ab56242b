//! The board's cable: the MAC of the STM32H743 with the LAN8742A beside it, polled by main.
//!
//! Its packets lie in the AXI SRAM, which the MAC reaches and nothing of the loop's uses. Its interrupt stays masked.

use crate::Shared;
use core::cell::UnsafeCell;
use core::mem::MaybeUninit;
use core::sync::atomic::{Ordering, fence};
use core::task::{Context, Waker};
use embassy_net_driver::{Driver, RxToken as _, TxToken as _};
use embassy_stm32::eth::{self, Ethernet, InterruptHandler, PacketQueue, Phy, Sma, StationManagement};
use embassy_stm32::gpio::{AfType, Flex, Pull};
use embassy_stm32::interrupt::{Interrupt, InterruptExt};
use embassy_stm32::pac::syscfg::vals::EthSelPhy;
use embassy_stm32::peripherals::{ETH, ETH_SMA, PA1, PA2, PA7, PB13, PC1, PC4, PC5, PG11, PG13};
use embassy_stm32::{Peri, bind_interrupts, pac, uid};
use hysteron_firmware::network::{Buffers, Network, Place, Places};
use smoltcp::phy::{Device, DeviceCapabilities, Medium};
use smoltcp::time::Instant;
use static_cell::{ConstStaticCell, StaticCell};

include!(concat!(env!("OUT_DIR"), "/place.rs"));

/// Looks at the MAC's reset, which ends once the PHY gives its clock: at 64 MHz and more cycles a look some milliseconds.
const CLOCK_LOOKS: u32 = 20_000;
/// The PHY's address on this board (UM2407, "Ethernet"), and its registers (IEEE 802.3, clause 22).
const ADDRESS_OF_PHY: u8 = 0;
const CONTROL: u8 = 0;
const STATUS: u8 = 1;
/// 100 Mbit/s, negotiate, begin anew.
const NEGOTIATE: u16 = 1 << 13 | 1 << 12 | 1 << 9;
/// Negotiated, and up.
const IS_UP: u16 = 1 << 5 | 1 << 2;
/// Frames of 1.5 kB that wait for the cable, and that wait for main.
const OUT: usize = 8;
const IN: usize = 4;

// `clear` sets the section to zero, which is what an empty one of each is.
#[unsafe(link_section = ".cable.queue")]
static QUEUE: Shared<PacketQueue<OUT, IN>> = Shared(UnsafeCell::new(MaybeUninit::uninit()));
#[unsafe(link_section = ".cable.buffers")]
static BUFFERS: ConstStaticCell<Buffers> = ConstStaticCell::new(Buffers::new());
#[unsafe(link_section = ".cable.places")]
static PLACES: StaticCell<Places> = StaticCell::new();
#[unsafe(link_section = ".cable.network")]
static NETWORK: StaticCell<Network> = StaticCell::new();

bind_interrupts!(struct Masked {
    ETH => InterruptHandler;
});

/// What the cable takes of the chip.
pub struct Pins {
    pub mac: Peri<'static, ETH>,
    pub station: Peri<'static, ETH_SMA>,
    pub clock: Peri<'static, PA1>,
    pub mdio: Peri<'static, PA2>,
    pub mdc: Peri<'static, PC1>,
    pub carrier: Peri<'static, PA7>,
    pub rx: (Peri<'static, PC4>, Peri<'static, PC5>),
    pub tx: (Peri<'static, PG13>, Peri<'static, PB13>),
    pub enable: Peri<'static, PG11>,
}

/// The PHY, without the library's waits for it.
struct Lan8742 {
    station: Sma<'static, ETH_SMA>,
}

impl Phy for Lan8742 {
    /// The chip's reset is its own as well.
    fn phy_reset(&mut self) {}

    fn phy_init(&mut self) {
        self.station.smi_write(ADDRESS_OF_PHY, CONTROL, NEGOTIATE);
    }

    fn poll_link(&mut self, _: &mut Context<'_>) -> bool {
        self.station.smi_read(ADDRESS_OF_PHY, STATUS) & IS_UP == IS_UP
    }
}

/// The MAC as the network's device.
struct Cable {
    ethernet: Ethernet<'static, ETH, Lan8742>,
}

/// Tokens of the one kind as those of the other.
struct Came<'a>(eth::RxToken<'a, 'static>);
struct Room<'a>(eth::TxToken<'a, 'static>);

impl smoltcp::phy::RxToken for Came<'_> {
    fn consume<R, F: FnOnce(&[u8]) -> R>(self, f: F) -> R {
        self.0.consume(|frame| f(frame))
    }
}

impl smoltcp::phy::TxToken for Room<'_> {
    fn consume<R, F: FnOnce(&mut [u8]) -> R>(self, length: usize, f: F) -> R {
        self.0.consume(length, f)
    }
}

impl Device for Cable {
    type RxToken<'a> = Came<'a>;
    type TxToken<'a> = Room<'a>;

    fn receive(&mut self, _: Instant) -> Option<(Came<'_>, Room<'_>)> {
        let (came, room) = self.ethernet.receive(&mut Context::from_waker(Waker::noop()))?;
        Some((Came(came), Room(room)))
    }

    fn transmit(&mut self, _: Instant) -> Option<Room<'_>> {
        self.ethernet
            .transmit(&mut Context::from_waker(Waker::noop()))
            .map(Room)
    }

    fn capabilities(&self) -> DeviceCapabilities {
        let mut capabilities = DeviceCapabilities::default();
        capabilities.medium = Medium::Ethernet;
        capabilities.max_transmission_unit = self.ethernet.capabilities().max_transmission_unit;
        capabilities
    }
}

/// The network on the cable.
pub struct Link {
    cable: Cable,
    network: &'static mut Network,
}

impl Link {
    /// Nothing where the PHY gives no clock: the board then has its debug probe alone.
    ///
    /// By itself, or main would keep what it takes of its stack.
    #[inline(never)]
    pub fn start(mut pins: Pins) -> Option<Self> {
        if !is_clocked(&mut pins.clock) {
            return None;
        }
        clear();
        let uid = uid::uid();
        let place = Place {
            // Locally administered, by the chip's own number.
            hardware: [0x02, uid[0], uid[2], uid[4], uid[8], uid[9]],
            address: ADDRESS,
            prefix: PREFIX,
        };
        let phy = Lan8742 {
            station: Sma::new(pins.station, pins.mdio, pins.mdc),
        };
        // SAFETY: a start calls this once, and nothing else knows of the queue; zeros are an empty one.
        let queue = unsafe {
            let queue = &mut *QUEUE.0.get();
            PacketQueue::init(queue);
            queue.assume_init_mut()
        };
        let ethernet = Ethernet::new_with_phy(
            queue,
            pins.mac,
            Masked,
            pins.clock,
            pins.carrier,
            pins.rx.0,
            pins.rx.1,
            pins.tx.0,
            pins.tx.1,
            pins.enable,
            place.hardware,
            phy,
        );
        Interrupt::ETH.disable();
        let mut cable = Cable { ethernet };
        let seed = u64::from(cortex_m::peripheral::DWT::cycle_count());
        let network = Network::new(&mut cable, (BUFFERS.take(), PLACES.init_with(Places::new)), place, seed);
        Some(Self {
            network: NETWORK.init_with(|| network),
            cable,
        })
    }

    /// Frames to and fro; `now_us` counts from the board's start.
    pub fn poll(&mut self, now_us: i64) {
        fence(Ordering::SeqCst);
        self.network.poll(&mut self.cable, now_us);
    }

    /// The board's end of both ways.
    pub fn network(&mut self) -> &mut Network {
        self.network
    }
}

/// Sets the section to zero, which nothing has written since power came. By eight bytes: the AXI SRAM has check bits for as many (RM0433,
/// "Error code correction").
fn clear() {
    unsafe extern "C" {
        #[link_name = "__cable_start"]
        static START: UnsafeCell<[u64; 0]>;
        #[link_name = "__cable_end"]
        static END: UnsafeCell<[u64; 0]>;
    }
    // SAFETY: the linker's ends of the section, a multiple of eight bytes; a start calls this once, before anything uses what lies there.
    unsafe {
        let mut place = START.get().cast::<u64>();
        while place < END.get().cast() {
            place.write_volatile(0);
            place = place.add(1);
        }
    }
}

/// Whether the MAC's reset ends, which it does by the PHY's clock (RM0433, "ETH_DMAMR"); the library would wait for it.
fn is_clocked(clock: &mut Peri<'static, PA1>) -> bool {
    // ETH_REF_CLK is alternate function 11 of PA1 (DS12110); the library takes it over.
    let mut pin = Flex::new(clock.reborrow());
    pin.set_as_af_unchecked(11, AfType::input(Pull::None));
    pac::RCC.ahb1enr().modify(|w| {
        w.set_ethen(true);
        w.set_ethtxen(true);
        w.set_ethrxen(true);
    });
    pac::SYSCFG.pmcr().modify(|w| w.set_eth_sel_phy(EthSelPhy::RMII));
    let dma = pac::ETH.ethernet_dma();
    dma.dmamr().modify(|w| w.set_swr(true));
    (0..CLOCK_LOOKS).any(|_| !dma.dmamr().read().swr())
}
