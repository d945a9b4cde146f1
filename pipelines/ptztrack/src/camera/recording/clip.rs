// SPDX-License-Identifier: MPL-2.0

//! A part of a recording, as it was recorded: nothing is decoded.
//!
//! ```text
//! files, one after the other ─ matroskademux ─▶ pictures that are encoded ─▶ muxer ─▶ parts of a file, as fast as they are taken
//! ```

use std::sync::mpsc;
use std::time::Duration;

use axum::body::Bytes;
use gst::prelude::*;
use tokio::sync::mpsc::{Receiver, Sender, channel};
use tokio::sync::{Semaphore, SemaphorePermit, oneshot};

use super::files::Piece;

/// So many at once: each has threads, and reads a disk that is written to.
static PLACES: Semaphore = Semaphore::const_new(4);

/// A file that says nothing for so long is none.
const LONGEST_WAIT: gst::ClockTime = gst::ClockTime::from_seconds(10);
/// Whoever takes nothing for so long is gone.
const LONGEST_END: Duration = Duration::from_secs(30);

/// So many parts wait for whoever takes them.
const WAITING: usize = 16;

/// What a clip is for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Purpose {
    /// To be seen in a browser.
    Play,
    /// To be kept as a file.
    Keep,
}

/// What a clip is made of.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Form {
    /// One JPEG after the other, each at its time: no browser plays them in a file.
    Pictures,
    Mp4,
    Matroska,
}

/// It comes while it is cut.
#[derive(Debug)]
pub struct Clip {
    pub form: Form,
    pub parts: Receiver<Bytes>,
}

/// Why there is no clip.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum NoClip {
    /// Others are being cut.
    Busy,
    /// Its files are no more, or are none.
    Gone,
}

impl Form {
    fn of(caps: &gst::CapsRef, purpose: Purpose) -> Self {
        let is_jpeg = caps.structure(0).is_some_and(|structure| structure.name() == "image/jpeg");
        match (is_jpeg, purpose) {
            (false, _) => Self::Mp4,
            (true, Purpose::Play) => Self::Pictures,
            (true, Purpose::Keep) => Self::Matroska,
        }
    }

    /// The element whose name is `first` takes pictures.
    fn description(self) -> &'static str {
        match self {
            Self::Pictures => "identity name=first ! appsink name=parts",
            Self::Mp4 => {
                "mp4mux name=first fragment-duration=500 streamable=true ! appsink name=parts sync=false"
            }
            Self::Matroska => "matroskamux name=first streamable=true ! appsink name=parts sync=false",
        }
    }
}

/// Cuts it out of these files.
///
/// # Errors
/// Why there is none.
pub async fn cut(pieces: Vec<Piece>, purpose: Purpose) -> Result<Clip, NoClip> {
    let place = PLACES.try_acquire().map_err(|_| NoClip::Busy)?;
    let (sender, parts) = channel(WAITING);
    let (tell, form) = oneshot::channel();
    tokio::task::spawn_blocking(move || {
        let mut cutter =
            Cutter { purpose, sender, tell: Some(tell), writer: None, lead: Vec::new(), _place: place };
        // Whoever takes it notices the end, and where it never began.
        let _ = pieces.iter().try_for_each(|piece| cutter.read(piece));
        cutter.writer.iter().for_each(Writer::end);
    });
    form.await.map(|form| Clip { form, parts }).map_err(|_| NoClip::Gone)
}

struct Cutter {
    purpose: Purpose,
    sender: Sender<Bytes>,
    /// To whom the form is told, until it is.
    tell: Option<oneshot::Sender<Form>>,
    writer: Option<Writer>,
    /// From the last picture that needs no other on, and when they were taken.
    lead: Vec<(gst::Buffer, i64)>,
    _place: SemaphorePermit<'static>,
}

impl Cutter {
    /// As much as there is of it: a file may be deleted, or never ended as it was written while the power failed. `None` where nobody
    /// takes any more.
    fn read(&mut self, piece: &Piece) -> Option<()> {
        if self.sender.is_closed() {
            return None;
        }
        let Some(reader) = Reader::open(piece) else { return Some(()) };
        while let Some(sample) = reader.packets.try_pull_sample(LONGEST_WAIT) {
            let Some((packet, in_file, caps)) = packet(&sample) else { return Some(()) };
            let [in_file, at, from] =
                [in_file, piece.at, piece.from].map(|time| time.nseconds().cast_signed());
            self.take(packet, in_file + at - from, caps)?;
        }
        Some(())
    }

    /// One that was taken so many nanoseconds after the beginning; before it only what those after it need.
    fn take(&mut self, packet: gst::Buffer, at: i64, caps: &gst::CapsRef) -> Option<()> {
        if !packet.flags().contains(gst::BufferFlags::DELTA_UNIT) {
            self.lead.clear();
        }
        self.lead.push((packet, at));
        if at < 0 {
            return Some(());
        }
        if self.writer.is_none() {
            self.begin(caps)?;
        }
        // A file has pictures of one kind: where the camera changed them, the clip ends.
        let writer = self.writer.as_mut().filter(|writer| writer.takes(caps))?;
        self.lead.drain(..).try_for_each(|(packet, at)| writer.write(packet, at))
    }

    fn begin(&mut self, caps: &gst::CapsRef) -> Option<()> {
        let form = Form::of(caps, self.purpose);
        self.writer = Some(Writer::begin(form, caps, self.sender.clone())?);
        self.tell.take()?.send(form).ok()
    }
}

/// What is encoded, when in its file, and what it is.
fn packet(sample: &gst::Sample) -> Option<(gst::Buffer, gst::ClockTime, &gst::CapsRef)> {
    let packet = sample.buffer_owned()?;
    let in_file = sample.segment()?.downcast_ref::<gst::ClockTime>()?.to_stream_time(packet.pts())?;
    Some((packet, in_file, sample.caps()?))
}

/// Reads what is encoded in a file.
struct Reader {
    /// Stops where it is dropped.
    _pipeline: Stopping,
    packets: gst_app::AppSink,
}

impl Reader {
    fn open(piece: &Piece) -> Option<Self> {
        let pipeline = Stopping::launch(
            "filesrc name=file ! matroskademux ! appsink name=packets sync=false max-buffers=8",
        )?;
        pipeline.0.by_name("file")?.set_property("location", piece.file.to_str()?);
        let packets = pipeline.0.by_name("packets")?.downcast().ok()?;
        pipeline.0.set_state(gst::State::Paused).ok()?;
        pipeline.0.state(LONGEST_WAIT).0.ok()?;
        let flags = gst::SeekFlags::FLUSH | gst::SeekFlags::KEY_UNIT | gst::SeekFlags::SNAP_BEFORE;
        let to = piece.from + piece.lasts;
        pipeline.0.seek(1.0, flags, gst::SeekType::Set, piece.from, gst::SeekType::Set, to).ok()?;
        pipeline.0.set_state(gst::State::Playing).ok()?;
        Some(Self { _pipeline: pipeline, packets })
    }
}

/// Makes a clip of it.
struct Writer {
    /// Stops where it is dropped.
    _pipeline: Stopping,
    /// Waits where nobody takes what comes of it.
    pad: gst::Pad,
    caps: gst::Caps,
    /// Says that all was taken, or that nobody takes it.
    ended: mpsc::Receiver<()>,
    /// When the first picture was taken, in nanoseconds, and the last one's time in the clip.
    began: Option<i64>,
    last: gst::ClockTime,
}

impl Writer {
    fn begin(form: Form, caps: &gst::CapsRef, parts: Sender<Bytes>) -> Option<Self> {
        let pipeline = Stopping::launch(form.description())?;
        let sink = pipeline.0.by_name("parts")?.downcast::<gst_app::AppSink>().ok()?;
        let (end, ended) = mpsc::channel();
        let nobody_takes_it = end.clone();
        let hand_on = move |sink: &gst_app::AppSink| {
            let sample = sink.pull_sample().map_err(|_| gst::FlowError::Eos)?;
            let map = sample.buffer().and_then(|buffer| buffer.map_readable().ok());
            let part = Bytes::copy_from_slice(&map.ok_or(gst::FlowError::Error)?);
            let gone = |_| {
                let _ = nobody_takes_it.send(());
                gst::FlowError::Eos
            };
            parts.blocking_send(part).map(|()| gst::FlowSuccess::Ok).map_err(gone)
        };
        let callbacks = gst_app::AppSinkCallbacks::builder().new_sample(hand_on);
        sink.set_callbacks(callbacks.eos(move |_| end.send(()).unwrap_or_default()).build());
        let first = pipeline.0.by_name("first")?;
        let into = first.static_pad("sink").or_else(|| first.request_pad_simple("video_%u"))?;
        let pad = gst::Pad::builder(gst::PadDirection::Src).build();
        pad.set_active(true).ok()?;
        pad.link(&into).ok()?;
        pipeline.0.set_state(gst::State::Playing).ok()?;
        let segment = gst::FormattedSegment::<gst::ClockTime>::new();
        let begins = [
            gst::event::StreamStart::new("clip"),
            gst::event::Caps::new(&caps.to_owned()),
            gst::event::Segment::new(&segment),
        ];
        begins.into_iter().all(|event| pad.push_event(event)).then_some(())?;
        Some(Self {
            _pipeline: pipeline,
            pad,
            caps: caps.to_owned(),
            ended,
            began: None,
            last: gst::ClockTime::ZERO,
        })
    }

    /// Whether pictures of these caps can go on from those before: their sizes and the codec's settings are told once.
    fn takes(&self, caps: &gst::CapsRef) -> bool {
        let of = |caps: &gst::CapsRef| {
            let structure = caps.structure(0)?;
            let value = |field| structure.value(field).ok().and_then(|value| value.serialize().ok());
            Some((structure.name().to_string(), ["width", "height", "codec_data"].map(value)))
        };
        caps == self.caps.as_ref() || of(caps) == of(&self.caps)
    }

    /// One that was taken then; a clip begins with its first, and never goes back.
    fn write(&mut self, mut packet: gst::Buffer, at: i64) -> Option<()> {
        let began = *self.began.get_or_insert(at);
        self.last = self.last.max(gst::ClockTime::from_nseconds((at - began).max(0).unsigned_abs()));
        let times = packet.make_mut();
        times.set_pts(self.last);
        times.set_dts(gst::ClockTime::NONE);
        self.pad.push(packet).ok().map(drop)
    }

    /// Waits until all is taken.
    fn end(&self) {
        self.pad.push_event(gst::event::Eos::new());
        let _ = self.ended.recv_timeout(LONGEST_END);
    }
}

/// A pipeline that stops where it is dropped.
struct Stopping(gst::Pipeline);

impl Stopping {
    fn launch(description: &str) -> Option<Self> {
        gst::parse::launch(description).ok()?.downcast().ok().map(Self)
    }
}

impl Drop for Stopping {
    fn drop(&mut self) {
        let _ = self.0.set_state(gst::State::Null);
    }
}

#[cfg(test)]
mod tests {
    use std::path::{Path, PathBuf};

    use super::*;

    /// Files of four seconds, 15 pictures a second, as they are recorded.
    fn record(name: &str, encoder: &str) -> Vec<PathBuf> {
        gst::init().unwrap();
        let folder = std::env::temp_dir().join(format!("ptztrack-clip-{name}-{}", std::process::id()));
        std::fs::create_dir_all(&folder).unwrap();
        let pipeline = Stopping::launch(&format!(
            "videotestsrc num-buffers=150 ! video/x-raw,format=I420,width=64,height=48,framerate=15/1 ! {encoder} \
             ! splitmuxsink name=recording max-size-time=4000000000 muxer-factory=matroskamux"
        ));
        let pipeline = pipeline.unwrap();
        let location = folder.join("%d.mkv");
        pipeline.0.by_name("recording").unwrap().set_property("location", location.to_str().unwrap());
        pipeline.0.set_state(gst::State::Playing).unwrap();
        let end = [gst::MessageType::Eos, gst::MessageType::Error];
        let said = pipeline.0.bus().unwrap().timed_pop_filtered(gst::ClockTime::NONE, &end).unwrap();
        assert_eq!(said.type_(), gst::MessageType::Eos, "{said:?}");
        (0..3).map(|n| folder.join(format!("{n}.mkv"))).collect()
    }

    fn piece(file: &Path, from_ms: u64, lasts_ms: u64, at_ms: u64) -> Piece {
        let [from, lasts, at] = [from_ms, lasts_ms, at_ms].map(gst::ClockTime::from_mseconds);
        Piece { file: file.to_owned(), from, lasts, at }
    }

    /// What is cut, and its form.
    fn all(pieces: Vec<Piece>, purpose: Purpose) -> Result<(Form, Vec<Bytes>), NoClip> {
        let runtime = tokio::runtime::Builder::new_current_thread().build().unwrap();
        runtime.block_on(async {
            let mut clip = cut(pieces, purpose).await?;
            let mut parts = Vec::new();
            while let Some(part) = clip.parts.recv().await {
                parts.push(part);
            }
            Ok((clip.form, parts))
        })
    }

    /// When its pictures are shown, in milliseconds.
    fn times(name: &str, parts: &[Bytes]) -> Vec<u64> {
        let file = std::env::temp_dir().join(format!("ptztrack-{name}-{}.clip", std::process::id()));
        std::fs::write(&file, parts.concat()).unwrap();
        let demuxer = if parts[0].starts_with(b"\x1a\x45") { "matroskademux" } else { "qtdemux" };
        let pipeline =
            Stopping::launch(&format!("filesrc name=file ! {demuxer} ! appsink name=packets sync=false"));
        let pipeline = pipeline.unwrap();
        pipeline.0.by_name("file").unwrap().set_property("location", file.to_str().unwrap());
        pipeline.0.set_state(gst::State::Playing).unwrap();
        let packets = pipeline.0.by_name("packets").unwrap().downcast::<gst_app::AppSink>().unwrap();
        let time = |sample: gst::Sample| sample.buffer().unwrap().pts().unwrap().mseconds();
        let times = std::iter::from_fn(|| packets.try_pull_sample(LONGEST_WAIT)).map(time).collect();
        std::fs::remove_file(file).unwrap();
        times
    }

    #[test]
    fn a_clip_begins_with_the_whole_picture_before_it_and_goes_on_in_the_next_file() {
        let files = record("h264", "x264enc tune=zerolatency key-int-max=15 ! h264parse");
        // From 2.3 s on, which has a whole picture at 2 s, to 5.3 s.
        let pieces = vec![piece(&files[0], 2300, 3000, 0), piece(&files[1], 0, 1300, 1700)];
        let (form, parts) = all(pieces, Purpose::Play).unwrap();
        let times = times("h264", &parts);
        assert_eq!(form, Form::Mp4);
        assert!((49..=51).contains(&times.len()), "{times:?}");
        assert!(times.windows(2).all(|pair| (60..75).contains(&(pair[1] - pair[0]))), "{times:?}");
        std::fs::remove_dir_all(files[0].parent().unwrap()).unwrap();
    }

    /// As while it is written.
    #[test]
    fn a_file_without_an_end_is_cut_as_far_as_it_goes() {
        let files = record("open", "x264enc tune=zerolatency key-int-max=15 ! h264parse");
        let bytes = std::fs::read(&files[1]).unwrap();
        std::fs::write(&files[1], &bytes[..bytes.len() * 3 / 4]).unwrap();
        let (_, parts) = all(vec![piece(&files[1], 1000, 9000, 0)], Purpose::Keep).unwrap();
        let times = times("open", &parts);
        assert!((28..=31).contains(&times.len()), "{times:?}");
        std::fs::remove_dir_all(files[0].parent().unwrap()).unwrap();
    }

    /// As where the disk was full, or the power failed.
    #[test]
    fn what_is_left_is_cut_where_its_first_file_is_gone_or_has_no_end() {
        let files = record("left", "x264enc tune=zerolatency key-int-max=15 ! h264parse");
        let pieces = || vec![piece(&files[0], 3000, 3000, 0), piece(&files[1], 0, 2000, 1000)];
        let cut = || times("left", &all(pieces(), Purpose::Play).unwrap().1);
        assert!((44..=46).contains(&cut().len()));
        let bytes = std::fs::read(&files[0]).unwrap();
        std::fs::write(&files[0], &bytes[..bytes.len() / 4]).unwrap();
        assert!((29..=31).contains(&cut().len()), "it ends before the clip begins");
        std::fs::remove_file(&files[0]).unwrap();
        let left = cut();
        assert!((29..=31).contains(&left.len()) && left[0] == 0, "{left:?}");
        std::fs::remove_dir_all(files[0].parent().unwrap()).unwrap();
    }

    #[test]
    fn a_clip_ends_where_the_pictures_become_others() {
        const ENCODER: &str = "x264enc tune=zerolatency key-int-max=15 ! h264parse";
        let files = record("before", ENCODER);
        let smaller = record("after", &format!("videoscale ! video/x-raw,width=32,height=24 ! {ENCODER}"));
        let pieces = |next: &PathBuf| vec![piece(&files[0], 3000, 3000, 0), piece(next, 0, 2000, 1000)];
        let cut = |next| times("others", &all(pieces(next), Purpose::Play).unwrap().1).len();
        assert!((14..=16).contains(&cut(&smaller[1])));
        assert!((44..=46).contains(&cut(&files[1])));
        for files in [files, smaller] {
            std::fs::remove_dir_all(files[0].parent().unwrap()).unwrap();
        }
    }

    #[test]
    fn pictures_are_shown_one_by_one_and_kept_in_a_file() {
        let files = record("jpeg", "jpegenc ! jpegparse");
        let pieces = || vec![piece(&files[2], 500, 400, 0)];
        let (form, parts) = all(pieces(), Purpose::Play).unwrap();
        assert_eq!(form, Form::Pictures);
        assert!(
            (5..=7).contains(&parts.len()) && parts.iter().all(|part| part.starts_with(&[0xff, 0xd8])),
            "{}",
            parts.len()
        );
        let (form, kept) = all(pieces(), Purpose::Keep).unwrap();
        assert_eq!((form, times("jpeg", &kept).len()), (Form::Matroska, parts.len()));
        std::fs::remove_dir_all(files[0].parent().unwrap()).unwrap();
    }

    #[test]
    fn what_is_gone_or_no_recording_is_no_clip() {
        gst::init().unwrap();
        let nonsense = std::env::temp_dir().join(format!("ptztrack-nonsense-{}", std::process::id()));
        std::fs::write(&nonsense, "nonsense").unwrap();
        for file in [Path::new("/nowhere/door.mkv"), &nonsense] {
            assert_eq!(all(vec![piece(file, 0, 1000, 0)], Purpose::Play).unwrap_err(), NoClip::Gone);
        }
        std::fs::remove_file(nonsense).unwrap();
    }
}
