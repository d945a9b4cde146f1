// SPDX-License-Identifier: MPL-2.0

//! A smoothed window of the picture with its pyramid: the only pixels that optical flow works on.

use multiversion::multiversion;
use opencv::core::{Point2f, Rect2f};

use super::geometry::grown;
use crate::vision::Luma;
use crate::vision::blur::mirrored;
use crate::vision::lucas_kanade::Pyramid;
use crate::vision::picture::add_rows;

/// Side of the largest window that points are looked for in, pixels of the patch.
pub(super) const GROWN_WINDOW: usize = 25;

/// Pixels of the patch that a target has at most: a larger one is looked at more coarsely.
const MAX_AREA: f32 = 40_000.0;
/// What is seen around the box, as a share of its sides, and at least, in pixels of the patch.
const MARGIN_SHARE: f32 = 0.3;
const MIN_MARGIN: f32 = 40.0;

/// A patch lies well enough while none of its sides is farther off than this, in pixels of it.
const SLACK: usize = 10;

/// A window of the picture. Two of them can be compared wherever each lies, as long as both are of
/// one size: where the camera pans, the second is cut where the first one's content is expected.
#[derive(Debug, Default)]
pub(super) struct Patch {
    x: usize,
    y: usize,
    step: usize,
    pyramid: Pyramid,
    /// Memory: a row of sums.
    sums: Vec<u16>,
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
    /// Cuts and smooths (thesis 3.5.1, step i), with so many halvings for windows of up to [`GROWN_WINDOW`] pixels.
    pub fn cut(luma: &Luma, cut: Cut, halvings: usize) -> Self {
        let mut patch = Self::default();
        patch.fill(luma, cut, halvings);
        patch
    }

    /// The same in the memory of another patch.
    pub fn fill(&mut self, luma: &Luma, cut: Cut, halvings: usize) {
        let Cut { x, y, width, height, step } = cut;
        (self.x, self.y, self.step) = (x, y, step);
        let size = (width / step, height / step);
        let view = luma.crop(x, y, size.0 * step, size.1 * step);
        let sums = &mut self.sums;
        // Averaging over each step x step block smooths already.
        self.pyramid.fill(size, GROWN_WINDOW, halvings, |y, row| {
            if step == 1 { smooth(&view, y, sums, row) } else { average(&view, y, step, sums, row) }
        });
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
    pub fn grey(&self) -> Luma<'_> {
        self.pyramid.luma()
    }

    /// So many of the smoothed pixels of a row, of which the first may lie a few pixels beside the patch: what is beyond its edge is as what
    /// is before it.
    pub fn around(&self, x: isize, y: isize, count: usize) -> &[u8] {
        self.pyramid.around(x, y, count)
    }

    pub fn pyramid(&self) -> &Pyramid {
        &self.pyramid
    }

    pub fn step(&self) -> usize {
        self.step
    }

    /// Whether the two can be compared.
    pub fn fits(&self, other: &Self) -> bool {
        self.step == other.step && self.size() == other.size()
    }

    /// Whether there is anything in it.
    pub fn is_empty(&self) -> bool {
        self.size() == (0, 0)
    }

    /// Width and height, its own pixels.
    pub fn size(&self) -> (usize, usize) {
        (self.grey().width(), self.grey().height())
    }

    /// The part of the frame that it shows.
    pub fn area(&self) -> Rect2f {
        let (width, height) = self.size();
        let sides = [self.x, self.y, width * self.step, height * self.step].map(|pixels| pixels as f32);
        Rect2f::new(sides[0], sides[1], sides[2], sides[3])
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

/// Row `y` of a picture smoothed by (1 2 1) / 4 either way, as OpenCV's `GaussianBlur` does it.
fn smooth(luma: &Luma, y: usize, sums: &mut Vec<u16>, out: &mut [u8]) {
    let rows = [-1, 0, 1].map(|off| luma.row(mirrored(y as isize + off, luma.height())));
    let width = luma.width();
    sums.resize(width + 2, 0);
    smooth_down(rows, &mut sums[1..=width]);
    // What is beyond the border is as what is before it.
    (sums[0], sums[width + 1]) = (sums[2.min(width)], sums[width.max(2) - 1]);
    smooth_across(sums, out);
}

#[multiversion(targets("x86_64+avx2"))]
fn smooth_down([a, b, c]: [&[u8]; 3], sums: &mut [u16]) {
    let count = sums.len();
    let (a, b, c) = (&a[..count], &b[..count], &c[..count]);
    for x in 0..count {
        sums[x] = u16::from(a[x]) + 2 * u16::from(b[x]) + u16::from(c[x]);
    }
}

#[multiversion(targets("x86_64+avx2"))]
fn smooth_across(sums: &[u16], out: &mut [u8]) {
    let count = out.len();
    let [a, b, c] = [0, 1, 2].map(|first| &sums[first..first + count]);
    for x in 0..count {
        out[x] = ((a[x] + 2 * b[x] + c[x] + 8) >> 4) as u8;
    }
}

/// Row `y` of a picture of which each square of `step` pixels a side becomes one, its mean.
fn average(luma: &Luma, y: usize, step: usize, sums: &mut Vec<u16>, out: &mut [u8]) {
    add_rows(*luma, step * y, step * (y + 1), sums);
    let count = (step * step) as u32;
    for (mean, sums) in out.iter_mut().zip(sums.chunks_exact(step)) {
        *mean = ((sums.iter().map(|&sum| u32::from(sum)).sum::<u32>() + count / 2) / count) as u8;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use opencv::core::{Mat, Size};
    use opencv::imgproc::gaussian_blur_def;
    use opencv::prelude::*;
    use proptest::prelude::*;

    #[test]
    fn points_enter_and_leave() {
        let data = vec![7; 64 * 48];
        let luma = Luma::new(&data, 64, 48, 64).expect("fits");
        let patch = Patch::cut(&luma, Cut::new(&luma, Rect2f::new(10.0, 6.0, 32.0, 32.0), 2), 0);
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
        assert!(Patch::cut(&luma, cut, 4).is_empty());
    }

    proptest! {
        #[test]
        fn pixels_are_smoothed_as_by_opencv(
            data in prop::collection::vec(any::<u8>(), 30 * 20), width in 1_usize..30, height in 1_usize..20,
        ) {
            let luma = Luma::new(&data, 30, 20, 30).expect("fits").crop(1, 1, width, height);
            let patch = Patch::cut(&luma, Cut { x: 0, y: 0, width: luma.width(), height: luma.height(), step: 1 }, 2);
            let mut expected = Mat::default();
            let blurred = luma.with_mat(|mat| gaussian_blur_def(mat, &mut expected, Size::new(3, 3), 0.0));
            blurred.expect("OpenCV");
            for y in 0..luma.height() {
                prop_assert_eq!(patch.grey().row(y), expected.at_row::<u8>(y as i32).expect("a row"));
            }
        }

        #[test]
        fn squares_become_their_mean(data in prop::collection::vec(any::<u8>(), 30 * 20), step in 2_usize..7) {
            let luma = Luma::new(&data, 30, 20, 30).expect("fits");
            let patch = Patch::cut(&luma, Cut { x: 3, y: 2, width: 26, height: 17, step }, 0);
            prop_assert_eq!(patch.size(), (26 / step, 17 / step));
            for (y, x) in (0..17 / step).flat_map(|y| (0..26 / step).map(move |x| (y, x))) {
                let rows = (0..step).map(|row| luma.row(2 + step * y + row));
                let sum: u32 = rows.flat_map(|row| &row[3 + step * x..][..step]).map(|&pixel| u32::from(pixel)).sum();
                let mean = f64::from(sum) / (step * step) as f64;
                prop_assert!((f64::from(patch.grey().row(y)[x]) - mean).abs() <= 0.5);
            }
        }

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
