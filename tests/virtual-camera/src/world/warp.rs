// SPDX-License-Identifier: MPL-2.0

//! Pictures seen through another lens: through a homography, or out of a panorama.
//!
//! By hand, in whole numbers: less work than OpenCV's, and the same picture however many cores there are.

use crate::picture::Plane;

/// Pixels between exact places; straight lines between them are off by less than a hundredth of a pixel.
const SPAN: usize = 16;
/// Places in the source count in 1/65536 pixel.
const ONE: f64 = 65536.0;

/// Fills `target` with what `source` shows where `place` takes each of its pixels; the source's edge goes on beyond it.
pub(crate) fn warp(source: &Plane, target: &mut Plane, place: impl Fn(f64, f64) -> (f64, f64)) {
    for (row, line) in target.data.chunks_exact_mut(target.width).enumerate() {
        let mut start = place(0.0, row as f64);
        for (span, pixels) in line.chunks_mut(SPAN).enumerate() {
            let next = span * SPAN + pixels.len();
            let end = place(next as f64, row as f64);
            fill(source, pixels, start, end);
            start = end;
        }
    }
}

/// Samples along a straight line from `start`, which ends before `end`.
fn fill(source: &Plane, pixels: &mut [u8], start: (f64, f64), end: (f64, f64)) {
    let length = pixels.len() as f64;
    let [du, dv] = [end.0 - start.0, end.1 - start.1].map(|way| (way / length * ONE) as i64);
    let (mut u, mut v) = ((start.0 * ONE) as i64, (start.1 * ONE) as i64);
    let (right, bottom) = (source.width as f64 - 2.0, source.height as f64 - 2.0);
    let inside = [start, end].iter().all(|&(u, v)| u >= 1.0 && v >= 1.0 && u < right && v < bottom);
    for pixel in pixels {
        *pixel = if inside { sample(source, u, v) } else { sample_at_edge(source, u, v) };
        (u, v) = (u + du, v + dv);
    }
}

/// The mean of the four pixels around a place that has all four.
#[inline]
fn sample(source: &Plane, u: i64, v: i64) -> u8 {
    let at = (v >> 16) as usize * source.width + (u >> 16) as usize;
    let above = &source.data[at..at + 2];
    let below = &source.data[at + source.width..at + source.width + 2];
    blend([above[0], above[1], below[0], below[1]], u, v)
}

fn sample_at_edge(source: &Plane, u: i64, v: i64) -> u8 {
    let pixel = |column: i64, row: i64| {
        let column = column.clamp(0, source.width as i64 - 1) as usize;
        let row = row.clamp(0, source.height as i64 - 1) as usize;
        source.data[row * source.width + column]
    };
    let (column, row) = (u >> 16, v >> 16);
    blend(
        [pixel(column, row), pixel(column + 1, row), pixel(column, row + 1), pixel(column + 1, row + 1)],
        u,
        v,
    )
}

#[inline]
fn blend(corners: [u8; 4], u: i64, v: i64) -> u8 {
    let [a, b, c, d] = corners.map(u32::from);
    let (right, down) = ((u >> 8 & 255) as u32, (v >> 8 & 255) as u32);
    let above = a * (256 - right) + b * right;
    let below = c * (256 - right) + d * right;
    ((above * (256 - down) + below * down + (1 << 15)) >> 16) as u8
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{
        geometry::{Pinhole, project, view_to_recording},
        kinematics::Pose,
    };

    /// Brightness that is linear in the place, so that every interpolation can be checked.
    fn ramp(width: usize, height: usize) -> Plane {
        let data = (0..width * height).map(|i| ((i % width + i / width) / 2) as u8).collect();
        Plane { width, height, data }
    }

    #[test]
    fn every_pixel_shows_what_the_homography_sees() {
        let source = ramp(256, 192);
        let pose = Pose { pan_deg: 9.0, tilt_deg: -4.0, zoom_step: 1.0 };
        let homography =
            view_to_recording(&pose, &Pinhole::new(203, 151, 25.0), &Pinhole::new(256, 192, 60.0));
        let mut view = Plane::filled(203, 151, 0);
        warp(&source, &mut view, |x, y| project(&homography, x, y));
        for (i, &pixel) in view.data.iter().enumerate() {
            let (u, v) = project(&homography, (i % 203) as f64, (i / 203) as f64);
            let expected = (u + v) / 2.0 - 0.25;
            assert!((f64::from(pixel) - expected).abs() <= 1.0, "{pixel} instead of {expected} at {i}");
        }
    }

    #[test]
    fn the_identity_changes_nothing() {
        let source = ramp(100, 80);
        let mut copy = Plane::filled(100, 80, 0);
        warp(&source, &mut copy, |x, y| (x, y));
        assert_eq!(copy, source);
    }

    #[test]
    fn beyond_the_edge_the_edge_goes_on() {
        let source = Plane { width: 2, height: 2, data: vec![10, 20, 30, 40] };
        let mut view = Plane::filled(6, 6, 0);
        warp(&source, &mut view, |x, y| (x - 2.0, y - 2.0));
        assert_eq!(view.data[..6], [10, 10, 10, 20, 20, 20]);
        assert_eq!(view.data[30..], [30, 30, 30, 40, 40, 40]);
    }
}
