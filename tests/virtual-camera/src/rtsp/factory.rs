// SPDX-License-Identifier: MPL-2.0

//! Makes a pipeline for each client, and feeds it.

use std::sync::{Arc, Once};

use gst::subclass::prelude::*;
use gst_rtsp_server::{gst_rtsp, prelude::*, subclass::prelude::*};

use super::{codec::Codec, stamp};
use crate::{
    camera::Camera,
    pace::Pace,
    picture::video_info,
    threads::Threads,
    vapix::parse_args,
    wish::{PictureError, Wish, argument},
};

glib::wrapper! {
    /// Makes what an RTSP URL asks for.
    pub struct MediaFactory(ObjectSubclass<imp::MediaFactory>)
        @extends gst_rtsp_server::RTSPMediaFactory;
}

impl MediaFactory {
    /// `codec` is what comes where the URL names none; `role` may watch.
    pub(super) fn new(camera: Arc<Camera>, feeders: Arc<Threads>, codec: Codec, role: &str) -> Self {
        let factory: Self = glib::Object::new();
        // It is new: nothing was set before.
        let _ = factory.imp().0.set(imp::Making { camera, feeders, codec });
        let access = gst::Structure::builder(role)
            .field("media.factory.access", true)
            .field("media.factory.construct", true)
            .build();
        factory.add_role_from_structure(&access);
        factory
    }
}

mod imp {
    use std::sync::OnceLock;

    use super::*;

    pub(super) struct Making {
        pub(super) camera: Arc<Camera>,
        pub(super) feeders: Arc<Threads>,
        pub(super) codec: Codec,
    }

    #[derive(Default)]
    pub struct MediaFactory(pub(super) OnceLock<Making>);

    #[glib::object_subclass]
    impl ObjectSubclass for MediaFactory {
        const NAME: &'static str = "VirtualCameraMediaFactory";
        type Type = super::MediaFactory;
        type ParentType = gst_rtsp_server::RTSPMediaFactory;
    }

    impl ObjectImpl for MediaFactory {}

    impl RTSPMediaFactoryImpl for MediaFactory {
        fn create_element(&self, url: &gst_rtsp::RTSPUrl) -> Option<gst::Element> {
            // A refused URL makes a media without streams, which the server tells the client. `None` would do too,
            // but the binding passes it on to GLib, which calls that critical.
            let made = self.0.get().and_then(|making| making.make(&url.request_uri()).ok());
            Some(made.unwrap_or_else(|| gst::Bin::new().upcast()))
        }
    }

    impl Making {
        fn make(&self, uri: &str) -> Result<gst::Element, PictureError> {
            let query = uri.split_once('?').map_or("", |(_, query)| query);
            let args = parse_args(query.as_bytes());
            let codec = argument(&args, "videocodec", Codec::parse)?.unwrap_or(self.codec);
            let wish = Wish::parse(&args, &self.camera)?;
            element(&self.camera, &self.feeders, codec, wish)
                .map_err(|error| PictureError::Encode(error.into()))
        }
    }
}

fn element(
    camera: &Arc<Camera>,
    feeders: &Arc<Threads>,
    codec: Codec,
    wish: Wish,
) -> Result<gst::Element, glib::Error> {
    let element = gst::parse::launch(&codec.launch(&wish))?;
    let child = |name| element.downcast_ref::<gst::Bin>().and_then(|bin| bin.by_name(name));
    if let Some(encoder) = child("encoder") {
        stamp::correct(&encoder);
    }
    let source = child("video");
    if let Some(source) = source.and_downcast::<gst_app::AppSrc>() {
        let info = video_info(wish.size, wish.frame_rate).ok();
        source.set_caps(info.and_then(|info| info.to_caps().ok()).as_ref());
        let (camera, feeders, begin) = (camera.clone(), feeders.clone(), Once::new());
        let feed_when_needed = move |source: &gst_app::AppSrc, _| {
            let (camera, source) = (camera.clone(), source.downgrade());
            // Without a thread there is no picture, and the client gives up.
            begin.call_once(|| drop(feeders.spawn("camera-rtp", move || feed(&camera, &source, wish))));
        };
        source.set_callbacks(gst_app::AppSrcCallbacks::builder().need_data(feed_when_needed).build());
    }
    Ok(element)
}

/// Draws for one client until its pipeline or the camera stops.
fn feed(camera: &Arc<Camera>, source: &glib::WeakRef<gst_app::AppSrc>, wish: Wish) {
    let _viewer = camera.viewer_begins();
    let Ok(info) = video_info(wish.size, wish.frame_rate) else {
        return;
    };
    let mut pace = Pace::new(wish.frame_rate, camera.newest_exposure());
    // Pictures are due when they are taken; the first one is due when it comes.
    let (mut origin, mut last) = (None, None);
    loop {
        let exposure = pace.next_exposure();
        if !camera.wait_until(camera.arrival(exposure)) {
            return;
        }
        let buffer = camera
            .sent_picture(exposure, wish.size, &mut last)
            .ok()
            .and_then(|picture| picture.to_buffer(&info));
        let (Some(mut buffer), Some(source)) = (buffer, source.upgrade()) else {
            return;
        };
        let taken = gst::ClockTime::from_nseconds(exposure.as_nanos() as u64);
        let running = source.current_running_time().unwrap_or_default();
        let (start, first) = *origin.get_or_insert((running, taken));
        if let Some(buffer) = buffer.get_mut() {
            buffer.set_pts(start + taken.saturating_sub(first));
        }
        if source.push_buffer(buffer).is_err() {
            return;
        }
        pace.advance(camera.oldest_pending());
    }
}
