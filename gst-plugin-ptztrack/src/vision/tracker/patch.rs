// SPDX-License-Identifier: MPL-2.0

//! A smoothed window of the picture with its pyramid: the only pixels that optical flow works on.

use opencv::core::{BORDER_CONSTANT, BORDER_REFLECT_101, Mat, Point2f, Rect2f, Size, Vector};
use opencv::prelude::*;
use opencv::{imgproc, video};

use super::geometry::grown;
use crate::vision::Luma;

/// Pyramid levels above the full one: 2^4 times the window is far more than a target moves in a frame.
const LEVELS: i32 = 4;

/// Pixels of the patch that a target has at most: a larger one is looked at more coarsely.
const MAX_AREA: f32 = 40_000.0;
/// What is seen around the box, as a share of its sides, and at least, in pixels of the patch.
const MARGIN_SHARE: f32 = 0.3;
const MIN_MARGIN: f32 = 40.0;

/// A patch lies well enough while none of its sides is farther off than this, in pixels of it.
const SLACK: usize = 10;

/// A window of the picture. Two of them can be compared wherever each lies, as long as both are of
/// one size: where the camera pans, the second is cut where the first one's content is expected.
pub(super) struct Patch {
    x: usize,
    y: usize,
    step: usize,
    grey: Mat,
    pyramid: Vector<Mat>,
}

/// Where to cut: whole pixels inside the frame.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Cut {
    x: usize,
    y: usize,
    width: usize,
    height: usize,
    step: usize,
}

impl Cut {
    /// The part of `area` inside the picture. Every `step` pixels of it become one, so that a huge
    /// target costs no more than a small one.
    pub fn new(luma: &Luma, area: Rect2f, step: usize) -> Self {
        let (x, width) = inside(area.x, area.width, luma.width());
        let (y, height) = inside(area.y, area.height, luma.height());
        Self { x, y, width, height, step: step.max(1) }
    }

    /// The same window moved by about `shift`, pushed back into the picture where it would leave it.
    pub fn moved(self, luma: &Luma, shift: Point2f) -> Self {
        let place = |start: usize, shift: f32, length: usize, size: usize| {
            let latest = size.saturating_sub(length) as f32;
            (start as f32 + shift.round()).clamp(0.0, latest) as usize
        };
        Self {
            x: place(self.x, shift.x, self.width, luma.width()),
            y: place(self.y, shift.y, self.height, luma.height()),
            ..self
        }
    }

    /// Whether this one does as well as `wanted`: a patch is costly, and its margin is there to be used.
    pub fn serves(&self, wanted: &Self) -> bool {
        let near = |a: usize, b: usize| a.abs_diff(b) <= SLACK * self.step;
        self.step == wanted.step
            && near(self.x, wanted.x)
            && near(self.y, wanted.y)
            && near(self.x + self.width, wanted.x + wanted.width)
            && near(self.y + self.height, wanted.y + wanted.height)
    }
}

/// Start and length in whole pixels inside `0..size`; `as` saturates, so a wild value cannot wrap.
fn inside(start: f32, length: f32, size: usize) -> (usize, usize) {
    let first = (start.floor().max(0.0) as usize).min(size);
    let last = ((start + length).ceil().max(0.0) as usize).clamp(first, size);
    (first, last - first)
}

impl Patch {
    /// Cuts, smooths (thesis 3.5.1, step i) and builds the pyramid for windows up to `window` pixels.
    pub fn cut(luma: &Luma, cut: Cut, window: i32) -> opencv::Result<Self> {
        let (width, height) = (cut.width / cut.step, cut.height / cut.step);
        let view = luma.crop(cut.x, cut.y, width * cut.step, height * cut.step);
        let grey = view.with_mat(|mat| smooth(mat, cut.step, width, height))?;
        let mut pyramid = Vector::new();
        if !grey.empty() {
            video::build_optical_flow_pyramid(
                &grey,
                &mut pyramid,
                Size::new(window, window),
                LEVELS,
                true,
                BORDER_REFLECT_101,
                BORDER_CONSTANT,
                false,
            )?;
        }
        Ok(Self { x: cut.x, y: cut.y, step: cut.step, grey, pyramid })
    }

    /// How it was cut.
    pub fn as_cut(&self) -> Cut {
        let area = self.area();
        Cut {
            x: self.x,
            y: self.y,
            width: area.width as usize,
            height: area.height as usize,
            step: self.step,
        }
    }

    /// The smoothed pixels.
    pub fn grey(&self) -> &Mat {
        &self.grey
    }

    pub fn pyramid(&self) -> &Vector<Mat> {
        &self.pyramid
    }

    /// Levels of the pyramid above the full one: fewer where the patch is small.
    pub fn levels(&self) -> i32 {
        // Each level is stored with its derivatives.
        (self.pyramid.len() as i32 / 2 - 1).max(0)
    }

    pub fn step(&self) -> usize {
        self.step
    }

    /// Whether the two can be compared.
    pub fn fits(&self, other: &Self) -> bool {
        self.step == other.step
            && (self.grey.cols(), self.grey.rows()) == (other.grey.cols(), other.grey.rows())
    }

    /// Whether there is anything in it.
    pub fn is_empty(&self) -> bool {
        self.grey.empty()
    }

    /// The part of the frame that it shows.
    pub fn area(&self) -> Rect2f {
        let step = self.step as i32;
        Rect2f::new(
            self.x as f32,
            self.y as f32,
            (self.grey.cols() * step) as f32,
            (self.grey.rows() * step) as f32,
        )
    }

    /// Frame pixels to pixels of the patch.
    pub fn enter(&self, point: Point2f) -> Point2f {
        (point - self.first_pixel()) / self.step as f32
    }

    /// Pixels of the patch to frame pixels.
    pub fn leave(&self, point: Point2f) -> Point2f {
        point * self.step as f32 + self.first_pixel()
    }

    /// Where the middle of its first pixel lies in the frame.
    fn first_pixel(&self) -> Point2f {
        let half = (self.step as f32 - 1.0) / 2.0;
        Point2f::new(self.x as f32 + half, self.y as f32 + half)
    }
}

/// Where optical flow for a target looks: around it, at a step that bounds the number of pixels.
pub(super) fn cut_around(luma: &Luma, bounds: Rect2f) -> Cut {
    let step = (bounds.area() / MAX_AREA).sqrt().round().max(1.0);
    let margin = (MARGIN_SHARE * bounds.width.max(bounds.height)).max(MIN_MARGIN * step);
    Cut::new(luma, grown(bounds, margin), step as usize)
}

fn smooth(mat: &Mat, step: usize, width: usize, height: usize) -> opencv::Result<Mat> {
    let mut grey = Mat::default();
    if width == 0 || height == 0 {
        return Ok(grey);
    }
    if step == 1 {
        imgproc::gaussian_blur_def(mat, &mut grey, Size::new(3, 3), 0.0)?;
    } else {
        // Averaging over each step x step block smooths already.
        let size = Size::new(width as i32, height as i32);
        imgproc::resize(mat, &mut grey, size, 0.0, 0.0, imgproc::INTER_AREA)?;
    }
    Ok(grey)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn points_enter_and_leave() {
        let data = vec![7; 64 * 48];
        let luma = Luma::new(&data, 64, 48, 64).expect("fits");
        let patch =
            Patch::cut(&luma, Cut::new(&luma, Rect2f::new(10.0, 6.0, 32.0, 32.0), 2), 15).expect("cut");
        assert_eq!(patch.area(), Rect2f::new(10.0, 6.0, 32.0, 32.0));
        // The first block of 2x2 pixels starts at (10, 6): its middle is half a pixel further.
        assert_eq!(patch.leave(Point2f::new(0.0, 0.0)), Point2f::new(10.5, 6.5));
        assert_eq!(patch.enter(Point2f::new(14.5, 8.5)), Point2f::new(2.0, 1.0));
    }

    #[test]
    fn nothing_of_the_frame_is_an_empty_patch() {
        let data = vec![7; 64 * 48];
        let luma = Luma::new(&data, 64, 48, 64).expect("fits");
        let cut = Cut::new(&luma, Rect2f::new(80.0, 6.0, 32.0, 32.0), 1);
        assert!(Patch::cut(&luma, cut, 15).expect("cut").is_empty());
    }

    proptest! {
        #[test]
        fn cuts_stay_in_the_frame(x in any::<f32>(), y in any::<f32>(), w in any::<f32>(), h in any::<f32>(),
                                  dx in any::<f32>(), dy in any::<f32>()) {
            let data = vec![7; 64 * 48];
            let luma = Luma::new(&data, 64, 48, 64).expect("fits");
            let cut = Cut::new(&luma, Rect2f::new(x, y, w, h), 1);
            let moved = cut.moved(&luma, Point2f::new(dx, dy));
            for cut in [cut, moved] {
                prop_assert!(cut.x + cut.width <= 64 && cut.y + cut.height <= 48);
            }
            prop_assert_eq!((cut.width, cut.height), (moved.width, moved.height));
        }
    }
}
