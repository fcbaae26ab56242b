//! Samples by UDP beside a connection: what comes by either, as one stream of whole packets.
//!
//! The board is asked over the connection to send its samples to a port of this machine. A datagram that is lost is never sent again: the
//! frames' numbers tell which ticks it had, and nothing after it waits.

use crate::capture::{PATIENCE, failed};
use crate::{BoardError, capture};
use hysteron_firmware::telemetry::{DATAGRAM_BYTES, Found, find, samples_to_packet};
use std::io::{Error, ErrorKind, Read, Write};
use std::net::{IpAddr, SocketAddr, TcpStream, UdpSocket};
use std::sync::mpsc::{Receiver, SyncSender, sync_channel};

/// What `--from` begins with where samples come by UDP.
pub(crate) const SCHEME: &str = "udp://";

/// Datagrams and pieces of the connection that wait for their reader.
const WAITING: usize = 4096;

/// Both ways as one stream. Empty chunks end it.
struct Merged {
    chunks: Receiver<std::io::Result<Vec<u8>>>,
    chunk: Vec<u8>,
    at: usize,
}

/// Connects, and asks for samples by UDP.
pub(crate) fn open(from: &str) -> Result<capture::Opened, BoardError> {
    let address = from.strip_prefix(SCHEME).unwrap_or(from);
    let asked = capture::connect(address)?;
    let (stream, socket) = begin(&asked).map_err(failed(from))?;
    let (sender, chunks) = sync_channel(WAITING);
    let of_datagrams = sender.clone();
    std::thread::spawn(move || datagrams(&socket, &of_datagrams));
    std::thread::spawn(move || packets(stream, &sender));
    let merged = Merged {
        chunks,
        chunk: Vec::new(),
        at: 0,
    };
    Ok((Box::new(merged), Some(asked)))
}

/// A socket that hears the board alone, and the request that it send there.
fn begin(asked: &TcpStream) -> std::io::Result<(TcpStream, UdpSocket)> {
    let (here, board) = (asked.local_addr()?.ip(), asked.peer_addr()?);
    let socket = UdpSocket::bind(SocketAddr::new(any_of(here), 0))?;
    socket.connect(board)?;
    socket.set_read_timeout(Some(PATIENCE))?;
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

fn datagrams(socket: &UdpSocket, to: &SyncSender<std::io::Result<Vec<u8>>>) {
    let mut buffer = [0; 2 * DATAGRAM_BYTES];
    loop {
        let came = match socket.recv(&mut buffer) {
            Ok(length) => Ok(buffer.get(..length).unwrap_or_default().to_vec()),
            // A board that says nothing more by UDP, or whose datagrams something on the way keeps.
            Err(error) if matches!(error.kind(), ErrorKind::WouldBlock | ErrorKind::TimedOut) => Err(Error::new(
                ErrorKind::TimedOut,
                "no sample came by UDP; a firewall may keep it: without udp:// samples come over the connection",
            )),
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

/// What comes over the connection, cut where packets end: a datagram may follow there.
fn packets(mut stream: TcpStream, to: &SyncSender<std::io::Result<Vec<u8>>>) {
    let mut buffer = [0; 4096];
    let mut rest: Vec<u8> = Vec::new();
    loop {
        let came: std::io::Result<Vec<u8>> = match stream.read(&mut buffer) {
            // An empty chunk is the end; what has not ended until then is no packet.
            Ok(0) => Ok(Vec::new()),
            Ok(length) => {
                rest.extend(buffer.iter().take(length));
                let packets: Vec<u8> = rest.drain(..whole(&rest)).collect();
                if packets.is_empty() {
                    continue;
                }
                Ok(packets)
            }
            Err(error) if error.kind() == ErrorKind::Interrupted => continue,
            Err(error) => Err(error),
        };
        let ended = came.as_ref().map_or(true, Vec::is_empty);
        if to.send(came).is_err() || ended {
            return;
        }
    }
}

/// Length of the packets that have ended, with what is none.
fn whole(bytes: &[u8]) -> usize {
    let mut at = 0;
    while let Some(left) = bytes.get(at..).filter(|left| !left.is_empty()) {
        match find(left) {
            Found::Incomplete => break,
            found => at += found.length(),
        }
    }
    at
}

impl Read for Merged {
    fn read(&mut self, buffer: &mut [u8]) -> std::io::Result<usize> {
        if self.at >= self.chunk.len() {
            // Both threads have gone: the stream has ended.
            self.chunk = self.chunks.recv().unwrap_or_else(|_| Ok(Vec::new()))?;
            self.at = 0;
        }
        let left = self.chunk.get(self.at..).unwrap_or_default();
        let length = left.len().min(buffer.len());
        for (place, byte) in buffer.iter_mut().zip(left) {
            *place = *byte;
        }
        self.at += length;
        Ok(length)
    }
}
