// SPDX-License-Identifier: MPL-2.0

use std::sync::{LazyLock, Mutex};

use glib::Properties;
use gst::prelude::*;
use gst::subclass::prelude::*;
use gst_video::{VideoFormat, VideoOverlayComposition, VideoOverlayCompositionMeta, VideoOverlayRectangle};
use ptztrack_contract::{
    BufferMeta, ContractError, MotionMeta, RefusedValues, TargetMeta, TargetState, TracksMeta,
};

use super::{caps, pixels};
use crate::allocation::refuse_crop;
use crate::duration;
use crate::frame;
use crate::lock::lock;
use crate::pad_templates;
use crate::vision::{self, ColourSpace, FrameSize, OverlayRectangle, Parts, Pen, Seen, Shape, Trail};

static CAT: LazyLock<gst::DebugCategory> = LazyLock::new(|| {
    gst::DebugCategory::new("ptzoverlay", gst::DebugColorFlags::empty(), Some("PTZ tracking overlay"))
});

#[derive(Debug, Clone, Copy)]
struct Settings {
    contours: bool,
    boxes: bool,
    tracks: bool,
    features: bool,
    centroid: bool,
    trail: bool,
    trail_duration_ns: u64,
    cross_hair: bool,
    state: bool,
    offset: bool,
}

impl Default for Settings {
    fn default() -> Self {
        Self {
            contours: true,
            boxes: true,
            tracks: true,
            features: true,
            centroid: true,
            trail: true,
            trail_duration_ns: 3_000_000_000,
            cross_hair: true,
            state: true,
            offset: true,
        }
    }
}

impl Settings {
    fn parts(self) -> Parts {
        let Self { contours, boxes, tracks, features, centroid, trail, cross_hair, state, offset, .. } = self;
        Parts { contours, boxes, tracks, features, centroid, trail, cross_hair, state, offset }
    }
}

/// What was agreed on with the neighbours.
#[derive(Debug, Clone)]
struct Format {
    /// Caps of the frames that come in.
    caps: gst::Caps,
    info: gst_video::VideoInfo,
    draws: Draws,
}

/// Who draws.
#[derive(Debug, Clone, Copy)]
enum Draws {
    /// Downstream: it gets a composition.
    Downstream,
    /// We, on the pixels as they are.
    Directly(ColourSpace),
    /// GStreamer, a composition: we do not know the format.
    Blending,
}

/// What is kept from frame to frame.
#[derive(Debug, Default)]
struct Memory {
    trail: Trail,
    pen: Pen,
    /// The last drawing and what it shows: where nothing changed it serves again.
    last: Option<(Vec<Shape>, Option<VideoOverlayComposition>)>,
    /// Whether a fault of this stream was already reported, so that one fault is not a flood.
    warned: bool,
}

/// The locks are never held together, nor while anything is drawn or pushed.
#[derive(Properties)]
#[properties(wrapper_type = super::PtzOverlay)]
pub struct PtzOverlay {
    #[property(
        name = "contours", get, set, type = bool, member = contours, default = Settings::default().contours, mutable_playing,
        blurb = "Draw the contours of what moves"
    )]
    #[property(
        name = "boxes", get, set, type = bool, member = boxes, default = Settings::default().boxes, mutable_playing,
        blurb = "Draw boxes around the target, and around what moves where no box of a track is drawn"
    )]
    #[property(
        name = "tracks", get, set, type = bool, member = tracks, default = Settings::default().tracks, mutable_playing,
        blurb = "Draw thin boxes of everybody else who is seen, with their numbers"
    )]
    #[property(
        name = "features", get, set, type = bool, member = features, default = Settings::default().features, mutable_playing,
        blurb = "Draw the feature points: followed ones green, rejected ones red"
    )]
    #[property(
        name = "centroid", get, set, type = bool, member = centroid, default = Settings::default().centroid, mutable_playing,
        blurb = "Draw the target's centre of mass"
    )]
    #[property(
        name = "trail", get, set, type = bool, member = trail, default = Settings::default().trail, mutable_playing,
        blurb = "Draw where the target was during the last trail-duration"
    )]
    #[property(
        name = "trail-duration", get, type = u64, member = trail_duration_ns, mutable_playing,
        set = |imp: &Self, value: u64| if duration::accepts(imp, &imp.refused, "trail-duration", value) { lock(&imp.settings).trail_duration_ns = value },
        default = Settings::default().trail_duration_ns, maximum = 60_000_000_000,
        blurb = "How long the trail reaches back, in nanoseconds"
    )]
    #[property(
        name = "cross-hair", get, set, type = bool, member = cross_hair, default = Settings::default().cross_hair, mutable_playing,
        blurb = "Mark the middle of the frame"
    )]
    #[property(
        name = "state", get, set, type = bool, member = state, default = Settings::default().state, mutable_playing,
        blurb = "Write the tracker's state, the target's number and the confidence in percent"
    )]
    #[property(
        name = "offset", get, set, type = bool, member = offset, default = Settings::default().offset, mutable_playing,
        blurb = "Draw and write the offset from the middle of the frame to the target (in frame widths and heights, positive to the right and down)"
    )]
    settings: Mutex<Settings>,
    format: Mutex<Option<Format>>,
    memory: Mutex<Memory>,
    refused: RefusedValues,
    sinkpad: gst::Pad,
    srcpad: gst::Pad,
}

#[glib::object_subclass]
impl ObjectSubclass for PtzOverlay {
    const NAME: &'static str = "GstPtzOverlay";
    type Type = super::PtzOverlay;
    type ParentType = gst::Element;

    #[allow(clippy::expect_used, reason = "both templates are declared below")]
    fn with_class(klass: &Self::Class) -> Self {
        let template = |name| klass.pad_template(name).expect("declared template");
        let sinkpad = gst::Pad::builder_from_template(&template("sink"))
            .chain_function(|_, parent, buffer| {
                Self::catch_panic_pad_function(
                    parent,
                    || Err(gst::FlowError::Error),
                    |overlay| overlay.chain(buffer),
                )
            })
            .event_function(|pad, parent, event| {
                Self::catch_panic_pad_function(parent, || false, |overlay| overlay.sink_event(pad, event))
            })
            .query_function(|pad, parent, query| {
                Self::catch_panic_pad_function(parent, || false, |overlay| overlay.sink_query(pad, query))
            })
            .flags(gst::PadFlags::PROXY_ALLOCATION)
            .build();
        let srcpad = gst::Pad::builder_from_template(&template("src"))
            .query_function(|pad, parent, query| {
                Self::catch_panic_pad_function(parent, || false, |overlay| overlay.src_query(pad, query))
            })
            .build();
        Self {
            settings: Mutex::default(),
            format: Mutex::default(),
            memory: Mutex::default(),
            refused: RefusedValues::default(),
            sinkpad,
            srcpad,
        }
    }
}

#[glib::derived_properties]
impl ObjectImpl for PtzOverlay {
    fn constructed(&self) {
        self.parent_constructed();
        let obj = self.obj();
        for pad in [&self.sinkpad, &self.srcpad] {
            if let Err(err) = obj.add_pad(pad) {
                gst::error!(CAT, imp = self, "cannot add pad {}: {err}", pad.name());
            }
        }
    }
}

impl GstObjectImpl for PtzOverlay {}

impl ElementImpl for PtzOverlay {
    fn metadata() -> Option<&'static gst::subclass::ElementMetadata> {
        static METADATA: LazyLock<gst::subclass::ElementMetadata> = LazyLock::new(|| {
            gst::subclass::ElementMetadata::new(
                "PTZ tracking overlay",
                "Filter/Effect/Video",
                "Draws what bgavgdetect and lkfeaturetrack saw",
                env!("CARGO_PKG_AUTHORS"),
            )
        });
        Some(&METADATA)
    }

    fn pad_templates() -> &'static [gst::PadTemplate] {
        static TEMPLATES: LazyLock<Vec<gst::PadTemplate>> =
            LazyLock::new(|| pad_templates::in_and_out(&caps::TEMPLATE));
        &TEMPLATES
    }

    fn change_state(
        &self,
        transition: gst::StateChange,
    ) -> Result<gst::StateChangeSuccess, gst::StateChangeError> {
        if transition == gst::StateChange::ReadyToPaused {
            self.refused.warn(&*self.obj());
        }
        let success = self.parent_change_state(transition)?;
        if transition == gst::StateChange::PausedToReady {
            *lock(&self.format) = None;
            *lock(&self.memory) = Memory::default();
        }
        Ok(success)
    }
}

/// Agreeing on caps.
impl PtzOverlay {
    fn sink_query(&self, pad: &gst::Pad, query: &mut gst::QueryRef) -> bool {
        match query.view_mut() {
            gst::QueryViewMut::Caps(query) => {
                let peer = self.srcpad.peer_query_caps(Some(&caps::TEMPLATE));
                query.set_result(&filtered(caps::plain_first(&peer), query.filter()));
                true
            }
            _ => {
                let answered = gst::Pad::query_default(pad, Some(&*self.obj()), query);
                if let gst::QueryViewMut::Allocation(query) = query.view_mut() {
                    refuse_crop(query);
                }
                answered
            }
        }
    }

    fn src_query(&self, pad: &gst::Pad, query: &mut gst::QueryRef) -> bool {
        match query.view_mut() {
            gst::QueryViewMut::Caps(query) => {
                let peer = self.sinkpad.peer_query_caps(Some(&caps::TEMPLATE));
                query.set_result(&filtered(caps::both(&peer), query.filter()));
                true
            }
            _ => gst::Pad::query_default(pad, Some(&*self.obj()), query),
        }
    }

    fn sink_event(&self, pad: &gst::Pad, event: gst::Event) -> bool {
        match event.view() {
            gst::EventView::Caps(event) => return self.negotiate(event.caps_owned()).is_ok(),
            gst::EventView::FlushStop(_) => lock(&self.memory).trail.clear(),
            _ => (),
        }
        gst::Pad::event_default(pad, Some(&*self.obj()), event)
    }

    /// Finds out who draws, and tells downstream what comes.
    fn negotiate(&self, caps: gst::Caps) -> Result<(), gst::FlowError> {
        let info = gst_video::VideoInfo::from_caps(&caps).map_err(|err| {
            gst::error!(CAT, imp = self, "not raw video: {caps}: {err}");
            gst::FlowError::NotNegotiated
        })?;
        let composing = caps::composing(&caps);
        let attach = caps::is_composing(&caps) || self.downstream_composes(&composing);
        let draws = match pixels::colour_space(&info) {
            _ if attach => Draws::Downstream,
            Some(colours) => Draws::Directly(colours),
            None => Draws::Blending,
        };
        gst::debug!(CAT, imp = self, "{caps}: {draws:?}");
        let out = if attach { composing } else { caps.clone() };
        if !self.srcpad.push_event(gst::event::Caps::new(&out)) {
            let flushing = self.srcpad.pad_flags().contains(gst::PadFlags::FLUSHING);
            return Err(if flushing { gst::FlowError::Flushing } else { gst::FlowError::NotNegotiated });
        }
        *lock(&self.format) = Some(Format { caps, info, draws });
        *lock(&self.memory) = Memory::default();
        Ok(())
    }

    /// Whether downstream not only lets such caps pass (a `fakesink` takes anything), but also asks for
    /// the meta. Transforms answer an allocation query only for caps that were set.
    fn downstream_composes(&self, composing: &gst::Caps) -> bool {
        if !self.srcpad.peer_query_caps(Some(composing)).can_intersect(composing)
            || !self.srcpad.push_event(gst::event::Caps::new(composing))
        {
            return false;
        }
        let mut query = gst::query::Allocation::new(Some(composing), false);
        self.srcpad.peer_query(&mut query)
            && query.find_allocation_meta::<VideoOverlayCompositionMeta>().is_some()
    }
}

fn filtered(caps: gst::Caps, filter: Option<&gst::CapsRef>) -> gst::Caps {
    match filter {
        Some(filter) => filter.intersect_with_mode(&caps, gst::CapsIntersectMode::First),
        None => caps,
    }
}

/// Drawing.
impl PtzOverlay {
    fn chain(&self, buffer: gst::Buffer) -> Result<gst::FlowSuccess, gst::FlowError> {
        let format = lock(&self.format).clone().ok_or(gst::FlowError::NotNegotiated)?;
        if self.srcpad.check_reconfigure()
            && let Err(err) = self.negotiate(format.caps)
        {
            self.srcpad.mark_reconfigure();
            return Err(err);
        }
        let format = lock(&self.format).clone().ok_or(gst::FlowError::NotNegotiated)?;
        self.srcpad.push(self.draw_on(buffer, &format))
    }

    /// The frame with the drawing; where that fails, a warning says why and the frame passes as it is.
    fn draw_on(&self, mut buffer: gst::Buffer, format: &Format) -> gst::Buffer {
        let mut memory = std::mem::take(&mut *lock(&self.memory));
        let done = self.shapes(&buffer, &format.info, &mut memory).and_then(|shapes| {
            if shapes.is_empty() {
                return Ok(());
            }
            let info = &format.info;
            // Only what is drawn on is made writable: a frame that is shared would be copied.
            match format.draws {
                Draws::Downstream => memory
                    .composition(shapes, info)?
                    .map_or(Ok(()), |composition| attach(buffer.make_mut(), &composition)),
                Draws::Directly(colours) => draw(buffer.make_mut(), info, colours, &shapes, &mut memory.pen),
                Draws::Blending => memory
                    .composition(shapes, info)?
                    .map_or(Ok(()), |composition| blend(buffer.make_mut(), info, &composition)),
            }
        });
        if let Err(reason) = done
            && !std::mem::replace(&mut memory.warned, true)
        {
            gst::element_imp_warning!(
                self,
                gst::StreamError::Failed,
                ("Frame not drawn on: {reason}. Further ones of this stream are not reported.")
            );
        }
        *lock(&self.memory) = memory;
        buffer
    }

    /// What there is to draw.
    fn shapes(
        &self,
        buffer: &gst::BufferRef,
        info: &gst_video::VideoInfo,
        memory: &mut Memory,
    ) -> Result<Vec<Shape>, String> {
        let unreadable = |err: ContractError| format!("unreadable meta: {err}");
        let motion = MotionMeta::of(buffer).transpose().map_err(unreadable)?;
        let target = TargetMeta::of(buffer).transpose().map_err(unreadable)?;
        let tracks = TracksMeta::of(buffer).transpose().map_err(unreadable)?;
        if motion.is_none() && target.is_none() && tracks.is_none() {
            return Ok(Vec::new());
        }
        let settings = *lock(&self.settings);
        remember(&mut memory.trail, buffer.pts(), target.as_ref(), settings.trail_duration_ns);
        let trail: Vec<_> = memory.trail.points().collect();
        let seen =
            Seen { motion: motion.as_ref(), target: target.as_ref(), tracks: tracks.as_ref(), trail: &trail };
        vision::scene(frame_size(info), settings.parts(), seen).map_err(failed)
    }
}

impl Memory {
    /// The shapes as a composition; none where they all lie outside.
    fn composition(
        &mut self,
        shapes: Vec<Shape>,
        info: &gst_video::VideoInfo,
    ) -> Result<Option<VideoOverlayComposition>, String> {
        if let Some((last, composition)) = &self.last
            && *last == shapes
        {
            return Ok(composition.clone());
        }
        let patches = self.pen.patches(&shapes, frame_size(info)).map_err(failed)?;
        let composition = compose(patches)?;
        self.last = Some((shapes, composition.clone()));
        Ok(composition)
    }
}

fn frame_size(info: &gst_video::VideoInfo) -> FrameSize {
    FrameSize { width: info.width(), height: info.height() }
}

fn failed(err: opencv::Error) -> String {
    format!("drawing failed: {err}")
}

/// Adds to the trail. A dropped frame (DISCONT) does not break it, only a new target or a jump back does:
/// a leaky queue in front marks each drop as discontinuity. Where a frame has no time, nobody knows how old the trail is.
fn remember(
    trail: &mut Trail,
    pts: Option<gst::ClockTime>,
    target: Option<&TargetMeta>,
    trail_duration_ns: u64,
) {
    let Some(pts) = pts else { return trail.clear() };
    if let Some(target) = target
        && matches!(target.state, TargetState::Tracking | TargetState::Occluded)
    {
        trail.push(target.id, pts.seconds_f64(), target.centroid);
    }
    let duration = gst::ClockTime::from_nseconds(trail_duration_ns);
    trail.expire(pts.seconds_f64(), duration.seconds_f64());
}

fn compose(patches: Vec<OverlayRectangle>) -> Result<Option<VideoOverlayComposition>, String> {
    let rectangles = patches.into_iter().map(rectangle).collect::<Result<Vec<_>, _>>()?;
    if rectangles.is_empty() {
        return Ok(None);
    }
    VideoOverlayComposition::new(&rectangles).map(Some).map_err(|err| err.to_string())
}

fn rectangle(patch: OverlayRectangle) -> Result<VideoOverlayRectangle, String> {
    let OverlayRectangle { x, y, width, height, pixels } = patch;
    let mut buffer = gst::Buffer::from_mut_slice(pixels);
    gst_video::VideoMeta::add(
        buffer.make_mut(),
        gst_video::VideoFrameFlags::empty(),
        VideoFormat::Bgra,
        width,
        height,
    )
    .map_err(|err| err.to_string())?;
    let flags = gst_video::VideoOverlayFormatFlags::PREMULTIPLIED_ALPHA;
    Ok(VideoOverlayRectangle::new_raw(&buffer, x, y, width, height, flags))
}

/// Adds the drawing to one that is there already, as only one is shown.
fn attach(buffer: &mut gst::BufferRef, composition: &VideoOverlayComposition) -> Result<(), String> {
    let Some(mut meta) = buffer.meta_mut::<VideoOverlayCompositionMeta>() else {
        VideoOverlayCompositionMeta::add(buffer, composition);
        return Ok(());
    };
    let both: Vec<_> = meta.overlay().iter().chain(composition.iter()).collect();
    let both = VideoOverlayComposition::new(&both).map_err(|err| err.to_string())?;
    meta.set_overlay(&both);
    Ok(())
}

type WritableFrame<'a> = gst_video::VideoFrameRef<&'a mut gst::BufferRef>;

fn mapped<'a>(
    buffer: &'a mut gst::BufferRef,
    info: &gst_video::VideoInfo,
) -> Result<WritableFrame<'a>, String> {
    frame::writable(buffer, info)
        .ok_or_else(|| format!("the frame is no {}x{} {:?}", info.width(), info.height(), info.format()))
}

fn blend(
    buffer: &mut gst::BufferRef,
    info: &gst_video::VideoInfo,
    composition: &VideoOverlayComposition,
) -> Result<(), String> {
    composition.blend(&mut mapped(buffer, info)?).map_err(|err| err.to_string())
}

fn draw(
    buffer: &mut gst::BufferRef,
    info: &gst_video::VideoInfo,
    colours: ColourSpace,
    shapes: &[Shape],
    pen: &mut Pen,
) -> Result<(), String> {
    let mut frame = mapped(buffer, info)?;
    pixels::with_surface(&mut frame, colours, |surface| pen.draw(shapes, frame_size(info), surface))
        .map_err(failed)
}
