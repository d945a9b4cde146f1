// SPDX-License-Identifier: MPL-2.0

//! Pictures without what is bright and narrow. By night rain and snow in the light of a camera are the brightest of all that is in the
//! picture, and every corner is one of theirs.

use opencv::core::{Mat, Size};
use opencv::imgproc;
use opencv::prelude::*;

use crate::vision::Luma;

/// What is narrower than this many pixels, and by more than so many grey levels brighter than what is on both sides, is taken out. What is
/// less so may be noise: that stays as it is, so that corners can be told from it.
const WIDTH: i32 = 5;
const BRIGHTER: u8 = 12;

/// A grey opening along the rows, where it is called for.
#[derive(Debug, Default)]
pub(super) struct Opening {
    is_called_for: bool,
    /// Memory.
    opened: Mat,
    pixels: Vec<u8>,
}

impl Opening {
    /// Whether pictures are opened.
    pub fn is_called_for(&self) -> bool {
        self.is_called_for
    }

    /// Says whether pictures are opened from now on.
    pub fn call_for(&mut self, is_called_for: bool) {
        self.is_called_for = is_called_for;
    }

    /// The picture as it is to be looked at.
    pub fn apply<'a>(&'a mut self, picture: &Luma<'a>) -> opencv::Result<Luma<'a>> {
        if !self.is_called_for {
            return Ok(*picture);
        }
        let element = imgproc::get_structuring_element_def(imgproc::MORPH_RECT, Size::new(WIDTH, 1))?;
        picture.with_mat(|picture| {
            imgproc::morphology_ex_def(picture, &mut self.opened, imgproc::MORPH_OPEN, &element)
        })?;
        let rows = self.opened.data_bytes()?.chunks_exact(picture.width()).enumerate();
        self.pixels.clear();
        self.pixels.extend(rows.flat_map(|(y, opened)| {
            let pixels = picture.row(y).iter().zip(opened);
            pixels.map(|(&seen, &opened)| if seen.saturating_sub(opened) > BRIGHTER { opened } else { seen })
        }));
        Ok(Luma::packed(&self.pixels, picture.width()))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_bright_and_narrow_goes_where_that_is_called_for() {
        let row = [20, 20, 90, 90, 20, 20, 20, 90, 90, 90, 90, 90, 20, 20, 5, 20, 25, 20];
        let picture = Luma::packed(&row, row.len());
        let mut opening = Opening::default();
        assert_eq!(opening.apply(&picture).unwrap().row(0), row);
        opening.call_for(true);
        let opened = opening.apply(&picture).unwrap().row(0).to_vec();
        assert_eq!(opened, [20, 20, 20, 20, 20, 20, 20, 90, 90, 90, 90, 90, 20, 20, 5, 20, 25, 20]);
        opening.call_for(false);
        assert_eq!(opening.apply(&picture).unwrap().row(0), row);
    }
}
