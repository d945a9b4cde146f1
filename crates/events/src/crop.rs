// SPDX-License-Identifier: MPL-2.0

use std::ops::Range;

use image::RgbImage;
use image::codecs::jpeg::JpegEncoder;

use crate::{Looks, Picture};

/// A part of a picture with somebody in it.
#[derive(Debug, Clone, PartialEq)]
pub struct Crop {
    /// In pixels.
    pub width: u32,
    /// In pixels.
    pub height: u32,
    /// Red, green and blue of each pixel, row by row, without a gap.
    pub rgb: Vec<u8>,
    /// Where they are in it: left, top, width and height in pixels.
    pub person: [u32; 4],
}

/// As pictures for people usually are.
const JPEG_QUALITY: u8 = 80;

/// The head is in this share of the box: one in so many.
const HEAD: u32 = 4;
/// No more cells than that tell whose it is.
const CELLS: u32 = 4;

impl Crop {
    /// The picture to keep; with `pixelate` nobody's face is known by it. `None` where there are fewer pixels than there should be.
    pub fn into_picture(mut self, quality: f64, pixelate: bool) -> Option<Picture> {
        // Of the clothes, whatever is shown of the head.
        let looks = self.looks();
        if pixelate {
            self.pixelate_faces();
        }
        let picture = RgbImage::from_raw(self.width, self.height, self.rgb)?;
        let mut jpeg = Vec::new();
        picture.write_with_encoder(JpegEncoder::new_with_quality(&mut jpeg, JPEG_QUALITY)).ok()?;
        Some(Picture { jpeg, quality, looks })
    }

    /// Of what is inside the box: its middle half, where there is little but the person.
    fn looks(&self) -> Looks {
        let [x, y, width, height] = self.person;
        let row = |row: u32| {
            let down = f64::from(row) / f64::from(height);
            let pixel = move |column| Some((down, self.pixel(column, y + row)?));
            (x + width / 4..x + width - width / 4).filter_map(pixel)
        };
        Looks::of((0..height).flat_map(row))
    }

    /// All but the person below the head: others may stand beside them, and a box may begin too low.
    fn pixelate_faces(&mut self) {
        let [x, y, width, height] = self.person;
        let (shoulders, right, feet) = (y + height / HEAD, x + width, y + height);
        let (all, body) = (0..self.width, shoulders..feet);
        self.pixelate(all.clone(), 0..shoulders);
        self.pixelate(0..x, body.clone());
        self.pixelate(right..self.width, body);
        self.pixelate(all, feet..self.height);
    }

    fn pixelate(&mut self, columns: Range<u32>, rows: Range<u32>) {
        let [_, _, width, height] = self.person;
        let cell = (width.max(height / HEAD) / CELLS).max(1);
        for row in rows.clone().step_by(cell as usize) {
            for column in columns.clone().step_by(cell as usize) {
                self.flatten(
                    column..column.saturating_add(cell).min(columns.end),
                    row..row.saturating_add(cell).min(rows.end),
                );
            }
        }
    }

    /// Gives all pixels of a cell their mean.
    fn flatten(&mut self, columns: Range<u32>, rows: Range<u32>) {
        let places: Vec<(u32, u32)> =
            rows.flat_map(|row| columns.clone().map(move |column| (column, row))).collect();
        let pixels: Vec<[u8; 3]> =
            places.iter().filter_map(|(column, row)| self.pixel(*column, *row)).collect();
        let Ok(count @ 1..) = u32::try_from(pixels.len()) else { return };
        let mean =
            [0, 1, 2].map(|part| pixels.iter().map(|pixel| u32::from(pixel[part])).sum::<u32>() / count);
        for (column, row) in places {
            if let Some(at) = self.index(column, row) {
                self.rgb[at..at + 3].copy_from_slice(&mean.map(|part| part as u8));
            }
        }
    }

    fn pixel(&self, column: u32, row: u32) -> Option<[u8; 3]> {
        let at = self.index(column, row)?;
        self.rgb[at..at + 3].try_into().ok()
    }

    fn index(&self, column: u32, row: u32) -> Option<usize> {
        let at = (row as usize * self.width as usize + column as usize) * 3;
        (column < self.width && at + 3 <= self.rgb.len()).then_some(at)
    }
}

/// How sharp a grey picture is, 0 to 1: how much neighbours differ, on average.
pub fn sharpness(grey: &[u8], width: usize) -> f64 {
    let difference = |pair: &[u8]| u64::from(pair[0].abs_diff(pair[1]));
    let rows = || grey.chunks_exact(width.max(1));
    let sum: u64 = rows().map(|row| row.windows(2).map(difference).sum::<u64>()).sum();
    let pairs: usize = rows().map(|row| row.len().saturating_sub(1)).sum();
    sum as f64 / (255.0 * pairs.max(1) as f64)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Stripes of a pixel each, black and white.
    fn striped() -> Crop {
        let (width, height) = (40, 80);
        let pixel = |n: u32| [if (n % width).is_multiple_of(2) { 0 } else { 255 }; 3];
        let rgb = (0..width * height).flat_map(pixel).collect();
        Crop { width, height, rgb, person: [10, 20, 20, 40] }
    }

    #[test]
    fn nobodys_face_is_known_but_clothes_are() {
        let mut crop = striped();
        crop.pixelate_faces();
        let grey = |columns: Range<u32>, row: u32| {
            columns.map(|column| crop.pixel(column, row).unwrap()[0]).collect::<Vec<_>>()
        };
        // The head, what is above and below it, and who stands on either side.
        let faces = [0, 10, 29, 60, 79].map(|row| grey(0..40, row));
        let beside = [grey(0..10, 30), grey(30..40, 59)];
        for shades in faces.iter().chain(&beside) {
            assert!(shades.iter().all(|shade| (85..=170).contains(shade)), "{shades:?}");
        }
        for row in [30, 59] {
            let clothes = grey(10..30, row);
            assert!(clothes.iter().all(|shade| [0, 255].contains(shade)), "{row}: {clothes:?}");
        }
    }

    #[test]
    fn a_picture_is_a_jpeg_of_that_size() {
        let picture = striped().into_picture(0.5, true).unwrap();
        let read = image::load_from_memory(&picture.jpeg).unwrap();
        assert_eq!((read.width(), read.height()), (40, 80));
        assert!(picture.looks.likeness(&striped().looks()) > 0.99);
    }

    /// As where a box reaches beyond its picture, or the picture is broken off.
    #[test]
    fn what_is_not_there_is_left_out() {
        let mut crop = Crop { person: [30, 0, 40, 200], ..striped() };
        crop.rgb.truncate(1000);
        crop.pixelate_faces();
        assert!(crop.clone().into_picture(1.0, false).is_none());
    }

    #[test]
    fn what_is_blurred_is_less_sharp() {
        let sharp: Vec<u8> = (0..64).map(|n| if n % 2 == 0 { 0 } else { 255 }).collect();
        let blurred: Vec<u8> = (0..64).map(|n| if n % 2 == 0 { 120 } else { 135 }).collect();
        assert_eq!(sharpness(&sharp, 8), 1.0);
        assert!(sharpness(&blurred, 8) < 0.1);
        assert_eq!((sharpness(&[], 0), sharpness(&[7; 9], 3)), (0.0, 0.0));
    }
}
