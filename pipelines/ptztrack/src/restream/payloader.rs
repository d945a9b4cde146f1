// SPDX-License-Identifier: MPL-2.0

//! Documents of ONVIF's metadata as RTP: XML as it is, in as many packets as it takes, the last of them marked (ONVIF Streaming
//! Specification, 5.1.2.1.1). GStreamer has an element for that in `gst-plugins-rs`, which Debian 12 has not.

use gst_rtp::prelude::*;
use gst_rtp::subclass::prelude::*;

glib::wrapper! {
    /// Makes packets of documents.
    pub struct MetadataPayloader(ObjectSubclass<imp::MetadataPayloader>)
        @extends gst_rtp::RTPBasePayload, gst::Element, gst::Object;
}

/// What it takes, by the name that GStreamer has for it.
pub const DOCUMENT: &str = "application/x-onvif-metadata";

/// What it makes: whoever reads it knows `VND.ONVIF.METADATA` in small letters, too.
const ENCODING: &str = "VND.ONVIF.METADATA";
const CLOCK_RATE: u32 = 90_000;

/// The parts of a document.
fn packets(payloader: &MetadataPayloader, document: &gst::BufferRef) -> Option<gst::BufferList> {
    let most =
        usize::try_from(gst_rtp::calc_payload_len(payloader.mtu(), 0, 0)).ok().filter(|most| *most > 0)?;
    let text = document.map_readable().ok()?;
    let mut parts = text.chunks(most).peekable();
    let mut list = gst::BufferList::new();
    let packets = list.get_mut()?;
    while let Some(part) = parts.next() {
        let mut packet = gst::Buffer::new_rtp_with_sizes(u32::try_from(part.len()).ok()?, 0, 0).ok()?;
        let buffer = packet.get_mut()?;
        buffer.set_pts(document.pts());
        let mut rtp = gst_rtp::RTPBuffer::from_buffer_writable(buffer).ok()?;
        rtp.payload_mut().ok()?.copy_from_slice(part);
        rtp.set_marker(parts.peek().is_none());
        drop(rtp);
        packets.add(packet);
    }
    Some(list)
}

mod imp {
    use std::sync::LazyLock;

    use super::*;

    #[derive(Default)]
    pub struct MetadataPayloader;

    #[glib::object_subclass]
    impl ObjectSubclass for MetadataPayloader {
        const NAME: &'static str = "PtztrackMetadataPayloader";
        type Type = super::MetadataPayloader;
        type ParentType = gst_rtp::RTPBasePayload;
    }

    impl ObjectImpl for MetadataPayloader {}
    impl GstObjectImpl for MetadataPayloader {}

    impl ElementImpl for MetadataPayloader {
        fn metadata() -> Option<&'static gst::subclass::ElementMetadata> {
            static METADATA: LazyLock<gst::subclass::ElementMetadata> = LazyLock::new(|| {
                let what = "Makes RTP packets of ONVIF's metadata";
                // gst-rtsp-server looks for a payloader by its class.
                gst::subclass::ElementMetadata::new(
                    "ONVIF metadata",
                    "Codec/Payloader/Network/RTP",
                    what,
                    "ptztrack",
                )
            });
            Some(&METADATA)
        }

        fn pad_templates() -> &'static [gst::PadTemplate] {
            static TEMPLATES: LazyLock<Vec<gst::PadTemplate>> = LazyLock::new(|| {
                let packets = gst::Caps::builder("application/x-rtp")
                    .field("media", "application")
                    .field("payload", gst::IntRange::new(96, 127))
                    .field("clock-rate", CLOCK_RATE as i32)
                    .field("encoding-name", ENCODING)
                    .build();
                let documents = gst::Caps::new_empty_simple(DOCUMENT);
                let always = |name, direction, caps| {
                    gst::PadTemplate::new(name, direction, gst::PadPresence::Always, &caps)
                };
                let sink = always("sink", gst::PadDirection::Sink, documents);
                let source = always("src", gst::PadDirection::Src, packets);
                [sink, source].into_iter().flatten().collect()
            });
            &TEMPLATES
        }
    }

    impl RTPBasePayloadImpl for MetadataPayloader {
        fn set_caps(&self, _: &gst::Caps) -> Result<(), gst::LoggableError> {
            self.obj().set_options("application", true, ENCODING, CLOCK_RATE);
            let refused = |_| gst::loggable_error!(gst::CAT_RUST, "nobody takes ONVIF metadata");
            self.obj().set_outcaps(None).map_err(refused)
        }

        fn handle_buffer(&self, document: gst::Buffer) -> Result<gst::FlowSuccess, gst::FlowError> {
            let packets = packets(&self.obj(), &document).ok_or(gst::FlowError::Error)?;
            self.obj().push_list(packets)
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_document_is_whole_where_its_marked_packet_has_come() {
        gst::init().unwrap();
        let payloader: MetadataPayloader = glib::Object::new();
        payloader.set_mtu(112);
        let mut document = gst::Buffer::from_slice([b'x'; 250]);
        document.get_mut().unwrap().set_pts(gst::ClockTime::from_mseconds(40));
        let list = packets(&payloader, &document).unwrap();
        let parts: Vec<_> = list
            .iter()
            .map(|packet| {
                let rtp = gst_rtp::RTPBuffer::from_buffer_readable(packet).unwrap();
                (rtp.payload_size(), rtp.is_marker(), packet.pts() == document.pts())
            })
            .collect();
        assert_eq!(parts, [(100, false, true), (100, false, true), (50, true, true)]);
    }
}
