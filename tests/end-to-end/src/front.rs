// SPDX-License-Identifier: MPL-2.0

//! What stands between a camera and its user: the network, and the camera's own power supply.

use std::io::{Read, Write};
use std::net::{Ipv4Addr, Shutdown, SocketAddr, TcpListener, TcpStream};
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Condvar, Mutex, PoisonError, mpsc};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use socket2::SockRef;

use crate::Chance;

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
    /// Everything passes so late, and up to the second so much later; in order.
    Late(Duration, Duration),
}

/// The only way to one port of a camera, for video and PTZ alike.
pub struct Front {
    state: Arc<State>,
    /// Whoever accepts connections, while they are.
    listener: Mutex<Option<JoinHandle<()>>>,
}

struct State {
    address: SocketAddr,
    traffic: Mutex<Traffic>,
    changed: Condvar,
}

struct Traffic {
    way: Way,
    camera: SocketAddr,
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
        Self::at((Ipv4Addr::LOCALHOST, 0), camera)
    }

    /// The same, that begins at this address; port 0 is a free one.
    pub fn at(address: impl Into<SocketAddr>, camera: SocketAddr) -> Self {
        let listener = TcpListener::bind(address.into()).unwrap();
        let address = listener.local_addr().unwrap();
        let traffic = Mutex::new(Traffic {
            way: Way::Open,
            camera,
            streams: Vec::new(),
            video_requests: 0,
            video_bytes: 0,
        });
        let state = Arc::new(State { address, traffic, changed: Condvar::new() });
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

    /// Leads to another camera from now on; who is connected is reset.
    pub fn lead_to(&self, camera: SocketAddr) {
        self.state.traffic.lock().unwrap().camera = camera;
        self.reset();
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
            let camera = state.traffic.lock().unwrap().camera;
            let camera = TcpStream::connect(camera);
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
    fn pass_on(self: &Arc<Self>, mut from: &TcpStream, to: &TcpStream, asked: &AtomicU64) {
        // What is late waits here, so that what comes meanwhile is no later for that.
        let (sender, waiting) = mpsc::channel::<(Instant, Vec<u8>)>();
        let writer = to.try_clone().unwrap();
        let state = self.clone();
        let writing = std::thread::spawn(move || {
            for (due, bytes) in waiting {
                std::thread::sleep(due.saturating_duration_since(Instant::now()));
                state.wait_until_free();
                if (&writer).write_all(&bytes).is_err() {
                    return;
                }
            }
        });
        let mut chance = Chance::new(0);
        let mut bytes = [0; 16 * 1024];
        while let Ok(read @ 1..) = from.read(&mut bytes) {
            self.count(&bytes[..read], asked);
            self.wait_until_free();
            let due = Instant::now() + self.late(&mut chance);
            if sender.send((due, bytes[..read].to_vec())).is_err() {
                break;
            }
        }
        drop(sender);
        // It panics nowhere; what is still under way arrives.
        let _ = writing.join();
    }

    fn wait_until_free(&self) {
        let traffic = self.traffic.lock().unwrap();
        drop(self.changed.wait_while(traffic, |traffic| traffic.way == Way::Stalled).unwrap());
    }

    /// How late what comes now is to be.
    fn late(&self, chance: &mut Chance) -> Duration {
        match self.traffic.lock().unwrap().way {
            Way::Late(at_least, more) => at_least + more.mul_f64(chance.within((0, 1000)) as f64 / 1000.0),
            Way::Open | Way::Refused | Way::Stalled => Duration::ZERO,
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
    let _ = socket.set_linger(Some(Duration::ZERO));
    let _ = socket.shutdown(Shutdown::Both);
}
