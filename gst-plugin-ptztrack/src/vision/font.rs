// SPDX-License-Identifier: MPL-2.0

//! OpenCV's letters, each drawn once.

use std::collections::HashMap;
use std::collections::hash_map::Entry;

use opencv::core::{Mat, Point, Rect, Scalar};
use opencv::imgproc;

use super::Spot;
use super::coverage::Coverage;

/// Height of a capital letter of the font at scale 1, in pixels.
const CAPITAL_HEIGHT: f64 = 21.0;
const FACE: i32 = imgproc::FONT_HERSHEY_SIMPLEX;
/// So many letters are measured to tell how wide one is to a part of a pixel.
const MEASURED: usize = 32;

/// Scale and stroke width for capitals of `height` pixels.
fn scale(height: f64) -> (f64, i32) {
    (height / CAPITAL_HEIGHT, ((height / 9.0).round() as i32).max(1))
}

/// How many pixels wide `text` is with capitals of `height` pixels.
pub fn text_width(text: &str, height: f64) -> opencv::Result<f64> {
    let (scale, width) = scale(height);
    Ok(f64::from(imgproc::get_text_size(text, FACE, scale, width, &mut 0)?.width))
}

/// Letters, by their size as well: a picture has labels of several.
#[derive(Debug, Default)]
pub(super) struct Font {
    glyphs: HashMap<(u8, u64), Glyph>,
}

/// A letter.
#[derive(Debug)]
struct Glyph {
    mask: Vec<u8>,
    width: usize,
    /// From its origin, the left end of the base line, to the right and down to the mask.
    offset: (i32, i32),
    /// From its origin to that of the next letter.
    advance: f64,
}

impl Font {
    /// Covers a line of text whose base line begins at `origin`, with capitals of `height` pixels. What is not ASCII
    /// becomes `?`.
    pub fn write(&mut self, text: &str, origin: Spot, height: f64, out: &mut Coverage) -> opencv::Result<()> {
        let (mut x, y) = (origin.x.round(), origin.y.round() as i32);
        for letter in text.chars() {
            let letter =
                u8::try_from(letter).ok().filter(|letter| (b' '..=b'~').contains(letter)).unwrap_or(b'?');
            let glyph = match self.glyphs.entry((letter, height.to_bits())) {
                Entry::Occupied(known) => known.into_mut(),
                Entry::Vacant(place) => place.insert(Glyph::drawn(letter, height)?),
            };
            let corner = (x.round() as i32 + glyph.offset.0, y + glyph.offset.1);
            out.add_mask(&glyph.mask, glyph.width, corner);
            x += glyph.advance;
        }
        Ok(())
    }
}

impl Glyph {
    fn drawn(letter: u8, height: f64) -> opencv::Result<Self> {
        let text = char::from(letter).to_string();
        let many = text_width(&text.repeat(MEASURED + 1), height)?;
        let advance = (many - text_width(&text, height)?) / MEASURED as f64;
        // Letters like `g` and `,` reach below the base line.
        let margin = (height * 0.5) as i32 + 2;
        let (rise, width) = (height.ceil() as i32, advance.ceil() as i32 + 2 * margin);
        let rows = rise + 2 * margin;
        let mut mask = vec![0; width as usize * rows as usize];
        let mut picture = Mat::new_rows_cols_with_bytes_mut::<u8>(rows, width, &mut mask)?;
        let (scale, stroke) = scale(height);
        let origin = Point::new(margin, margin + rise);
        let white = Scalar::all(255.0);
        imgproc::put_text(&mut picture, &text, origin, FACE, scale, white, stroke, imgproc::LINE_AA, false)?;
        // Of what is empty around it nothing need be drawn.
        let Rect { x, y, width: across, height: down } = imgproc::bounding_rect(&picture)?;
        drop(picture);
        let rows = mask.chunks_exact(width as usize).skip(y as usize).take(down as usize);
        let mask = rows.flat_map(|row| &row[x as usize..][..across as usize]).copied().collect();
        Ok(Self { mask, width: across as usize, offset: (x - margin, y - margin - rise), advance })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::vision::coverage::BARE;

    #[test]
    fn text_grows_with_its_height() {
        assert!(text_width("abc", 20.0).unwrap() > 1.8 * text_width("abc", 10.0).unwrap());
        assert!(text_width("", 20.0).unwrap() < 20.0);
    }

    #[test]
    fn letters_stand_where_opencv_puts_them() {
        let (text, height) = ("dx +0.10  dy -0.03", 19.0);
        let (width, rows) = (320, 60);
        let mut known = vec![0; (width * rows) as usize];
        let mut picture = Mat::new_rows_cols_with_bytes_mut::<u8>(rows, width, &mut known).unwrap();
        let (scale, stroke) = scale(height);
        let (origin, white) = (Point::new(12, 40), Scalar::all(255.0));
        imgproc::put_text(&mut picture, text, origin, FACE, scale, white, stroke, imgproc::LINE_AA, false)
            .unwrap();
        drop(picture);
        let mut coverage = Coverage::default();
        coverage.clear(Rect::new(0, 0, width, rows));
        Font::default().write(text, Spot { x: 12.0, y: 40.0 }, height, &mut coverage).unwrap();
        let sum = |pixels: &[u8]| pixels.iter().map(|pixel| f64::from(*pixel)).sum::<f64>();
        for (known, ours) in
            known.chunks_exact(width as usize).zip(coverage.bytes(BARE).chunks_exact(width as usize))
        {
            assert!((sum(known) - sum(ours)).abs() < 0.1 * sum(known) + 60.0);
        }
        // No letter lies a pixel or more beside its place: half of what is white is white in both.
        let both =
            known.iter().zip(coverage.bytes(BARE)).filter(|(known, ours)| **known > 128 && *ours > 128);
        assert!(both.count() * 2 > known.iter().filter(|known| **known > 128).count());
    }

    #[test]
    fn a_letter_is_drawn_once_for_each_size() {
        let (mut font, mut coverage) = (Font::default(), Coverage::default());
        coverage.clear(Rect::new(0, 0, 90, 40));
        for height in [15.0, 11.0, 15.0, 11.0] {
            font.write("123", Spot { x: 10.0, y: 30.0 }, height, &mut coverage).unwrap();
            let masks =
                |font: &Font| font.glyphs.values().map(|glyph| glyph.mask.as_ptr()).collect::<Vec<_>>();
            let before = masks(&font);
            font.write("31", Spot { x: 10.0, y: 30.0 }, height, &mut coverage).unwrap();
            assert_eq!(before, masks(&font));
        }
        assert_eq!(font.glyphs.len(), 6);
    }

    #[test]
    fn what_is_not_ascii_becomes_a_question_mark() {
        let written = |text: &str| {
            let mut coverage = Coverage::default();
            coverage.clear(Rect::new(0, 0, 40, 40));
            Font::default().write(text, Spot { x: 10.0, y: 30.0 }, 15.0, &mut coverage).unwrap();
            coverage.bytes(BARE)
        };
        assert_eq!(written("ü"), written("?"));
        assert_ne!(written("u"), written("?"));
    }
}
