// SPDX-License-Identifier: MPL-2.0

use ptztrack_contract::{
    MotionMeta, Point, Rect, Region, TargetMeta, TargetState, Track, TrackState, TracksMeta,
};

use super::draw::{Colour, Shape};
use super::font::text_width;

/// Size of a frame in pixels.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct FrameSize {
    /// Pixels a row.
    pub width: u32,
    /// Rows.
    pub height: u32,
}

/// A place in the frame, in pixels from its top left corner.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Spot {
    /// To the right.
    pub x: f64,
    /// Downwards.
    pub y: f64,
}

impl Spot {
    /// Where upright strokes of that width fill whole pixels, which keeps them sharp.
    fn snapped(self, width: i32) -> Self {
        let middle = if width % 2 == 0 { 0.0 } else { 0.5 };
        Self { x: self.x.floor() + middle, y: self.y.floor() + middle }
    }
}

impl FrameSize {
    /// Normalised to pixels. Held near the frame: what lies far outside is not seen, and must not
    /// overflow the drawing's numbers.
    fn spot(self, point: Point) -> Spot {
        let scale = |value: f64, size: u32| value.clamp(-2.0, 3.0) * f64::from(size);
        Spot { x: scale(point.x, self.width), y: scale(point.y, self.height) }
    }
}

/// Which parts of the scene to draw.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Parts {
    /// Contours of what moves.
    pub contours: bool,
    /// Boxes of what moves, but for who has one as a track, and of the target.
    pub boxes: bool,
    /// Boxes and numbers of everybody else who is seen.
    pub tracks: bool,
    /// Feature points.
    pub features: bool,
    /// Centre of mass of the target.
    pub centroid: bool,
    /// Where the target was lately.
    pub trail: bool,
    /// Middle of the frame.
    pub cross_hair: bool,
    /// State, number and confidence in words.
    pub state: bool,
    /// From the middle of the frame to the target, as line and in numbers.
    pub offset: bool,
}

const MOTION: Colour = Colour::new(80, 200, 255);
const TRACK: Colour = Colour::new(235, 235, 245);
const KEPT: Colour = Colour::new(80, 235, 70);
const REJECTED: Colour = Colour::new(255, 60, 50);
const TRAIL: Colour = Colour::new(255, 220, 90);
const WHITE: Colour = Colour::new(255, 255, 255);
const PLATE: Colour = Colour { red: 12, green: 16, blue: 22, alpha: 0.62 };
const CENTRE: Point = Point { x: 0.5, y: 0.5 };

fn state_colour(state: TargetState) -> Colour {
    match state {
        TargetState::Searching => Colour::new(225, 230, 235),
        TargetState::Tracking => Colour::new(80, 235, 120),
        TargetState::Occluded => Colour::new(255, 165, 50),
        TargetState::Lost => Colour::new(255, 85, 75),
    }
}

/// Sizes that suit the frame, so that a picture looks alike at 320x240 and at 4K.
#[derive(Debug, Clone, Copy)]
struct Style {
    stroke: i32,
    dot: f64,
    text: f64,
}

impl Style {
    fn of(frame: FrameSize) -> Self {
        let size = f64::from(frame.width.min(frame.height));
        Self {
            stroke: (size / 400.0).round().max(1.0) as i32,
            dot: (size / 260.0).max(1.4),
            // Below eight or nine pixels the letters fall apart, so small frames get relatively larger ones.
            text: (4.0 + size / 48.0).round(),
        }
    }
}

/// What was seen in one frame.
#[derive(Debug, Clone, Copy, Default)]
pub struct Seen<'a> {
    /// By the detector.
    pub motion: Option<&'a MotionMeta>,
    /// By the tracker.
    pub target: Option<&'a TargetMeta>,
    /// By the tracker: everybody.
    pub tracks: Option<&'a TracksMeta>,
    /// Where the target was lately, oldest first.
    pub trail: &'a [Point],
}

/// Turns what was seen into shapes, the furthest back first.
pub fn scene(frame: FrameSize, parts: Parts, seen: Seen) -> opencv::Result<Vec<Shape>> {
    let mut scene = Scene { frame, style: Style::of(frame), parts, shapes: Vec::new() };
    // While the tracker searches, the target's geometry says nothing.
    let target = seen.target.filter(|target| target.state != TargetState::Searching);
    scene.caption(seen.target)?;
    if parts.trail && seen.trail.len() > 1 {
        scene.trail(seen.trail);
    }
    let tracks = seen.tracks.filter(|_| parts.tracks).map_or(&[][..], |meta| &meta.tracks);
    for region in seen.motion.iter().flat_map(|motion| &motion.regions) {
        scene.region(region, tracks);
    }
    // A box around a group is nobody's own.
    let is_group = target.is_some_and(|target| target.is_group);
    tracks.iter().filter(|track| is_group || !track.is_target).for_each(|track| scene.track(track));
    if parts.cross_hair {
        scene.cross_hair();
    }
    if let Some(target) = target {
        scene.target(target);
    }
    Ok(scene.shapes)
}

fn is_seen(track: &Track) -> bool {
    track.state != TrackState::Hidden
}

struct Scene {
    frame: FrameSize,
    style: Style,
    parts: Parts,
    shapes: Vec<Shape>,
}

impl Scene {
    fn line(&mut self, points: impl IntoIterator<Item = Point>, closed: bool, colour: Colour) {
        let points = points.into_iter().map(|point| self.frame.spot(point)).collect();
        self.shapes.push(Shape::Line { points, closed, width: self.style.stroke, colour });
    }

    fn dot(&mut self, point: Point, radius: f64, colour: Colour) {
        self.shapes.push(Shape::Dot { centre: self.frame.spot(point), radius, colour });
    }

    fn bounds(&mut self, rect: Rect, colour: Colour) {
        self.outline(rect, self.style.stroke, colour);
    }

    fn outline(&mut self, rect: Rect, width: i32, colour: Colour) {
        let origin = self.frame.spot(Point { x: rect.x, y: rect.y });
        let end = self.frame.spot(Point { x: rect.x + rect.width, y: rect.y + rect.height });
        self.shapes.push(Shape::Frame { origin, end, width, colour });
    }

    /// Who has a box of their own needs no other around the region in which they are seen.
    fn region(&mut self, region: &Region, tracks: &[Track]) {
        let shows = |track: &Track| is_seen(track) && region.bounds.contains(track.bounds.centre());
        if self.parts.boxes && !tracks.iter().any(shows) {
            self.bounds(region.bounds, MOTION.with_alpha(0.55));
        }
        if self.parts.contours {
            self.line(region.contour.iter().copied(), true, MOTION);
        }
    }

    /// A thin box with its number above; fainter where it is not seen.
    fn track(&mut self, track: &Track) {
        let colour = TRACK.with_alpha(if is_seen(track) { 0.8 } else { 0.35 });
        self.outline(track.bounds, 1, colour);
        let corner = self.frame.spot(Point { x: track.bounds.x, y: track.bounds.y });
        let height = self.style.text * 0.75;
        let origin = Spot { x: corner.x, y: (corner.y - 0.3 * height).max(height) };
        self.shapes.push(Shape::Text { origin, text: track.id.to_string(), height, colour });
    }

    fn trail(&mut self, trail: &[Point]) {
        let points = trail.iter().map(|&point| self.frame.spot(point)).collect();
        self.shapes.push(Shape::Fading { points, width: self.style.stroke, colour: TRAIL });
    }

    /// Four strokes around the middle, which itself stays free.
    fn cross_hair(&mut self) {
        let middle = self.frame.spot(CENTRE).snapped(self.style.stroke);
        let (near, far) = (self.style.text * 0.6, self.style.text * 1.5);
        for (dx, dy) in [(1.0, 0.0), (-1.0, 0.0), (0.0, 1.0), (0.0, -1.0)] {
            let at = |length: f64| Spot { x: middle.x + dx * length, y: middle.y + dy * length };
            let (width, points) = (self.style.stroke, vec![at(near), at(far)]);
            self.shapes.push(Shape::Line { points, closed: false, width, colour: WHITE });
        }
    }

    fn target(&mut self, target: &TargetMeta) {
        let colour = state_colour(target.state);
        if self.parts.boxes {
            self.bounds(target.bounds, colour);
        }
        if self.parts.features {
            for feature in &target.features {
                let colour = if feature.kept { KEPT } else { REJECTED };
                self.dot(feature.position, self.style.dot, colour);
            }
        }
        if self.parts.offset {
            self.line([CENTRE, target.centroid], false, WHITE.with_alpha(0.9));
        }
        if self.parts.centroid {
            self.dot(target.centroid, self.style.dot * 2.0, WHITE);
            self.dot(target.centroid, self.style.dot, colour);
        }
    }

    /// State and offset in words, on a plate in the corner; left out where the frame has no room for it.
    fn caption(&mut self, target: Option<&TargetMeta>) -> opencv::Result<()> {
        let Some(target) = target else { return Ok(()) };
        let mut lines = Vec::new();
        if self.parts.state {
            lines.push((state_text(target), state_colour(target.state)));
        }
        if self.parts.offset && target.state != TargetState::Searching {
            lines.push((offset_text(target.centroid), WHITE));
        }
        let Style { text: height, .. } = self.style;
        let mut width = 0.0_f64;
        for (text, _) in &lines {
            width = width.max(text_width(text, height)?);
        }
        let (margin, pitch) = (height * 0.7, height * 1.75);
        let plate_width = width + 2.0 * margin;
        let plate_height = pitch * lines.len() as f64 + margin;
        let room = f64::from(self.frame.width) >= plate_width + 2.0 * margin
            && f64::from(self.frame.height) >= plate_height + 2.0 * margin;
        if lines.is_empty() || !room {
            return Ok(());
        }
        let origin = Spot { x: margin, y: margin };
        self.shapes.push(Shape::Plate { origin, width: plate_width, height: plate_height, colour: PLATE });
        for (index, (text, colour)) in lines.into_iter().enumerate() {
            let baseline = margin * 2.0 + pitch * index as f64 + height;
            let origin = Spot { x: margin * 2.0, y: baseline };
            self.shapes.push(Shape::Text { origin, text, height, colour });
        }
        Ok(())
    }
}

fn state_text(target: &TargetMeta) -> String {
    match target.state {
        TargetState::Searching => target.state.name().to_owned(),
        state => format!("{} #{}  {:.0}%", state.name(), target.id, target.confidence * 100.0),
    }
}

/// Positive: right of and below the middle, in frame widths and heights.
fn offset_text(centroid: Point) -> String {
    format!("dx {:+.2}  dy {:+.2}", centroid.x - CENTRE.x, centroid.y - CENTRE.y)
}

#[cfg(test)]
mod tests {
    use super::*;
    use ptztrack_contract::Feature;

    const FRAME: FrameSize = FrameSize { width: 320, height: 240 };
    const NONE: Parts = Parts {
        contours: false,
        boxes: false,
        tracks: false,
        features: false,
        centroid: false,
        trail: false,
        cross_hair: false,
        state: false,
        offset: false,
    };
    const ALL: Parts = Parts {
        contours: true,
        boxes: true,
        tracks: true,
        features: true,
        centroid: true,
        trail: true,
        cross_hair: true,
        state: true,
        offset: true,
    };

    fn target(state: TargetState) -> TargetMeta {
        let position = Point { x: 0.6, y: 0.5 };
        TargetMeta {
            state,
            id: 7,
            bounds: Rect { x: 0.55, y: 0.4, width: 0.1, height: 0.2 },
            centroid: position,
            confidence: 0.873,
            features: vec![Feature { position, kept: true }, Feature { position, kept: false }],
            ..TargetMeta::default()
        }
    }

    fn track(target: &TargetMeta) -> Track {
        Track {
            id: target.id,
            bounds: target.bounds,
            velocity: ptztrack_contract::Vector::default(),
            state: TrackState::Seen,
            confidence: 1.0,
            is_target: true,
        }
    }

    fn shapes(parts: Parts, target: &TargetMeta) -> Vec<Shape> {
        let trail = [Point { x: 0.1, y: 0.1 }, Point { x: 0.2, y: 0.1 }, Point { x: 0.3, y: 0.1 }];
        let region = Region { contour: trail.to_vec(), ..Region::default() };
        let motion = MotionMeta { regions: vec![region], ..MotionMeta::default() };
        let other = Track { id: 3, is_target: false, ..track(target) };
        let tracks = TracksMeta { tracks: vec![track(target), other] };
        let seen = Seen { motion: Some(&motion), target: Some(target), tracks: Some(&tracks), trail: &trail };
        scene(FRAME, parts, seen).unwrap()
    }

    fn texts(shapes: &[Shape]) -> Vec<&str> {
        fn text(shape: &Shape) -> Option<&str> {
            if let Shape::Text { text, .. } = shape { Some(text) } else { None }
        }
        shapes.iter().filter_map(text).collect()
    }

    #[test]
    fn each_part_draws_only_itself() {
        let target = target(TargetState::Tracking);
        let count = |parts| shapes(parts, &target).len();
        assert_eq!(count(NONE), 0);
        assert_eq!(count(Parts { contours: true, ..NONE }), 1);
        assert_eq!(count(Parts { boxes: true, ..NONE }), 2);
        assert_eq!(count(Parts { tracks: true, ..NONE }), 2, "the target has a box of its own");
        assert_eq!(count(Parts { features: true, ..NONE }), 2);
        assert_eq!(count(Parts { centroid: true, ..NONE }), 2);
        assert_eq!(count(Parts { trail: true, ..NONE }), 1);
        assert_eq!(count(Parts { cross_hair: true, ..NONE }), 4);
        assert_eq!(count(Parts { state: true, ..NONE }), 2);
        assert_eq!(count(Parts { offset: true, ..NONE }), 3);
        assert_eq!(count(ALL), 18, "state and offset share a plate");
    }

    #[test]
    fn who_is_seen_as_a_track_has_one_box() {
        let bounds = Rect { x: 0.2, y: 0.2, width: 0.1, height: 0.4 };
        let motion =
            MotionMeta { regions: vec![Region { bounds, ..Region::default() }], ..MotionMeta::default() };
        let boxes = |state: TrackState, x: f64, parts: Parts| {
            let bounds = Rect { x, ..bounds };
            let other = Track { bounds, state, is_target: false, ..track(&target(TargetState::Tracking)) };
            let tracks = TracksMeta { tracks: vec![other] };
            let seen = Seen { motion: Some(&motion), tracks: Some(&tracks), ..Seen::default() };
            let shapes = scene(FRAME, parts, seen).unwrap();
            shapes.iter().filter(|shape| matches!(shape, Shape::Frame { .. })).count()
        };
        let both = Parts { boxes: true, tracks: true, ..NONE };
        assert_eq!(boxes(TrackState::Seen, 0.22, both), 1);
        assert_eq!(boxes(TrackState::Seen, 0.6, both), 2, "somebody else");
        assert_eq!(boxes(TrackState::Hidden, 0.22, both), 2, "what hides them");
        assert_eq!(boxes(TrackState::Seen, 0.22, Parts { boxes: true, ..NONE }), 1, "tracks are not drawn");
    }

    #[test]
    fn each_of_a_group_that_is_the_target_has_a_box_of_their_own() {
        let one = target(TargetState::Tracking);
        let both = TargetMeta { is_group: true, ..one.clone() };
        let tracks = TracksMeta { tracks: vec![track(&one)] };
        let numbers = |target: &TargetMeta| {
            let seen = Seen { target: Some(target), tracks: Some(&tracks), ..Seen::default() };
            let shapes = scene(FRAME, Parts { tracks: true, boxes: true, ..NONE }, seen).unwrap();
            texts(&shapes).len()
        };
        assert_eq!(numbers(&one), 0, "the target's box is its own");
        assert_eq!(numbers(&both), 1);
    }

    #[test]
    fn words_and_numbers() {
        let shapes = shapes(ALL, &target(TargetState::Tracking));
        assert_eq!(texts(&shapes), ["tracking #7  87%", "dx +0.10  dy +0.00", "3"]);
    }

    #[test]
    fn searching_shows_no_target() {
        let target = target(TargetState::Searching);
        assert_eq!(texts(&shapes(ALL, &target)), ["searching", "3"]);
        assert!(shapes(Parts { features: true, centroid: true, offset: true, ..NONE }, &target).is_empty());
    }

    #[test]
    fn tiny_frames_have_no_caption() {
        let target = target(TargetState::Tracking);
        let seen = Seen { target: Some(&target), ..Seen::default() };
        let shapes = scene(FrameSize { width: 16, height: 16 }, ALL, seen).unwrap();
        assert!(texts(&shapes).is_empty() && !shapes.is_empty());
    }

    #[test]
    fn wild_coordinates_stay_near_the_frame() {
        let spot = FRAME.spot(Point { x: 1e300, y: -1e300 });
        assert_eq!(spot, Spot { x: 960.0, y: -480.0 });
    }
}
