// SPDX-License-Identifier: MPL-2.0

//! Makes what goes to those who watch a camera: one pipeline for all of them.

use std::sync::Arc;

use gst::subclass::prelude::*;
use gst_rtsp_server::{gst_rtsp, prelude::*, subclass::prelude::*};
use ptztrack_contract::lock::lock;

use super::ROLE;
use super::feed::Feed;
use super::payloader::{DOCUMENT, MetadataPayloader};
use crate::config::Codec;
use crate::fleet::Fleet;

glib::wrapper! {
    /// One camera's.
    pub struct MediaFactory(ObjectSubclass<imp::MediaFactory>)
        @extends gst_rtsp_server::RTSPMediaFactory;
}

glib::wrapper! {
    /// What goes to those who watch.
    pub struct Media(ObjectSubclass<imp::Media>)
        @extends gst_rtsp_server::RTSPMedia;
}

impl MediaFactory {
    /// For the camera of this name, whose stream comes in this form.
    pub fn new(fleet: Arc<Fleet>, camera: &str, codec: Codec, runtime: tokio::runtime::Handle) -> Self {
        let factory: Self = glib::Object::new();
        // It is new: nothing was set before.
        let _ = factory.imp().0.set(imp::Making { fleet, camera: camera.to_owned(), codec, runtime });
        let access = gst::Structure::builder(ROLE)
            .field("media.factory.access", true)
            .field("media.factory.construct", true)
            .build();
        factory.add_role_from_structure(&access);
        factory.set_shared(true);
        // By UDP, reports would be taken from anybody on the network, and pictures go in clear beside a connection by TLS.
        factory.set_protocols(gst_rtsp::RTSPLowerTrans::TCP);
        factory.set_media_gtype(Media::static_type());
        // The packets' times are told by it.
        factory.set_clock(Some(&gst::SystemClock::obtain()));
        factory
    }
}

mod imp {
    use std::sync::OnceLock;

    use super::*;

    pub struct Making {
        pub fleet: Arc<Fleet>,
        pub camera: String,
        pub codec: Codec,
        pub runtime: tokio::runtime::Handle,
    }

    #[derive(Default)]
    pub struct MediaFactory(pub OnceLock<Making>);

    #[glib::object_subclass]
    impl ObjectSubclass for MediaFactory {
        const NAME: &'static str = "PtztrackMediaFactory";
        type Type = super::MediaFactory;
        type ParentType = gst_rtsp_server::RTSPMediaFactory;
    }

    impl ObjectImpl for MediaFactory {}

    impl RTSPMediaFactoryImpl for MediaFactory {
        /// One for all, whatever they add to the address.
        fn gen_key(&self, _: &gst_rtsp::RTSPUrl) -> Option<glib::GString> {
            self.0.get().map(|making| making.camera.as_str().into())
        }

        fn create_element(&self, _: &gst_rtsp::RTSPUrl) -> Option<gst::Element> {
            // Not `None`, which the binding passes on to GLib, and that calls it critical.
            let made = self.0.get().and_then(Making::make);
            Some(made.unwrap_or_else(|| gst::Bin::new().upcast()))
        }
    }

    impl Making {
        fn make(&self) -> Option<gst::Element> {
            self.fleet.of(&self.camera).filter(|known| lock(&known.state).picture)?;
            let bin = gst::parse::launch(&description(self.codec)).ok()?.downcast::<gst::Bin>().ok()?;
            let payloader: MetadataPayloader = glib::Object::builder().property("name", "pay1").build();
            payloader.set_property("pt", 97u32);
            bin.add(&payloader).ok()?;
            let [video, metadata] =
                ["video", "metadata"].map(|name| bin.by_name(name)?.downcast::<gst_app::AppSrc>().ok());
            let (video, metadata) = (video?, metadata?);
            metadata.link(&payloader).ok()?;
            let feed = Feed {
                fleet: self.fleet.clone(),
                camera: self.camera.clone(),
                codec: self.codec,
                video: video.downgrade(),
                metadata: metadata.downgrade(),
            };
            self.runtime.spawn(feed.run());
            Some(bin.upcast())
        }
    }

    #[derive(Default)]
    pub struct Media;

    #[glib::object_subclass]
    impl ObjectSubclass for Media {
        const NAME: &'static str = "PtztrackMedia";
        type Type = super::Media;
        type ParentType = gst_rtsp_server::RTSPMedia;
    }

    impl ObjectImpl for Media {}

    impl RTSPMediaImpl for Media {
        /// A camera that has no picture has no streams; the client is told at once.
        fn prepare(&self, thread: &gst_rtsp_server::RTSPThread) -> Result<(), gst::LoggableError> {
            if self.obj().n_streams() == 0 {
                return Err(gst::loggable_error!(gst::CAT_RUST, "no picture"));
            }
            self.parent_prepare(thread)
        }

        /// Reports of both streams tell when a picture came, not when this or that was sent of it.
        fn setup_rtpbin(&self, rtpbin: &gst::Element) -> Result<(), gst::LoggableError> {
            rtpbin.set_property("rtcp-sync-send-time", false);
            self.parent_setup_rtpbin(rtpbin)
        }
    }
}

/// So much waits for a visitor at most, in bytes: a camera may send pictures of any size.
const LONGEST_QUEUE: u64 = 64 * 1024 * 1024;

/// Packets of the stream as it is, and documents for the payloader that is added.
fn description(codec: Codec) -> String {
    let payloader = match codec {
        Codec::Mjpeg => "rtpjpegpay pt=26",
        Codec::Mpeg4 => "rtpmp4vpay config-interval=1 pt=96",
        Codec::H264 => "rtph264pay config-interval=-1 pt=96",
        Codec::H265 => "rtph265pay config-interval=-1 pt=96",
    };
    let source = format!(
        "appsrc is-live=true format=time block=false leaky-type=downstream max-buffers=64 max-bytes={LONGEST_QUEUE}"
    );
    format!("( {source} name=video ! {payloader} name=pay0 {source} name=metadata caps={DOCUMENT} )")
}
