// SPDX-License-Identifier: MPL-2.0

//! RTSP, through gst-rtsp-server: `/axis-media/media.amp?videocodec=...` and `/mpeg4/media.amp`.

mod codec;
mod factory;
mod stamp;

use std::{
    net::{Ipv4Addr, SocketAddr},
    sync::Arc,
    thread::JoinHandle,
    time::Duration,
};

use gst_rtsp_server::{RTSPAuth, RTSPFilterResult, RTSPServer, RTSPToken, gst_rtsp, prelude::*};

use crate::{Auth, Error, Settings, camera::Camera, threads::Threads};
use codec::Codec;
use factory::MediaFactory;

/// The only role there is: whoever knows the password.
const ROLE: &str = "viewer";
/// How often sessions whose client vanished are looked for.
const CLEANING: Duration = Duration::from_secs(5);

/// The running server.
pub(crate) struct RtspServer {
    address: SocketAddr,
    server: RTSPServer,
    door: glib::Source,
    context: glib::MainContext,
    main_loop: glib::MainLoop,
    feeders: Arc<Threads>,
    thread: Option<JoinHandle<()>>,
}

impl RtspServer {
    pub fn start(camera: Arc<Camera>) -> Result<Self, Error> {
        let port = camera.settings.rtsp_port;
        let unavailable = |reason: String| Error::Port { protocol: "RTSP", port, reason };
        let server = RTSPServer::new();
        server.set_address("127.0.0.1");
        server.set_service(&port.to_string());
        server.set_auth(auth(&camera.settings).as_ref());
        if let Some(pool) = server.thread_pool() {
            // All clients in the one thread below, so that stopping it stops them.
            pool.set_max_threads(0);
        }
        let feeders = Arc::new(Threads::default());
        let mounts = server.mount_points().ok_or_else(|| unavailable("no mount points".into()))?;
        for (path, codec) in [("/axis-media/media.amp", Codec::H264), ("/mpeg4/media.amp", Codec::Mpeg4)] {
            mounts.add_factory(path, MediaFactory::new(camera.clone(), feeders.clone(), codec, ROLE));
        }
        let door = server
            .create_source(gst_rtsp_server::gio::Cancellable::NONE)
            .map_err(|error| unavailable(error.to_string()))?;
        let context = glib::MainContext::new();
        door.attach(Some(&context));
        let bound = u16::try_from(server.bound_port()).map_err(|error| unavailable(error.to_string()))?;
        clean(&server, &context);
        let main_loop = glib::MainLoop::new(Some(&context), false);
        let running = main_loop.clone();
        let thread = std::thread::Builder::new()
            .name("camera-rtsp".into())
            .spawn(move || running.run())
            .map_err(|source| Error::Thread { source })?;
        let address = SocketAddr::from((Ipv4Addr::LOCALHOST, bound));
        Ok(Self { address, server, door, context, main_loop, feeders, thread: Some(thread) })
    }

    pub fn address(&self) -> SocketAddr {
        self.address
    }

    /// Ends all sessions and keeps the connections.
    pub fn forget_sessions(&self) {
        let server = self.server.clone();
        self.context.invoke(move || remove_sessions(&server));
    }

    /// Closes the port and all sessions. Pictures must still be coming: a session just being set up waits for one.
    pub fn close(&mut self) {
        let (server, door, main_loop) = (self.server.clone(), self.door.clone(), self.main_loop.clone());
        self.context.invoke(move || {
            door.destroy();
            server.client_filter(Some(&mut |_, _| RTSPFilterResult::Remove));
            remove_sessions(&server);
            main_loop.quit();
        });
        if let Some(thread) = self.thread.take() {
            // It ended with a panic at worst, which has been printed.
            let _ = thread.join();
        }
    }

    /// Waits for the threads that drew for its clients, once the camera is stopping.
    pub fn join(&self) {
        self.feeders.join();
    }
}

fn remove_sessions(server: &RTSPServer) {
    if let Some(sessions) = server.session_pool() {
        sessions.filter(Some(&mut |_, _| RTSPFilterResult::Remove));
    }
}

/// Ends sessions whose client has gone without a word.
fn clean(server: &RTSPServer, context: &glib::MainContext) {
    let server = server.downgrade();
    let source = glib::timeout_source_new(CLEANING, None, glib::Priority::DEFAULT, move || {
        let Some(server) = server.upgrade() else {
            return glib::ControlFlow::Break;
        };
        if let Some(sessions) = server.session_pool() {
            sessions.cleanup();
        }
        glib::ControlFlow::Continue
    });
    source.attach(Some(context));
}

fn auth(settings: &Settings) -> Option<RTSPAuth> {
    let (basic, digest) = match settings.auth {
        Auth::None => return None,
        Auth::Basic => (true, false),
        Auth::Digest { .. } => (false, true),
        Auth::Both => (true, true),
    };
    let auth = RTSPAuth::new();
    let token = RTSPToken::builder().field(gst_rtsp_server::RTSP_TOKEN_MEDIA_FACTORY_ROLE, ROLE).build();
    let mut methods = gst_rtsp::RTSPAuthMethod::None;
    if basic {
        auth.add_basic(&RTSPAuth::make_basic(&settings.user, &settings.password), &token);
        methods = gst_rtsp::RTSPAuthMethod::Basic;
    }
    if digest {
        auth.add_digest(&settings.user, &settings.password, &token);
        methods = gst_rtsp::RTSPAuthMethod::Digest;
    }
    // Where both are offered the challenge is for Digest, and Basic is let in too.
    auth.set_supported_methods(methods);
    auth.set_realm(Some(&format!("AXIS_{}", settings.serial)));
    Some(auth)
}
