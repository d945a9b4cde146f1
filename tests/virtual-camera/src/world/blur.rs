// SPDX-License-Identifier: MPL-2.0

//! Motion blur: what the shutter sees while the camera turns.

use crate::picture::{Picture, Plane};

/// The mean of all pictures while the content moves by (`x`, `y`) pixels, starting as it is.
///
/// Halving: the mean of a picture and itself moved by d/2 holds two moments, that of the result and itself moved by d/4
/// four, and so on until less than a pixel is left. A handful of cheap passes for any length.
pub(crate) fn motion_blur(picture: &mut Picture, x: f64, y: f64) {
    let [luma, u, v] = &mut picture.planes;
    blur_plane(luma, x, y);
    blur_plane(u, x / 2.0, y / 2.0);
    blur_plane(v, x / 2.0, y / 2.0);
}

/// The same of one plane.
pub(crate) fn blur_plane(plane: &mut Plane, x: f64, y: f64) {
    let (mut x, mut y) = (x / 2.0, y / 2.0);
    while x.abs().max(y.abs()) > 0.5 {
        average_with_moved(plane, x.round() as isize, y.round() as isize);
        (x, y) = (x / 2.0, y / 2.0);
    }
}

/// Mean of the plane and the plane moved by (`dx`, `dy`); the edge goes on beyond itself.
fn average_with_moved(plane: &mut Plane, dx: isize, dy: isize) {
    let before = plane.data.clone();
    let (width, height) = (plane.width as isize, plane.height as isize);
    for (row, line) in plane.data.chunks_exact_mut(plane.width).enumerate() {
        let from = (row as isize - dy).clamp(0, height - 1) as usize * plane.width;
        let source = &before[from..from + plane.width];
        // Columns whose source lies inside are the bulk and need no clamping.
        let inside = dx.clamp(0, width) as usize..(width + dx).clamp(0, width) as usize;
        let edges = (0..inside.start.min(plane.width)).chain(inside.end..plane.width);
        for column in edges {
            let at = (column as isize - dx).clamp(0, width - 1) as usize;
            line[column] = mean(line[column], source[at]);
        }
        let moved = &source[(-dx).clamp(0, width) as usize..];
        for (pixel, &other) in line[inside].iter_mut().zip(moved) {
            *pixel = mean(*pixel, other);
        }
    }
}

fn mean(a: u8, b: u8) -> u8 {
    (u16::from(a) + u16::from(b)).div_ceil(2) as u8
}

#[cfg(test)]
mod tests {
    use super::*;

    fn spot(x: usize, y: usize) -> Plane {
        let mut plane = Plane::filled(40, 30, 0);
        plane.data[y * 40 + x] = 255;
        plane
    }

    fn lit(plane: &Plane) -> Vec<(usize, usize)> {
        (0..plane.data.len()).filter(|&i| plane.data[i] > 8).map(|i| (i % 40, i / 40)).collect()
    }

    #[test]
    fn a_spot_becomes_a_streak_in_the_direction_of_movement() {
        let mut plane = spot(10, 15);
        blur_plane(&mut plane, 8.0, 0.0);
        assert_eq!(lit(&plane), (10..18).map(|x| (x, 15)).collect::<Vec<_>>());
        let mut plane = spot(10, 15);
        blur_plane(&mut plane, 0.0, -4.0);
        assert_eq!(lit(&plane), (12..=15).map(|y| (10, y)).collect::<Vec<_>>());
    }

    #[test]
    fn brightness_is_kept() {
        for (x, y) in [(13.0, 5.0), (-60.0, 2.0), (100.0, 100.0), (0.3, 0.0)] {
            let mut plane = Plane::filled(40, 30, 100);
            blur_plane(&mut plane, x, y);
            assert!(plane.data.iter().all(|&pixel| pixel == 100));
        }
    }

    #[test]
    fn standing_still_blurs_nothing() {
        let mut plane = spot(10, 15);
        blur_plane(&mut plane, 0.4, 0.4);
        assert_eq!(plane, spot(10, 15));
    }
}
