// SPDX-License-Identifier: MPL-2.0

//! What pictures go through before a tracker sees them: a real encoder and its decoder.

use std::{
    collections::VecDeque,
    sync::{Arc, Mutex},
};

use gst::prelude::*;

use crate::{
    pipeline::{Elements, PipelineError, lock},
    record::Codec,
};

/// VAPIX compression that the virtual camera uses unless asked for another.
const COMPRESSION: u32 = 30;

/// What a narrow line carries, and what cameras send where it is wide: kilobits a second.
const LOW_KBIT_S: u32 = 250;
const USUAL_KBIT_S: u32 = 2000;

/// The element that makes JPEGs as the virtual camera does.
pub(crate) fn jpeg_encoder() -> String {
    format!("jpegenc quality={}", 100 - COMPRESSION)
}

fn h264_encoder(kbit_s: u32) -> String {
    format!(
        "x264enc name=encoder tune=zerolatency sliced-threads=false threads=1 speed-preset=ultrafast key-int-max=50 \
         bitrate={kbit_s} ! video/x-h264,profile=constrained-baseline"
    )
}

impl Codec {
    /// The elements, as the virtual camera sets them for its own streams. Each gives one picture for one, at once.
    pub(crate) fn description(self) -> String {
        format!("{} ! {}", self.encoder(), self.decoder())
    }

    /// From pictures to what the camera sends.
    pub(crate) fn encoder(self) -> String {
        match self {
            Self::Mjpeg => jpeg_encoder(),
            Self::Mpeg4 => {
                format!("avenc_mpeg4 name=encoder gop-size=25 pass=quant quantizer={}", 2 + COMPRESSION / 10)
            }
            Self::Raw => "identity".into(),
            Self::Mpeg4Low => {
                format!("avenc_mpeg4 name=encoder gop-size=25 pass=cbr bitrate={}", 1000 * LOW_KBIT_S)
            }
            Self::H264 => h264_encoder(USUAL_KBIT_S),
            Self::H264Low => h264_encoder(LOW_KBIT_S),
        }
    }

    /// And back.
    pub(crate) fn decoder(self) -> &'static str {
        match self {
            Self::Mjpeg => "jpegdec",
            Self::Mpeg4 | Self::Mpeg4Low => "avdec_mpeg4 max-threads=1",
            Self::Raw => "identity",
            Self::H264 | Self::H264Low => "avdec_h264 max-threads=1",
        }
    }

    /// Mends what the elements do wrong.
    pub(crate) fn attach(self, pipeline: &gst::Pipeline) -> Result<(), PipelineError> {
        match self {
            Self::Mjpeg | Self::Raw => Ok(()),
            Self::Mpeg4 | Self::Mpeg4Low | Self::H264 | Self::H264Low => {
                keep_times(&pipeline.pad("encoder", "sink")?, &pipeline.pad("encoder", "src")?)
            }
        }
    }
}

/// `avenc_mpeg4` of GStreamer 1.22 gives all pictures the same time, in a segment of its own that begins a thousand
/// hours later, as `x264enc`'s does. They leave in the order in which they came, as there are no bidirectional ones.
fn keep_times(sink: &gst::Pad, source: &gst::Pad) -> Result<(), PipelineError> {
    let times = Arc::new(Mutex::new(VecDeque::new()));
    let entering = times.clone();
    sink.add_probe(gst::PadProbeType::BUFFER, move |_, info| {
        lock(&entering).extend(info.buffer().map(|buffer| buffer.pts()));
        gst::PadProbeReturn::Ok
    });
    source.add_probe(gst::PadProbeType::BUFFER, move |_, info| {
        let time = lock(&times).pop_front().flatten();
        if let Some(buffer) = info.buffer_mut().map(gst::Buffer::make_mut) {
            buffer.set_pts(time);
            buffer.set_dts(time);
        }
        gst::PadProbeReturn::Ok
    });
    source.add_probe(gst::PadProbeType::EVENT_DOWNSTREAM, |_, info| {
        if let Some(event) = info.event_mut().filter(|event| event.type_() == gst::EventType::Segment) {
            *event = gst::event::Segment::new(&gst::FormattedSegment::<gst::ClockTime>::new());
        }
        gst::PadProbeReturn::Ok
    });
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::pipeline::Pipeline;

    /// Sends pictures of growing brightness through; gives what comes out for each, as (time, brightness).
    fn through(codec: Codec) -> Vec<(Option<gst::ClockTime>, u8)> {
        gst::init().unwrap();
        let info = gst_video::VideoInfo::builder(gst_video::VideoFormat::I420, 64, 48)
            .fps(gst::Fraction::new(25, 1))
            .build()
            .unwrap();
        let description =
            format!("appsrc name=source ! {} ! fakesink name=sink sync=false", codec.description());
        let pipeline = Pipeline::new(&description, &info).unwrap();
        codec.attach(pipeline.bin()).unwrap();
        let out = Arc::new(Mutex::new(Vec::new()));
        let seen = out.clone();
        pipeline.bin().pad("sink", "sink").unwrap().add_probe(gst::PadProbeType::BUFFER, move |_, info| {
            let buffer = info.buffer().unwrap();
            lock(&seen).push((buffer.pts(), buffer.map_readable().unwrap()[64 * 24 + 32]));
            gst::PadProbeReturn::Ok
        });
        pipeline.start().unwrap();
        for n in 0..60u8 {
            let mut buffer = gst::Buffer::from_slice(vec![60 + 2 * n; info.size()]);
            buffer.get_mut().unwrap().set_pts(gst::ClockTime::from_mseconds(40 * u64::from(n)));
            pipeline.finish(buffer).unwrap();
            // No picture is kept back for the next.
            assert_eq!(lock(&out).len(), usize::from(n) + 1);
        }
        let out = lock(&out);
        out.clone()
    }

    #[test]
    fn every_picture_comes_out_at_its_time_before_the_next_goes_in() {
        for &codec in Codec::ALL {
            let out = through(codec);
            for (n, (time, brightness)) in out.iter().enumerate() {
                assert_eq!(*time, Some(gst::ClockTime::from_mseconds(40 * n as u64)), "{codec}");
                assert!(brightness.abs_diff(60 + 2 * n as u8) <= 3, "{codec} {n}: {brightness}");
            }
            assert_eq!(out, through(codec), "{codec}");
        }
    }
}
