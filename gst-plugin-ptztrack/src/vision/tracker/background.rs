//! Small windows spread over the frame, watched for the motion of the camera.

use opencv::core::{Point2f, Rect2f};

use super::corners::{self, Search};
use super::ego_motion::{self, EgoMotion};
use super::flow::Flow;
use super::geometry::{Frame, around, grown};
use super::patch::{Cut, Patch};
use crate::vision::Luma;

/// Where the windows lie, in frame sizes.
const PLACES: [(f32, f32); 5] = [(0.15, 0.25), (0.5, 0.12), (0.85, 0.25), (0.2, 0.85), (0.8, 0.85)];
/// Corners followed in each window.
const POINTS: usize = 6;
/// As long as so many are left in a window, no new ones are looked for.
const ENOUGH: usize = 4;
/// Side of a window in pixels of its patch.
const SIDE: f32 = 64.0;
/// Frame pixels that the windows keep from the target.
const DISTANCE: f32 = 8.0;

const FLOW: Flow = Flow { window: 11, grown_window: 11, max_residual: 16.0, max_return_error: None };

/// What the last frame showed away from the target.
#[derive(Default)]
pub(super) struct Background {
    windows: Vec<(Patch, Vec<Point2f>)>,
    /// What was cut from the newest frame already; all of it serves again while the camera rests.
    newest: Vec<Patch>,
    /// Where the points are in the newest frame.
    followed: Vec<Point2f>,
}

impl Background {
    /// Remembers the windows that do not touch `target`.
    pub fn remember(&mut self, luma: &Luma, target: Rect2f) -> opencv::Result<()> {
        let frame = Frame { width: luma.width() as f32, height: luma.height() as f32 };
        // Windows of the same share of the picture at any resolution see the same fast pan.
        let step = (frame.height.min(frame.width) / 240.0).round().clamp(1.0, 8.0);
        let keep_out = grown(target, DISTANCE);
        let mut windows = Vec::new();
        for (x, y) in PLACES {
            let middle = Point2f::new(x * frame.width, y * frame.height);
            let area = around(middle, SIDE * step, SIDE * step);
            if (area & keep_out).area() > 0.0 {
                continue;
            }
            let cut = Cut::new(luma, area, step as usize);
            let patch = match self.newest.iter().position(|patch| patch.as_cut() == cut) {
                Some(index) => self.newest.swap_remove(index),
                None => Patch::cut(luma, cut, FLOW.window)?,
            };
            let points = self.points_in(&patch)?;
            windows.push((patch, points));
        }
        self.newest.clear();
        self.windows = windows;
        Ok(())
    }

    /// The points that were followed into this window; new corners where too few were.
    fn points_in(&self, patch: &Patch) -> opencv::Result<Vec<Point2f>> {
        if patch.is_empty() {
            return Ok(Vec::new());
        }
        let inner = grown(patch.area(), -(FLOW.window as f32) * patch.step() as f32);
        let followed = self.followed.iter().copied().filter(|point| inner.contains(*point));
        let points: Vec<Point2f> = followed.take(POINTS).collect();
        if points.len() >= ENOUGH {
            return Ok(points);
        }
        let distance = 6.0 * patch.step() as f32;
        corners::find(patch, &Search { contour: &[], taken: &[], count: POINTS, distance })
    }

    /// How the picture moved since the last frame, in which it moved like `last`; `None` where that cannot be
    /// seen.
    pub fn motion(&mut self, luma: &Luma, last: EgoMotion) -> opencv::Result<Option<EgoMotion>> {
        // The camera goes on as it did, or it has stopped; a blank background says nothing at all.
        for expected in [last, EgoMotion::default()] {
            let motion = ego_motion::estimate(&self.follow(luma, expected)?);
            if motion.is_some() {
                return Ok(motion);
            }
        }
        Ok(None)
    }

    /// The points that are found again in the new frame, `(from, to)`, expected to move like `expected`.
    fn follow(&mut self, luma: &Luma, expected: EgoMotion) -> opencv::Result<Vec<(Point2f, Point2f)>> {
        let mut pairs = Vec::new();
        self.newest.clear();
        for (previous, points) in &self.windows {
            let Some(first) = points.first() else { continue };
            let cut = previous.as_cut().moved(luma, expected.at(*first));
            let next = Patch::cut(luma, cut, FLOW.window)?;
            let guesses: Vec<Point2f> = points.iter().map(|point| expected.apply(*point)).collect();
            let found = FLOW.follow(previous, &next, points, &guesses)?;
            pairs.extend(points.iter().zip(found).filter_map(|(from, to)| Some((*from, to?))));
            self.newest.push(next);
        }
        self.followed = pairs.iter().map(|(_, to)| *to).collect();
        Ok(pairs)
    }
}

#[cfg(test)]
mod tests {
    use super::super::geometry::length;
    use super::super::synthetic::Scene;
    use super::*;
    use proptest::prelude::*;

    const NOBODY: Rect2f = Rect2f { x: 300.0, y: 200.0, width: 40.0, height: 80.0 };

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(8))]
        #[test]
        fn a_panning_camera_is_measured(dx in -24.0_f32..24.0, dy in -12.0_f32..12.0) {
            let scene = Scene::new(640, 480);
            let (before, after) = (scene.background((0.0, 0.0)), scene.background((dx, dy)));
            let mut background = Background::default();
            background.remember(&before.luma(), NOBODY).expect("remember");
            let motion = background.motion(&after.luma(), EgoMotion::default()).expect("follow");
            let motion = motion.expect("textured everywhere");
            let error = length(motion.at(Point2f::new(320.0, 240.0)) - Point2f::new(dx, dy));
            prop_assert!(error < 0.4, "{error} pixels off");
        }
    }

    #[test]
    fn a_blank_wall_tells_nothing() {
        let wall = Scene::new(640, 480).flat(120);
        let mut background = Background::default();
        background.remember(&wall.luma(), NOBODY).expect("remember");
        assert_eq!(background.motion(&wall.luma(), EgoMotion::default()).expect("follow"), None);
    }
}
