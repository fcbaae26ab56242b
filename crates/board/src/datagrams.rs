//! Samples by UDP beside a connection: what comes by either, as one stream of whole packets.
//!
//! The board is asked over the connection to send its samples to a port of this machine. A datagram that is lost is never sent again: the
//! frames' numbers tell which ticks it had, and nothing after it waits.

use crate::BoardError;
use crate::capture::{Chunk, Opened, PATIENCE, connect, failed};
use hysteron_firmware::telemetry::{DATAGRAM_BYTES, all, samples_to_packet};
use std::io::{Error, ErrorKind, Read, Write};
use std::net::{IpAddr, SocketAddr, TcpStream, UdpSocket};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{SyncSender, sync_channel};
use std::time::{Duration, Instant};

/// What `--from` begins with where samples come by UDP.
pub(crate) const SCHEME: &str = "udp://";

/// Datagrams and pieces of the connection that wait for their reader.
const WAITING: usize = 4096;
/// Longest until the end of the connection is that of the datagrams, too.
const LOOK: Duration = Duration::from_millis(100);

/// Connects, and asks for samples by UDP.
pub(crate) fn open(from: &str) -> Result<Opened, BoardError> {
    let asked = connect(from.strip_prefix(SCHEME).unwrap_or(from))?;
    let (stream, socket) = begin(&asked).map_err(failed(from))?;
    let (sender, chunks) = sync_channel(WAITING);
    let of_datagrams = sender.clone();
    let over = Arc::new(AtomicBool::new(false));
    let is_over = Arc::clone(&over);
    std::thread::spawn(move || datagrams(&socket, &is_over, &of_datagrams));
    std::thread::spawn(move || {
        packets(stream, &sender);
        over.store(true, Ordering::Relaxed);
    });
    Ok((chunks, Some(asked)))
}

/// A socket that hears the board alone, and the request that it send there.
fn begin(asked: &TcpStream) -> std::io::Result<(TcpStream, UdpSocket)> {
    let (here, board) = (asked.local_addr()?.ip(), asked.peer_addr()?);
    let socket = UdpSocket::bind(SocketAddr::new(any_of(here), 0))?;
    socket.connect(board)?;
    socket.set_read_timeout(Some(LOOK))?;
    let mut stream = asked.try_clone()?;
    stream.write_all(&samples_to_packet(socket.local_addr()?.port()))?;
    Ok((stream, socket))
}

/// An address that any interface of this machine's has.
fn any_of(here: IpAddr) -> IpAddr {
    match here {
        IpAddr::V4(_) => std::net::Ipv4Addr::UNSPECIFIED.into(),
        IpAddr::V6(_) => std::net::Ipv6Addr::UNSPECIFIED.into(),
    }
}

/// Until the connection is over, or no sample comes.
fn datagrams(socket: &UdpSocket, over: &AtomicBool, to: &SyncSender<Chunk>) {
    let mut buffer = [0; 2 * DATAGRAM_BYTES];
    let mut heard = Instant::now();
    while !over.load(Ordering::Relaxed) {
        let came = match socket.recv(&mut buffer) {
            Ok(length) => {
                heard = Instant::now();
                Ok(buffer.get(..length).unwrap_or_default().to_vec())
            }
            Err(error) if matches!(error.kind(), ErrorKind::WouldBlock | ErrorKind::TimedOut) => {
                if heard.elapsed() < PATIENCE {
                    continue;
                }
                // A board that says nothing more by UDP, or whose datagrams something on the way keeps.
                Err(Error::new(
                    ErrorKind::TimedOut,
                    "no sample came by UDP; a firewall may keep it: without udp:// samples come over the connection",
                ))
            }
            // What another datagram of this machine has met.
            Err(error) if matches!(error.kind(), ErrorKind::Interrupted | ErrorKind::ConnectionRefused) => continue,
            Err(error) => Err(error),
        };
        let ended = came.is_err();
        if to.send(came).is_err() || ended {
            return;
        }
    }
}

/// What comes over the connection, cut where packets end: a datagram may follow there. What has not ended with it is no packet.
fn packets(mut stream: TcpStream, to: &SyncSender<Chunk>) {
    let mut buffer = [0; 4096];
    let mut rest: Vec<u8> = Vec::new();
    loop {
        let came = match stream.read(&mut buffer) {
            Ok(0) => return,
            Ok(length) => {
                rest.extend(buffer.iter().take(length));
                let ended: usize = all(&rest).map(|found| found.length()).sum();
                Ok(rest.drain(..ended).collect())
            }
            Err(error) if error.kind() == ErrorKind::Interrupted => continue,
            Err(error) => Err(error),
        };
        let ended = came.is_err();
        if to.send(came).is_err() || ended {
            return;
        }
    }
}
