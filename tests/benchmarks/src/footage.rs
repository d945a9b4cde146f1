// SPDX-License-Identifier: MPL-2.0

/// Pixels of the world around the picture on either side, in picture widths.
const MARGIN: f64 = 0.25;
/// Pictures from one end of a walk, or a turn, to the other.
const WALK: u64 = 60;
/// Sizes of the walker in picture heights.
const WALKER: (f64, f64) = (0.15, 0.45);
/// How far the walker goes in the picture, in widths of it.
const WAY: f64 = 0.3;
/// How much later each walker turns than the one before, pictures.
const LATER: u64 = 37;

/// What the camera does.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Camera {
    /// It rests.
    Still,
    /// It turns to and fro, a quarter of its picture each way in 2.4 s.
    Turning,
}

/// People who walk to and fro before a wall with a pattern, past each other, in I420 pictures without gaps between rows. The same number
/// gives the same picture.
#[derive(Debug)]
pub struct Footage {
    size: (usize, usize),
    camera: Camera,
    people: u64,
    /// Luma of the wall, wider than the picture.
    wall: Vec<u8>,
    margin: usize,
}

impl Footage {
    /// Of pictures of that size (pixels, even), with so many people.
    pub fn new(size: (usize, usize), camera: Camera, people: u64) -> Self {
        let margin = (MARGIN * size.0 as f64) as usize;
        let width = size.0 + margin;
        let grain = (size.1 / 60).max(2);
        let wall =
            (0..width * size.1).map(|index| pattern(1, index % width, index / width, grain, 90)).collect();
        Self { size, camera, people, wall, margin }
    }

    /// Width and height, pixels.
    pub fn size(&self) -> (usize, usize) {
        self.size
    }

    /// The bytes of a picture.
    pub fn picture(&self, number: u64) -> Vec<u8> {
        let ((width, height), wide) = (self.size, self.size.0 + self.margin);
        let turned = if self.camera == Camera::Turning { swing(number) * self.margin as f64 } else { 0.0 };
        let first = turned as usize;
        let mut pixels = Vec::with_capacity(width * height * 3 / 2);
        for (y, row) in self.wall.chunks_exact(wide).enumerate() {
            let noise = (0..width).map(|x| (hash(number as usize + 7, x, y) & 3) as u8);
            pixels.extend(row[first..first + width].iter().zip(noise).map(|(wall, noise)| wall + noise));
        }
        pixels.resize(width * height * 3 / 2, 128);
        (0..self.people).for_each(|person| self.paint(&mut pixels, number, person));
        pixels
    }

    fn paint(&self, pixels: &mut [u8], number: u64, person: u64) {
        let (width, height) = self.size;
        let (across, down) = ((WALKER.0 * height as f64) as usize, (WALKER.1 * height as f64) as usize);
        let middle = (person + 1) as f64 / (self.people + 1) as f64;
        let place = middle + WAY * (swing(number + WALK / 2 + person * LATER) - 0.5);
        let left = ((place * width as f64) as usize).saturating_sub(across / 2).min(width - across);
        // Every second one is nearer to the camera.
        let top = height / 4 + (person % 2) as usize * height / 8;
        let (luma, chroma) = pixels.split_at_mut(width * height);
        let grain = (height / 90).max(2);
        for y in 0..down {
            for x in 0..across {
                luma[(top + y) * width + left + x] = pattern(2 + person as usize, x, y, grain, 20);
            }
        }
        for (plane, value) in chroma.chunks_exact_mut(width * height / 4).zip([100, 170]) {
            for y in top / 2..(top + down) / 2 {
                plane[y * width / 2 + left / 2..][..across / 2].fill(value);
            }
        }
    }
}

/// From 0 to 1 and back.
fn swing(number: u64) -> f64 {
    let phase = number % (2 * WALK);
    phase.min(2 * WALK - phase) as f64 / WALK as f64
}

/// Blocks of `grain` pixels a side, of any grey from `base` to 63 more.
fn pattern(seed: usize, x: usize, y: usize, grain: usize, base: u8) -> u8 {
    base + (hash(seed, x / grain, y / grain) & 63) as u8
}

fn hash(seed: usize, x: usize, y: usize) -> u32 {
    let mixed = (seed as u32).wrapping_mul(0x9e37_79b9)
        ^ (x as u32).wrapping_mul(0x85eb_ca6b)
        ^ (y as u32).wrapping_mul(0xc2b2_ae35);
    (mixed ^ (mixed >> 13)).wrapping_mul(0x27d4_eb2f) >> 9
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_walker_moves_and_the_wall_only_when_the_camera_turns() {
        for (camera, moves) in [(Camera::Still, false), (Camera::Turning, true)] {
            let footage = Footage::new((320, 240), camera, 1);
            let (first, second) = (footage.picture(10), footage.picture(20));
            assert_eq!(first, footage.picture(10));
            let apart = |place: usize| first[place].abs_diff(second[place]);
            let changed = |rows: std::ops::Range<usize>| {
                let count = rows.len() * 320;
                rows.flat_map(|y| y * 320..(y + 1) * 320).filter(|place| apart(*place) > 4).count() * 4
                    > count
            };
            assert_eq!(changed(0..50), moves);
            assert!((60 * 320..160 * 320).any(|place| apart(place) > 60));
        }
    }
}
