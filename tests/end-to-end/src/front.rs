//! What stands between a camera and its user: the network, and the camera's own power supply.

use std::io::{Read, Write};
use std::net::{Shutdown, SocketAddr, TcpListener, TcpStream};
use std::sync::{Arc, Condvar, Mutex};

use socket2::SockRef;

/// What asks for video.
const VIDEO: &[u8] = b"GET /axis-cgi/mjpg/video.cgi";

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
}

impl Front {
    /// A way to the port of a camera.
    pub fn new(camera: SocketAddr) -> Self {
        let listener = TcpListener::bind(("127.0.0.1", 0)).unwrap();
        let address = listener.local_addr().unwrap();
        let traffic = Mutex::new(Traffic { way: Way::Open, streams: Vec::new(), video_requests: 0 });
        let state = Arc::new(State { address, camera, traffic, changed: Condvar::new() });
        listen(state.clone(), listener);
        Self { state }
    }

    /// Where the camera is to be found.
    pub fn address(&self) -> SocketAddr {
        self.state.address
    }

    /// Makes the way like this.
    pub fn set(&self, way: Way) {
        let before = {
            let mut traffic = self.state.traffic.lock().unwrap();
            if way == Way::Refused {
                traffic.streams.drain(..).for_each(|stream| reset(&stream));
            }
            std::mem::replace(&mut traffic.way, way)
        };
        self.state.changed.notify_all();
        if way == Way::Refused {
            // Wakes the listener, which then goes away.
            let _ = TcpStream::connect(self.state.address);
        } else if before == Way::Refused {
            listen(self.state.clone(), again(self.state.address));
        }
    }

    /// Requests for video so far.
    pub fn video_requests(&self) -> u64 {
        self.state.traffic.lock().unwrap().video_requests
    }

    /// Waits until somebody asks for video, after so many requests.
    #[track_caller]
    pub fn wait_for_video_request(&self, after: u64) {
        let traffic = self.state.traffic.lock().unwrap();
        let none = |traffic: &mut Traffic| traffic.video_requests <= after;
        let waited = self.state.changed.wait_timeout_while(traffic, crate::PATIENCE, none);
        assert!(!waited.unwrap().1.timed_out(), "nobody asks for video");
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

fn again(address: SocketAddr) -> TcpListener {
    loop {
        // Until its predecessor is gone.
        if let Ok(listener) = TcpListener::bind(address) {
            return listener;
        }
        std::thread::yield_now();
    }
}

fn listen(state: Arc<State>, listener: TcpListener) {
    std::thread::spawn(move || {
        for client in listener.incoming().map_while(Result::ok) {
            if state.traffic.lock().unwrap().way == Way::Refused {
                return;
            }
            let Ok(camera) = TcpStream::connect(state.camera) else { continue };
            for (from, to) in [(&client, &camera), (&camera, &client)] {
                let (from, to, state) = (from.try_clone().unwrap(), to.try_clone().unwrap(), state.clone());
                std::thread::spawn(move || {
                    state.pass_on(&from, &to);
                    let _ = (from.shutdown(Shutdown::Both), to.shutdown(Shutdown::Both));
                });
            }
            state.traffic.lock().unwrap().streams.extend([client, camera]);
        }
    });
}

impl State {
    fn pass_on(&self, mut from: &TcpStream, mut to: &TcpStream) {
        let mut bytes = [0; 16 * 1024];
        while let Ok(read @ 1..) = from.read(&mut bytes) {
            if bytes[..read].windows(VIDEO.len()).any(|part| part == VIDEO) {
                self.traffic.lock().unwrap().video_requests += 1;
                self.changed.notify_all();
            }
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
}

/// A lost connection, not one that ends.
fn reset(stream: &TcpStream) {
    let socket = SockRef::from(stream);
    let _ = socket.set_linger(Some(std::time::Duration::ZERO));
    let _ = socket.shutdown(Shutdown::Both);
}
