//! Small windows spread over the frame, watched for the motion of the camera.

use opencv::core::{Point2f, Rect2f};

use super::corners::{self, Search};
use super::ego_motion::EgoMotion;
use super::flow::Flow;
use super::geometry::{Frame, around, grown};
use super::patch::{Cut, Patch};
use crate::vision::Luma;

/// Where the windows lie, in frame sizes.
const PLACES: [(f32, f32); 6] =
    [(0.15, 0.2), (0.5, 0.15), (0.85, 0.2), (0.15, 0.8), (0.5, 0.85), (0.85, 0.8)];
/// Corners followed in each window.
const POINTS: usize = 6;
/// Side of a window in pixels of its patch.
const SIDE: f32 = 64.0;
/// Frame pixels that the windows keep from the target.
const DISTANCE: f32 = 8.0;

const FLOW: Flow = Flow { window: 11, grown_window: 11, max_residual: 16.0, max_return_error: None };

/// What the last frame showed away from the target.
pub(super) struct Background {
    windows: Vec<(Patch, Vec<Point2f>)>,
}

impl Background {
    /// Remembers the windows that do not touch `target`.
    pub fn remember(luma: &Luma, target: Rect2f) -> opencv::Result<Self> {
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
            let patch = Patch::cut(luma, Cut::new(luma, area, step as usize), FLOW.window)?;
            let search = Search { contour: &[], taken: &[], count: POINTS, distance: 6.0 * step };
            let points = if patch.is_empty() { Vec::new() } else { corners::find(&patch, &search)? };
            windows.push((patch, points));
        }
        Ok(Self { windows })
    }

    /// The points that are found again in the new frame, `(from, to)`, expected to move like `expected`.
    pub fn follow(&self, luma: &Luma, expected: EgoMotion) -> opencv::Result<Vec<(Point2f, Point2f)>> {
        let mut pairs = Vec::new();
        for (previous, points) in &self.windows {
            let Some(first) = points.first() else { continue };
            let cut = previous.as_cut().moved(luma, expected.at(*first));
            let next = Patch::cut(luma, cut, FLOW.window)?;
            let guesses: Vec<Point2f> = points.iter().map(|point| expected.apply(*point)).collect();
            let found = FLOW.follow(previous, &next, points, &guesses)?;
            pairs.extend(points.iter().zip(found).filter_map(|(from, to)| Some((*from, to?))));
        }
        Ok(pairs)
    }
}

#[cfg(test)]
mod tests {
    use super::super::ego_motion::estimate;
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
            let background = Background::remember(&before.luma(), NOBODY).expect("remember");
            let still = EgoMotion::translation(Point2f::default());
            let pairs = background.follow(&after.luma(), still).expect("follow");
            let motion = estimate(&pairs).expect("textured everywhere");
            let error = length(motion.at(Point2f::new(320.0, 240.0)) - Point2f::new(dx, dy));
            prop_assert!(error < 0.4, "{error} pixels off");
        }
    }

    #[test]
    fn a_blank_wall_tells_nothing() {
        let wall = Scene::new(640, 480).flat(120);
        let background = Background::remember(&wall.luma(), NOBODY).expect("remember");
        let still = EgoMotion::translation(Point2f::default());
        assert!(background.follow(&wall.luma(), still).expect("follow").is_empty());
    }
}
