// SPDX-License-Identifier: MPL-2.0

//! One picture in, the same picture finished: a pipeline that works in step with whoever feeds it.

use std::{
    sync::{
        Arc, Mutex,
        mpsc::{Receiver, RecvTimeoutError, Sender, channel},
    },
    time::{Duration, Instant},
};

use gst::prelude::*;
pub(crate) use ptztrack_contract::lock::lock;
use ptztrack_contract::{BufferMeta, TargetMeta};

/// No picture takes this long; who waits longer waits for something that never comes.
const PATIENCE: Duration = Duration::from_secs(30);

/// Name of the `appsrc` in a description.
pub(crate) const SOURCE: &str = "source";
/// Name of the last element.
pub(crate) const SINK: &str = "sink";

/// Why a pipeline did not finish a picture.
#[derive(Debug, thiserror::Error)]
pub(crate) enum PipelineError {
    /// It cannot be made as described.
    #[error("cannot make the pipeline: {0}")]
    Make(#[from] glib::Error),
    /// Something in it is missing or refuses.
    #[error("cannot make the pipeline: {0}")]
    Link(#[from] glib::BoolError),
    /// It has no element of that name.
    #[error("the pipeline has no element `{0}`")]
    NoElement(&'static str),
    /// It does not start.
    #[error("the pipeline does not start: {0}")]
    Start(String),
    /// An element posted an error or a warning: a run that is not sound is no run.
    #[error("{0}")]
    Posted(String),
    /// Who steers past all elements was not heard.
    #[error("the camera is not commanded: {0}")]
    Command(#[from] std::io::Error),
    /// Nothing came for [`PATIENCE`].
    #[error("the pipeline did not finish a picture within {PATIENCE:?}")]
    Stalled,
}

enum Event {
    /// The source wants a picture: whatever it had has gone all the way.
    Hungry,
    /// All of it has come to its end.
    Ended,
    Posted(String),
}

/// What reached the sink with the last picture.
#[derive(Default)]
struct Arrival {
    time: Option<gst::ClockTime>,
    target: Option<TargetMeta>,
}

/// What reached the sink last, where it is a file in itself: an encoded picture.
#[derive(Clone, Default)]
pub(crate) struct LastBytes(Arc<Mutex<Vec<u8>>>);

impl LastBytes {
    /// Each can be had once.
    pub fn take(&self) -> Vec<u8> {
        std::mem::take(&mut *lock(&self.0))
    }
}

/// Elements by name, with an error that says which is missing.
pub(crate) trait Elements {
    fn element(&self, name: &'static str) -> Result<gst::Element, PipelineError>;

    fn pad(&self, element: &'static str, pad: &str) -> Result<gst::Pad, PipelineError> {
        self.element(element)?.static_pad(pad).ok_or(PipelineError::NoElement(element))
    }
}

impl Elements for gst::Pipeline {
    fn element(&self, name: &'static str) -> Result<gst::Element, PipelineError> {
        self.by_name(name).ok_or(PipelineError::NoElement(name))
    }
}

/// A pipeline without a clock that stands still unless it is given a picture.
pub(crate) struct Pipeline {
    bin: gst::Pipeline,
    source: gst_app::AppSrc,
    events: Receiver<Event>,
    arrival: Arc<Mutex<Arrival>>,
}

impl Pipeline {
    /// Makes what `description` says: elements from an `appsrc` named [`SOURCE`] to a sink named [`SINK`], without
    /// a queue between. Pictures are of the format `info`.
    pub fn new(description: &str, info: &gst_video::VideoInfo) -> Result<Self, PipelineError> {
        Self::of_caps(description, &info.to_caps()?)
    }

    /// The same for what is of these caps.
    pub fn of_caps(description: &str, caps: &gst::Caps) -> Result<Self, PipelineError> {
        let bin = gst::parse::launch(description)?
            .downcast::<gst::Pipeline>()
            .map_err(|_| PipelineError::NoElement(SOURCE))?;
        // The stream's time is the world's: nothing shall look at a clock.
        bin.use_clock(gst::Clock::NONE);
        let source =
            bin.by_name(SOURCE).and_downcast::<gst_app::AppSrc>().ok_or(PipelineError::NoElement(SOURCE))?;
        source.set_caps(Some(caps));
        source.set_format(gst::Format::Time);
        let (sender, events) = channel();
        announce_hunger(&source, sender.clone());
        announce_faults(&bin, sender);
        Ok(Self { bin, source, events, arrival: Arc::default() })
    }

    /// The elements.
    pub fn bin(&self) -> &gst::Pipeline {
        &self.bin
    }

    /// Begins; to be called when everybody else has put up their probes.
    pub fn start(&self) -> Result<(), PipelineError> {
        let arrival = self.arrival.clone();
        self.bin.pad(SINK, "sink")?.add_probe(gst::PadProbeType::BUFFER, move |_, info| {
            if let Some(buffer) = info.buffer() {
                let target = TargetMeta::of(buffer).and_then(Result::ok);
                *lock(&arrival) = Arrival { time: buffer.pts(), target };
            }
            gst::PadProbeReturn::Ok
        });
        let started = self.bin.set_state(gst::State::Playing);
        started.map_err(|error| PipelineError::Start(self.posted().unwrap_or_else(|| error.to_string())))?;
        self.wait(|event| matches!(event, Event::Hungry))
    }

    /// What reaches the sink from now on; to be called before [`Self::start`].
    pub fn last_bytes(&self) -> Result<LastBytes, PipelineError> {
        let bytes = LastBytes::default();
        let LastBytes(out) = bytes.clone();
        self.bin.pad(SINK, "sink")?.add_probe(gst::PadProbeType::BUFFER, move |_, info| {
            let map = info.buffer().and_then(|buffer| buffer.map_readable().ok());
            *lock(&out) = map.map(|map| map.to_vec()).unwrap_or_default();
            gst::PadProbeReturn::Ok
        });
        Ok(bytes)
    }

    /// Sends a picture through and waits until all elements have done with it; gives the target meta that it had at
    /// the sink.
    pub fn finish(&self, buffer: gst::Buffer) -> Result<Option<TargetMeta>, PipelineError> {
        let time = buffer.pts();
        self.source
            .push_buffer(buffer)
            .map_err(|_| PipelineError::Posted(self.posted().unwrap_or_else(|| "it has ended".into())))?;
        self.wait(|event| matches!(event, Event::Hungry) && lock(&self.arrival).time == time)?;
        Ok(lock(&self.arrival).target.take())
    }

    /// Caps of what reaches the sink, once something did.
    pub fn caps(&self) -> Result<gst::Caps, PipelineError> {
        self.bin.pad(SINK, "sink")?.current_caps().ok_or(PipelineError::Stalled)
    }

    /// Sends an event from the sink to all elements before it, as a servo does; to be called between pictures.
    pub fn send_upstream(&self, event: gst::Event) -> Result<(), PipelineError> {
        // Who does not know it leaves it alone: that is no fault.
        self.bin.pad(SINK, "sink")?.push_event(event);
        Ok(())
    }

    /// Ends the stream, and waits until whatever writes a file has written it.
    pub fn end(&self) -> Result<(), PipelineError> {
        self.source.end_of_stream().map_err(|_| PipelineError::Stalled)?;
        self.wait(|event| matches!(event, Event::Ended))
    }

    /// Waits for an event that is `wanted`.
    fn wait(&self, wanted: impl Fn(&Event) -> bool) -> Result<(), PipelineError> {
        let deadline = Instant::now() + PATIENCE;
        loop {
            match self.events.recv_timeout(deadline.saturating_duration_since(Instant::now())) {
                Ok(event) if wanted(&event) => return Ok(()),
                Ok(Event::Posted(text)) => return Err(PipelineError::Posted(text)),
                Ok(Event::Hungry | Event::Ended) => {}
                Err(RecvTimeoutError::Timeout | RecvTimeoutError::Disconnected) => {
                    return Err(PipelineError::Stalled);
                }
            }
        }
    }

    fn posted(&self) -> Option<String> {
        self.events.try_iter().find_map(|event| match event {
            Event::Posted(text) => Some(text),
            Event::Hungry | Event::Ended => None,
        })
    }
}

impl Drop for Pipeline {
    fn drop(&mut self) {
        // Nothing more can be done about a pipeline that will not stop.
        let _ = self.bin.set_state(gst::State::Null);
    }
}

fn announce_hunger(source: &gst_app::AppSrc, sender: Sender<Event>) {
    // Who no longer listens wants no news.
    let hungry = move |_: &gst_app::AppSrc, _| drop(sender.send(Event::Hungry));
    source.set_callbacks(gst_app::AppSrcCallbacks::builder().need_data(hungry).build());
}

fn announce_faults(bin: &gst::Pipeline, sender: Sender<Event>) {
    let Some(bus) = bin.bus() else { return };
    bus.set_sync_handler(move |_, message| {
        let event = match message.type_() {
            gst::MessageType::Eos => Some(Event::Ended),
            _ => fault(message).map(Event::Posted),
        };
        if let Some(event) = event {
            let _ = sender.send(event);
        }
        gst::BusSyncReply::Drop
    });
}

/// What an error or a warning says, and who.
pub(crate) fn fault(message: &gst::Message) -> Option<String> {
    let who = || message.src().map_or_else(|| "pipeline".into(), |source| source.name());
    match message.view() {
        gst::MessageView::Error(error) => Some(format!("{}: {}", who(), error.error())),
        gst::MessageView::Warning(warning) => Some(format!("{}: {}", who(), warning.error())),
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn info() -> gst_video::VideoInfo {
        gst::init().unwrap();
        gst_video::VideoInfo::builder(gst_video::VideoFormat::I420, 64, 48).build().unwrap()
    }

    fn picture(info: &gst_video::VideoInfo, milliseconds: u64) -> gst::Buffer {
        let mut buffer = gst::Buffer::with_size(info.size()).unwrap();
        buffer.get_mut().unwrap().set_pts(gst::ClockTime::from_mseconds(milliseconds));
        buffer
    }

    #[test]
    fn a_picture_is_finished_when_it_has_reached_the_end() {
        let info = info();
        let pipeline =
            Pipeline::new("appsrc name=source ! identity name=last ! fakesink name=sink sync=false", &info)
                .unwrap();
        let seen = Arc::new(Mutex::new(0));
        let counted = seen.clone();
        let pad = pipeline.bin().pad("last", "src").unwrap();
        pad.add_probe(gst::PadProbeType::BUFFER, move |_, info| {
            *lock(&counted) += 1;
            let meta = TargetMeta { id: *lock(&counted), ..TargetMeta::default() };
            meta.attach(info.buffer_mut().unwrap().make_mut()).unwrap();
            gst::PadProbeReturn::Ok
        });
        pipeline.start().unwrap();
        for n in 1..50 {
            let target = pipeline.finish(picture(&info, 40 * n)).unwrap();
            assert_eq!((*lock(&seen), target.unwrap().id), (n, n));
        }
    }

    #[test]
    fn a_fault_is_told_in_its_own_words() {
        let info = info();
        let broken = "appsrc name=source ! identity error-after=3 name=thing ! fakesink name=sink sync=false";
        let pipeline = Pipeline::new(broken, &info).unwrap();
        pipeline.start().unwrap();
        assert!(pipeline.finish(picture(&info, 0)).is_ok());
        let told = (1..5).find_map(|n| pipeline.finish(picture(&info, n)).err()).unwrap();
        assert!(matches!(&told, PipelineError::Posted(text) if text.starts_with("thing: ")), "{told}");
        assert!(Pipeline::new("appsrc name=source ! nonsense", &info).is_err());
    }
}
