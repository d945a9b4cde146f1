// SPDX-License-Identifier: MPL-2.0

//! The way to a camera's pictures. GStreamer's own sources tell user and password to anybody who asks for them in the camera's
//! place, and show them in their properties; so they are told neither. The camera is logged in to here, by the rules that PTZ
//! goes by: by Digest, or over verified TLS, and nowhere but at its own address.
//!
//! ```text
//! MJPEG:  camera ─ session::http::HttpClient ─ multipart ─ appsrc
//! RTSP:   camera ─ relay, media ─ 127.0.0.1 ─ rtspsrc
//! ```

mod address;
mod http;
pub mod media;
pub mod multipart;
mod rtsp;
pub mod rtsp_message;

use std::future::Future;
use std::sync::mpsc::{Receiver, SyncSender, sync_channel};
use std::sync::{Arc, Mutex};
use std::thread;
use std::time::Duration;

pub use address::rtsp_host;
use gst_app::AppSrc;
use session::Error;
use session::http::ClientSettings;

/// Without anything new for so long the way is no way any more.
pub const LONGEST_SILENCE: Duration = Duration::from_secs(1);
/// For the first: to log in over a long way, and for the camera to start an encoder.
const LONGEST_START: Duration = Duration::from_secs(4);

/// Sources for which `rtspsrc` makes a buffer and a thread, for each stream of a camera. There may be more than one, as a camera that
/// begins its stream anew may do so as another.
const MOST_PER_STREAM: u32 = 4;

/// Why there are no pictures.
#[derive(Debug, Clone, thiserror::Error)]
#[error("{reason}")]
pub struct Failure {
    /// In words.
    pub reason: String,
    /// User and password are refused: to go on trying could lock the account.
    pub refused: bool,
}

/// What ended the way to a camera's pictures, where that is known.
pub type Ended = Arc<Mutex<Option<Failure>>>;

/// A way that is open.
#[derive(Debug)]
pub enum Video {
    /// The camera sends already: to whoever is handed over.
    Http(SyncSender<AppSrc>),
    /// `rtspsrc` finds the camera there.
    Rtsp(String),
}

impl Failure {
    /// One that may pass.
    pub fn new(reason: impl ToString) -> Self {
        Self { reason: reason.to_string(), refused: false }
    }
}

impl From<Error> for Failure {
    fn from(err: Error) -> Self {
        Self { reason: format!("{err}. {}", err.advice()), refused: err.is_final() }
    }
}

impl Video {
    /// Asks for pictures by HTTP, at this path and query. Waits no longer than it takes to log in; a name server that never
    /// answers keeps a thread, called `name`, but nobody who waits for it.
    ///
    /// # Errors
    /// Why there are none.
    pub fn http(name: &str, settings: ClientSettings, target: String) -> Result<Self, Failure> {
        open(name, Duration::ZERO, move |report| async move { http::carry(settings, &target, &report).await })
    }

    /// Connects to an RTSP server, once `find` has found its address, and path and query of the pictures, which takes no longer
    /// than `finding`. Waits as [`Self::http`] does. What ends the way later is in `ended`.
    ///
    /// # Errors
    /// Why there is no way.
    pub fn rtsp<F: Future<Output = Result<(String, String), Failure>>>(
        name: &str,
        settings: ClientSettings,
        find: impl FnOnce() -> F + Send + 'static,
        finding: Duration,
        ended: Ended,
    ) -> Result<Self, Failure> {
        open(name, finding, move |report| async move {
            match find().await {
                Ok((camera, target)) => rtsp::carry(&settings, &camera, &target, &report, &ended).await,
                // Who waited for it may have given up.
                Err(failure) => drop(report.try_send(Err(failure))),
            }
        })
    }

    /// Gives the pictures to an `appsrc`, or to an `rtspsrc`. What was opened for the other is dropped.
    pub fn connect(self, source: &gst::Element) {
        use gst::prelude::*;
        match (self, source.downcast_ref::<AppSrc>()) {
            (Self::Http(hand_over), Some(source)) => {
                source.set_block(true);
                // Before it runs, it takes nothing.
                let hand_over = move |source: &AppSrc, _| drop(hand_over.try_send(source.clone()));
                source.set_callbacks(gst_app::AppSrcCallbacks::builder().need_data(hand_over).build());
            }
            (Self::Rtsp(location), None) => {
                source.set_property("location", location);
                limit(source);
            }
            _ => {}
        }
    }
}

/// Has an `rtspsrc` ask for nothing that would come past the connection to the camera, and serve few sources of it.
fn limit(source: &gst::Element) {
    use gst::prelude::*;
    if glib::subclass::SignalId::lookup("new-manager", source.type_()).is_none() {
        return;
    }
    source.set_property_from_str("protocols", "tcp");
    source.connect("new-manager", false, |values| {
        let manager = values.get(1)?.get::<gst::Element>().ok()?;
        if manager.has_property_with_type("max-streams", glib::Type::U32) {
            manager.set_property("max-streams", MOST_PER_STREAM);
        }
        None
    });
}

type Report = SyncSender<Result<Video, Failure>>;

fn open<F: Future<Output = ()>>(
    name: &str,
    finding: Duration,
    carry: impl FnOnce(Report) -> F + Send + 'static,
) -> Result<Video, Failure> {
    let (report, opened): (_, Receiver<Result<Video, Failure>>) = sync_channel(1);
    thread::Builder::new()
        .name(format!("{name}-video"))
        .spawn(move || {
            let runtime = match tokio::runtime::Builder::new_current_thread().enable_all().build() {
                Ok(runtime) => runtime,
                Err(err) => return drop(report.try_send(Err(Failure::new(err)))),
            };
            runtime.block_on(carry(report));
            // A look-up of a name is not waited for.
            runtime.shutdown_background();
        })
        .map_err(Failure::new)?;
    let no_answer = |_| Err(Failure::new(Error::Timeout(LONGEST_START)));
    opened.recv_timeout(finding + LONGEST_START + LONGEST_SILENCE).unwrap_or_else(no_answer)
}

#[cfg(test)]
mod tests {
    use gst::prelude::*;

    use super::*;

    #[test]
    fn rtspsrc_asks_for_tcp_only_and_makes_few_streams() {
        gst::init().unwrap();
        let source = gst::ElementFactory::make("rtspsrc").build().unwrap();
        Video::Rtsp("rtsp://127.0.0.1:1/".to_owned()).connect(&source);
        let protocols = source.property_value("protocols").serialize().unwrap();
        assert!(protocols.ends_with("TCP") && !protocols.contains('+'), "{protocols}");
        let manager = gst::ElementFactory::make("rtpbin").build().unwrap();
        source.emit_by_name::<()>("new-manager", &[&manager]);
        assert_eq!(manager.property::<u32>("max-streams"), MOST_PER_STREAM);
    }
}
