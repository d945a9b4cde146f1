// SPDX-License-Identifier: MPL-2.0

//! The cameras' streams by RTSP, as they come, and beside each what is seen in it, as ONVIF's metadata. Where nobody watches,
//! nothing is copied; where it fails, every camera follows as before.
//!
//! ```text
//! pipeline of the camera ─ Packet ─ feed ─┬ appsrc ─ rtph264pay ──────┬ gst-rtsp-server ─▶ VMS
//!                                         └ appsrc ─ MetadataPayloader ┘
//! ```

mod factory;
mod feed;
mod payloader;
mod visitor;

use std::collections::BTreeMap;
use std::net::SocketAddr;
use std::sync::mpsc::{Receiver, channel};
use std::sync::{Arc, Mutex};
use std::thread;
use std::time::Duration;

use factory::MediaFactory;
use gst_rtsp_server::{
    RTSP_TOKEN_MEDIA_FACTORY_ROLE, RTSPAuth, RTSPFilterResult, RTSPServer, RTSPToken, gio, gst_rtsp,
    prelude::*,
};
use pipeline_supervisor::Backoff;
use ptztrack_contract::lock::lock;
use tokio::runtime::Handle;
use visitor::Visitors;

use crate::config::{CameraSettings, Codec, Restream};
use crate::event::{Event, Level};
use crate::fleet::Fleet;
use crate::log::Log;

/// The only role there is: whoever knows the password.
const ROLE: &str = "viewer";

/// As many as the page takes at once. Beyond that, somebody without a stream is sent away.
const MOST_CLIENTS: usize = 128;

/// Nobody has to send more than a few words in the body of a request; it is read before anybody has logged in.
const LONGEST_BODY: u32 = 64 * 1024;

/// How often sessions whose client vanished are looked for, in seconds.
const CLEANING: u32 = 5;

/// Between two tries to begin; twice as long each time.
const SHORTEST_PAUSE: Duration = Duration::from_secs(1);
const LONGEST_PAUSE: Duration = Duration::from_secs(60);

/// For clients to be told that it ends.
const LONGEST_END: Duration = Duration::from_secs(2);

/// The running server.
pub struct Restreaming {
    server: RTSPServer,
    fleet: Arc<Fleet>,
    context: glib::MainContext,
    main_loop: glib::MainLoop,
    ended: Receiver<()>,
    /// By camera, in which form its stream is passed on.
    mounts: Mutex<BTreeMap<String, Codec>>,
    /// Carries packets.
    runtime: Handle,
}

impl Restreaming {
    /// Starts it, in a runtime of tokio's.
    ///
    /// # Errors
    /// Why there is none, in words.
    pub fn start(
        settings: &Restream,
        cameras: &[CameraSettings],
        fleet: Arc<Fleet>,
        log: Arc<Log>,
    ) -> Result<Self, String> {
        let server = RTSPServer::new();
        server.set_address(&settings.listen.ip().to_string());
        server.set_service(&settings.listen.port().to_string());
        if let Some(pool) = server.thread_pool() {
            // One for each client: who waits for a camera's first picture keeps nobody else waiting.
            pool.set_max_threads(-1);
        }
        server.set_content_length_limit(LONGEST_BODY);
        let context = glib::MainContext::new();
        server.connect_client_connected({
            let (visitors, context) = (Visitors::default(), context.clone());
            // Called in the thread of that context.
            move |server, client| visitors.receive(server, client, &context)
        });
        let main_loop = glib::MainLoop::new(Some(&context), false);
        context.spawn(serve(server.clone(), context.clone(), settings.clone(), log));
        let (ending, ended) = channel();
        let running = main_loop.clone();
        let run = move || {
            running.run();
            drop(ending);
        };
        thread::Builder::new().name("restream".to_owned()).spawn(run).map_err(|err| err.to_string())?;
        let this = Self {
            server,
            fleet,
            context,
            main_loop,
            ended,
            mounts: Mutex::default(),
            runtime: Handle::current(),
        };
        this.change(cameras);
        Ok(this)
    }

    /// Passes these cameras on, and no others.
    pub fn change(&self, cameras: &[CameraSettings]) {
        let Some(points) = self.server.mount_points() else { return };
        let wanted: BTreeMap<_, _> =
            cameras.iter().map(|camera| (camera.name.clone(), camera.codec)).collect();
        let mut mounts = lock(&self.mounts);
        for (name, _) in mounts.iter().filter(|(name, codec)| wanted.get(*name) != Some(codec)) {
            points.remove_factory(&path(name));
        }
        for (name, codec) in wanted.iter().filter(|(name, codec)| mounts.get(*name) != Some(codec)) {
            points.add_factory(
                &path(name),
                MediaFactory::new(self.fleet.clone(), name, *codec, self.runtime.clone()),
            );
        }
        *mounts = wanted;
    }

    /// Ends it, and waits for that, but not for ever.
    pub fn end(self) {
        let (server, main_loop) = (self.server, self.main_loop);
        self.context.invoke(move || {
            server.client_filter(Some(&mut |_, _| RTSPFilterResult::Remove));
            main_loop.quit();
        });
        // Nothing is ever sent: it ends with the thread.
        let _ = self.ended.recv_timeout(LONGEST_END);
    }
}

fn path(camera: &str) -> String {
    format!("/{camera}")
}

/// Nobody is followed the worse for a server that is not there: it is tried again.
async fn serve(server: RTSPServer, context: glib::MainContext, settings: Restream, log: Arc<Log>) {
    let mut told = false;
    let mut pauses = Backoff::new(SHORTEST_PAUSE, LONGEST_PAUSE, Duration::MAX);
    while let Err(reason) = listen(&server, &context, &settings) {
        if !std::mem::replace(&mut told, true) {
            let detail = format!("nothing is passed on at {}: {reason}; it is tried again", settings.listen);
            log.tell(&Event::new(Level::Warning, None, "not-restreaming", detail));
        }
        glib::timeout_future(pauses.after(Duration::ZERO)).await;
    }
    let scheme = if settings.tls.is_some() { "rtsps" } else { "rtsp" };
    let bound = u16::try_from(server.bound_port()).unwrap_or_default();
    let address = SocketAddr::new(settings.listen.ip(), bound);
    log.info("restreaming", format!("passes the cameras on at {scheme}://{address}/NAME"));
    loop {
        glib::timeout_future_seconds(CLEANING).await;
        if let Some(sessions) = server.session_pool() {
            sessions.cleanup();
        }
    }
}

/// # Errors
/// Why nobody can connect, in words.
fn listen(server: &RTSPServer, context: &glib::MainContext, settings: &Restream) -> Result<(), String> {
    server.set_auth(auth(settings)?.as_ref());
    let source = server.create_source(gio::Cancellable::NONE).map_err(|err| err.to_string())?;
    source.attach(Some(context));
    Ok(())
}

/// By Digest; over TLS, where there is a certificate.
fn auth(settings: &Restream) -> Result<Option<RTSPAuth>, String> {
    if settings.credentials.is_none() && settings.tls.is_none() {
        return Ok(None);
    }
    let auth = RTSPAuth::new();
    let mut token = RTSPToken::builder().field(RTSP_TOKEN_MEDIA_FACTORY_ROLE, ROLE).build();
    match &settings.credentials {
        Some(credentials) => auth.add_digest(&credentials.user, credentials.password.reveal(), &token),
        None => auth.set_default_token(Some(&mut token)),
    }
    auth.set_supported_methods(gst_rtsp::RTSPAuthMethod::Digest);
    auth.set_realm(Some("ptztrack"));
    if let Some(certificate) = &settings.tls {
        auth.set_tls_certificate(Some(&certificate.load()?));
    }
    Ok(Some(auth))
}
