// SPDX-License-Identifier: MPL-2.0

//! Clients that have set up no stream yet: what they send is read before anybody has logged in, so they may send and stay no longer
//! than a log-in takes.

use std::os::fd::AsRawFd;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use glib::translate::from_glib_none;
use gst_rtsp_server::{RTSPClient, RTSPServer, gio, prelude::*};

use super::{LONGEST_BODY, MOST_CLIENTS};

/// Who has set up nothing by then is sent away. The server waits for a camera's first picture for 20 s.
const LONGEST_VISIT: Duration = Duration::from_secs(30);

/// What somebody may send until then: the server bounds a body, but neither the length of a head nor how many come.
const MOST_BYTES: u64 = 2 * LONGEST_BODY as u64;

/// What may wait in the kernel to be read, bytes: it is still read after the end of a visit, byte by byte.
const MOST_WAITING: i32 = 16 * 1024;

/// Between two looks at what they have sent.
const LOOK: Duration = Duration::from_millis(50);

/// Whether a client has set up a stream.
type Settled = Arc<AtomicBool>;

/// Takes on a client that has just connected, in the thread that carries out `context`.
pub(super) fn receive(server: &RTSPServer, client: &RTSPClient, context: &glib::MainContext) {
    let Some(socket) = socket_of(client) else { return };
    // Where it is not taken, more is read.
    let _ = socket.set_option(libc::SOL_SOCKET, libc::SO_RCVBUF, MOST_WAITING);
    let settled = Settled::default();
    client.connect_new_session({
        let settled = settled.clone();
        move |_, _| settled.store(true, Ordering::Relaxed)
    });
    let is_too_much = server.client_filter(None).len() > MOST_CLIENTS;
    context.spawn_local(watch(socket, client.downgrade(), settled, is_too_much));
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

/// Sends a client away at once, or where it stays for too long or sends too much without setting up a stream.
async fn watch(socket: gio::Socket, client: glib::WeakRef<RTSPClient>, settled: Settled, is_too_much: bool) {
    let begin = Instant::now();
    let is_short = || received(&socket) <= MOST_BYTES;
    while !is_too_much && begin.elapsed() < LONGEST_VISIT && is_short() {
        glib::timeout_future(LOOK).await;
        // A client may be there without its socket: in a tunnel it waits for another request by which it would be told more.
        if settled.load(Ordering::Relaxed) || (socket.is_closed() && client.upgrade().is_none()) {
            return;
        }
    }
    let client = client.upgrade();
    // One that goes on with a session of before; or, where the client is gone and its socket is not, that of a tunnel through HTTP,
    // which is another client's now.
    let belongs = client.as_ref().is_none_or(|client| !client.session_filter(None).is_empty());
    if !is_too_much && is_short() && belongs {
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
