// SPDX-License-Identifier: MPL-2.0

//! What stands between a camera and its user: the network, and the camera's own power supply.

use std::io::{Read, Write};
use std::net::{Shutdown, SocketAddr, TcpListener, TcpStream};
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Condvar, Mutex, PoisonError};
use std::thread::JoinHandle;
use std::time::Instant;

use socket2::SockRef;

/// What asks for video, by HTTP and by RTSP: with this a client there begins.
const VIDEO: [&[u8]; 2] = [b"GET /axis-cgi/mjpg/video.cgi", b"OPTIONS rtsp://"];

/// How the way to the camera is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Way {
    /// Free.
    Open,
    /// Nobody listens, and whoever was connected is reset: a reboot.
    Refused,
    /// Connections come about and stay, and nothing passes.
    Stalled,
}

/// The only way to one port of a camera, for video and PTZ alike.
pub struct Front {
    state: Arc<State>,
    /// Whoever accepts connections, while they are.
    listener: Mutex<Option<JoinHandle<()>>>,
}

struct State {
    address: SocketAddr,
    camera: SocketAddr,
    traffic: Mutex<Traffic>,
    changed: Condvar,
}

struct Traffic {
    way: Way,
    streams: Vec<TcpStream>,
    /// Requests for video so far.
    video_requests: u64,
    /// What has come back of the newest of them.
    video_bytes: usize,
}

/// More than is said before there are pictures.
const PICTURE_BYTES: usize = 4000;

impl Front {
    /// A way to the port of a camera.
    pub fn new(camera: SocketAddr) -> Self {
        let listener = TcpListener::bind(("127.0.0.1", 0)).unwrap();
        let address = listener.local_addr().unwrap();
        let traffic =
            Mutex::new(Traffic { way: Way::Open, streams: Vec::new(), video_requests: 0, video_bytes: 0 });
        let state = Arc::new(State { address, camera, traffic, changed: Condvar::new() });
        let listener = Mutex::new(Some(listen(state.clone(), listener)));
        Self { state, listener }
    }

    /// Where the camera is to be found.
    pub fn address(&self) -> SocketAddr {
        self.state.address
    }

    /// Makes the way like this.
    pub fn set(&self, way: Way) {
        {
            let mut traffic = self.state.traffic.lock().unwrap();
            if way == Way::Refused {
                traffic.streams.drain(..).for_each(|stream| reset(&stream));
            }
            traffic.way = way;
        }
        self.state.changed.notify_all();
        let mut listener = self.listener.lock().unwrap_or_else(PoisonError::into_inner);
        if way != Way::Refused {
            listener.get_or_insert_with(|| listen(self.state.clone(), again(self.state.address)));
        } else if let Some(thread) = listener.take() {
            // Wakes it, and it goes away. Waited for, as it would stay where the way is free again before it has looked.
            let _ = TcpStream::connect(self.state.address);
            let _ = thread.join();
        }
    }

    /// Requests for video so far.
    pub fn video_requests(&self) -> u64 {
        self.state.traffic.lock().unwrap().video_requests
    }

    /// Waits until somebody asks for video, after so many requests.
    #[track_caller]
    pub fn wait_for_video_request(&self, after: u64) {
        self.wait_while("nobody asks for video", |traffic| traffic.video_requests <= after);
    }

    /// Waits until whoever asked for video after so many requests has got some.
    #[track_caller]
    pub fn wait_for_picture(&self, after: u64) {
        let none =
            |traffic: &mut Traffic| traffic.video_requests <= after || traffic.video_bytes < PICTURE_BYTES;
        self.wait_while("there is no picture", none);
    }

    #[track_caller]
    fn wait_while(&self, what: &str, condition: impl FnMut(&mut Traffic) -> bool) {
        let traffic = self.state.traffic.lock().unwrap();
        let waited = self.state.changed.wait_timeout_while(traffic, crate::PATIENCE, condition);
        assert!(!waited.unwrap().1.timed_out(), "{what}");
    }

    /// Everybody who is connected is reset, and may connect again.
    pub fn reset(&self) {
        self.state.traffic.lock().unwrap().streams.drain(..).for_each(|stream| reset(&stream));
    }

    /// The same, in good order: the camera has forgotten their sessions.
    pub fn close(&self) {
        for stream in self.state.traffic.lock().unwrap().streams.drain(..) {
            let _ = stream.shutdown(Shutdown::Both);
        }
    }
}

impl Drop for Front {
    fn drop(&mut self) {
        self.set(Way::Refused);
    }
}

/// Somebody else may have the port for a moment, as the one of a connection.
fn again(address: SocketAddr) -> TcpListener {
    let begin = Instant::now();
    loop {
        match TcpListener::bind(address) {
            Ok(listener) => return listener,
            Err(err) => assert!(begin.elapsed() < crate::PATIENCE, "{address}: {err}"),
        }
        std::thread::yield_now();
    }
}

fn listen(state: Arc<State>, listener: TcpListener) -> JoinHandle<()> {
    std::thread::spawn(move || {
        for client in listener.incoming().map_while(Result::ok) {
            let camera = TcpStream::connect(state.camera);
            let mut traffic = state.traffic.lock().unwrap();
            if traffic.way == Way::Refused {
                return;
            }
            let Ok(camera) = camera else { continue };
            let both = [(&client, &camera), (&camera, &client)].map(clones);
            // Before anything passes: whoever has got something can be reset.
            traffic.streams.extend([client, camera]);
            drop(traffic);
            let asked = Arc::new(AtomicU64::new(0));
            for (from, to) in both {
                let (state, asked) = (state.clone(), asked.clone());
                std::thread::spawn(move || {
                    state.pass_on(&from, &to, &asked);
                    let _ = (from.shutdown(Shutdown::Both), to.shutdown(Shutdown::Both));
                });
            }
        }
    })
}

fn clones((from, to): (&TcpStream, &TcpStream)) -> (TcpStream, TcpStream) {
    (from.try_clone().unwrap(), to.try_clone().unwrap())
}

impl State {
    /// `asked`: the number of the connection's newest request for video.
    fn pass_on(&self, mut from: &TcpStream, mut to: &TcpStream, asked: &AtomicU64) {
        let mut bytes = [0; 16 * 1024];
        while let Ok(read @ 1..) = from.read(&mut bytes) {
            self.count(&bytes[..read], asked);
            drop(
                self.changed
                    .wait_while(self.traffic.lock().unwrap(), |traffic| traffic.way == Way::Stalled)
                    .unwrap(),
            );
            if to.write_all(&bytes[..read]).is_err() {
                return;
            }
        }
    }

    fn count(&self, bytes: &[u8], asked: &AtomicU64) {
        let mut traffic = self.traffic.lock().unwrap();
        let asks = |video: &&[u8]| bytes.windows(video.len()).any(|part| part == *video);
        if VIDEO.iter().any(asks) {
            traffic.video_requests += 1;
            traffic.video_bytes = 0;
            asked.store(traffic.video_requests, Ordering::Relaxed);
        } else if asked.load(Ordering::Relaxed) == traffic.video_requests {
            traffic.video_bytes += bytes.len();
        }
        self.changed.notify_all();
    }
}

/// A lost connection, not one that ends.
fn reset(stream: &TcpStream) {
    let socket = SockRef::from(stream);
    let _ = socket.set_linger(Some(std::time::Duration::ZERO));
    let _ = socket.shutdown(Shutdown::Both);
}
