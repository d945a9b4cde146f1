// SPDX-License-Identifier: MPL-2.0

//! What is recorded, in a pipeline and a thread of its own: a disk that is full, slow, broken or hangs costs the recording and
//! nothing else, and so does an encoder or a parser that fails or is not installed. Copies reach it over an `appsrc` that takes them at
//! once, and drops them where they are not written.
//!
//! ```text
//! pipeline of the camera ─ appsink ─ Feed ─ appsrc ─ (encoder) ─ parser ─ splitmuxsink
//! ```

mod clip;
mod files;
mod segments;

pub use clip::{Clip, Form, NoClip, Purpose, cut};
pub use files::{now_ms, pieces};
pub use segments::Segments;

use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::sync::mpsc::{Receiver, Sender, channel};
use std::sync::{Arc, Condvar, Mutex};
use std::thread;
use std::time::{Duration, Instant};

use gst::prelude::*;
use ptztrack_contract::lock::lock;

use self::segments::Arrivals;
use super::bounds::{self, cost};
use crate::config::{CameraSettings, Codec, Recording};
use crate::event::{Event, Level};
use crate::log::Log;

/// The overlay, encoded, as it is recorded.
const ENCODER: &str = "videoconvert ! x264enc tune=zerolatency speed-preset=superfast key-int-max=30";

/// So much waits for a disk that is slow for a moment, in bytes.
const LONGEST_QUEUE: u64 = 16 * 1024 * 1024;

/// So many pictures wait for it at most: small ones take more than their bytes.
const MOST_QUEUED: u64 = LONGEST_QUEUE / bounds::BUFFER as u64;

/// Of pictures in a row that need the one before, in bytes of memory that they take: a minute at 32 Mbit/s. Cameras send one that needs
/// no other every few seconds, or once a minute where nothing moves and little is sent.
const LONGEST_GROUP: usize = 256 * 1024 * 1024;

/// Between two tries; twice as long each time.
const SHORTEST_PAUSE: Duration = Duration::from_secs(1);
const LONGEST_PAUSE: Duration = Duration::from_secs(60);

/// How often it is seen whether there is room on the disk.
const LOOK: Duration = Duration::from_secs(5);

/// The end of a file is waited for this long.
const LONGEST_END: Duration = Duration::from_secs(10);

/// Records one camera, of each of its pipelines in turn.
#[derive(Debug, Clone)]
pub struct Recorder {
    settings: Recording,
    camera: CameraSettings,
    log: Arc<Log>,
    /// Held by everybody who still writes.
    _writing: Sender<()>,
    trouble: Arc<Mutex<bool>>,
    /// Whether it was said that files are deleted to make room.
    told_early: Arc<AtomicBool>,
    segments: Arc<Segments>,
}

/// Hears when nobody writes any more.
#[derive(Debug)]
pub struct Recordings(Receiver<()>);

/// Where copies go while there is somebody to write them.
#[derive(Debug, Default)]
struct Feed {
    state: Mutex<FeedState>,
    ends: Condvar,
}

#[derive(Debug, Default)]
struct FeedState {
    source: Option<gst_app::AppSrc>,
    /// It begins with a picture that needs no other.
    begun: bool,
    ended: bool,
}

impl Recorder {
    /// For one camera; nothing is written yet.
    pub fn new(settings: &Recording, camera: &CameraSettings, log: Arc<Log>) -> (Self, Recordings) {
        let (writing, written) = channel();
        (
            Self {
                settings: settings.clone(),
                camera: camera.clone(),
                log,
                _writing: writing,
                trouble: Arc::default(),
                told_early: Arc::default(),
                segments: Arc::default(),
            },
            Recordings(written),
        )
    }

    /// The files that it has begun.
    pub fn segments(&self) -> Arc<Segments> {
        self.segments.clone()
    }

    /// Records what comes to this sink, until its stream ends or it is no more.
    pub fn record(self, tap: &gst_app::AppSink) {
        let feed = Arc::new(Feed::default());
        let ends = feed.clone();
        // Ends the stream too where the pipeline is dropped without an end.
        let taps = Tap(feed.clone());
        let copy = move |sink: &gst_app::AppSink| {
            let sample = sink.pull_sample().map_err(|_| gst::FlowError::Eos)?;
            taps.0.copy(&sample);
            Ok(gst::FlowSuccess::Ok)
        };
        let callbacks = gst_app::AppSinkCallbacks::builder().new_sample(copy).eos(move |_| ends.end());
        tap.set_callbacks(callbacks.build());
        let name = format!("{}-record", self.camera.name);
        let log = self.log.clone();
        let camera = self.camera.name.clone();
        if let Err(err) = thread::Builder::new().name(name).spawn(move || self.run(&feed)) {
            let detail = format!("nothing is recorded: {err}");
            log.tell(&Event::new(Level::Error, Some(&camera), "recording-failed", &detail));
        }
    }

    /// In its own thread: writes, and begins anew where that fails.
    fn run(&self, feed: &Feed) {
        let mut pause = SHORTEST_PAUSE;
        loop {
            let begin = Instant::now();
            let failure = match self.write(feed) {
                Ok(()) => return,
                Err(failure) => failure,
            };
            if begin.elapsed() > LONGEST_PAUSE {
                pause = SHORTEST_PAUSE;
            }
            feed.stop();
            if feed.has_ended() {
                return;
            }
            if !std::mem::replace(&mut *lock(&self.trouble), true) {
                let detail = format!("nothing is recorded: {failure}; the camera keeps following; retrying");
                self.tell(Level::Warning, "recording-failed", &detail);
            }
            if feed.ends_within(pause) {
                return;
            }
            pause = (pause * 2).min(LONGEST_PAUSE);
        }
    }

    /// Until the end of the stream.
    fn write(&self, feed: &Feed) -> Result<(), String> {
        if let Some(lacks) = self.camera.lacks() {
            return Err(lacks);
        }
        self.make_room()?;
        let said = |err: glib::Error| err.message().to_owned();
        let pipeline =
            gst::parse::launch(&description(self.camera.codec, self.settings.overlay)).map_err(said)?;
        let pipeline = pipeline.downcast::<gst::Pipeline>().map_err(|_| "no pipeline")?;
        let arrivals = Arc::new(Arrivals::default());
        let came = arrivals.clone();
        files::configure(&pipeline, &self.settings, &self.camera.name, &self.segments, move |pts| {
            came.came_ms(pts)
        });
        let source = pipeline.by_name("feed").and_then(|source| source.downcast::<gst_app::AppSrc>().ok());
        let bus = pipeline.bus().ok_or("a pipeline without a bus")?;
        // Where it fails, a message has the reason.
        let _ = pipeline.set_state(gst::State::Playing);
        feed.start(source.ok_or("no source")?, arrivals);
        let result = loop {
            let wait = gst::ClockTime::from_nseconds(u64::try_from(LOOK.as_nanos()).unwrap_or(u64::MAX));
            let kinds = [gst::MessageType::Eos, gst::MessageType::Error];
            match bus.timed_pop_filtered(wait, &kinds) {
                None => {
                    if let Err(short) = self.make_room() {
                        break Err(short.to_owned());
                    }
                    if files::newest_grew(&self.settings, &self.camera.name, LOOK * 2)
                        && std::mem::take(&mut *lock(&self.trouble))
                    {
                        self.tell(Level::Info, "recording", "it is recorded again");
                    }
                }
                Some(message) => match message.view() {
                    gst::MessageView::Error(error) => break Err(error.error().message().to_owned()),
                    _ => break Ok(()),
                },
            }
        };
        let _ = pipeline.set_state(gst::State::Null);
        result
    }

    /// Says once where files go before their time.
    fn make_room(&self) -> Result<(), &'static str> {
        let room = files::make_room(&self.settings, &self.camera.name, &self.segments);
        if room.deleted > 0 && !self.told_early.swap(true, Ordering::Relaxed) {
            self.tell(Level::Warning, "recording-deleted-early", files::EARLY);
        }
        if room.is_short { Err(files::SHORT) } else { Ok(()) }
    }

    fn tell(&self, level: Level, event: &str, detail: &str) {
        self.log.tell(&Event::new(level, Some(&self.camera.name), event, detail));
    }
}

fn description(codec: Codec, overlay: bool) -> String {
    let codec = if overlay { Codec::H264 } else { codec };
    let parser = match codec {
        Codec::Mjpeg => "jpegparse",
        Codec::Mpeg4 => "mpeg4videoparse",
        Codec::H264 => "h264parse",
        Codec::H265 => "h265parse",
    };
    // Pictures that are not encoded yet do not wait: few would fit, and they would be taken for later ones.
    let (most, encoder) = match overlay {
        true => (
            1,
            format!(
                "{ENCODER} ! queue max-size-bytes={LONGEST_QUEUE} max-size-buffers={MOST_QUEUED} max-size-time=0 ! "
            ),
        ),
        false => (MOST_QUEUED, String::new()),
    };
    format!(
        "appsrc name=feed is-live=true format=time block=false leaky-type=downstream max-bytes={LONGEST_QUEUE} \
         max-buffers={most} ! {encoder}{parser} name=parser ! splitmuxsink name=recording muxer-factory=matroskamux"
    )
}

impl Recordings {
    /// Waits until all files are whole; not for ever, as a disk may hang.
    pub fn wait(self) {
        // Nothing is ever sent: it ends with the last who could.
        let _ = self.0.recv_timeout(LONGEST_END);
    }
}

impl Feed {
    /// Leaves a copy for whoever writes; waits for nothing.
    fn copy(&self, sample: &gst::Sample) {
        let mut state = lock(&self.state);
        let Some(source) = state.source.clone() else { return };
        let delta =
            sample.buffer().is_none_or(|buffer| buffer.flags().contains(gst::BufferFlags::DELTA_UNIT));
        if state.begun || !delta {
            state.begun = true;
            // Where it is over, its own thread says so.
            let _ = source.push_sample(sample);
        }
    }

    fn start(&self, source: gst_app::AppSrc, arrivals: Arc<Arrivals>) {
        watch_groups(&source, arrivals);
        let mut state = lock(&self.state);
        if state.ended {
            let _ = source.end_of_stream();
        }
        (state.source, state.begun) = (Some(source), false);
    }

    fn stop(&self) {
        lock(&self.state).source = None;
    }

    fn end(&self) {
        let mut state = lock(&self.state);
        state.ended = true;
        if let Some(source) = &state.source {
            let _ = source.end_of_stream();
        }
        self.ends.notify_all();
    }

    /// Whether it ends, for which so long is waited.
    fn ends_within(&self, longest: Duration) -> bool {
        let state = lock(&self.state);
        // Where somebody panicked meanwhile, it is not waited for.
        drop(self.ends.wait_timeout_while(state, longest, |state| !state.ended));
        self.has_ended()
    }

    fn has_ended(&self) -> bool {
        lock(&self.state).ended
    }
}

/// Notes when pictures come that need no other. Ends the recording with an error where pictures go on and on that need the one before:
/// `splitmuxsink` keeps them all until one comes that needs no other. Which ones do is known behind the parser only: not every
/// depayloader says so, as that of MPEG-4.
fn watch_groups(source: &gst_app::AppSrc, arrivals: Arc<Arrivals>) {
    let Some(pad) = parsed(source) else { return };
    let kept = AtomicUsize::new(0);
    pad.add_probe(gst::PadProbeType::BUFFER, move |pad, info| {
        let before = kept.load(Ordering::Relaxed);
        let Some(buffer) = info.buffer().filter(|_| before <= LONGEST_GROUP) else {
            return gst::PadProbeReturn::Handled;
        };
        let delta = buffer.flags().contains(gst::BufferFlags::DELTA_UNIT);
        if let Some(pts) = buffer.pts().filter(|_| !delta) {
            arrivals.note(pts, now_ms());
        }
        let now = cost(buffer).saturating_add(if delta { before } else { 0 });
        kept.store(now, Ordering::Relaxed);
        if now <= LONGEST_GROUP {
            return gst::PadProbeReturn::Ok;
        }
        if let Some(element) = pad.parent_element() {
            let why =
                format!("{LONGEST_GROUP} bytes of memory are taken without a picture that needs no other");
            gst::element_error!(element, gst::StreamError::Mux, ("{why}"));
        }
        gst::PadProbeReturn::Handled
    });
}

/// Where pictures leave the parser.
fn parsed(source: &gst_app::AppSrc) -> Option<gst::Pad> {
    let pipeline = source.parent()?.downcast::<gst::Bin>().ok()?;
    pipeline.by_name("parser")?.static_pad("src")
}

/// Ends its feed when it is dropped.
struct Tap(Arc<Feed>);

impl Drop for Tap {
    fn drop(&mut self) {
        self.0.end();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// What waits of so many pictures of this size for a disk, where nothing runs that would write them: how many, and their bytes.
    fn waiting(number: u64, size: usize) -> (u64, u64) {
        let pipeline = gst::parse::launch(&description(Codec::Mjpeg, false)).unwrap();
        let source = pipeline.downcast::<gst::Pipeline>().unwrap().by_name("feed").unwrap();
        let source = source.downcast::<gst_app::AppSrc>().unwrap();
        let feed = Feed::default();
        feed.start(source.clone(), Arc::default());
        let picture = picture(size, false);
        for _ in 0..number {
            feed.copy(&picture);
        }
        (source.property("current-level-buffers"), source.current_level_bytes())
    }

    #[test]
    fn what_a_slow_disk_does_not_take_is_dropped_and_not_waited_for() {
        gst::init().unwrap();
        let (_, bytes) = waiting(3 * (LONGEST_QUEUE >> 20), 1 << 20);
        assert!((LONGEST_QUEUE / 2..=LONGEST_QUEUE).contains(&bytes), "{bytes}");
        let (pictures, _) = waiting(3 * MOST_QUEUED, SMALL);
        assert!((MOST_QUEUED / 2..=MOST_QUEUED).contains(&pictures), "{pictures}");
    }

    /// Between two tries, also where a minute would pass until the next.
    #[test]
    fn who_waits_to_record_again_ends_with_the_camera() {
        let feed = Arc::new(Feed::default());
        let waits = thread::spawn({
            let feed = feed.clone();
            move || feed.ends_within(Duration::MAX)
        });
        feed.end();
        assert!(waits.join().unwrap());
    }

    /// A picture of H.264 in which nothing moves has as many bytes.
    const SMALL: usize = 9;

    /// Takes a mebibyte.
    const LARGE: usize = (1 << 20) - bounds::BUFFER;

    /// A picture of so many bytes.
    fn picture(size: usize, delta: bool) -> gst::Sample {
        let mut picture = gst::Buffer::from_slice(vec![0; size]);
        if delta {
            picture.get_mut().unwrap().set_flags(gst::BufferFlags::DELTA_UNIT);
        }
        gst::Sample::builder().buffer(&picture).build()
    }

    /// What is said of these pictures, and what memory those take that go on from where a parser stands.
    fn recorded<'a>(pictures: impl Iterator<Item = &'a gst::Sample>) -> (Option<String>, usize) {
        // Plays before anything comes: after an error it would not begin to, and so not end.
        let text =
            "appsrc name=feed format=time ! identity name=parser ! fakesink name=recording async=false";
        let pipeline = gst::parse::launch(text).unwrap().downcast::<gst::Pipeline>().unwrap();
        let written = Arc::new(AtomicUsize::new(0));
        let sink = pipeline.by_name("recording").unwrap().static_pad("sink").unwrap();
        sink.add_probe(gst::PadProbeType::BUFFER, {
            let written = written.clone();
            move |_, info| {
                written.fetch_add(info.buffer().map_or(0, |buffer| cost(buffer)), Ordering::Relaxed);
                gst::PadProbeReturn::Ok
            }
        });
        let source = pipeline.by_name("feed").unwrap().downcast::<gst_app::AppSrc>().unwrap();
        let feed = Feed::default();
        feed.start(source, Arc::default());
        pipeline.set_state(gst::State::Playing).unwrap();
        pictures.for_each(|picture| feed.copy(picture));
        feed.end();
        let (bus, mut said) = (pipeline.bus().unwrap(), None);
        let kinds = [gst::MessageType::Eos, gst::MessageType::Error];
        loop {
            let message = bus.timed_pop_filtered(gst::ClockTime::from_seconds(60), &kinds).unwrap();
            let gst::MessageView::Error(error) = message.view() else { break };
            assert!(said.replace(error.error().message().to_owned()).is_none(), "it is said once");
        }
        pipeline.set_state(gst::State::Null).unwrap();
        (said, written.load(Ordering::Relaxed))
    }

    #[test]
    fn pictures_that_all_need_the_one_before_end_the_recording() {
        gst::init().unwrap();
        let (key, delta) = (picture(LARGE, false), picture(LARGE, true));
        let most = LONGEST_GROUP >> 20;
        // Also what begins anew comes too late.
        let endless =
            std::iter::once(&key).chain(std::iter::repeat_n(&delta, 2 * most)).chain([&key, &delta]);
        let (said, written) = recorded(endless);
        assert!(said.as_ref().is_some_and(|said| said.contains("needs no other")), "{said:?}");
        assert_eq!(written, LONGEST_GROUP);
        let groups = (0..4 * most).map(|number| if number.is_multiple_of(most) { &key } else { &delta });
        assert_eq!(recorded(groups), (None, 4 * LONGEST_GROUP));
    }

    #[test]
    fn small_pictures_that_all_need_the_one_before_end_the_recording_as_well() {
        gst::init().unwrap();
        let delta = picture(SMALL, true);
        let endless = std::iter::repeat_n(&delta, LONGEST_GROUP / bounds::BUFFER);
        let (said, written) = recorded(std::iter::once(&picture(SMALL, false)).chain(endless));
        assert!(said.as_ref().is_some_and(|said| said.contains("needs no other")), "{said:?}");
        let one = bounds::BUFFER + SMALL;
        assert_eq!(written, LONGEST_GROUP / one * one);
    }

    /// Whatever a parser does to their times.
    #[test]
    fn of_every_codec_it_is_known_when_the_first_picture_of_a_file_came() {
        gst::init().unwrap();
        let encoders = [
            (Codec::Mjpeg, "jpegenc"),
            (Codec::Mpeg4, "avenc_mpeg4 gop-size=10 ! rtpmp4vpay config-interval=1 ! rtpmp4vdepay"),
            (Codec::H264, "x264enc tune=zerolatency key-int-max=10"),
            (
                Codec::H265,
                "x265enc tune=zerolatency key-int-max=10 option-string=pools=1:frame-threads=1:log-level=error",
            ),
        ];
        for (codec, encoder) in encoders {
            let text = format!(
                "videotestsrc num-buffers=40 ! video/x-raw,format=I420,width=320,height=240,framerate=10/1 ! {encoder} ! appsink name=tap sync=false"
            );
            let camera = gst::parse::launch(&text).unwrap().downcast::<gst::Pipeline>().unwrap();
            let tap = camera.by_name("tap").unwrap().downcast::<gst_app::AppSink>().unwrap();
            let pipeline =
                gst::parse::launch(&description(codec, false)).unwrap().downcast::<gst::Pipeline>().unwrap();
            let recording = pipeline.by_name("recording").unwrap();
            let folder = std::env::temp_dir().join(format!("ptztrack-came-{}", std::process::id()));
            std::fs::create_dir_all(&folder).unwrap();
            recording.set_property("max-size-time", 1_000_000_000_u64);
            let (arrivals, opened) = (Arc::new(Arrivals::default()), Arc::new(Mutex::new(Vec::new())));
            recording.connect("format-location-full", false, {
                let (arrivals, opened, folder) = (arrivals.clone(), opened.clone(), folder.clone());
                move |values| {
                    let first = values[2].get::<gst::Sample>().unwrap();
                    let came = first.buffer().and_then(|first| arrivals.came_ms(first.pts()?));
                    lock(&opened).push(came.is_some());
                    Some(folder.join(format!("{}.mkv", lock(&opened).len())).to_value())
                }
            });
            let feed = Feed::default();
            feed.start(pipeline.by_name("feed").unwrap().downcast().unwrap(), arrivals);
            pipeline.set_state(gst::State::Playing).unwrap();
            camera.set_state(gst::State::Playing).unwrap();
            // Without a network MPEG-4 has no times.
            for number in 0.. {
                let Ok(sample) = tap.pull_sample() else { break };
                let mut picture = sample.buffer_owned().unwrap();
                picture.make_mut().set_pts(gst::ClockTime::from_mseconds(100 * number));
                feed.copy(
                    &gst::Sample::builder().buffer(&picture).caps(&sample.caps_owned().unwrap()).build(),
                );
            }
            feed.end();
            let kinds = [gst::MessageType::Eos, gst::MessageType::Error];
            let bus = pipeline.bus().unwrap();
            let end = bus.timed_pop_filtered(gst::ClockTime::from_seconds(60), &kinds).unwrap();
            camera.set_state(gst::State::Null).unwrap();
            pipeline.set_state(gst::State::Null).unwrap();
            std::fs::remove_dir_all(folder).unwrap();
            assert_eq!(end.type_(), gst::MessageType::Eos, "{codec:?}: {end:?}");
            assert_eq!(*lock(&opened), [true; 4], "{codec:?}");
        }
    }

    #[test]
    fn pictures_are_looked_at_where_they_leave_the_parser() {
        gst::init().unwrap();
        let codecs = [Codec::Mjpeg, Codec::Mpeg4, Codec::H264, Codec::H265];
        for (codec, overlay) in codecs.map(|codec| (codec, false)).into_iter().chain([(Codec::Mjpeg, true)]) {
            let pipeline = gst::parse::launch(&description(codec, overlay)).unwrap();
            let pipeline = pipeline.downcast::<gst::Pipeline>().unwrap();
            let source = pipeline.by_name("feed").unwrap().downcast::<gst_app::AppSrc>().unwrap();
            let next = parsed(&source).unwrap().peer().unwrap().parent_element();
            assert_eq!(next, pipeline.by_name("recording"));
        }
    }
}
