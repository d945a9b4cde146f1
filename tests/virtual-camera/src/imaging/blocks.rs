// SPDX-License-Identifier: MPL-2.0

//! A noise filter that works block by block, as in small cameras: where a block shows little but noise, it is flattened, and
//! its edges begin to show.

use crate::picture::Plane;

/// Pixels along the side of a block.
const SIDE: usize = 8;
/// Standard deviation in grey levels below which a block is taken for plain, and above which it is left alone.
const PLAIN: (f64, f64) = (3.0, 8.0);

/// Takes what differs from their mean out of plain blocks, all of it at a strength of 1.
pub(super) fn flatten(strength: f64, plane: &mut Plane) {
    let (width, height) = (plane.width, plane.height);
    for (top, left) in
        (0..height).step_by(SIDE).flat_map(|top| (0..width).step_by(SIDE).map(move |left| (top, left)))
    {
        let rows = top..(top + SIDE).min(height);
        let columns = left..(left + SIDE).min(width);
        let (mut sum, mut squares) = (0u32, 0u32);
        for row in rows.clone() {
            for &pixel in &plane.data[row * width + columns.start..row * width + columns.end] {
                sum += u32::from(pixel);
                squares += u32::from(pixel) * u32::from(pixel);
            }
        }
        let count = f64::from((rows.len() * columns.len()) as u32);
        let mean = f64::from(sum) / count;
        let spread = (f64::from(squares) / count - mean * mean).max(0.0).sqrt();
        let plain = ((PLAIN.1 - spread) / (PLAIN.1 - PLAIN.0)).clamp(0.0, 1.0);
        let (kept, mean) = ((256.0 * (1.0 - strength * plain)) as i32, mean.round() as i32);
        for row in rows {
            for pixel in &mut plane.data[row * width + columns.start..row * width + columns.end] {
                *pixel = (mean + (((i32::from(*pixel) - mean) * kept + 128) >> 8)).clamp(0, 255) as u8;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn noise_goes_and_edges_stay() {
        let mut plane = Plane::filled(20, 20, 100);
        (0..400).filter(|index| index % 2 == 0).for_each(|index| plane.data[index] += 3);
        plane.data[3 * 20 + 12] = 250;
        let before = plane.clone();
        flatten(1.0, &mut plane);
        let block = |plane: &Plane, left: usize| plane.data[2 * 20 + left..][..4].to_vec();
        assert_eq!(block(&plane, 0), [102; 4]);
        assert_eq!(block(&plane, 8), block(&before, 8), "somebody is there");
    }
}
