// SPDX-License-Identifier: MPL-2.0

//! What stays put in the picture while the world moves: a burned-in clock, a logo, dirt on the dome. It is not the known
//! background wherever the camera looks, and yet no mover.

use std::ops::Range;

use multiversion::multiversion;
use ptztrack_contract::Rect;

use crate::vision::Luma;

/// Widths of the picture by which the world must move past a pixel that stays the same: nobody walks along with the camera for
/// so long without a change.
const TRAVEL: f64 = 1.0;
/// Grey levels that a pixel may differ by from one picture to the next and stay the same: noise, and what the codec makes of
/// the world beside it.
const SAME: u8 = 12;
/// Belief from which a pixel is burned in, and what one change takes of it. The seconds of a clock change now and then; where
/// nothing is burned in, nearly every picture is a change.
const BURNED_IN: u8 = 128;
const CHANGE: u8 = 16;

/// How sure it is of each pixel of the picture that it stays put.
#[derive(Debug, Default)]
pub(super) struct BurnedIn {
    belief: Vec<u8>,
    last: Vec<u8>,
    /// Travel that is too little to count yet, in units of belief.
    rest: f64,
}

impl BurnedIn {
    /// Learns from the next picture, in which the world moved by `travel` pixels and `foreground` says what is not the known
    /// background. Nothing is learned in `held` (pixels): a camera that follows somebody keeps them where they are.
    pub fn update(&mut self, luma: &Luma, foreground: &[u8], travel: f64, held: Option<Rect>) {
        let width = luma.width();
        if self.last.len() != width * luma.height() {
            *self = Self { belief: vec![0; foreground.len()], last: luma.bytes().to_vec(), rest: 0.0 };
            return;
        }
        let gain = self.rest + f64::from(BURNED_IN) * travel / (TRAVEL * width as f64);
        self.rest = gain.fract();
        let gain = gain as u8;
        let rows = self.belief.chunks_exact_mut(width).zip(self.last.chunks_exact_mut(width));
        for (y, (belief, last)) in rows.enumerate() {
            let now = luma.row(y);
            let foreground = &foreground[y * width..][..width];
            let kept = held.map_or(0..0, |held| columns(held, y, width));
            for (part, gain) in [(0..kept.start, gain), (kept.clone(), 0), (kept.end..width, gain)] {
                let belief = &mut belief[part.clone()];
                learn(belief, &mut last[part.clone()], &now[part.clone()], &foreground[part], gain);
            }
        }
    }

    /// Takes what is burned in out of `foreground`.
    pub fn clear(&self, foreground: &mut [u8]) {
        clear(foreground, &self.belief);
    }
}

/// The columns of a row that lie in a box.
fn columns(bounds: Rect, row: usize, width: usize) -> Range<usize> {
    let rows = bounds.y..bounds.y + bounds.height;
    let column = |x: f64| (x.max(0.0) as usize).min(width);
    if !rows.contains(&(row as f64)) {
        return 0..0;
    }
    let start = column(bounds.x);
    // The box comes from whoever tracks, who may tell of one that has no width left in the picture.
    start..column(bounds.x + bounds.width).max(start)
}

#[multiversion(targets("x86_64+avx2"))]
fn learn(belief: &mut [u8], last: &mut [u8], now: &[u8], foreground: &[u8], gain: u8) {
    // As at rest, mostly: there is nothing to gain and nothing to lose.
    if gain == 0 && belief.iter().fold(0, |any, belief| any | belief) == 0 {
        return last.copy_from_slice(now);
    }
    for (belief, ((last, &now), &foreground)) in
        belief.iter_mut().zip(last.iter_mut().zip(now).zip(foreground))
    {
        let gain = if foreground > super::UNKNOWN { gain } else { 0 };
        // Both are always done, one of them with nothing: no branch, of which the compiler could make no vector code.
        let (gain, loss) = if now.abs_diff(*last) <= SAME { (gain, 0) } else { (0, CHANGE) };
        *belief = belief.saturating_add(gain).saturating_sub(loss);
        *last = now;
    }
}

#[multiversion(targets("x86_64+avx2"))]
fn clear(foreground: &mut [u8], belief: &[u8]) {
    for (foreground, &belief) in foreground.iter_mut().zip(belief) {
        *foreground = if belief >= BURNED_IN { 0 } else { *foreground };
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const SIZE: (usize, usize) = (160, 20);
    /// Pixels a picture.
    const TRAVELS: f64 = 4.0;

    /// What it makes of a picture of foreground all over, after so many of these pictures.
    fn after(pictures: usize, held: Option<Rect>, paint: impl Fn(usize, usize) -> u8) -> Vec<u8> {
        let mut burned_in = BurnedIn::default();
        let all = vec![255; SIZE.0 * SIZE.1];
        for picture in 0..pictures {
            let pixels: Vec<u8> = (0..all.len()).map(|index| paint(picture, index)).collect();
            burned_in.update(&Luma::packed(&pixels, SIZE.0), &all, TRAVELS, held);
        }
        let mut foreground = all;
        burned_in.clear(&mut foreground);
        foreground
    }

    fn logo(_: usize, index: usize) -> u8 {
        if index.is_multiple_of(3) { 250 } else { 20 }
    }

    #[test]
    fn a_logo_is_no_mover_once_the_world_has_passed_behind_it() {
        let pictures = (TRAVEL * SIZE.0 as f64 / TRAVELS) as usize;
        assert!(after(pictures - 5, None, logo).iter().all(|value| *value == 255), "too soon to say");
        assert!(after(pictures + 1, None, logo).iter().all(|value| *value == 0));
    }

    #[test]
    fn a_clock_that_changes_every_second_is_none_either() {
        let clock = |picture: usize, index: usize| logo(picture, index + picture / 25);
        assert!(after(99, None, clock).iter().all(|value| *value == 0));
    }

    #[test]
    fn whoever_walks_along_with_the_camera_is() {
        let strides = |picture: usize, index: usize| logo(picture, index + picture / 5);
        assert!(after(200, None, strides).iter().all(|value| *value == 255));
    }

    #[test]
    fn a_box_of_no_width_keeps_nothing() {
        let held = |width: f64| Some(Rect { x: 151.0, y: 5.0, width, height: 10.0 });
        for width in [0.0, -1e-3, -400.0] {
            assert!(after(99, held(width), logo).iter().all(|value| *value == 0), "{width}");
        }
    }

    #[test]
    fn the_target_is_kept_where_it_is_and_is_no_logo() {
        let held = Rect { x: 40.0, y: 5.0, width: 30.0, height: 10.0 };
        let foreground = after(200, Some(held), logo);
        let at = |x: usize, y: usize| foreground[y * SIZE.0 + x];
        assert_eq!([at(40, 5), at(69, 14)], [255; 2]);
        assert_eq!([at(39, 5), at(70, 14), at(40, 4), at(40, 15)], [0; 4]);
    }
}
