// SPDX-License-Identifier: MPL-2.0

//! Normalised image geometry: `x` in frame widths from the left, `y` in frame heights from the top.

/// A point of the frame; inside the frame both coordinates are 0 to 1.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Point {
    /// Frame widths from the left edge.
    pub x: f64,
    /// Frame heights from the top edge.
    pub y: f64,
}

/// A displacement in frame widths and heights, or a rate of them per second.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Vector {
    /// Frame widths (per second), positive to the right.
    pub x: f64,
    /// Frame heights (per second), positive downwards.
    pub y: f64,
}

/// An upright box in the frame.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Rect {
    /// Left edge, frame widths.
    pub x: f64,
    /// Top edge, frame heights.
    pub y: f64,
    /// Width, frame widths.
    pub width: f64,
    /// Height, frame heights.
    pub height: f64,
}

impl Rect {
    /// The middle of the box.
    pub fn centre(&self) -> Point {
        Point { x: self.x + self.width / 2.0, y: self.y + self.height / 2.0 }
    }

    /// Whether `point` lies in the box, its edges included.
    pub fn contains(&self, point: Point) -> bool {
        (self.x..=self.x + self.width).contains(&point.x)
            && (self.y..=self.y + self.height).contains(&point.y)
    }

    /// The box in pixels of a frame of `frame_width` x `frame_height`, cut to the frame, as
    /// `(x, y, width, height)`; width or height is 0 where nothing of it lies inside.
    pub fn to_pixels(&self, frame_width: u32, frame_height: u32) -> (u32, u32, u32, u32) {
        let (x, width) = edge_pixels(self.x, self.width, frame_width);
        let (y, height) = edge_pixels(self.y, self.height, frame_height);
        (x, y, width, height)
    }

    /// The normalised box of the pixels `(x, y, width, height)` in a frame of that size (at least 1x1).
    pub fn from_pixels(pixels: (u32, u32, u32, u32), frame_width: u32, frame_height: u32) -> Self {
        let (width, height) = (f64::from(frame_width.max(1)), f64::from(frame_height.max(1)));
        Self {
            x: f64::from(pixels.0) / width,
            y: f64::from(pixels.1) / height,
            width: f64::from(pixels.2) / width,
            height: f64::from(pixels.3) / height,
        }
    }
}

/// Start and length in whole pixels, cut to `0..size`; `as` saturates, so a wild value cannot wrap.
fn edge_pixels(start: f64, length: f64, size: u32) -> (u32, u32) {
    let limit = f64::from(size);
    // `max` takes the number where the other is none, which `clamp` would pass on, and then panic of.
    let inside = |edge: f64, least: f64| (edge * limit).round().max(least).min(limit);
    let first = inside(start, 0.0);
    let last = inside(start + length, first);
    (first as u32, (last - first) as u32)
}

/// Width by height of a picture as displayed: of its size in pixels, and of the shape of each; `None` where that is no
/// shape.
pub fn aspect((width, height): (u32, u32), pixel: (i32, i32)) -> Option<f64> {
    let aspect = f64::from(width) * f64::from(pixel.0) / (f64::from(height) * f64::from(pixel.1));
    (aspect.is_finite() && aspect > 0.0).then_some(aspect)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn centre_and_containment() {
        let rect = Rect { x: 0.2, y: 0.4, width: 0.2, height: 0.4 };
        let centre = rect.centre();
        assert!((centre.x - 0.3).abs() < 1e-12 && (centre.y - 0.6).abs() < 1e-12);
        assert!(rect.contains(centre));
        assert!(!rect.contains(Point { x: 0.1, y: 0.5 }));
    }

    /// NaN and infinities too.
    fn anything() -> impl Strategy<Value = f64> {
        prop::num::f64::ANY
    }

    proptest! {
        #[test]
        fn pixels_round_trip(x in 0u32..640, y in 0u32..480, w in 0u32..640, h in 0u32..480) {
            let pixels = (x, y, w.min(640 - x), h.min(480 - y));
            prop_assert_eq!(Rect::from_pixels(pixels, 640, 480).to_pixels(640, 480), pixels);
        }

        #[test]
        fn pixels_stay_inside_the_frame(x in anything(), y in anything(), w in anything(), h in anything()) {
            let (px, py, pw, ph) = Rect { x, y, width: w, height: h }.to_pixels(64, 48);
            prop_assert!(px + pw <= 64 && py + ph <= 48);
        }
    }
}
