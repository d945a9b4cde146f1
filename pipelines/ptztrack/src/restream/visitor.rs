// SPDX-License-Identifier: MPL-2.0

//! Clients that have set up no stream yet: what they send is read before anybody has logged in, so they may send and stay no longer
//! than a log-in takes, and where there are too many, they make room.

use std::os::fd::AsRawFd;
use std::sync::{Arc, Mutex, Weak};
use std::time::{Duration, Instant};

use glib::translate::from_glib_none;
use gst_rtsp_server::{RTSPClient, RTSPServer, gio, prelude::*};
use ptztrack_contract::lock::lock;

use super::{LONGEST_BODY, MOST_CLIENTS};

/// Who has set up nothing by then is sent away. The server waits for a camera's first picture for 20 s.
const LONGEST_VISIT: Duration = Duration::from_secs(30);

/// What somebody may send until then: the server bounds a body, but neither the length of a head nor how many come.
const MOST_BYTES: u64 = 2 * LONGEST_BODY as u64;

/// What may wait in the kernel to be read, bytes: it is still read after the end of a visit, byte by byte.
const MOST_WAITING: i32 = 16 * 1024;

/// Between two looks at what they have sent.
const LOOK: Duration = Duration::from_millis(50);

/// What has become of a visit.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Visit {
    Open,
    /// A stream was set up.
    Settled,
    /// Others need the place.
    SentAway,
}

/// A client that has connected.
struct Visitor {
    client: glib::WeakRef<RTSPClient>,
    visit: Mutex<Visit>,
}

impl Visitor {
    fn is(&self, visit: Visit) -> bool {
        *lock(&self.visit) == visit
    }

    /// Ends its visit so, unless it has ended already: nobody is sent away from a stream.
    fn end(&self, end: Visit) -> bool {
        let mut visit = lock(&self.visit);
        let is_open = *visit == Visit::Open;
        if is_open {
            *visit = end;
        }
        is_open
    }

    /// Has it make room, where it has a place and no stream, neither one of its own nor one of a session of before.
    fn makes_room(&self) -> bool {
        let client = self.client.upgrade();
        client.is_some_and(|client| client.session_filter(None).is_empty()) && self.end(Visit::SentAway)
    }
}

/// Those who are being watched, oldest first.
#[derive(Default)]
pub(super) struct Visitors(Mutex<Vec<Weak<Visitor>>>);

impl Visitors {
    /// Takes on a client that has just connected, in the thread that carries out `context`.
    pub(super) fn receive(&self, server: &RTSPServer, client: &RTSPClient, context: &glib::MainContext) {
        let Some(socket) = socket_of(client) else { return };
        // Where it is not taken, more is read.
        let _ = socket.set_option(libc::SOL_SOCKET, libc::SO_RCVBUF, MOST_WAITING);
        let visitor = Arc::new(Visitor { client: client.downgrade(), visit: Mutex::new(Visit::Open) });
        // Not as a session begins: it may be for a transport that is refused.
        client.connect_setup_request({
            let visitor = Arc::downgrade(&visitor);
            move |_, _| {
                if let Some(visitor) = visitor.upgrade() {
                    visitor.end(Visit::Settled);
                }
            }
        });
        self.add(&visitor);
        if server.client_filter(None).len() > MOST_CLIENTS {
            self.make_room();
        }
        context.spawn_local(watch(socket, visitor));
    }

    /// Who is watched no more is forgotten.
    fn add(&self, visitor: &Arc<Visitor>) {
        let mut visitors = lock(&self.0);
        visitors.retain(|visitor| visitor.strong_count() > 0);
        visitors.push(Arc::downgrade(visitor));
    }

    /// Sends away who has been here for longest without a stream. The newcomer is the last of them: were it the first, those who only
    /// connect would keep everybody out.
    fn make_room(&self) {
        let visitors: Vec<_> = lock(&self.0).iter().filter_map(Weak::upgrade).collect();
        let _ = visitors.iter().any(|visitor| visitor.makes_room());
    }
}

/// By which a client has connected.
fn socket_of(client: &RTSPClient) -> Option<gio::Socket> {
    // SAFETY: the connection lives at least as long as its client, and the socket as long as somebody has a reference to it.
    unsafe {
        let connection = gst_rtsp_server::ffi::gst_rtsp_client_get_connection(client.as_ptr());
        let socket = gst_rtsp_server::gst_rtsp::ffi::gst_rtsp_connection_get_read_socket(connection);
        from_glib_none(socket)
    }
}

/// By which a client is answered: in a tunnel through HTTP, another than that by which it asks, and than that by which it connected where
/// its POST came first.
fn answering(client: &RTSPClient) -> Option<gio::Socket> {
    // SAFETY: as above. This socket goes with the connection; the one that is read from does not, as a tunnel may lose it.
    unsafe {
        let connection = gst_rtsp_server::ffi::gst_rtsp_client_get_connection(client.as_ptr());
        let socket = gst_rtsp_server::gst_rtsp::ffi::gst_rtsp_connection_get_write_socket(connection);
        from_glib_none(socket)
    }
}

/// Sends a client away that is to make room, or stays for too long or sends too much without setting up a stream.
async fn watch(socket: gio::Socket, visitor: Arc<Visitor>) {
    let begin = Instant::now();
    let is_short = || received(&socket) <= MOST_BYTES;
    while !visitor.is(Visit::SentAway) && begin.elapsed() < LONGEST_VISIT && is_short() {
        glib::timeout_future(LOOK).await;
        // A client may be there without its socket: in a tunnel it waits for another request by which it would be told more.
        if visitor.is(Visit::Settled) || (socket.is_closed() && visitor.client.upgrade().is_none()) {
            return;
        }
    }
    let client = visitor.client.upgrade();
    // One that goes on with a session of before, unless its place is another's by now; or, where the client is gone and its socket is not,
    // that of a tunnel through HTTP, which is another client's now.
    let goes_on = |client: &RTSPClient| !client.session_filter(None).is_empty();
    let belongs = client.as_ref().is_none_or(|client| !visitor.is(Visit::SentAway) && goes_on(client));
    if is_short() && belongs {
        return;
    }
    // Without this, one of a tunnel waits for another request until the server itself ends it, after a minute. Asked for first: the
    // client's own thread may close what was shut down before we look.
    let answering = client.as_ref().filter(|_| !socket.is_closed()).and_then(answering);
    // The client's own thread reads the end of it, and closes it. Closed by another thread, a connection that is just being read would
    // keep its thread busy for ever.
    for socket in [Some(socket), answering].into_iter().flatten() {
        let _ = socket.shutdown(true, true);
    }
}

/// How many bytes have come by a socket of TCP; 0 where nobody can tell.
fn received(socket: &gio::Socket) -> u64 {
    // SAFETY: a structure of plain numbers, which may all be zero.
    let mut info: libc::tcp_info = unsafe { std::mem::zeroed() };
    let mut length = size_of::<libc::tcp_info>() as libc::socklen_t;
    // SAFETY: the kernel writes `length` bytes at most, all of them into `info`.
    let result = unsafe {
        let (level, name) = (libc::IPPROTO_TCP, libc::TCP_INFO);
        libc::getsockopt(socket.as_raw_fd(), level, name, (&raw mut info).cast(), &raw mut length)
    };
    if result == 0 { info.tcpi_bytes_received } else { 0 }
}
