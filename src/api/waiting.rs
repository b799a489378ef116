//! Places for connections that have not shown a token, or not sent their request. Who comes last is let in: the one that has waited longest
//! goes, so that silent strangers keep nobody out.

use std::cell::{Cell, RefCell};
use std::collections::VecDeque;
use std::net::IpAddr;
use std::rc::Rc;
use tokio::sync::oneshot;

/// The connections that wait.
#[derive(Debug)]
pub(super) struct WaitingRoom {
    most: usize,
    most_of_address: usize,
    guests: RefCell<VecDeque<Guest>>,
    next: Cell<u64>,
    sent_away: Cell<u64>,
}

#[derive(Debug)]
struct Guest {
    number: u64,
    address: Option<IpAddr>,
    /// Dropped to send the guest away.
    _stays: oneshot::Sender<()>,
}

/// A place, given back when it is dropped.
#[derive(Debug)]
pub(super) struct Seat {
    room: Rc<WaitingRoom>,
    number: u64,
    is_over: oneshot::Receiver<()>,
}

impl WaitingRoom {
    pub(super) fn new(most: usize, most_of_address: usize) -> Rc<Self> {
        let guests = RefCell::new(VecDeque::with_capacity(most));
        Rc::new(Self { most, most_of_address, guests, next: Cell::default(), sent_away: Cell::default() })
    }

    /// A place for a newcomer. If the room is full, or has many from this address, the guest that has waited longest goes, of the address that
    /// has most.
    pub(super) fn enter(self: &Rc<Self>, address: Option<IpAddr>) -> Seat {
        let address = address.map(network);
        let mut guests = self.guests.borrow_mut();
        let of = |guests: &VecDeque<Guest>, address| guests.iter().filter(|guest| guest.address == address).count();
        let crowded = if of(&guests, address) >= self.most_of_address {
            Some(address)
        } else if guests.len() >= self.most {
            guests.iter().map(|guest| guest.address).max_by_key(|address| of(&guests, *address))
        } else {
            None
        };
        if let Some(crowded) = crowded
            && let Some(oldest) = guests.iter().position(|guest| guest.address == crowded)
        {
            guests.remove(oldest);
            self.sent_away.set(self.sent_away.get() + 1);
        }
        let (stays, is_over) = oneshot::channel();
        let number = self.next.replace(self.next.get() + 1);
        guests.push_back(Guest { number, address, _stays: stays });
        Seat { room: Rc::clone(self), number, is_over }
    }

    /// Connections sent away so far.
    pub(super) fn sent_away(&self) -> u64 {
        self.sent_away.get()
    }
}

impl Seat {
    /// Returns when the place is given to a newcomer.
    pub(super) async fn lost(&mut self) {
        let _ = (&mut self.is_over).await;
    }
}

impl Drop for Seat {
    fn drop(&mut self) {
        self.room.guests.borrow_mut().retain(|guest| guest.number != self.number);
    }
}

/// The address, or its network: one customer has a whole IPv6 network.
fn network(address: IpAddr) -> IpAddr {
    match address {
        IpAddr::V4(_) => address,
        IpAddr::V6(v6) => match v6.to_ipv4_mapped() {
            Some(v4) => v4.into(),
            None => IpAddr::V6((v6.to_bits() & !u128::from(u64::MAX)).into()),
        },
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn address(text: &str) -> Option<IpAddr> {
        Some(text.parse().unwrap())
    }

    fn is_lost(seat: &mut Seat) -> bool {
        !matches!(seat.is_over.try_recv(), Err(oneshot::error::TryRecvError::Empty))
    }

    #[test]
    fn who_has_waited_longest_goes_from_the_address_that_has_most() {
        let room = WaitingRoom::new(6, 4);
        let mut theirs: Vec<Seat> = (0..4).map(|_| room.enter(address("10.0.0.1"))).collect();
        let mut mine = room.enter(address("10.0.0.2"));
        assert!(!theirs.iter_mut().any(is_lost));
        theirs.push(room.enter(address("::ffff:10.0.0.1")));
        assert!(is_lost(&mut theirs[0]) && !is_lost(&mut theirs[1]), "one address has four places");
        let mut other = room.enter(address("2001:db8::1"));
        let mut same = room.enter(address("2001:db8::2"));
        assert!(is_lost(&mut theirs[1]), "a full room");
        assert!(![&mut mine, &mut other, &mut same].into_iter().any(is_lost));
        assert_eq!((room.sent_away(), room.guests.borrow().len()), (2, 6));
        drop((theirs, mine, other, same));
        assert!(room.guests.borrow().is_empty());
    }
}
