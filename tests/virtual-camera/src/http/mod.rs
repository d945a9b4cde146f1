// SPDX-License-Identifier: MPL-2.0

//! The HTTP server: VAPIX, snapshots, MJPEG and the live page.

mod auth;
mod cgi;
mod connection;
mod mjpeg;
mod onvif;
mod page;
mod picture;
mod truth;

use std::{net::SocketAddr, sync::Arc, thread::JoinHandle};

use axum::{
    Router,
    middleware::from_fn_with_state,
    routing::{any, get, post},
};
use tokio::{net::TcpSocket, sync::oneshot};

use crate::{Error, Fault, OnvifSettings, camera::Camera, threads::Threads};
use auth::Guard;
use connection::{Connection, Door};

/// What the handlers share.
struct Site {
    camera: Arc<Camera>,
    guard: Guard,
    /// CGIs run one at a time.
    turn: tokio::sync::Mutex<()>,
    streams: Arc<Threads>,
}

/// The running server.
pub(crate) struct HttpServer {
    address: SocketAddr,
    streams: Arc<Threads>,
    stop: Option<oneshot::Sender<()>>,
    thread: Option<JoinHandle<()>>,
}

impl HttpServer {
    pub fn start(camera: Arc<Camera>) -> Result<Self, Error> {
        let port = camera.settings.http_port;
        let unavailable =
            |error: std::io::Error| Error::Port { protocol: "HTTP", port, reason: error.to_string() };
        let runtime =
            tokio::runtime::Builder::new_current_thread().enable_all().build().map_err(unavailable)?;
        let door = {
            let _context = runtime.enter();
            Door::open(SocketAddr::from(([127, 0, 0, 1], port)), camera.fault.subscribe())
                .map_err(unavailable)?
        };
        let address = door.address();
        let streams = Arc::new(Threads::default());
        let site = Arc::new(Site {
            guard: Guard::new(&camera.settings),
            camera,
            turn: tokio::sync::Mutex::new(()),
            streams: streams.clone(),
        });
        let (stop, stopped) = oneshot::channel();
        let reboots = reboots(site.clone());
        let service = routes(site).into_make_service_with_connect_info::<Connection>();
        let thread = std::thread::Builder::new()
            .name("camera-http".into())
            .spawn(move || {
                runtime.block_on(async {
                    tokio::select! {
                        // Serving never ends by itself; a dropped handle stops it as well.
                        _ = axum::serve(door, service) => {}
                        () = reboots => {}
                        _ = stopped => {}
                    }
                });
            })
            .map_err(|source| Error::Thread { source })?;
        Ok(Self { address, streams, stop: Some(stop), thread: Some(thread) })
    }

    pub fn address(&self) -> SocketAddr {
        self.address
    }

    /// Closes the port and all connections, and waits for its threads. The camera must be stopping already.
    pub fn stop(&mut self) {
        if let Some(stop) = self.stop.take() {
            let _ = stop.send(());
        }
        if let Some(thread) = self.thread.take() {
            // It ended with a panic at worst, which has been printed.
            let _ = thread.join();
        }
        self.streams.join();
    }
}

/// Lets the camera forget what a reboot makes it forget, each time there is one.
async fn reboots(site: Arc<Site>) {
    let mut fault = site.camera.fault.subscribe();
    // The sender is the camera's own: it is there as long as this is.
    while fault.wait_for(|fault| *fault == Fault::Reboot).await.is_ok() {
        site.guard.reboot();
        let _ = fault.wait_for(|fault| *fault != Fault::Reboot).await;
    }
}

fn routes(site: Arc<Site>) -> Router {
    let guarded = Router::new()
        .route("/axis-cgi/jpg/image.cgi", get(picture::snapshot))
        .route("/axis-cgi/imagesize.cgi", get(picture::size))
        .route("/axis-cgi/mjpg/video.cgi", get(mjpeg::video))
        .route("/mjpg/video.mjpg", get(mjpeg::video))
        .layer(from_fn_with_state(site.clone(), auth::require));
    // Faults come before authentication, so these ask for it themselves.
    let faulty = Router::new()
        .route("/axis-cgi/com/ptz.cgi", any(cgi::ptz))
        .route("/axis-cgi/com/ptzqueue.cgi", any(cgi::queue))
        .route("/axis-cgi/param.cgi", any(cgi::param));
    let page = Router::new()
        .route("/", get(page::page))
        .route("/api/status", get(page::status))
        .route("/api/picture.jpg", get(page::picture))
        .route("/api/truth", get(truth::truth))
        .route("/api/overview.jpg", get(page::overview))
        .route("/api/ptz", any(page::steer));
    let vapix = match site.camera.settings.onvif {
        Some(OnvifSettings { alone: true, .. }) => Router::new(),
        _ => guarded.merge(faulty),
    };
    // Absent where the camera speaks no ONVIF.
    let onvif = match site.camera.settings.onvif {
        Some(_) => Router::new()
            .route(crate::onvif::DEVICE_SERVICE, post(onvif::service))
            .route(crate::onvif::MEDIA_SERVICE, post(onvif::service))
            .route(crate::onvif::MEDIA2_SERVICE, post(onvif::service))
            .route(crate::onvif::PTZ_SERVICE, post(onvif::service)),
        None => Router::new(),
    };
    vapix.merge(page).merge(onvif).with_state(site)
}

/// A socket that holds the port without listening.
fn reserve(address: SocketAddr) -> std::io::Result<TcpSocket> {
    let socket = TcpSocket::new_v4()?;
    socket.set_reuseaddr(true)?;
    socket.bind(address)?;
    Ok(socket)
}
