// SPDX-License-Identifier: MPL-2.0

//! The picture for who looks, with what it shows.

use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};

use axum::body::Bytes;
use gst::prelude::*;
use ptztrack_contract::lock::lock;
use ptztrack_contract::{BufferMeta, TargetMeta, TargetState};
use serde::{Deserialize, Serialize};
use tokio::sync::watch;

use super::known::Known;

/// A few pictures a second for who looks, and none while nobody does.
pub const VIEW: &str = "valve name=view drop=true drop-mode=forward-sticky-events ! ptzoverlay ! videoconvert \
    ! jpegenc quality=75 ! appsink name=picture sync=false async=false max-buffers=1 drop=true";

/// Between two pictures for who looks.
const EVERY: Duration = Duration::from_millis(200);

/// A picture for who looks.
#[derive(Debug, Clone, Default)]
pub struct Shown {
    /// JPEG.
    pub jpeg: Bytes,
    /// What the tracker says of it; `None` in a pipeline of one's own without one.
    pub target: Option<Seen>,
}

/// What a tracker does in one picture.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Seen {
    /// `searching`, `tracking`, `occluded` or `lost`.
    pub state: String,
    /// Number of the target, where there is one.
    pub id: Option<u64>,
}

impl Seen {
    fn of(buffer: &gst::BufferRef) -> Option<Self> {
        let meta = TargetMeta::of(buffer)?.ok()?;
        let is_there = matches!(meta.state, TargetState::Tracking | TargetState::Occluded);
        Some(Self { state: meta.state.name().to_owned(), id: is_there.then_some(meta.id) })
    }
}

/// Hands a few pictures a second to who looks. Not by `videorate`: it ends the process where a picture has no duration.
pub fn show(view: Option<&gst::Element>, picture: Option<&gst_app::AppSink>, known: &Arc<Known>) {
    let last = Mutex::new(None::<Instant>);
    let few = move |_: &gst::Pad, _: &mut gst::PadProbeInfo| {
        let mut last = lock(&last);
        if last.is_some_and(|last| last.elapsed() < EVERY) {
            return gst::PadProbeReturn::Drop;
        }
        *last = Some(Instant::now());
        gst::PadProbeReturn::Ok
    };
    if let Some(pad) = view.and_then(|view| view.static_pad("src")) {
        pad.add_probe(gst::PadProbeType::BUFFER, few);
    }
    let Some(picture) = picture else { return };
    let known = known.clone();
    let show = move |sink: &gst_app::AppSink| {
        let sample = sink.pull_sample().map_err(|_| gst::FlowError::Eos)?;
        let Some(buffer) = sample.buffer() else { return Ok(gst::FlowSuccess::Ok) };
        if let Ok(map) = buffer.map_readable() {
            let (jpeg, target) = (Bytes::copy_from_slice(&map), Seen::of(buffer));
            known.view.send_replace(Shown { jpeg, target });
        }
        Ok(gst::FlowSuccess::Ok)
    };
    picture.set_callbacks(gst_app::AppSinkCallbacks::builder().new_sample(show).build());
}

/// Somebody looks; where nobody does any more, the camera's own timer ends it, as the next may come soon.
#[derive(Debug)]
pub struct Look {
    /// Of what is known of the camera no more: that ends with the camera, and with it this.
    looking: Arc<AtomicUsize>,
    pictures: watch::Receiver<Shown>,
}

impl Known {
    /// Pictures are made while this is held.
    pub fn look(&self) -> Look {
        self.looking.fetch_add(1, Ordering::Relaxed);
        self.with(|running| running.look(true));
        Look { pictures: self.view.subscribe(), looking: self.looking.clone() }
    }
}

impl Look {
    /// The next picture; `None` where the camera is no more.
    pub async fn next(&mut self) -> Option<Shown> {
        self.pictures.changed().await.ok()?;
        Some(self.pictures.borrow_and_update().clone())
    }
}

impl Drop for Look {
    fn drop(&mut self) {
        self.looking.fetch_sub(1, Ordering::Relaxed);
    }
}

#[cfg(test)]
mod tests {
    use ptztrack_contract::{Point, Rect};

    use super::*;

    /// As where its entry was changed: whoever looks on asks for the new one.
    #[test]
    fn whoever_looks_at_a_camera_that_is_no_more_hears_of_it() {
        let known = Known::new("door");
        let mut look = known.look();
        drop(known.look());
        assert_eq!(known.looking.load(Ordering::Relaxed), 1);
        drop(known);
        let runtime = tokio::runtime::Builder::new_current_thread().build().unwrap();
        assert!(runtime.block_on(look.next()).is_none());
    }

    /// By the time at which somebody asks, another one is followed.
    #[test]
    fn the_words_are_those_of_the_picture() {
        gst::init().unwrap();
        let pipeline = gst::parse::launch(
            "appsrc name=source format=time caps=video/x-raw,format=I420,width=16,height=16,framerate=0/1 \
             ! valve name=view ! videoconvert ! jpegenc ! appsink name=picture sync=false async=false",
        );
        let pipeline = pipeline.unwrap().downcast::<gst::Pipeline>().unwrap();
        let known = Arc::new(Known::new("door"));
        let picture = pipeline.by_name("picture").unwrap().downcast().unwrap();
        show(pipeline.by_name("view").as_ref(), Some(&picture), &known);
        let mut buffer = gst::Buffer::from_slice([0; 16 * 16 * 3 / 2]);
        let meta = TargetMeta {
            state: TargetState::Tracking,
            id: 7,
            bounds: Rect { x: 0.1, y: 0.1, width: 0.2, height: 0.4 },
            centroid: Point { x: 0.2, y: 0.3 },
            confidence: 1.0,
            ..TargetMeta::default()
        };
        meta.attach(buffer.make_mut()).unwrap();
        let mut pictures = known.view.subscribe();
        pipeline.set_state(gst::State::Playing).unwrap();
        let source = pipeline.by_name("source").unwrap().downcast::<gst_app::AppSrc>().unwrap();
        source.push_buffer(buffer).unwrap();
        let runtime = tokio::runtime::Builder::new_current_thread().build().unwrap();
        runtime.block_on(pictures.changed()).unwrap();
        pipeline.set_state(gst::State::Null).unwrap();
        let mut state = lock(&known.state);
        (state.picture, state.target, state.target_id) = (true, "tracking".to_owned(), Some(8));
        drop(state);
        assert_eq!(known.words_of(&pictures.borrow()), "follows target 7, the camera is not moved");
        assert_eq!(known.in_words(), "follows target 8, the camera is not moved");
    }
}
