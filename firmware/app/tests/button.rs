//! The button: what a press asks for, that a bouncing one asks once, and that no order of the host's is lost to it.

use hysteron_firmware::button::{Button, Slot};
use hysteron_firmware::monitor::Fault;
use hysteron_firmware::wire::{Mode, Order};

/// Looks once a tick while the contact is as the pattern says, and what the interrupt takes on each.
fn orders(
    button: &mut Button,
    from: u32,
    contact: impl Fn(u32) -> bool,
    ticks: u32,
    at: (Mode, Option<Fault>),
) -> Vec<(u32, Order)> {
    let slot = Slot::new();
    let taken = (0..ticks).map(|k| from.wrapping_add(k)).map(|tick| {
        button.look(contact(tick), tick, at, &slot);
        (tick, slot.take())
    });
    taken.filter(|(_, order)| *order != Order::None).collect()
}

const OFF: (Mode, Option<Fault>) = (Mode::Off, None);

/// By what the loop is at, whoever has started it.
#[test]
fn val_what_a_press_asks_for() {
    for (at, asked) in [
        (OFF, Some(Order::Start)),
        ((Mode::Rising, None), Some(Order::Stop)),
        ((Mode::Running, None), Some(Order::Stop)),
        ((Mode::Falling, None), None),
        ((Mode::Off, Some(Fault::SensorJump)), Some(Order::Clear)),
        ((Mode::Falling, Some(Fault::SensorJump)), Some(Order::Clear)),
    ] {
        let found = orders(&mut Button::default(), 0, |_| true, 5000, at);
        // Steady for 500 ticks, once however long it is held.
        assert_eq!(found, asked.map(|order| (500, order)).into_iter().collect::<Vec<_>>());
    }
}

/// A contact that bounces for 5 ms both ways is one press; 499 ticks are none, 500 are; a press after a release is another.
#[test]
fn bva_a_contact_that_bounces() {
    let bouncing = |tick: u32| match tick {
        0..250 => tick % 7 < 3,
        250..3000 => true,
        3000..3250 => tick % 11 < 4,
        _ => false,
    };
    assert_eq!(
        orders(&mut Button::default(), 0, bouncing, 8000, OFF),
        [(750, Order::Start)]
    );
    for (held, presses) in [(500, 0), (501, 1)] {
        let found = orders(&mut Button::default(), 0, |tick| tick < held, 5000, OFF);
        assert_eq!(found.len(), presses, "{held}");
    }
    let twice = |tick: u32| tick % 2000 < 1000;
    let found = orders(&mut Button::default(), 0, twice, 4000, OFF);
    assert_eq!(found, [(500, Order::Start), (2500, Order::Start)]);
    // Where the ticks' number begins anew.
    let found = orders(&mut Button::default(), u32::MAX - 100, |_| true, 1000, OFF);
    assert_eq!(found, [(399, Order::Start)]);
}

/// An order of the host's that waits stays; the button's comes on the tick after it, and is not lost either.
#[test]
fn val_the_hosts_orders_stay() {
    let (slot, mut button) = (Slot::new(), Button::default());
    assert!(slot.is_empty() && slot.offer(Order::Byte(0x5a)));
    for tick in 0..600 {
        button.look(true, tick, OFF, &slot);
    }
    assert!(!slot.offer(Order::Stop));
    assert_eq!(slot.take(), Order::Byte(0x5a));
    button.look(true, 600, OFF, &slot);
    // Nor does the host take the button's place.
    assert!(!slot.offer(Order::Byte(1)));
    assert_eq!([slot.take(), slot.take()], [Order::Start, Order::None]);
    button.look(true, 601, OFF, &slot);
    assert!(slot.is_empty());
}

/// Every order comes out as it went in; a main that has failed does not wait.
#[test]
fn val_a_slot_keeps_what_it_is_given() {
    let slot = Slot::default();
    for order in [
        Order::Start,
        Order::Stop,
        Order::Clear,
        Order::Byte(255),
        Order::Apply(3),
        Order::To(2),
    ] {
        assert!(slot.offer(order));
        assert_eq!([slot.take(), slot.take()], [order, Order::None]);
    }
    slot.offer(Order::Start);
    slot.insist(Order::Stop);
    assert_eq!(slot.take(), Order::Stop);
}
